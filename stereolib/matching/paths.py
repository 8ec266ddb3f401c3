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
_NEVER = 32000  # dearer than any sum of eight paths


def aggregate(cost: UInt8, grey: UInt8, p1: int, p2: int, edge: float, *, slanted: bool = True) -> Int16:
    """Sum up the costs along paths, from the rim to each pixel.

    Parameters
    ----------
    cost : (H, D, W) uint8
        Its largest value and both penalties together are at most 255.
    grey : (H, W) uint8
        The picture whose edges make steps cheap.
    p1, p2 : int
        Penalties for a step of one and of more pixels.
    edge : float
        Step of the picture, in grey levels, at which ``p2`` has fallen to a half.
    slanted : bool
        Along the four diagonals, too, not along rows and columns alone.

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
    the pixel before p on path r, and ``P2(p, q) = max(P2 / (1 + |I(p) - I(q)| / edge), P1 + 1)``; a path that comes in
    over the rim begins there. No path exceeds the largest cost and P2, so that 8 bits hold it.
    """
    if grey.shape != cost.shape[::2]:
        raise ValueError(f"the picture has shape {grey.shape}, the costs (H, D, W) are {cost.shape}")
    fall = np.maximum(p2 / (1 + np.arange(256) / edge), p1 + 1).astype(np.uint8)
    shades, total = grey.astype(np.int16), np.zeros(cost.shape, np.int16)
    _walk(cost, shades, fall, np.uint8(p1), np.array([0, 1, -1] if slanted else [0]), total)
    height, depth, width = cost.shape
    rows = -(-height // -(-height // _BAND_ROWS))
    turned, along = (np.empty((width, depth, rows), kind) for kind in (np.uint8, np.int16))
    for top in range(0, height, rows):
        first = min(top, height - rows)  # the last band begins in the one before
        for d in range(depth):
            turned[:, d] = cv2.transpose(cost[first : first + rows, d])
        along[:] = 0
        _walk(turned, np.ascontiguousarray(shades[first : first + rows].T), fall, np.uint8(p1), np.array([0]), along)
        for d in range(depth):
            total[top : first + rows, d] += cv2.transpose(along[:, d, top - first :])
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


@compiled
def _walk(cost: UInt8, grey: Int16, fall: UInt8, p1: np.uint8, shifts: Ints, total: Int16) -> None:
    """Add the paths that run along the first axis, there and back, moving by each shift on the last one a step.

    The penalties are ``p1``, and `fall` by the step of the picture in grey levels. A path that comes in over a side
    begins there.
    """
    height, depth, width = cost.shape
    least_before, dearest = np.empty((2, width), np.uint8)
    for order in (1, -1):
        rooms = np.full((2, shifts.size, depth + 2, width + 2), np.uint8(255 - p1))  # outside nothing is cheap
        leasts = np.empty((2, shifts.size, width), np.uint8)
        for k in range(height):
            y = k if order == 1 else height - 1 - k
            for j in range(shifts.size):
                before, here, least = rooms[k % 2, j], rooms[1 - k % 2, j], leasts[1 - k % 2, j]
                for x in range(width):
                    q = x - shifts[j]
                    least_before[x] = dearest[x] = 0
                    if k > 0 and 0 <= q < width:
                        least_before[x] = leasts[k % 2, j, q]
                        dearest[x] = least_before[x] + fall[abs(grey[y, x] - grey[y - order, q])]
                least[:] = 255
                before = before[:, 1 - shifts[j] :]
                for d in range(depth):
                    nearer, same, farther = before[d], before[d + 1], before[d + 2]
                    path, c, s = here[d + 1, 1:], cost[y, d], total[y, d]
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
