"""Where the camera stood: the printed set-up against plain trigonometry, and what fits the picture."""

from __future__ import annotations

from dataclasses import replace
from math import atan, cos, degrees, radians, sin, sqrt

import numpy as np
import pytest

from stereolib import paper
from stereolib.paper import paper_rig
from stereolib.rig import pose_left_world


@pytest.fixture(scope="module")
def rectified():
    return paper_rig().rectify(alpha=0)


@pytest.fixture(scope="module")
def setup():
    return paper.paper_setup()


def test_setup_in_millimetres(setup):
    assert setup == paper.CubeSetup(side_mm=300, distance_mm=700, camera_height_mm=85, constant_rows=53)


def slow_view(rectified, distance, height, pitch, x=0.0, y=0.0, z=0.0):
    """Column, row and disparity of a point by plain trigonometry: baseline level, optical axis pitched up."""
    ahead, up = distance + x, z - height
    depth = ahead * cos(pitch) + up * sin(pitch)
    rise = up * cos(pitch) - ahead * sin(pitch)
    K, f = rectified.P1, rectified.f_px
    return K[0, 2] - f * y / depth, K[1, 2] - f * rise / depth, f * rectified.baseline_mm / depth


def test_pitched_setup_of_the_facts(rectified, setup):
    view = paper.solve_pitch(rectified, setup)
    assert degrees(view.pitch_rad) == pytest.approx(8.27, abs=0.005)
    assert view.constant_rows == pytest.approx(53, abs=1e-6)
    assert view.width_px == pytest.approx(363.9, abs=0.05)
    assert view.disparity_foot_px == pytest.approx(104.5, abs=0.05)
    assert view.disparity_top_px == pytest.approx(98.3, abs=0.05)
    assert view.disparity_foot_px - view.disparity_top_px == pytest.approx(6.2, abs=0.05)
    closed = atan((480 - 53 - rectified.P1[1, 2]) / rectified.f_px) - atan(85 / 700)
    assert view.pitch_rad == pytest.approx(closed, abs=1e-9)


def test_level_setup_of_the_facts(rectified, setup):
    view = paper.solve_camera_height(rectified, setup)
    assert view.camera_height_mm == pytest.approx(190, abs=0.5)
    assert view.width_px == pytest.approx(355, abs=0.5)
    assert view.disparity_foot_px == pytest.approx(view.disparity_top_px, abs=1e-9)
    closed = 700 * (480 - 53 - rectified.P1[1, 2]) / rectified.f_px
    assert view.camera_height_mm == pytest.approx(closed, abs=1e-6)


def test_the_printed_setup_cannot_be_right(rectified, setup):
    """facts: level at 8.5 cm, raw image: 340 px wide, foot at row 315; rectified: the top leaves the image."""
    half = 150 * sqrt(2)
    ground = [[700 + half, half, 0], [700 + half, -half, 0], [700, 0, 0]]
    points = np.c_[ground, np.ones(3)] @ pose_left_world(0, 85).T
    K = paper_rig().left.K
    raw = points[:, :3] @ K.T / points[:, 2:3]
    assert raw[1, 0] - raw[0, 0] == pytest.approx(340, abs=0.6)
    assert raw[2, 1] == pytest.approx(315, abs=0.5)
    printed = paper.cube_view(rectified, setup)
    assert printed.top_row < 0
    assert printed.constant_rows > 160
    assert printed.width_px == pytest.approx(355, abs=0.5)


def test_disparity_at_half_a_metre_needs_more_than_112(rectified, setup):
    """facts: 147 px at 0.5 m with the solved pitch."""
    pitch = paper.solve_pitch(rectified, setup).pitch_rad
    near = paper.cube_view(rectified, replace(setup, distance_mm=500), pitch_rad=pitch)
    assert near.disparity_foot_px == pytest.approx(147, abs=0.5)


def test_below_half_a_metre_the_cube_no_longer_fits(rectified, setup):
    """facts: its near edge then spans more rows than the image has."""
    views = [paper.cube_view(rectified, replace(setup, distance_mm=d), camera_height_mm=150) for d in (500, 470)]
    spans = [view.foot_row - view.top_row for view in views]
    assert spans[0] < rectified.size[1] < spans[1]


@pytest.mark.parametrize(("pitch", "height", "distance"), [(0.1, 85, 700), (-0.2, 300, 900), (0.0, 150, 520)])
def test_cube_view_against_trigonometry(rectified, setup, pitch, height, distance):
    view = paper.cube_view(rectified, replace(setup, distance_mm=distance), pitch_rad=pitch, camera_height_mm=height)
    column, row, disparity = slow_view(rectified, distance, height, pitch)
    assert (view.column, view.foot_row, view.disparity_foot_px) == pytest.approx((column, row, disparity))
    _, row, disparity = slow_view(rectified, distance, height, pitch, z=300)
    assert (view.top_row, view.disparity_top_px) == pytest.approx((row, disparity))
    half = 150 * sqrt(2)
    widths = []
    for z in (0, 300):
        left, right = (slow_view(rectified, distance, height, pitch, half, y, z)[0] for y in (half, -half))
        widths.append(right - left)
    assert view.width_px == pytest.approx(max(widths))
    depths = [(distance + half) * cos(pitch) + (z - height) * sin(pitch) for z in (0, 300)]
    assert view.depth_side_mm == pytest.approx(min(depths))  # the wider of the two is the nearer
    assert view.width_px == pytest.approx(
        10 * sqrt(2) * 30 / (10 * paper.cm_per_px_at(view.depth_side_mm, rectified.f_px))
    )


def test_pose_turns_world_points_into_the_left_camera(rectified):
    """Through the rectification they land where plain trigonometry says."""
    pitch, height = 0.13, 120.0
    point = np.array([800.0, 90.0, 40.0])
    pose = paper.rig_pose(rectified, pitch, height)
    left = pose[:3, :3] @ point + pose[:3, 3]
    u, v, w = rectified.P1[:, :3] @ rectified.R1 @ left
    expected = slow_view(rectified, 800, height, pitch, y=90.0, z=40.0)[:2]
    assert (u / w, v / w) == pytest.approx(expected)
    np.testing.assert_allclose(np.linalg.inv(pose)[:3, 3], [0, 0, height], atol=1e-9)


def test_solvers_refuse_the_impossible(rectified, setup):
    with pytest.raises(ValueError, match=r"no pitch_rad from -0\.785 to 0\.785"):
        paper.solve_pitch(rectified, replace(setup, constant_rows=5000))
    with pytest.raises(ValueError, match=r"no camera_height_mm from 1 to 1\.4e\+03"):
        paper.solve_camera_height(rectified, replace(setup, constant_rows=400))
    with pytest.raises(ValueError, match="behind"):
        paper.cube_view(rectified, setup, pitch_rad=radians(100))


def test_family_is_the_solved_pitch_at_every_height(rectified, setup):
    for view in paper.setup_family(rectified, setup, [20.0, 85.0, 300.0, 560.0]):
        solved = paper.solve_pitch(rectified, replace(setup, camera_height_mm=view.camera_height_mm))
        assert view.pitch_rad == pytest.approx(solved.pitch_rad, abs=1e-9)
        assert view.constant_rows == pytest.approx(53, abs=1e-6)
        assert view.box_px == view.width_px + 1
        assert view.edge_rows == view.foot_row - view.top_row


def test_cameras_that_read_thirty_centimetres(rectified, setup):
    """The counterexample: 52.6 cm up, pitched down by 21.7 degrees, 53 rows, 348 px, 30.0 cm."""
    view = paper.setup_family(rectified, setup, [526.0])[0]
    assert degrees(view.pitch_rad) == pytest.approx(-21.73, abs=0.01)
    assert view.width_px == pytest.approx(348.0, abs=0.1)
    assert 0.116 * view.edge_rows == pytest.approx(30.0, abs=0.01)
    both = paper.setup_family(rectified, setup, [112.0])[0]  # has both printed numbers
    assert (view.constant_rows, both.width_px) == pytest.approx((53, 362), abs=0.1)


def test_distance_to_the_edges_nearest_point(rectified, setup):
    """From above the cube it is the top: the cube stands nearer on the floor; from below nothing changes."""
    low, high = paper.setup_family(rectified, setup, [200.0, 500.0], to_point=True)
    assert low.width_px == paper.setup_family(rectified, setup, [200.0])[0].width_px
    near = replace(setup, distance_mm=sqrt(700**2 - 200**2))
    assert high.width_px == pytest.approx(paper.setup_family(rectified, near, [500.0])[0].width_px)
    with pytest.raises(ValueError, match="farther"):
        paper.setup_family(rectified, setup, [1100.0], to_point=True)


def test_room_of_the_printed_digits():
    setups = paper.setups_in_print()
    assert len({(s.distance_mm, s.constant_rows) for s in setups}) == 9
    assert sorted({s.constant_rows for s in setups}) == [52, 53, 54]
    assert setups[4] == paper.paper_setup()
