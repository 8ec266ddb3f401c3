"""Filling of holes with the surfaces behind them, which go on as planes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stereolib.base import Float32, Float64, Ints
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
        dx = ((2 * k - 1) * away_px[:, None] * _PLACES).round().astype(np.intp)
        planes = planes_at(disparity, y, x, dx, _AROUND_PX)
        planes[at_border, 1] = _of_rows_around(y[at_border], planes[at_border, 1], len(disparity))
        level, slope = planes[which, :2].T
        filled[rows, at] = np.clip(level + slope * (at - from_px), 0, nearer[rows, at])
    return filled


def _of_rows_around(rows: Ints, values: Float32, height: int) -> Float32:
    """Median of the values of the rows around each, where these have one."""
    every = np.full(height + 2 * _ALIKE_ROWS, np.nan, np.float32)
    every[rows + _ALIKE_ROWS] = values
    return np.asarray(np.nanmedian(every[rows[:, None] + np.arange(2 * _ALIKE_ROWS + 1)], axis=1))


def planes_at(disparity: Float32, rows: Ints, columns: Ints, dx: Ints, dy: Ints) -> Float32:
    """Lay robust planes through a map at some valid pixels.

    Parameters
    ----------
    disparity : (H, W) float32, px, NaN is a hole
    rows, columns : (N,) int
        Where the planes are laid.
    dx : (N or 1, C) int, px
        Columns of the places around each that are looked at.
    dy : (R,) int, px
        Their rows, evenly apart.

    Returns
    -------
    (N, 3) float32
        ``a, b, c`` of ``d = a + b (x - x_0) + c (y - y_0)``: px, px per column, px per row.
    """
    off, steep = np.empty((len(rows), len(dy), dx.shape[1]), np.float32), np.empty(len(rows), np.float32)
    places = np.broadcast_to(dx, (len(rows), dx.shape[1]))
    _look(disparity, rows, columns, places, dy, off)
    _steepen(off, steep)
    steep /= np.float32(dy[1] - dy[0])
    off -= steep[:, None, None] * dy.astype(np.float32)[:, None]
    plane = np.empty((len(rows), 3), np.float32)
    _fit(off, places, dy, (_SCALES_PX[-1] / np.array([_LEVEL_PX, _SLOPE, _SLOPE])) ** 2, plane)
    return plane + np.column_stack([disparity[rows, columns], np.zeros_like(steep), steep])


@compiled
def _look(disparity: Float32, rows: Ints, columns: Ints, dx: Ints, dy: Ints, off: Float32) -> None:
    """How far disparities around N pixels are from theirs, (N, rows, places); no number beyond the map."""
    height, width = disparity.shape
    for i in range(rows.size):
        own = disparity[rows[i], columns[i]]
        for r in range(dy.size):
            y = rows[i] + dy[r]
            for c in range(dx.shape[1]):
                x = columns[i] + dx[i, c]
                inside = 0 <= y < height and 0 <= x < width
                off[i, r, c] = disparity[y, x] - own if inside else np.float32(np.nan)


@compiled
def _steepen(off: Float32, steep: Float32) -> None:
    """By how much disparities (N, rows, places) grow from row to row: the median of neighbouring rows, 0 if unknown."""
    count, rows, places = off.shape
    steps = np.empty((rows - 1) * places, np.float32)
    for i in range(count):
        known = 0
        for r in range(1, rows):
            for c in range(places):
                step = off[i, r, c] - off[i, r - 1, c]
                if np.isfinite(step):
                    steps[known] = step
                    known += 1
        steep[i] = np.median(steps[:known]) if known else np.float32(0)


@compiled
def _fit(off: Float32, dx: Ints, dy: Ints, prior: Float64, plane: Float32) -> None:
    """Robust planes through deviations (N, rows, places), no number where unknown, at dx and dy: (N, 3)."""
    for i in range(plane.shape[0]):
        a = b = c = 0.0
        for scale in _SCALES_PX:
            aa, bb, cc = prior[0], prior[1], prior[2]
            ab = ac = bc = ar = br = cr = 0.0
            for k in range(off.shape[1]):
                y = float(dy[k])
                for j in range(off.shape[2]):
                    r, x = off[i, k, j], float(dx[i, j])
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
