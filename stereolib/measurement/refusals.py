"""Why what was followed in both pictures is no upright box on the floor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from stereolib.base import Float64
from stereolib.measurement.agreement import Samples
from stereolib.measurement.box import Edge, Shared, Side, World
from stereolib.measurement.edges import SHARP_PX, Peak
from stereolib.measurement.edges_beyond import uprights_below
from stereolib.measurement.follow import Stretch
from stereolib.measurement.reasons import Reason, Why
from stereolib.measurement.scene_solver import Solution
from stereolib.measurement.views import Views

_SURE_STDS, _EDGE_PX = 3.0, 4.0  # of an extent: less may be none; and what is so wide may be an edge
_GAP_MM, _GAP_PX = 6.0, 4.0  # so far above the floor a face may end for want of texture, and for a pixel's size
_BELOW, _PLAIN_SLOPE = 8, 0.6  # samples between a face's end and the floor; grey levels per px, of a surface's texture
_LEANING_RAD = np.radians(1.5)
_LEANING_ASIDE_RAD = np.radians(3.0)
_SURE = 4.0  # standard deviations
_GO_ON = 3.0  # logarithm of the odds that upright edges go on to the floor, from which on a face stands there


def why_it_stands_not(views: Views, world: World, stretch: Stretch, own: Float64, shown: Sequence[Edge]) -> Why | None:
    """Why a face does not stand on the floor.

    Parameters
    ----------
    views : Views
    world : World
        One, real.
    stretch : Stretch
        The face, as it was followed.
    own : (8,) float64
        The box, in the order of `Own`.
    shown : sequence of Edge
        Those that the pictures show.

    Returns
    -------
    Why or None
        Its foot is cut by the picture, or it ends above the floor, and so do its upright edges.
    """
    ends = [side.end for side in Side if side.end in shown]
    return _cut_below(stretch) or _in_the_air(views, world, stretch, own, ends)


def why_it_is_no_box(
    stretch: Stretch,
    tilts: Sequence[tuple[float, float]],
    shown: Sequence[Edge],
    peaks: Mapping[Edge, Peak],
    solution: Solution,
) -> Why | None:
    """Why a face that stands on the floor is none of an upright box.

    Parameters
    ----------
    stretch : Stretch
        The face, as it was followed.
    tilts : sequence of (float, float), rad
        Of each face that was aligned, and its standard deviation.
    shown : sequence of Edge
        Those that the pictures show.
    peaks : Mapping of Peak
        Those that were located.
    solution : Solution
        Of this box alone.

    Returns
    -------
    Why or None
        It leans, or was matched nowhere, or is no wider than an edge, or nothing of its outline stands out.
    """
    stands = _edges_stand(peaks) or _faces_stand(tilts)
    leans = _leaning(stretch, tilts, stands=stands)
    narrow = _unfollowed(stretch) or _too_narrow(stretch, shown, solution)
    return leans or narrow or _without_edges(shown, peaks, stands=stands)


def _unfollowed(stretch: Stretch) -> Why | None:
    """A face about which both pictures agree nowhere."""
    nowhere = stretch.high.at - stretch.low_mm < _GAP_PX * stretch.mm_per_px
    return Why(Reason.NO_TEXTURE) if nowhere else None


def _too_narrow(stretch: Stretch, shown: Sequence[Edge], solution: Solution) -> Why | None:
    """Faces none of which is surely wider than an edge: that was matched, the faces are too plain."""
    own, std = solution.boxes[0], np.sqrt(np.diag(solution.covariance))[len(Shared) :]
    ended = [side.extent for side in Side if side.end in shown]
    narrow = [own[extent] < _SURE_STDS * std[extent] + _EDGE_PX * stretch.mm_per_px for extent in ended]
    return Why(Reason.NO_TEXTURE) if ended and all(narrow) else None


def _gap_mm(stretch: Stretch) -> float:
    """A face that ends so far above the floor may stand in the air."""
    return _GAP_MM + _GAP_PX * stretch.mm_per_px


def _cut_below(stretch: Stretch) -> Why | None:
    """A face whose foot the pictures do not show."""
    return Why(Reason.FOOT_CUT) if stretch.is_cut_below and stretch.foot_mm >= _gap_mm(stretch) else None


def _in_the_air(views: Views, world: World, stretch: Stretch, own: Float64, ends: Sequence[Edge]) -> Why | None:
    """A face that ends above the floor, and nothing nearer hides its foot."""
    if stretch.foot_mm < _gap_mm(stretch) or _unfollowed(stretch):
        return None
    upright = uprights_below(views.pair.pictures, world, own, ends, stretch.foot_mm)
    if upright and upright[0] < _gap_mm(stretch) and upright[1] > _GO_ON:
        return None
    along = np.linspace(stretch.left.at, stretch.right.at, 2 * _BELOW + 1)[1:-1]
    below = np.array([
        [[*stretch.line.at(t), height] for t in along] for height in np.linspace(0.2, 0.8, _BELOW) * stretch.foot_mm
    ])  # fmt: skip
    there = Samples.of(views, world, below)
    if there.inside.any() and float(np.median(np.abs(there.slope[there.inside]))) < _PLAIN_SLOPE:
        return Why(Reason.IN_THE_AIR, f"it shows no texture between {stretch.foot_mm:.0f} mm of height and the floor")
    return Why(Reason.IN_THE_AIR, f"its face ends {stretch.foot_mm:.0f} mm above the floor")


def _leaning(stretch: Stretch, tilts: Sequence[tuple[float, float]], *, stands: bool) -> Why | None:
    """Faces that are not upright (tilts with their deviations, rad), or whose ends are turned."""
    for tilt, std in tilts:
        if abs(tilt) > _LEANING_RAD + _SURE * std:
            return Why(Reason.LEANS, f"tilted by {np.degrees(abs(tilt)):.0f} degrees")
    lean, unfooted = abs(stretch.lean_rad), stretch.low_mm > _gap_mm(stretch)
    if lean > _LEANING_ASIDE_RAD + (1.0 if unfooted else _SURE) * stretch.lean_std_rad and not stands:
        return Why(Reason.LEANS, f"tilted to the side by about {np.degrees(lean):.0f} degrees")
    return None


def _without_edges(shown: Sequence[Edge], peaks: Mapping[Edge, Peak], *, stands: bool) -> Why | None:
    """Nothing of its outline stands out: what was followed may be any part of it; or nothing upright does."""
    outer = [edge for edge in shown if edge is not Edge.CORNER]
    if outer and not any(edge in peaks for edge in outer):
        return Why(Reason.NO_EDGE)
    may_lean = any(edge.upright for edge in shown) and not stands
    return Why(Reason.MAY_LEAN, "no upright edge of it stands out") if may_lean else None


def _faces_stand(tilts: Sequence[tuple[float, float]]) -> bool:
    """Two faces were seen, and neither is tilted: what stands at the edge where they meet does not lean to any side."""
    return len(tilts) > 1 and all(abs(tilt) + _SURE * std < _LEANING_ASIDE_RAD for tilt, std in tilts)


def _edges_stand(peaks: Mapping[Edge, Peak]) -> bool:
    """Upright edges were seen all along their lines, together as well as a sharp one."""
    return sum(peak.std_px**-2 for edge, peak in peaks.items() if edge.upright) > SHARP_PX**-2
