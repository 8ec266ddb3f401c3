"""Attempts at a height and widths from faces: against the recorded cubes' truth; figures: what is drawn is measured."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from stereolib import plotting
from stereolib.measurement import Uncertainty, add_specks, attempt_height, corner_width_mm, floor_from_pose
from stereolib.measurement.object_height import height_of_nearest
from stereolib.virtual import recordings

RECT = recordings.rectified()


@cache
def attempted(name, seed=0):
    return attempt_height(*RECT.rectify(*recordings.load_pair(name)), RECT, seed=seed)


def test_an_attempt_is_the_measurement_with_its_steps():
    tried = attempted("conditions/level")
    rng = np.random.default_rng(0)
    found = height_of_nearest(tried.left, tried.right, tried.disparity_px, RECT, rng=rng)
    assert (tried.height_mm, tried.std_mm, tried.refused) == (found.height_mm, found.height_std_mm, "")
    assert tried.floor.camera_height_mm == pytest.approx(190.06, abs=0.5)
    assert tried.region.position_mm == pytest.approx((700, 0), abs=15)


def test_what_cannot_be_measured_is_kept_with_its_reason():
    tried = attempted("conditions/poor_light")
    assert tried.refused == "no floor" and tried.found is None
    assert np.isnan([tried.height_mm, tried.std_mm, corner_width_mm(tried)]).all()
    blank = np.full((480, 640), 90, np.uint8)
    assert attempt_height(blank, blank, RECT, floor=floor_from_pose(RECT, recordings.setup())).refused == "no object"


def test_a_floor_by_hand_helps_where_none_is_seen():
    """Under glare the floor has no matches; the cube has."""
    pair = RECT.rectify(*recordings.load_pair("conditions/glare"))
    floor = floor_from_pose(RECT, recordings.setup("pitched"), height_std_mm=1.0)
    tried = attempt_height(*pair, RECT, floor=floor)
    assert attempted("conditions/glare").refused == "no floor"
    assert tried.height_mm == pytest.approx(300, abs=1.0) and tried.std_mm > 1.0


def test_a_height_that_says_nothing_is_refused():
    how = Uncertainty(baseline_mm=0.1 * RECT.baseline_mm)
    pair = RECT.rectify(*recordings.load_pair("conditions/texture"))
    assert attempt_height(*pair, RECT, uncertainty=how).refused == "too uncertain"
    assert attempt_height(*pair, RECT, uncertainty=how, worst_std=0.2).std_mm == pytest.approx(30, rel=0.01)


@pytest.mark.parametrize("name", ["series/fine_600", "series/medium_800", "series/coarse_1000"])
def test_width_from_the_faces_is_the_diagonal(name):
    assert corner_width_mm(attempted(name)) == pytest.approx(300 * np.sqrt(2), rel=0.004)


def test_a_corner_that_one_camera_does_not_see_gives_no_width():
    """At 0.5 m the left corner lies outside of the right picture."""
    tried = attempted("series/medium_500")
    assert tried.height_mm == pytest.approx(300, abs=1) and np.isnan(corner_width_mm(tried))


def test_pixels_of_points_on_the_floor():
    tried, pose = attempted("conditions/level"), recordings.setup("level")
    world = np.array([[700.0, 0, 0], [900, 200, 0], [912, -212, 300]])
    left = (np.c_[world, np.ones(3)] @ pose.T)[:, :3] @ RECT.R1.T
    assert tried.floor.pixels(world) == pytest.approx(left[:, :2] / left[:, 2:] * RECT.f_px + RECT.P1[:2, 2], abs=1)
    found = tried.found
    near = np.array([[*found.near_mm, 0.0], [*found.near_mm, found.height_mm]])
    assert tried.floor.pixels(near) == pytest.approx(np.stack([found.foot_px, found.top_px]))


def test_specks_are_counted_and_the_map_is_left_alone():
    clean = np.full((480, 640), 50.0)
    specked = add_specks(clean, 100, np.random.default_rng(0), highest_px=128)
    changed = specked != clean
    assert 95 <= changed.sum() <= 100 and (clean == 50).all()
    assert specked[changed].min() >= 1 and specked[changed].max() <= 128


def test_found_is_drawn_where_it_was_measured():
    tried = attempted("conditions/level")
    ax = plotting.plot_height_attempt(tried, plotting.panels(1)[1][0], "cube")
    lines = {line.get_label(): line.get_xydata() for line in ax.lines}
    assert lines["near edge"] == pytest.approx(np.stack([tried.found.foot_px, tried.found.top_px]))
    (x0, y0), (x1, y1) = lines["top line"]
    at = (tried.found.top_px[0] - x0) / (x1 - x0)
    assert y0 + at * (y1 - y0) == pytest.approx(tried.found.top_px[1], abs=1.5)
    assert ax.texts[0].get_text() == f"{tried.height_mm / 10:.2f} ± {0.196 * tried.std_mm:.2f} cm"
    shown = ax.images[0].get_array()
    blue, red = shown[470, 500, 2] > shown[470, 500, 0], shown[250, 300, 0] > shown[250, 300, 2]
    assert blue and red  # the floor, the object


def test_a_refused_attempt_is_drawn_without_lines():
    ax = plotting.plot_height_attempt(attempted("conditions/poor_light"), plotting.panels(1)[1][0])
    assert not ax.lines and not ax.texts


def test_intervals_and_notes_stand_in_their_rows():
    ax = plotting.panels(1)[1][0]
    plotting.plot_intervals(
        ["a", "b", "c"], [0.5, np.nan, -0.2], [0.1, np.nan, 0.3], ax, xlabel="error (mm)", notes=["", "refused", ""]
    )
    (container,) = ax.containers
    assert container.lines[0].get_xydata().tolist() == [[0.5, 0], [-0.2, 2]]
    bars = [segment[:, 0].tolist() for segment in container.lines[2][0].get_segments()]
    assert bars == [pytest.approx([0.4, 0.6]), pytest.approx([-0.5, 0.1])]
    assert [(t.get_position(), t.get_text()) for t in ax.texts] == [((0, 1), "refused")]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["a", "b", "c"]
    low, high = ax.get_ylim()
    assert low > high  # the first name is on top


def test_sliders_say_both_readings():
    from stereolib.notebook import draw_heights, draw_recipe

    picture, text = draw_heights(700, 45, 0, 300.0)
    assert picture.shape == (480, 1280, 3)
    assert text.startswith("true height 30.0 cm; the paper's recipe reads 3")
    assert float(text.partition("the ground plane ")[2].split()[0]) == pytest.approx(30, abs=0.1)
    picture, text = draw_recipe("pitched", 53, 7.25, 1)
    assert picture.shape == (480, 640, 3) and "the recipe reads 37.8 cm, the top pixel's ray 30.2 cm" in text
    assert "the recipe reads 0.1 cm" in draw_recipe("pitched", 53, 0.0, 1)[1]
