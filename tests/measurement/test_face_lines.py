"""Lines of faces from laser and pair, and both in one: against the truth and least squares."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from support.boxes import FLOOR, HERE, X, the_faces, the_footprint

from stereolib.measurement import LaserOnFloor, SystematicUncertainty
from stereolib.measurement.face_lines import FaceLines, combined, pictured_lines, scanned_lines, without
from stereolib.rig import rigid
from stereolib.virtual import recordings


def test_the_laser_lines_hold_the_truth():
    off = []
    for seed in range(60):
        lines = scanned_lines(the_footprint(seed), HERE)
        assert lines is not None and lines.visible == (0, 1)
        off.append((lines.x - X) / np.sqrt(np.diag(lines.covariance)))
    assert 0.9 <= (np.abs(off) < 1.96).mean() <= 1.0


def test_a_moved_laser_gives_the_same_lines():
    turn = np.radians(7)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    here, moved = (
        scanned_lines(the_footprint(1), laser)
        for laser in (HERE, LaserOnFloor(R, np.array([30.0, -20.0]), HERE.covariance, bias_mm=0.0))
    )
    x = here.x.copy()
    x[0] += turn
    x[1:] += [np.array([np.cos(a), np.sin(a)]) @ [30, -20] for a in (x[0], x[0] - np.pi / 2)]
    np.testing.assert_allclose(moved.x, x, atol=1e-9)


def test_the_pair_s_lines_hold_the_truth():
    rng, off = np.random.default_rng(4), []
    for _ in range(200):
        lines = pictured_lines(the_faces(rng), FLOOR, SystematicUncertainty(face_px=0.0))
        off.append((lines.x - X) / np.sqrt(np.diag(lines.covariance)))
    assert 0.92 <= (np.abs(off) < 1.96).mean() <= 0.98


def test_combined_is_the_weighted_mean_that_least_squares_gives():
    rng = np.random.default_rng(5)
    scanned = scanned_lines(the_footprint(3), HERE)
    pictured = pictured_lines(the_faces(rng), FLOOR, SystematicUncertainty())
    lines, shares, text = combined(scanned, pictured)
    inverse = [np.linalg.inv(one.covariance) for one in (scanned, pictured)]
    expected = np.linalg.solve(sum(inverse), inverse[0] @ scanned.x + inverse[1] @ pictured.x)
    np.testing.assert_allclose(lines.x, expected, rtol=1e-9)
    np.testing.assert_allclose(lines.covariance, np.linalg.inv(sum(inverse)), rtol=1e-9)
    scan_pct = 100 * np.trace(np.linalg.solve(sum(inverse), inverse[0])) / 3
    assert text == "" and shares == f"scan {scan_pct:.0f} %, image {100 - scan_pct:.0f} %"
    assert scan_pct < 10  # the picture is the better one here


def test_one_face_finds_its_place_beside_two():
    both = FaceLines(X, np.diag([1e-6, 0.1, 0.1]))
    left = FaceLines(np.array([X[0] - np.pi / 2, X[2], np.nan]), np.diag([1e-6, 0.1, 0.0]))
    for a, b in ((both, left), (left, both)):
        lines, _, _ = combined(a, b)
        np.testing.assert_allclose(lines.x, X, atol=1e-9)
        assert lines.covariance[2, 2] < lines.covariance[1, 1]


def test_what_disagrees_is_said_with_both_values_and_not_mixed():
    pictured = FaceLines(X, np.diag([1e-6, 0.1, 0.1]))
    lines, shares, text = combined(FaceLines(X + np.array([0, 100, 100]), np.diag([1e-6, 0.1, 0.1])), pictured)
    assert lines is pictured and shares == "image" and f"{X[1] + 100:.0f} and {X[1]:.0f} mm" in text
    lines, _, text = combined(FaceLines(X + np.array([0, 0, 100]), np.diag([1e-6, 0.1, 0.1])), pictured)
    assert lines.visible == (0,) and lines.x[1] == pytest.approx(X[1]) and f"{X[2] + 100:.0f}" in text


def test_the_left_face_alone_becomes_the_right_one():
    alone = without(FaceLines(X, np.diag([1e-6, 0.1, 0.2])), 0)
    assert alone.visible == (0,) and alone.x[1] == X[2] and alone.covariance[1, 1] == 0.2
    np.testing.assert_allclose(alone.normal(0), FaceLines(X, np.eye(3)).normal(1), atol=1e-12)


def test_the_laser_s_pose_on_the_floor():
    pose = recordings.setup() @ rigid(
        [[np.cos(0.1), -np.sin(0.1), 0], [np.sin(0.1), np.cos(0.1), 0], [0, 0, 1]], [-40, 25, 60]
    )
    laser = LaserOnFloor.of(SimpleNamespace(T_left_lidar=pose, covariance=np.diag([0, 0, 1e-4, 4.0, 1.0, 9.0])), FLOOR)
    assert laser.yaw_rad == pytest.approx(0.1, abs=1e-6)
    np.testing.assert_allclose(laser.t, [-40, 25], atol=1e-6)
    np.testing.assert_allclose(np.linalg.eigvalsh(laser.covariance[:2, :2]), [1, 4])
    assert laser.covariance[2, 2] == pytest.approx(1e-4)
