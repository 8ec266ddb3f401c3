"""Upright faces of objects in a disparity map: planes, straight lines in inverse distance over the bearing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolib.measurement.floor import Floor
from stereolib.measurement.plane_alignment import AlignedPair, CannotMeasure, align, cell_of, clustered_covariance
from stereolib.measurement.regions import Region, rays

Array = np.ndarray
_BIN = 1.5  # px: width of a bin of bearing


@dataclass(frozen=True, eq=False)
class Face:
    """An upright face: ``1 / forward distance = a + b t``, t the tangent of the bearing (left positive).

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

    line: Array
    covariance: Array
    bearing: tuple[float, float]
    pixels: int

    def points_mm(self, t: Array | float) -> Array:
        """Points of the face on the floor, (..., 2) mm: forward and left of the camera."""
        forward = 1 / (self.line[0] + self.line[1] * np.asarray(t, float))
        return np.stack([forward, forward * t], axis=-1)


def find_faces(floor: Floor, region: Region, pair: AlignedPair | None = None, *, least: int = 60) -> tuple[Face, ...]:
    """One or two upright faces: the inverse distance is one straight line over the tangent of the bearing, or two.

    Parameters are those of `measure_height`. Raises CannotMeasure "no texture".
    """
    scale = floor.rectified.f_px * floor.rectified.baseline_mm
    upright = region.height_mm < 0.85 * region.top_mm  # what is higher may be the top face
    u, v, d = (a[upright] for a in (region.u, region.v, region.disparity_px))
    if len(d) < least:
        raise CannotMeasure("no texture", f"only {len(d)} pixels of the object were matched; light or texture it")
    ahead, aside = rays(floor, u, v)
    t, w_px = aside / ahead, d / ahead
    width = _BIN / floor.rectified.f_px
    index = ((t - t.min()) / width).astype(int)
    n, total = np.bincount(index), np.bincount(index, w_px)
    for _ in range(2):
        keep = np.abs(w_px - (total / np.maximum(n, 1))[index]) < 1.5
        n, total = np.bincount(index, keep), np.bincount(index, w_px * keep)
    full = np.flatnonzero(n > 0.2 * np.sort(n)[int(0.8 * len(n))])
    pieces = _hinge(t.min() + (full + 0.5) * width, total[full] / n[full])
    faces = []
    for (low, high), line in pieces:
        margin = min(3 * width, (high - low) / 6)
        mine = (t > low + margin) & (t < high - margin) & (np.abs(d - ahead * (line[0] + line[1] * t)) < 1.0)
        pixels = int(np.count_nonzero(mine))
        if pixels < least:
            continue  # a sliver: the other face carries the measurement
        um, vm, dm, xm = u[mine], v[mine], d[mine], scale * np.stack([ahead[mine], aside[mine]]).T
        line = np.linalg.solve(xm.T @ xm, xm.T @ dm)
        if pair is None:
            covariance = clustered_covariance(xm, dm - xm @ line, np.ones(pixels), cell_of(um, vm))
        else:
            fit = align(pair, um, vm, xm, line)
            line, covariance = fit.parameters, fit.covariance
        faces.append(Face(line, covariance, (float(low), float(high)), pixels))
    if not faces:
        raise CannotMeasure(
            "no texture", f"no face of the object has {least} matched pixels that agree; light or texture it"
        )
    return tuple(faces)


def _hinge(t: Array, w: Array) -> list[tuple[tuple[float, float], Array]]:
    """Split w(t) into one straight line or two that meet in a ridge: their ranges and (a, b), w in px."""
    moments = np.stack([np.ones_like(t), t, w, t * t, t * w, w * w])
    sums = np.concatenate([np.zeros((6, 1)), moments.cumsum(axis=1)], axis=1)

    def fit(part: Array) -> tuple[Array, Array, Array]:
        n, st, sw, stt, stw, sww = part
        n = np.maximum(n, 1)
        ctt, ctw, cww = stt - st * st / n, stw - st * sw / n, sww - sw * sw / n
        b = ctw / np.maximum(ctt, 1e-12)
        return (sw - b * st) / n, b, np.maximum(cww - b * ctw, 0)

    a, b, rest = fit(sums[:, -1])
    one = [((t[0], t[-1]), np.array([a, b]))]
    least = 5
    if len(t) < 3 * least:
        return one
    knots = np.arange(least, len(t) - least)
    al, bl, rl = fit(sums[:, knots])
    ar, br, rr = fit(sums[:, -1:] - sums[:, knots])
    k = int((rl + rr).argmin())
    if not (rl[k] + rr[k] < 0.5 * rest and bl[k] > br[k]):
        return one
    crossing = float(np.clip((ar[k] - al[k]) / (bl[k] - br[k]), t[0], t[-1]))
    return [((t[0], crossing), np.array([al[k], bl[k]])), ((crossing, t[-1]), np.array([ar[k], br[k]]))]
