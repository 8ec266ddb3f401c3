"""How far a matched or filled disparity may be off, told by signs that every map shows without a truth."""

from __future__ import annotations

from enum import IntEnum
from typing import Any, NamedTuple, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Bools, Float32
from stereolib.matching.filling import neighbours

_NEAR_PX, _AROUND_PX, _WIDE_PX = 5, 15, 31  # edges of the windows that are looked at
_STEP_PX = 2.0  # neighbours farther apart are two surfaces
_MOST_BENT_PX = 2.0  # more counts as so much
_BENT_FLOOR_PX, _SPREAD_FLOOR_PX = 0.02, 0.1  # added before the logarithm is taken


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
    weights : (4,) of float
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
        (-0.218, 0.404, -1.247, -0.021),
        (
            -3.431,
            -3.382,
            -3.348,
            -3.316,
            -3.281,
            -3.242,
            -3.198,
            -3.147,
            -3.085,
            -2.999,
            -2.888,
            -2.767,
            -2.632,
            -2.473,
            -2.247,
            -1.823,
        ),
        (0.104, 0.105, 0.11, 0.115, 0.121, 0.128, 0.136, 0.148, 0.164, 0.192, 0.231, 0.292, 0.371, 0.484, 0.772, 1.584),
    ),
    Kind.STEP: StdLaw(
        (-0.436, -0.298, -3.45, 0.198),
        (-4.951, -4.701, -4.458, -4.124, -3.653, -2.913),
        (2.25, 8.063, 12.762, 15.179, 17.67, 22.537),
    ),
    Kind.GAP: StdLaw(
        (-0.038, 1.13, -0.378, 0.224),
        (-0.751, -0.253, 0.039, 0.275, 0.501, 0.844),
        (5.18, 7.996, 12.047, 14.136, 16.601, 20.877),
    ),
    Kind.BORDER: StdLaw(
        (-0.021, 0.164, -3.113, 0.279),
        (-1.671, -0.948, -0.586, -0.344, -0.046, 0.36),
        (1.477, 16.931, 19.893, 19.34, 20, 19.468),
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


def signs(disparity_px: Float32, matched_px: Float32, margin: Float32, kept: Bools) -> Float32:
    """Gather what tells good matches from bad ones.

    Parameters
    ----------
    disparity_px : (H, W) float32, px
        The dense map.
    matched_px : (H, W) float32, px
        As it was matched, nothing removed.
    margin : (H, W) float32
        Of the sums' minima, as `SGMResult` has it.
    kept : (H, W) bool
        Whether the match was kept.

    Returns
    -------
    (H, W, 4) float32
        Logarithm of the margin; logarithm of how bent the matched map is, mean over 15 px; share of kept pixels, over
        31 px; logarithm of the spread of the dense map over 15 px.
    """
    bent = np.abs(cv2.Laplacian(matched_px, cv2.CV_32F)).clip(0, _MOST_BENT_PX)
    parts = (
        np.log(np.maximum(margin, 1)),
        np.log(cv2.blur(bent, (_AROUND_PX, _AROUND_PX)) + _BENT_FLOOR_PX),
        cv2.blur(kept.astype(np.float32), (_WIDE_PX, _WIDE_PX)),
        np.log(_spread(disparity_px, _AROUND_PX) + _SPREAD_FLOOR_PX),
    )
    return np.stack(parts, axis=-1).astype(np.float32)


def std_px(kind: Kinds, sign: Float32) -> Float32:
    """Give each pixel its standard deviation by `LAWS`.

    Parameters
    ----------
    kind : (H, W) int8
    sign : (H, W, 4) float32

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
