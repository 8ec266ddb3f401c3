"""Lines and walls through points: of a known room, and of the real recording."""

from dataclasses import replace

import numpy as np
import pytest

from stereolib import laser
from stereolib.base import datasets


@pytest.fixture(scope="module")
def recording():
    try:
        return datasets.real_recording("xv11/hand_in_box.txt")
    except datasets.NotAvailable as reason:
        pytest.skip(str(reason))


def test_real_walls_are_straight_as_the_emitter_stands_beside_the_axis(recording):
    scans = [s for s in laser.turns(laser.read_recording(recording)) if s.complete]
    mean = laser.average(scans)

    def walls(points, threshold_mm):
        found = laser.fit_walls(points, 4, threshold_mm=threshold_mm, rng=np.random.default_rng(0))
        squares = np.concatenate([w.residuals_mm[w.inliers] ** 2 for w in found])
        return found, float(np.sqrt(squares.mean())), len(squares)

    corrected, rms_mm, used = walls(laser.points_mm(mean), 4.0)
    assert rms_mm <= 1.1 and used >= 340
    assert max(w.rms_mm for w in corrected) <= 1.85
    _, wide_rms_mm, wide_used = walls(laser.points_mm(mean), 6.0)
    assert wide_rms_mm <= 1.85 and wide_used >= 358
    _, plain_rms_mm, _ = walls(laser.points_mm(replace(mean, emitter_offset_mm=0.0)), 6.0)
    assert wide_rms_mm < 0.8 * plain_rms_mm
    angles = np.sort(np.rad2deg([np.arctan2(*w.normal[::-1]) for w in corrected]))
    np.testing.assert_allclose(np.diff(angles), 90, atol=3)


def test_walls_of_a_known_room():
    rng = np.random.default_rng(1)
    t = np.linspace(-1, 1, 120)
    room = np.concatenate([
        np.stack([np.full(120, 900.0), 700 * t], axis=1),
        np.stack([np.full(120, -600.0), 700 * t], axis=1),
        np.stack([750 * t + 150, np.full(120, 700.0)], axis=1),
        np.stack([750 * t + 150, np.full(120, -700.0)], axis=1),
    ])  # fmt: skip
    turn = np.deg2rad(17)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    points = (room + rng.normal(0, 1.0, room.shape)) @ rotation.T
    clutter = rng.uniform(-500, 500, (60, 2))
    walls = laser.fit_walls(np.concatenate([points, clutter]), 4, rng=rng)
    found = sorted((round(np.rad2deg(np.arctan2(*w.normal[::-1]))) % 360, w.offset_mm) for w in walls)
    assert [angle for angle, _ in found] == [17, 107, 197, 287]
    np.testing.assert_allclose([offset for _, offset in found], [900, 700, 600, 700], atol=0.5)
    for w in walls:
        assert w.inliers.sum() >= 115 and 0.8 < w.rms_mm < 1.3


def test_no_wall_is_none_to_fit():
    with pytest.raises(ValueError, match="count must be 1 wall or more, got 0"):
        laser.fit_walls(np.ones((9, 2)), 0, rng=np.random.default_rng(0))


def test_line_at_right_angles_not_along_y():
    line = laser.fit_line([[5, -100], [5, 0], [5, 200]])  # upright: no slope to speak of
    np.testing.assert_allclose(line.normal, [1, 0], atol=1e-12)
    assert line.offset_mm == pytest.approx(5) and line.rms_mm == pytest.approx(0, abs=1e-9)
    with_outlier = np.array([[10.0 * x, 10.0] for x in range(20)] + [[10.0, 60.0]])
    robust = laser.fit_line(with_outlier, threshold_mm=20)
    assert robust.inliers.tolist() == [True] * 20 + [False]
    assert robust.offset_mm == pytest.approx(10)
    with pytest.raises(ValueError, match="at least 2 finite points"):
        laser.fit_line([[1, 2]])
    with pytest.raises(ValueError, match="walls found"):
        laser.fit_walls(with_outlier[:20], 4, rng=np.random.default_rng(0))


@pytest.mark.parametrize("place", [[0.0, 0.0], [900.1, -300.7]])
def test_points_at_one_place_are_no_line(place):
    with pytest.raises(ValueError, match=r"all 3 points lie at .* through which any line goes"):
        laser.fit_line([place] * 3)
    line = laser.fit_line([place, [place[0], place[1] + 0.001]])
    np.testing.assert_allclose(np.abs(line.normal), [1, 0], atol=1e-6)
