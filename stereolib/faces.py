"""Upright faces of objects in a disparity map: planes, straight lines in inverse distance over the bearing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolib.alignment import AlignedPair, CannotMeasure, align, cell_of, clustered_covariance
from stereolib.floor import Floor, scaled_pixels
from stereolib.ground_objects import Region, bearing_of

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
    top = np.percentile(region.height_mm, 97)
    upright = region.height_mm < 0.85 * top  # what is higher may be the top face
    u, v, d = (a[upright] for a in (region.u, region.v, region.disparity_px))
    if len(d) < least:
        raise CannotMeasure("no texture", f"only {len(d)} pixels of the object were matched; light or texture it")
    t, w = bearing_of(floor, u, v, d)
    width = _BIN / floor.rectified.f_px
    index = np.floor((t - t.min()) / width).astype(int)
    n = np.bincount(index).astype(float)
    mean = np.bincount(index, w) / np.maximum(n, 1)
    for _ in range(2):
        keep = np.abs(w - mean[index]) * scale < 1.5
        n = np.bincount(index[keep], minlength=len(n)).astype(float)
        mean = np.bincount(index[keep], w[keep], len(n)) / np.maximum(n, 1)
    full = np.flatnonzero(n > 0.2 * np.percentile(n, 80))
    centre, mean = t.min() + (full + 0.5) * width, mean[full]
    pieces = _hinge(centre, mean * scale)
    ray = scaled_pixels(u, v, floor.rectified) @ floor.axes[:2].T
    faces = []
    for (low, high), line in pieces:
        margin = min(3 * width, (high - low) / 6)
        mine = (t > low + margin) & (t < high - margin) & (np.abs(d - ray @ line) < 1.0)
        if mine.sum() < least:
            continue  # a sliver: the other face carries the measurement
        um, vm, xm = u[mine], v[mine], scale * ray[mine]
        line = np.linalg.lstsq(xm, d[mine], rcond=None)[0]
        covariance = clustered_covariance(xm, d[mine] - xm @ line, np.ones(len(um)), cell_of(um, vm))
        if pair is not None:
            fit = align(pair, um, vm, xm, line)
            line, covariance = fit.parameters, fit.covariance
        faces.append(Face(line, covariance, (float(low), float(high)), int(mine.sum())))
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
