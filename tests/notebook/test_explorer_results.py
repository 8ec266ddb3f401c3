"""The line of results: what the chain reads, and a reason for what it does not read."""

from __future__ import annotations

import re
from dataclasses import replace

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
    assert attempt.refused and f"refused: {attempt.refused} (" in line
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
        ("room/1", "boxes"),
        (MOTORCYCLE, "its disparities"),
    ):
        assert told in said(State(source=source)).partition("ground plane")[0]
    assert said(State(source=MOTORCYCLE)).count("needs a calibration") == 2
