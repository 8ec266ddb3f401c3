"""The floor: against the virtual rig's truth, its own covariance, and what is none."""

from __future__ import annotations

import numpy as np
import pytest
from support.ground import GRID, RECT, pictures_of_plane, recorded, textured

from stereolib.measurement import (
    AlignedPair,
    CannotMeasure,
    Floor,
    fit_floor,
    floor_from_pose,
    floor_tolerance_px,
)
from stereolib.paper import paper_rig, rig_pose
from stereolib.virtual import Scene, cube_scene, recordings, render_truth, room
from stereolib.virtual.camera_emulator import scaled_rig


@pytest.mark.parametrize("name", ["pitched", "level"])
def test_floor_of_a_pose_is_the_truths_floor(name):
    pose, scene = recordings.setup(name), Scene((room(),))
    floor, seen = floor_from_pose(RECT, pose), render_truth(scene, RECT, pose)
    on = seen.disparity_px > 40  # the walls are farther
    assert on.sum() > 20_000
    assert np.abs(floor.disparity(*GRID) - seen.disparity_px)[on].max() < 1e-3
    assert floor.camera_height_mm == pytest.approx(np.linalg.inv(pose)[2, 3])
    assert floor.axes @ floor.axes.T == pytest.approx(np.eye(3))
    assert floor.axes[2] == pytest.approx(-floor.down)


def test_floor_angles_are_the_poses():
    floor = floor_from_pose(RECT, rig_pose(RECT, -0.2, 400.0))
    assert (floor.camera_height_mm, floor.pitch_rad, floor.roll_rad) == pytest.approx((400.0, -0.2, 0.0), abs=1e-9)
    lean = np.array([[np.cos(0.05), np.sin(0.05), 0], [-np.sin(0.05), np.cos(0.05), 0], [0, 0, 1]])
    K = RECT.P1[:, :3]
    plane = RECT.f_px * RECT.baseline_mm * np.linalg.inv(K).T @ lean @ [0, 1, 0] / 300.0
    assert Floor(RECT, plane, np.zeros((3, 3))).roll_rad == pytest.approx(0.05)


@pytest.mark.parametrize("name", ["pitched", "level"])
def test_floor_from_perfect_disparity(name):
    """Cube, walls and shadowed half of the map are not floor; noise averages out."""
    pose = recordings.setup(name)
    disparity = render_truth(cube_scene(), RECT, pose).disparity_px
    disparity = disparity + np.random.default_rng(1).normal(0, 0.2, disparity.shape)
    disparity[:, :150] = np.nan
    found, true = fit_floor(disparity, RECT), floor_from_pose(RECT, pose)
    assert found.camera_height_mm == pytest.approx(true.camera_height_mm, rel=0.004)
    assert found.pitch_rad == pytest.approx(true.pitch_rad, abs=0.0008)
    again = fit_floor(disparity, RECT)
    assert np.abs(again.disparity(320.0, 470.0) - found.disparity(320.0, 470.0)) < 0.02


@pytest.mark.parametrize("tolerances", [0.0, 0.6])
def test_covariance_of_the_floor_is_that_of_many_draws(tolerances):
    """Blocks of 8 x 8 pixels err together, as matches do: the deviations stated are those found.

    Also where they err as much as a floor may, so that many of them count less.
    """
    true = floor_from_pose(RECT, rig_pose(RECT, -0.2, 400.0))
    flat, draw = true.disparity(*GRID), np.random.default_rng(2)
    scale_px = tolerances * floor_tolerance_px(flat) if tolerances else 0.3
    found = []
    for _ in range(60):
        error = scale_px * np.kron(draw.normal(0, 1.0, (60, 80)), np.ones((8, 8)))
        found.append(fit_floor(np.where(flat > 20, flat + error, np.nan), RECT))
    off = [floor.plane - true.plane for floor in found]
    squares = [e @ np.linalg.solve(floor.covariance, e) / 3 for e, floor in zip(off, found, strict=True)]
    assert 0.8 < np.mean(squares) < 1.4  # 1, give or take 0.1


def test_a_floor_of_long_structures_is_found_within_its_deviations():
    """On planks along the rows half is matched, by 1 px to either side: the pictures know better, and how well."""
    true, off, squares = floor_from_pose(RECT, rig_pose(RECT, -0.2, 400.0)), [], []
    flat = true.disparity(*GRID)
    for seed in range(16):
        draw = np.random.default_rng([9, seed])
        pair = AlignedPair.of(*pictures_of_plane(true.plane, textured(draw, 30.0, (12.0, 1.5)), draw, noise=4.0))
        blocks = np.where(draw.random((60, 80)) < 0.5, draw.normal(0, 1.0, (60, 80)), np.nan)
        error = np.kron(blocks, np.ones((8, 8)))
        found = fit_floor(np.where(flat > 20, flat + error, np.nan), RECT, pair=pair)
        off.append(found.camera_height_mm / 400 - 1)
        squares.append((found.plane - true.plane) @ np.linalg.solve(found.covariance, found.plane - true.plane) / 3)
    assert np.sqrt(np.mean(np.square(off))) < 0.005
    assert 0.6 < np.sqrt(np.mean(squares)) < 1.4


def test_a_small_floor_is_found():
    """At 0.5 m the cube leaves a strip of floor: one pixel in twelve."""
    left, right, disparity = recorded("series/medium_500")
    assert fit_floor(disparity, RECT, pair=AlignedPair.of(left, right)).camera_height_mm == pytest.approx(85, abs=0.8)


@pytest.mark.parametrize("roll", [-14, -8, 3, 14])
@pytest.mark.parametrize("share", [1.0, 0.1])
def test_a_floor_under_a_leaning_camera(roll, share):
    """450 mm up, looking down by 20 degrees; all but a strip of lower rows may be wall, and a third is not matched."""
    pose = rig_pose(RECT, np.radians(-20), 450.0)
    lean = np.eye(4)
    c, s = np.cos(np.radians(roll)), np.sin(np.radians(roll))
    lean[:3, :3] = RECT.R1.T @ [[c, -s, 0], [s, c, 0], [0, 0, 1]] @ RECT.R1
    true, draw = floor_from_pose(RECT, lean @ pose), np.random.default_rng(7)
    disparity = true.disparity(*GRID) + draw.normal(0, 0.2, GRID[0].shape)
    disparity[: round(480 * (1 - share))] = 118.0  # a wall, which hides the floor behind it
    spots = np.kron(draw.random((24, 32)), np.ones((20, 20)))
    disparity[spots < 0.3] = np.nan
    found = fit_floor(disparity, RECT)
    assert found.camera_height_mm == pytest.approx(450, rel=0.02)
    assert np.degrees(found.roll_rad - true.roll_rad) == pytest.approx(0, abs=0.7)


def test_a_wall_is_no_floor():
    """A camera that sees a wall and nothing else."""
    disparity = np.full((480, 640), 60.0) + np.random.default_rng(5).normal(0, 0.2, (480, 640))
    with pytest.raises(CannotMeasure, match="no floor"):
        fit_floor(disparity, RECT)


@pytest.mark.parametrize(("pitch_deg", "height_mm"), [(-49, 400.0), (-51, 400.0), (-10, 990.0), (-10, 1010.0)])
def test_a_floor_beyond_its_limits_is_none(pitch_deg: float, height_mm: float):
    disparity = floor_from_pose(RECT, rig_pose(RECT, np.radians(pitch_deg), height_mm)).disparity(*GRID)
    if pitch_deg >= -50 and height_mm < 1000:
        assert fit_floor(disparity, RECT).camera_height_mm == pytest.approx(height_mm, abs=1e-5)
        return
    with pytest.raises(CannotMeasure, match="no floor"):
        fit_floor(disparity, RECT)


def test_a_floor_of_one_spot_is_none():
    """All of a small picture's floor lies in one place: nothing tells how well its plane is known."""
    small = scaled_rig(paper_rig(), 0.25).rectify()
    floor = floor_from_pose(small, rig_pose(small, -0.2, 400.0))
    disparity = floor.disparity(*np.meshgrid(np.arange(160.0), np.arange(120.0)))
    disparity[:, :72] = disparity[:, 96:] = disparity[:72] = disparity[96:] = np.nan
    with pytest.raises(CannotMeasure, match="no floor"):
        fit_floor(disparity, small)


def test_pixels_of_a_floor_lie_on_it_and_others_do_not():
    assert floor_tolerance_px(np.array([20.0, 80.0])) == pytest.approx([0.7, 1.6])


def test_bad_input():
    floor = floor_from_pose(RECT, recordings.setup("level"))
    with pytest.raises(ValueError, match=r"shape \(240, 320\)"):
        fit_floor(np.ones((240, 320)), RECT)
    with pytest.raises(CannotMeasure, match="no floor"):
        fit_floor(np.full((480, 640), np.nan), RECT)
    with pytest.raises(ValueError, match="below the camera"):
        Floor(RECT, -floor.plane, np.zeros((3, 3)))
    with pytest.raises(ValueError, match="above the floor"):
        floor_from_pose(RECT, rig_pose(RECT, 0.0, -10.0))
