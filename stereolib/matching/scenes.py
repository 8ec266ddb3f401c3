"""What a scene asks of a matcher: the size of its texture, its near edge, the width of its search window."""

from __future__ import annotations

import numpy as np

from stereolib.base import Bools, Floats, UInt8
from stereolib.matching.disparity import compute_disparity
from stereolib.matching.scoring import check_mask, score
from stereolib.matching.sgbm import SGBMParams
from stereolib.rig import to_grey

_ENOUGH_PCT = 5.0  # a window serves from this share of bad pixels (2 px) down


def near_edge_mask(truth_px: Floats, on_object: Bools, half_width_px: int = 3) -> Bools:
    """Find an object's pixels around its nearest column in each row: the vertical edge whose height is wanted.

    Parameters
    ----------
    truth_px : (H, W) float, px
    on_object : (H, W) bool
    half_width_px : int
        Columns to either side, px.

    Returns
    -------
    (H, W) bool

    Raises
    ------
    ValueError
        If the object is no mask of the map's shape.

    Examples
    --------
    >>> near_edge_mask(np.array([[5.0, 6, 9, 7, 6]]), np.ones((1, 5), bool), half_width_px=1).astype(int)
    array([[0, 1, 1, 1, 0]])
    """
    on_object = check_mask(on_object, np.shape(truth_px), "on_object")
    nearest = np.where(on_object & np.isfinite(truth_px), truth_px, -np.inf).argmax(axis=1)[:, None]
    return np.asarray(on_object & (np.abs(np.arange(on_object.shape[1]) - nearest) <= half_width_px))


def smallest_window(left: UInt8, right: UInt8, truth_px: Floats, where: Bools, *, widest: int = 192) -> int:
    """Find the fewest disparities, from 0 on, at which `where` has at most 5 % bad pixels (2 px).

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        Rectified.
    truth_px : (H, W) float, px
    where : (H, W) bool
        Pixels to look at.
    widest : int, px
        The last window tried.

    Returns
    -------
    int, px
        A multiple of 16.

    Raises
    ------
    ValueError
        If no window up to `widest` does.
    """
    for count in range(16, widest + 1, 16):
        disparity = compute_disparity(left, right, SGBMParams(count), whole=True)
        if score(disparity, truth_px, where).bad2_pct <= _ENOUGH_PCT:
            return count
    raise ValueError(f"even {widest} disparities leave more than {_ENOUGH_PCT:g} % bad pixels: it is not the window")


def correlation_length_px(image: UInt8, where: Bools) -> float:
    """Measure a texture's size along the rows: the shift at which its correlation with itself falls to 1/e.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
    where : (H, W) bool
        The textured surface.

    Returns
    -------
    float, px

    Raises
    ------
    ValueError
        If there is nothing to see: an empty mask, or one grey value only; or if the correlation does not fall so far
        within half of the picture.

    Examples
    --------
    >>> stripes = np.tile(np.uint8([0, 0, 0, 200, 200, 200]), (4, 20))
    >>> round(correlation_length_px(stripes, np.ones(stripes.shape, bool)), 2)
    0.96
    """
    grey = to_grey(image).astype(float)
    where = check_mask(where, grey.shape)
    if not where.any() or np.ptp(grey[where]) == 0:
        raise ValueError("no texture to measure: the mask is empty or the surface has one grey value")
    grey = np.where(where, grey - grey[where].mean(), 0.0)
    limit = image.shape[1] // 2
    weight = np.array([(where[:, k:] & where[:, : image.shape[1] - k]).sum() for k in range(limit)])
    product = np.array([(grey[:, k:] * grey[:, : image.shape[1] - k]).sum() for k in range(limit)])
    correlation = product / np.maximum(weight, 1)
    correlation /= correlation[0]
    below = int((correlation < np.exp(-1)).argmax())
    if not below:
        raise ValueError(f"the texture is larger than {limit} px along the rows: its correlation does not fall to 1/e")
    step = correlation[below - 1] - correlation[below]
    return float(below - 1 + (correlation[below - 1] - np.exp(-1)) / step)
