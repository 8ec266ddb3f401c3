"""Sizes, volumes and surfaces with their deviations: against the box that was seen, and many draws of it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.boxes import EDGE_PX, EDGES, FLOOR, OWN, PRIORS, STILL, everything, pictured, start

from stereolib.base import turn_2d
from stereolib.laser import LaserScan, find_segments, fit_footprint
from stereolib.measurement import LaserOnFloor, MeasuredObject, ObjectRegion, Reason, Why
from stereolib.measurement.agreement import Past
from stereolib.measurement.box import Edge, Own, Shared
from stereolib.measurement.measured_object import BoxFacts, from_box, from_region, from_scan
from stereolib.measurement.observations import EdgeSeen
from stereolib.measurement.reasons import UNSURE
from stereolib.measurement.scene_solver import COMMON_ERRORS, Seen, Solution, solve

OPEN = dict.fromkeys(EDGES, Past.OPEN)
NO_HEIGHT = (np.nan, np.nan)
FROM_ABOVE = {edge: past for edge, past in OPEN.items() if edge is not Edge.RIGHT_END}  # one face is hidden


def solution(own=OWN, spread=None):
    covariance = np.zeros((len(Shared) + len(Own),) * 2)
    covariance[len(Shared) :, len(Shared) :] = np.diag(np.full(8, 1e-6) if spread is None else np.square(spread))
    return Solution(
        STILL, (own,), covariance, 0.0, 0.0, (np.zeros(0),), 0.0, {}, np.zeros((len(covariance), COMMON_ERRORS))
    )


def test_a_box_as_it_stands():
    thing = from_box(solution(), 0, BoxFacts(OPEN))
    np.testing.assert_allclose(thing.size_mm, [300, 200, 250], atol=1e-9)
    np.testing.assert_allclose(thing.outline_mm.mean(axis=0), thing.position_mm)
    np.testing.assert_allclose(thing.outline_mm[0], [700, 20], atol=1e-9)
    a, b, c, _ = thing.outline_mm
    assert np.linalg.det(np.stack([b - a, c - b])) > 0  # counter-clockwise
    assert thing.shape == "box" and thing.reasons == {} and thing.volume_l[0] == pytest.approx(15)
    assert np.degrees(thing.yaw_rad) == pytest.approx(-50)
    long_left = OWN[[0, 1, 2, 4, 3, 5, 6, 7]]
    other = from_box(solution(long_left), 0, BoxFacts(OPEN))
    np.testing.assert_allclose(other.size_mm, [300, 200, 250])
    assert np.degrees(other.yaw_rad) == pytest.approx(40)


def test_deviations_of_sizes_volume_and_surface_against_draws():
    spread = np.array([0.5, 0.5, 0.002, 0.6, 0.4, 0.7, 0.0, 0.0])
    thing = from_box(solution(spread=spread), 0, BoxFacts(OPEN))
    x = OWN + np.random.default_rng(8).normal(0, 1, (20_000, 8)) * spread
    sizes = x[:, [Own.RIGHT, Own.LEFT, Own.HEIGHT]]
    np.testing.assert_allclose(thing.std_mm, sizes.std(axis=0), rtol=0.03)
    assert thing.volume_l[1] == pytest.approx(sizes.prod(axis=1).std() / 1e6, rel=0.03)
    area = 2 * (sizes[:, 0] + sizes[:, 1]) * sizes[:, 2] + sizes[:, 0] * sizes[:, 1]
    assert thing.surface_m2[1] == pytest.approx(area.std() / 1e6, rel=0.03)
    centres = np.array([from_box(solution(own), 0, BoxFacts(OPEN)).position_mm for own in x[:1000]])
    np.testing.assert_allclose(thing.position_covariance, np.cov(centres.T), atol=0.06)
    assert thing.yaw_std_rad == pytest.approx(0.002)


@pytest.mark.parametrize(
    ("past", "reason"),
    [
        ({}, Reason.DEPTH_HIDDEN),
        (OPEN | {Edge.RIGHT_END: Past.CUT}, Reason.CUT),
        (OPEN | {Edge.RIGHT_END: Past.HIDDEN}, Reason.HIDDEN),
        (FROM_ABOVE, Reason.DEPTH_HIDDEN),
        (OPEN, Reason.TOO_UNCERTAIN),
        (FROM_ABOVE | {Edge.BACK_LEFT: Past.OPEN}, Reason.TOO_UNCERTAIN),
        (FROM_ABOVE | {Edge.BACK_LEFT: Past.HIDDEN}, Reason.HIDDEN),
        (FROM_ABOVE | {Edge.BACK_RIGHT: Past.OPEN}, Reason.DEPTH_HIDDEN),
    ],
)
def test_a_side_that_is_too_vague_is_refused_with_why_and_the_other_stays(past, reason):
    vague = np.array([1e-3] * 3 + [40.0] + [1e-3] * 4)
    thing = from_box(solution(spread=vague), 0, BoxFacts(past))
    assert thing.shape == "face" and np.isnan(thing.size_mm[0])
    assert thing.size_mm[1:] == pytest.approx([200, 250]) and np.isfinite(thing.covariance[1:, 1:]).all()
    assert thing.reasons["length"].reason is reason and list(thing.reasons) == ["length"]
    assert np.isnan(thing.volume_l).all() and len(thing.outline_mm) == 2
    np.testing.assert_allclose(thing.outline_mm.mean(axis=0), thing.position_mm)
    if reason is Reason.TOO_UNCERTAIN:
        assert str(thing.reasons["length"]).startswith("300 ± 40 mm")


def test_a_height_that_the_picture_cuts():
    vague = np.array([1e-3] * 5 + [40.0] + [1e-3] * 2)
    thing = from_box(solution(spread=vague), 0, BoxFacts(OPEN | {Edge.TOP_LEFT: Past.CUT}))
    assert thing.reasons["height"].reason is Reason.TOP_CUT and thing.shape == "box"
    assert thing.size_mm[:2] == pytest.approx([300, 200]) and np.isnan(thing.volume_l[0])


def test_edges_that_contradict_the_others_take_all_sizes_away():
    facts = BoxFacts(OPEN, doubtful=frozenset({Edge.LEFT_END}))
    thing = from_box(solution(), 0, facts)
    assert {why.reason for why in thing.reasons.values()} == {Reason.CONTRADICTION} and np.isnan(thing.size_mm).all()


def test_what_does_not_stand_has_no_size():
    facts = BoxFacts(OPEN, reasons={"object": Why(Reason.LEANS)})
    assert np.isnan(from_box(solution(), 0, facts).size_mm).all()
    unscanned = BoxFacts(OPEN, reasons={"object": Why(Reason.NOT_IN_SCAN)})
    assert np.isfinite(from_box(solution(), 0, unscanned).size_mm).all()


def test_a_known_reason_is_kept():
    vague, why = np.array([1e-3] * 5 + [40.0] + [1e-3] * 2), Why(Reason.NO_FLOOR)
    assert from_box(solution(spread=vague), 0, BoxFacts(reasons={"height": why})).reasons["height"] is why


def test_a_solved_box_becomes_an_object():
    found = solve(PRIORS, [Seen(start(), everything(PRIORS.world(STILL)))])
    thing = from_box(found, 0, BoxFacts(OPEN))
    np.testing.assert_allclose(thing.size_mm, [300, 200, 250], atol=0.02)
    own = found.of_box(0)[1][len(Shared) :, len(Shared) :]
    assert thing.std_mm == pytest.approx(np.sqrt(np.diag(own))[[Own.RIGHT, Own.LEFT, Own.HEIGHT]])


@pytest.mark.parametrize(("times", "least", "most"), [(1.0, 1.0, 1.06), (3.0, 1.2, 2.0)])
def test_edges_farther_off_than_they_say_widen_the_deviations_and_chance_does_not(times, least, most):
    rng, ours, plain = np.random.default_rng(12), [], []
    for _ in range(60):
        seen = [
            replace(o, point_px=o.point_px + np.sqrt(times**2 - 1) * rng.normal(0, EDGE_PX) * o.across)
            if isinstance(o, EdgeSeen)
            else o
            for o in everything(PRIORS.world(STILL), OWN, rng)
        ]
        found = solve(PRIORS, [Seen(start(), seen)])
        thing = from_box(found, 0, BoxFacts(OPEN))
        std = np.sqrt(np.diag(found.of_box(0)[1]))[len(Shared) :][[Own.RIGHT, Own.LEFT, Own.HEIGHT]]
        ours.append((thing.size_mm - [300, 200, 250]) / thing.std_mm)
        plain.append((thing.size_mm - [300, 200, 250]) / std)
    rms = [float(np.sqrt(np.mean(np.square(z)))) for z in (plain, ours)]
    assert least <= rms[0] / rms[1] < most


def test_what_shows_no_face_has_a_place_alone():
    nothing = np.zeros(1)
    region = ObjectRegion(nothing, nothing, nothing, nothing, (800.0, 50.0), (0, 0, 9, 9))
    thing = from_region(region, {"height": Why(Reason.LEANS)})
    assert thing.position_mm.tolist() == [800.0, 50.0] and np.isnan([thing.size_mm, thing.std_mm]).all()
    reasons = {name: why.reason for name, why in thing.reasons.items()}
    assert reasons == {"length": Reason.NO_FACE, "width": Reason.NO_FACE, "height": Reason.LEANS}


@cache
def cylinder():
    """Of 240 mm, as a scan shows it: its axis at (850, 300) in the laser's frame."""
    angles, centre, radius_mm = np.radians(np.arange(360.0)), np.array([850.0, 300.0]), 120.0
    along = np.column_stack([np.cos(angles), np.sin(angles)]) @ centre
    under_root = radius_mm**2 - centre @ centre + along**2
    meets = (under_root > 0) & (along > 0)
    ranges_mm = np.where(meets, along - np.sqrt(np.maximum(under_root, 0)), 2500.0)
    [part] = [
        part
        for part in find_segments(LaserScan(ranges_mm, np.ones(360), emitter_offset_mm=0.0))
        if part.kind == "object"
    ]
    return fit_footprint(part)


def test_a_cylinder_has_what_the_laser_leaves_open_in_its_place_and_size():
    known = np.diag([3.0, 2.0, np.radians(2.0), 0.01]) ** 2
    laser = LaserOnFloor(
        turn_2d(0.3), np.array([20.0, -30.0]), known, scale=0.02, common=np.diag([0.0, 0.0, 0.0, 0.01])
    )
    thing, exact = (
        from_scan(cylinder(), each, NO_HEIGHT, {}) for each in (laser, replace(laser, covariance=0 * known))
    )
    assert thing.shape == "circle" and thing.size_mm[:2] == pytest.approx(0.98 * 240.0)
    rim = np.hypot(*(thing.outline_mm - thing.position_mm).T)
    assert 2 * rim == pytest.approx(thing.size_mm[0])
    steps = 1e-4 * np.eye(4)
    J = np.array(
        [
            laser.moved(*s).points_mm(cylinder().centre_mm) - laser.moved(*-s).points_mm(cylinder().centre_mm)
            for s in steps
        ]
    )
    J = J.T / 2e-4
    np.testing.assert_allclose(
        thing.position_covariance - exact.position_covariance, J @ known @ J.T, rtol=1e-6, atol=1e-6
    )
    assert thing.std_mm[0] ** 2 - exact.std_mm[0] ** 2 == pytest.approx((0.01 * 240.0) ** 2)
    assert thing.common_mm[:2, 3] == pytest.approx(-0.01 * 240.0) and not thing.common_mm[:, :3].any()


def test_a_cylinder_s_volume_and_surface():
    std = np.array([1.0, 1.0, 2.0])
    C = np.outer(std, std) * [[1, 1, 0], [1, 1, 0], [0, 0, 1]]
    nothing = np.zeros(2)
    thing = MeasuredObject("circle", np.array([200.0, 200, 300]), C, nothing, np.eye(2), np.nan, np.nan, nothing[None])
    r = 100 + np.random.default_rng(1).normal(0, 0.5, 200_000)
    h = 300 + np.random.default_rng(2).normal(0, 2, 200_000)
    for told, drawn in (
        (thing.volume_l, np.pi * r**2 * h / 1e6),
        (thing.surface_m2, (2 * np.pi * r * h + np.pi * r**2) / 1e6),
    ):
        assert told[0] == pytest.approx(drawn.mean(), rel=1e-3) and told[1] == pytest.approx(drawn.std(), rel=0.02)


def test_a_size_of_5_mm_or_worse_is_told_with_what_makes_it_so():
    """A floor that is hardly known makes the height unsure; beams far apart make the ends so; both are computed."""
    world = PRIORS.world(STILL)
    sure = from_box(solve(PRIORS, [Seen(start(), everything(world))]), 0, BoxFacts(OPEN))
    assert sure.std_mm.max() < 5 and not sure.unsure
    rough = replace(PRIORS, floor=replace(FLOOR, covariance=200 * FLOOR.covariance))
    high = from_box(solve(rough, [Seen(start(), pictured(world))]), 0, BoxFacts(OPEN))
    assert high.std_mm[2] > 5 and high.unsure["height"] == UNSURE["floor"]
    blurred = [replace(seen, std_px=3.0) if isinstance(seen, EdgeSeen) else seen for seen in pictured(world)]
    wide = from_box(solve(PRIORS, [Seen(start(), blurred)]), 0, BoxFacts(OPEN))
    assert wide.std_mm[0] > 5 and wide.unsure["length"] == UNSURE["EdgeSeen"]
    many = dict.fromkeys(("EdgeSeen", "PlaneSeen", "floor"), np.full(len(Shared) + len(Own), 12.0))
    spread = solution(spread=np.full(8, 6.0))
    assert not from_box(replace(spread, given=many), 0, BoxFacts(OPEN)).unsure  # no one thing makes it
    assert set(
        from_box(replace(spread, given={"laser": np.full(len(Shared) + len(Own), 36.0)}), 0, BoxFacts(OPEN)).unsure
    ) == {
        "length",
        "width",
        "height",
    }
