"""What the scan alone tells of a box: its lines and sides against the truth, with the laser anywhere."""

from __future__ import annotations

import numpy as np
import pytest
from support.boxes import FLOOR, OWN, RECT

from stereolib.base import turn_2d
from stereolib.laser import LaserScan, find_segments, fit_footprint
from stereolib.measurement import LaserOnFloor
from stereolib.measurement.box import Box, Own, Shared, Side
from stereolib.measurement.observations import EndBetweenBeams, RangesSeen
from stereolib.measurement.regions import ObjectRegion
from stereolib.measurement.scanned import is_wall, scan_observations, scanned_box, sides_of
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
