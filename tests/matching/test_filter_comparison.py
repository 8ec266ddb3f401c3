"""The table of filters: its counts on a scene whose answers are known."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib.matching import FilterCase, compare_filters


def square_case(wall_known: bool) -> FilterCase:
    """A near square before a far wall, matched without error; the wall is a hole if it is not known."""
    truth = np.full((80, 160), 20.0, np.float32)
    truth[20:60, 60:100] = 90
    on_object = truth > 50
    found = np.where(on_object | wall_known, truth, np.float32(np.nan))
    found[30:33, 70:73] = np.nan
    left = np.where(on_object, 200, 60).astype(np.uint8)
    return FilterCase(left, found, found, truth, on_object, on_object)


def test_growth_is_told_only_where_the_wall_was_matched():
    cases = {"known": square_case(True), "unknown": square_case(False)}
    methods = ("dilation", "closing", "background")
    table = compare_filters(cases, methods, size_px=9, cm_per_px=0.5).set_index(["case", "method"])
    assert table.loc["known", "growth_px"].tolist() == [4, 0, 0]
    assert table.loc["known", "growth_cm"].tolist() == [2, 0, 0]
    assert table.loc["unknown", "growth_px"].isna().all()
    assert (table["filled_pct"] == 100).all() and (table["wrong2_pct"] == 0).all()
    assert (table["bad2_pct"] == 0).all() and (table["time_ms"] > 0).all()


def test_an_unknown_method_is_refused():
    with pytest.raises(ValueError, match="unknown method 'blur'"):
        compare_filters({"a": square_case(True)}, ["blur"], cm_per_px=1)
