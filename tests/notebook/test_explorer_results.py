"""The line of results: what the chain reads, and a reason for what it does not read."""

from __future__ import annotations

import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest

from stereolib.measurement import Reason
from stereolib.notebook import chain
from stereolib.notebook.explorer_results import legend, result_line
from stereolib.notebook.knobs import MOTORCYCLE, State
from stereolib.plotting import LASER, PAPER

TEXTURE = State(source="conditions/texture")


def said(state):
    return re.sub("<[^>]+>", " ", result_line(state))


def test_result_line_reads_what_the_chain_reads():
    line = said(TEXTURE)
    assert f"{chain.recipe(TEXTURE).height_mm / 10:.1f} cm high" in line
    assert f"{chain.ground_plane(TEXTURE).height_mm / 10:.2f} ±" in line
    quality, map_px, truth = chain.quality(TEXTURE), chain.filtered(TEXTURE), chain.known(TEXTURE)
    error = (map_px - truth.disparity_px)[truth.region]
    assert f"{100 * (1 - (np.abs(error) <= 2).mean()):.1f} % wrong or empty" in line
    within = error[np.abs(error) <= 4]
    assert f"mean error {within.mean():+.2f} px, scatter {within.std():.2f} px" in line
    everywhere = 100 * np.isfinite(map_px).mean()
    assert f"{quality.density_pct:.1f} % matched ({everywhere:.1f} % of all pixels)" in line
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


def test_readings_of_the_preview_are_near_those_of_the_full_size():
    full, half = (re.search(r"mean error ([-+.\d]+) px", said(one)) for one in (TEXTURE, replace(TEXTURE, half=True)))
    assert float(half[1]) == pytest.approx(float(full[1]), abs=0.3)


@pytest.mark.parametrize("name", ["plain", "poor_light", "glare"])
def test_a_refusal_says_what_it_means_and_proposes_no_option_of_a_command(name):
    state = State(source=f"conditions/{name}")
    attempt, line = chain.ground_plane(state), said(state)
    assert attempt.refused and f"refused: {attempt.refused}" in line
    assert attempt.why not in line.replace(attempt.why, "", 1)  # said once
    assert "--" not in line and "nothing was measured" not in line


def test_a_missing_size_has_its_reason_beside_it():
    turned = State(yaw_deg=0, laser=False)
    (thing,) = chain.measured(turned).objects
    assert np.isnan(thing.size_mm).any() and thing.reasons
    for why in thing.reasons.values():
        assert str(why) in said(turned)


def test_a_scan_that_tells_nothing_is_said_and_without_one_the_pair_is_alone():
    noisy = said(replace(TEXTURE, laser_noise=5.0))
    assert Reason.SCAN_IRREGULAR.value in noisy and "?" not in noisy and "laser and pair" in noisy
    alone = said(replace(TEXTURE, laser=False))
    assert "pair alone" in alone and "laser and pair" not in alone


def test_legend_has_the_colours_that_are_drawn():
    assert PAPER in legend() and LASER in legend() and "0.116" in legend()


def test_truth_is_told_as_far_as_it_is_known():
    for source, told in (
        ("conditions/texture", "30.0 x 30.0 x 30.0 cm"),
        ("room/1", "5 boxes: 40.0 x 25.0 x 30.0, "),
        (MOTORCYCLE, "its disparities"),
    ):
        assert told in said(State(source=source)).partition("ground plane")[0]
    assert said(State(source=MOTORCYCLE)).count("needs a calibration") == 2


@pytest.mark.parametrize("turned", [{"num_disparities": 64}, {"filter": "dilation", "kernel_px": 31}])
def test_what_no_knob_of_matcher_and_filter_changes_is_said_to_be_measured_otherwise(turned):
    state = replace(TEXTURE, **turned)
    line, before = said(state), said(TEXTURE)
    for name in ("ground plane", "laser and pair"):
        assert line.partition(name)[2].partition("cm")[0] == before.partition(name)[2].partition("cm")[0]
    assert chain.recipe(state).height_mm != chain.recipe(TEXTURE).height_mm
    assert '"Ground plane" and "laser and pair" are measured from the pictures by a matching of their own' in unescape(
        line
    )


def test_a_search_that_ends_too_early_is_said_with_one_that_does_not():
    enough = re.search(r"search (\d+) disparities", said(replace(TEXTURE, num_disparities=64)))
    assert enough and "the search ends" not in said(replace(TEXTURE, num_disparities=int(enough[1])))
    assert "nearer than the 63 px at which the search ends" in said(replace(TEXTURE, num_disparities=64))
    assert "the search ends" in said(State(baseline_mm=200))


def test_the_start_reads_what_the_finding_says_and_why_the_maximum_is_where_it_is():
    line, truth, map_px = said(State()), chain.known(State()), chain.filtered(State())
    assert chain.recipe(State()).height_mm == chain.recipe(TEXTURE).height_mm == pytest.approx(378, abs=1)
    counted = map_px[: -State().constant_rows]
    at = np.unravel_index(np.nanargmax(counted), counted.shape)
    assert f"greatest disparity, {counted[at]:.1f} px (true there: {truth.disparity_px[at]:.1f})" in unescape(line)


def test_nothing_that_was_not_found_has_a_number():
    assert "nan" not in said(State(baseline_mm=200)) and "none is within 4 px" in said(State(baseline_mm=200))
    assert "set-up's alone" in unescape(said(State(source=MOTORCYCLE))) and "set-up" not in said(TEXTURE)


def test_what_the_laser_adds_is_computed():
    alone = replace(TEXTURE, laser=False)
    both, pair = (chain.measured(one).objects[0].size_mm for one in (TEXTURE, alone))
    assert f"sizes by {np.abs(both - pair).max() / 10:.2f} cm at most" in said(TEXTURE)
    assert "laser changes" not in said(alone)
    assert "laser alone sees its left end" in said(State(distance_mm=500))


def test_a_wrong_baseline_is_said_with_and_without_the_laser():
    for laser in (True, False):
        wrong = replace(TEXTURE, baseline_pct=5.0, laser=laser)
        attempt = chain.ground_plane(wrong)
        assert abs(attempt.height_mm - 300) > 10 * attempt.std_mm  # the interval does not hold it
        assert "no pair can tell a wrong baseline: here it changes every length by +5 %" in said(wrong)
