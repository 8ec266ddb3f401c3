"""Every filter that `smooth` knows on the same maps, counted against the truth: the table of notebook 04."""

from __future__ import annotations

import itertools
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stereolib.base import Bools, Floats, UInt8
from stereolib.matching.disparity import compute_disparity
from stereolib.matching.filters import SMOOTHING_METHODS, smooth
from stereolib.matching.scoring import overreach_px, score, score_repair

if TYPE_CHECKING:
    import pandas as pd

_COLUMNS = ["method", "case", "filled_pct", "wrong2_pct", "shift_px", "growth_px", "growth_cm", "bad2_pct", "time_ms"]
_STEP_PX = 40  # by which the object stands before its background in the rows that count
_LEAST_ROWS = 20  # from which an outline is told


@dataclass(frozen=True, eq=False)
class FilterCase:
    """One map to repair, and what is needed to judge it.

    Parameters
    ----------
    left : (H, W) or (H, W, 3) uint8
        The rectified left picture.
    left_px, right_px : (H, W) float, px
        Disparity of both views.
    truth_px : (H, W) float, px
        True disparity of the left view.
    where : (H, W) bool
        Pixels to count over.
    on_object : (H, W) bool
        The object whose outline is watched.
    """

    left: UInt8
    left_px: Floats
    right_px: Floats
    truth_px: Floats
    where: Bools
    on_object: Bools

    @classmethod
    def from_pair(cls, pair: tuple[UInt8, UInt8], truth_px: Floats, where: Bools, on_object: Bools) -> FilterCase:
        """Match a rectified pair both ways with the defaults of `SGBMParams`.

        Parameters
        ----------
        pair : two (H, W) or (H, W, 3) uint8
            Left and right picture.
        truth_px, where, on_object
            As the fields of those names.

        Returns
        -------
        FilterCase
        """
        left, right = pair
        mirrored = compute_disparity(np.ascontiguousarray(right[:, ::-1]), np.ascontiguousarray(left[:, ::-1]))
        return cls(left, compute_disparity(left, right), mirrored[:, ::-1], truth_px, where, on_object)

    def around_object(self, margin_px: int) -> FilterCase:
        """Cut out the part around the object, and all that is left of it: there the right view shows the object.

        Parameters
        ----------
        margin_px : int
            What is kept above, below and right of the object, px.

        Returns
        -------
        FilterCase
        """
        rows, columns = (np.flatnonzero(self.on_object.any(axis=axis)) for axis in (1, 0))
        part = slice(max(0, rows[0] - margin_px), rows[-1] + 1 + margin_px), slice(0, columns[-1] + 1 + margin_px)
        return FilterCase(**{name: array[part] for name, array in vars(self).items()})


def compare_filters(
    cases: Mapping[str, FilterCase],
    methods: Sequence[str] = tuple(SMOOTHING_METHODS),
    *,
    size_px: int = 9,
    cm_per_px: float,
) -> pd.DataFrame:
    """Run filters over maps and count.

    Parameters
    ----------
    cases : mapping of name to FilterCase
    methods : sequence of str
        Names of `SMOOTHING_METHODS`.
    size_px : int
        Handed to each.
    cm_per_px : float
        What a pixel stands for at the object's outline.

    Returns
    -------
    DataFrame
        One row a method and case: ``filled_pct`` of the holes; ``wrong2_pct`` of the filled pixels, off by more than
        2 px; ``shift_px`` of the pixels that were right; ``growth_px`` and ``growth_cm`` of the outline over its right
        border (see `outline_growth_px`); ``bad2_pct`` over all pixels looked at; ``time_ms``.

    Raises
    ------
    ValueError
        If a method is unknown, or shapes differ.
    """
    import pandas as pd

    rows = []
    for method, (name, one) in itertools.product(methods, cases.items()):
        start = time.perf_counter()
        after = smooth(one.left_px, method, size_px=size_px, image=one.left, right_px=one.right_px)
        taken_ms = 1000 * (time.perf_counter() - start)
        repaired = score_repair(one.left_px, after, one.truth_px, one.where)
        growth_px = outline_growth_px(one, after, size_px)
        bad2_pct = score(after, one.truth_px, one.where).bad2_pct
        told = (repaired.filled_pct, repaired.wrong2_pct, repaired.shift_px, growth_px, growth_px * cm_per_px)
        rows.append((method, name, *told, bad2_pct, taken_ms))
    return pd.DataFrame(rows, columns=_COLUMNS)


def outline_growth_px(one: FilterCase, after_px: Floats, size_px: int) -> float:
    """Measure by how many pixels a filter moved an object's right border outwards (`overreach_px`, after less before).

    Parameters
    ----------
    one : FilterCase
    after_px : (H, W) float, px
        Its left map after the filter.
    size_px : int
        Edge of the filter's kernel.

    Returns
    -------
    float, px
        Over rows where at least half of the ``2 * size_px`` pixels beside the object were matched, NaN if they are
        few: where there was no background, nobody can say whether the object grew or a hole was filled.
    """
    told = _told(one, 2 * size_px)
    return _reach(one, after_px, told) - _reach(one, one.left_px, told)


def _told(one: FilterCase, width_px: int) -> Bools:
    """The object in the rows where at least half of the pixels right of it were matched."""
    rows = np.flatnonzero(one.on_object.any(axis=1))
    last = one.on_object.shape[1] - 1 - one.on_object[rows, ::-1].argmax(axis=1)
    beside = [one.left_px[row, column + 1 : column + 1 + width_px] for row, column in zip(rows, last, strict=True)]
    known = [len(values) > 0 and np.isfinite(values).mean() >= 0.5 for values in beside]
    told = np.zeros_like(one.on_object)
    told[rows[known]] = one.on_object[rows[known]]
    return told


def _reach(one: FilterCase, disparity_px: Floats, told: Bools) -> float:
    with suppress(ValueError):  # nothing stands clear of its background
        if told.any(axis=1).sum() >= _LEAST_ROWS:
            return overreach_px(disparity_px, one.truth_px, told, step_px=_STEP_PX)
    return float("nan")
