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
        mean=(5.314, -2.29, 0.927, 0.43, -1.642, 0.0, 0.0),
        scale=(0.48, 0.666, 0.13, 1.101, 0.602, 1.0, 1.0),
        weights=(-0.161, 0.0999, -0.0746, -0.0731, 0.0938, 0.0, 0.0),
        products=(
            (-0.0038, 0.0, 0.0414, -0.0342, 0.0432, 0.0, 0.0),
            (0.0, 0.0094, 0.0131, -0.0154, 0.0473, 0.0, 0.0),
            (0.0, 0.0, -0.0084, -0.0496, -0.014, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0162, -0.0061, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, -0.014, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ),
        score=(
            -0.329,
            -0.284,
            -0.255,
            -0.23,
            -0.206,
            -0.182,
            -0.156,
            -0.127,
            -0.091,
            -0.04,
            0.037,
            0.138,
            0.254,
            0.398,
            0.604,
            0.858,
            1.072,
            1.251,
            1.418,
            1.647,
        ),
        std_px=(
            0.082,
            0.093,
            0.106,
            0.116,
            0.123,
            0.129,
            0.132,
            0.138,
            0.153,
            0.185,
            0.235,
            0.307,
            0.395,
            0.51,
            0.648,
            0.877,
            1.142,
            1.566,
            18.0,
            22.907,
        ),
    ),
    Kind.STEP: StdLaw(
        mean=(4.74, -0.748, 0.802, 2.825, -0.628, 0.0, 0.0),
        scale=(0.506, 0.342, 0.195, 0.778, 0.63, 1.0, 1.0),
        weights=(-0.059, -0.0368, -0.3338, 0.1671, 0.3073, 0.0, 0.0),
        products=(
            (-0.1859, -0.0417, 0.061, 0.0155, 0.0257, 0.0, 0.0),
            (0.0, -0.1184, -0.0191, 0.0579, -0.003, 0.0, 0.0),
            (0.0, 0.0, -0.0814, -0.0648, -0.0723, 0.0, 0.0),
            (0.0, 0.0, 0.0, -0.0129, 0.0551, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0082, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ),
        score=(-1.189, -0.996, -0.876, -0.769, -0.651, -0.514, -0.363, -0.192, 0.01, 0.269, 0.623, 1.154),
        std_px=(0.521, 0.556, 0.544, 0.645, 5.993, 11.538, 12.349, 16.226, 17.992, 20.971, 22.651, 27.163),
    ),
    Kind.GAP: StdLaw(
        mean=(4.195, -1.356, 0.432, 1.584, 0.613, 1.461, 1.706),
        scale=(0.488, 0.794, 0.274, 1.468, 0.711, 0.774, 1.486),
        weights=(-0.0377, 0.153, -0.2365, 0.3734, -0.3002, 0.1274, 0.1345),
        products=(
            (-0.0426, 0.0438, 0.1106, 0.0116, -0.0866, 0.0424, 0.0234),
            (0.0, 0.1544, 0.1239, 0.0828, 0.3204, 0.16, -0.1994),
            (0.0, 0.0, -0.0949, -0.164, 0.0334, -0.029, 0.0115),
            (0.0, 0.0, 0.0, -0.0702, -0.1803, -0.1878, 0.1254),
            (0.0, 0.0, 0.0, 0.0, -0.16, -0.0869, 0.1119),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0436, 0.0039),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0978),
        ),
        score=(-1.312, -0.991, -0.813, -0.653, -0.499, -0.344, -0.171, 0.019, 0.228, 0.478, 0.806, 1.365),
        std_px=(0.372, 0.553, 0.644, 0.819, 0.979, 2.46, 11.611, 15.616, 17.495, 20.278, 23.573, 25.446),
    ),
    Kind.BORDER: StdLaw(
        mean=(3.26, -1.601, 0.082, 1.144, 1.225, 3.076, 4.313),
        scale=(0.778, 1.073, 0.144, 1.45, 0.394, 1.033, 0.789),
        weights=(-0.3927, 0.1149, 0.1887, 0.0912, -0.1442, 0.4272, 0.3179),
        products=(
            (0.0223, 0.0351, -0.1962, 0.0218, -0.1567, -0.0389, -0.095),
            (0.0, -0.1064, -0.0346, -0.0725, 0.0109, -0.0287, -0.0081),
            (0.0, 0.0, 0.082, -0.0775, -0.0255, 0.2172, -0.099),
            (0.0, 0.0, 0.0, 0.2235, -0.0662, -0.0875, -0.0003),
            (0.0, 0.0, 0.0, 0.0, -0.0424, -0.1216, 0.0465),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.2861, -0.0715),
            (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.0833),
        ),
        score=(-1.728, -1.271, -0.862, -0.51, -0.209, 0.047, 0.26, 0.471, 0.728, 1.022, 1.359, 1.863),
        std_px=(0.407, 0.559, 12.302, 22.48, 25.119, 25.698, 27.603, 27.692, 29.331, 32.279, 36.586, 46.487),
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
    window = np.ones((size_px, size_px), np.uint8)
    return cv2.dilate(disparity_px, window) - cv2.erode(disparity_px, window)
