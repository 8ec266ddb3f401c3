"""Why there is no floor: each cause made, and told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.disturbed import exposed, noisy, rows_moved
from support.ground import GRID, RECT

from stereolib.measurement import CannotMeasure, Instrument, NoFloor, Views, find_floor, floor_from_pose, why_no_floor
from stereolib.measurement.standing import _floor_below
from stereolib.paper import rig_pose
from stereolib.virtual import recordings

PAIR = RECT.rectify(*recordings.load_pair("conditions/texture"))


def cause(left, right):
    return why_no_floor(Views.of_rectified(left, right), RECT)


def test_too_dark_and_too_bright():
    assert cause(*(exposed(picture, 0.02) for picture in PAIR))[0] is NoFloor.DARK
    assert cause(PAIR[0], exposed(PAIR[1], 0.02))[0] is NoFloor.DARK
    assert cause(*(exposed(picture, 8.0) for picture in PAIR))[0] is NoFloor.BRIGHT


def test_no_texture():
    plain = np.full_like(PAIR[0], 120)
    assert cause(noisy(plain, 2, 1), noisy(plain, 2, 2))[0] is NoFloor.PLAIN


@pytest.mark.parametrize("rows", [16, -20])
def test_rows_that_disagree_by_more_than_can_be_corrected(rows):
    found, value = cause(PAIR[0], rows_moved(PAIR[1], rows))
    assert found is NoFloor.ROWS and value == pytest.approx(rows, abs=4)


@pytest.mark.parametrize("width", [20, 90])
def test_a_picture_too_narrow_to_be_matched(width):
    small = np.random.default_rng(3).integers(40, 220, (60, width)).astype(np.uint8)
    views = replace(Views.of_rectified(*PAIR), left=small, right=small)
    assert why_no_floor(views, RECT)[0] is NoFloor.UNSEEN


def test_nearer_than_the_window():
    """A surface 0.2 m away: 360 px."""
    texture = np.kron(np.random.default_rng(0).integers(40, 220, (80, 200)), np.ones((6, 6))).astype(np.uint8)
    found, near_mm = cause(texture[:480, :640].copy(), texture[:480, 360:1000].copy())
    assert found is NoFloor.NEAR and near_mm == pytest.approx(RECT.f_px * RECT.baseline_mm / 256)


def test_a_floor_that_both_see_differently():
    """Two moments: below, the pictures have nothing in common."""
    draw = np.random.default_rng(1)
    spoilt = PAIR[1].copy()
    spoilt[200:] = np.kron(draw.integers(40, 220, (70, 160, 1)), np.ones((4, 4, 3))).astype(np.uint8)
    assert cause(PAIR[0], spoilt)[0] is NoFloor.GLOSSY


def test_a_camera_on_a_tripod():
    """Its floor is there, but farther below than sizes were tried from."""
    floor = floor_from_pose(RECT, rig_pose(RECT, pitch_rad=np.radians(-35.0), camera_height_mm=1250.0))
    disparity = np.asarray(floor.disparity(*GRID), np.float32)
    views = replace(Views.of_rectified(*PAIR), disparity_px=np.where(disparity > 0, disparity, np.nan))
    found, value = why_no_floor(views, RECT)
    assert found is NoFloor.HIGH and value == pytest.approx(1250, abs=1)
    with pytest.raises(
        CannotMeasure, match=r"no floor: the camera stands 1250 mm above it.* up to 1000 mm below.*--floor"
    ):
        find_floor(views, RECT)


def test_a_camera_that_looks_at_a_wall():
    wall = np.kron(np.random.default_rng(2).integers(40, 220, (120, 200)), np.ones((4, 4))).astype(np.uint8)
    left, right = wall[:480, :640].copy(), wall[:480, 60:700].copy()
    assert cause(left, right)[0] is NoFloor.UNSEEN
    with pytest.raises(CannotMeasure, match=r"no floor: nothing below the camera is a plane.*--floor"):
        find_floor(Views.of_rectified(left, right), RECT)


def test_the_floor_that_is_seen_is_found():
    true = floor_from_pose(RECT, recordings.setup("pitched"))
    for level in (1.0, 0.1, 0.05):  # dark ones too, with larger deviations
        floor = find_floor(Views.of_rectified(*(exposed(picture, level) for picture in PAIR)), RECT)
        off = floor.plane - true.plane
        assert off @ np.linalg.solve(floor.covariance, off) < 16.3


def test_without_a_floor_and_a_laser_the_camera_is_taken_to_look_level():
    """So that what the scan shows lies in a plane through the camera, with a floor 100 mm below it."""
    floor = _floor_below(Instrument(RECT))
    assert floor.camera_height_mm == pytest.approx(100) and floor.down == pytest.approx([0, 1, 0], abs=0.05)
    level = floor_from_pose(RECT, rig_pose(RECT, 0.0, 100.0))
    np.testing.assert_allclose(floor.plane, level.plane, rtol=0.05, atol=1e-2)
