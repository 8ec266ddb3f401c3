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
        mean=(5.201, -2.248, 0.922, 0.428, -1.576, 0.0, 0.0),
        scale=(0.466, 0.653, 0.133, 1.156, 0.558, 1.0, 1.0),
        weights=(-0.1672, 0.1559, -0.0647, -0.1372, 0.063, 0.0, 0.0),
        products=(
            (-0.036, -0.019, 0.0814, -0.0333, 0.0013, -0.0, -0.0),
            (0.0, 0.0196, 0.045, -0.0619, 0.0433, 0.0, 0.0),
            (0.0, 0.0, -0.0034, -0.0621, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0441, -0.0148, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, -0.0204, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ),
        score=(
            -0.326,
            -0.281,
            -0.25,
            -0.222,
            -0.194,
            -0.167,
            -0.138,
            -0.104,
            -0.064,
            -0.014,
            0.048,
            0.127,
            0.232,
            0.377,
            0.602,
            0.901,
            1.164,
            1.366,
            1.603,
        ),
        std_px=(
            0.094,
            0.107,
            0.12,
            0.128,
            0.132,
            0.136,
            0.143,
            0.159,
            0.185,
            0.22,
            0.264,
            0.341,
            0.442,
            0.548,
            0.692,
            0.949,
            1.404,
            2.08,
            22.761,
        ),
    ),
    Kind.STEP: StdLaw(
        mean=(4.682, -0.756, 0.759, 2.865, -0.618, 0.0, 0.0),
        scale=(0.489, 0.304, 0.202, 0.834, 0.645, 1.0, 1.0),
        weights=(-0.1899, -0.0062, -0.2987, 0.1658, 0.233, -0.0, -0.0),
        products=(
            (-0.0852, 0.0046, 0.0532, -0.0019, 0.083, -0.0, -0.0),
            (0.0, -0.0986, -0.0055, 0.0434, 0.0166, -0.0, 0.0),
            (0.0, 0.0, -0.0311, -0.0634, -0.1207, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0149, 0.0656, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0022, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ),
        score=(-1.066, -0.84, -0.689, -0.564, -0.449, -0.331, -0.197, -0.046, 0.143, 0.392, 0.743, 1.327),
        std_px=(0.231, 0.393, 0.51, 0.542, 0.708, 3.495, 9.026, 14.526, 17.307, 19.933, 23.595, 29.816),
    ),
    Kind.GAP: StdLaw(
        mean=(4.049, -1.3, 0.423, 1.771, 0.649, 1.481, 1.707),
        scale=(0.538, 0.814, 0.268, 1.545, 0.73, 0.766, 1.389),
        weights=(-0.0037, 0.4069, -0.503, 0.1841, -0.2862, -0.0132, 0.1055),
        products=(
            (-0.0437, 0.0979, 0.1253, -0.0673, -0.067, 0.0451, 0.0802),
            (0.0, 0.0552, 0.1312, 0.1347, 0.2618, 0.0869, -0.1304),
            (0.0, 0.0, -0.0128, -0.1576, 0.018, 0.0215, -0.0137),
            (0.0, 0.0, 0.0, 0.0631, -0.1233, -0.0912, 0.0888),
            (0.0, 0.0, 0.0, 0.0, -0.111, -0.0888, 0.0942),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0039, 0.0092),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0356),
        ),
        score=(-1.218, -0.867, -0.677, -0.509, -0.352, -0.193, -0.023, 0.165, 0.383, 0.638, 0.952, 1.455),
        std_px=(0.353, 0.567, 0.735, 0.89, 4.895, 12.13, 14.628, 16.28, 17.836, 20.854, 23.116, 30.929),
    ),
    Kind.BORDER: StdLaw(
        mean=(2.956, -2.052, 0.091, 1.031, 1.271, 2.937, 4.112),
        scale=(0.933, 1.09, 0.15, 1.639, 0.354, 0.972, 0.659),
        weights=(-0.5961, 0.3479, -0.0171, -0.1114, -0.148, 0.154, 0.1218),
        products=(
            (-0.0808, -0.0069, -0.1416, 0.2033, -0.1584, -0.1077, -0.2788),
            (0.0, -0.1865, -0.0042, 0.1851, -0.0508, -0.024, 0.005),
            (0.0, 0.0, 0.0189, -0.0359, -0.0101, 0.0256, -0.1725),
            (0.0, 0.0, 0.0, 0.2618, -0.0033, 0.0965, -0.0186),
            (0.0, 0.0, 0.0, 0.0, 0.0157, -0.1921, 0.0526),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.1569, -0.2909),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.1654),
        ),
        score=(-1.588, -1.137, -0.799, -0.509, -0.237, 0.02, 0.258, 0.496, 0.73, 0.99, 1.314, 1.834),
        std_px=(0.423, 0.53, 1.442, 11.53, 18.955, 24.832, 30.474, 30.146, 30.002, 31.443, 34.624, 41.649),
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
        as the step. NaN tells nothing: where no pixel at all was kept.
    """
    kept = np.isfinite(kept_px)
    bent = np.abs(cv2.Laplacian(disparity_px, cv2.CV_32F)).clip(0, _MOST_BENT_PX)
    if not kept.any():
        bent[:] = np.nan  # a smooth map of which nothing was kept is no better than a rough one
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
        worst = law.score[-1]  # where the signs tell nothing
        out[here] = np.interp(np.nan_to_num(score.sum(axis=0), nan=worst), law.score, np.log(law.std_px))
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
