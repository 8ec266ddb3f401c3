"""From a rectified pair to disparity, and from disparity to depth (sections II.C, Fig. 2 to 4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from stereolib.images import check_pair, to_grey
from stereolib.rig import RectifiedRig

Array = np.ndarray
_MODES = {"sgbm": cv2.STEREO_SGBM_MODE_SGBM, "hh": cv2.STEREO_SGBM_MODE_HH, "3way": cv2.STEREO_SGBM_MODE_SGBM_3WAY}
_MODES["hh4"] = cv2.STEREO_SGBM_MODE_HH4
_LARGEST = 32767  # OpenCV adds up costs in 16 bits
_LEAST_ROOM = 88  # grey levels; see SGBMParams.room
_KEYPOINTS = 300  # at most, in each picture
_LEAST_MATCHES = 50  # that tell something of a pair's rows


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
        n, block = self.num_disparities, self.block_size
        if not all(isinstance(value, int | np.integer) for value in (n, block, self.min_disparity)):
            raise ValueError(f"whole numbers of pixels are needed, got {n!r}, {block!r} and {self.min_disparity!r}")
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
        if self.room < _LEAST_ROOM:
            most = _LARGEST - _LEAST_ROOM * block**2
            smaller = f"p2 up to {most} (and p1 below it), or " if most > 1 else ""
            raise ValueError(
                f"block_size {block} with p2={p2} runs over: OpenCV adds up costs in 16 bits, and {self.room:.0f} grey "
                f"levels a pixel are left for a mismatch, {_LEAST_ROOM} are needed. Take {smaller}a block of at most "
                f"15 with the usual penalties"
            )

    @classmethod
    def for_range(cls, rig: RectifiedRig, near_mm: float, far_mm: float = np.inf, **fields: Any) -> SGBMParams:
        """The smallest search window that holds everything between two depths.

        Parameters
        ----------
        rig : RectifiedRig
        near_mm, far_mm : float
            Depth along the left camera's optical axis, mm.
        **fields
            The other parameters.

        Raises
        ------
        ValueError
            If not ``0 < near_mm < far_mm``.

        Notes
        -----
        ``d = f B / Z`` at both ends, and one pixel more on either side: a match at the window's end has no
        neighbour to be interpolated with.

        Examples
        --------
        >>> from stereolib.paper import paper_rig
        >>> params = SGBMParams.for_range(paper_rig().rectify(), near_mm=600, far_mm=1200)
        >>> params.min_disparity, params.num_disparities
        (58, 64)
        """
        if not 0 < near_mm < far_mm:
            raise ValueError(f"depths must satisfy 0 < near_mm < far_mm, got {near_mm:g} and {far_mm:g}")
        largest, smallest = (rig.f_px * rig.baseline_mm / depth for depth in (near_mm, far_mm))
        first = int(np.floor(smallest)) - 1 if np.isfinite(far_mm) else 0
        count = int(np.ceil(largest)) + 2 - first
        return cls(num_disparities=-(-count // 16) * 16, min_disparity=first, **fields)

    @property
    def penalties(self) -> tuple[int, int]:
        """The penalties in force, ``8 b^2`` and ``32 b^2`` unless given."""
        area = self.block_size**2
        return 8 * area if self.p1 is None else self.p1, 32 * area if self.p2 is None else self.p2

    @property
    def room(self) -> float:
        """Mean cost of a pixel, grey levels, at which a block's cost and P2 together leave OpenCV's 16 bits.

        ``(32767 - P2) / b^2``. A pixel's cost is at most 63 from the grey values and twice `pre_filter_cap` from their
        gradients, so that nothing can run over from 189 on (block 11 with the usual penalties). Real mismatches cost
        less: with 88 recordings, the motorcycle pair and noisy pictures are as good as ever; with 81 (block 17) a dim
        picture has more than twice as many bad pixels, and from 59 on (block 19) all of them fall apart.
        """
        return (_LARGEST - self.penalties[1]) / self.block_size**2

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


def check_window(params: SGBMParams, width_px: int) -> int:
    """Refuse a search window that the image cannot hold (ValueError); return where it ends, px."""
    reach = max(0, params.min_disparity + params.num_disparities)
    if reach + params.block_size // 2 >= width_px:
        raise ValueError(
            f"the search window ends at {reach} px, the image is {width_px} px wide and blocks are "
            f"{params.block_size} px: reduce num_disparities, min_disparity or block_size"
        )
    return reach


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
