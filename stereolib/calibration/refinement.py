"""Corners to sub-pixel: each in a window of its own, that never reaches over the board's rim."""

from __future__ import annotations

import cv2
import numpy as np

from stereolib.base import Bools, Float32, Float64, UInt8

#: Steps, and px: to the end, where one of 1e-3 px stops elsewhere on every processor; as fast, most corners take few.
_CORNER_STOP = (100, 1e-7)
_HALF_WINDOW_PX = (2, 15)  # less holds no gradient, more reaches over what a lens bends
_CLEAR_PX = 2.0  # kept between window and rim: the gradient's own pixel, and half of an edge's blur
_STRAYS, _STRAYS_PX = 0.1, 1.5  # of a square's edge, and px: off by more, an outermost corner is another one
_LEAST_ROWS = 4  # a row led on from three inner ones, whose opposite one may be an outermost row too
_ASKED = np.arange(0.06, 1.0, 0.02)  # squares beyond the last corners: where the rim is looked for
_AWAY = 0.3  # of the way from a square's own grey to its neighbour's: half of what a table behind the board differs by
_LEAST_CONTRAST = 12.0  # grey levels between two squares: less tells no rim


def refine(grey: UInt8, corners_px: Float32, rows: int, *, reach: float = 0.5) -> Float32:
    """Move corners onto the grey-value gradient (Foerstner, `cv2.cornerSubPix`).

    The window reaches some share of the shortest edge between corners, within 2 to 15 px. Boards are printed with
    outermost squares of any width: where those end is looked for in the picture (`rim_distance`), and the windows
    of the outermost corners stay before it. They begin where the inner corners lead to if they were found elsewhere,
    since a detector may take the rim's corners for them, and one that ends elsewhere, or has no room for a window, is
    not found.

    Parameters
    ----------
    grey : (H, W) uint8
    corners_px : (N, 2) float32, px
        Row by row; NaN where a corner was not found.
    rows : int
    reach : float
        Half of the window, as a share of the shortest edge.

    Returns
    -------
    (N, 2) float32, px
        NaN where a corner was not found; all, if no two of them are neighbours, which tell how large windows may be.
    """
    grid = corners_px.astype(np.float32, copy=True).reshape(rows, -1, 2)
    edges = np.concatenate([np.linalg.norm(np.diff(grid, axis=axis), axis=2).ravel() for axis in (0, 1)])
    if np.isnan(edges).all():
        return np.full_like(corners_px, np.nan)
    usual = int(np.clip(reach * np.nanmin(edges), *_HALF_WINDOW_PX))
    inner, corner = np.zeros((2, *grid.shape[:2]), bool)
    inner[1:-1, 1:-1], corner[:: rows - 1, :: grid.shape[1] - 1] = True, True
    _settle(grey, grid, inner, np.full(inner.shape, usual))
    for outermost in (~inner & ~corner, corner):  # what leads to the board's four corners is settled before them
        expected, strays = extrapolated(grid), max(_STRAYS_PX, _STRAYS * float(np.nanmin(edges)))
        moved = outermost & (np.linalg.norm(grid - expected, axis=2) > strays)
        grid[moved] = expected[moved]
        room = window_room_px(grey, grid)
        grid[outermost & (room < _HALF_WINDOW_PX[0])] = np.nan
        _settle(grey, grid, outermost, np.minimum(usual, room))
        grid[outermost & (np.linalg.norm(grid - expected, axis=2) > strays)] = np.nan
    return grid.reshape(-1, 2)


def _settle(grey: UInt8, grid_px: Float32, chosen: Bools, halves: Float64) -> None:
    """Refine the chosen corners in place, each in a window of its own size."""
    chosen, halves = chosen & np.isfinite(grid_px[..., 0]), halves.astype(int)
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, *_CORNER_STOP)
    for half in np.unique(halves[chosen]).tolist():
        at = chosen & (halves == half)
        grid_px[at] = cv2.cornerSubPix(grey, grid_px[at].reshape(-1, 1, 2), (half, half), (-1, -1), criteria)[:, 0]


def extrapolated(grid_px: Float32) -> Float32:
    """Lead corners on to the outermost ones by their second differences: to the board's four corners both ways.

    Parameters
    ----------
    grid_px : (rows, columns, 2) float32, px

    Returns
    -------
    (rows, columns, 2) float32, px
        NaN for inner corners, and where fewer than three in a row are known.

    Examples
    --------
    >>> grid = np.stack(np.meshgrid([0, 1, 4, 9, 16], [0.0, 1, 2, 3, 4]), -1).astype(np.float32)
    >>> extrapolated(grid)[:2, 0]
    array([[0., 0.],
           [0., 1.]], dtype=float32)
    """
    leads = np.full((2, *grid_px.shape), np.nan, np.float32)  # along columns, along rows
    for turn in range(4):
        turned, lead = np.rot90(grid_px, turn), np.rot90(leads[turn % 2], turn)  # a view: what is written stays
        if len(turned) >= _LEAST_ROWS:
            lead[0] = 3 * (turned[1] - turned[2]) + turned[3]
    known = np.isfinite(leads)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(known, leads, 0).sum(axis=0) / known.sum(axis=0), np.float32)


def window_room_px(grey: UInt8, grid_px: Float32) -> Float64:
    """Tell how large half of each corner's window may be before it meets the board's rim. (rows, columns), px.

    A window stands upright in the picture: half of it, h, reaches ``h (|n_x| + |n_y|)`` towards a rim of normal n.
    """
    room = np.full(grid_px.shape[:2], np.inf)
    for turn in range(4):  # each side in turn comes first
        turned, there = np.rot90(grid_px, turn), np.rot90(room, turn)  # a view: what is written stays
        along = turned[0, -1] - turned[0, 0]
        normal = np.array([-along[1], along[0]]) / np.linalg.norm(along)
        distance = rim_distance(grey, turned)
        outwards = np.abs((turned[0] - turned[1]) @ normal)
        np.minimum(there[0], (distance * outwards - _CLEAR_PX) / np.abs(normal).sum(), out=there[0])
    return np.asarray(np.nan_to_num(room, nan=np.inf))


def rim_distance(grey: UInt8, grid_px: Float32) -> float:
    """Tell where the squares beyond the first row of corners end, in squares; infinite if not within one.

    Along the middle of each of those squares the grey value is that of the square two rows further in, up to the
    board's rim; where it has left for the other colour, or for what lies behind the board, the square ends.
    """
    middle = (grid_px[:, 1:] + grid_px[:, :-1]) / 2  # of the edges between corners, row by row
    step = middle[0] - middle[1]
    first, second, beyond = (middle[0] + t * step for t in (-0.5, -1.5, 0.0))
    path = beyond[:, None] + _ASKED[:, None] * step[:, None]
    profile, neighbour, own = (_grey_at(grey, at) for at in (path, first, second))
    contrast = neighbour - own
    with np.errstate(divide="ignore", invalid="ignore"):
        away = np.abs(profile - own[:, None]) / np.abs(contrast)[:, None]
    away[~(np.abs(contrast) > _LEAST_CONTRAST)] = 0.0
    begun = np.logical_or.accumulate(away < _AWAY, axis=1)  # the first samples may still lie in the blurred line
    ended = begun & (away > _AWAY)
    ends = np.where(ended.any(axis=1), _ASKED[ended.argmax(axis=1)], np.inf)
    ends = np.where(begun.any(axis=1), ends, _ASKED[away.argmin(axis=1)])  # a square narrower than the blur
    return float(ends.min())


def _grey_at(grey: UInt8, at_px: Float32) -> Float64:
    where = np.asarray(at_px, np.float32).reshape(-1, 1, 2)
    found = cv2.remap(grey, where, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found.reshape(at_px.shape[:-1]), float)
