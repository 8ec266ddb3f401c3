"""The least squares: exact boxes from exact observations, stated deviations against draws, mistaken edges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.boxes import FLOOR, HERE, OTHER, OWN, PRIORS, STILL, everything, pictured, shared, start

from stereolib.measurement import LaserOnFloor
from stereolib.measurement.box import Edge, Own, Shared
from stereolib.measurement.observations import EdgeSeen
from stereolib.measurement.scene_solver import Seen, solve

SIZES = [Own.RIGHT, Own.LEFT, Own.HEIGHT]


def test_exact_observations_give_the_exact_box():
    world = PRIORS.world(STILL)
    found = solve(PRIORS, [Seen(start(), everything(world))])
    assert found.boxes[0][SIZES] == pytest.approx([300, 200, 250], abs=0.01)
    assert found.boxes[0][: Own.RIGHT] == pytest.approx(OWN[: Own.RIGHT], abs=0.02)
    assert found.cost < 1e-2 and np.abs(found.shared[:3]).max() < 1e-4
    assert np.linalg.eigvalsh(found.covariance).min() > 0


def test_what_gave_the_variance_adds_up_to_it():
    found = solve(PRIORS, [Seen(start(), everything(PRIORS.world(STILL)))])
    assert sum(found.given.values()) == pytest.approx(np.diag(found.covariance), rel=1e-6)
    assert set(found.given) == {
        "floor", "laser", "cameras", "OwnPrior", "PlaneSeen", "EdgeSeen", "RangesSeen", "EndBetweenBeams"
    }  # fmt: skip


def test_the_errors_in_common_are_a_part_of_the_variance_and_mean_the_same_in_every_pair():
    """Laser and cameras but for the rows; numbers of another pair's whitening must not change what an error is."""
    found = solve(PRIORS, [Seen(start(), everything(PRIORS.world(STILL)))])
    no_rows = replace(PRIORS, cameras=PRIORS.cameras * np.diag([1, 1e-12, 1, 1]))
    known = solve(no_rows, [Seen(start(), everything(PRIORS.world(STILL)))])
    told = np.square(known.common).sum(axis=1)
    assert told == pytest.approx(known.given["laser"] + known.given["cameras"], rel=1e-4, abs=1e-9)
    assert (
        0
        < np.square(found.common[-8 + Own.HEIGHT]).sum()
        < found.given["laser"][-8 + Own.HEIGHT] + found.given["cameras"][-8 + Own.HEIGHT]
    )
    other = replace(PRIORS, laser=replace(HERE, covariance=HERE.covariance + np.full((4, 4), 1e-7)))
    assert np.abs(other.roots[0] - PRIORS.roots[0]).max() > 0.1  # its axes are others
    again = solve(other, [Seen(start(), everything(PRIORS.world(STILL)))])
    np.testing.assert_allclose(again.common[-8:], found.common[-8:], atol=2e-2 * np.abs(found.common[-8:]).max())


def test_a_baseline_that_is_wrong_makes_the_box_wrong_by_its_common_part():
    wrong = 20 * np.sqrt(PRIORS.cameras[3, 3])  # large beside where the search ends
    true = PRIORS.world(shared(baseline=wrong))
    priors = replace(PRIORS, floor=replace(FLOOR, plane=FLOOR.plane * (1 + wrong)))  # as the true cameras see it
    assert np.abs(priors.residuals(shared(baseline=wrong), true)[:3]).max() < 0.1
    found = solve(priors, [Seen(start(), pictured(true))])
    off = found.boxes[0][SIZES] - OWN[SIZES]
    assert np.abs(off).max() > 0.5
    at = [len(Shared) + k for k in SIZES]
    assert off == pytest.approx(-20 * found.common[at, -1], rel=0.05)


def test_the_floor_s_share_is_the_derivative():
    """Against numerical derivatives of the boxes, the floor's plane moved by a part of its deviations each way."""
    seen, slopes = [Seen(start(), pictured(PRIORS.world(STILL)))], []
    for column in np.linalg.cholesky(FLOOR.covariance).T:
        high, low = (
            solve(replace(PRIORS, floor=replace(FLOOR, plane=FLOOR.plane + sign * column)), seen).boxes[0]
            for sign in (0.1, -0.1)
        )
        slopes.append((high - low) / 0.2)
    share = np.sqrt(solve(PRIORS, seen).given["floor"][len(Shared) :])
    assert np.linalg.norm(slopes, axis=0)[SIZES] == pytest.approx(share[SIZES], rel=0.03, abs=1e-3)


@pytest.mark.parametrize("see", [pictured, everything])
def test_stated_deviations_are_those_of_draws(see):
    """What all boxes share is drawn too: floor, laser, cameras; two boxes, so that they tell it to each other."""
    rng, z = np.random.default_rng(11), []
    laser_std = np.sqrt(np.diag(HERE.covariance))
    for _ in range(25):
        x = STILL.copy()
        x[3:7], x[7:] = rng.normal(0, laser_std), rng.multivariate_normal(np.zeros(4), PRIORS.cameras)
        floor = rng.multivariate_normal(FLOOR.plane, FLOOR.covariance, method="eigh")  # as it was seen
        priors = replace(PRIORS, floor=replace(FLOOR, plane=floor))
        seen, boxes = [], []
        for own in (OWN, OTHER):
            box = own.copy()
            box[[Own.RIGHT_BIAS, Own.LEFT_BIAS]] = rng.normal(0, HERE.bias_mm, 2)
            seen.append(Seen(start(own), see(PRIORS.world(x), box, rng)))
            boxes.append(box)
        found = solve(priors, seen)
        for k, box in enumerate(boxes):
            std = np.sqrt(np.diag(found.of_box(k)[1]))[len(Shared) :]
            z.append(((found.boxes[k] - box) / std)[:6])
    rms = np.sqrt(np.mean(np.square(z)))
    assert 0.85 < rms < 1.15 and np.sqrt(np.mean(np.square(z), axis=0)).max() < 1.35


def test_a_second_box_tells_the_first_where_the_laser_is():
    world = PRIORS.world(STILL)
    one = solve(PRIORS, [Seen(start(), everything(world))])
    two = solve(PRIORS, [Seen(start(), everything(world)), Seen(start(OTHER), everything(world, OTHER))])
    assert (two.laser_std < one.laser_std).all()
    assert two.boxes[1][SIZES] == pytest.approx(OTHER[SIZES], abs=0.02)


def mistaken(px):
    seen = everything(PRIORS.world(STILL))
    return [
        replace(o, point_px=o.point_px + px * o.across) if isinstance(o, EdgeSeen) and o.edge is Edge.TOP_LEFT else o
        for o in seen
    ]


def test_an_edge_far_off_hardly_matters():
    """The higher of two upper edges is another thing's: it counts less, not linearly more.

    Which of the two it is, neither cost tells (`weigh_contradictions` does): the search begins where the box is.
    """
    true, std = OWN[Own.HEIGHT], 0.0
    heights = []
    for px in (0.3, 3.0, 12.0):
        found = solve(PRIORS, [Seen(OWN, mistaken(px))])
        heights.append(abs(found.boxes[0][Own.HEIGHT] - true))
        std = float(np.sqrt(found.of_box(0)[1][-3, -3]))
    assert heights[1] < 5 * heights[0] and heights[2] < heights[1] and heights[2] < 1.5 * std
    misfits = dict(zip(mistaken(12.0), found.misfits[0], strict=True))
    worst = max(misfits, key=misfits.get)
    assert isinstance(worst, EdgeSeen) and worst.edge is Edge.TOP_LEFT and misfits[worst] > 4


def test_a_start_that_is_off_hardly_costs_anything():
    """One edge of a box is another thing's; the search begins a few mm off each way, and at the true box."""
    rng, stuck = np.random.default_rng(5), 0
    for _ in range(40):
        seen, bad = (
            everything(PRIORS.world(STILL), OWN, rng),
            rng.choice([Edge.TOP_LEFT, Edge.RIGHT_END, Edge.LEFT_END]),
        )
        px = rng.uniform(2, 14) * rng.choice([-1, 1])
        at = next(k for k, o in enumerate(seen) if isinstance(o, EdgeSeen) and o.edge is bad)
        seen[at] = replace(seen[at], point_px=seen[at].point_px + px * seen[at].across)
        off = rng.normal(0, [3, 3, 0.01, 4, 4, 4, 0, 0])
        there, here = (solve(PRIORS, [Seen(begin, seen)]).cost for begin in (OWN, OWN + off))
        stuck += here > there + 1
    assert stuck <= 1


def test_what_is_known_beforehand_is_kept_where_nothing_is_seen():
    """The pair alone says nothing of the laser."""
    found = solve(PRIORS, [Seen(start(), pictured(PRIORS.world(shared(laser_x=30.0))))])
    assert found.laser == pytest.approx(np.zeros(4), abs=1e-6)
    assert found.laser_std == pytest.approx(np.sqrt(np.diag(HERE.covariance)))


def test_a_scene_without_boxes_is_its_priors():
    found = solve(PRIORS, [])
    assert found.boxes == () and found.shared == pytest.approx(STILL, abs=1e-9)
    std = np.sqrt(np.diag(found.covariance))
    assert std[Shared.OFFSET] == pytest.approx(PRIORS.cameras[0, 0] ** 0.5)
    assert std[0] * FLOOR.camera_height_mm == pytest.approx(0.5, rel=0.01)
    assert isinstance(PRIORS.laser, LaserOnFloor)
