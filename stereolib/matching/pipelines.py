"""Whole ways from a rectified pair to a disparity map, by name: what the paper did, what is fast, what is best.

The settings of "best" were chosen on virtual scenes by `benchmarks/choose_best.py`. The photographs on which it is
tested showed what two of its steps did wrong (`choose_surface`, `smooth_by_planes`): virtual scenes like that were
added for it, and the settings are chosen on these, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple, TypeAlias

import cv2
import numpy as np

from stereolib.base import Bools, Float32, UInt8
from stereolib.matching import deviation
from stereolib.matching.census_sgm import CensusSGM, SGMResult, match_census_sgm
from stereolib.matching.disparity import compute_disparity, left_right_check
from stereolib.matching.even_pair import EvenPair, even_out
from stereolib.matching.fill_around import fill_from_around
from stereolib.matching.filling import fill_background, remove_speckles
from stereolib.matching.filters import dilate
from stereolib.matching.levels import halved
from stereolib.matching.plane_smoothing import smooth_by_planes
from stereolib.matching.rows import find_rows
from stereolib.matching.sgbm import SGBMParams, check_window
from stereolib.matching.surfaces import Surfaces, choose_surface
from stereolib.rig import check_pair, to_grey

_RIM_PX = 11  # patches below 11 x 11 px are guesses: no holes are filled from them
_MEDIAN_PX = 5
_FARTHEST, _ROOM, _ROOM_PX = 0.999, 1.05, 8.0  # share of the rough match that the range holds, and room beyond it
_RANGE = 128  # where nothing tells
_LEAST_LEFT_PX = 5  # of a picture's width, beyond the range


@dataclass(frozen=True, eq=False)
class DisparityEstimate:
    """What a pipeline returns.

    Parameters
    ----------
    disparity_px : (H, W) float32
        NaN where unknown. Planes laid through what is nearly infinitely far away may end a fraction of a pixel below 0.
    matched : (H, W) bool
        Where it was matched; elsewhere it was filled by a guess, or is unknown.
    std_px : (H, W) float32 or None
        Standard deviation of each disparity; only ``"best"`` has one. It is the error of pixels of the same kind in
        virtual scenes that look alike (`deviation`), with the few hundredths of a pixel that a good calibration leaves
        between the columns; of a worse one it does not know.
    """

    disparity_px: Float32
    matched: Bools
    std_px: Float32 | None = None


class FilledMap(NamedTuple):
    """The dense map of ``"best"``, where each disparity comes from, and what tells how far it may be off.

    Parameters
    ----------
    disparity_px : (H, W) float32
    kind : (H, W) int8
        Of `deviation.Kind`.
    signs : (H, W, 11) float32
        As `deviation.signs` gathers them.
    """

    disparity_px: Float32
    kind: deviation.Kinds
    signs: Float32


Pipeline: TypeAlias = Callable[[UInt8, UInt8], DisparityEstimate]


def stereo_pipeline(name: str = "best", num_disparities: int | None = 128) -> Pipeline:
    """Choose a way from a rectified pair to its disparity.

    Parameters
    ----------
    name : {"paper", "fast", "best"}
        - ``"paper"``: `cv2.StereoSGBM` and one 9 x 9 dilation (sections II.C and II.D; the paper prints no kernel).
        - ``"fast"``: matched in half size from left and from right, checked, holes filled from the background, and
          enlarged. A quarter of the pixels, half of the disparities: several times faster than plain SGBM.
        - ``"best"``: `even_out`, `match_census_sgm`, checked from right to left, holes filled by the planes around
          them (`fill_from_around`), but from no small patch, pixels beside steps given to the surface that has their
          colour (`choose_surface`), 5 x 5 median, planes (`smooth_by_planes`); a standard deviation for each pixel.
          Dense. Its first run on a machine compiles for some seconds.
    num_disparities : int or None, px
        Disparities from 0 to this are looked for; a multiple of 16, of 32 for ``"fast"``. None takes what
        `search_range` tells of the pair.

    Returns
    -------
    callable
        Takes the left and the right picture, (H, W) or (H, W, 3) uint8, and returns a `DisparityEstimate`.

    Raises
    ------
    ValueError
        If the name or the number is wrong; when called, what `check_pair` says of the pair. Whether it is
        rectified, exchanged or shows nothing is not looked at: `match_checked` does that.

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
    if num_disparities is None:
        return lambda left, right: run(left, right, search_range(find_rows(left, right)[1], left.shape[1], step))
    if num_disparities < step or num_disparities % step:
        below = max(step, num_disparities // step * step)
        got = f"got {num_disparities}; near are {below}, {below + step}"
        raise ValueError(f'"{name}" looks for a multiple of {step} disparities, {got}')
    return partial(run, num_disparities=int(num_disparities))


def search_range(rough_px: Float32, width_px: int, step: int = 16) -> int:
    """Tell how many disparities a pair needs, from a rough match of it.

    Parameters
    ----------
    rough_px : (H / 2, W / 2) float32, px of the half size
        As `find_rows` gives it; NaN where nothing was matched.
    width_px : int
        The whole picture's.
    step : int, px
        The answer is a multiple of it.

    Returns
    -------
    int, px
        999 of 1000 roughly matched pixels lie below it, and there is room beyond; less where the picture is not as
        wide. 128 where nothing was matched.

    Raises
    ------
    ValueError
        If the picture is too narrow for a step.

    Examples
    --------
    >>> search_range(np.full((240, 320), 30, np.float32), 640)
    80
    """
    found = rough_px[np.isfinite(rough_px)]
    need = _ROOM * 2 * float(np.quantile(found, _FARTHEST)) + _ROOM_PX if found.size else _RANGE
    if width_px < (least_px := step + _LEAST_LEFT_PX):
        raise ValueError(f"pictures {width_px} px wide cannot be matched: at least {least_px} px are needed")
    widest = (width_px - _LEAST_LEFT_PX) // step * step
    return max(step, min(-(-int(need) // step) * step, widest))


@dataclass(frozen=True)
class FillSteps:
    """The steps of `fill_matched` that `benchmarks/choose_best.py` tries other settings of.

    Parameters
    ----------
    rim_px : int
        A patch of fewer than ``rim_px ** 2`` pixels counts as a hole, for which its disparities are the first guess:
        nothing is filled from it, and it has no vote.
    median_px : {3, 5}
        Edge of the median.
    around, surface, planes : callable
        `fill_from_around`, `choose_surface` and `smooth_by_planes`, with other settings or without.
    """

    rim_px: int = _RIM_PX
    median_px: int = _MEDIAN_PX
    around: Callable[[Float32, Float32, Float32, UInt8], Float32] = fill_from_around
    surface: Callable[[Float32, Bools, UInt8], Surfaces] = choose_surface
    planes: Callable[[Float32, Float32], Float32] = smooth_by_planes


def fill_matched(matched: SGMResult, pair: EvenPair, steps: FillSteps | None = None) -> FilledMap:
    """Make the dense map of ``"best"``: checked, holes filled, steps moved to the colour's, smoothed.

    Parameters
    ----------
    matched : SGMResult
    pair : EvenPair
        What was matched; the left picture's colours tell where near surfaces end.
    steps : FillSteps, optional

    Returns
    -------
    FilledMap
    """
    steps = steps or FillSteps()
    checked = left_right_check(matched.left_px, matched.right_px)
    checked[checked > np.arange(checked.shape[1])] = np.nan
    kept = remove_speckles(checked, steps.rim_px)
    dense = steps.around(kept, checked, matched.right_px, pair.left)
    if np.isnan(dense).any():  # no patch was large enough to be trusted
        dense = matched.left_px
    dense, moved = steps.surface(dense, np.isfinite(kept), pair.left)
    kept[moved] = np.nan  # another surface's: no match any more
    disparity = steps.planes(cv2.medianBlur(dense, steps.median_px), pair.detail())
    signs = deviation.signs(disparity, matched, kept, pair)
    return FilledMap(disparity, deviation.kinds(disparity, kept), signs)


def match_best(pair: EvenPair, num_disparities: int, params: CensusSGM | None = None) -> SGMResult:
    """Match as ``"best"`` does.

    Parameters
    ----------
    pair : EvenPair
    num_disparities : int, px
        In place of that of `params`, as is the pictures' noise.
    params : CensusSGM, optional

    Returns
    -------
    SGMResult
        Where the left picture shows nothing at all, as through a covered lens, every disparity is as good: the right
        view is NaN then, so that no check keeps any.

    Raises
    ------
    ValueError
        As `match_census_sgm`.
    """
    settings = replace(params or CensusSGM(), num_disparities=num_disparities, noise_grey=pair.noise_grey)
    found = match_census_sgm(pair.left, pair.right, settings)
    return found if pair.detail().any() else replace(found, right_px=np.full_like(found.right_px, np.nan))


def _best(left: UInt8, right: UInt8, num_disparities: int) -> DisparityEstimate:
    pair = even_out(left, right)
    found = fill_matched(match_best(pair, num_disparities), pair)
    std_px = deviation.std_px(found.kind, found.signs)
    return DisparityEstimate(found.disparity_px, found.kind <= deviation.Kind.STEP, std_px)


def _paper(left: UInt8, right: UInt8, num_disparities: int) -> DisparityEstimate:
    matched = compute_disparity(left, right, SGBMParams(num_disparities))
    return DisparityEstimate(dilate(matched, 9), np.isfinite(matched))


def _fast(left: UInt8, right: UInt8, num_disparities: int) -> DisparityEstimate:
    check_pair(left, right)
    height, width = left.shape[:2]
    check_window(SGBMParams(num_disparities, 11), width // 2 * 2)  # said in pixels of the whole picture
    half = [halved(to_grey(i)) for i in (left, right)]
    params = SGBMParams(num_disparities // 2, 5, mode="3way", uniqueness_ratio=0, speckle_window_size=0)
    matched = compute_disparity(half[0], half[1], params, whole=True)
    mirrored = compute_disparity(half[1][:, ::-1], half[0][:, ::-1], params, whole=True)[:, ::-1]
    kept = remove_speckles(left_right_check(matched, mirrored), 5)
    dense = cv2.medianBlur(fill_background(kept), 5)
    sure = cv2.resize(np.isfinite(kept).astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) > 0
    return DisparityEstimate(2 * cv2.resize(dense, (width, height), interpolation=cv2.INTER_NEAREST), sure)
