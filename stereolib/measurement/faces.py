"""Faces of an object: the upright one found in its disparities, others predicted, aligned over both pictures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from stereolib.base import Float64, Ints
from stereolib.measurement.box import Box, Level, Side, Surface, World
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
_GAP_BINS = 8  # what lies beyond so many empty ones is something else, though it may lie on the same line
_INNER = (0.06, 0.94)  # shares of its sides between which a surface is aligned: no edge is in it
_STEP_PX = 3.0  # of disparity: two faces of a box meet
_BETTER = 0.5  # two lines must leave less than this share of what one leaves


@dataclass(frozen=True, eq=False)
class Face:
    """A face of an object: a plane of disparities, ``coefficients @ (u - u0, v - v0, 1)``.

    Attributes
    ----------
    centre_px : (2,) float64
        (u0, v0), the middle of its pixels.
    coefficients : (3,) float64
        px per px, px per px, px.
    plane_covariance : (3, 3) float64
        Of `coefficients`.
    bearing : (t_right, t_left)
        Tangents of the bearings between which it was seen.
    pixels : int
        Pixels it was fitted to.
    """

    centre_px: Float64
    coefficients: Float64
    plane_covariance: Float64
    bearing: tuple[float, float]
    pixels: int


def find_face(floor: Floor, region: ObjectRegion, pair: AlignedPair) -> Face:
    """Find the upright face of an object that shows most, and align both pictures over it.

    Parameters
    ----------
    floor : Floor
    region : ObjectRegion
        Its disparities say where the faces lie.
    pair : AlignedPair
        Aligned over the face, to a few hundredths of a pixel.

    Returns
    -------
    Face

    Raises
    ------
    CannotMeasure
        "no texture", if too few pixels were matched, or the pictures show nothing to align.

    Notes
    -----
    Over the tangent t of the bearing (left positive) an upright face's inverse forward distance is a straight line,
    ``1 / x = a + b t``; two faces that meet in a near corner are two lines with a ridge. The face is aligned with these
    two coefficients first, then with three, so that a face that leans is seen to.
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
    full = _unbroken(np.flatnonzero(n > _FULL * np.sort(n)[int(0.8 * len(n))]), n)
    pieces = _hinge(t.min() + (full + 0.5) * width, total[full] / n[full], n[full])
    parts = []
    for (low, high), line in pieces:
        margin = min(3 * width, (high - low) / 6)
        parts.append((t > low + margin) & (t < high - margin) & (np.abs(d - ahead * (line[0] + line[1] * t)) < _ON_PX))
    counts = [int(np.count_nonzero(part)) for part in parts]
    best = int(np.argmax(counts))
    if counts[best] < LEAST_PIXELS:
        text = f"no face of the object has {LEAST_PIXELS} matched pixels that agree; light or texture it"
        raise CannotMeasure("no texture", text)
    (low, high), mine = pieces[best][0], parts[best]
    um, vm, rays = u[mine], v[mine], np.stack([ahead[mine], aside[mine]]).T
    level = align(pair, um, vm, scale * rays, np.linalg.solve(rays.T @ rays, rays.T @ d[mine]) / scale)
    centre, x = _about_centre(um, vm)
    start = np.linalg.lstsq(x, scale * rays @ level.parameters, rcond=None)[0]
    fit = align(pair, um, vm, x, start.astype(float))
    return Face(centre, fit.parameters, fit.covariance, (float(low), float(high)), counts[best])


def align_surface(pair: AlignedPair, world: World, own: Float64, surface: Surface) -> list[Face]:
    """Align both pictures over a face that was predicted, or over the top.

    Parameters
    ----------
    pair : AlignedPair
    world : World
        One, real.
    own : (8,) float64
        The box, in the order of `Own`.
    surface : Surface

    Returns
    -------
    list of Face
        One, without its bearing; or none where they show nothing to align.
    """
    box, (low, high) = Box(own), _INNER
    across = [0, 1] if surface is Level.TOP else [0 if surface is Side.RIGHT else 1, 2]
    shares = np.full((4, 3), 1.0 if surface is Level.TOP else 0.0)
    shares[:, across] = [[low, low], [high, low], [high, high], [low, high]]
    quad = world.pixels(box.points(shares))
    height, width = pair.pictures[0].shape[:2]
    first, last = (
        np.clip(np.rint(end), 0, (width, height)).astype(int) for end in (quad.min(axis=0), quad.max(axis=0) + 1)
    )
    mask = np.zeros(np.maximum(last - first, 0)[::-1], np.uint8)
    if mask.size < LEAST_PIXELS:
        return []
    cv2.fillConvexPoly(mask, np.rint(quad).astype(np.int32) - first.astype(np.int32), 1)
    row, column = np.nonzero(mask)
    u, v = ((a + start).astype(float) for a, start in zip((column, row), first, strict=True))
    if len(u) < LEAST_PIXELS:
        return []
    plane, (centre, x) = world.disparity_plane(*box.plane(surface)), _about_centre(u, v)
    try:
        fit = align(pair, u, v, x, np.array([plane[0], plane[1], plane[:2] @ centre + plane[2]]))
    except CannotMeasure:
        return []
    return [Face(centre, fit.parameters, fit.covariance, (np.nan, np.nan), len(u))]


def _about_centre(u: Float64, v: Float64) -> tuple[Float64, Float64]:
    """Middle of some pixels (2,), and what a plane's coefficients about it are multiplied by (N, 3)."""
    centre = np.array([u.mean(), v.mean()])
    return centre, np.stack([u - centre[0], v - centre[1], np.ones_like(u)]).T


def _unbroken(full: Ints, n: Ints | Float64) -> Ints:
    """The part of the full bins that has no gap and the most pixels."""
    parts = np.split(full, np.flatnonzero(np.diff(full) > _GAP_BINS) + 1)
    return max(parts, key=lambda part: int(n[part].sum()))


class _Split(NamedTuple):
    """Two straight lines ``w = a + b t``, the first one up to a bin; and whether they fit far better than one."""

    bins: int
    first: Float64
    second: Float64
    is_better: bool

    def step_px(self, t: Float64) -> float:
        """By how much the second one is higher than the first where they are parted."""
        middle = float(t[self.bins - 1 : self.bins + 1].mean())
        return float((self.second - self.first) @ [1.0, middle])


def _hinge(t: Float64, w: Float64, n: Ints | Float64) -> list[tuple[tuple[float, float], Float64]]:
    """Split w(t) into one straight line or two that meet in a ridge: their ranges and (a, b), w in px.

    What lies behind a step is another thing, or what was matched beside an outline: of n pixels the part with more is
    taken.
    """
    t, w, n = _without_steps(t, w, n)
    split = _split(t, w)
    if split is not None and split.is_better:
        sides = (slice(split.bins), slice(split.bins, None))
        (left, right) = (_without_steps(t[side], w[side], n[side]) for side in sides)
        (al, bl), (ar, br) = first, second = _line(*left[:2]), _line(*right[:2])
        if bl > br:
            low, high = float(left[0][0]), float(right[0][-1])
            crossing = float(np.clip((ar - al) / (bl - br), low, high))
            return [((low, crossing), first), ((crossing, high), second)]
    return [((float(t[0]), float(t[-1])), _line(t, w))]


def _without_steps(t: Float64, w: Float64, n: Ints | Float64) -> tuple[Float64, Float64, Ints | Float64]:
    """Without what lies behind steps."""
    while (split := _split(t, w)) is not None and split.is_better and abs(split.step_px(t)) > _STEP_PX:
        k = split.bins
        part = slice(k) if n[:k].sum() > n[k:].sum() else slice(k, None)
        t, w, n = t[part], w[part], n[part]
    return t, w, n


def _line(t: Float64, w: Float64) -> Float64:
    """The straight line through w(t): (a, b)."""
    return np.asarray(_lines(_moments(t, w).sum(axis=1))[0])


def _split(t: Float64, w: Float64) -> _Split | None:
    """The two lines that fit best; None where there are too few bins."""
    if len(t) < 3 * _LEAST_BINS:
        return None
    sums = np.concatenate([np.zeros((6, 1)), _moments(t, w).cumsum(axis=1)], axis=1)
    knots = np.arange(_LEAST_BINS, len(t) - _LEAST_BINS)
    first, rest_first = _lines(sums[:, knots])
    second, rest_second = _lines(sums[:, -1:] - sums[:, knots])
    rest, one = rest_first + rest_second, _lines(sums[:, -1])[1]
    k = int(rest.argmin())
    return _Split(int(knots[k]), first[:, k], second[:, k], bool(rest[k] < _BETTER * one))


def _moments(t: Float64, w: Float64) -> Float64:
    return np.stack([np.ones_like(t), t, w, t * t, t * w, w * w])


def _lines(moments: Float64) -> tuple[Float64, Float64]:
    """Straight lines (a, b) through points, by their sums of moments (6, ...), and what they leave: squared, px2."""
    n, st, sw, stt, stw, sww = moments
    n = np.maximum(n, 1)
    ctt, ctw, cww = stt - st * st / n, stw - st * sw / n, sww - sw * sw / n
    b = ctw / np.maximum(ctt, 1e-12)
    return np.array([(sw - b * st) / n, b]), np.maximum(cww - b * ctw, 0)
