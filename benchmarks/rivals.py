"""What others can have for nothing instead of "best": OpenCV's matchers.

The one that "best" is held against is what others have: it gets the same rows and brightness, and settings that were
chosen on the same scenes by the same procedure (``choose_best.py``). `with_our_steps` has what "best" does after the
matching, too.
"""

from __future__ import annotations

import cv2
import numpy as np

from stereolib.matching import SGBMParams, even_out, find_rows, left_right_check, match_pair, pipelines, smooth
from stereolib.matching.census_sgm import SGMResult
from stereolib.matching.levels import shaded
from stereolib.rig import to_grey

Array = np.ndarray
_BM_BLOCK = 15
#: Chosen by ``choose_best.py``; the penalties are so many times the block's pixels.
CHOSEN = {
    "block_size": 1,
    "p1_times": 12,
    "p2_times": 32,
    "speckle_px": 5,
    "median_px": 5,
    "pre_filter_cap": 31,
    "check_px": 1,
}


def both_sides(left: Array, right: Array, num_disparities: int, setting: dict[str, int] = CHOSEN) -> Array:
    """`cv2.StereoSGBM` along eight paths from both sides, checked, specks removed, holes filled, median.

    The rows of the right picture are corrected by the estimator that "best" uses, its brightness is given the mean and
    the deviation of the left one, and what differs part by part is taken off as "best" does it.
    """
    kept, _ = matched_twice(*evened(left, right), num_disparities, setting)
    return cv2.medianBlur(smooth(kept, "background"), setting["median_px"])


def with_our_steps(left: Array, right: Array, num_disparities: int) -> Array:
    """The same matcher on the pictures that "best" matches, and all that "best" does after its own."""
    even = even_out(left, right)
    kept, back = matched_twice(to_grey(even.left), to_grey(even.right), num_disparities, CHOSEN)
    found = SGMResult(kept, back, np.ones_like(kept))
    return pipelines.fill_matched(found, even, pipelines.FillSteps(rim_px=CHOSEN["speckle_px"])).disparity_px


def matched_twice(left: Array, right: Array, num_disparities: int, setting: dict[str, int]) -> tuple[Array, Array]:
    """What the left view sees as the right one does, less specks, and what the right one sees, px."""
    block, area = setting["block_size"], setting["block_size"] ** 2
    every = {"disp12_max_diff": setting["check_px"], "uniqueness_ratio": 0, "speckle_window_size": 0}
    penalties = {"p1": setting["p1_times"] * area, "p2": setting["p2_times"] * area}
    params = SGBMParams(
        num_disparities, block, mode="hh", pre_filter_cap=setting["pre_filter_cap"], **every, **penalties
    )
    forth = match_pair(left, right, params, whole=True)
    back = match_pair(right[:, ::-1], left[:, ::-1], params, whole=True)[:, ::-1]
    return smooth(left_right_check(forth, back), "speckle", size_px=setting["speckle_px"]), back


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
