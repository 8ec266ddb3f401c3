"""Filling of holes with the surfaces behind them: as planes, and at the left border with those of their colour."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Float32, Ints, UInt8
from stereolib.matching.filling import check_map, fill_background, neighbours

# Where a surface is looked at from the last pixel before a hole, px: away from the hole, and in the rows around.
_AWAY_PX, _AROUND_PX = np.linspace(0, 31, 8).round(), np.linspace(-20, 20, 7).round()
_SCALES_PX = (2.0, 1.0, 0.5)  # of the robust weights, one round each
_LEVEL_PX, _SLOPE = 2.0, 0.04  # deviations of the plane from the pixel's own disparity and from level, before looking
_LEAST_HOLE_PX = 4  # shorter ones are filled level
# Colours at the left border: of a pixel, of a surface, how far from its rim that is looked at, window of the vote.
_OWN_PX, _SURFACE_PX, _INSIDE_PX, _VOTE_PX = 5, 9, 5, 15
_BEHIND_PX, _ALIKE, _LEAST_UNLIKE = 2.0, 0.4, 9.0  # px; share of the nearer one's difference of colour; grey levels


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
    56 places within 31 columns beyond it and 20 rows around, by ``min sum rho(r_i) + prior``: three rounds of least
    squares with the weights ``1 / (1 + (r / s)^2)^2``, s = 2, 1, 0.5 px, so that other surfaces drop out. The prior
    holds a to the pixel's disparity (2 px) and b, c to 0 (0.04), where few places tell. The row is filled with
    ``a + b (x - x_0)``; between two sides never nearer than both, and never behind infinity.

    Examples
    --------
    >>> wall = np.tile(np.linspace(10, 14, 41, dtype=np.float32), (21, 1))
    >>> seen = np.where(np.arange(41) < 10, np.nan, wall)
    >>> [round(float(filled[10, 0]), 1) for filled in (fill_background(seen), continue_background(seen))]
    [11.0, 10.2]
    """
    disparity, _ = check_map(disparity_px)
    filled, columns = fill_background(disparity), np.arange(disparity.shape[1], dtype=np.float32)
    before, after = sides = neighbours(disparity)
    nearest = neighbours(np.where(np.isnan(disparity), np.float32(np.nan), columns))
    length = np.nan_to_num(nearest[1], nan=len(columns)) - np.nan_to_num(nearest[0], nan=-1) - 1
    nearer = np.where(np.isnan(before + after), np.float32(np.inf), np.maximum(before, after))
    for k, is_farther in enumerate(((before <= after) | np.isnan(after), (after < before) | np.isnan(before))):
        rows, at = np.nonzero(np.isnan(disparity) & (length >= _LEAST_HOLE_PX) & is_farther & np.isfinite(sides[k]))
        from_px = nearest[k][rows, at].astype(np.intp)
        ends, which = np.unique(rows * len(columns) + from_px, return_inverse=True)
        planes = _planes(disparity, *np.divmod(ends, len(columns)), away=2 * k - 1)
        level, slope = planes[which].T
        filled[rows, at] = np.clip(level + slope * (at - from_px), 0, nearer[rows, at])
    return filled


def behind_border(filled_px: Float32, disparity_px: Float32, left: UInt8) -> Float32:
    """Give holes at the left border to a surface above or below instead, where that is farther and has their colour.

    Where a near surface leaves the right picture, its row goes on with it to the border, though it may end before.

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
        A hole takes the disparity of the nearest valid pixel above or below if that is farther by more than 2 px and
        the colours there, 5 px on, differ from the hole's by less than 0.4 of what those of its row do, which must be
        9 grey levels or more (root mean square of the channels). Where most pixels within 15 px stay, it stays.

    Examples
    --------
    >>> seen = np.full((60, 60), 30, np.float32)
    >>> seen[30:], seen[:30, :30] = 10, np.nan  # a near thing above, which the right picture sees from column 30 on
    >>> left = np.full((60, 60), 50, np.uint8)
    >>> left[:30, 20:] = 200  # it ends at column 20
    >>> filled = behind_border(continue_background(seen), seen, left)
    >>> filled[10, [5, 25, 40]]
    array([10., 30., 30.], dtype=float32)
    """
    known, rows_px = np.isfinite(disparity_px), np.arange(len(disparity_px), dtype=np.intp)[:, None]
    first = np.where(known.any(axis=1), known.argmax(axis=1), 0)
    if not (width := int(first.max())):
        return filled_px
    known, part = known[:, :width], np.atleast_3d(left)[:, : width + _SURFACE_PX]
    own, around = (np.atleast_3d(cv2.blur(part, (size, size))).astype(np.int16) for size in (_OWN_PX, _SURFACE_PX))
    # the first row and the last one may be holes: NaN
    above, after = (np.maximum.accumulate(np.where(k, rows_px, 0), axis=0) for k in (known, known[::-1]))
    below = len(known) - 1 - after[::-1]
    hole = np.arange(width) < first[:, None]
    least, level = np.full(known.shape, np.inf, np.float32), np.full(known.shape, np.nan, np.float32)
    for rim, on in ((above, -_INSIDE_PX), (below, _INSIDE_PX)):
        found = np.take_along_axis(disparity_px[:, :width], rim, axis=0)
        y, x = np.nonzero(hole & (found < filled_px[:, :width] - _BEHIND_PX))
        differs = _square(own[y, x] - around[(rim[y, x] + on).clip(0, len(known) - 1), x])
        in_row = _square(own[y, x] - around[y, np.minimum(first[y] + _INSIDE_PX, around.shape[1] - 1)])
        better = (differs < _ALIKE**2 * in_row) & (in_row > _LEAST_UNLIKE**2) & (differs < least[y, x])
        y, x = y[better], x[better]
        least[y, x], level[y, x] = differs[better], found[y, x]
    share = cv2.blur(np.isfinite(level).astype(np.float32), (_VOTE_PX, _VOTE_PX), borderType=cv2.BORDER_REPLICATE)
    taken = (share > 0.5) & np.isfinite(level)
    out = filled_px.copy()
    out[:, :width][taken] = level[taken]
    return out


def _square(colour: npt.NDArray[np.int16]) -> Float32:
    return np.asarray((colour.astype(np.float32) ** 2).mean(axis=-1))


def _planes(disparity: Float32, rows: Ints, columns: Ints, away: int) -> Float32:
    """Level (px) and slope along the row of the planes at some pixels, (N, 2); the surface lies left (-1) or right."""
    dx, dy = (offset.ravel() for offset in np.meshgrid(away * _AWAY_PX, _AROUND_PX))
    y, x = ((at[:, None] + by).astype(np.intp) for at, by in ((rows, dy), (columns, dx)))
    inside = (y >= 0) & (y < disparity.shape[0]) & (x >= 0) & (x < disparity.shape[1])
    seen = np.where(inside, disparity[np.where(inside, y, 0), np.where(inside, x, 0)], np.float32(np.nan))
    known, own = np.isfinite(seen), disparity[rows, columns]
    off = np.where(known, seen - own[:, None], np.float32(0))
    along = np.column_stack([np.ones_like(dx), dx, dy]).astype(np.float32)
    squares = (along[:, :, None] * along[:, None, :]).reshape(-1, 9)
    prior = np.diag((_SCALES_PX[-1] / np.array([_LEVEL_PX, _SLOPE, _SLOPE])) ** 2).astype(np.float32)
    plane = np.zeros((len(rows), 3), np.float32)
    for scale in _SCALES_PX:
        weight = known / (1 + ((off - plane @ along.T) / np.float32(scale)) ** 2) ** 2
        normal = (weight @ squares).reshape(-1, 3, 3) + prior
        plane = np.linalg.solve(normal, ((weight * off) @ along)[..., None])[..., 0]
    return np.column_stack([own + plane[:, 0], plane[:, 1]])
