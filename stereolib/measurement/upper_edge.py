"""Where the upper edge of a face ends: a line printed on the face ends it in no picture, its upper edge goes on."""

from __future__ import annotations

import numpy as np

from stereolib.base import Float32, Float64, UInt8
from stereolib.measurement.box import Box, Own, Side, World
from stereolib.measurement.edges import Light, light_at

_BESIDE_PX = np.arange(-6.0, 6.5, 0.5)  # across the edge
_STEPS = 3  # of half a pixel: points that are compared across an edge are so far apart, the width of a webcam's edge
_AT, _PLAIN = 0.6, 2.5  # so near lies the edge, px, and from there on what is beside it
_SURE = (0.1, 0.8)  # shares of the extent as it is known: there it is the face's
_BEYOND_PX, _LEAST_PX = 160.0, 8.0  # looked at beyond the known end; and so long at least is what is known
_STANDS_OUT = 2.0  # the edge's strength over that of what is beside it: less tells nothing
_MOST, _SHARE = 1.0, 0.5  # odds of one pixel, at most, as a logarithm; neighbours tell half the same
_FARTHEST_MM, _AHEAD_MM = 1200.0, 1.0
_LEAST = 1e-3


def upper_edge_beyond(light: Light, world: World, own: Float64, side: Side) -> tuple[float, float] | None:
    """Whether the upper edge of a face goes straight on beyond the end that it is taken to have.

    Parameters
    ----------
    light : (left, right), each (H, W, 3) or (H, W) float32
        Rectified pictures as light.
    world : World
        One, real.
    own : (8,) float64
        The box, in the order of `Own`.
    side : Side

    Returns
    -------
    (extent_mm, log_odds) or None
        Where it ends likeliest, at the known end or beyond, and the logarithm of the odds for that against the known
        end; None where the edge does not stand out from what is beside it.

    Notes
    -----
    Each pixel along the line has a strength s, the difference across it. On the edge s is about S, as within the known
    extent, and beside it about T; for exponential distributions ``log p(s | edge) / p(s | none) = log T / S + s (1 / T
    - 1 / S)``, limited to 1, half of which is summed from the known end on.
    """
    strengths = [found for k in (False, True) if (found := _strength(light[k], world, own, side, right=k)) is not None]
    if not strengths:
        return None
    extents, known = strengths[0][0], 0
    extents, strength = max(strengths, key=lambda found: float(np.count_nonzero(found[0] < own[side.extent])))
    known = int(np.count_nonzero(extents < own[side.extent]))
    if known < _LEAST_PX:
        return None
    sure = strength[:, round(_SURE[0] * known) : max(round(_SURE[1] * known), 1)]
    off = np.abs(0.5 * (_BESIDE_PX[_STEPS:] + _BESIDE_PX[:-_STEPS]))
    on_edge = strength[off < _AT].max(axis=0)
    S, T = float(np.median(sure[off < _AT].max(axis=0))), float(np.median(sure[off > _PLAIN]))
    if not _STANDS_OUT * max(T, _LEAST) < S:
        return None
    odds = np.log(max(T, _LEAST) / S) + on_edge[known:] * (1 / max(T, _LEAST) - 1 / S)
    total = np.concatenate([[0.0], np.cumsum(_SHARE * np.clip(odds, -_MOST, _MOST))])
    best = int(total.argmax())
    return float(np.concatenate([extents, extents[-1:]])[known + best]), float(total[best])


def _strength(
    picture: UInt8 | Float32 | None, world: World, own: Float64, side: Side, *, right: bool
) -> tuple[Float64, Float64] | None:
    """Extents a pixel apart in a picture, and differences across the upper edge there: (N,) and (M, N)."""
    if picture is None:
        return None
    boxes = np.repeat(own[None], 2, axis=0)
    boxes[:, side.extent] = own[side.extent] * np.array([0.0, 1.0])
    ends = _tops(world, Box(boxes), side, right)
    outwards = float(ends[1, 0] - ends[0, 0]) * (1 if side is Side.RIGHT else -1)
    along_px = float(np.hypot(*(ends[1] - ends[0])))
    if outwards <= 0 or along_px < _LEAST_PX:
        return None
    tried = np.linspace(0.0, _FARTHEST_MM, 2000)
    boxes = np.repeat(own[None], len(tried), axis=0)
    boxes[:, side.extent] = tried
    pixels = _tops(world, Box(boxes), side, right)
    length = np.hypot(*(pixels - pixels[0]).T)
    extents = np.interp(np.arange(1.0, min(along_px + _BEYOND_PX, float(length[-1]))), length, tried)
    across = abs(float(ends[1, 0] - ends[0, 0])) / along_px  # of a step upwards
    per_mm = float(world.focal) / max(float(own[Own.X]), _AHEAD_MM) * max(across, 0.2)
    boxes = np.repeat(own[None], len(extents) * len(_BESIDE_PX), axis=0).reshape(len(_BESIDE_PX), len(extents), -1)
    boxes[..., side.extent] = extents
    boxes[..., Own.HEIGHT] += _BESIDE_PX[:, None] / per_mm
    pixels = _tops(world, Box(boxes.reshape(-1, boxes.shape[-1])), side, right).astype(np.float32)
    u, v = pixels.T.reshape(2, len(_BESIDE_PX), len(extents))
    height, width = picture.shape[:2]
    inside = ((u > 1) & (u < width - 2) & (v > 1) & (v < height - 2)).all(axis=0)
    shown = len(inside) if inside.all() else int(np.argmin(inside))
    if not shown:
        return None
    values = light_at(picture, u[:, :shown], v[:, :shown]).reshape(len(_BESIDE_PX), shown, -1)
    return extents[:shown], np.abs(values[_STEPS:] - values[:-_STEPS]).mean(axis=2)


def _tops(world: World, box: Box, side: Side, right: bool) -> Float64:
    """Upper outer ends of a face, of many boxes, in a picture. (N, 2)."""
    shares = np.array([[1.0, 0.0, 1.0] if side is Side.RIGHT else [0.0, 1.0, 1.0]])
    return np.asarray(world.pixels(box.points(shares)[:, 0], right))
