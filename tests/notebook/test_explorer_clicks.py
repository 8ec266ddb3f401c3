"""What a click finds: depths and heights that are right within their intervals, and the costs at a pixel."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from stereolib.notebook import chain
from stereolib.notebook.explorer_clicks import draw_costs, find, length_text
from stereolib.notebook.knobs import MOTORCYCLE, State

TEXTURE = State(source="conditions/texture")


def test_clicks_hold_the_true_depth_and_height_as_often_as_they_say():
    known, rectified = chain.known(TEXTURE), chain.rectified_rig(TEXTURE)
    rows, columns = np.nonzero(known.region & np.isfinite(chain.filtered(TEXTURE)))
    picked = np.random.default_rng(1).choice(len(rows), 300, replace=False)
    held = []
    for u, v in zip(columns[picked], rows[picked], strict=True):
        found = find(TEXTURE, (int(u), int(v)))
        true_mm = rectified.f_px * rectified.baseline_mm / known.disparity_px[v, u]
        if np.isfinite(found.depth_std_mm):
            held.append(abs(found.point_mm[2] - true_mm) <= 1.96 * found.depth_std_mm)
        assert -20 < found.height_mm < 320
        column = re.search(r"in column ([\d.]+)(\. No|$)", found.text)
        assert float(column[1].rstrip(".")) == pytest.approx(u - found.disparity_px, abs=0.051)
    assert 0.9 <= np.mean(held) <= 1 and len(held) > 200


def test_the_interval_of_a_depth_is_what_the_disparity_leaves_of_it():
    found, rectified = find(TEXTURE, (313, 250)), chain.rectified_rig(TEXTURE)
    drawn = found.disparity_px + found.std_px * np.random.default_rng(0).standard_normal(100_000)
    spread = np.std(rectified.f_px * rectified.baseline_mm / drawn)
    assert found.depth_std_mm == pytest.approx(spread, rel=0.02)


def test_unmatched_pixel_and_missing_calibration_are_said():
    assert find(TEXTURE, (20, 200)).text == (
        f"column 20, row 200: no disparity was found here (true: {chain.known(TEXTURE).disparity_px[200, 20]:.1f})"
    )
    found = find(State(source=MOTORCYCLE), (400, 250))
    assert "depth" not in found.text and re.search(r"disparity [\d.]+ ± [\d.]+ px\. Its partner", found.text)
    assert length_text(found, found, None) == ""


def test_two_clicks_measure_the_near_edge():
    upper, lower, rectified = find(TEXTURE, (313, 150)), find(TEXTURE, (313, 380)), chain.rectified_rig(TEXTURE)
    told = re.match(r"([\d.]+) ± ([\d.]+) mm between the last two clicks", length_text(lower, upper, rectified))
    heights = abs(upper.height_mm - lower.height_mm)  # the edge is upright: its length is the heights' difference
    assert abs(float(told[1]) - heights) <= float(told[2]) + 1
    assert length_text(upper, upper, rectified) == ""


def test_costs_have_their_least_at_the_disparity():
    found = find(TEXTURE, (313, 250))
    pictures = draw_costs(TEXTURE, found)
    assert len(pictures) == 2 and all(picture.ndim == 3 and picture.dtype == np.uint8 for picture in pictures)
    other = draw_costs(TEXTURE, find(TEXTURE, (400, 250)))
    assert not np.array_equal(pictures[0], other[0])
    assert isinstance(draw_costs(TEXTURE, find(TEXTURE, (20, 200))), str)  # a column without partners


@pytest.mark.parametrize(
    "turned",
    [{"num_disparities": 64}, {"row_px": 3.0}, {"block_size": 15}, {"source": "conditions/glare"},
     {"source": "conditions/poor_light"}],
    ids=str,
)  # fmt: skip
def test_an_interval_that_is_told_holds_the_truth_also_of_a_bad_map(turned):
    state = replace(TEXTURE, **turned)
    known, map_px = chain.known(state), chain.filtered(state)
    rows, columns = np.nonzero(known.visible & np.isfinite(map_px))
    picked = np.random.default_rng(2).choice(len(rows), 200, replace=False)
    found = [find(state, (int(columns[k]), int(rows[k]))) for k in picked]
    told = [one for one in found if np.isfinite(one.std_px)]
    held = [abs(one.disparity_px - one.true_px) <= 1.96 * one.std_px for one in told]
    assert len(told) >= 20 and np.mean(held) > 0.88
    assert all(("±" in one.text) == (not one.doubt) for one in found)


@pytest.mark.parametrize(
    "turned", [{"filter": "dilation", "kernel_px": 15}, {"filter": "median"}, {"matcher": "paper"}]
)
def test_a_moved_disparity_has_no_interval(turned):
    state = replace(TEXTURE, **turned)
    found, other = find(state, (313, 150)), find(state, (313, 380))
    assert np.isnan(found.std_px) and np.isnan(found.depth_std_mm) and found.point_mm[2] > 0
    before, _, after = found.text.partition("before it")
    assert "±" not in before and "No interval is told" in before
    assert "±" not in length_text(found, other, chain.rectified_rig(state))
    if "filter" in turned:
        plain = find(TEXTURE, (313, 150))
        assert f"{plain.disparity_px:.2f} ± {1.96 * plain.std_px:.2f} px" in after
