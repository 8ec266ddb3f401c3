"""Every filter of `smoothing` on the same maps, counted against the truth: the table of notebook 04."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stereolib.matching.disparity import compute_disparity
from stereolib.matching.filters import METHODS, smooth
from stereolib.matching.scoring import overreach_px, repair, score
from stereolib.matching.sgbm import SGBMParams

if TYPE_CHECKING:
    import pandas as pd

Array = np.ndarray
_LEAST_ROWS = 20  # from which an outline is told


@dataclass(frozen=True, eq=False)
class Case:
    """One map to repair, and what is needed to judge it.

    ``left`` (H, W[, 3]) uint8 is the rectified left picture, ``left_px`` and ``right_px`` (H, W) the disparity of both
    views, ``truth_px`` (H, W) the true one, ``looked`` (H, W) bool the pixels to count over, ``on_object`` (H, W) bool
    the object whose outline is watched.
    """

    left: Array
    left_px: Array
    right_px: Array
    truth_px: Array
    looked: Array
    on_object: Array

    def around_object(self, margin_px: int) -> Case:
        """The part of it around the object, and all that is left of it: there the right view shows the object."""
        rows, columns = (np.flatnonzero(self.on_object.any(axis=axis)) for axis in (1, 0))
        part = slice(max(0, rows[0] - margin_px), rows[-1] + 1 + margin_px), slice(0, columns[-1] + 1 + margin_px)
        return Case(*(array[part] for array in vars(self).values()))


def case(pair: tuple[Array, Array], truth_px: Array, looked: Array, on_object: Array) -> Case:
    """Match a rectified pair both ways with `SGBMParams`' defaults and keep what `measure` needs."""
    left, right = pair
    params = SGBMParams()
    mirrored = compute_disparity(np.ascontiguousarray(right[:, ::-1]), np.ascontiguousarray(left[:, ::-1]), params)
    return Case(left, compute_disparity(left, right, params), mirrored[:, ::-1], truth_px, looked, on_object)


def measure(
    cases: Mapping[str, Case], methods: Sequence[str] = tuple(METHODS), *, size_px: int = 9, cm_per_px: float
) -> pd.DataFrame:
    """Run filters over maps and count.

    Parameters
    ----------
    cases : mapping of name to `Case`
    methods : names of `smoothing.METHODS`
    size_px : int
        Handed to each.
    cm_per_px : float
        What a pixel stands for at the object's outline.

    Returns
    -------
    DataFrame
        One row a method and case: ``filled_pct`` of the holes; ``wrong2_pct`` of the filled pixels, off by more than
        2 px; ``shift_px`` of the pixels that were right; ``growth_px`` and ``growth_cm`` of the outline over its right
        border (see `growth_px`); ``bad2_pct`` over all pixels looked at; ``time_ms``.

    Raises
    ------
    ValueError
        If a method is unknown, or shapes differ.
    """
    import pandas as pd

    rows = []
    for method in methods:
        for name, one in cases.items():
            start = time.perf_counter()
            after = smooth(one.left_px, method, size_px=size_px, image=one.left, right_px=one.right_px)
            taken_ms = 1000 * (time.perf_counter() - start)
            done = repair(one.left_px, after, one.truth_px, one.looked)
            grown = growth_px(one, after, size_px)
            bad2 = score(after, one.truth_px, one.looked).bad2_pct
            rows.append((method, name, done.filled_pct, done.wrong2_pct, done.shift_px, grown, grown * cm_per_px, bad2,
                         taken_ms))  # fmt: skip
    names = ["method", "case", "filled_pct", "wrong2_pct", "shift_px", "growth_px", "growth_cm", "bad2_pct", "time_ms"]
    return pd.DataFrame(rows, columns=names)


def growth_px(one: Case, after_px: Array, size_px: int) -> float:
    """By how many pixels a filter moved the object's right border outwards (`metrics.overreach_px`, after less before).

    Counted in rows where at least half of the ``2 * size_px`` pixels beside the object were matched, NaN if they are
    few: where there was no background, nobody can say whether the object grew or a hole was filled.
    """
    told = _told(one, 2 * size_px)
    return _reach(one, after_px, told) - _reach(one, one.left_px, told)


def _told(one: Case, width_px: int) -> Array:
    """The object in the rows where at least half of the pixels right of it were matched."""
    rows = np.flatnonzero(one.on_object.any(axis=1))
    last = one.on_object.shape[1] - 1 - one.on_object[rows, ::-1].argmax(axis=1)
    beside = [one.left_px[row, column + 1 : column + 1 + width_px] for row, column in zip(rows, last, strict=True)]
    known = [len(values) > 0 and np.isfinite(values).mean() >= 0.5 for values in beside]
    told = np.zeros_like(one.on_object)
    told[rows[known]] = one.on_object[rows[known]]
    return told


def _reach(one: Case, disparity_px: Array, told: Array) -> float:
    if told.any(axis=1).sum() < _LEAST_ROWS:
        return float("nan")
    try:
        return overreach_px(disparity_px, one.truth_px, told, step_px=40)
    except ValueError:  # nothing stands clear of its background
        return float("nan")
