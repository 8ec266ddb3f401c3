"""The laser's pose from boards: the virtual laser and the camera see the same board; the truth is known."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from support.box_scenes import reading_too_far

from stereolib import laser, paper
from stereolib.calibration import LaserBoardView, ViewsDisagree, calibrate_lidar_to_camera, find_board_in_scan
from stereolib.calibration.laser_pose import _check_observable, _Fit
from stereolib.rig import pose_left_world, rigid
from stereolib.virtual import Scene, VirtualLidar, board_box, room

INNER, SQUARE = (6, 9), 30.0  # portrait: tall enough for the laser's plane to cut it
DIAGONAL = float(np.hypot(*((n + 2.6) * SQUARE for n in INNER)))
LASER = (-40.0, 25.0, 0.06)  # x, y, yaw
HEIGHT = 110.0
POSE = pose_left_world(0.10, 140.0)
T_WORLD_LIDAR = rigid(
    [[np.cos(LASER[2]), -np.sin(LASER[2]), 0], [np.sin(LASER[2]), np.cos(LASER[2]), 0], [0, 0, 1]], [*LASER[:2], HEIGHT]
)
TRUTH = POSE @ T_WORLD_LIDAR

#: (forward, left, turn about the vertical, lean back) in mm and degrees.
GOOD = (
    (700, 0, 0, 0), (600, 120, 35, 30), (600, -120, -35, 30), (1000, 200, -30, -30), (1000, -200, 30, -30),
    (550, 0, 20, -30), (1100, 60, 0, 35), (700, -80, 40, 0), (750, 90, -40, -25), (900, -250, 10, 35),
)  # fmt: skip


def upright(forward, left, turn, lean):
    """T_world_board: z towards the rig, y up, then turned about the vertical and leant back."""
    t, a = np.radians([turn, lean])
    facing = np.array([[0.0, 0, -1], [-1, 0, 0], [0, 1, 0]])
    spin = np.array([[np.cos(t), -np.sin(t), 0], [np.sin(t), np.cos(t), 0], [0, 0, 1]])
    back = np.array([[1, 0, 0], [0, np.cos(a), np.sin(a)], [0, -np.sin(a), np.cos(a)]])
    return rigid(spin @ facing @ back, [forward, left, 180.0])


@cache
def corners():
    columns, rows = INNER
    grid = np.array([[c - (columns - 1) / 2, r - (rows - 1) / 2, 0] for r in range(rows) for c in range(columns)])
    return grid * SQUARE


def seen_by_camera(T_left_board, rng):
    """Corners through the true lens with 0.1 px of noise, then the pose as the camera finds it."""
    camera = paper.paper_rig().left
    pixels = camera.project(corners() @ T_left_board[:3, :3].T + T_left_board[:3, 3])
    pixels = pixels + rng.normal(0, 0.1, pixels.shape)
    _, rotation, t = cv2.solvePnP(corners(), pixels, camera.K, camera.dist)
    return rigid(cv2.Rodrigues(rotation)[0], t)


def scanned(T_world_board, rng, too_far_pct=0.0):
    scene = Scene((room(), board_box(INNER, SQUARE, T_world_board)))
    sensor = reading_too_far(VirtualLidar(height_mm=HEIGHT), too_far_pct)
    data = sensor.scan(scene, LASER, rng, turns=5)
    return laser.average(laser.turns(laser.decode(data)))


def views(poses, seed, *, too_far_pct=0.0):
    rng = np.random.default_rng(seed)
    found = []
    for pose in poses:
        T = upright(*pose)
        found.append(
            find_board_in_scan(scanned(T, rng, too_far_pct), seen_by_camera(POSE @ T, rng), diagonal_mm=DIAGONAL)
        )
    return found


def error(T):
    """Small turn and shift in the laser's own frame between found and true pose."""
    off = np.linalg.inv(TRUTH) @ T
    return np.concatenate([cv2.Rodrigues(off[:3, :3])[0].ravel(), off[:3, 3]])


def test_pose_comes_back_with_honest_deviations():
    scores = []
    for seed in range(20):
        found = calibrate_lidar_to_camera(views(GOOD, seed))
        off = error(found.T_left_lidar)
        assert np.abs(off[3:]).max() < 5 and np.degrees(np.abs(off[:3]).max()) < 0.6
        scores.append(off / np.concatenate([found.std_rad, found.std_mm]))
    scores = np.abs(scores)
    assert (scores < 1.96).mean() >= 0.95
    assert 0.7 < np.sqrt(np.mean(scores**2)) < 1.1  # below 1: the stated bias is the most that the laser may have


@pytest.mark.parametrize("pct", [-2.0, 1.0, 3.0])
def test_a_laser_that_reads_too_far_is_told_from_one_that_stands_elsewhere(pct):
    found = calibrate_lidar_to_camera(views(GOOD, 7, too_far_pct=pct))
    assert found.scale == pytest.approx(pct / 100, abs=2.5 * found.std_scale) and found.std_scale < 0.003
    assert (np.abs(error(found.T_left_lidar)[3:]) < 3 * found.std_mm).all() and found.std_mm.max() < 4


def test_what_no_laser_errs_is_told_with_what_to_measure():
    """Squares of 30 mm told as 27 mm: the cameras' world shrinks, and the laser's does not."""
    good = views(GOOD, 8)
    assert calibrate_lidar_to_camera(good).warning == ""
    shrunk = [replace(v, T_left_board=v.T_left_board @ np.diag([1.0, 1, 1, 1])) for v in good]
    for view in shrunk:
        view.T_left_board.flags.writeable = True
        view.T_left_board[:3, 3] *= 0.9
    told = re.match(
        r"the laser reads (\d+\.\d) % longer than the boards have it", calibrate_lidar_to_camera(shrunk).warning
    )
    assert told and 8 < float(told[1]) < 11


def test_boards_that_are_all_at_one_place_leave_the_scale_open_and_it_is_said():
    """Of a laser that reads 2 % too far; two views more, nearer and farther, tell it."""
    near = [(700, y, turn, lean) for y, turn, lean in
            ((0, 0, 30), (40, 35, -30), (-40, -35, 30), (60, -30, -30), (-60, 30, 30), (20, 20, 30), (-20, -10, -30))
            ]  # fmt: skip
    found = calibrate_lidar_to_camera(views(near, 9, too_far_pct=2.0), max_std_mm=30.0)
    assert 0.01 < found.std_scale < 0.02 and abs(found.scale - 0.02) < 2 * found.std_scale
    assert "hold some nearer and some farther" in found.warning
    more = [*near, (1300, 0, 0, 0), (520, 0, 20, 0)]
    found = calibrate_lidar_to_camera(views(more, 9, too_far_pct=2.0), max_std_mm=30.0)
    assert found.std_scale < 0.005 and found.warning == ""
    assert found.scale == pytest.approx(0.02, abs=2.5 * found.std_scale)


def test_points_of_the_scan_land_on_the_board():
    found = calibrate_lidar_to_camera(views(GOOD, 1))
    T = POSE @ upright(700, 50, 20, 10)
    view = find_board_in_scan(scanned(upright(700, 50, 20, 10), np.random.default_rng(5)), T, diagonal_mm=DIAGONAL)
    points_mm = (1 - found.scale) * view.points_mm @ found.T_left_lidar[:3, :2].T + found.T_left_lidar[:3, 3]
    off = (points_mm - T[:3, 3]) @ T[:3, 2]
    assert abs(off.mean()) < 3


def test_any_mounting_is_found_without_a_start():
    """A laser turned by 170 degrees: readings of the same boards, given in its own frame."""
    turned = np.array([[np.cos(2.97), -np.sin(2.97)], [np.sin(2.97), np.cos(2.97)]])
    found = calibrate_lidar_to_camera(
        [LaserBoardView(v.T_left_board, v.points_mm @ turned, v.sigma_mm) for v in views(GOOD, 2)]
    )
    back = found.T_left_lidar.copy()
    back[:3, :2] = back[:3, :2] @ turned.T
    assert np.abs(error(back)[3:]).max() < 5


@pytest.mark.parametrize(
    ("poses", "message"),
    [
        ([(d, y, t, 0) for d, y, t, _ in GOOD], "0 boards lean"),
        ([(700, 10 * i, 25 * (-1) ** i, 25 * (i < 3)) for i in range(6)], "leaning boards stand too close"),
        ([(600 + 60 * i, 20 * i, 2 * i, 30 * (-1) ** i) for i in range(6)], "face nearly the same way"),
        (GOOD[:3], "at least 4"),
    ],
)
def test_poor_poses_are_refused_and_the_missing_one_named(poses, message):
    with pytest.raises(ValueError, match=message):
        calibrate_lidar_to_camera(views(poses, 3))


def test_a_board_that_moved_is_named():
    good = views(GOOD, 4)
    moved = good[4].T_left_board.copy()
    moved[:3, 3] += 40 * moved[:3, 2]
    with pytest.raises(ViewsDisagree, match="view 5 contradicts the other 9") as refused:
        calibrate_lidar_to_camera([*good[:4], LaserBoardView(moved, good[4].points_mm, good[4].sigma_mm), *good[5:]])
    assert refused.value.view == 4


def test_boards_that_moved_are_told_without_a_name():
    good = views(GOOD, 4)
    moved = [view.T_left_board.copy() for view in good]
    for k, off_mm in ((2, 60.0), (4, 40.0), (7, -50.0)):
        moved[k][:3, 3] += off_mm * moved[k][:3, 2]
    told = [LaserBoardView(T, view.points_mm, view.sigma_mm) for T, view in zip(moved, good, strict=True)]
    with pytest.raises(ViewsDisagree, match="leaving out any one does not mend it") as refused:
        calibrate_lidar_to_camera(told)
    assert refused.value.view is None


def test_board_must_be_the_only_candidate():
    rng = np.random.default_rng(0)
    boards = [board_box(INNER, SQUARE, upright(700, y, 0, 0)) for y in (-250, 250)]
    data = VirtualLidar(height_mm=HEIGHT).scan(Scene((room(), *boards)), LASER, rng)
    scan = laser.average(laser.turns(laser.decode(data)))
    T = POSE @ upright(700, 250, 0, 0)
    with pytest.raises(ValueError, match="2 things in the scan"):
        find_board_in_scan(scan, T, diagonal_mm=DIAGONAL)
    with pytest.raises(ValueError, match="at least 2 readings"):
        LaserBoardView(T, np.zeros((1, 2)), np.ones(1))


@pytest.mark.parametrize("value", [0.0, np.inf, np.nan])
def test_a_scan_of_nothing_is_refused_with_what_to_do(value):
    for readings in (0, 1):
        ranges = np.full(360, value)
        ranges[:readings] = 700.0
        with pytest.raises(ValueError, match=f"{readings} of the scan's 360 beams met something.*see that the sensor"):
            find_board_in_scan(laser.LaserScan(ranges, np.ones(360)), POSE, diagonal_mm=DIAGONAL)


def test_last_bits_of_the_input_stay_last_bits():
    """An optimiser that stops by its tolerance magnified them to 1e-4 mm: another processor, another map."""
    rng, good = np.random.default_rng(6), views(GOOD, 2)

    def shaken(array):
        return array * (1 + 1e-15 * rng.standard_normal(array.shape))

    other = [LaserBoardView(shaken(v.T_left_board), shaken(v.points_mm), v.sigma_mm) for v in good]
    first, second = (calibrate_lidar_to_camera(some).T_left_lidar for some in (good, other))
    np.testing.assert_allclose(second[:3, 3], first[:3, 3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(second[:3, :3], first[:3, :3], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("turn", "direction", "worst_mm"), [(0, "up", 432), (1, "up", 1200), (2, "sideways", 1274)])
def test_what_a_turn_leaves_open_counts_where_objects_stand(turn, direction, worst_mm):
    """A roll moves only what stands beside the middle, up to 0.36 of 1.2 m; a yaw most what stands farthest."""
    tilted = views(GOOD[:4], 0)
    std = np.array([1e-5] * 3 + [0.01] * 3 + [1e-5])
    std[turn] = 0.05
    found = _Fit(TRUTH, 0.0, np.diag(1 / std), np.zeros(0))
    facing = [replace(view, points_mm=view.points_mm - [0.0, view.points_mm.mean(axis=0)[1]]) for view in tilted]
    with pytest.raises(ValueError, match=rf"scan lies: {direction}, .* uncertain by (\d+) mm") as said:
        _check_observable(facing, found, 10.0)
    told = int(re.search(r"uncertain by (\d+) mm", str(said.value))[1])
    assert told == pytest.approx(0.05 * worst_mm, abs=1)
    _check_observable(facing, found, 0.05 * worst_mm + 1)
