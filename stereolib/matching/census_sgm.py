"""Semi-global matching written out: the same idea as `cv2.StereoSGBM`, with a cost and a penalty of our own.

What differs was measured on virtual scenes: the cost is census plus colour difference instead of Birchfield-Tomasi on
gradients; the fainter the picture is against its noise, the more of it is seen in half, quarter and eighth size, where
there is less noise, so that fine things count and noisy pictures need no blur; the penalty for a step falls where the
image has an edge; between whole disparities lie two straight lines, no parabola; and the whole cost volume is at hand
afterwards: from it the right view, which checks the left one, gets sums along paths of its own, and each pixel a
confidence.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Float32, UInt8
from stereolib.matching.compiled import compiled
from stereolib.matching.paths import aggregate, read_off
from stereolib.rig import check_pair, to_grey

UInt16: TypeAlias = npt.NDArray[np.uint16]
_COARSE_CENSUS_PX = (7, 7)  # of the smaller sizes
_COARSE_BITS = 48
_SHARES = 64  # whole steps in which two costs are mixed, a power of two; what comes out is rounded down
_CONTRAST_PX = 11  # window in which contrast is measured
_CELL_BYTES = 5  # a pixel and disparity: the cost, the sum of 16 bits, and both of a band that is turned
_STRIP_BYTES = 2**30  # more than so much is matched in strips
_BESIDE_ROWS = 64  # of a strip, that tell its own rows what lies above and below
_GUIDE_PX = 3  # median of the picture whose edges make steps cheap: its noise must not
_FINER = 3  # steps a unit of cost, before it is averaged over the block


@dataclass(frozen=True)
class CensusSGM:
    """Parameters of `match_census_sgm`; the defaults were chosen on virtual scenes by `benchmarks/choose_best.py`.

    Parameters
    ----------
    num_disparities : int, px
        Disparities 0 to ``num_disparities - 1`` are looked at.
    noise_grey : float, grey levels
        Of the pictures, as `levels.noise_grey` tells it; contrast is held against it.
    census_px : (rows, columns)
        Odd edges of the census window; at most 64 pixels.
    color_weight, color_cap : float
        The mean difference of the channels counts by the weight, at most up to the cap (grey levels).
    block_size : int, px
        Odd edge over which the cost is averaged.
    p1, p2 : int
        Penalties for a step of one and of more pixels.
    edge : float
        Step of the image (its 3 x 3 median, the channel that steps most), in grey levels, at which ``p2`` has fallen
        to a half.
    coarse_share : float
        Of the cost of the next smaller size, where there is no contrast.
    contrast : float
        In units of the noise, at which that share has fallen to a half.
    halvings : int
        Smaller sizes that are looked at, up to 3.
    outside_cost : int
        Of a match outside the right picture, which has no other: more than a true one's, less than a false one's.

    Raises
    ------
    ValueError
        If a window is even or too large, a value is out of its range, or the costs add up to more than 8 bits hold.

    Examples
    --------
    >>> CensusSGM(p1=30, p2=20)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    ValueError: need 0 < p1 < p2; got CensusSGM(num_disparities=128, ...)
    """

    num_disparities: int = 128
    noise_grey: float = 1.0
    census_px: tuple[int, int] = (5, 5)
    color_weight: float = 0.7
    color_cap: float = 20.0
    block_size: int = 1
    p1: int = 20
    p2: int = 120
    edge: float = 5.0
    coarse_share: float = 0.75
    contrast: float = 5.0
    halvings: int = 3
    outside_cost: int = 16

    def __post_init__(self) -> None:
        for name in ("num_disparities", "block_size", "p1", "p2", "halvings", "outside_cost"):
            value = getattr(self, name)
            if not isinstance(value, int | np.integer):
                raise ValueError(f"{name} must be a whole number, got {value!r}")
            object.__setattr__(self, name, int(value))  # products of numpy's small ones may run over
        odd = (*self.census_px, self.block_size)
        if any(n < 1 or n % 2 == 0 for n in odd) or self.census_px[0] * self.census_px[1] > 64:
            raise ValueError(f"windows need odd edges, the census at most 64 pixels; got {self.census_px}, {odd[2]}")
        ranges = {
            "num_disparities >= 2": self.num_disparities >= 2,
            "noise_grey > 0": self.noise_grey > 0,
            "color_weight >= 0": self.color_weight >= 0,
            "color_cap >= 0": self.color_cap >= 0,
            "0 < p1 < p2": 0 < self.p1 < self.p2,
            "edge > 0": self.edge > 0,
            "0 <= coarse_share <= 1": 0 <= self.coarse_share <= 1,
            "contrast > 0": self.contrast > 0,
            "0 <= halvings <= 3": 0 <= self.halvings <= 3,
            "outside_cost >= 1": self.outside_cost >= 1,
        }
        if broken := [text for text, holds in ranges.items() if not holds]:
            raise ValueError(f"need {', '.join(broken)}; got {self}")
        dearest = self.census_px[0] * self.census_px[1] - 1 + self.color_weight * self.color_cap
        longest = max(_FINER * dearest, max(dearest, _COARSE_BITS, self.outside_cost) + self.p2 + self.p1)
        if longest > 255:
            raise ValueError(f"the costs add up to {longest:.0f}, more than 8 bits hold: reduce p2 or the weights")


@dataclass(frozen=True, eq=False)
class SGMResult:
    """Disparity of both views, every pixel returned, and how clear the left one's minimum was.

    Parameters
    ----------
    left_px, right_px : (H, W) float32, px
    margin : (H, W) float32
        Summed cost of the best disparity at least two pixels away, less that of the best one. With fewer than four
        disparities there may be none so far away: then it is larger than any other.
    """

    left_px: Float32
    right_px: Float32
    margin: Float32


def match_census_sgm(left: UInt8, right: UInt8, params: CensusSGM | None = None) -> SGMResult:
    """Match a rectified pair along rows and columns.

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
    Each pixel takes the disparity of the least sum along four paths (`paths.aggregate`), refined by two straight lines
    of equal slope through it and its neighbours. The right view has the same costs, ``C_right(x, d) = C(x + d, d)``,
    but sums of its own, with the steps of its own picture. Read off the left view's sums it would repeat their faults,
    and the check would miss them. Costs are ``C_0 = (1 - w_0) c_0 + w_0 C_1``, ``C_1 = (1 - w_1) c_1 + w_1 C_2`` and so
    on: c_0 is that of the pictures, census plus colour; c_1, c_2 and c_3 are census distances in half, quarter and
    eighth size, whose right picture is moved by d before it is made smaller. The share ``w_k(p) = share / (1 + s^2 /
    (contrast n_k)^2)`` falls where the left picture's deviation s in a window of 11 px of that size, its noise ``n_k =
    noise / 2^k`` taken off in squares, exceeds the noise. Memory: 5 bytes a pixel and disparity, 6 of pictures of 256
    rows and fewer; from about 0.9 GiB on, the pictures are matched in strips of rows that reach into each other.

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
    own = max(_STRIP_BYTES // row_bytes // 8 * 8 - 2 * _BESIDE_ROWS, _BESIDE_ROWS)  # the smallest size joins 8 rows
    _check_memory(min(own + 2 * _BESIDE_ROWS, height) * row_bytes, params.num_disparities)
    found = []
    for top in range(0, height, own):
        first = max(top - _BESIDE_ROWS, 0)
        seen, kept = slice(first, top + own + _BESIDE_ROWS), slice(top - first, top - first + own)
        cost = _cost(left[seen], right[seen], params)
        left_px, margin = _least(cost, left[seen], params, kept)
        _turn_to_right(cost, params.outside_cost)
        found.append((left_px, _least(cost, right[seen], params, kept)[0], margin))
    return SGMResult(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def census_transform(grey: UInt8 | UInt16, size_px: tuple[int, int]) -> UInt8:
    """Tell which neighbours are darker than each pixel, one bit each; invariant to gain and offset.

    Parameters
    ----------
    grey : (H, W) uint8 or uint16
    size_px : (rows, columns)
        Odd edges of the window, px.

    Returns
    -------
    (B, H, W) uint8
        Eight neighbours a plane, row by row; a plane's first is its highest bit.

    Examples
    --------
    >>> census_transform(np.array([[1, 2, 3]], np.uint8), (1, 3))
    array([[[  0, 128, 128]]], dtype=uint8)
    """
    above, before = size_px[0] // 2, size_px[1] // 2
    roomy: Any = np.pad(grey, ((above, above), (before, before)), mode="edge")
    bits = np.zeros((-(-(size_px[0] * size_px[1] - 1) // 8), *grey.shape), np.uint8)
    _compare(roomy, above, before, bits)
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


def _cost(left: UInt8, right: UInt8, params: CensusSGM) -> UInt8:
    """Cost volume (H, D, W) uint8: that of the pictures and those of smaller sizes, mixed."""
    cost = _fine_cost(left, right, params)
    if params.halvings:
        share = _coarse_share(to_grey(left).astype(np.float32), params, 0)
        _mix(_coarse_cost(left, right, params, 1), share, cost)
    for d in range(params.num_disparities):
        cost[:, d, :d] = params.outside_cost
    return cost


def _least(cost: UInt8, image: UInt8, params: CensusSGM, kept: slice) -> tuple[Float32, Float32]:
    """Disparity and margin of the rows that are kept."""
    guide: Any = cv2.medianBlur(image, _GUIDE_PX)
    return read_off(aggregate(cost, guide, params.p1, params.p2, params.edge)[kept])


def _turn_to_right(cost: UInt8, outside_cost: int) -> None:
    """Make the left view's costs the right one's: what ``C(x, d)`` is there is ``C(x + d, d)`` here."""
    width = cost.shape[2]
    for d in range(cost.shape[1]):
        cost[:, d, : width - d] = cost[:, d, d:]
        cost[:, d, width - d :] = outside_cost


def _coarse_cost(left: UInt8, right: UInt8, params: CensusSGM, halvings: int) -> UInt8:
    """Census distance in a smaller size, mixed with those of still smaller ones; d is that of the whole pictures."""
    times, depth = 2**halvings, params.num_disparities
    sums, moved = _block_sums(left, times)[0], _block_sums(right, times)
    bits, *others = (census_transform(blocks, _COARSE_CENSUS_PX) for blocks in (sums, *moved))
    height, width = sums.shape
    cost = np.empty((height, depth, width), np.uint8)
    for d in range(depth):
        by = min(-(-d // times), width - 1)
        _count_differing(bits, others[max(by * times - d, 0)], d, by, cost)
        cost[:, d, :by] = cost[:, d, by : by + 1]  # some disparities see a part of such a column
    if halvings < params.halvings:
        grey = sums.astype(np.float32) / (times**2 * np.atleast_3d(left).shape[2])
        share = _coarse_share(grey, params, halvings)
        _mix(_coarse_cost(left, right, params, halvings + 1), share, cost)
    return cost


def _block_sums(image: UInt8, times: int) -> list[UInt16]:
    """Sums over squares of `times` pixels and over channels, of the picture moved to the left by 0 to `times` - 1 px.

    The border is repeated where they reach over it. 16 bits hold those of three channels and 8 pixels.
    """
    grey = _channels(image).sum(axis=0, dtype=np.uint16)
    rows, columns = (-(-n // times) for n in grey.shape)
    spare = [(0, rows * times - grey.shape[0]), (0, (columns + 1) * times - 1 - grey.shape[1])]
    roomy: Any = np.pad(grey, spare, mode="edge")
    down = roomy.reshape(rows, times, -1).sum(axis=1, dtype=np.uint16)
    across: Any = np.sum([down[:, k : k + columns * times] for k in range(times)], axis=0, dtype=np.uint16)
    return [np.ascontiguousarray(across[:, k::times]) for k in range(times)]


def _channels(image: UInt8) -> UInt8:
    return np.ascontiguousarray(np.atleast_3d(image).transpose(2, 0, 1))


def _coarse_share(grey: Float32, params: CensusSGM, halvings: int) -> Float32:
    """Share (H, W) of the next smaller size's cost: the less, the more contrast there is beyond the noise."""
    window, noise = (_CONTRAST_PX, _CONTRAST_PX), (params.noise_grey / 2**halvings) ** 2
    variance = cv2.sqrBoxFilter(grey, cv2.CV_32F, window) - cv2.blur(grey, window) ** 2
    ratio = np.maximum(variance - noise, 0) / (params.contrast**2 * noise)
    return np.asarray(params.coarse_share / (1 + ratio), np.float32)


def _fine_cost(left: UInt8, right: UInt8, params: CensusSGM) -> UInt8:
    """Census distance plus capped colour difference, mean of the block, (H, D, W) uint8; unset before column d."""
    bits = [census_transform(to_grey(image), params.census_px) for image in (left, right)]
    channels = [_channels(image) for image in (left, right)]
    number, height, width = channels[0].shape
    finer = _FINER if params.block_size > 1 else 1
    law = min(int(params.color_cap * number), 2**16 - 1), round(65536 * finer * params.color_weight / number)
    cost = np.empty((height, params.num_disparities, width), np.uint8)
    for d in range(params.num_disparities):
        _count_differing(bits[0], bits[1], d, d, cost)
        _add_unlike(channels[0], channels[1], d, law, finer, cost)
        if params.block_size > 1:
            averaged = cv2.blur(cost[:, d, d:], (params.block_size,) * 2)
            cost[:, d, d:] = cv2.convertScaleAbs(averaged, alpha=1 / finer)
    return cost


@compiled
def _compare(roomy: UInt8 | UInt16, above: int, before: int, bits: UInt8) -> None:
    """The census transform of a picture with room beside; bits start as zeros."""
    _, height, width = bits.shape
    for y in range(height):
        here, k = roomy[y + above, before:], 0
        for v in range(2 * above + 1):
            for u in range(2 * before + 1):
                if v != above or u != before:
                    row, there, bit = bits[k // 8, y], roomy[y + v, u:], np.uint8(128 >> k % 8)
                    for x in range(width):
                        row[x] |= bit if there[x] < here[x] else np.uint8(0)
                    k += 1


@compiled
def _count_differing(left: UInt8, right: UInt8, d: int, shift: int, cost: UInt8) -> None:
    """Bits of (B, H, W) that differ between column x of the left and x - shift of the right picture: cost[:, d]."""
    planes, height, width = left.shape
    for y in range(height):
        row = cost[y, d, shift:]
        row[:] = 0
        for k in range(planes):
            a, b = left[k, y, shift:], right[k, y]
            for x in range(width - shift):
                n = np.uint8(a[x] ^ b[x])  # bits are counted in pairs, in fours, in eights
                n = np.uint8(n - ((n >> 1) & 0x55))
                n = np.uint8((n & 0x33) + ((n >> 2) & 0x33))
                row[x] += np.uint8((n + (n >> 4)) & 0x0F)


@compiled
def _add_unlike(left: UInt8, right: UInt8, d: int, law: tuple[int, int], finer: int, cost: UInt8) -> None:
    """Make cost[:, d] `finer` times as large, and add what the differences of all channels, (C, H, W), count.

    The law: up to which sum they do, and by how many 65536ths.
    """
    channels, height, width = left.shape
    cap, weight = np.uint16(law[0]), np.uint32(law[1])
    unlike = np.empty(width, np.uint16)
    for y in range(height):
        row = cost[y, d, d:]
        unlike[:] = 0
        for k in range(channels):
            a, b = left[k, y, d:], right[k, y]
            for x in range(width - d):
                unlike[x] += np.uint8(max(a[x], b[x]) - min(a[x], b[x]))
        for x in range(width - d):
            more = np.uint32(np.uint32(min(unlike[x], cap)) * weight + np.uint32(1 << 15)) >> np.uint32(16)
            row[x] = np.uint8(np.uint8(np.uint8(finer) * row[x]) + np.uint8(more))


@compiled
def _mix(coarser: UInt8, share: Float32, cost: UInt8) -> None:
    """Put the coarser size's share, rounded to whole ``_SHARES``, into a cost (H, D, W)."""
    height, depth, width = cost.shape
    whole, other = np.empty(width, np.uint8), np.empty(width, np.uint16)
    for y in range(height):
        for x in range(width):
            other[x] = round(_SHARES * share[y, x])
        for d in range(depth):
            row, half = cost[y, d], coarser[y // 2, d]
            for x in range(width // 2):
                whole[2 * x] = whole[2 * x + 1] = half[x]
            whole[width - 1] = half[(width - 1) // 2]
            for x in range(width):
                own = np.uint16(row[x] * np.uint16(_SHARES - other[x]))
                row[x] = np.uint8(np.uint16(own + np.uint16(whole[x] * other[x])) // np.uint16(_SHARES))
