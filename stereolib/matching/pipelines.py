"""Whole ways from a rectified pair to a disparity map, by name: what the paper did, what is fast, what is best.

The settings of "best" were chosen on virtual scenes by `benchmarks/choose_best.py`, its standard deviations calibrated
on the same scenes by `benchmarks/bench_pipeline.py`; the photographs on which both are tested took no part.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np

from stereolib.matching import census_sgm, filling, filters
from stereolib.matching.disparity import compute_disparity, left_right_check
from stereolib.matching.sgbm import SGBMParams, check_window
from stereolib.rig import check_pair, to_grey

Array = np.ndarray
_SPECKLE_PX = 11  # patches below 11 x 11 px go
_MEDIAN_PX = 5
_BLUR_FROM_GREY = 1.0  # grey levels of noise from which on the pictures are blurred before matching
#: Limits between classes, and the standard deviation in px of each, over five cluttered virtual scenes in three lights,
#: rectified as well as rigs are (the cube alone is too easy: it would promise more than other scenes keep). Matched
#: pixels are told apart by the margin of their minimum, on smooth surfaces and beside steps: the 68th percentile of the
#: absolute error. Filled ones are told apart by how far their two neighbours in the row lie apart: there a guess is
#: right or wrong by the whole gap, a percentile would hide the wrong ones, and the root mean square error is taken,
#: classes put together until it does not fall with the gap. The limits of the margin are its 10th, 25th, 45th, 65th and
#: 85th percentile.
MARGINS = (50.0, 90.0, 136.0, 187.0, 259.0)
GAPS_PX = (0.5, 1.0, 4.0, 16.0, 1000.0)
SIGMA_PX = {
    "smooth": (0.99, 0.85, 0.6, 0.38, 0.26, 0.24),
    "step": (2.36, 2.54, 2.66, 1.68, 0.67, 0.33),
    "filled": (8.94, 8.94, 8.94, 9.39, 13.99, 30.83),
}


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a pipeline returns.

    ``disparity_px`` (H, W) float32, NaN where unknown. ``std_px`` (H, W) float32, standard deviation of each disparity,
    or None: only ``"best"`` has one. It is the error of pixels of the same kind in virtual scenes (`SIGMA_PX`): of
    matched pixels the half width that holds 68 % of the errors, at most 3 px; of filled ones the root mean square,
    9 px and more. Most filled pixels are off by less, some by far more: above 5 px read it as "a guess".
    """

    disparity_px: Array
    std_px: Array | None = None


def stereo_pipeline(name: str = "best", num_disparities: int = 128) -> Callable[[Array, Array], Estimate]:
    """A function of a rectified pair, (H, W) or (H, W, 3) uint8 each, that returns an `Estimate`.

    Parameters
    ----------
    name : {"paper", "fast", "best"}
        - ``"paper"``: `cv2.StereoSGBM` and one 9 x 9 dilation (sections II.C and II.D; the paper prints no kernel).
        - ``"fast"``: matched in half size from left and from right, checked, holes filled from the background, and
          enlarged. A quarter of the pixels, half of the disparities: several times faster than plain SGBM.
        - ``"best"``: `sgm.match`, checked from right to left, specks removed, holes filled from the background, 5 x 5
          median; a standard deviation for each pixel. Noisy pictures are blurred first. Dense; some seconds.
    num_disparities : int, px
        Disparities from 0 to this are looked for; a multiple of 16, of 32 for ``"fast"``.

    Raises
    ------
    ValueError
        If the name or the number is wrong; when called, what `check_pair` says of the pair.
    """
    steps = {"paper": 16, "fast": 32, "best": 16}
    if name not in steps:
        raise ValueError(f"unknown pipeline {name!r}; choose one of {', '.join(steps)}")
    step = steps[name]
    if num_disparities < step or num_disparities % step:
        below = max(step, num_disparities // step * step)
        raise ValueError(
            f'"{name}" looks for a multiple of {step} disparities, got {num_disparities}; near are {below}, '
            f"{below + step}"
        )
    run = {"paper": _paper, "fast": _fast, "best": _best}[name]
    return lambda left, right: run(left, right, num_disparities)


def noise_grey(image: Array) -> float:
    """Noise of a picture in grey levels, where it is flattest: the tenth percentile over blocks of 16 x 16 px.

    References
    ----------
    J. Immerkaer, Fast noise variance estimation, doi:10.1006/cviu.1996.0060 (its mask; the median of each block).
    """
    mask = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
    edges = np.abs(cv2.filter2D(to_grey(image).astype(np.float32), -1, mask))
    rows, columns = (max(n // 16, 1) for n in edges.shape)
    blocks = edges[: 16 * rows, : 16 * columns].reshape(rows, -1, columns, min(16, edges.shape[1]))
    return float(np.percentile(np.median(blocks, axis=(1, 3)), 10) / 0.6745 / 6)


def features(
    matched: census_sgm.SGMResult,
    *,
    speckle_px: int = _SPECKLE_PX,
    median_px: int = _MEDIAN_PX,
    margins: tuple[float, ...] = MARGINS,
) -> tuple[Array, Array, Array]:
    """The dense map of ``"best"``, and what its standard deviation is told from.

    Patches of fewer than ``speckle_px ** 2`` pixels are removed; `median_px` is 3 or 5.

    Returns
    -------
    disparity_px : (H, W) float32
    kind : (H, W) int8
        0 matched on a smooth surface, 1 matched beside a step of the map, 2 filled.
    level : (H, W) int8
        Class of `margins` (kinds 0 and 1) or of `GAPS_PX` (kind 2), counted from 0.
    """
    checked = left_right_check(matched.left_px, matched.right_px)
    checked[checked > np.arange(checked.shape[1])] = np.nan
    checked = filling.remove_speckles(checked, speckle_px)
    dense = filling.fill_background(checked)
    if np.isnan(dense).any():  # nothing was accepted anywhere
        dense = matched.left_px
    disparity = cv2.medianBlur(dense, median_px)
    # a neighbour that is missing counts as far off, both in one row too
    near, far = (np.nan_to_num(s, nan=x) for s, x in zip(filling.neighbours(checked), (1e4, -1e4), strict=True))
    window = np.ones((5, 5), np.uint8)
    step = cv2.dilate(disparity, window) - cv2.erode(disparity, window) > 2
    kind = np.where(np.isnan(checked), 2, step).astype(np.int8)
    gap, margin = np.digitize(np.abs(near - far), GAPS_PX), np.digitize(matched.margin, margins)
    return disparity, kind, np.where(kind == 2, gap, margin).astype(np.int8)


def match_best(
    left: Array,
    right: Array,
    num_disparities: int,
    params: census_sgm.CensusSGM | None = None,
    *,
    blur_from_grey: float = _BLUR_FROM_GREY,
) -> census_sgm.SGMResult:
    """The match inside ``"best"``: `sgm.match`, of blurred pictures where their noise reaches `blur_from_grey`."""
    check_pair(left, right)
    noise = max(noise_grey(left), noise_grey(right))
    if noise >= blur_from_grey:
        left, right = (cv2.GaussianBlur(image, (0, 0), noise) for image in (left, right))
    return census_sgm.match(left, right, replace(params or census_sgm.CensusSGM(), num_disparities=num_disparities))


def _best(left: Array, right: Array, num_disparities: int) -> Estimate:
    disparity, kind, level = features(match_best(left, right, num_disparities))
    sigma = np.array([SIGMA_PX[name] for name in ("smooth", "step", "filled")], np.float32)
    return Estimate(disparity, sigma[kind, level])


def _paper(left: Array, right: Array, num_disparities: int) -> Estimate:
    return Estimate(filters.dilate(compute_disparity(left, right, SGBMParams(num_disparities)), 9))


def _fast(left: Array, right: Array, num_disparities: int) -> Estimate:
    check_pair(left, right)
    height, width = left.shape[:2]
    check_window(SGBMParams(num_disparities, 9), width)  # said in pixels of the whole picture
    half = [cv2.resize(to_grey(i), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for i in (left, right)]
    params = SGBMParams(
        num_disparities // 2, 5, disp12_max_diff=-1, uniqueness_ratio=0, speckle_window_size=0, mode="3way"
    )
    found = compute_disparity(half[0], half[1], params, whole=True)
    mirrored = compute_disparity(half[1][:, ::-1], half[0][:, ::-1], params, whole=True)[:, ::-1]
    kept = filling.remove_speckles(left_right_check(found, mirrored), 5)
    dense = cv2.medianBlur(filling.fill_background(kept), 5)
    return Estimate(2 * cv2.resize(dense, (width, height), interpolation=cv2.INTER_NEAREST))
