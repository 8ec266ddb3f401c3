"""Sums of costs along paths, and what is read off them: a view's disparity, how clear the minimum was."""

from __future__ import annotations

from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Float32, Ints, UInt8
from stereolib.matching.compiled import compiled

Int16: TypeAlias = npt.NDArray[np.int16]
_BAND_ROWS = 256  # no more rows are turned at once for the paths along rows
_NEVER = 32000  # dearer than any sum of four paths


def aggregate(cost: UInt8, image: UInt8, p1: int, p2: int, edge: float) -> Int16:
    """Sum up the costs along rows and columns, there and back, from the rim to each pixel.

    Parameters
    ----------
    cost : (H, D, W) uint8
        Its largest value and both penalties together are at most 255.
    image : (H, W) or (H, W, C) uint8
        The picture whose edges make steps cheap.
    p1, p2 : int
        Penalties for a step of one and of more pixels.
    edge : float
        Step of the picture, in grey levels, at which ``p2`` has fallen to a half.

    Returns
    -------
    (H, D, W) int16

    Raises
    ------
    ValueError
        If the picture is not of the costs' height and width.

    Notes
    -----
    ``L_r(p, d) = C(p, d) + min(L_r(q, d), L_r(q, d +- 1) + P1, min_k L_r(q, k) + P2(p, q)) - min_k L_r(q, k)`` with q
    the pixel before p on path r, and ``P2(p, q) = floor(max(P2 / (1 + max_c |I_c(p) - I_c(q)| / edge), P1 + 1))`` with
    c the channels; a path begins at the rim. No path exceeds the largest cost and P2, so that 8 bits hold it.
    """
    if image.shape[:2] != cost.shape[::2]:
        raise ValueError(f"the picture has shape {image.shape}, the costs (H, D, W) are {cost.shape}")
    fall = np.maximum(p2 / (1 + np.arange(256) / edge), p1 + 1).astype(np.uint8)
    total = np.zeros(cost.shape, np.int16)
    _walk(cost, fall[_steps(image)], np.uint8(p1), total)
    height, depth, width = cost.shape
    rows = -(-height // -(-height // _BAND_ROWS))
    turned, along = (np.empty((width, depth, rows), kind) for kind in (np.uint8, np.int16))
    for top in range(0, height, rows):
        first = min(top, height - rows)  # the last band begins in the one before
        band = slice(first, first + rows)
        for d in range(depth):
            turned[:, d] = cv2.transpose(cost[band, d])
        along[:] = 0
        _walk(turned, fall[_steps(image[band].swapaxes(0, 1))], np.uint8(p1), along)
        for d in range(depth):
            total[top : band.stop, d] += cv2.transpose(along[:, d, top - first :])
    return total


def read_off(total: Int16) -> tuple[Float32, Float32]:
    """Find the least sums.

    Parameters
    ----------
    total : (H, D, W) int16
        Written into meanwhile, and as it was at the end.

    Returns
    -------
    disparity_px : (H, W) float32, px
        Refined between the first disparity and the last one.
    margin : (H, W) float32
        The least sum at least two pixels away, less the least one.
    """
    height, depth, width = total.shape
    best, far = np.empty((2, height, width), np.int16)
    around = np.empty((3, height, width), np.int16)
    _find_least(total, best, around)
    _find_least_elsewhere(total, best, around, far)
    return _refined(best, around, depth), np.asarray(far - around[1], np.float32)


def _refined(disparity: Ints, around: Int16, depth: int) -> Float32:
    """Two straight lines of equal slope through the least sum, the one below and the one above, (3, H, W)."""
    fall, rise = (around[k].astype(np.float32) - around[1] for k in (0, 2))
    inner = (disparity > 0) & (disparity < depth - 1)
    offset = np.where(inner, 0.5 * (fall - rise) / np.maximum(np.maximum(fall, rise), 1), 0).clip(-0.5, 0.5)
    return np.asarray(disparity + offset, np.float32)


def _steps(image: UInt8) -> UInt8:
    """How far the channel that steps most steps from each row to the next, (H - 1, W)."""
    steps = np.abs(np.diff(np.atleast_3d(image).astype(np.int16), axis=0))
    return np.asarray(steps.max(axis=2), np.uint8)


@compiled
def _walk(cost: UInt8, p2: UInt8, p1: np.uint8, total: Int16) -> None:
    """Add the paths that run along the first axis, there and back; `p2`, (H - 1, W), is that between its places."""
    height, depth, width = cost.shape
    least, dearest = np.empty((2, width), np.uint8)
    least_before = np.empty(width, np.uint8)
    for order in (1, -1):
        rooms = np.full((2, depth + 2, width), np.uint8(255 - p1))  # outside nothing is cheap
        least[:] = 0
        for k in range(height):
            y = k if order == 1 else height - 1 - k
            before, here = rooms[k % 2], rooms[1 - k % 2]
            for x in range(width):
                least_before[x], dearest[x], least[x] = least[x], 0, 255
            if k > 0:
                between = p2[min(y, y - order)]
                for x in range(width):
                    dearest[x] = least_before[x] + between[x]
            for d in range(depth):
                nearer, same, farther = before[d], before[d + 1], before[d + 2]
                path, c, s = here[d + 1], cost[y, d], total[y, d]
                for x in range(width):
                    beside = np.uint8(min(nearer[x], farther[x]) + p1)
                    cheapest = min(beside, same[x], dearest[x])
                    path[x] = np.uint8(np.uint8(cheapest - least_before[x]) + c[x])
                    least[x] = min(least[x], path[x])
                    s[x] = np.int16(s[x] + path[x])


@compiled
def _find_least(total: Int16, best: Int16, around: Int16) -> None:
    """The least sums: their disparities, and the sums below, at and above them."""
    height, depth, width = total.shape
    rank = np.empty(width, np.int32)
    for y in range(height):
        rank[:] = _NEVER << 16
        for d in range(depth):
            sums = total[y, d]
            for x in range(width):  # the sum above the disparity: the first of equals is the least
                rank[x] = min(rank[x], np.int32(np.int32(np.int32(sums[x]) << np.int32(16)) + np.int32(d)))
        for x in range(width):
            best[y, x] = rank[x] & 0xFFFF
            for side in range(3):
                d = best[y, x] + side - 1
                around[side, y, x] = total[y, d, x] if 0 <= d < depth else _NEVER


@compiled
def _find_least_elsewhere(total: Int16, best: Int16, around: Int16, far: Int16) -> None:
    """The least sum at least two pixels away; those nearer are taken out meanwhile, and put back."""
    height, depth, width = total.shape
    least = np.empty(width, np.int16)
    for y in range(height):
        for x in range(width):
            for d in range(max(best[y, x] - 1, 0), min(best[y, x] + 2, depth)):
                total[y, d, x] = _NEVER
        least[:] = _NEVER
        for d in range(depth):
            sums = total[y, d]
            for x in range(width):
                least[x] = min(least[x], sums[x])
        for x in range(width):
            far[y, x] = least[x]
            for d in range(max(best[y, x] - 1, 0), min(best[y, x] + 2, depth)):
                total[y, d, x] = around[d - best[y, x] + 1, y, x]
