"""Filling of holes with the surfaces around them: each goes on as a plane, and all holes choose together."""

from __future__ import annotations

import math

import cv2
import numpy as np

from stereolib.base import Bools, Float32, Ints, UInt8
from stereolib.matching.compiled import compiled
from stereolib.matching.plane_fill import continue_background, planes_at

# Rows and columns of a step of the sixteen rays along which a hole sees what is around it.
_RAYS = np.array([(y, x) for y in range(-2, 3) for x in range(-2, 3) if math.gcd(y, x) == 1], np.intp)
_AROUND_PX = np.arange(-24, 25, 8)  # rows and columns around a rim that tell its plane
_OWN_PX, _SURFACE_PX, _INSIDE = 3, 9, 3  # colours: of a pixel, of a surface, how many steps beyond its rim
_MOST_UNLIKE = 4.0  # colours can speak against a surface by so much
_NEVER = 100.0  # far more than colour and four paths' neighbours can be together, 44
_BEFORE_PX = 1.5  # nearer by more hides what is behind; nearer or farther by less is the same surface
_EACH_PX, _APART, _EDGE = 0.6, 10.0, 5.0  # of neighbours: a pixel between them, the most; grey levels that halve that
_GUIDE_PX = 3  # median of the picture whose edges make steps cheap


def fill_from_around(
    disparity_px: Float32,
    guess_px: Float32,
    right_px: Float32,
    left: UInt8,
    *,
    unlike: float = 12.0,
    other: float = 1.7,
) -> Float32:
    """Give holes to the surfaces around them: by colour, by what the right camera saw, and as their neighbours are.

    Parameters
    ----------
    disparity_px : (H, W) float32, px, NaN is a hole
    guess_px : (H, W) float32, px
        What holes may have instead, as small islands of matches that are not trusted; NaN where there is none.
    right_px : (H, W) float32, px
        Disparity of the right view, NaN where unknown.
    left : (H, W) or (H, W, 3) uint8
        The rectified left picture.
    unlike : float
        Grey levels, root mean square of the channels: colours that differ by so much are hardly one.
    other : float
        What speaks against all but the first choice. Both were chosen on virtual scenes by
        `benchmarks/choose_best.py`.

    Returns
    -------
    (H, W) float32, px
        NaN only if nothing was valid at all, whatever the guesses.

    Raises
    ------
    ValueError
        If the maps and the picture differ in height or width, or a setting is not positive and finite.

    Notes
    -----
    From a hole p sixteen rays go to the next valid pixels. Through each of these a robust plane is laid
    (`plane_fill.planes_at`), from 49 places within 24 px; ``d_k(p)`` is the plane of ray k at p, neither behind
    infinity nor nearer than the nearest match; d_0, the first choice, is the guess, or as the row goes on by itself
    (`continue_background`). Against a choice speaks

    ``E_k(p) = min(|c(p) - c_k|^2 / (2 unlike^2), 4) + other [k > 0] + 100 [r(x - d_k) < d_k - 1.5]``

    with c(p) the colour of 3 x 3 px, c_k that of 9 x 9 px three steps beyond the end of the ray, no farther than the
    picture's rim (mean square of the channels; for d_0 it is that of the farther side of the row, or 4 counts if that
    has none; against a guess no colour speaks), and r what the right view has there, if the left one has it, too,
    within 1.5 px: had p such a disparity, it would hide that. Neighbours p and q differ at a price
    of ``min(0.6 |d_k(p) - d_m(q)|, 10 / (1 + s / 5))``, s the step of the picture from one to the other (3 x 3 median,
    the channel that steps most); valid pixels have one choice only, which costs nothing. As in semi-global matching,
    prices are summed up along rows and columns, there and back, and each hole takes the least sum of its four paths,
    its own price counted once.

    Examples
    --------
    >>> seen = np.full((60, 60), 30, np.float32)
    >>> seen[30:], seen[:30, :30] = 10, np.nan  # a near thing above, which the right picture sees from column 30 on
    >>> left = np.full((60, 60), 50, np.uint8)
    >>> left[:30, 20:] = 200  # it ends at column 20
    >>> nothing = np.full((60, 60), np.nan, np.float32)
    >>> filled = fill_from_around(seen, nothing, nothing, left)
    >>> filled[10, [5, 25, 40]]
    array([10., 30., 30.], dtype=float32)
    """
    shapes = disparity_px.shape, guess_px.shape, right_px.shape, left.shape[:2]
    if len(set(shapes)) > 1:
        raise ValueError("the maps have shapes {}, {} and {}, the picture {}".format(*shapes))
    if not (0 < unlike < np.inf and 0 < other < np.inf):
        raise ValueError(f"need finite unlike > 0 and other > 0; got {unlike}, {other}")
    filled = continue_background(disparity_px)
    hole = np.isnan(disparity_px)
    y, x = np.nonzero(hole)
    if not 0 < y.size < hole.size:
        return filled
    index = np.full(hole.shape, -1, np.intp)
    index[y, x] = np.arange(y.size)
    rims = np.empty((y.size, len(_RAYS)), np.intp)
    _find_rims(index, y, x, _RAYS, rims)
    guess = guess_px[y, x]
    own = np.where(np.isnan(guess), filled[y, x], guess)
    choices = np.column_stack([own, np.where(rims < 0, own[:, None], _at_holes(disparity_px, y, x, rims))])
    against = np.minimum(_unlike(left, disparity_px, y, x, rims) / np.float32(2 * unlike**2), np.float32(_MOST_UNLIKE))
    against[np.isfinite(guess), 0] = 0
    against[:, 1:] += np.float32(other)
    against[_hides(choices, y, x, disparity_px, right_px)] += np.float32(_NEVER)
    total = _with_neighbours(disparity_px, left, index, choices, against)
    filled[y, x] = choices[np.arange(y.size), total.argmin(axis=1)]
    return filled


def _with_neighbours(disparity_px: Float32, left: UInt8, index: Ints, choices: Float32, against: Float32) -> Float32:
    """What speaks against each choice with all that its neighbours choose along four paths, (N, choices)."""
    guide = np.atleast_3d(cv2.medianBlur(left, _GUIDE_PX)).astype(np.int16)
    (y, x), (height, width) = np.nonzero(index >= 0), index.shape
    total = -3 * against
    for down, right in ((-1, 0), (0, -1), (0, 1), (1, 0)):
        v, u = y + down, x + right
        inside = (v >= 0) & (v < height) & (u >= 0) & (u < width)
        v, u = np.where(inside, v, y), np.where(inside, u, x)
        before = np.where(inside, index[v, u], -1)
        most = np.float32(_APART) / (1 + np.abs(guide[v, u] - guide[y, x]).max(axis=1) / np.float32(_EDGE))
        first = np.fmin(np.float32(_EACH_PX) * np.abs(choices - disparity_px[v, u, None]), most[:, None])
        first[~inside] = 0
        _add_path(before, most, first, choices, against, total)
    return total


def _at_holes(disparity_px: Float32, y: Ints, x: Ints, rims: Ints) -> Float32:
    """What the planes at the rims are at the holes, (N, rays) px; no matter what where a ray meets nothing."""
    ends = np.zeros(disparity_px.size, np.intp)
    ends[rims[rims >= 0]] = 1
    rows, columns = np.divmod(np.flatnonzero(ends), disparity_px.shape[1])
    planes, number = planes_at(disparity_px, rows, columns, _AROUND_PX[None], _AROUND_PX), np.cumsum(ends) - 1
    found = np.empty(rims.shape, np.float32)
    for k, which in enumerate(number[rims].T):
        level, along, steep = planes[which].T
        found[:, k] = level + along * (x - columns[which]) + steep * (y - rows[which])
    return np.asarray(found.clip(0, max(float(np.nanmax(disparity_px)), 0.0)))


def _unlike(left: UInt8, disparity_px: Float32, y: Ints, x: Ints, rims: Ints) -> Float32:
    """Mean square difference of colours between holes and surfaces, (N, 1 + rays); first that of the row's own."""
    picture = np.atleast_3d(left)
    height, width = disparity_px.shape
    own, around = (np.atleast_3d(cv2.blur(picture, (size, size))) for size in (_OWN_PX, _SURFACE_PX))
    end_y, end_x = np.divmod(rims, width)
    square, here = np.empty(rims.shape, np.float32), own[y, x].astype(np.float32)
    for k, (down, right) in enumerate(_INSIDE * _RAYS):
        there = around[np.clip(end_y[:, k] + down, 0, height - 1), np.clip(end_x[:, k] + right, 0, width - 1)]
        square[:, k] = ((there - here) ** 2).mean(axis=1)
    square[rims < 0] = np.inf
    before, after = (_RAYS.tolist().index([0, side]) for side in (-1, 1))
    levels = (np.where(rims[:, k] < 0, np.inf, disparity_px[end_y[:, k], end_x[:, k]]) for k in (before, after))
    return np.column_stack([np.where(np.less_equal(*levels), square[:, before], square[:, after]), square])


def _hides(choices: Float32, y: Ints, x: Ints, disparity_px: Float32, right_px: Float32) -> Bools:
    """Which choices would hide what the right view has at their place, and the left one has seen, too. (N, choices)."""
    columns = np.arange(right_px.shape[1])
    back = np.nan_to_num(columns + right_px, nan=-1).round().astype(np.intp)
    there = disparity_px[np.arange(len(right_px))[:, None], np.clip(back, 0, columns[-1])]
    known = (back >= 0) & (back <= columns[-1]) & (np.abs(there - right_px) <= _BEFORE_PX)
    seen = np.where(known, right_px, np.float32(np.inf))
    at = (x[:, None] - choices).round().astype(np.intp)
    inside = (at >= 0) & (at <= columns[-1])
    return np.asarray(inside & (seen[y[:, None], np.clip(at, 0, columns[-1])] < choices - np.float32(_BEFORE_PX)))


@compiled
def _find_rims(index: Ints, y: Ints, x: Ints, rays: Ints, rims: Ints) -> None:
    """Flat index of the first valid pixel along each ray, (N, rays), -1 for none; `index` of a hole, -1 elsewhere."""
    height, width = index.shape
    for k in range(rays.shape[0]):
        down, right = rays[k, 0], rays[k, 1]
        onward = down < 0 or (down == 0 and right < 0)  # the hole one step on must have its own before
        for i in range(y.size):
            at = i if onward else y.size - 1 - i
            v, u = y[at] + down, x[at] + right
            if not (0 <= v < height and 0 <= u < width):
                rims[at, k] = -1
            elif index[v, u] < 0:
                rims[at, k] = v * width + u
            else:
                rims[at, k] = rims[index[v, u], k]


@compiled
def _add_path(before: Ints, most: Float32, first: Float32, choices: Float32, against: Float32, total: Float32) -> None:
    """Add the sums along one path to `total`, (N, choices).

    `before` is the hole that each comes from, on the same side of all in their order, `most` (N,) the highest price of
    the way from there; where there is none, -1, each choice costs `first`.
    """
    count, many = choices.shape
    path = np.empty((count, many), np.float32)
    onward = (before < np.arange(count)).all()
    for i in range(count):
        at = i if onward else count - 1 - i
        came = before[at]
        if came < 0:
            path[at] = against[at] + first[at]
        else:
            least = path[came].min()
            for k in range(many):
                price = most[at]
                for m in range(many):
                    so_far = path[came, m] - least
                    if so_far < price:
                        price = min(price, so_far + np.float32(_EACH_PX) * abs(choices[at, k] - choices[came, m]))
                path[at, k] = against[at, k] + price
        total[at] += path[at]
