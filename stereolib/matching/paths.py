"""Sums of costs along eight paths, and what is read off them: disparity of both views, how clear the minimum was."""

from __future__ import annotations

from typing import TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Float32, Ints, UInt8

Int16: TypeAlias = npt.NDArray[np.int16]
_BAND_ROWS = 256  # rows that are turned at once for the paths along rows
_NEVER = np.int16(32000)  # dearer than any sum of eight paths


def aggregate(cost: UInt8, grey: UInt8, p1: int, p2: int, edge: float) -> Int16:
    """Sum up the costs along eight paths.

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

    Returns
    -------
    (H, D, W) int16

    Notes
    -----
    ``L_r(p, d) = C(p, d) + min(L_r(q, d), L_r(q, d +- 1) + P1, min_k L_r(q, k) + P2(p, q)) - min_k L_r(q, k)`` with q
    the pixel before p on path r, and ``P2(p, q) = max(P2 / (1 + |I(p) - I(q)| / edge), P1 + 1)``; a path that comes in
    over the rim begins there. No path exceeds the largest cost and P2, so that 8 bits hold it.
    """
    fall = np.maximum(p2 / (1 + np.arange(256) / edge), p1 + 1).astype(np.uint8)
    penalties, shades, total = (np.uint8(p1), fall), grey.astype(np.int16), np.zeros(cost.shape, np.int16)
    _walk(cost, total, shades, penalties, (0, 1, -1))
    height, depth, width = cost.shape
    turned, along = (np.empty((width, depth, min(_BAND_ROWS, height)), kind) for kind in (np.uint8, np.int16))
    for top in range(0, height, _BAND_ROWS):
        band = slice(top, min(top + _BAND_ROWS, height))
        rows = slice(0, band.stop - top)
        for d in range(depth):  # by OpenCV, several times faster than a turned copy
            turned[:, d, rows] = cv2.transpose(cost[band, d])
        along[:] = 0
        _walk(turned[..., rows], along[..., rows], shades[band].T, penalties, (0,))
        for d in range(depth):
            total[band, d] += cv2.transpose(along[:, d, rows])
    return total


def read_off(total: Int16) -> tuple[Float32, Float32, Float32]:
    """Find the least sums, row by row while they are in the cache.

    Parameters
    ----------
    total : (H, D, W) int16

    Returns
    -------
    left_px, right_px : (H, W) float32, px
        The right view's sums are ``S_right(x, d) = S(x + d, d)``.
    margin : (H, W) float32
        The left view's least sum at least two pixels away, less the least one.
    """
    height, depth, width = total.shape
    roomy = np.full((depth, width + depth), _NEVER)
    flat, line = roomy.reshape(-1), roomy.strides[0]
    left = roomy[:, :width]
    right = np.lib.stride_tricks.as_strided(roomy, (depth, width), (line + 2, 2), writeable=False)
    code = np.arange(depth)[::-1, None].astype(np.uint8 if depth <= 256 else np.uint16)
    start, along, beside = np.arange(width), width + depth, np.array([[-1], [0], [1]])
    best, around = np.empty((2, height, width), np.intp), np.empty((2, 3, height, width), np.int16)
    far = np.empty((height, width), np.int16)
    for y, sums in enumerate(total):
        left[:] = sums
        for k, (view, step) in enumerate(((left, along), (right, along + 1))):
            least = view.min(axis=0)
            best[k, y] = depth - 1 - np.multiply(view == least, code, dtype=code.dtype).max(axis=0)
            where = start + best[k, y] * step
            around[k, 1, y] = least
            for j in (0, 2):
                flat.take(where + (j - 1) * step, out=around[k, j, y], mode="clip")
        near = np.minimum(np.maximum(best[0, y] + beside, 0), depth - 1)
        flat[start + near * along] = _NEVER
        far[y] = left.min(axis=0)
    left_px, right_px = (_refined(one, three, depth) for one, three in zip(best, around, strict=True))
    return left_px, right_px, np.asarray(far - around[0, 1], np.float32)


def _refined(disparity: Ints, around: Int16, depth: int) -> Float32:
    """Two straight lines of equal slope through the least sum, the one below and the one above, (3, H, W)."""
    fall, rise = (around[k].astype(np.float32) - around[1] for k in (0, 2))
    inner = (disparity > 0) & (disparity < depth - 1)
    offset = np.where(inner, 0.5 * (fall - rise) / np.maximum(np.maximum(fall, rise), 1), 0).clip(-0.5, 0.5)
    return np.asarray(disparity + offset, np.float32)


def _walk(cost: UInt8, total: Int16, grey: Int16, penalties: tuple[np.uint8, UInt8], shifts: tuple[int, ...]) -> None:
    """Add the paths that run along the first axis, there and back, moving by each shift on the last one a step.

    The penalties are ``P1``, and ``P2`` by the step of the picture in grey levels. A path that comes in over a side
    begins there.
    """
    p1, fall = penalties
    for order in (1, -1):
        costs, sums = cost[::order], total[::order]
        paths = [_Path(cost.shape[1:], p1, shift) for shift in shifts]
        p2 = [fall[np.abs(grey - np.roll(grey, (order, shift), axis=(0, 1)))][::order] for shift in shifts]
        for k in range(len(cost)):
            for path, jump in zip(paths, p2, strict=True):
                sums[k] += path.step(costs[k], jump[k], first=k == 0)


class _Path:
    """One direction's sums of a row and of the row before, with room beside, so that neighbours are views of them."""

    def __init__(self, shape: tuple[int, int], p1: np.uint8, shift: int) -> None:
        (depth, width), self.p1 = shape, p1
        spare, size = width + 1, depth * width
        rooms = np.full((2, size + 2 * spare), 255 - p1, np.uint8)  # outside nothing is cheap
        self.here, self.before = (
            [[room[spare + by : spare + by + size].reshape(shape) for by in offsets] for room in rooms]
            for offsets in ((0,), (-shift, -shift - width, -shift + width))
        )
        self.rim = {0: slice(0), 1: slice(1), -1: slice(width - 1, width)}[shift]

    def step(self, cost: UInt8, p2: UInt8, *, first: bool) -> UInt8:
        """Go on by a row, whose `cost` is (D, W)."""
        self.here.reverse()
        self.before.reverse()
        (path,), (same, nearer, farther) = self.here[0], self.before[1]
        if first:
            path[:] = cost
            return path
        least = same.min(axis=0)
        np.minimum(nearer, farther, out=path)
        path += self.p1
        np.minimum(path, same, out=path)
        np.minimum(path, least + p2, out=path)
        path -= least
        path += cost
        path[:, self.rim] = cost[:, self.rim]
        return path
