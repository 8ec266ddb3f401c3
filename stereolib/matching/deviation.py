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
        mean=(5.197, -3.699, 0.921, 0.193, -1.571, 0.0, 0.0),
        scale=(0.469, 1.014, 0.134, 1.306, 0.562, 1.0, 1.0),
        weights=(-0.131, 0.2462, -0.0647, -0.1037, 0.058, -0.0, -0.0),
        products=(
            (-0.016, 0.003, 0.0809, -0.0481, 0.0112, -0.0, 0.0),
            (0.0, -0.111, 0.0102, 0.1146, 0.0609, 0.0, 0.0),
            (0.0, 0.0, 0.0026, -0.0426, 0.0053, 0.0, 0.0),
            (0.0, 0.0, 0.0, -0.0634, -0.0376, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, -0.0185, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ),
        score=(
            -0.468,
            -0.401,
            -0.354,
            -0.309,
            -0.273,
            -0.245,
            -0.218,
            -0.188,
            -0.149,
            -0.101,
            -0.04,
            0.041,
            0.149,
            0.298,
            0.524,
            0.834,
            1.115,
            1.326,
            1.547,
        ),
        std_px=(
            0.055,
            0.067,
            0.08,
            0.101,
            0.116,
            0.118,
            0.121,
            0.133,
            0.157,
            0.191,
            0.238,
            0.298,
            0.378,
            0.47,
            0.634,
            0.92,
            1.47,
            2.483,
            21.121,
        ),
    ),
    Kind.STEP: StdLaw(
        mean=(4.715, -0.964, 0.763, 2.961, -0.633, 0.0, 0.0),
        scale=(0.484, 0.315, 0.204, 0.756, 0.654, 1.0, 1.0),
        weights=(-0.0796, 0.0895, -0.4126, 0.1376, 0.2646, -0.0, -0.0),
        products=(
            (-0.1853, -0.0014, 0.1591, -0.0143, 0.0034, 0.0, 0.0),
            (0.0, -0.0534, 0.0154, 0.0308, -0.0072, 0.0, 0.0),
            (0.0, 0.0, -0.0721, -0.0565, -0.0902, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0714, 0.0564, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, -0.0061, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ),
        score=(-1.077, -0.859, -0.72, -0.607, -0.494, -0.364, -0.208, -0.015, 0.218, 0.498, 0.868, 1.465),
        std_px=(0.178, 0.302, 0.399, 0.648, 6.013, 11.279, 14.514, 16.291, 18.367, 20.607, 23.867, 30.514),
    ),
    Kind.GAP: StdLaw(
        mean=(4.049, -2.022, 0.423, 1.635, 0.649, 1.481, 1.707),
        scale=(0.538, 1.354, 0.268, 1.677, 0.73, 0.766, 1.389),
        weights=(-0.0549, 0.4491, -0.5091, 0.1464, -0.306, -0.0462, 0.1185),
        products=(
            (-0.0625, 0.0348, 0.1141, -0.02, -0.1059, 0.0393, 0.0982),
            (0.0, 0.1943, 0.1347, 0.0631, 0.2005, 0.0972, -0.1438),
            (0.0, 0.0, -0.0029, -0.1737, 0.0311, -0.0092, 0.0042),
            (0.0, 0.0, 0.0, 0.0398, -0.0961, -0.1071, 0.1021),
            (0.0, 0.0, 0.0, 0.0, -0.1301, -0.1101, 0.1296),
            (0.0, 0.0, 0.0, 0.0, 0.0, -0.0033, 0.0193),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0238),
        ),
        score=(-1.093, -0.818, -0.627, -0.459, -0.301, -0.138, 0.039, 0.24, 0.469, 0.734, 1.052, 1.544),
        std_px=(0.37, 0.52, 0.696, 1.022, 4.271, 12.211, 15.082, 16.718, 18.667, 20.754, 23.224, 30.452),
    ),
    Kind.BORDER: StdLaw(
        mean=(2.956, -3.008, 0.091, 0.944, 1.271, 2.937, 4.112),
        scale=(0.933, 1.535, 0.15, 1.704, 0.354, 0.972, 0.659),
        weights=(-0.6306, 0.5557, 0.0005, -0.2388, -0.1248, 0.1514, 0.0937),
        products=(
            (-0.1085, -0.0928, -0.1096, 0.2756, -0.196, -0.1341, -0.2347),
            (0.0, -0.2407, -0.072, 0.2241, -0.0014, -0.1169, -0.0439),
            (0.0, 0.0, -0.007, 0.0339, -0.0015, -0.0223, -0.1702),
            (0.0, 0.0, 0.0, 0.1955, -0.0446, 0.1833, 0.0435),
            (0.0, 0.0, 0.0, 0.0, 0.0222, -0.2064, 0.0428),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.1169, -0.2669),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.1681),
        ),
        score=(-1.694, -1.259, -0.95, -0.656, -0.358, -0.08, 0.176, 0.424, 0.667, 0.932, 1.248, 1.705),
        std_px=(0.414, 0.524, 0.987, 10.457, 19.023, 25.266, 30.057, 29.991, 30.461, 32.16, 34.734, 41.013),
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
