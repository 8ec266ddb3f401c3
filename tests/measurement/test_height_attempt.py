"""Attempts at a height and widths from faces: against the recorded cubes' truth."""

from __future__ import annotations

import numpy as np
import pytest
from support.attempts import attempted
from support.ground import RECT, nearest_height

from stereolib.measurement import (
    AlignedPair,
    SystematicUncertainty,
    attempt_height,
    corner_width_mm,
    floor_from_pose,
    measure_height,
)
from stereolib.virtual import recordings


def test_an_attempt_is_the_measurement_with_its_steps():
    tried = attempted("conditions/level")
    rng = np.random.default_rng(0)
    found = nearest_height(tried.left, tried.right, tried.disparity_px, RECT, rng=rng)
    assert (tried.height_mm, tried.std_mm, tried.refused) == (found.height_mm, found.height_std_mm, "")
    assert tried.floor.camera_height_mm == pytest.approx(190.06, abs=0.5)
    assert tried.region.position_mm == pytest.approx((700, 0), abs=15)


def test_what_cannot_be_measured_is_kept_with_its_reason():
    tried = attempted("conditions/poor_light")
    assert tried.refused == "no floor" and tried.measured is None
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
    how = SystematicUncertainty(baseline_mm=0.1 * RECT.baseline_mm)
    pair = RECT.rectify(*recordings.load_pair("conditions/texture"))
    assert attempt_height(*pair, RECT, uncertainty=how).refused == "too uncertain"
    tried = attempt_height(*pair, RECT, uncertainty=how)
    told = measure_height(AlignedPair.of(*pair), tried.floor, tried.region, uncertainty=how, worst_std=0.2)
    assert told.height_std_mm == pytest.approx(30, rel=0.01)


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
    found = tried.measured
    near = np.array([[*found.near_mm, 0.0], [*found.near_mm, found.height_mm]])
    assert tried.floor.pixels(near) == pytest.approx(np.stack([found.foot_px, found.top_px]))
