"""What others can have for nothing instead of "best": OpenCV's matchers, with every advantage that ours has."""

from __future__ import annotations

import cv2
import numpy as np

from stereolib.matching import SGBMParams, find_rows, left_right_check, match_pair, smooth
from stereolib.matching.levels import shaded
from stereolib.rig import to_grey

Array = np.ndarray
_BLOCK, _BM_BLOCK, _SPECKLE_PX = 5, 15, 11


def both_sides(left: Array, right: Array, num_disparities: int) -> Array:
    """`cv2.StereoSGBM` along eight paths from both sides, checked, specks removed, holes filled, median.

    The rows of the right picture are corrected by the estimator that "best" uses, its brightness is given the mean and
    the deviation of the left one, and what differs part by part is taken off as "best" does it.
    """
    grey = evened(left, right)
    every = {"disp12_max_diff": -1, "uniqueness_ratio": 0, "speckle_window_size": 0}
    params = SGBMParams(num_disparities, _BLOCK, mode="hh", **every)
    forth = match_pair(grey[0], grey[1], params, whole=True)
    back = match_pair(grey[1][:, ::-1], grey[0][:, ::-1], params, whole=True)[:, ::-1]
    kept = smooth(left_right_check(forth, back), "speckle", size_px=_SPECKLE_PX)
    return cv2.medianBlur(smooth(kept, "background"), 3)


def filled_bm(left: Array, right: Array, num_disparities: int) -> Array:
    """`cv2.StereoBM`, its holes filled from the background."""
    matched = cv2.StereoBM.create(num_disparities, _BM_BLOCK).compute(*evened(left, right)) / np.float32(16)
    return smooth(np.where(matched < 0, np.float32(np.nan), matched), "background")


def evened(left: Array, right: Array) -> tuple[Array, Array]:
    """Both in grey, with the same rows and exposure."""
    rows, rough_px = find_rows(left, right)
    first, second = to_grey(left), to_grey(rows.correct(right)).astype(np.float32)
    second = (second - second.mean()) * (first.std() / max(second.std(), 1e-6)) + first.mean()
    even = np.rint(second).clip(0, 255).astype(np.uint8)
    return shaded(first, even, rough_px), even
