"""Triangulation and sizes: exact points come back, a wrong board is wrong by exactly as much."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.corners import corner_set, draw_rig

from stereolib.calibration import Charuco, board_size, bundle_adjustment
from stereolib.rig import Camera, StereoRig
from stereolib.virtual.recordings import BOARD


@pytest.fixture(scope="module")
def rig():
    return draw_rig(np.random.default_rng(3))


def test_points_come_back(rig):
    points = np.random.default_rng(0).uniform([-80, -120, 500], [200, 120, 1500], (50, 3))
    pixels = rig.left.project(points), rig.right.project(points @ rig.R.T + rig.T)
    np.testing.assert_allclose(board_size.triangulate(rig, *pixels), points, atol=1e-6)


def test_parallel_lines_of_sight_meet_nowhere_and_cost_no_other_point():
    camera = Camera([[700, 0, 320], [0, 700, 240], [0, 0, 1]], [], (640, 480))
    rig = StereoRig(camera, camera, np.eye(3), [-90.0, 0, 0])
    left, right = (
        [[320, 240.0], [np.nan, 240], [390, 240], [320, 240]],
        [[320, 240.0], [320, 240], [320, 240], [390, 240]],
    )
    points = board_size.triangulate(rig, left, right)
    assert np.isnan(points[:2]).all()
    np.testing.assert_allclose(points[2:, 2], [900, -900])


def test_size_of_a_scaled_board_is_off_by_the_scale():
    assert board_size.board_size_error_pct(BOARD.points_mm * 1.01, BOARD) == pytest.approx((1.0, 1.0), abs=1e-3)
    wide = BOARD.points_mm * [1.02, 1, 1]
    assert board_size.board_size_error_pct(wide, BOARD) == pytest.approx(
        (2 * 48 / 93, 2.0), abs=1e-3
    )  # 48 of 93 edges lie so


def test_noise_is_not_taken_for_size():
    rng = np.random.default_rng(1)
    for larger_pct in (0.0, 1.0):
        points_mm = (1 + larger_pct / 100) * BOARD.points_mm
        noisy = [board_size.board_size_error_pct(points_mm + rng.normal(0, 0.5, (54, 3)), BOARD) for _ in range(200)]
        # the mean of single edges would read 0.04 % more for each 0.5 mm squared
        np.testing.assert_allclose(np.mean(noisy, axis=0), larger_pct, atol=0.06)


def test_missing_corners_are_no_error():
    board = Charuco(6, 6, 30.0, 20.0)
    points = board.points_mm.astype(float)
    points[[0, 5, 14]] = np.nan
    assert board_size.board_size_error_pct(points, board) == pytest.approx((0, 0), abs=1e-6)
    assert np.isnan(board_size.board_size_error_pct(np.full((36, 3), np.nan), board)).all()


def test_leave_one_out_is_that_of_refits(rig):
    views = corner_set(np.random.default_rng(4), rig=rig, pairs=12)
    fitted = bundle_adjustment.fit_rig(views, rig)
    sizes = board_size.left_out_size_errors(views, fitted)
    assert sizes.square_error_pct < 0.1
    for k in (1, 8):
        rest = bundle_adjustment.fit_rig(views.only([i for i in range(12) if i != k]), fitted.rig).rig
        points = board_size.triangulate(rest, views.left_px[k], views.right_px[k])
        np.testing.assert_allclose(
            (sizes.square_pct[k], sizes.board_pct[k]), board_size.board_size_error_pct(points, BOARD), atol=0.01
        )


def test_other_size_of_square_scales_the_rig_and_hides(rig):
    """Why a ruler is needed: with a wrong square everything fits, and the baseline is wrong by the same factor."""
    views = corner_set(np.random.default_rng(4), rig=rig, pairs=12)
    fitted = bundle_adjustment.fit_rig(views, rig)
    larger = replace(views, board=replace(BOARD, square_mm=30.0))
    start = type(rig)(rig.left, rig.right, rig.R, rig.T * 1.2)
    again = bundle_adjustment.fit_rig(larger, start)
    assert again.rms_px == pytest.approx(fitted.rms_px, rel=1e-4)
    assert again.rig.baseline_mm == pytest.approx(1.2 * fitted.rig.baseline_mm, rel=1e-4)
    assert board_size.left_out_size_errors(larger, again).square_error_pct < 0.1
