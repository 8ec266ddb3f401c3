"""From a rectified pair to disparity, and from disparity to depth (sections II.C, Fig. 2 to 4)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.images import check_pair, to_grey

Array = np.ndarray
_MODES = {
    "sgbm": cv2.STEREO_SGBM_MODE_SGBM,
    "hh": cv2.STEREO_SGBM_MODE_HH,
    "3way": cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    "hh4": cv2.STEREO_SGBM_MODE_HH4,
}


@dataclass(frozen=True)
class SGBMParams:
    """Parameters of `cv2.StereoSGBM`, checked; nothing is rounded silently.

    Parameters
    ----------
    num_disparities : int, px
        Width of the search window, a multiple of 16.
    block_size : int, px
        Odd edge of the matched block.
    min_disparity : int, px
        Where the search window begins.
    p1, p2 : int or None
        Penalties for a disparity step of one and of more pixels; None takes ``8 b^2`` and ``32 b^2``.
    disp12_max_diff : int, px
        Largest disagreement with the match from right to left; -1 leaves the check out.
    uniqueness_ratio : int, %
        By how much the best match must beat the second.
    speckle_window_size, speckle_range : int
        Patches smaller than this many pixels, whose disparities differ by less than the range, are removed.
    pre_filter_cap : int
        Clip of the prefiltered image's gradient.
    mode : {"sgbm", "hh", "3way", "hh4"}
        Five paths, eight, three, four.

    Raises
    ------
    ValueError
        The text says which neighbouring values are valid.
    """

    num_disparities: int = 128
    block_size: int = 5
    min_disparity: int = 0
    p1: int | None = None
    p2: int | None = None
    disp12_max_diff: int = 1
    uniqueness_ratio: int = 10
    speckle_window_size: int = 100
    speckle_range: int = 2
    pre_filter_cap: int = 63
    mode: str = "sgbm"

    def __post_init__(self) -> None:
        for name in ("num_disparities", "block_size", "min_disparity"):
            if not isinstance(getattr(self, name), int | np.integer):
                raise ValueError(f"{name} is a whole number of pixels, got {getattr(self, name)!r}")
        n, block = self.num_disparities, self.block_size
        if n < 16 or n % 16:
            below = max(16, n // 16 * 16)
            raise ValueError(
                f"num_disparities must be a positive multiple of 16, got {n}; near are {below}, {below + 16}"
            )
        if block < 1 or block % 2 == 0:
            near = max(1, block - 1 if block % 2 == 0 else 1)
            raise ValueError(f"block_size must be odd and at least 1, got {block}; near are {near}, {near + 2}")
        p1, p2 = self.penalties
        if not 0 < p1 < p2:
            raise ValueError(f"the penalties must satisfy 0 < p1 < p2, got p1={p1}, p2={p2}")
        if self.mode not in _MODES:
            raise ValueError(f"unknown mode {self.mode!r}; choose one of {', '.join(_MODES)}")
        if not 0 <= self.uniqueness_ratio <= 100:
            raise ValueError(f"uniqueness_ratio is a percentage, got {self.uniqueness_ratio}")

    @property
    def penalties(self) -> tuple[int, int]:
        """The penalties in force, ``8 b^2`` and ``32 b^2`` unless given."""
        area = self.block_size**2
        return 8 * area if self.p1 is None else self.p1, 32 * area if self.p2 is None else self.p2

    def matcher(self) -> cv2.StereoSGBM:
        """A new `cv2.StereoSGBM` with these parameters."""
        p1, p2 = self.penalties
        return cv2.StereoSGBM.create(
            self.min_disparity, self.num_disparities, self.block_size, p1, p2, self.disp12_max_diff,
            self.pre_filter_cap, self.uniqueness_ratio, self.speckle_window_size, self.speckle_range, _MODES[self.mode],
        )  # fmt: skip


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
    """
    params = params or SGBMParams()
    check_pair(left, right)
    reach = max(0, params.min_disparity + params.num_disparities)
    if reach + params.block_size // 2 >= left.shape[1]:
        raise ValueError(
            f"the search window ends at {reach} px, the image is {left.shape[1]} px wide and blocks are "
            f"{params.block_size} px: reduce num_disparities, min_disparity or block_size"
        )
    grey_left, grey_right = to_grey(left), to_grey(right)
    disparity = _match(grey_left, grey_right, params, reach if whole else 0)
    if np.isnan(disparity[:, reach:]).mean() > 0.6 and _exchanged(grey_left, grey_right):
        raise ValueError(
            "left and right are exchanged: matches run the other way (x_left - x_right is negative); swap the images"
        )
    return disparity


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
        If no disparity is valid, or the focal length or the baseline is not positive.
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
    if border:
        left, right = (cv2.copyMakeBorder(i, 0, 0, border, 0, cv2.BORDER_REPLICATE) for i in (left, right))
    raw = params.matcher().compute(left, right)[:, border:]
    disparity = raw.astype(np.float32)
    disparity *= 1 / 16
    disparity[raw < 16 * params.min_disparity] = np.nan
    if border:  # a match outside the right image is a match with the border's copies
        disparity[disparity > np.arange(disparity.shape[1])] = np.nan
    return disparity


def _exchanged(left: Array, right: Array) -> bool:
    """Whether the pair matches clearly better the other way round; looked at in half size."""
    left, right = (cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for image in (left, right))
    params = SGBMParams(num_disparities=max(16, left.shape[1] // 5 // 16 * 16))
    if left.shape[1] < 2 * params.num_disparities:
        return False  # too narrow to tell
    matched = [np.isfinite(_match(a, b, params, 0)).mean() for a, b in ((left, right), (right, left))]
    return bool(matched[1] > max(0.3, 2 * matched[0]))  # chance matches in noise prove nothing
