"""What the bench shows of a state: pictures, the line of results, clicks that are right within their intervals."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from stereolib.notebook import chain
from stereolib.notebook.explorer_panels import (
    CAPTIONS,
    WIDTH,
    draw_costs,
    draw_panels,
    find,
    length_text,
    result_line,
    scale_of,
)
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
    assert find(TEXTURE, (20, 200)).text == "column 20, row 200: no disparity was found here"
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


def test_pictures_have_the_shown_width_and_the_captions_number():
    for state in (TEXTURE, replace(TEXTURE, half=True)):
        pictures = draw_panels(state)
        assert len(pictures) == len(CAPTIONS)
        assert pictures[0].shape == (round(480 * WIDTH / 640), WIDTH, 3) and pictures[3].shape[1] == WIDTH
    assert scale_of(TEXTURE) == WIDTH / 640 == scale_of(replace(TEXTURE, half=True)) / 2


def test_result_line_reads_what_the_chain_reads():
    line = re.sub("<[^>]+>", " ", result_line(TEXTURE))
    assert f"{chain.recipe(TEXTURE).height_mm / 10:.1f} cm high" in line
    assert f"{chain.ground_plane(TEXTURE).height_mm / 10:.2f} ±" in line
    assert f"bad 2: {chain.quality(TEXTURE).bad2_pct:.1f} %" in line
    assert "…" in result_line(replace(TEXTURE, half=True)) and "…" not in line
    assert "refused" in result_line(State(source="conditions/plain"))


def test_result_line_is_safe_html():
    assert "<script" not in result_line(TEXTURE)
    nothing = replace(TEXTURE, constant_rows=200, min_disparity=96, num_disparities=16)
    assert "the paper" in result_line(nothing)


def test_what_takes_seconds_is_said_while_it_does():
    state = State(source="conditions/texture", matcher="best", num_disparities=16, half=True)
    assert "half size for now" in result_line(state)
    assert "half size for now" not in result_line(replace(state, matcher="fast"))
