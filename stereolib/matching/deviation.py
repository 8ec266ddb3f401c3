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
        mean=(5.277, -2.305, 0.936, 0.411, -1.622, 0.0, 0.0),
        scale=(0.451, 0.624, 0.12, 1.108, 0.518, 1.0, 1.0),
        weights=(-0.1803, 0.1278, -0.0602, -0.1332, 0.0451, 0.0, -0.0),
        products=(
            (-0.0277, -0.0213, 0.0597, -0.0238, 0.005, 0.0, -0.0),
            (0.0, 0.016, 0.0147, -0.0527, 0.0289, 0.0, 0.0),
            (0.0, 0.0, -0.0095, -0.0355, -0.0007, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0431, -0.0088, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, -0.0094, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ),
        score=(
            -0.278,
            -0.241,
            -0.214,
            -0.19,
            -0.167,
            -0.144,
            -0.118,
            -0.09,
            -0.059,
            -0.021,
            0.028,
            0.094,
            0.183,
            0.312,
            0.519,
            0.801,
            1.059,
            1.259,
            1.468,
        ),
        std_px=(
            0.088,
            0.098,
            0.11,
            0.117,
            0.123,
            0.127,
            0.134,
            0.142,
            0.155,
            0.178,
            0.213,
            0.258,
            0.333,
            0.447,
            0.589,
            0.801,
            1.101,
            1.557,
            3.232,
        ),
    ),
    Kind.STEP: StdLaw(
        mean=(4.747, -0.742, 0.794, 2.861, -0.686, 0.0, 0.0),
        scale=(0.491, 0.326, 0.186, 0.78, 0.631, 1.0, 1.0),
        weights=(-0.1652, 0.0071, -0.2737, 0.1316, 0.2156, 0.0, 0.0),
        products=(
            (-0.0943, -0.0056, 0.0345, 0.0075, 0.0492, -0.0, -0.0),
            (0.0, -0.0987, -0.0031, 0.0435, 0.004, 0.0, 0.0),
            (0.0, 0.0, -0.0192, -0.0567, -0.1146, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0395, 0.0538, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, -0.0017, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ),
        score=(-0.902, -0.709, -0.581, -0.483, -0.397, -0.312, -0.208, -0.067, 0.109, 0.339, 0.684, 1.276),
        std_px=(0.23, 0.328, 0.465, 0.509, 0.54, 0.662, 2.916, 8.165, 13.719, 17.154, 21.16, 26.467),
    ),
    Kind.GAP: StdLaw(
        mean=(4.123, -1.384, 0.463, 1.729, 0.657, 1.413, 1.497),
        scale=(0.563, 0.844, 0.265, 1.544, 0.749, 0.721, 1.281),
        weights=(-0.003, 0.3966, -0.4066, 0.1377, -0.3039, -0.03, 0.1279),
        products=(
            (-0.0331, 0.0789, 0.0779, -0.0524, -0.1314, 0.0433, 0.0915),
            (0.0, 0.0714, 0.0299, 0.1599, 0.262, -0.0139, -0.1594),
            (0.0, 0.0, -0.0654, -0.1483, -0.0177, -0.0114, -0.0462),
            (0.0, 0.0, 0.0, -0.0118, -0.1469, -0.0489, 0.1045),
            (0.0, 0.0, 0.0, 0.0, -0.1377, -0.047, -0.0028),
            (0.0, 0.0, 0.0, 0.0, 0.0, -0.0031, 0.0367),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0379),
        ),
        score=(-1.132, -0.813, -0.64, -0.504, -0.369, -0.24, -0.099, 0.056, 0.238, 0.467, 0.769, 1.281),
        std_px=(0.326, 0.427, 0.59, 0.734, 0.979, 2.37, 9.598, 13.355, 14.971, 17.555, 19.449, 23.2),
    ),
    Kind.BORDER: StdLaw(
        mean=(3.016, -2.172, 0.102, 0.984, 1.276, 2.889, 4.029),
        scale=(0.963, 1.107, 0.159, 1.578, 0.343, 0.985, 0.708),
        weights=(-0.6276, 0.3227, 0.0591, -0.1722, -0.1735, 0.1531, 0.1879),
        products=(
            (-0.0992, 0.1302, -0.1526, 0.0021, -0.166, -0.0327, -0.4835),
            (0.0, -0.1692, 0.0997, 0.0712, -0.0603, 0.1589, -0.0725),
            (0.0, 0.0, 0.0054, -0.1445, -0.0481, 0.1095, -0.1845),
            (0.0, 0.0, 0.0, 0.3645, -0.0595, -0.12, -0.0549),
            (0.0, 0.0, 0.0, 0.0, 0.0255, -0.2943, 0.0502),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.3471, -0.4384),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.1899),
        ),
        score=(-1.568, -1.136, -0.82, -0.537, -0.283, -0.034, 0.219, 0.463, 0.714, 1.004, 1.391, 2.037),
        std_px=(0.329, 0.478, 0.718, 3.987, 11.882, 17.879, 22.467, 27.833, 30.692, 32.372, 37.883, 44.861),
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
