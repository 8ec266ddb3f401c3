"""From a rectified pair to disparity, and from disparity to depth (sections II.C, Fig. 2 to 4)."""

from __future__ import annotations

import cv2
import numpy as np

from stereolib.matching.sgbm import SGBMParams, check_window
from stereolib.rig import check_pair, to_grey

# The settings next door are reached through here too.
__all__ = [
    "SGBMParams", "check_rectified", "check_told", "check_window", "compute_disparity", "depth_to_disparity",
    "disparity_to_depth", "left_right_check", "raw_disparity",
]  # fmt: skip

Array = np.ndarray
_KEYPOINTS = 300  # at most, in each picture
_LEAST_MATCHES = 50  # that tell something of a pair's rows


def compute_disparity(left: Array, right: Array, params: SGBMParams | None = None, *, whole: bool = False) -> Array:
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
    """
    params = params or SGBMParams()
    check_pair(left, right)
    reach = check_window(params, left.shape[1])
    grey_left, grey_right = to_grey(left), to_grey(right)
    disparity = _match(grey_left, grey_right, params, reach if whole else 0)
    seen = disparity[:, reach:]
    if np.count_nonzero(np.isnan(seen)) > 0.6 * seen.size:
        _check_sides(grey_left, grey_right)
    return disparity


def raw_disparity(left: Array, right: Array, params: SGBMParams, border: int = 0) -> Array:
    """What OpenCV returns, unchecked: (H, W) int16, 1/16 px, less than ``16 min_disparity`` where there is no match.

    `left` and `right` are (H, W) uint8. A border widens them first, so that the columns at the left are matched too.
    """
    if border:
        left, right = (cv2.copyMakeBorder(i, 0, 0, border, 0, cv2.BORDER_REPLICATE) for i in (left, right))
    return params.matcher().compute(left, right)[:, border:]


def check_rectified(left: Array, right: Array, limit_px: float = 1.0) -> float:
    """Refuse a pair whose rows do not agree, or whose sides are exchanged.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
    limit_px : float
        Largest root mean square of the vertical offset, px.

    Returns
    -------
    float
        The offset's root mean square, px; NaN where too little can be matched to tell.

    Raises
    ------
    ValueError
        With the rms that was measured.
    """
    check_pair(left, right)
    a, b = _matched_points(left, right)
    if not a.size or np.median(a[:, 0] - b[:, 0]) < 0:  # else the points say already which side is which
        _check_sides(to_grey(left), to_grey(right))
    offsets = b[:, 1] - a[:, 1]
    rms = float(np.sqrt((offsets**2).mean())) if offsets.size else float("nan")
    if rms > limit_px:
        raise ValueError(
            f"the pair is not rectified: over {offsets.size} matched points the rows differ by {rms:.1f} px rms "
            f"(median {np.median(offsets):+.1f} px), at most {limit_px:g} px is allowed. Rectify it with its "
            f"calibration (RectifiedRig.rectify)"
        )
    return rms


def check_told(left: Array, right: Array, names: tuple[str, str] = ("left", "right")) -> None:
    """Refuse a pair in which no disparity can be told (ValueError): one picture twice, or one of a single grey value.

    `left` and `right` are (H, W) or (H, W, 3) uint8.
    """
    check_pair(left, right, names)
    for name, image in zip(names, (left, right), strict=True):
        if np.ptp(to_grey(image)) == 0:
            raise ValueError(f"{name} has one grey value, {to_grey(image)[0, 0]}: there is nothing to match; was the "
                             f"lens covered?")  # fmt: skip
    if np.array_equal(left, right):
        raise ValueError(f"{names[0]} and {names[1]} are the same picture, every disparity would be 0: give the left "
                         f"and the right camera's")  # fmt: skip


def disparity_to_depth(disparity_px: Array, f_px: float, baseline_mm: float) -> Array:
    """Depth by triangulation, ``Z = f B / d``.

    Parameters
    ----------
    disparity_px : (H, W) array
        NaN or <= 0 is invalid.
    f_px, baseline_mm : float
        Of the rectified rig.

    Returns
    -------
    (H, W) float64, mm, NaN where invalid

    Raises
    ------
    ValueError
        If no disparity is valid, or f or B is not positive.
    """
    if not (f_px > 0 and baseline_mm > 0):
        raise ValueError(f"focal length and baseline must be positive, got {f_px} px and {baseline_mm} mm")
    disparity = np.asarray(disparity_px, float)
    valid = disparity > 0
    if not valid.any():
        raise ValueError(
            f"the disparity map of shape {disparity.shape} is empty: no pixel was matched. Check that the pair is "
            f"rectified, the search window covers the scene, and the surfaces have texture"
        )
    return f_px * baseline_mm / np.where(valid, disparity, np.nan)


def depth_to_disparity(depth_mm: Array, f_px: float, baseline_mm: float) -> Array:
    """Disparity of a depth, ``d = f B / Z``: inverse of `disparity_to_depth`."""
    return f_px * baseline_mm / np.asarray(depth_mm, float)


def left_right_check(left_px: Array, right_px: Array, tolerance_px: float = 1.0) -> Array:
    """Left disparity where the right view's disparity at the matched pixel agrees, NaN elsewhere.

    Parameters
    ----------
    left_px, right_px : (H, W) float
        Disparity of the left and of the right image, both positive.
    """
    width = left_px.shape[1]
    column = np.arange(width)
    valid = np.isfinite(left_px)
    target = np.where(valid, np.rint(column - np.nan_to_num(left_px)), -1).astype(int)
    inside = valid & (target >= 0)
    other = np.take_along_axis(right_px, np.clip(target, 0, width - 1), axis=1)
    with np.errstate(invalid="ignore"):
        return np.where(inside & (np.abs(other - left_px) <= tolerance_px), left_px, np.nan)


def _match(left: Array, right: Array, params: SGBMParams, border: int) -> Array:
    raw = raw_disparity(left, right, params, border)
    disparity = raw * np.float32(1 / 16)
    invalid = raw < 16 * params.min_disparity
    if border:  # a match outside the right image is a match with the border's copies
        invalid |= disparity > np.arange(disparity.shape[1], dtype=np.float32)
    np.putmask(disparity, invalid, np.nan)
    return disparity


def _matched_points(left: Array, right: Array) -> tuple[Array, Array]:
    """Points (n, 2) of the left and of the right picture that belong together, px; none where too few can be matched.

    SIFT keypoints of the pictures in half size, matched both ways. The rows' offset changes slowly over the image, so
    that matches further than 2 px from a plane through it (fitted three times over) are mistaken and are left out.
    """
    sift, none = cv2.SIFT.create(nfeatures=_KEYPOINTS), np.zeros((0, 2))
    small = [cv2.resize(to_grey(i), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for i in (left, right)]
    points, looks = zip(*(sift.detectAndCompute(image, None) for image in small), strict=True)
    if min(map(len, points)) < _LEAST_MATCHES:
        return none, none
    pairs = cv2.BFMatcher(cv2.NORM_L2, crossCheck=True).match(*looks)
    a = 2 * np.array([points[0][pair.queryIdx].pt for pair in pairs])
    b = 2 * np.array([points[1][pair.trainIdx].pt for pair in pairs])
    offset, likely = b[:, 1] - a[:, 1], np.abs(b[:, 1] - a[:, 1]) < 0.15 * left.shape[0]
    at = np.column_stack([np.ones(len(a)), a / left.shape[1]])
    plane = np.array([np.median(offset[likely]) if likely.any() else 0.0, 0.0, 0.0])
    for limit in (6.0, 3.0, 2.0):
        kept = likely & (np.abs(offset - at @ plane) < limit)
        if kept.sum() < max(_LEAST_MATCHES, 0.2 * likely.sum()):
            return none, none  # chance matches prove nothing
        plane = np.linalg.lstsq(at[kept], offset[kept], rcond=None)[0]
    kept = np.abs(offset - at @ plane) < 2.0
    return a[kept], b[kept]


def _check_sides(left: Array, right: Array) -> None:
    """Refuse a pair that matches clearly better the other way round; looked at in half size."""
    left, right = (cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for image in (left, right))
    params = SGBMParams(num_disparities=max(16, left.shape[1] // 5 // 16 * 16))
    if left.shape[1] < 2 * params.num_disparities:
        return  # too narrow to tell
    matched = [np.isfinite(_match(a, b, params, 0)).mean() for a, b in ((left, right), (right, left))]
    if matched[1] > max(0.3, 2 * matched[0]):  # chance matches in noise prove nothing
        raise ValueError(
            "left and right are exchanged: matches run the other way (x_left - x_right is negative); swap the images"
        )
