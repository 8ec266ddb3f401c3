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
from stereolib.matching.surfaces import STEP_PX

_NEAR_PX, _AROUND_PX, _WIDE_PX = 5, 15, 31  # edges of the windows that are looked at
_MOST_BENT_PX, _MOST_APART_PX = 2.0, 4.0  # more counts as so much
_FAR = 3.0  # scales from the mean: signs beyond count as so far
_BENT_FLOOR_PX, _SPREAD_FLOOR_PX, _APART_FLOOR_PX = 0.01, 0.1, 0.05  # added before the logarithm is taken


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
        The standard deviation there; between them its logarithm is interpolated, beyond them it stays.
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
        mean=(5.316, -2.294, 0.924, 0.425, -1.643, 0.0, 0.0),
        scale=(0.479, 0.664, 0.132, 1.1, 0.602, 1.0, 1.0),
        weights=(-0.1618, 0.0981, -0.0754, -0.0787, 0.0924, 0.0, 0.0),
        products=(
            (-0.0038, -0.0015, 0.0444, -0.0329, 0.042, -0.0, 0.0),
            (0.0, 0.0077, 0.0154, -0.0218, 0.0462, -0.0, 0.0),
            (0.0, 0.0, -0.0104, -0.0494, -0.0148, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0193, -0.0077, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, -0.0146, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ),
        score=(
            -0.328,
            -0.284,
            -0.255,
            -0.231,
            -0.207,
            -0.183,
            -0.157,
            -0.128,
            -0.093,
            -0.042,
            0.034,
            0.134,
            0.249,
            0.39,
            0.592,
            0.843,
            1.052,
            1.222,
            1.375,
            1.59,
        ),
        std_px=(
            0.082,
            0.093,
            0.106,
            0.115,
            0.123,
            0.129,
            0.132,
            0.138,
            0.153,
            0.185,
            0.232,
            0.302,
            0.393,
            0.503,
            0.643,
            0.861,
            1.113,
            1.522,
            12.063,
            22.285,
        ),
    ),
    Kind.STEP: StdLaw(
        mean=(4.746, -0.734, 0.788, 2.843, -0.693, 0.0, 0.0),
        scale=(0.512, 0.349, 0.196, 0.776, 0.631, 1.0, 1.0),
        weights=(-0.0675, 0.0268, -0.3376, 0.1255, 0.2657, 0.0, 0.0),
        products=(
            (-0.141, 0.0034, 0.0226, 0.0515, 0.0137, -0.0, -0.0),
            (0.0, -0.0832, -0.0006, 0.0321, 0.0102, -0.0, 0.0),
            (0.0, 0.0, -0.0488, -0.1023, -0.1006, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0083, 0.0661, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, -0.0187, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ),
        score=(-1.078, -0.864, -0.741, -0.645, -0.552, -0.446, -0.311, -0.154, 0.032, 0.282, 0.657, 1.273),
        std_px=(0.238, 0.393, 0.517, 0.516, 0.564, 0.676, 4.572, 11.134, 14.146, 18.704, 22.424, 27.47),
    ),
    Kind.GAP: StdLaw(
        mean=(4.215, -1.337, 0.434, 1.615, 0.577, 1.445, 1.724),
        scale=(0.497, 0.792, 0.272, 1.469, 0.732, 0.769, 1.459),
        weights=(-0.0584, 0.2047, -0.2967, 0.3106, -0.2532, 0.0641, 0.1239),
        products=(
            (-0.0514, 0.0555, 0.0886, -0.0056, -0.0773, 0.0129, 0.0017),
            (0.0, 0.1641, 0.1592, 0.0738, 0.3174, 0.1651, -0.203),
            (0.0, 0.0, -0.0875, -0.2372, 0.0394, -0.0533, -0.007),
            (0.0, 0.0, 0.0, -0.0602, -0.1755, -0.1936, 0.1079),
            (0.0, 0.0, 0.0, 0.0, -0.1155, -0.0741, 0.0681),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0397, -0.0026),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0897),
        ),
        score=(-1.195, -0.871, -0.705, -0.55, -0.409, -0.269, -0.11, 0.077, 0.286, 0.532, 0.868, 1.447),
        std_px=(0.339, 0.535, 0.645, 0.814, 0.931, 1.793, 9.25, 14.313, 17.223, 19.53, 23.331, 25.194),
    ),
    Kind.BORDER: StdLaw(
        mean=(3.262, -1.595, 0.082, 1.153, 1.224, 3.073, 4.313),
        scale=(0.779, 1.071, 0.144, 1.453, 0.395, 1.035, 0.79),
        weights=(-0.391, 0.1149, 0.1586, 0.0884, -0.146, 0.4188, 0.3153),
        products=(
            (0.0248, 0.0353, -0.1964, 0.0194, -0.1488, -0.0403, -0.0924),
            (0.0, -0.1042, -0.033, -0.0745, -0.003, -0.0229, -0.0059),
            (0.0, 0.0, 0.0517, -0.106, -0.0337, 0.1792, -0.1093),
            (0.0, 0.0, 0.0, 0.2245, -0.0601, -0.0996, -0.004),
            (0.0, 0.0, 0.0, 0.0, -0.0429, -0.1227, 0.0475),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.2808, -0.0786),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.0829),
        ),
        score=(-1.722, -1.265, -0.86, -0.509, -0.209, 0.05, 0.268, 0.482, 0.74, 1.034, 1.372, 1.873),
        std_px=(0.405, 0.55, 12.041, 22.352, 25.214, 25.767, 27.302, 27.989, 29.335, 32.273, 36.606, 46.561),
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
    return np.where(hole, filled, _spread(disparity_px, _NEAR_PX) > STEP_PX).astype(np.int8)


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
        Logarithm of the mean margin over 15 px; logarithm of how bent the dense map is, mean over 15 px; share of
        kept pixels, over 31 px; logarithm of the spread of the dense map over 15 px; logarithm of how far both views'
        disparities are apart, mean over 5 px; ``ln(1 + r)``, r the distance to what was kept, px; ``ln(1 + w)``, w how
        much wider the hole is in its row than the step it lies beside, px: what the right camera cannot see is as wide
        as the step.
    """
    kept = np.isfinite(kept_px)
    bent = np.abs(cv2.Laplacian(disparity_px, cv2.CV_32F)).clip(0, _MOST_BENT_PX)
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
        out[here] = np.interp(score.sum(axis=0), law.score, np.log(law.std_px))
    return np.exp(out, out=out).reshape(kind.shape)


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
    return cv2.morphologyEx(disparity_px, cv2.MORPH_GRADIENT, np.ones((size_px, size_px), np.uint8))
