"""Whole ways from a rectified pair to a disparity map, by name: what the paper did, what is fast, what is best.

The settings of "best" were chosen on virtual scenes by `benchmarks/choose_best.py`, its standard deviations calibrated
on the same scenes by `benchmarks/bench_pipeline.py`; the photographs on which both are tested took no part.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeAlias, cast

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Float32, Floats, UInt8
from stereolib.matching.census_sgm import CensusSGM, SGMResult, match_census_sgm
from stereolib.matching.disparity import compute_disparity, left_right_check
from stereolib.matching.filling import fill_background, neighbours, remove_speckles
from stereolib.matching.filters import dilate
from stereolib.matching.sgbm import SGBMParams, check_window
from stereolib.rig import check_pair, to_grey

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
BEST_SIGMA_PX = {
    "smooth": (0.99, 0.85, 0.6, 0.38, 0.26, 0.24),
    "step": (2.36, 2.54, 2.66, 1.68, 0.67, 0.33),
    "filled": (8.94, 8.94, 8.94, 9.39, 13.99, 30.83),
}


@dataclass(frozen=True, eq=False)
class DisparityEstimate:
    """What a pipeline returns.

    Parameters
    ----------
    disparity_px : (H, W) float32
        NaN where unknown.
    std_px : (H, W) float32 or None
        Standard deviation of each disparity; only ``"best"`` has one. It is the error of pixels of the same kind in
        virtual scenes (`BEST_SIGMA_PX`): of matched pixels the half width that holds 68 % of the errors, at most 3 px;
        of filled ones the root mean square, 9 px and more. Most filled pixels are off by less, some by far more: above
        5 px read it as "a guess".
    """

    disparity_px: Float32
    std_px: Float32 | None = None


Pipeline: TypeAlias = Callable[[UInt8, UInt8], DisparityEstimate]


def stereo_pipeline(name: str = "best", num_disparities: int = 128) -> Pipeline:
    """Choose a way from a rectified pair to its disparity.

    Parameters
    ----------
    name : {"paper", "fast", "best"}
        - ``"paper"``: `cv2.StereoSGBM` and one 9 x 9 dilation (sections II.C and II.D; the paper prints no kernel).
        - ``"fast"``: matched in half size from left and from right, checked, holes filled from the background, and
          enlarged. A quarter of the pixels, half of the disparities: several times faster than plain SGBM.
        - ``"best"``: `match_census_sgm`, checked from right to left, specks removed, holes filled from the background,
          5 x 5 median; a standard deviation for each pixel. Noisy pictures are blurred first. Dense; some seconds.
    num_disparities : int, px
        Disparities from 0 to this are looked for; a multiple of 16, of 32 for ``"fast"``.

    Returns
    -------
    callable
        Takes the left and the right picture, (H, W) or (H, W, 3) uint8, and returns a `DisparityEstimate`.

    Raises
    ------
    ValueError
        If the name or the number is wrong; when called, what `check_pair` says of the pair.

    Examples
    --------
    >>> left = np.random.default_rng(0).integers(0, 256, (40, 120), np.uint8)
    >>> estimate = stereo_pipeline("fast", 32)(left, np.roll(left, -8, axis=1))
    >>> float(np.median(estimate.disparity_px)), estimate.std_px
    (8.0, None)
    """
    pipelines = {"paper": (_paper, 16), "fast": (_fast, 32), "best": (_best, 16)}
    if name not in pipelines:
        raise ValueError(f"unknown pipeline {name!r}; choose one of {', '.join(pipelines)}")
    run, step = pipelines[name]
    if num_disparities < step or num_disparities % step:
        below = max(step, num_disparities // step * step)
        got = f"got {num_disparities}; near are {below}, {below + step}"
        raise ValueError(f'"{name}" looks for a multiple of {step} disparities, {got}')
    return lambda left, right: run(left, right, num_disparities)


def noise_grey(image: UInt8) -> float:
    """Estimate a picture's noise where it is flattest: the tenth percentile over blocks of 16 x 16 px.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8

    Returns
    -------
    float, grey levels
        Standard deviation.

    References
    ----------
    J. Immerkaer, Fast noise variance estimation, doi:10.1006/cviu.1996.0060 (its mask; the median of each block).
    """
    mask = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
    edges = np.abs(cv2.filter2D(to_grey(image).astype(np.float32), -1, mask))
    rows, columns = (max(n // 16, 1) for n in edges.shape)
    blocks = edges[: 16 * rows, : 16 * columns].reshape(rows, -1, columns, min(16, edges.shape[1]))
    return float(np.percentile(np.median(blocks, axis=(1, 3)), 10) / 0.6745 / 6)


def fill_and_classify(
    matched: SGMResult,
    *,
    speckle_px: int = _SPECKLE_PX,
    median_px: int = _MEDIAN_PX,
    margins: tuple[float, ...] = MARGINS,
) -> tuple[Floats, npt.NDArray[np.int8], npt.NDArray[np.int8]]:
    """Make the dense map of ``"best"``, and sort its pixels into classes of equal standard deviation.

    Parameters
    ----------
    matched : SGMResult
    speckle_px : int
        Patches of fewer than ``speckle_px ** 2`` pixels are removed.
    median_px : {3, 5}
        Edge of the median at the end.
    margins : tuple of float
        Limits between the classes of matched pixels.

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
    checked = remove_speckles(checked, speckle_px)
    dense = fill_background(checked)
    if np.isnan(dense).any():  # nothing was accepted anywhere
        dense = matched.left_px
    disparity = cv2.medianBlur(dense, median_px)
    # a neighbour that is missing counts as far off, both in one row too
    near, far = (np.nan_to_num(s, nan=x) for s, x in zip(neighbours(checked), (1e4, -1e4), strict=True))
    window = np.ones((5, 5), np.uint8)
    step = cv2.dilate(disparity, window) - cv2.erode(disparity, window) > 2
    kind = np.where(np.isnan(checked), 2, step).astype(np.int8)
    gap, margin = np.digitize(np.abs(near - far), GAPS_PX), np.digitize(matched.margin, margins)
    return disparity, kind, np.where(kind == 2, gap, margin).astype(np.int8)


def match_best(
    left: UInt8,
    right: UInt8,
    num_disparities: int,
    params: CensusSGM | None = None,
    *,
    blur_from_grey: float = _BLUR_FROM_GREY,
) -> SGMResult:
    """Match as ``"best"`` does: `match_census_sgm`, of blurred pictures where they are noisy.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
    num_disparities : int, px
        In place of that of `params`.
    params : CensusSGM, optional
    blur_from_grey : float
        Noise in grey levels from which on the pictures are blurred.

    Returns
    -------
    SGMResult

    Raises
    ------
    ValueError
        As `match_census_sgm`.
    """
    check_pair(left, right)
    noise = max(noise_grey(left), noise_grey(right))
    if noise >= blur_from_grey:
        left, right = (cast(UInt8, cv2.GaussianBlur(image, (0, 0), noise)) for image in (left, right))
    return match_census_sgm(left, right, replace(params or CensusSGM(), num_disparities=num_disparities))


def _best(left: UInt8, right: UInt8, num_disparities: int) -> DisparityEstimate:
    disparity, kind, level = fill_and_classify(match_best(left, right, num_disparities))
    sigma = np.array(list(BEST_SIGMA_PX.values()), np.float32)
    return DisparityEstimate(disparity, sigma[kind, level])


def _paper(left: UInt8, right: UInt8, num_disparities: int) -> DisparityEstimate:
    return DisparityEstimate(dilate(compute_disparity(left, right, SGBMParams(num_disparities)), 9))


def _fast(left: UInt8, right: UInt8, num_disparities: int) -> DisparityEstimate:
    check_pair(left, right)
    height, width = left.shape[:2]
    check_window(SGBMParams(num_disparities, 9), width)  # said in pixels of the whole picture
    half = [cv2.resize(to_grey(i), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for i in (left, right)]
    unchecked: dict[str, Any] = {"disp12_max_diff": -1, "uniqueness_ratio": 0, "speckle_window_size": 0}
    params = SGBMParams(num_disparities // 2, 5, mode="3way", **unchecked)
    matched = compute_disparity(half[0], half[1], params, whole=True)
    mirrored = compute_disparity(half[1][:, ::-1], half[0][:, ::-1], params, whole=True)[:, ::-1]
    kept = remove_speckles(left_right_check(matched, mirrored), 5)
    dense = cv2.medianBlur(fill_background(kept), 5)
    return DisparityEstimate(2 * cv2.resize(dense, (width, height), interpolation=cv2.INTER_NEAREST))
