"""How far a matched or filled disparity may be off, told by signs that every map shows without a truth."""

from __future__ import annotations

from enum import IntEnum
from typing import Any, NamedTuple, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Bools, Float32
from stereolib.matching.census_sgm import SGMResult
from stereolib.matching.disparity import left_right_difference
from stereolib.matching.filling import neighbours

_NEAR_PX, _AROUND_PX, _WIDE_PX = 5, 15, 31  # edges of the windows that are looked at
_STEP_PX = 2.0  # neighbours farther apart are two surfaces
_MOST_BENT_PX, _MOST_APART_PX = 2.0, 4.0  # more counts as so much
_BENT_FLOOR_PX, _SPREAD_FLOOR_PX, _APART_FLOOR_PX = 0.02, 0.1, 0.05  # added before the logarithm is taken


class Kind(IntEnum):
    """Where a disparity comes from."""

    SMOOTH = 0  # matched on a smooth surface
    STEP = 1  # matched beside a step of the map
    GAP = 2  # filled between matched pixels of its row
    BORDER = 3  # filled at the border, from one side


Kinds: TypeAlias = npt.NDArray[np.int8]


class StdLaw(NamedTuple):
    """The standard deviation of one kind: a sum of the signs, and what it means.

    Parameters
    ----------
    weights : (5,) of float
        Of the signs of `signs`, in their order.
    score : (N,) of float
        Rising values of the sum.
    std_px : (N,) of float, px
        The standard deviation there; between them it is interpolated, beyond them it stays.
    """

    weights: tuple[float, ...]
    score: tuple[float, ...]
    std_px: tuple[float, ...]


#: As `benchmarks/bench_pipeline.py` finds them on virtual scenes.
LAWS: dict[Kind, StdLaw] = {
    Kind.SMOOTH: StdLaw(
        (-0.221, 0.211, -0.99, -0.003, 0.204),
        (
            -3.083,
            -3.029,
            -2.991,
            -2.958,
            -2.926,
            -2.894,
            -2.859,
            -2.819,
            -2.773,
            -2.717,
            -2.643,
            -2.54,
            -2.405,
            -2.249,
            -2.038,
            -1.656,
        ),
        (0.103, 0.111, 0.115, 0.118, 0.121, 0.125, 0.131, 0.139, 0.151, 0.169, 0.199, 0.253, 0.329, 0.429, 0.59, 1.199),
    ),
    Kind.STEP: StdLaw(
        (-0.428, -0.299, -2.07, 0.136, 0.576),
        (-4.553, -4.219, -3.912, -3.548, -3.081, -2.377),
        (0.423, 6.848, 11.652, 13.482, 16.552, 21.498),
    ),
    Kind.GAP: StdLaw(
        (-0.021, 0.622, -1.969, 0.317, -0.647),
        (-1.74, -1.289, -0.976, -0.657, -0.319, 0.185),
        (3.792, 8.065, 11.12, 12.555, 14.712, 22.475),
    ),
    Kind.BORDER: StdLaw(
        (-0.148, 0.662, -2.04, 0.219, -0.158),
        (-2.123, -1.381, -0.784, -0.404, -0.145, 0.186),
        (0.494, 17.24, 18.87, 19.253, 19.562, 21.604),
    ),
}


def kinds(disparity_px: Float32, kept_px: Float32) -> Kinds:
    """Tell of each pixel where its disparity comes from.

    Parameters
    ----------
    disparity_px : (H, W) float32, px
        The dense map.
    kept_px : (H, W) float32, px
        What was matched and kept before the rest was filled; NaN is a hole.

    Returns
    -------
    (H, W) int8, of `Kind`
    """
    hole, (before, after) = np.isnan(kept_px), neighbours(kept_px)
    filled = np.where(np.isnan(before + after), Kind.BORDER, Kind.GAP)
    return np.where(hole, filled, _spread(disparity_px, _NEAR_PX) > _STEP_PX).astype(np.int8)


def signs(disparity_px: Float32, matched: SGMResult, kept: Bools) -> Float32:
    """Gather what tells good matches from bad ones.

    Parameters
    ----------
    disparity_px : (H, W) float32, px
        The dense map.
    matched : SGMResult
        As it was matched, nothing removed.
    kept : (H, W) bool
        Whether the match was kept.

    Returns
    -------
    (H, W, 5) float32
        Logarithm of the margin; logarithm of how bent the matched map is, mean over 15 px; share of kept pixels, over
        31 px; logarithm of the spread of the dense map over 15 px; logarithm of how far both views' disparities are
        apart, mean over 5 px.
    """
    bent = np.abs(cv2.Laplacian(matched.left_px, cv2.CV_32F)).clip(0, _MOST_BENT_PX)
    if not kept.any():
        bent[:] = _MOST_BENT_PX  # a smooth map of which nothing was kept is no better than a rough one
    apart = np.nan_to_num(left_right_difference(matched.left_px, matched.right_px), nan=_MOST_APART_PX)
    parts = (
        np.log(np.maximum(matched.margin, 1)),
        np.log(cv2.blur(bent, (_AROUND_PX, _AROUND_PX)) + _BENT_FLOOR_PX),
        cv2.blur(kept.astype(np.float32), (_WIDE_PX, _WIDE_PX)),
        np.log(_spread(disparity_px, _AROUND_PX) + _SPREAD_FLOOR_PX),
        np.log(cv2.blur(apart.clip(0, _MOST_APART_PX), (_NEAR_PX, _NEAR_PX)) + _APART_FLOOR_PX),
    )
    return np.stack(parts, axis=-1).astype(np.float32)


def std_px(kind: Kinds, sign: Float32) -> Float32:
    """Give each pixel its standard deviation by `LAWS`.

    Parameters
    ----------
    kind : (H, W) int8
    sign : (H, W, 5) float32

    Returns
    -------
    (H, W) float32, px
    """
    out = np.empty(kind.shape, np.float32)
    for each, law in LAWS.items():
        here = kind == each
        out[here] = np.interp(sign[here] @ np.asarray(law.weights, np.float32), law.score, law.std_px)
    return out


def _spread(disparity_px: Float32, size_px: int) -> Any:
    window = np.ones((size_px, size_px), np.uint8)
    return cv2.dilate(disparity_px, window) - cv2.erode(disparity_px, window)
