"""What a second, rough matching of a pair has against a disparity map: patches mistaken as a whole, nearer things."""

from __future__ import annotations

import cv2
import numpy as np

from stereolib.base import Bools, Float32, Ints

_STEP_PX = 1.0  # neighbours farther apart are two surfaces
_AGREE_PX = 2.0
_HOLE_PX = 14  # within what is nearer than a range: as near
_LEAST_AGREEING = 0.1  # share of a surface's pixels; chosen on cluttered and layered scenes that judge nothing


def unsupported(disparity_px: Float32, matched: Bools, rough_px: Float32) -> Bools:
    """Find matched patches with which a rough matching of the same pair does not agree.

    Parameters
    ----------
    disparity_px : (H, W) float32, px
    matched : (H, W) bool
        Pixels that may be refused.
    rough_px : (H / 2, W / 2) float32, px of the half size
        As `find_rows` gives it; NaN where nothing was matched.

    Returns
    -------
    (H, W) bool
        Pixels of surfaces of which less than a tenth agrees within 2 px. A surface is what hangs together by steps of
        at most 1 px. None where the rough matching tells nothing at all.

    Notes
    -----
    What one camera alone sees is at times matched with a thing that looks like it, from either side. Such patches are
    islands: a large surface is not refused for the pixels in which the rough matching has holes.

    Examples
    --------
    >>> map_px = np.full((8, 20), 6, np.float32)
    >>> map_px[2:6, 12:16] = 40
    >>> unsupported(map_px, map_px > 0, np.full((4, 10), 3, np.float32)).sum()
    np.int64(16)
    """
    height, width = disparity_px.shape
    if not np.isfinite(rough_px).any():
        return np.zeros((height, width), bool)
    twice = 2 * cv2.resize(rough_px, (width, height), interpolation=cv2.INTER_NEAREST)
    agrees = np.abs(disparity_px - twice) <= _AGREE_PX
    surface = _surfaces(disparity_px, matched)
    area, agreeing = (np.bincount(surface.ravel(), weights=mask.ravel()) for mask in (matched, matched & agrees))
    return np.asarray(matched & (agreeing < _LEAST_AGREEING * area)[surface])


def beyond_range(rough_px: Float32, num_disparities: int, shape: tuple[int, int]) -> Bools:
    """Find what a rough matching of the same pair knows to be nearer than a range that was searched.

    Parameters
    ----------
    rough_px : (H / 2, W / 2) float32, px of the half size
        As `find_rows` gives it; NaN where nothing was matched.
    num_disparities : int, px
        Of the whole size.
    shape : (int, int)
        H and W.

    Returns
    -------
    (H, W) bool
        Such pixels, and the holes of up to 14 px between them.

    Examples
    --------
    >>> rough = np.full((40, 60), 3, np.float32)
    >>> rough[10:30, 20:50], rough[15:20, 25:30] = 40, np.nan
    >>> [int(beyond_range(rough, most, (80, 120)).sum()) for most in (96, 32)]
    [0, 2400]
    """
    with np.errstate(invalid="ignore"):
        near = (2 * rough_px > num_disparities).astype(np.uint8)
    closed = cv2.morphologyEx(near, cv2.MORPH_CLOSE, np.ones((_HOLE_PX // 2, _HOLE_PX // 2), np.uint8))
    return np.asarray(cv2.resize(closed, shape[::-1], interpolation=cv2.INTER_NEAREST) > 0)


def _surfaces(disparity_px: Float32, matched: Bools) -> Ints:
    """Number the surfaces; 0 is what was not matched. Pixels and the steps between them are nodes of one grid."""
    height, width = disparity_px.shape
    grid = np.zeros((2 * height - 1, 2 * width - 1), np.uint8)
    grid[::2, ::2] = matched
    for along, between in ((0, grid[1::2, ::2]), (1, grid[::2, 1::2])):
        here, there = (slice(None, -1), slice(None)), (slice(1, None), slice(None))
        if along:
            here, there = here[::-1], there[::-1]
        between[...] = matched[here] & matched[there] & (np.abs(np.diff(disparity_px, axis=along)) <= _STEP_PX)
    return np.asarray(cv2.connectedComponents(grid, connectivity=4)[1][::2, ::2])
