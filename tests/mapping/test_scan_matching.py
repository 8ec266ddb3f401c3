"""Poses from scans, on rooms of the virtual laser whose poses are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support import walks

from stereolib import laser
from stereolib.base import direction, turn_2d
from stereolib.mapping import Station, disturb_poses, refine_poses
from stereolib.virtual import Scene, VirtualLidar, box_on_floor, cast_rays, recordings, room, walk

TRUE = np.array(list(walk.POSES.values()))


def stations(poses, scans):
    return [Station(pose, (), scan) for pose, scan in zip(poses, scans, strict=True)]


def poses_of(match):
    return np.array([station.pose for station in match.stations])


def test_disturbed_poses_of_the_walk_come_back():
    """From 50 mm and 3 degrees off to 9 mm and 0.25 degrees, as far as the laser's bias lets it."""
    scans = [walks.scan_mm(k) for k in walks.SEEN]
    found = []
    for seed in range(3):
        match = refine_poses(disturb_poses(stations(TRUE, scans), np.random.default_rng(seed), 50.0, np.radians(3.0)))
        error = poses_of(match) - TRUE
        assert np.array_equal(error[0], [0, 0, 0]) and not match.stations[0].covariance.any()
        assert np.abs(error[:, :2]).max() < 9 and np.degrees(np.abs(error[:, 2])).max() < 0.25
        for k, station in enumerate(match.stations[1:]):
            assert error[k + 1] @ np.linalg.solve(station.covariance, error[k + 1]) < 14.2  # 99.7 % of three
            np.testing.assert_array_equal(station.covariance, match.covariance[3 * k : 3 * k + 3, 3 * k : 3 * k + 3])
        assert match.rms_before_mm > 25 > 5 > match.rms_after_mm and match.pairs > 2000
        found.append(poses_of(match))
    np.testing.assert_allclose(found[1:], [found[0]] * 2, atol=0.05)  # one minimum


def test_the_bias_that_was_learnt_and_taken_off_brings_the_poses_nearer():
    true = np.repeat(np.array(recordings.RANGES_MM, float), 360)
    learnt = laser.learn_bias(true, np.concatenate(recordings.load_range_series("white")))
    scans = [recordings.scan(name) for name in walk.POSES]
    corrected = [laser.points_mm(replace(scan, ranges_mm=learnt(scan.ranges_mm))) for scan in scans]
    match = refine_poses(stations(TRUE, corrected), bias_mm=(1.0, 0.0))
    error = poses_of(match) - TRUE
    assert np.abs(error[:, :2]).max() < 4.5 and np.degrees(np.abs(error[:, 2])).max() < 0.18


def test_exact_scans_give_exact_poses_and_deviations_cover_noisy_ones():
    """Rooms drawn at random: errors in units of their stated deviations; without noise and bias hardly any error."""
    scores = []
    perfect = VirtualLidar(sigma_mm=0.0, sigma_per_mm=0.0, bias_mm=(0, 0, 0), bias_dark_mm=0.0)
    for seed in range(12):
        rng = np.random.default_rng([3, seed])
        (x, y), (u, v) = rng.uniform(800, 1500, 2), rng.uniform(1500, 2200, 2)
        boxes = [box_on_floor((300.0, 200.0, 300.0), px, py, rng.uniform(0, 3)) for px, py in ((900, 500), (700, -500))]
        scene = Scene((room(x_mm=(-x, u), y_mm=(-y, v)), *boxes))
        true = np.array([[0.0, 0, 0], [300, 100, 2.0], [100, -300, -0.7]])
        for sensor in (perfect, VirtualLidar()):
            scans = [
                laser.points_mm(laser.average(laser.turns(laser.decode(sensor.scan(scene, p, rng))))) for p in true
            ]
            match = refine_poses(disturb_poses(stations(true, scans), rng, 50.0, np.radians(3.0)))
            error = poses_of(match)[1:] - true[1:]
            if sensor is perfect:
                assert np.abs(error[:, :2]).max() < 0.5 and np.degrees(np.abs(error[:, 2])).max() < 0.02
            else:
                scores += [e @ np.linalg.solve(s.covariance, e) for e, s in zip(error, match.stations[1:], strict=True)]
    assert np.mean(np.array(scores) < 7.81) > 0.85  # 95 % of three degrees of freedom
    assert np.mean(scores) > 0.2  # and are not several times too wide


def views(poses, x_mm, y_mm):
    """Of each station: true ranges, the face that each beam meets, and the cosine it meets it at."""
    boxes = [box_on_floor((300.0, 200.0, 300.0), 900, 500, 0.4), box_on_floor((400.0, 200.0, 300.0), 700, -600, 1.1)]
    for x, y, yaw in poses:
        beams = np.column_stack([direction(yaw + np.radians(np.arange(360))), np.zeros(360)])
        hits = cast_rays(Scene((room(x_mm=x_mm, y_mm=y_mm), *boxes)), np.array([x, y, 100.0]), beams)
        face = np.unique(hits.normal.round(6), axis=0, return_inverse=True)[1].ravel()
        yield hits.distance_mm, face, np.abs((beams * hits.normal).sum(axis=1))


def scores_of(true, runs, **how):
    """Root mean square errors of many matchings as shares of what is stated: of each number, and of all jointly."""
    matches = [refine_poses(stations(true, scans), **how) for scans in runs]
    covariance = np.mean([match.covariance for match in matches], axis=0)
    errors = np.array([(poses_of(match) - true)[1:].ravel() for match in matches])
    jointly = np.mean([e @ np.linalg.solve(m.covariance, e) for e, m in zip(errors, matches, strict=True)])
    return np.sqrt((errors**2).mean(axis=0) / np.diag(covariance)), np.sqrt(jointly / len(covariance))


def scan_of(ranges_mm):
    return laser.points_mm(laser.LaserScan(ranges_mm, np.ones(360), emitter_offset_mm=0.0))


@pytest.mark.parametrize("bias_mm", [(0.0, 0.0), (1.0, 0.8e-6)])
def test_the_deviations_are_those_of_many_scans(bias_mm):
    """Noise alone, and with the bias that is assumed: each pose scatters as much as is stated, jointly too."""
    rng, true, runs = np.random.default_rng(5), np.array([[0.0, 0, 0], [300, 100, 2.0], [100, -300, -0.7]]), []
    seen = list(views(true, (-1500, 2500), (-1500, 1500)))
    for _ in range(60):
        by_range, scans = bias_mm[1] * rng.normal(), []
        for r, face, cosine in seen:
            by_face = bias_mm[0] * rng.normal(size=face.max() + 1)[face] / cosine
            scans.append(scan_of(r + laser.XV11_SIGMA(r) * rng.normal(size=360) + by_face + by_range * r**2))
        runs.append(scans)
    ratio, jointly = scores_of(true, runs, bias_mm=bias_mm)
    assert ratio.min() > 0.7 and ratio.max() < 1.3  # 60 runs tell each of them to 9 %, and all together to 4 %
    assert 0.85 < jointly < 1.2


TWO, THREE = (
    ([[500.0, -200, 1.0]], (-900, 1700), (-1000, 1200)),
    (
        [[300.0, 100, 2.0], [100, -300, -0.7]],
        (-1500, 2500),
        (-1500, 1500),
    ),
)


@pytest.mark.parametrize("others, x_mm, y_mm", [TWO, THREE], ids=["two", "three"])
def test_things_that_moved_between_the_scans_are_in_the_deviations(others, x_mm, y_mm):
    """Three in ten readings of the second station on things that have moved by 10 to 40 mm, some dozen beams each."""
    rng, true, runs = np.random.default_rng(6), np.array([[0.0, 0, 0], *others]), []
    seen = list(views(true, x_mm, y_mm))
    for _ in range(80):
        ranges = [r + laser.XV11_SIGMA(r) * rng.normal(size=360) for r, _, _ in seen]
        moved = 0
        while moved < 0.3 * 360:
            beams = (rng.integers(360) + np.arange(rng.integers(10, 30))) % 360
            ranges[1][beams] += rng.uniform(10, 40) * rng.choice([-1, 1])
            moved += len(beams)
        runs.append([scan_of(each) for each in ranges])
    ratio, jointly = scores_of(true, runs, bias_mm=(0.0, 0.0))
    assert ratio.min() > 0.65 and ratio.max() < 1.35  # too wide where blame is shared with a station that kept still
    assert 0.8 < jointly < 1.3


@pytest.mark.parametrize("what, far, turned_rad, std", [("scale", 1.008, 0.0, 0.005), ("turn", 1.0, 0.006, 0.004)])
def test_a_laser_that_errs_alike_everywhere_is_in_the_deviations(what, far, turned_rad, std):
    """All readings 0.8 % too long, or turned by 0.3 degrees: known so well they are explained, exactly not."""
    scans, error = [walks.scan_mm(k) for k in walks.SEEN], np.eye(4)[:, [2 if what == "turn" else 3]]
    scores = []
    for known in (0.0, std):
        laser_errs = {"laser_covariance": known**2 * error @ error.T, "laser_common": known * error}
        there = [
            replace(s, scan_mm=far * s.scan_mm @ turn_2d(-turned_rad), **laser_errs) for s in stations(TRUE, scans)
        ]
        match = refine_poses(there)
        off = (poses_of(match) - TRUE)[1:].ravel()
        scores.append(float(off @ np.linalg.solve(match.covariance, off)))
    assert scores[1] < 26.2 < scores[0]  # 99 % of twelve


def line(start, end, count=90):
    return np.linspace(start, end, count)


def test_one_wall_leaves_a_direction_open_and_says_which():
    rng = np.random.default_rng(0)
    wall = [line((1000, -900), (1000, 900)) + rng.normal(0, 2, (90, 2)) * [1, 0] for _ in range(2)]
    with pytest.raises(ValueError, match=r"leave open for station 2 where it stands along (89|90|91) degrees"):
        refine_poses(stations(np.zeros((2, 3)), wall))
    slanted = [p @ np.array([[0.8, 0.6], [-0.6, 0.8]]) for p in wall]  # the wall now runs along 127 degrees
    with pytest.raises(ValueError, match=r"stands along 12[678] degrees"):
        refine_poses(stations(np.zeros((2, 3)), slanted))
    corner = [np.concatenate([p, line((990, 900), (-500, 900)) + rng.normal(0, 2, (90, 2)) * [0, 1]]) for p in wall]
    assert refine_poses(stations(np.zeros((2, 3)), corner)).rms_after_mm < 5


def test_a_round_room_leaves_the_turn_open():
    angles = np.radians(np.arange(360))
    ring = 1500 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    with pytest.raises(ValueError, match="station 2 the direction in which it looks"):
        refine_poses(stations(np.zeros((2, 3)), [ring, ring]))


def test_stations_that_see_nothing_in_common_are_named():
    scans = [walks.scan_mm(k) for k in (1, 3, 4)]
    start = TRUE[[0, 2, 3]]
    start[2, 0] += 9000
    with pytest.raises(ValueError, match="stations 3 have nothing in common with that of station 1"):
        refine_poses(stations(start, scans))
    with pytest.raises(ValueError, match="two stations or more, got 1"):
        refine_poses(stations(TRUE[:1], scans[:1]))
    with pytest.raises(ValueError, match="scan of station 2 has 3 readings"):
        refine_poses(stations(TRUE[:2], [scans[0], scans[1][:3]]))
    with pytest.raises(ValueError, match="station 1 has no straight bit"):
        refine_poses(stations(TRUE[:2], [np.random.default_rng(0).uniform(-2000, 2000, (300, 2)), scans[1]]))
