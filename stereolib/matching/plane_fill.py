"""Filling of holes with the surfaces behind them, as planes, or with those around them that have their colour."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Bools, Float32, Float64, Ints, UInt8
from stereolib.matching.compiled import compiled
from stereolib.matching.filling import check_map, fill_background, nearest_columns, neighbours

# Where a surface is looked at from the last pixel before a hole, px: away from the hole, and in the rows around. At
# the left border, where holes are long, it is looked at as far as the hole goes, but no farther than this.
_AWAY_PX, _AROUND_PX, _FARTHEST_PX = 31, np.arange(-24, 25, 6), 200
_PLACES = np.linspace(0, 1, 8)  # of that way
_SCALES_PX = (2.0, 1.0, 0.5)  # of the robust weights, one round each
_LEVEL_PX, _SLOPE = 2.0, 0.04  # deviations of the plane from the pixel's own disparity and from level, before looking
_LEAST_HOLE_PX = 4  # shorter ones are filled level
_ALIKE_ROWS = 20  # above and below, with whose slopes a row goes on to the left border
# Colours: of a pixel, of a surface, how far from its rim that is looked at, window of the vote.
_OWN_PX, _SURFACE_PX, _INSIDE_PX, _VOTE_PX = 5, 9, 5, 15
_SIDES = (0, 0, -1, 1), (-1, 1, 0, 0)  # rows and columns: left, right, above, below
_ANOTHER_PX, _ALIKE, _LEAST_UNLIKE = 2.0, 0.5, 9.0  # px; share of the given one's difference of colour; grey levels


def continue_background(disparity_px: npt.ArrayLike) -> Float32:
    """Fill holes from the background as `fill_background` does, but let its surfaces go on as planes.

    Parameters
    ----------
    disparity_px : (H, W) float, px, NaN is a hole

    Returns
    -------
    (H, W) float32, px
        NaN only if nothing was valid at all.

    Raises
    ------
    ValueError
        If the map is none.

    Notes
    -----
    To the last valid pixel (x_0, y_0) on the farther side a plane ``d = a + b (x - x_0) + c (y - y_0)`` is fitted, over
    72 places within 31 columns beyond it and 24 rows around, by ``min sum rho(r_i) + prior``: three rounds of least
    squares with the weights ``1 / (1 + (r / s)^2)^2``, s = 2, 1, 0.5 px, so that other surfaces drop out. The prior
    holds a to the pixel's disparity (2 px), b to 0 and c to the median step between neighbouring rows of places (0.04),
    where few places tell: without that step rows of a floor would lie so far off the first plane as to drop out. The
    row is filled with ``a + b (x - x_0)``; between two sides never nearer than both, and never behind infinity. Holes
    at the left border are as wide as the disparities are large: there the places lie within as many columns as the hole
    has, up to 200, and b is the median of those of the rows around, 20 above and 20 below, else every row would go its
    own way.

    Examples
    --------
    >>> wall = np.tile(np.linspace(10, 14, 41, dtype=np.float32), (21, 1))
    >>> seen = np.where(np.arange(41) < 10, np.nan, wall)
    >>> [round(float(filled[10, 0]), 1) for filled in (fill_background(seen), continue_background(seen))]
    [11.0, 10.2]
    """
    disparity, _ = check_map(disparity_px)
    width = disparity.shape[1]
    nearest = nearest_columns(disparity)
    before, after = sides = neighbours(disparity, nearest)
    filled = np.fmin(before, after)
    if np.isnan(filled).any():  # rows without anything
        filled = fill_background(disparity)
    length = nearest[1] - nearest[0] - 1
    nearer = np.where(np.isnan(before + after), np.float32(np.inf), np.maximum(before, after))
    for k, is_farther in enumerate(((before <= after) | np.isnan(after), (after < before) | np.isnan(before))):
        rows, at = np.nonzero(np.isnan(disparity) & (length >= _LEAST_HOLE_PX) & is_farther & np.isfinite(sides[k]))
        from_px = nearest[k][rows, at]
        ends, first, which = np.unique(rows * width + from_px, return_index=True, return_inverse=True)
        y, x = np.divmod(ends, width)
        at_border = (length[rows, at][first] == x) & (k == 1)
        away_px = np.where(at_border, np.clip(x, _AWAY_PX, _FARTHEST_PX), _AWAY_PX)
        planes = _planes(disparity, y, x, (2 * k - 1) * away_px)
        planes[at_border, 1] = _of_rows_around(y[at_border], planes[at_border, 1], len(disparity))
        level, slope = planes[which].T
        filled[rows, at] = np.clip(level + slope * (at - from_px), 0, nearer[rows, at])
    return filled


def fill_by_color(filled_px: Float32, disparity_px: Float32, left: UInt8) -> Float32:
    """Give holes to a surface left, right, above or below of them instead, where that has their colour.

    A row goes on with the farther of its two surfaces, and at the border with the one it has; what a third one has
    there, or the nearer one where nothing is hidden, the picture tells.

    Parameters
    ----------
    filled_px : (H, W) float32, px
        As `continue_background` gives it.
    disparity_px : (H, W) float32, px, NaN is a hole
        Before it was filled.
    left : (H, W) or (H, W, 3) uint8
        The rectified left picture.

    Returns
    -------
    (H, W) float32, px
        A hole takes the disparity of the nearest valid pixel to one of its four sides if that differs by more than 2 px
        and the colours there, 5 px on, differ from the hole's by less than half of what those of the farther surface of
        its row do, which must be 9 grey levels or more (root mean square of the channels); the one most alike, of
        several. Nothing nearer is taken at the left border, nor where the nearer surface of the row hides the other:
        ``d_right - d_left`` pixels left of it. Where most holes within 15 px stay, it stays.

    Examples
    --------
    >>> seen = np.full((60, 60), 30, np.float32)
    >>> seen[30:], seen[:30, :30] = 10, np.nan  # a near thing above, which the right picture sees from column 30 on
    >>> left = np.full((60, 60), 50, np.uint8)
    >>> left[:30, 20:] = 200  # it ends at column 20
    >>> filled = fill_by_color(continue_background(seen), seen, left)
    >>> filled[10, [5, 25, 40]]
    array([10., 30., 30.], dtype=float32)
    """
    hole = np.isnan(disparity_px)
    y, x = np.nonzero(hole)
    if not 0 < y.size < hole.size:
        return filled_px
    picture = np.atleast_3d(left)
    own, around = (np.atleast_3d(cv2.blur(picture, (size, size))).astype(np.int16) for size in (_OWN_PX, _SURFACE_PX))
    every = np.empty((4, *hole.shape), np.int32)
    _find_rims(~hole, every)
    rims = every[:, y, x]
    there = rims >= 0
    rim_y, rim_x = np.divmod(np.maximum(rims, 0), hole.shape[1])
    level = np.where(there, disparity_px[rim_y, rim_x], np.float32(np.nan))
    on_y, on_x = (
        np.clip(rim + _INSIDE_PX * np.array(way)[:, None], 0, size - 1)
        for rim, way, size in zip((rim_y, rim_x), _SIDES, hole.shape, strict=True)
    )
    differs = _square(own[y, x] - around[on_y, on_x])
    given = np.where((level[0] <= level[1]) | ~there[1], differs[0], differs[1])  # of the farther one of the row
    hidden = ~there[0] | (rim_x[1] - x <= level[1] - level[0])
    nearer = level - filled_px[y, x]
    other = (np.abs(nearer) > _ANOTHER_PX) & ~(hidden & (nearer > 0))
    differs[~other | (differs >= _ALIKE**2 * given) | (given <= _LEAST_UNLIKE**2)] = np.inf
    chosen, is_taken = level[differs.argmin(axis=0), np.arange(y.size)], np.isfinite(differs.min(axis=0))
    taken = np.zeros(hole.shape, np.float32)
    taken[y, x] = is_taken
    votes, of = (cv2.blur(a, (_VOTE_PX, _VOTE_PX), borderType=cv2.BORDER_REPLICATE) for a in (taken, np.float32(hole)))
    is_taken &= (votes > 0.5 * of)[y, x]
    out = filled_px.copy()
    out[y[is_taken], x[is_taken]] = chosen[is_taken]
    return out


@compiled
def _find_rims(known: Bools, rims: Ints) -> None:
    """Flat index of the nearest known pixel to the left, right, above and below, (4, H, W); -1 where there is none."""
    height, width = known.shape
    for y in range(height):
        at = -1
        for x in range(width):
            at = y * width + x if known[y, x] else at
            rims[0, y, x] = at
            rims[2, y, x] = at if known[y, x] else rims[2, y - 1, x] if y > 0 else -1
        at = -1
        for x in range(width - 1, -1, -1):
            at = y * width + x if known[y, x] else at
            rims[1, y, x] = at
    for y in range(height - 1, -1, -1):
        for x in range(width):
            rims[3, y, x] = y * width + x if known[y, x] else rims[3, y + 1, x] if y + 1 < height else -1


def _square(colour: npt.NDArray[np.int16]) -> Float32:
    return np.asarray((colour.astype(np.float32) ** 2).mean(axis=-1))


def _of_rows_around(rows: Ints, values: Float32, height: int) -> Float32:
    """Median of the values of the rows around each, where these have one."""
    every = np.full(height + 2 * _ALIKE_ROWS, np.nan, np.float32)
    every[rows + _ALIKE_ROWS] = values
    return np.asarray(np.nanmedian(every[rows[:, None] + np.arange(2 * _ALIKE_ROWS + 1)], axis=1))


def _steepness(seen: Float32) -> Float32:
    """By how much disparities (N, places) grow from row to row, px per px: the median of neighbouring rows. (N,)."""
    rows = seen.reshape(len(seen), len(_AROUND_PX), len(_PLACES))
    steps = np.diff(rows, axis=1).reshape(len(seen), (len(_AROUND_PX) - 1) * len(_PLACES))
    steps[np.isnan(steps).all(axis=1)] = 0.0
    return np.asarray(np.nanmedian(steps, axis=1) / np.float32(np.diff(_AROUND_PX)[0]))


def _planes(disparity: Float32, rows: Ints, columns: Ints, away_px: Ints) -> Float32:
    """Level (px) and slope along the row of the planes at some pixels, (N, 2); their surfaces lie so far to a side."""
    share, dy = (offset.ravel() for offset in np.meshgrid(_PLACES, _AROUND_PX))
    dx = (away_px[:, None] * share).round()
    y, x = rows[:, None] + dy, (columns[:, None] + dx).astype(np.intp)
    inside = (y >= 0) & (y < disparity.shape[0]) & (x >= 0) & (x < disparity.shape[1])
    seen = np.where(inside, disparity[np.where(inside, y, 0), np.where(inside, x, 0)], np.float32(np.nan))
    own = disparity[rows, columns]
    off = seen - own[:, None] - _steepness(seen)[:, None] * dy.astype(np.float32)
    plane = np.empty((len(rows), 3), np.float32)
    prior = (_SCALES_PX[-1] / np.array([_LEVEL_PX, _SLOPE, _SLOPE])) ** 2
    _fit(off, dx.astype(np.float32), dy.astype(np.float32), prior, plane)
    return np.column_stack([own + plane[:, 0], plane[:, 1]])


@compiled
def _fit(off: Float32, dx: Float32, dy: Float32, prior: Float64, plane: Float32) -> None:
    """Robust planes through deviations (N, places), no number where unknown, at columns dx and rows dy: (N, 3)."""
    for i in range(plane.shape[0]):
        a = b = c = 0.0
        for scale in _SCALES_PX:
            aa, bb, cc = prior[0], prior[1], prior[2]
            ab = ac = bc = ar = br = cr = 0.0
            for k in range(off.shape[1]):
                r, x, y = off[i, k], dx[i, k], dy[k]
                if not np.isfinite(r):
                    continue
                weight = 1 / (1 + ((r - a - b * x - c * y) / scale) ** 2) ** 2
                aa, ab, ac = aa + weight, ab + weight * x, ac + weight * y
                bb, bc, cc = bb + weight * x * x, bc + weight * x * y, cc + weight * y * y
                ar, br, cr = ar + weight * r, br + weight * x * r, cr + weight * y * r
            # Gauss, by hand: the prior makes every pivot positive
            bb, bc, br = bb - ab * ab / aa, bc - ab * ac / aa, br - ab * ar / aa
            c = (cr - ac * ar / aa - bc * br / bb) / (cc - ac * ac / aa - bc * bc / bb)
            b = (br - bc * c) / bb
            a = (ar - ab * b - ac * c) / aa
        plane[i, 0], plane[i, 1], plane[i, 2] = a, b, c
