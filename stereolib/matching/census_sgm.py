"""Semi-global matching written out in numpy: the same idea as `cv2.StereoSGBM`, with a cost and a penalty of our own.

Three things differ, and each was measured on the virtual rig (`benchmarks/choose_best.py`): the cost is census plus
colour difference instead of Birchfield-Tomasi on gradients; the penalty for a step falls where the image has an edge;
and the whole cost volume is at hand afterwards, so that the right view's disparity and a confidence cost no new match.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.rig import check_pair, to_grey

Array = np.ndarray
_BAND_ROWS = 32  # rows that are turned at once for the paths along rows
_NEVER = np.int16(32000)  # dearer than any sum of eight paths


@dataclass(frozen=True)
class CensusSGM:
    """Parameters of `match`; the defaults were chosen on virtual scenes by `benchmarks/choose_best.py`.

    Parameters
    ----------
    num_disparities : int, px
        Disparities 0 to ``num_disparities - 1`` are looked at.
    census_px : (rows, columns)
        Odd edges of the census window; at most 64 pixels.
    color_weight, color_cap : float
        The mean difference of the channels counts by the weight, at most up to the cap (grey levels).
    block_size : int, px
        Odd edge over which the cost is averaged.
    p1, p2 : int
        Penalties for a step of one and of more pixels.
    edge : float
        Step of the image, in grey levels, at which ``p2`` has fallen to a half.

    Raises
    ------
    ValueError
    """

    num_disparities: int = 128
    census_px: tuple[int, int] = (5, 5)
    color_weight: float = 1.0
    color_cap: float = 20.0
    block_size: int = 3
    p1: int = 20
    p2: int = 120
    edge: float = 16.0

    def __post_init__(self) -> None:
        if self.num_disparities < 2:
            raise ValueError(f"num_disparities must be at least 2, got {self.num_disparities}")
        odd = (*self.census_px, self.block_size)
        if any(n < 1 or n % 2 == 0 for n in odd) or self.census_px[0] * self.census_px[1] > 64:
            raise ValueError(f"windows need odd edges, the census at most 64 pixels; got {self.census_px}, {odd[2]}")
        if not 0 < self.p1 < self.p2 or self.edge <= 0:
            raise ValueError(f"need 0 < p1 < p2 and edge > 0, got p1={self.p1}, p2={self.p2}, edge={self.edge}")
        longest = 8 * (self.census_px[0] * self.census_px[1] + self.color_weight * self.color_cap + self.p2)
        if longest >= _NEVER:
            raise ValueError(f"the costs add up to {longest:.0f}, more than 16 bits hold: reduce p2 or the weights")


@dataclass(frozen=True, eq=False)
class SGMResult:
    """Both views' disparity, (H, W) float32 px, every pixel returned; and how clear the left one's minimum was.

    ``margin`` (H, W) float32: summed cost of the best disparity at least two pixels away, less that of the best one.
    """

    left_px: Array
    right_px: Array
    margin: Array


def match(left: Array, right: Array, params: CensusSGM | None = None) -> SGMResult:
    """Disparity of a rectified pair along eight paths.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
    params : CensusSGM, optional

    Raises
    ------
    ValueError
        If the images do not fit together, or the search window is wider than the image.

    Notes
    -----
    ``L_r(p, d) = C(p, d) + min(L_r(q, d), L_r(q, d +- 1) + P1, min_k L_r(q, k) + P2(p, q)) - min_k L_r(q, k)`` with q
    the pixel before p on path r, and ``P2(p, q) = max(P2 / (1 + |I(p) - I(q)| / edge), P1 + 1)``. The disparity is the
    least sum over the paths, refined by two straight lines of equal slope through it and its neighbours. The right
    view's comes from the same sums, ``S_right(x, d) = S(x + d, d)``. Memory: 5 bytes a pixel and disparity.

    References
    ----------
    H. Hirschmueller, Stereo processing by semiglobal matching and mutual information, doi:10.1109/TPAMI.2007.1166;
    R. Zabih and J. Woodfill, Non-parametric local transforms, doi:10.1007/BFb0028345
    """
    params = params or CensusSGM()
    check_pair(left, right)
    if params.num_disparities >= left.shape[1]:
        raise ValueError(
            f"{params.num_disparities} disparities were asked for and the image is {left.shape[1]} px wide: "
            f"reduce num_disparities"
        )
    total = _aggregate(_cost(left, right, params), to_grey(left), params)
    disparity = total.argmin(axis=1)
    return SGMResult(_refined(total, disparity), _right(total), _margin(total, disparity))


def census(grey: Array, size_px: tuple[int, int]) -> Array:
    """Which neighbours are darker than the pixel, one bit each: (H, W) uint64; invariant to gain and offset."""
    half = size_px[0] // 2, size_px[1] // 2
    height, width = grey.shape
    roomy = np.pad(grey, ((half[0], half[0]), (half[1], half[1])), mode="edge")
    bits = np.zeros(grey.shape, np.uint64)
    for v in range(size_px[0]):
        for u in range(size_px[1]):
            if (v, u) != half:
                bits = bits << np.uint64(1) | (roomy[v : v + height, u : u + width] < grey)
    return bits


def _cost(left: Array, right: Array, params: CensusSGM) -> Array:
    """Cost volume (H, D, W) int16: census distance plus capped colour difference, averaged over the block."""
    bits = [census(to_grey(image), params.census_px) for image in (left, right)]
    height, width = left.shape[:2]
    channels = list(zip(_channels(left), _channels(right), strict=True))
    cost = np.empty((height, params.num_disparities, width), np.int16)
    for d in range(params.num_disparities):
        unlike = sum(cv2.absdiff(a[:, d:], b[:, : width - d]).astype(np.float32) for a, b in channels) / len(channels)
        distance = np.bitwise_count(bits[0][:, d:] ^ bits[1][:, : width - d]).astype(np.float32)
        distance += params.color_weight * np.minimum(unlike, params.color_cap)
        cost[:, d, d:] = np.rint(cv2.blur(distance, (params.block_size,) * 2))
        cost[:, d, :d] = cost[:, d, d : d + 1]  # the match would lie outside the right image: as its first column
    return cost


def _channels(image: Array) -> list[Array]:
    return [image] if image.ndim == 2 else list(cv2.split(image))


def _aggregate(cost: Array, grey: Array, params: CensusSGM) -> Array:
    """Sum of the eight paths, (H, D, W) int16."""
    fall = np.maximum(params.p2 / (1 + np.arange(256) / params.edge), params.p1 + 1).astype(np.int16)
    grey, total = grey.astype(np.int16), np.zeros_like(cost)
    for shift in (0, 1, -1):
        _walk(cost, total, grey, np.int16(params.p1), fall, shift)
    for top in range(0, len(cost), _BAND_ROWS):
        band = slice(top, top + _BAND_ROWS)
        turned = np.ascontiguousarray(cost[band].T)
        along = np.zeros_like(turned)
        _walk(turned, along, np.ascontiguousarray(grey[band].T), np.int16(params.p1), fall, 0)
        total[band] += along.T
    return total


def _walk(cost: Array, total: Array, grey: Array, p1: np.int16, fall: Array, shift: int) -> None:
    """Add the two paths that run along the first axis, there and back, moving by `shift` on the last one a step."""
    count = len(cost)
    orders: Iterable[range] = (range(count), range(count - 1, -1, -1))
    for order in orders:
        before = shade = None
        for k in order:
            path = cost[k]
            if before is not None and shade is not None:
                before, shade = _moved(before, shift), _moved(shade, shift)
                least = before.min(axis=0)
                path = np.minimum(before, least + fall[np.abs(grey[k] - shade)])
                before = before + p1
                np.minimum(path[1:], before[:-1], out=path[1:])
                np.minimum(path[:-1], before[1:], out=path[:-1])
                path -= least
                path += cost[k]
            total[k] += path
            before, shade = path, grey[k]


def _moved(values: Array, shift: int) -> Array:
    if shift == 0:
        return values
    if shift > 0:
        return np.concatenate([values[..., :1], values[..., :-1]], axis=-1)
    return np.concatenate([values[..., 1:], values[..., -1:]], axis=-1)


def _at(total: Array, disparity: Array) -> Array:
    inside = np.clip(disparity, 0, total.shape[1] - 1)
    return np.take_along_axis(total, inside[:, None], axis=1)[:, 0].astype(np.float32)


def _refined(total: Array, disparity: Array) -> Array:
    low, here, high = (_at(total, disparity + k) for k in (-1, 0, 1))
    slope = np.maximum(np.maximum(low - here, high - here), 1)
    inner = (disparity > 0) & (disparity < total.shape[1] - 1)
    return (disparity + np.where(inner, 0.5 * (low - high) / slope, 0).clip(-0.5, 0.5)).astype(np.float32)


def _right(total: Array) -> Array:
    count, width = total.shape[1:]
    turned = np.full_like(total, _NEVER)
    for d in range(count):
        turned[:, d, : width - d] = total[:, d, d:]
    return _refined(turned, turned.argmin(axis=1))


def _margin(total: Array, disparity: Array) -> Array:
    here = _at(total, disparity)
    far = np.full(disparity.shape, _NEVER)
    for d in range(total.shape[1]):
        np.copyto(far, np.minimum(far, total[:, d]), where=np.abs(disparity - d) > 1)
    return far - here
