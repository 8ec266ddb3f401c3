"""Semi-global matching written out in numpy: the same idea as `cv2.StereoSGBM`, with a cost and a penalty of our own.

Four things differ, and each was measured on virtual scenes: the cost is census plus colour difference instead of
Birchfield-Tomasi on gradients; half of it is seen in half size, where there is less noise, so that fine things count
and noisy pictures need no blur; the penalty for a step falls where the image has an edge; and the whole cost volume is
at hand afterwards, so that the right view's disparity and a confidence cost no new match.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Float32, Ints, UInt8
from stereolib.matching.levels import halved
from stereolib.rig import check_pair, to_grey

Int16: TypeAlias = npt.NDArray[np.int16]
_BAND_ROWS = 128  # rows that are turned at once for the paths along rows
_COARSE_CENSUS_PX = (7, 7)  # of the half size
_CELL_BYTES = 5  # a pixel and disparity: the cost, a quarter of it once more, the sum, and bands that are turned
_STRIP_BYTES = 2**30  # more than so much is matched in strips
_BESIDE_ROWS = 64  # of a strip, that tell its own rows what lies above and below
_NEVER = np.int16(32000)  # dearer than any sum of eight paths


@dataclass(frozen=True)
class CensusSGM:
    """Parameters of `match_census_sgm`; the defaults were chosen on virtual scenes by `benchmarks/choose_best.py`.

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
        If a window is even or too large, a penalty is none, or the costs add up to more than 16 bits hold.

    Examples
    --------
    >>> CensusSGM(p1=30, p2=20)
    Traceback (most recent call last):
    ...
    ValueError: need 0 < p1 < p2 and edge > 0, got p1=30, p2=20, edge=16.0
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
    """Disparity of both views, every pixel returned, and how clear the left one's minimum was.

    Parameters
    ----------
    left_px, right_px : (H, W) float32, px
    margin : (H, W) float32
        Summed cost of the best disparity at least two pixels away, less that of the best one.
    """

    left_px: Float32
    right_px: Float32
    margin: Float32


def match_census_sgm(left: UInt8, right: UInt8, params: CensusSGM | None = None) -> SGMResult:
    """Match a rectified pair along eight paths.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
    params : CensusSGM, optional

    Returns
    -------
    SGMResult

    Raises
    ------
    ValueError
        If the images do not fit together, the search window is wider than the image, or memory does not suffice.

    Notes
    -----
    ``L_r(p, d) = C(p, d) + min(L_r(q, d), L_r(q, d +- 1) + P1, min_k L_r(q, k) + P2(p, q)) - min_k L_r(q, k)`` with q
    the pixel before p on path r, and ``P2(p, q) = max(P2 / (1 + |I(p) - I(q)| / edge), P1 + 1)``. The disparity is the
    least sum over the paths, refined by two straight lines of equal slope through it and its neighbours. The right
    view's comes from the same sums, ``S_right(x, d) = S(x + d, d)``. C is the mean of the cost of the pictures and of
    that of the pictures in half size, whose right one is moved by d before it is made smaller. Memory: 5 bytes a pixel
    and disparity; from 1 GiB on, the pictures are matched in strips of rows that reach into each other.

    References
    ----------
    H. Hirschmueller, Stereo processing by semiglobal matching and mutual information, doi:10.1109/TPAMI.2007.1166;
    R. Zabih and J. Woodfill, Non-parametric local transforms, doi:10.1007/BFb0028345

    Examples
    --------
    >>> left = np.random.default_rng(0).integers(0, 256, (20, 60), np.uint8)
    >>> result = match_census_sgm(left, np.roll(left, -7, axis=1), CensusSGM(num_disparities=16))
    >>> round(float(np.median(result.left_px)), 1)
    7.0
    """
    params = params or CensusSGM()
    check_pair(left, right)
    if params.num_disparities >= left.shape[1]:
        asked = f"{params.num_disparities} disparities were asked for"
        raise ValueError(f"{asked} and the image is {left.shape[1]} px wide: reduce num_disparities")
    height, width = left.shape[:2]
    row_bytes = width * params.num_disparities * _CELL_BYTES
    own = max(_STRIP_BYTES // row_bytes // 2 * 2 - 2 * _BESIDE_ROWS, _BESIDE_ROWS)  # even: the half size pairs rows
    _check_memory(min(own + 2 * _BESIDE_ROWS, height) * row_bytes, params.num_disparities)
    found = []
    for top in range(0, height, own):
        first = max(top - _BESIDE_ROWS, 0)
        seen, kept = slice(first, top + own + _BESIDE_ROWS), slice(top - first, top - first + own)
        total = _aggregate(_cost(left[seen], right[seen], params), to_grey(left[seen]), params)[kept]
        disparity = total.argmin(axis=1)
        found.append((_refined(total, disparity), _right(total), _margin(total, disparity)))
    return SGMResult(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def census_transform(grey: UInt8 | Float32, size_px: tuple[int, int]) -> npt.NDArray[np.uint64]:
    """Tell which neighbours are darker than each pixel, one bit each; invariant to gain and offset.

    Parameters
    ----------
    grey : (H, W) uint8 or float32
    size_px : (rows, columns)
        Odd edges of the window, px; at most 64 pixels.

    Returns
    -------
    (H, W) uint64

    Examples
    --------
    >>> census_transform(np.array([[1, 2, 3]], np.uint8), (1, 3))
    array([[0, 2, 2]], dtype=uint64)
    """
    half, (height, width) = (size_px[0] // 2, size_px[1] // 2), grey.shape
    roomy: Any = np.pad(grey, ((half[0], half[0]), (half[1], half[1])), mode="edge")
    bits = np.zeros(grey.shape, np.uint64)
    for v, u in np.ndindex(size_px):
        if (v, u) != half:
            bits = bits << np.uint64(1) | (roomy[v : v + height, u : u + width] < grey)
    return bits


def _check_memory(needed: int, num_disparities: int) -> None:
    """Refuse what the machine cannot hold, with the figure and what it would."""
    free = _free_bytes()
    if needed > free:
        asked, left = (f"{amount / 2**30:.2f} GiB" for amount in (needed, free))
        fits = int(num_disparities * free // needed) // 16 * 16
        advice = f"reduce num_disparities to {fits}" if fits else "take smaller pictures"
        raise ValueError(f"matching {num_disparities} disparities needs {asked} of memory, {left} are free: {advice}")


def _free_bytes() -> float:
    """What Linux says is free; elsewhere nothing is known, and nothing is refused."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
    except OSError:
        return float("inf")
    return next((1024 * float(line.split()[1]) for line in lines if line.startswith("MemAvailable")), float("inf"))


def _cost(left: UInt8, right: UInt8, params: CensusSGM) -> Int16:
    """Cost volume (H, D, W) int16: the mean of those of the pictures and of the half size."""
    cost, coarse = _fine_cost(left, right, params), _coarse_cost(left, right, params.num_disparities)
    for y, row in enumerate(cost):
        row += np.repeat(coarse[y // 2], 2, axis=1)[:, : left.shape[1]]
    return np.right_shift(cost, 1, out=cost)


def _coarse_cost(left: UInt8, right: UInt8, num_disparities: int) -> Int16:
    """Census distance in half size, (H / 2, D, W / 2) int16: d is that of the whole pictures."""
    bits, *moved = (
        census_transform(image.mean(axis=2), _COARSE_CENSUS_PX)
        for image in (halved(left), halved(right), halved(right, 1))
    )
    height, width = bits.shape
    cost = np.empty((height, num_disparities, width), np.int16)
    for d in range(num_disparities):
        by, k = (d + 1) // 2, d % 2
        cost[:, d, by:] = np.bitwise_count(bits[:, by:] ^ moved[k][:, : width - by])
        cost[:, d, :by] = cost[:, d, by : by + 1]  # as in `_fine_cost`
    return cost


def _fine_cost(left: UInt8, right: UInt8, params: CensusSGM) -> Int16:
    """Census distance plus capped colour difference, averaged over the block, (H, D, W) int16."""
    bits = [census_transform(to_grey(image), params.census_px) for image in (left, right)]
    height, width = left.shape[:2]
    planes = (np.ascontiguousarray(np.atleast_3d(image).transpose(2, 0, 1)) for image in (left, right))
    channels = list(zip(*planes, strict=True))
    cost = np.empty((height, params.num_disparities, width), np.int16)
    for d in range(params.num_disparities):
        unlike = sum(cv2.absdiff(a[:, d:], b[:, : width - d]).astype(np.float32) for a, b in channels) / len(channels)
        distance = np.bitwise_count(bits[0][:, d:] ^ bits[1][:, : width - d]).astype(np.float32)
        distance += params.color_weight * np.minimum(unlike, params.color_cap)
        cost[:, d, d:] = np.rint(cv2.blur(distance, (params.block_size,) * 2))
        cost[:, d, :d] = cost[:, d, d : d + 1]  # the match would lie outside the right image: as its first column
    return cost


def _aggregate(cost: Int16, grey: UInt8, params: CensusSGM) -> Int16:
    """Sum of the eight paths, (H, D, W) int16."""
    fall = np.maximum(params.p2 / (1 + np.arange(256) / params.edge), params.p1 + 1).astype(np.int16)
    shades, total = grey.astype(np.int16), np.zeros(cost.shape, np.int16)
    for shift in (0, 1, -1):
        _walk(cost, total, shades, (np.int16(params.p1), fall), shift)
    for top in range(0, len(cost), _BAND_ROWS):
        band = slice(top, top + _BAND_ROWS)
        turned = _turned(cost[band])
        along = np.zeros(turned.shape, np.int16)
        _walk(turned, along, np.ascontiguousarray(shades[band].T), (np.int16(params.p1), fall), 0)
        total[band] += _turned(along)
    return total


def _turned(volume: Int16) -> Int16:
    """Rows and columns of a volume exchanged, (A, D, B) to (B, D, A), by OpenCV: several times faster than a copy."""
    out = np.empty(volume.shape[::-1], np.int16)
    for d in range(volume.shape[1]):
        out[:, d] = cv2.transpose(volume[:, d])
    return out


def _walk(cost: Int16, total: Int16, grey: Int16, penalties: tuple[np.int16, Int16], shift: int) -> None:
    """Add the two paths that run along the first axis, there and back, moving by `shift` on the last one a step.

    The penalties are ``P1``, and ``P2`` by the step of the picture in grey levels.
    """
    (p1, fall), count = penalties, len(cost)
    for order in (range(count), range(count - 1, -1, -1)):
        before: Int16 | None = None
        shade: Int16 | None = None
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


def _moved(values: Int16, shift: int) -> Int16:
    parts = {0: [values], 1: [values[..., :1], values[..., :-1]], -1: [values[..., 1:], values[..., -1:]]}[shift]
    return np.concatenate(parts, axis=-1) if shift else values


def _at(total: Int16, disparity: Ints) -> Float32:
    inside = np.clip(disparity, 0, total.shape[1] - 1)
    return np.take_along_axis(total, inside[:, None], axis=1)[:, 0].astype(np.float32)


def _refined(total: Int16, disparity: Ints) -> Float32:
    low, here, high = (_at(total, disparity + k) for k in (-1, 0, 1))
    slope = np.maximum(np.maximum(low - here, high - here), 1)
    inner = (disparity > 0) & (disparity < total.shape[1] - 1)
    offset = np.where(inner, 0.5 * (low - high) / slope, 0).clip(-0.5, 0.5)
    return np.asarray(disparity + offset, np.float32)


def _right(total: Int16) -> Float32:
    (height, count, width), found = total.shape, []
    for top in range(0, height, _BAND_ROWS):
        band = total[top : top + _BAND_ROWS]
        turned = np.full_like(band, _NEVER)
        for d in range(count):
            turned[:, d, : width - d] = band[:, d, d:]
        found.append(_refined(turned, turned.argmin(axis=1)))
    return np.concatenate(found)


def _margin(total: Int16, disparity: Ints) -> Float32:
    here = _at(total, disparity)
    far: Any = np.full(disparity.shape, _NEVER)
    for d in range(total.shape[1]):
        np.copyto(far, np.minimum(far, total[:, d]), where=np.abs(disparity - d) > 1)
    return np.asarray(far - here)
