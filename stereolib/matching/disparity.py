"""From a rectified pair to disparity, and from disparity to depth and back (section II.C, Fig. 2 to 4)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stereolib.base import Float32, Float64, Floats, UInt8
from stereolib.matching.pair_checks import check_sides, is_doubtful
from stereolib.matching.sgbm import SGBMParams, check_window, match_pair
from stereolib.rig import check_pair, to_grey


def compute_disparity(left: UInt8, right: UInt8, params: SGBMParams | None = None, *, whole: bool = False) -> Float32:
    """Disparity of a rectified pair by semi-global block matching.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        Rectified; colour is matched as grey.
    params : SGBMParams, optional
    whole : bool
        OpenCV returns nothing in the first ``min_disparity + num_disparities`` columns, where the window would leave
        the right image. True widens the images with their border so that those columns are matched too.

    Returns
    -------
    (H, W) float32, px
        ``d = x_left - x_right``, in steps of 1/16 px; NaN where no match was accepted.

    Raises
    ------
    ValueError
        If the images do not fit together, the window is wider than the image, or left and right are exchanged.
        Whether the pair is rectified is not looked at here: `check_rectified` does that.

    Examples
    --------
    >>> left = np.random.default_rng(0).integers(0, 256, (40, 120), np.uint8)
    >>> right = np.roll(left, -7, axis=1)  # everything 7 px further left
    >>> float(np.nanmedian(compute_disparity(left, right, SGBMParams(16))))
    7.0
    """
    params = params or SGBMParams()
    check_pair(left, right)
    reach = check_window(params, left.shape[1])
    grey_left, grey_right = to_grey(left), to_grey(right)
    disparity = match_pair(grey_left, grey_right, params, whole=whole)
    if is_doubtful(disparity[:, reach:]):
        check_sides(grey_left, grey_right)
    return disparity


def disparity_to_depth(disparity_px: npt.ArrayLike, f_px: float, baseline_mm: float) -> Float64:
    """Depth by triangulation, ``Z = f B / d``.

    Parameters
    ----------
    disparity_px : (H, W) array
        NaN, infinite or <= 0 is invalid.
    f_px, baseline_mm : float
        Of the rectified rig.

    Returns
    -------
    (H, W) float64, mm, NaN where invalid

    Raises
    ------
    ValueError
        If no disparity is valid, or f or B is not positive.

    Examples
    --------
    >>> disparity_to_depth([100.0, 50.0, np.nan], f_px=760, baseline_mm=93)
    array([ 706.8, 1413.6,    nan])
    """
    if not (f_px > 0 and baseline_mm > 0):
        raise ValueError(f"focal length and baseline must be positive, got {f_px} px and {baseline_mm} mm")
    disparity = np.asarray(disparity_px, float)
    valid = np.isfinite(disparity) & (disparity > 0)
    if not valid.any():
        advice = "Check that the pair is rectified, the search window covers the scene, and the surfaces have texture"
        raise ValueError(f"the disparity map of shape {disparity.shape} is empty: no pixel was matched. {advice}")
    depth_mm: Float64 = f_px * baseline_mm / np.where(valid, disparity, np.nan)
    return depth_mm


def depth_to_disparity(depth_mm: npt.ArrayLike, f_px: float, baseline_mm: float) -> Float64:
    """Disparity of a depth, ``d = f B / Z``: inverse of `disparity_to_depth`.

    Parameters
    ----------
    depth_mm : array_like
        Along the optical axis of the rectified left camera, mm.
    f_px, baseline_mm : float
        Of the rectified rig.

    Returns
    -------
    float64 of the same shape, px
        NaN where the depth is not above 0; 0 of an infinite one.

    Examples
    --------
    >>> float(depth_to_disparity(706.8, f_px=760, baseline_mm=93))
    100.0
    """
    depth = np.asarray(depth_mm, np.float64)
    disparity_px: Float64 = f_px * baseline_mm / np.where(depth > 0, depth, np.nan)
    return disparity_px


def left_right_check(left_px: Floats, right_px: Floats, tolerance_px: float = 1.0) -> Floats:
    """Keep the left disparities with which the right view's disparity at the matched pixel agrees.

    Parameters
    ----------
    left_px, right_px : (H, W) float, px
        Disparity of the left and of the right image, both positive.
    tolerance_px : float
        Largest disagreement, px.

    Returns
    -------
    (H, W) float as `left_px`, px
        NaN where the two disagree, or the match lies outside the right image.

    Raises
    ------
    ValueError
        If the maps differ in shape.

    Examples
    --------
    >>> left, right = np.full((1, 4), 1.0), np.array([[1.0, 5.0, 1.0, np.nan]])
    >>> left_right_check(left, right)
    array([[nan,  1., nan,  1.]])
    """
    with np.errstate(invalid="ignore"):
        return np.where(left_right_difference(left_px, right_px) <= tolerance_px, left_px, np.nan)


def left_right_difference(left_px: Floats, right_px: Floats) -> Floats:
    """How far the right view's disparity at the matched pixel is off the left one, ``|d_l(x) - d_r(x - d_l(x))|``.

    Parameters
    ----------
    left_px, right_px : (H, W) float, px
        Disparity of the left and of the right image, both positive.

    Returns
    -------
    (H, W) float as `left_px`, px
        NaN where either is, or the match lies outside the right image.

    Raises
    ------
    ValueError
        If the maps differ in shape.

    Examples
    --------
    >>> left_right_difference(np.full((1, 4), 1.0), np.array([[1.0, 5.0, 1.0, np.nan]]))
    array([[nan,  0.,  4.,  0.]])
    """
    left_px, right_px = np.asarray(left_px), np.asarray(right_px)
    if left_px.ndim != 2 or left_px.shape != right_px.shape:
        raise ValueError(f"both views' maps must be (H, W), got {left_px.shape} and {right_px.shape}")
    width = left_px.shape[1]
    target = np.where(np.isfinite(left_px), np.rint(np.arange(width) - np.nan_to_num(left_px)), -1).astype(int)
    other = np.take_along_axis(right_px, np.clip(target, 0, width - 1), axis=1)
    difference: Floats = np.where((target >= 0) & (target < width), np.abs(other - left_px), np.nan)
    return difference
