"""How far a matched or filled disparity may be off, told by signs that every map shows without a truth."""

from __future__ import annotations

from enum import IntEnum
from typing import Any, NamedTuple, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Float32
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
    weights : (7,) of float
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
        (-0.149, 0.226, -1.067, 0.014, 0.202, 0.0, 0.0),
        (
            -2.778,
            -2.72,
            -2.679,
            -2.642,
            -2.605,
            -2.565,
            -2.521,
            -2.466,
            -2.397,
            -2.309,
            -2.198,
            -2.074,
            -1.938,
            -1.781,
            -1.575,
            -1.223,
        ),
        (0.117, 0.117, 0.118, 0.12, 0.124, 0.128, 0.134, 0.15, 0.174, 0.209, 0.262, 0.331, 0.42, 0.539, 0.734, 1.252),
    ),
    Kind.STEP: StdLaw(
        (-0.252, -0.309, -1.807, 0.252, 0.651, 0.0, 0.0),
        (-3.041, -2.712, -2.442, -2.132, -1.718, -1.064),
        (1.398, 5.234, 10.654, 14.086, 18.292, 23.795),
    ),
    Kind.GAP: StdLaw(
        (-0.014, 0.249, -1.18, 0.335, -0.38, 0.101, 0.208),
        (-0.609, -0.227, 0.12, 0.481, 0.868, 1.462),
        (0.866, 4.134, 9.517, 13.393, 18.718, 23.594),
    ),
    Kind.BORDER: StdLaw(
        (-0.174, 0.299, 0.618, 0.186, -0.145, 0.544, 0.421),
        (1.699, 2.493, 3.042, 3.49, 3.909, 4.432),
        (5.975, 19.95, 29.435, 30.841, 32.949, 41.163),
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


def signs(disparity_px: Float32, matched: SGMResult, kept_px: Float32) -> Float32:
    """Gather what tells good matches from bad ones.

    Parameters
    ----------
    disparity_px : (H, W) float32, px
        The dense map.
    matched : SGMResult
        As it was matched, nothing removed.
    kept_px : (H, W) float32, px
        What was matched and kept; NaN is a hole.

    Returns
    -------
    (H, W, 7) float32
        Logarithm of the margin; logarithm of how bent the matched map is, mean over 15 px; share of kept pixels, over
        31 px; logarithm of the spread of the dense map over 15 px; logarithm of how far both views' disparities are
        apart, mean over 5 px; ``ln(1 + r)``, r the distance to what was kept, px; ``ln(1 + w)``, w how much wider the
        hole is in its row than the step it lies beside, px: what the right camera cannot see is as wide as the step.
    """
    kept = np.isfinite(kept_px)
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
        np.log1p(cv2.distanceTransform((~kept).astype(np.uint8), cv2.DIST_L2, 3).clip(0, kept.shape[1])),
        np.log1p(_wider_than_step(kept_px)),
    )
    return np.stack(parts, axis=-1).astype(np.float32)


def std_px(kind: Kinds, sign: Float32) -> Float32:
    """Give each pixel its standard deviation by `LAWS`.

    Parameters
    ----------
    kind : (H, W) int8
    sign : (H, W, 7) float32

    Returns
    -------
    (H, W) float32, px
    """
    out = np.empty(kind.shape, np.float32)
    for each, law in LAWS.items():
        here = kind == each
        out[here] = np.interp(sign[here] @ np.asarray(law.weights, np.float32), law.score, law.std_px)
    return out


def _wider_than_step(kept_px: Float32) -> Float32:
    """Width of each pixel's hole in its row without the difference of disparity between its rims, px; 0 if kept."""
    kept, width = np.isfinite(kept_px), kept_px.shape[1]
    columns = np.arange(width, dtype=np.float32)
    first, last = neighbours(np.where(kept, columns, np.float32(np.nan)))
    before, after = neighbours(kept_px)
    hole_px = np.nan_to_num(last, nan=width) - np.nan_to_num(first, nan=-1) - 1
    return np.where(kept, 0, hole_px - np.nan_to_num(np.abs(before - after))).clip(0, None).astype(np.float32)


def _spread(disparity_px: Float32, size_px: int) -> Any:
    window = np.ones((size_px, size_px), np.uint8)
    return cv2.dilate(disparity_px, window) - cv2.erode(disparity_px, window)
