"""A board's pose: the minimum itself, and no pose where corners tell none."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from stereolib.calibration import board_pose, board_poses


def test_pose_of_a_board_is_the_minimum_to_rounding(views, rig):
    rng, board, corners = np.random.default_rng(3), views.board.points_mm.astype(float), views.left_px[0].astype(float)
    turn, shift = board_pose(board, corners, rig.left)
    _, bare_turn, bare_shift = cv2.solvePnP(board, corners, rig.left.K, rig.left.dist)
    np.testing.assert_allclose(turn, bare_turn[:, 0], atol=1e-5)
    np.testing.assert_allclose(shift, bare_shift[:, 0], atol=1e-2)
    pixels, J = cv2.projectPoints(board, turn, shift, rig.left.K, rig.left.dist)
    slope = J[:, :6].T @ (corners - pixels[:, 0]).ravel() / np.linalg.norm(J[:, :6], axis=0)
    assert np.abs(slope).max() < 1e-9  # px
    shaken = corners * (1 + 1e-15 * rng.standard_normal(corners.shape))
    np.testing.assert_allclose(board_pose(board, shaken, rig.left)[1], shift, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda b, c: (b, np.full_like(c, np.nan)), "leave out those that are NaN"),
        (lambda b, c: (b[:3], c[:3]), "3 corners tell no pose: it takes 4 at least"),
        (lambda b, c: (b, c[:50]), r"got \(54, 3\) and \(50, 2\)"),
        (lambda b, c: (b, 0 * c + c[0]), "54 corners tell no pose"),
        (lambda b, c: (b[:9], c[:9]), "9 corners tell no pose: .* not all on one line"),
        (lambda b, c: (b[[0, 5, 20, 30, 50]] + np.diag([0.0, 0, 9, 9, 9])[:, 2:], c[:5]), "it takes 6 at least"),
    ],
)
def test_corners_that_tell_no_pose_are_refused(views, rig, change, text):
    points, corners = change(views.board.points_mm.astype(float), views.left_px[0].astype(float))
    with pytest.raises(ValueError, match=text):
        board_pose(points, corners, rig.left)


def test_a_pose_is_refined_to_rounding_from_where_opencv_stops(views, rig):
    for corners in views.left_px[:3].astype(float):
        turn, shift = board_pose(views.board.points_mm, corners, rig.left)
        points = views.board.points_mm @ cv2.Rodrigues(turn)[0].T + shift
        pixels, J = cv2.projectPoints(views.board.points_mm.astype(float), turn, shift, rig.left.K, rig.left.dist)
        step = np.linalg.lstsq(J[:, :6], (corners - pixels[:, 0]).ravel(), rcond=None)[0]
        assert np.abs(step[:3]).max() < 1e-12 and np.abs(step[3:]).max() < 1e-9
        np.testing.assert_allclose(pixels[:, 0], rig.left.project(points), atol=1e-8)


@pytest.mark.parametrize("seed", [13, 21, 22, 30])
def test_a_pose_stays_where_opencv_found_it_if_steps_lead_away(views, rig, monkeypatch, seed):
    """Starts from which six Gauss-Newton steps end at an rms 4 % to thirty times larger."""
    board, corners = views.board.points_mm.astype(float), views.left_px[0].astype(float)
    _, turn, shift = cv2.solvePnP(board, corners, rig.left.K, rig.left.dist)
    rng = np.random.default_rng(seed)
    start = turn + rng.normal(0, 1.0, (3, 1)), shift * rng.uniform(0.2, 1.5, (3, 1))
    monkeypatch.setattr(board_poses.cv2, "solvePnP", lambda *_: (True, *start))

    def rms(turn, shift):
        pixels = cv2.projectPoints(board, turn, shift, rig.left.K, rig.left.dist)[0]
        return np.sqrt(np.mean((corners - pixels[:, 0]) ** 2))

    ended = board_pose(board, corners, rig.left)
    assert rms(*ended) <= rms(*start) * (1 + 1e-6)
