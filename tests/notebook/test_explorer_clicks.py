"""What a click finds: depths and heights that are right within their intervals, and the costs at a pixel."""

from __future__ import annotations

import re

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
        held.append(abs(found.point_mm[2] - true_mm) <= 1.96 * found.depth_std_mm)
        assert -20 < found.height_mm < 320
        column = re.search(r"in column ([\d.]+)$", found.text)
        assert float(column[1]) == pytest.approx(u - found.disparity_px, abs=0.051)
    assert 0.9 <= np.mean(held) <= 1


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
