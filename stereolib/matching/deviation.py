"""How far a matched or filled disparity may be off, told by signs that every map shows without a truth."""

from __future__ import annotations

from enum import IntEnum
from typing import Any, NamedTuple, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Float32, Floats
from stereolib.matching.census_sgm import SGMResult
from stereolib.matching.disparity import left_right_difference
from stereolib.matching.filling import neighbours

_NEAR_PX, _AROUND_PX, _WIDE_PX = 5, 15, 31  # edges of the windows that are looked at
_STEP_PX = 2.0  # neighbours farther apart are two surfaces
_MOST_BENT_PX, _MOST_APART_PX = 2.0, 4.0  # more counts as so much
_FAR = 3.0  # scales from the mean: signs beyond count as so far
_BENT_FLOOR_PX, _SPREAD_FLOOR_PX, _APART_FLOOR_PX = 0.02, 0.1, 0.05  # added before the logarithm is taken


class Kind(IntEnum):
    """Where a disparity comes from."""

    SMOOTH = 0  # matched on a smooth surface
    STEP = 1  # matched beside a step of the map
    GAP = 2  # filled between matched pixels of its row
    BORDER = 3  # filled at the border, from one side


Kinds: TypeAlias = npt.NDArray[np.int8]


class StdLaw(NamedTuple):
    """The standard deviation of one kind: a polynomial of the signs, and what its values mean.

    Parameters
    ----------
    mean, scale : (7,) of float
        A sign s of `signs` counts as ``z = (s - mean) / scale``, held within -3 and 3: nothing is told beyond what was
        seen.
    weights : (7,) of float
    products : (7, 7) of float
        The score is ``weights z + z products z``.
    score : (N,) of float
        Rising values of it.
    std_px : (N,) of float, px
        The standard deviation there; between them it is interpolated, beyond them it stays.
    """

    mean: tuple[float, ...]
    scale: tuple[float, ...]
    weights: tuple[float, ...]
    products: tuple[tuple[float, ...], ...]
    score: tuple[float, ...]
    std_px: tuple[float, ...]


#: As `benchmarks/bench_pipeline.py` finds them on virtual scenes.
LAWS: dict[Kind, StdLaw] = {
    Kind.SMOOTH: StdLaw(
        mean=(5.279, -0.879, 0.92, 0.456, -1.604, 0.0, 0.0),
        scale=(0.484, 0.635, 0.136, 1.117, 0.621, 1.0, 1.0),
        weights=(-0.1564, 0.0355, -0.0795, 0.0022, 0.1202, 0.0, 0.0),
        products=(
            (-0.0309, -0.0436, 0.0421, -0.0336, 0.0201, 0.0, 0.0),
            (0.0, -0.0221, -0.004, -0.0139, 0.0291, 0.0, 0.0),
            (0.0, 0.0, -0.015, -0.0452, -0.0088, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0039, 0.0229, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, -0.0274, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ),
        score=(
            -0.354,
            -0.309,
            -0.282,
            -0.26,
            -0.239,
            -0.217,
            -0.192,
            -0.161,
            -0.118,
            -0.056,
            0.033,
            0.14,
            0.258,
            0.397,
            0.597,
            0.97,
        ),
        std_px=(
            0.088,
            0.101,
            0.11,
            0.116,
            0.121,
            0.126,
            0.132,
            0.144,
            0.166,
            0.203,
            0.261,
            0.337,
            0.435,
            0.562,
            0.697,
            1.155,
        ),
    ),
    Kind.STEP: StdLaw(
        mean=(4.697, -0.136, 0.798, 2.798, -0.635, 0.0, 0.0),
        scale=(0.508, 0.342, 0.197, 0.774, 0.625, 1.0, 1.0),
        weights=(0.0527, 0.046, -0.2996, 0.1468, 0.3224, 0.0, 0.0),
        products=(
            (-0.2839, -0.0765, 0.1579, 0.0688, -0.0327, 0.0, 0.0),
            (0.0, 0.0658, 0.1548, 0.079, -0.0975, 0.0, 0.0),
            (0.0, 0.0, -0.042, -0.0417, -0.0986, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0116, 0.0645, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0238, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ),
        score=(-1.071, -0.879, -0.752, -0.637, -0.515, -0.377, -0.239, -0.085, 0.108, 0.358, 0.702, 1.275),
        std_px=(0.448, 0.539, 0.529, 0.675, 1.293, 6.09, 9.743, 15.372, 17.64, 21.147, 23.304, 26.832),
    ),
    Kind.GAP: StdLaw(
        mean=(4.176, 0.282, 0.427, 1.576, 0.578, 1.456, 1.805),
        scale=(0.491, 0.276, 0.273, 1.458, 0.706, 0.776, 1.514),
        weights=(-0.0377, -0.0137, -0.2127, 0.4301, -0.2716, 0.1104, 0.1633),
        products=(
            (-0.0653, -0.0123, 0.1638, 0.056, -0.0944, 0.0982, 0.0124),
            (0.0, 0.0195, 0.0315, 0.0655, 0.0406, 0.096, -0.1109),
            (0.0, 0.0, -0.0851, -0.0695, 0.0196, 0.0204, 0.041),
            (0.0, 0.0, 0.0, 0.0181, -0.0173, -0.1396, 0.0521),
            (0.0, 0.0, 0.0, 0.0, -0.1901, -0.1712, 0.1849),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0949, 0.0593),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1051),
        ),
        score=(-1.222, -0.928, -0.759, -0.611, -0.475, -0.332, -0.172, 0.011, 0.223, 0.469, 0.792, 1.325),
        std_px=(0.383, 0.571, 0.699, 0.89, 1.118, 1.725, 9.045, 14.607, 17.488, 20.198, 23.966, 27.72),
    ),
    Kind.BORDER: StdLaw(
        mean=(3.214, 0.157, 0.076, 0.99, 1.219, 3.13, 4.398),
        scale=(0.766, 0.528, 0.139, 1.287, 0.4, 1.039, 0.77),
        weights=(-0.4185, 0.0433, -0.0029, 0.0423, 0.1245, 0.3296, 0.4014),
        products=(
            (0.0643, 0.2675, -0.0994, 0.1101, -0.3557, 0.0383, -0.1901),
            (0.0, 0.0606, -0.0258, 0.111, -0.2258, 0.0979, -0.1235),
            (0.0, 0.0, -0.0091, -0.0848, -0.0195, -0.0538, -0.1505),
            (0.0, 0.0, 0.0, 0.0814, 0.0399, -0.2103, 0.028),
            (0.0, 0.0, 0.0, 0.0, -0.0606, -0.1274, 0.0209),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.1709, -0.0839),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.0992),
        ),
        score=(-1.634, -1.066, -0.631, -0.295, 0.011, 0.291, 0.516, 0.715, 0.916, 1.139, 1.404, 1.808),
        std_px=(0.421, 5.652, 17.149, 21.969, 27.205, 30.434, 30.876, 30.989, 32.813, 34.665, 41.24, 48.047),
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
        Logarithm of the mean margin over 15 px; logarithm of how bent the matched map is, mean over 15 px; share of
        kept pixels, over 31 px; logarithm of the spread of the dense map over 15 px; logarithm of how far both views'
        disparities are apart, mean over 5 px; ``ln(1 + r)``, r the distance to what was kept, px; ``ln(1 + w)``, w how
        much wider the hole is in its row than the step it lies beside, px: what the right camera cannot see is as wide
        as the step.
    """
    kept = np.isfinite(kept_px)
    bent = np.abs(cv2.Laplacian(matched.left_px, cv2.CV_32F)).clip(0, _MOST_BENT_PX)
    if not kept.any():
        bent[:] = _MOST_BENT_PX  # a smooth map of which nothing was kept is no better than a rough one
    apart = np.nan_to_num(left_right_difference(matched.left_px, matched.right_px), nan=_MOST_APART_PX)
    parts = (
        np.log(np.maximum(cv2.blur(matched.margin, (_AROUND_PX, _AROUND_PX)), 1)),
        np.log(cv2.blur(bent, (_AROUND_PX, _AROUND_PX)) + _BENT_FLOOR_PX),
        cv2.blur(kept.astype(np.float32), (_WIDE_PX, _WIDE_PX)),
        np.log(_spread(disparity_px, _AROUND_PX) + _SPREAD_FLOOR_PX),
        np.log(cv2.blur(apart.clip(0, _MOST_APART_PX), (_NEAR_PX, _NEAR_PX)) + _APART_FLOOR_PX),
        np.log1p(cv2.distanceTransform((~kept).astype(np.uint8), cv2.DIST_L2, 3).clip(0, kept.shape[1])),
        np.log1p(_wider_than_step(kept_px)),
    )
    return np.moveaxis(np.stack(parts).astype(np.float32, copy=False), 0, -1)  # one sign after the other in memory


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
    out, each_px = np.empty(kind.size, np.float32), kind.ravel()
    planes = np.moveaxis(sign, -1, 0).reshape(sign.shape[-1], -1)
    for each, law in LAWS.items():
        here = np.flatnonzero(each_px == each)
        z = scaled(planes.take(here, axis=1), law.mean, law.scale)
        score = np.asarray(law.products, np.float32).T @ z
        score += np.asarray(law.weights, np.float32)[:, None]
        score *= z
        out[here] = np.interp(score.sum(axis=0), law.score, law.std_px)
    return out.reshape(kind.shape)


def scaled(sign: Floats, mean: npt.ArrayLike, scale: npt.ArrayLike) -> Floats:
    """Signs as a `StdLaw` counts them.

    Parameters
    ----------
    sign : (7, N) of float
    mean, scale : (7,) of float

    Returns
    -------
    (7, N), of the same dtype
    """
    z = sign - np.asarray(mean, sign.dtype)[:, None]
    z /= np.asarray(scale, sign.dtype)[:, None]
    return np.clip(z, -_FAR, _FAR, out=z)


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
