"""How far a matched or filled disparity may be off, told by signs that every map shows without a truth."""

from __future__ import annotations

import json
from collections.abc import Sequence
from enum import IntEnum
from importlib import resources
from typing import Any, NamedTuple, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Float32, Ints
from stereolib.matching.census_sgm import SGMResult
from stereolib.matching.compiled import compiled
from stereolib.matching.disparity import left_right_difference
from stereolib.matching.even_pair import EvenPair
from stereolib.matching.surfaces import STEP_PX
from stereolib.rig import to_grey

_STEP_AROUND_PX, _NEAR_PX, _AROUND_PX, _WIDE_PX = 3, 5, 15, 31  # edges of the windows that are looked at
_MOST_BENT_PX, _MOST_MOVED_PX, _MOST_APART_PX, _FARTHEST_PX = 2.0, 8.0, 4.0, 60.0  # more counts as so much
_AT_ONCE = 256  # pixels, so that what is added up stays in the processor
FAR = 3.0  # scales from the mean: signs beyond count as so far
# Added before the logarithm is taken; the last two in units of the noise.
_BENT_FLOOR_PX, _SPREAD_FLOOR_PX, _MOVED_FLOOR_PX, _APART_FLOOR_PX = 0.01, 0.1, 0.05, 0.05
_UNLIKE_FLOOR, _ALONG_FLOOR = 0.3, 0.1


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
    mean, scale : (11,) of float
        A sign s of `signs` counts as ``z = (s - mean) / scale``, held within -3 and 3: nothing is told beyond what was
        seen.
    weights : (11,) of float
    products : (11, 11) of float
        The score is ``weights z + z products z``.
    score : (N,) of float
        Rising values of it.
    std_px : (N,) of float, px
        The standard deviation there; between them its logarithm is interpolated, beyond them it stays.
    """

    mean: Sequence[float]
    scale: Sequence[float]
    weights: Sequence[float]
    products: Sequence[Sequence[float]]
    score: Sequence[float]
    std_px: Sequence[float]


def _laws() -> dict[Kind, StdLaw]:
    """As `benchmarks/bench_pipeline.py` found them on virtual scenes, which writes the file."""
    with resources.files("stereolib.matching").joinpath("std_laws.json").open("rb") as file:
        return {Kind[name]: StdLaw(**law) for name, law in json.load(file).items()}


LAWS = _laws()


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
    kept, columns = np.isfinite(kept_px), np.arange(kept_px.shape[1])
    first, last = kept.argmax(axis=1)[:, None], columns[-1] - kept[:, ::-1].argmax(axis=1)[:, None]
    between = (first < columns) & (columns < last) & kept.any(axis=1, keepdims=True)
    filled = np.where(between, np.int8(Kind.GAP), np.int8(Kind.BORDER))
    return np.where(kept, (_spread(disparity_px, _NEAR_PX) > STEP_PX).astype(np.int8), filled)


def signs(disparity_px: Float32, matched: SGMResult, kept_px: Float32, pair: EvenPair) -> Float32:
    """Gather what tells good matches from bad ones.

    Parameters
    ----------
    disparity_px : (H, W) float32, px
        The dense map.
    matched : SGMResult
        As it was matched, nothing removed.
    kept_px : (H, W) float32, px
        What was matched and kept; NaN is a hole.
    pair : EvenPair
        What was matched.

    Returns
    -------
    (H, W, 11) float32
        Logarithms of the margin; of its mean over 15 px; of how bent the dense map is, mean over 15 px; of its spread
        over 15 px; of how far it is from what was matched, mean over 15 px; of how far both views' disparities are
        apart, mean over 5 px; of how unlike the pictures are, mean over 5 and over 15 px, and how much the left one
        changes along the row, mean over 5 px, in units of the noise; ``ln(1 + r)``, r the distance to a step, at most
        60 px; and, no logarithm, the share of kept pixels over 31 px. NaN tells nothing: where no pixel was kept.
    """
    kept = np.isfinite(kept_px)
    bent = np.abs(cv2.Laplacian(disparity_px, cv2.CV_32F)).clip(0, _MOST_BENT_PX)
    if not kept.any():
        bent[:] = np.nan  # a smooth map of which nothing was kept is no better than a rough one
    apart = np.nan_to_num(left_right_difference(matched.left_px, matched.right_px), nan=_MOST_APART_PX)
    moved, unlike = np.abs(matched.left_px - disparity_px), pair.unlike(disparity_px)
    along = np.abs(cv2.Sobel(to_grey(pair.left), cv2.CV_32F, 1, 0, ksize=1, scale=0.5)) / np.float32(pair.noise_grey)
    level = (_spread(disparity_px, _STEP_AROUND_PX) <= STEP_PX).astype(np.uint8)
    parts = (
        np.maximum(matched.margin, 1),
        np.maximum(_mean(matched.margin, _AROUND_PX), 1),
        _mean(bent, _AROUND_PX) + _BENT_FLOOR_PX,
        _spread(disparity_px, _AROUND_PX) + _SPREAD_FLOOR_PX,
        _mean(moved.clip(0, _MOST_MOVED_PX), _AROUND_PX) + _MOVED_FLOOR_PX,
        _mean(apart.clip(0, _MOST_APART_PX), _NEAR_PX) + _APART_FLOOR_PX,
        _mean(unlike, _NEAR_PX) + _UNLIKE_FLOOR,
        _mean(unlike, _AROUND_PX) + _UNLIKE_FLOOR,
        _mean(along, _NEAR_PX) + _ALONG_FLOOR,
        1 + cv2.distanceTransform(level, cv2.DIST_L2, 3).clip(0, _FARTHEST_PX),
    )
    every = np.empty((len(parts) + 1, *kept.shape), np.float32)  # one sign after the other in memory
    for part, sign in zip(parts, every, strict=False):
        cv2.log(part.astype(np.float32, copy=False), dst=sign)
    every[-1] = _mean(kept.astype(np.float32), _WIDE_PX)
    return np.moveaxis(every, 0, -1)


def std_px(kind: Kinds, sign: Float32) -> Float32:
    """Give each pixel its standard deviation by `LAWS`.

    Parameters
    ----------
    kind : (H, W) int8
    sign : (H, W, 11) float32

    Returns
    -------
    (H, W) float32, px

    Raises
    ------
    ValueError
        If there are not as many signs as the laws have, or their shape is not that of the kinds.
    """
    many = len(LAWS[Kind.SMOOTH].mean)
    if sign.shape != (*kind.shape, many):
        raise ValueError(f"a map of shape {kind.shape} needs {many} signs a pixel, got shape {sign.shape}")
    out, each_px = np.empty(kind.size, np.float32), kind.ravel()
    planes = np.moveaxis(sign, -1, 0).reshape(sign.shape[-1], -1)
    for each, law in LAWS.items():
        here = np.flatnonzero(each_px == each)
        score = np.empty(here.size, np.float32)
        _add_up(planes, here, np.array([law.mean, law.scale, law.weights, *law.products], np.float32), score)
        worst = law.score[-1]  # where the signs tell nothing
        out[here] = np.interp(np.nan_to_num(score, nan=worst), law.score, np.log(law.std_px))
    return np.exp(out, out=out).reshape(kind.shape)


def _mean(values: Float32, size_px: int) -> Any:
    return cv2.blur(values, (size_px, size_px))


def _spread(disparity_px: Float32, size_px: int) -> Any:
    return cv2.morphologyEx(disparity_px, cv2.MORPH_GRADIENT, np.ones((size_px, size_px), np.uint8))


@compiled
def _add_up(signs: Float32, here: Ints, law: Float32, score: Float32) -> None:
    """Score of some pixels, whose signs are columns of (11, N); of the law mean, scale, weights and products."""
    many = signs.shape[0]
    mean, scale, weights, products = law[0], law[1], law[2], law[3:]
    z, (part, total) = np.zeros((many, _AT_ONCE), np.float32), np.zeros((2, _AT_ONCE), np.float32)
    for first in range(0, here.size, _AT_ONCE):
        count = min(_AT_ONCE, here.size - first)
        for a in range(many):
            for i in range(count):
                z[a, i] = (signs[a, here[first + i]] - mean[a]) / scale[a]
                z[a, i] = min(max(z[a, i], np.float32(-FAR)), np.float32(FAR))
        total[:] = 0
        for a in range(many):
            part[:] = weights[a]
            for b in range(many):
                for i in range(_AT_ONCE):
                    part[i] += products[b, a] * z[b, i]
            for i in range(_AT_ONCE):
                total[i] += part[i] * z[a, i]
        for i in range(count):
            score[first + i] = total[i]
