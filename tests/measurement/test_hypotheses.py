"""Whether the laser or the cameras have moved: told when they have, and only then; sizes change without a jump."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.boxes import OTHER, OWN, PRIORS, STILL, ends, everything, pictured, readings, shared, start

from stereolib.measurement import hypotheses
from stereolib.measurement.box import Edge, Own, Shared, Side
from stereolib.measurement.hypotheses import Moved, judge
from stereolib.measurement.scene_solver import Seen, solve

SIZES = [Own.RIGHT, Own.LEFT, Own.HEIGHT]


def judged(rng=None, **moved):
    return judge(PRIORS, [Seen(start(), everything(PRIORS.world(shared(**moved)), rng=rng))], scanned=True)


def size_std(found):
    return np.sqrt(np.diag(found.solution.of_box(0)[1]))[-8:][SIZES]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_laser_where_it_was_calibrated_has_not_moved(seed):
    found = judged(np.random.default_rng(seed))
    assert found.chance(laser=True) < 0.05 and found.chance(cameras=True) < 0.05
    assert sum(found.probability.values()) == pytest.approx(1)


@pytest.mark.parametrize("moved", [{"laser_yaw": np.radians(2)}, {"laser_y": 30.0}, {"laser_x": -20.0}])
def test_a_laser_that_has_moved_is_found_and_changes_no_size(moved):
    found = judged(np.random.default_rng(4), **moved)
    assert found.chance(laser=True) > 0.9
    assert (np.abs(found.solution.boxes[0][SIZES] - OWN[SIZES]) < 3 * size_std(found)).all()
    assert size_std(found) == pytest.approx(size_std(judged(np.random.default_rng(4))), rel=0.1)
    (name, value), solution = moved.popitem(), found.solution
    at = ["laser_x", "laser_y", "laser_yaw"].index(name)
    assert abs(solution.laser[at] - value) < 3 * solution.laser_std[at] < 0.5 * abs(value)


def test_sizes_change_without_a_jump():
    """From a laser that stands still to one turned by 5 degrees, in steps of a half."""
    found = [judged(laser_yaw=np.radians(yaw)) for yaw in np.arange(0.0, 5.1, 0.5)]
    sizes = np.array([one.solution.boxes[0][SIZES] for one in found])
    std = np.array([size_std(one) for one in found])
    assert (np.abs(np.diff(sizes, axis=0)) < std[1:]).all()
    assert (np.abs(sizes - OWN[SIZES]) < 3 * std).all()
    chances = [one.chance(laser=True) for one in found]
    assert chances[0] < 0.05 and min(chances[4:]) > 0.9


def turned(offset_px, boxes, rng=None):
    """All disparities are off by so much, the floor's too: what the scan shows of distances decides."""
    world = PRIORS.world(shared(offset=offset_px))
    floor = replace(PRIORS.floor, plane=PRIORS.floor.plane + np.array([0.0, 0.0, offset_px]))
    seen = [Seen(start(own), everything(world, own, rng)) for own in boxes]
    return judge(replace(PRIORS, floor=floor), seen, scanned=True)


@pytest.mark.parametrize("offset_px", [0.0, 0.1, 0.2, 0.3])
def test_what_one_solution_tells_of_turned_cameras_is_what_two_tell(offset_px, monkeypatch):
    """Where little speaks for it, no second solution is sought: the chance is near, and so are sizes and intervals."""
    found = []
    for least in (np.inf, -1.0):
        monkeypatch.setattr(hypotheses, "_LEAST_EXCESS", least)
        monkeypatch.setattr(hypotheses, "_LEAST_CHANCE", 1.0)
        found.append(turned(offset_px, [OWN]))
    linear, solved = found
    assert linear.chance(cameras=True) == pytest.approx(solved.chance(cameras=True), rel=0.5, abs=0.01)
    off = linear.solution.boxes[0][SIZES] - solved.solution.boxes[0][SIZES]
    assert (np.abs(off) < 0.5 * size_std(solved)).all()


def test_cameras_are_told_to_have_turned_the_surer_the_farther_they_have():
    found = [turned(offset_px, [OWN]) for offset_px in np.arange(0.0, 2.1, 0.1)]
    chances = np.array([one.chance(cameras=True) for one in found])
    assert (np.diff(chances) > -0.02).all()
    assert chances[0] < 0.02 and chances[-1] > 0.9
    off = np.array([one.solution.boxes[0][SIZES] - OWN[SIZES] for one in found])
    assert (np.abs(off) < 3 * np.array([size_std(one) for one in found])).all()


def test_cameras_that_have_turned_are_told_from_the_laser():
    found = turned(1.5, [OWN, OTHER], np.random.default_rng(5))
    assert found.chance(cameras=True) > 0.5
    off = found.solution.boxes[0][SIZES] - OWN[SIZES]
    assert (np.abs(off) < 3 * size_std(found)).all()


def test_without_a_scan_nothing_is_moved():
    seen = [Seen(start(), pictured(PRIORS.world(shared(offset=1.5))))]
    found = judge(PRIORS, seen, scanned=False)
    assert found.probability == {Moved.NOTHING: 1.0} and not found.scanned


def test_readings_of_one_face_alone_move_nothing_without_need():
    world = PRIORS.world(STILL)
    seen = [*pictured(world, rng=np.random.default_rng(6)), *readings(world, OWN, np.random.default_rng(7))[:1]]
    assert judge(PRIORS, [Seen(start(), seen)], scanned=True).chance(laser=True) < 0.05
    assert Moved.BOTH.laser and Moved.BOTH.cameras and not Moved.CAMERAS.laser


def test_an_end_that_the_laser_alone_tells_is_known_no_better_than_its_mount():
    """One face and its two ends in the scan; the pictures show neither end, so that the scan may slide along it."""
    world, rng = PRIORS.world(STILL), np.random.default_rng(8)
    face = [o for o in pictured(world, rng=rng) if getattr(o, "edge", Edge.TOP_RIGHT) is Edge.TOP_RIGHT]
    face = [o for o in face if getattr(o, "surface", Side.RIGHT) is Side.RIGHT]
    laser = [
        *readings(world, OWN, rng, [Side.RIGHT]),
        *ends(world, OWN, rng, [(Side.RIGHT, False), (Side.RIGHT, True)]),
    ]
    alone, sure = (
        judge(PRIORS, [Seen(start(), [*face, *laser])], scanned=True),
        solve(PRIORS, [Seen(start(), [*face, *laser])]),
    )
    at = len(Shared) + Own.Y
    along = [np.sqrt(found.covariance[at, at]) for found in (alone.solution, sure)]
    assert along[1] < 6 and 10 < along[0] < 20  # one laser in ten was shifted by 50 mm
    seen = [Seen(start(), everything(world, rng=rng))]  # where the pictures show it too, nothing is left open
    both = [
        np.sqrt(found.covariance[at, at]) for found in (judge(PRIORS, seen, scanned=True).solution, solve(PRIORS, seen))
    ]
    assert both[0] == pytest.approx(both[1], rel=0.1)
