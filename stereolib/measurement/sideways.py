"""How far a face goes on sideways: as both pictures show it, and as far as it stands on the floor."""

from __future__ import annotations

import numpy as np

from stereolib.base import Float64
from stereolib.measurement.agreement import Agreement, Look, Past, Reach, agreement
from stereolib.measurement.box import World
from stereolib.measurement.views import Views

_SAMPLES = 16  # of each line
_SIDEWAYS = (0.12, 0.88)  # shares of the height between which a face is followed sideways
_FOOT, _FOOT_SAMPLES = (0.02, 0.12), 6  # between which the floor beside a foot is seen
_FOOT_PX = 12  # by so much a face may go on beyond where its foot does
_PLAIN_LINES = 8  # more of them, that say nothing, and its foot is looked at
_PLAIN_SHARE = 0.5  # of these px, at least, say nothing then


def heights_aside(low_mm: float, high_mm: float) -> Float64:
    """Heights at which a face is compared sideways, mm."""
    return low_mm + (high_mm - low_mm) * np.linspace(*_SIDEWAYS, _SAMPLES)


def upright(ground: Float64, heights: Float64) -> Float64:
    """Points (..., heights, 3) over points of the floor (..., 2)."""
    points = np.empty((*ground.shape[:-1], len(heights), 3))
    points[..., :2], points[..., 2] = ground[..., None, :], heights
    return points


def reach_aside(
    views: Views, world: World, points_mm: Float64, along: Agreement, known: int, look: Look = Look.FIRST
) -> Reach:
    """Follow a face sideways.

    Parameters
    ----------
    views : Views
    world : World
        One, real.
    points_mm : (lines, samples, 3) float64
        Upright lines on the face and beyond, a pixel apart, outwards, each from below.
    along : Agreement
        Along these.
    known : int
        So many lines from the first on lie on the face, mostly.
    look : Look

    Returns
    -------
    Reach

    Notes
    -----
    Where all is plain beside a face, pictures and map say nothing of where it ends; but beside its foot the floor
    shows, which is seldom plain: it goes no more than 12 px beyond where its foot does.
    """
    reach = along.reach(known, look, aside=True)
    plain = ~along.shows(known, look)[: reach.stop]
    if reach.past is Past.HIDDEN or np.count_nonzero(plain) <= _PLAIN_LINES:
        return reach
    top_mm = points_mm[0, -1, 2] / _SIDEWAYS[1]
    low = upright(points_mm[:, 0, :2], top_mm * np.linspace(*_FOOT, _FOOT_SAMPLES))
    foot = agreement(views, world, low).reach(known, look)
    limit = foot.stop + _FOOT_PX
    if foot.past is not Past.OPEN or limit >= reach.stop or plain[foot.stop : limit].mean() < _PLAIN_SHARE:
        return reach
    return along.part(slice(limit)).reach(known, look, aside=True)
