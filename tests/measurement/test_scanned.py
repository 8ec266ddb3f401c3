"""What the scan alone tells of a box: its lines and sides against the truth, with the laser anywhere."""

from __future__ import annotations

import numpy as np
import pytest
from support.boxes import FLOOR, OWN, RECT

from stereolib.base import turn_2d
from stereolib.laser import LaserScan, find_segments, fit_footprint
from stereolib.measurement import LaserOnFloor
from stereolib.measurement.box import Box, Own, Shared, Side
from stereolib.measurement.laser_on_floor import Lean
from stereolib.measurement.observations import EndBetweenBeams, RangesSeen
from stereolib.measurement.regions import ObjectRegion
from stereolib.measurement.scanned import (
    is_seen_through,
    is_wall,
    reads_otherwise,
    scan_observations,
    scanned_box,
    sides_of,
)
from stereolib.measurement.scene_solver import Priors, solve

NEAR = np.diag([0.5**2, 0.5**2, 1e-6, 1e-8])
STD = np.diag([0.03, 0.03, 2e-4, 2e-4]) ** 2


def drawn(laser, seed, sigma_mm=1.5):
    """A scan of the box: true ranges of the beams that meet it, with noise, 25 mm beside the laser's axis."""
    angles = np.radians(np.arange(360.0))
    beam, beside = (np.stack([np.cos(a), np.sin(a)], axis=1) @ laser.R.T for a in (angles, angles - np.radians(82)))
    origin = laser.t + 25 * beside
    ranges = np.full(360, 2500.0)
    for side, length in ((Side.RIGHT, OWN[Own.RIGHT]), (Side.LEFT, OWN[Own.LEFT])):
        n, along = Box(OWN).normal(side), Box(OWN).normal(side.other)
        facing = beam @ n
        r = (Box(OWN).distance(side) - origin @ n) / np.where(facing > 0.05, facing, np.nan)
        s = (origin + beam * r[:, None] - OWN[:2]) @ along
        hit = (s > 0) & (s < length) & (r < ranges)
        ranges[hit] = r[hit]
    noise = np.random.default_rng(seed).normal(0, sigma_mm, 360)
    return LaserScan(np.rint(ranges + noise), np.full(360, 500.0))


def footprint(laser, seed):
    parts = [part for part in find_segments(drawn(laser, seed), max_mm=2000) if part.kind == "object"]
    return fit_footprint(parts[0], bias_mm=0.0)


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (30.0, -20.0, 0.12)])
def test_a_scanned_box_within_its_deviations(pose):
    laser, z = LaserOnFloor(turn_2d(pose[2]), np.array(pose[:2]), NEAR, bias_mm=0.1), []
    for seed in range(12):
        seen = scanned_box(footprint(laser, seed), laser)
        found = solve(Priors(FLOOR, laser, STD), [seen])
        std = np.sqrt(np.diag(found.of_box(0)[1]))[len(Shared) :]
        z.append(((found.boxes[0] - OWN) / std)[: Own.HEIGHT])
        assert np.abs(found.boxes[0] - OWN)[[Own.RIGHT, Own.LEFT]].max() < 15
    assert np.sqrt(np.mean(np.square(z))) < 1.4


def test_lines_find_their_sides():
    laser = LaserOnFloor(np.eye(2), np.zeros(2), NEAR)
    shown = footprint(laser, 1)
    assert sides_of(shown, laser, OWN[Own.TURN]) == {0: Side.RIGHT, 1: Side.LEFT}
    assert sides_of(shown, laser, OWN[Own.TURN] + 0.5) == {0: Side.RIGHT, 1: Side.LEFT}
    assert sides_of(shown, laser, OWN[Own.TURN] + np.pi / 2) == {0: Side.LEFT}


def test_free_ends_lie_between_beams():
    laser = LaserOnFloor(np.eye(2), np.zeros(2), NEAR)
    found = scan_observations(footprint(laser, 1), laser, OWN[Own.TURN])
    assert sum(isinstance(o, RangesSeen) for o in found) == 2
    ends = {(o.side, o.at_corner) for o in found if isinstance(o, EndBetweenBeams)}
    assert ends == {(Side.RIGHT, False), (Side.LEFT, False)}


WALL_MM = np.column_stack([np.full(41, 1500.0), np.linspace(-800, 800, 41)])
NOTHING = np.zeros((0, 2))


def part_of_wall(nearer_px=0.0, share=1.0):
    """Pixels matched on a wall 1500 mm ahead, a share of them nearer by some pixels of disparity."""
    u, v = (a.ravel().astype(float) for a in np.meshgrid(np.arange(200, 400, 3), np.arange(100, 300, 3)))
    disparity = RECT.f_px * RECT.baseline_mm * FLOOR.rays(u, v)[0] / 1500
    disparity[: round(share * len(u))] += nearer_px
    return ObjectRegion(u, v, disparity, FLOOR.height_mm(u, v, disparity), (1500.0, 0.0), (200, 100, 399, 298))


def test_a_part_of_a_wall_is_told_from_what_stands_before_it():
    assert is_wall(part_of_wall(), FLOOR, WALL_MM, NOTHING)
    assert is_wall(part_of_wall(-6.0, 0.1), FLOOR, WALL_MM, NOTHING)  # wrong matches
    assert not is_wall(part_of_wall(6.0, 0.1), FLOOR, WALL_MM, NOTHING)  # an object that grew together with it
    assert not is_wall(part_of_wall(-6.0), FLOOR, WALL_MM, NOTHING)  # something behind what the scan takes for a wall
    assert not is_wall(part_of_wall(), FLOOR, WALL_MM[:0], NOTHING)


@pytest.mark.parametrize("before_mm", [20.0, 60.0])
def test_a_wall_before_which_the_scan_shows_something_is_no_wall(before_mm):
    at = np.abs(WALL_MM[:, 1] - 100) < 90
    stepped = WALL_MM - np.column_stack([before_mm * at, 0 * at])
    assert not is_wall(part_of_wall(), FLOOR, stepped, NOTHING)
    assert not is_wall(part_of_wall(), FLOOR, WALL_MM[~at], stepped[at])
    elsewhere = WALL_MM[at] - [before_mm, 700.0]
    assert is_wall(part_of_wall(), FLOOR, WALL_MM, elsewhere)
    assert is_wall(part_of_wall(), FLOOR, WALL_MM, WALL_MM[at] * 0.5)  # what stands far before it is no part of it


BOX_MM = np.array([[1000.0, 0.0], [1150.0, -150.0], [1150.0, 150.0]])  # its nearest corner and the ends of two faces
LEVEL = LaserOnFloor(np.eye(2), np.zeros(2), NEAR, lean=Lean(np.zeros(2), 80.0, 1e-6 * np.eye(2)))


def readings(distance_mm, spread_deg=8.0):
    bearings = np.radians(np.arange(-spread_deg, spread_deg + 1))
    return distance_mm * np.column_stack([np.cos(bearings), np.sin(bearings)])


@pytest.mark.parametrize(("distance_mm", "otherwise"), [(400, True), (2000, True), (1000, False), (1100, False)])
def test_what_the_laser_reads_where_a_box_stands(distance_mm, otherwise):
    assert reads_otherwise(BOX_MM, 300.0, LEVEL, readings(distance_mm)) is otherwise
    moved = LEVEL.moved(-500.0, 0.0, 0.3)  # all is told from where the laser stands
    assert reads_otherwise(BOX_MM - [500, 0], 300.0, moved, readings(distance_mm) - [500, 0]) is otherwise


def test_when_it_tells_nothing():
    behind = readings(2000)
    assert not reads_otherwise(BOX_MM, 90.0, LEVEL, behind)  # hardly higher than the laser's plane
    assert not reads_otherwise(BOX_MM, 300.0, LaserOnFloor(np.eye(2), np.zeros(2), NEAR), behind)  # which is where?
    assert not reads_otherwise(BOX_MM, 300.0, LEVEL, behind[:2]) and not reads_otherwise(BOX_MM, 300.0, LEVEL, NOTHING)
    one_on_it = np.concatenate([behind, [[1010.0, 0.0]]])
    assert not reads_otherwise(BOX_MM, 300.0, LEVEL, one_on_it)
    rising = LaserOnFloor(np.eye(2), np.zeros(2), NEAR, lean=Lean(np.array([0.2, 0.0]), 80.0, 1e-6 * np.eye(2)))
    assert not reads_otherwise(BOX_MM, 300.0, rising, behind)  # over the box


@pytest.mark.parametrize(
    ("seen", "is_gap"),
    [
        ("ooobbboo", True),
        ("obbbo", True),
        ("oobooo", True),
        ("obboo", True),
        ("ooo.bbb.ooo", False),  # beside it mixed readings: nobody knows
        ("oobo", False),  # one beam, hardly on it beside: chance
        ("bbbooo", False),  # it ends there
        ("oonnoo", False),  # something nearer hides it
        ("oooooo", False),
        ("", False),
    ],
)
@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (-40.0, 30.0, 0.3)])
def test_a_face_with_a_gap_is_told_by_the_beams_that_go_through(seen, is_gap, pose):
    laser = LaserOnFloor(np.array(pose[:2]), pose[2], np.zeros((4, 4)))
    ends = np.array([[700.0, 200.0], [800.0, -150.0]])
    share = (np.arange(len(seen)) + 0.5)[:, None] / max(len(seen), 1)
    on_it = ends[0] + share * (ends[1] - ends[0])
    times = np.array([{"o": 1.05, "b": 1.2, ".": 1.1, "n": 0.8}[c] for c in seen])
    beside = laser.t + np.array([[900.0, 600.0], [-300.0, 20.0]])
    readings_mm = np.concatenate([laser.t + times[:, None] * (on_it - laser.t), beside])
    for order in (slice(None), slice(None, None, -1)):
        assert is_seen_through(ends, laser, readings_mm[order]) is is_gap
        assert is_seen_through(ends[::-1], laser, readings_mm[order]) is is_gap
