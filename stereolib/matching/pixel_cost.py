"""One pixel's costs, as OpenCV's semi-global matcher adds them up: the curve whose minimum is the match."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from stereolib.base import Ints, UInt8
from stereolib.matching.sgbm import SGBMParams, check_window
from stereolib.rig import check_pair, to_grey

_PATHS = {  # (columns, rows) from the pixel before to the pixel
    "sgbm": ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0)),
    "hh": ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)),
}
_LEAST_CAP = 15
_GREY_SHIFT = 2  # grey values count a quarter of what their gradients do


@dataclass(frozen=True, eq=False)
class PixelCost:
    """What each disparity costs one pixel.

    Attributes
    ----------
    disparities_px : (D,) int
    matching : (D,) int
        The mismatch of the two blocks alone.
    summed : (D,) int
        With the paths' sums; its least is the pixel's match.
    """

    disparities_px: Ints
    matching: Ints
    summed: Ints

    @property
    def best_px(self) -> int:
        """The disparity of the least sum, before it is refined to fractions of a pixel."""
        return int(self.disparities_px[self.summed.argmin()])


def pixel_cost(left: UInt8, right: UInt8, pixel: tuple[int, int], params: SGBMParams) -> PixelCost:
    """Tell what each disparity costs one pixel of a rectified pair, before and after the paths' sums.

    Only the pixels on the paths that end in this one are looked at, so that it takes a few milliseconds.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        Rectified.
    pixel : (column, row)
        In the left picture.
    params : SGBMParams
        The checks after the minimum (uniqueness, left-right, specks) and OpenCV's final 3 x 3 median take no part.

    Returns
    -------
    PixelCost

    Raises
    ------
    ValueError
        If the pixel is outside the picture or in the columns that have no match for every disparity, or the mode is
        neither ``"sgbm"`` nor ``"hh"``: the others cut their paths into stripes.

    Notes
    -----
    ``C(p, d)``: Birchfield and Tomasi's dissimilarity of the horizontal gradients, clipped at `pre_filter_cap`, plus a
    quarter of that of the grey values, summed over the block. Along each path,
    ``L(p, d) = C(p, d) + min(L(q, d), L(q, d +- 1) + P1, min_k L(q, k) + P2) - min_k L(q, k) - P2``, with q the pixel
    before p, and the sum is ``S(p, d) = sum over paths of L(p, d)``.

    References
    ----------
    H. Hirschmueller, Stereo processing by semiglobal matching and mutual information, doi:10.1109/TPAMI.2007.1166;
    S. Birchfield and C. Tomasi, A pixel dissimilarity measure that is insensitive to image sampling,
    doi:10.1109/34.677269

    Examples
    --------
    >>> left = np.random.default_rng(0).integers(0, 256, (20, 60), np.uint8)
    >>> pixel_cost(left, np.roll(left, -7, axis=1), (40, 10), SGBMParams(16, 3)).best_px
    7
    """
    check_pair(left, right)
    height, width = left.shape[:2]
    column, row = pixel
    first, last = check_window(params, width), width + min(0, params.min_disparity)
    if not (first <= column < last and 0 <= row < height):
        where = f"columns {first} to {last - 1} and rows 0 to {height - 1}"
        raise ValueError(f"pixel {pixel} has no match for every disparity: choose one in {where}")
    if params.mode not in _PATHS:
        raise ValueError(f'mode "{params.mode}" cuts its paths into stripes: choose {" or ".join(_PATHS)}')
    costs = _Costs(to_grey(left), to_grey(right), params)
    summed = sum(_path(costs, pixel, step, (first, last)) for step in _PATHS[params.mode])
    here = costs.of(np.array([column]), np.array([row]))[0]
    return PixelCost(params.min_disparity + np.arange(params.num_disparities), here, np.asarray(summed))


def _path(costs: _Costs, pixel: tuple[int, int], step: tuple[int, int], columns: tuple[int, int]) -> Ints:
    """Sum of the path that arrives at a pixel by `step`."""
    p1, p2 = costs.params.penalties
    (column, row), (right, down) = pixel, step
    inside = [np.inf]
    if right:
        inside.append(column - columns[0] if right > 0 else columns[1] - 1 - column)
    if down:
        inside.append(row if down > 0 else costs.height - 1 - row)
    back = np.arange(int(min(inside)), -1, -1)
    along = costs.of(column - right * back, row - down * back)
    path = np.zeros(costs.params.num_disparities, np.int64)
    for cost in along:
        least = path.min()
        cheapest = np.minimum(path, least + p2)
        cheapest[1:] = np.minimum(cheapest[1:], path[:-1] + p1)
        cheapest[:-1] = np.minimum(cheapest[:-1], path[1:] + p1)
        path = cost + cheapest - least - p2
    return path


class _Costs:
    """Matching costs of single pixels: each of both pictures' planes with its lowest and highest half-way value."""

    def __init__(self, left: UInt8, right: UInt8, params: SGBMParams) -> None:
        self.params, self.height, self.width = params, *left.shape
        self._planes = [
            (_between(a), [sliding_window_view(plane, params.num_disparities, axis=1) for plane in _between(b)], shift)
            for a, b, shift in (
                (_gradient(left, params.pre_filter_cap), _gradient(right, params.pre_filter_cap), 0),
                (left.astype(np.int16), right.astype(np.int16), _GREY_SHIFT),
            )
        ]

    def of(self, columns: Ints, rows: Ints) -> Ints:
        """Block costs of N pixels, (N, D)."""
        half = self.params.block_size // 2
        offsets = np.arange(-half, half + 1)
        u = (columns[:, None, None] + offsets[None, None, :]) + 0 * offsets[None, :, None]
        v = np.clip(rows[:, None, None] + offsets[None, :, None], 0, self.height - 1) + 0 * offsets[None, None, :]
        first = max(0, self.params.min_disparity + self.params.num_disparities)
        u = np.clip(u, first, self.width + min(0, self.params.min_disparity) - 1)
        start = u - self.params.min_disparity - self.params.num_disparities + 1
        total = np.zeros((*u.shape, self.params.num_disparities), np.int16)
        for (a, a_low, a_high), seen, shift in self._planes:
            here, low, high = (plane[v, u][..., None] for plane in (a, a_low, a_high))
            there, least, most = (windows[v, start][..., ::-1] for windows in seen)
            to_right = np.maximum(here - most, least - here)
            to_left = np.maximum(there - high, low - there)
            total += np.maximum(0, np.minimum(to_right, to_left)) >> shift
        return np.asarray(total.sum(axis=(1, 2), dtype=np.int64))


def _gradient(grey: UInt8, cap: int) -> Ints:
    """Horizontal Sobel gradient, clipped; constant in the outermost columns, as OpenCV has it."""
    cap = max(cap, _LEAST_CAP) | 1
    values = np.pad(grey.astype(np.int16), ((1, 1), (0, 0)), mode="edge")
    across = np.zeros_like(values)
    across[:, 1:-1] = values[:, 2:] - values[:, :-2]
    gradient = 2 * across[1:-1] + across[:-2] + across[2:]
    return np.asarray(np.clip(gradient, -cap, cap) + cap)


def _between(plane: Ints) -> tuple[Ints, Ints, Ints]:
    """A plane, and the least and the largest of its values and of those half-way to the neighbours in the row."""
    left, right = (np.pad(plane, ((0, 0), (1, 1)), mode="edge")[:, k : k + plane.shape[1]] for k in (0, 2))
    near = [plane, (plane + left) // 2, (plane + right) // 2]
    return plane, np.minimum.reduce(near), np.maximum.reduce(near)
