"""Upright faces of objects in a disparity map: planes, straight lines in inverse distance over the bearing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolib.base import Float64
from stereolib.measurement.floor import Floor
from stereolib.measurement.plane_alignment import AlignedPair, CannotMeasure, align
from stereolib.measurement.regions import ObjectRegion

LEAST_PIXELS = 60  # matched pixels that a face needs
_BIN_PX = 1.5  # width of a bin of bearing
_SIDES = 0.85  # of the rough top: what is higher may be the top face
_SCATTER_PX = 1.5  # a disparity so far off its bin's mean is a wrong match
_ON_PX = 1.0  # and so far off the face's line it is not of the face
_FULL = 0.2  # a bin counts if it holds so much of what the fuller ones hold
_LEAST_BINS = 5  # on either side of a corner
_BETTER = 0.5  # two lines must leave less than this share of what one leaves


@dataclass(frozen=True, eq=False)
class Face:
    """An upright face of an object: ``1 / forward distance = a + b t``, t the tangent of the bearing (left positive).

    Attributes
    ----------
    line : (a, b)
        1/mm.
    covariance : (2, 2) float64
    bearing : (t_right, t_left)
        Tangents between which it was seen.
    pixels : int
        Pixels it was fitted to.
    """

    line: Float64
    covariance: Float64
    bearing: tuple[float, float]
    pixels: int

    def points_mm(self, t: Float64 | float) -> Float64:
        """Points of the face on the floor.

        Parameters
        ----------
        t : float or (...) float64
            Tangents of their bearings.

        Returns
        -------
        (..., 2) float64, mm
            Forward and left of the camera.

        Examples
        --------
        >>> Face(np.array([1 / 500, 0.0]), np.zeros((2, 2)), (-0.1, 0.1), 900).points_mm(0.1).round(6)
        array([500.,  50.])
        """
        forward = 1 / (self.line[0] + self.line[1] * np.asarray(t, float))
        return np.stack([forward, forward * t], axis=-1)


def find_faces(floor: Floor, region: ObjectRegion, pair: AlignedPair) -> tuple[Face, ...]:
    """Find one or two upright faces: the inverse distance is one straight line over the tangent of the bearing, or two.

    Parameters
    ----------
    floor : Floor
    region : ObjectRegion
        Its disparities say where the faces lie.
    pair : AlignedPair
        Aligned over each face, to a few hundredths of a pixel.

    Returns
    -------
    tuple of Face
        From right to left.

    Raises
    ------
    CannotMeasure
        "no texture", if too few pixels were matched, or the pictures show nothing to align.
    """
    scale = floor.rectified.f_px * floor.rectified.baseline_mm
    upright = region.height_mm < _SIDES * region.top_mm
    u, v, d = (a[upright] for a in (region.u, region.v, region.disparity_px))
    if len(d) < LEAST_PIXELS:
        raise CannotMeasure("no texture", f"only {len(d)} pixels of the object were matched; light or texture it")
    ahead, aside = floor.rays(u, v)
    t, w_px = aside / ahead, d / ahead
    width = _BIN_PX / floor.rectified.f_px
    index = ((t - t.min()) / width).astype(int)
    n, total = np.bincount(index), np.bincount(index, w_px)
    for _ in range(2):
        keep = np.abs(w_px - (total / np.maximum(n, 1))[index]) < _SCATTER_PX
        n, total = np.bincount(index, keep), np.bincount(index, w_px * keep)
    full = np.flatnonzero(n > _FULL * np.sort(n)[int(0.8 * len(n))])
    pieces = _hinge(t.min() + (full + 0.5) * width, total[full] / n[full])
    faces = []
    for (low, high), line in pieces:
        margin = min(3 * width, (high - low) / 6)
        mine = (t > low + margin) & (t < high - margin) & (np.abs(d - ahead * (line[0] + line[1] * t)) < _ON_PX)
        pixels = int(np.count_nonzero(mine))
        if pixels < LEAST_PIXELS:
            continue  # a sliver: the other face carries the measurement
        um, vm, dm, xm = u[mine], v[mine], d[mine], scale * np.stack([ahead[mine], aside[mine]]).T
        fit = align(pair, um, vm, xm, np.linalg.solve(xm.T @ xm, xm.T @ dm))
        faces.append(Face(fit.parameters, fit.covariance, (float(low), float(high)), pixels))
    if not faces:
        text = f"no face of the object has {LEAST_PIXELS} matched pixels that agree; light or texture it"
        raise CannotMeasure("no texture", text)
    return tuple(faces)


def _hinge(t: Float64, w: Float64) -> list[tuple[tuple[float, float], Float64]]:
    """Split w(t) into one straight line or two that meet in a ridge: their ranges and (a, b), w in px."""
    moments = np.stack([np.ones_like(t), t, w, t * t, t * w, w * w])
    sums = np.concatenate([np.zeros((6, 1)), moments.cumsum(axis=1)], axis=1)

    def fit(part: Float64) -> tuple[Float64, Float64, Float64]:
        n, st, sw, stt, stw, sww = part
        n = np.maximum(n, 1)
        ctt, ctw, cww = stt - st * st / n, stw - st * sw / n, sww - sw * sw / n
        b = ctw / np.maximum(ctt, 1e-12)
        return (sw - b * st) / n, b, np.maximum(cww - b * ctw, 0)

    a, b, rest = fit(sums[:, -1])
    one = [((t[0], t[-1]), np.array([a, b]))]
    if len(t) < 3 * _LEAST_BINS:
        return one
    knots = np.arange(_LEAST_BINS, len(t) - _LEAST_BINS)
    al, bl, rl = fit(sums[:, knots])
    ar, br, rr = fit(sums[:, -1:] - sums[:, knots])
    k = int((rl + rr).argmin())
    if not (rl[k] + rr[k] < _BETTER * rest and bl[k] > br[k]):
        return one
    crossing = float(np.clip((ar[k] - al[k]) / (bl[k] - br[k]), t[0], t[-1]))
    return [((t[0], crossing), np.array([al[k], bl[k]])), ((crossing, t[-1]), np.array([ar[k], br[k]]))]
