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
        (-0.247, 0.397, -1.08, -0.035),
        (
            -3.413,
            -3.363,
            -3.326,
            -3.293,
            -3.257,
            -3.218,
            -3.176,
            -3.129,
            -3.075,
            -3.008,
            -2.92,
            -2.809,
            -2.674,
            -2.515,
            -2.299,
            -1.888,
        ),
        (0.102, 0.107, 0.112, 0.117, 0.122, 0.128, 0.136, 0.145, 0.158, 0.178, 0.21, 0.263, 0.34, 0.444, 0.662, 1.463),
    ),
    Kind.STEP: StdLaw(
        (-0.463, -0.284, -3.467, 0.182),
        (-5.174, -4.928, -4.685, -4.357, -3.891, -3.154),
        (1.685, 6.964, 11.869, 14.504, 16.713, 22.238),
    ),
    Kind.GAP: StdLaw(
        (0.002, 1.005, -0.404, 0.226),
        (-0.557, -0.125, 0.138, 0.36, 0.579, 0.91),
        (6.729, 8.004, 12.834, 14.303, 17.098, 21.061),
    ),
    Kind.BORDER: StdLaw(
        (-0.076, 0.525, -2.59, 0.157),
        (-1.936, -1.237, -0.672, -0.271, -0.014, 0.248),
        (1.067, 14.271, 19.947, 20.762, 20.944, 22.567),
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
    if not kept.any():
        bent[:] = _MOST_BENT_PX  # a smooth map of which nothing was kept is no better than a rough one
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
