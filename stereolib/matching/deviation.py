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
        mean=(5.316, -2.292, 0.924, 0.428, -1.643, 0.0, 0.0),
        scale=(0.479, 0.665, 0.132, 1.103, 0.603, 1.0, 1.0),
        weights=(-0.1611, 0.1004, -0.072, -0.0783, 0.0915, 0.0, 0.0),
        products=(
            (-0.0068, -0.0068, 0.0438, -0.0341, 0.0414, 0.0, 0.0),
            (0.0, 0.0035, 0.0159, -0.0178, 0.0504, 0.0, 0.0),
            (0.0, 0.0, -0.0091, -0.0522, -0.0134, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.018, -0.0123, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, -0.016, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ),
        score=(
            -0.326,
            -0.283,
            -0.254,
            -0.229,
            -0.206,
            -0.182,
            -0.156,
            -0.128,
            -0.092,
            -0.042,
            0.034,
            0.133,
            0.248,
            0.389,
            0.591,
            0.842,
            1.05,
            1.22,
            1.379,
            1.593,
        ),
        std_px=(
            0.084,
            0.094,
            0.107,
            0.116,
            0.124,
            0.129,
            0.133,
            0.138,
            0.154,
            0.186,
            0.234,
            0.304,
            0.394,
            0.507,
            0.645,
            0.869,
            1.111,
            1.561,
            17.109,
            23.046,
        ),
    ),
    Kind.STEP: StdLaw(
        mean=(4.749, -0.734, 0.788, 2.845, -0.697, 0.0, 0.0),
        scale=(0.51, 0.349, 0.195, 0.777, 0.628, 1.0, 1.0),
        weights=(-0.0693, 0.0274, -0.3251, 0.1169, 0.2722, 0.0, 0.0),
        products=(
            (-0.1642, -0.0313, 0.0393, 0.0572, 0.0086, 0.0, 0.0),
            (0.0, -0.0939, 0.0136, 0.031, 0.0142, 0.0, 0.0),
            (0.0, 0.0, -0.0444, -0.11, -0.1157, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0113, 0.076, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, -0.0235, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ),
        score=(-1.057, -0.849, -0.73, -0.638, -0.548, -0.446, -0.319, -0.161, 0.025, 0.28, 0.66, 1.318),
        std_px=(0.23, 0.404, 0.482, 0.534, 0.551, 0.665, 3.812, 10.023, 14.134, 17.704, 21.555, 27.134),
    ),
    Kind.GAP: StdLaw(
        mean=(4.216, -1.303, 0.434, 1.669, 0.576, 1.447, 1.724),
        scale=(0.497, 0.801, 0.272, 1.478, 0.733, 0.774, 1.463),
        weights=(-0.0196, 0.31, -0.2296, 0.2579, -0.1789, 0.0186, 0.1251),
        products=(
            (-0.0219, 0.0551, 0.0821, -0.0169, -0.1068, 0.06, 0.0259),
            (0.0, 0.1056, 0.1323, 0.113, 0.2304, 0.1276, -0.1393),
            (0.0, 0.0, -0.1223, -0.2051, -0.0108, 0.0148, -0.0448),
            (0.0, 0.0, 0.0, -0.0492, -0.1347, -0.1771, 0.107),
            (0.0, 0.0, 0.0, 0.0, -0.0982, -0.0684, 0.0145),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.1237, 0.0085),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0237),
        ),
        score=(-1.114, -0.806, -0.636, -0.482, -0.346, -0.219, -0.081, 0.08, 0.269, 0.504, 0.826, 1.402),
        std_px=(0.347, 0.479, 0.631, 0.764, 0.915, 1.071, 1.891, 9.161, 15.184, 19.001, 22.395, 27.451),
    ),
    Kind.BORDER: StdLaw(
        mean=(3.261, -1.962, 0.083, 1.056, 1.226, 3.067, 4.308),
        scale=(0.779, 1.103, 0.144, 1.557, 0.392, 1.035, 0.79),
        weights=(-0.3696, 0.1711, 0.0777, 0.0563, -0.1266, 0.411, 0.2928),
        products=(
            (0.0628, 0.0754, -0.1979, -0.017, -0.136, 0.0153, -0.1062),
            (0.0, -0.3959, -0.171, 0.2121, -0.1623, -0.2062, 0.1063),
            (0.0, 0.0, -0.0094, -0.0138, -0.1008, 0.0039, -0.0636),
            (0.0, 0.0, 0.0, 0.1866, -0.0067, -0.0217, -0.055),
            (0.0, 0.0, 0.0, 0.0, -0.0545, -0.2039, 0.0375),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.228, -0.0593),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.0438),
        ),
        score=(-1.721, -1.252, -0.853, -0.509, -0.201, 0.043, 0.261, 0.488, 0.735, 1.012, 1.344, 1.848),
        std_px=(0.372, 0.633, 11.204, 17.411, 23.111, 25.182, 27.304, 28.465, 31.589, 35.016, 38.407, 44.159),
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
