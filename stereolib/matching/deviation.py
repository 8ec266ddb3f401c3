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
        scale=(0.479, 0.665, 0.132, 1.103, 0.602, 1.0, 1.0),
        weights=(-0.1606, 0.1023, -0.0721, -0.0795, 0.0899, 0.0, 0.0),
        products=(
            (-0.0069, -0.0088, 0.0424, -0.0331, 0.041, 0.0, 0.0),
            (0.0, 0.0042, 0.014, -0.0194, 0.0488, 0.0, 0.0),
            (0.0, 0.0, -0.0094, -0.0506, -0.0136, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0186, -0.0104, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, -0.0164, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ),
        score=(
            -0.326,
            -0.282,
            -0.253,
            -0.229,
            -0.205,
            -0.182,
            -0.156,
            -0.128,
            -0.092,
            -0.042,
            0.033,
            0.133,
            0.247,
            0.388,
            0.59,
            0.841,
            1.049,
            1.219,
            1.375,
            1.588,
        ),
        std_px=(
            0.083,
            0.094,
            0.107,
            0.117,
            0.124,
            0.129,
            0.133,
            0.139,
            0.153,
            0.184,
            0.233,
            0.304,
            0.394,
            0.508,
            0.645,
            0.864,
            1.13,
            1.575,
            16.864,
            22.833,
        ),
    ),
    Kind.STEP: StdLaw(
        mean=(4.749, -0.733, 0.789, 2.844, -0.696, 0.0, 0.0),
        scale=(0.511, 0.349, 0.195, 0.777, 0.629, 1.0, 1.0),
        weights=(-0.0745, 0.0222, -0.3275, 0.1214, 0.2678, 0.0, 0.0),
        products=(
            (-0.1683, -0.0294, 0.0555, 0.0683, 0.0132, 0.0, 0.0),
            (0.0, -0.0872, 0.0214, 0.0362, 0.0213, 0.0, 0.0),
            (0.0, 0.0, -0.0503, -0.1177, -0.1049, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0111, 0.0741, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, -0.0202, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ),
        score=(-1.055, -0.847, -0.731, -0.638, -0.546, -0.441, -0.31, -0.152, 0.028, 0.277, 0.65, 1.3),
        std_px=(0.239, 0.41, 0.491, 0.503, 0.562, 0.66, 4.778, 10.737, 13.613, 18.049, 21.86, 27.305),
    ),
    Kind.GAP: StdLaw(
        mean=(4.216, -1.295, 0.434, 1.674, 0.577, 1.447, 1.724),
        scale=(0.498, 0.8, 0.272, 1.474, 0.732, 0.775, 1.463),
        weights=(-0.0158, 0.2996, -0.2414, 0.2618, -0.1822, 0.0101, 0.1188),
        products=(
            (-0.0211, 0.0576, 0.0828, -0.0182, -0.1064, 0.0635, 0.0268),
            (0.0, 0.1129, 0.1234, 0.1002, 0.2437, 0.1267, -0.1445),
            (0.0, 0.0, -0.1301, -0.2056, -0.0131, 0.0011, -0.0472),
            (0.0, 0.0, 0.0, -0.0444, -0.1409, -0.1814, 0.1105),
            (0.0, 0.0, 0.0, 0.0, -0.1019, -0.0644, 0.0129),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.1188, 0.0068),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0296),
        ),
        score=(-1.115, -0.805, -0.637, -0.483, -0.348, -0.222, -0.084, 0.078, 0.267, 0.501, 0.827, 1.401),
        std_px=(0.353, 0.479, 0.618, 0.775, 0.915, 1.209, 1.859, 8.289, 15.556, 18.958, 22.004, 28.209),
    ),
    Kind.BORDER: StdLaw(
        mean=(3.261, -1.956, 0.083, 1.068, 1.226, 3.067, 4.308),
        scale=(0.779, 1.101, 0.144, 1.551, 0.391, 1.035, 0.79),
        weights=(-0.3612, 0.1827, 0.0913, 0.0287, -0.1458, 0.423, 0.2916),
        products=(
            (0.0696, 0.0721, -0.1974, -0.0138, -0.1411, 0.0154, -0.1012),
            (0.0, -0.3757, -0.143, 0.1873, -0.1479, -0.1803, 0.1099),
            (0.0, 0.0, -0.0022, -0.0338, -0.0975, 0.0372, -0.0639),
            (0.0, 0.0, 0.0, 0.2063, -0.0152, -0.0345, -0.0703),
            (0.0, 0.0, 0.0, 0.0, -0.0567, -0.2074, 0.0337),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.2468, -0.0551),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.0414),
        ),
        score=(-1.682, -1.226, -0.835, -0.493, -0.187, 0.062, 0.285, 0.511, 0.758, 1.037, 1.362, 1.874),
        std_px=(0.372, 0.638, 11.129, 17.282, 22.841, 25.482, 26.771, 29.016, 31.437, 34.764, 38.699, 43.974),
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
