"""The joint fit against OpenCV's, its derivatives against differences, and leaving out against refitting."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from support.corners import corner_set

from stereolib.calibration import bundle_adjustment, calibrate_stereo
from stereolib.calibration.board_poses import board_poses
from stereolib.rig import Camera, StereoRig

TILTED = [0.06, -0.2, 7e-4, -1e-3, 0.05, 0.1, -0.05, 0.02, 1e-3, -5e-4, -1e-3, 4e-4, 0.01, -0.02]


@pytest.fixture(scope="module")
def fitted(views, rig):
    return bundle_adjustment.fit_rig(views, rig)


def test_meets_the_minimum_of_opencv(views, fitted):
    points = [views.board.points_mm] * len(views)
    left, right = ([c.reshape(-1, 1, 2) for c in corners] for corners in (views.left_px, views.right_px))
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-12)
    lenses = [part for side in (left, right) for part in cv2.calibrateCamera(points, side, views.size, None, None)[1:3]]
    rms, K1, d1, K2, d2, R, T, *_ = cv2.stereoCalibrate(
        points, left, right, *lenses, views.size, flags=cv2.CALIB_USE_INTRINSIC_GUESS, criteria=criteria
    )
    assert 0.98 * rms < fitted.rms_px <= (1 + 1e-6) * rms
    if cv2.__version__.startswith("4."):  # stops before the minimum
        return
    assert fitted.rms_px == pytest.approx(rms, rel=1e-6)
    std = np.sqrt(np.diag(bundle_adjustment.inverse_normal(fitted.normal.sum(axis=0)))) * fitted.sigma_px
    theirs = StereoRig(Camera(K1, d1, views.size), Camera(K2, d2, views.size), R, T)
    assert (np.abs(bundle_adjustment.rig_difference(fitted.rig, theirs)) < 0.05 * std).all()


@pytest.mark.parametrize("count", [0, 5, 8, 14])
def test_derivatives_are_those_of_differences(count):
    lens = Camera([[730, 0, 318], [0, 728, 235], [0, 0, 1]], np.array(TILTED[:count]), (640, 480))
    points = np.random.default_rng(0).uniform([-150, -100, 500], [150, 100, 900], (7, 3))
    pixels, by_point, by_lens = bundle_adjustment.project_with_derivatives(lens, points)
    np.testing.assert_allclose(pixels, lens.project(points), atol=1e-8)
    for k in range(3):
        step = 1e-3 * np.eye(3)[k]
        numeric = (lens.project(points + step) - lens.project(points - step)) / 2e-3
        np.testing.assert_allclose(by_point[..., k], numeric, atol=1e-5)
    for k in range(count):
        step = 1e-5 * np.eye(count)[k]
        up, down = (Camera(lens.K, lens.dist + s, lens.size).project(points) for s in (step, -step))
        np.testing.assert_allclose(by_lens[:, :, 4 + k], (up - down) / 2e-5, atol=2e-4)


def test_gradient_and_normal_are_those_of_the_sum_of_squares(views, rig):
    """Where poses follow, the sum of squares is ``c - 2 g d + d N d`` to second order."""
    away = bundle_adjustment.moved_rig(rig, np.full(24, 0.0))
    start = bundle_adjustment.fit_rig(views, away, free=False)
    for k in (0, 4, 11, 18, 21, 23):
        g, h = start.gradient.sum(axis=0)[k], start.normal.sum(axis=0)[k, k]
        size = 3 / np.sqrt(h)
        sums = []
        for sign in (-1, 1):
            step = np.zeros(24)
            step[k] = sign * size
            moved = bundle_adjustment.fit_rig(views, bundle_adjustment.moved_rig(rig, step), free=False)
            sums.append((moved.residuals_px**2).sum())
        middle = (start.residuals_px**2).sum()
        assert (sums[0] - sums[1]) / (4 * size) == pytest.approx(g, abs=0.01 * h * size)
        assert (sums[0] + sums[1] - 2 * middle) / (2 * size**2) == pytest.approx(h, rel=0.02)


def test_leaving_out_is_refitting(views, fitted):
    steps = fitted.without_each()
    for k in (0, 7, 14):
        rest = bundle_adjustment.fit_rig(views.only([i for i in range(len(views)) if i != k]), fitted.rig)
        refitted = bundle_adjustment.rig_difference(rest.rig, fitted.rig)
        spread = np.sqrt(np.diag(bundle_adjustment.inverse_normal(fitted.normal.sum(axis=0)))) * fitted.sigma_px
        np.testing.assert_allclose(steps[k] / spread, refitted / spread, atol=0.05)


def test_a_rational_lens_is_fitted_to_its_minimum():
    views = corner_set(np.random.default_rng(7), pairs=20, noise_px=0.1)
    fitted = calibrate_stereo(views, model="rational8").fit
    assert fitted.converged
    std = np.sqrt(np.diag(bundle_adjustment.inverse_normal(fitted.normal.sum(axis=0)))) * fitted.sigma_px
    moved = bundle_adjustment.rig_difference(bundle_adjustment.fit_rig(views, fitted.rig).rig, fitted.rig)
    assert (np.abs(moved) < 1e-3 * std).all()


def test_a_fit_says_that_its_steps_were_too_few(views, rig, fitted):
    start = bundle_adjustment.moved_rig(rig, np.r_[5.0, 5.0, np.zeros(22)])
    assert fitted.converged and not bundle_adjustment.fit_rig(views, start, iterations=1).converged


def test_a_step_takes_off_what_it_promised(views, rig):
    start = bundle_adjustment.fit_rig(views, rig, free=False)
    step = bundle_adjustment._solve(start.normal.sum(axis=0), start.gradient.sum(axis=0))
    moved = bundle_adjustment.fit_rig(views, bundle_adjustment.moved_rig(rig, step), free=False)
    assert start.squares_px2 - moved.squares_px2 == pytest.approx(start.promised_px2(step), rel=0.01)


def test_what_rounding_left_below_zero_is_not_known():
    """Near a pole of a rational lens the poses' part is subtracted to less than nothing."""
    normal = np.array([[4.0, 1e-8, 0], [1e-8, -1e-9, 0], [0, 0, 1e-12]])
    assert bundle_adjustment._solve(normal, np.array([8.0, 1.0, 1e-12])) == pytest.approx([2, 0, 1])
    assert bundle_adjustment.inverse_normal(normal)[1, 1] > 1e30


def test_steps_lead_there_and_back(rig):
    step = np.random.default_rng(4).normal(0, 1e-2, 24)
    np.testing.assert_allclose(
        bundle_adjustment.rig_difference(bundle_adjustment.moved_rig(rig, step), rig), step, atol=1e-12
    )


def test_corners_that_were_not_found_are_left_out(views, fitted):
    """A set with holes gives the rig within its uncertainty, and NaN goes nowhere."""
    rng, left = np.random.default_rng(5), views.left_px.copy()
    left[rng.random(left.shape[:2]) < 0.2] = np.nan
    holes = type(views)(views.board, views.size, left, views.right_px, views.names, ())
    found = calibrate_stereo(holes)
    std = np.sqrt(np.diag(bundle_adjustment.inverse_normal(fitted.normal.sum(axis=0)))) * fitted.sigma_px
    assert (np.abs(bundle_adjustment.rig_difference(found.rig, fitted.rig)) < 3 * std).all()
    assert np.isfinite(found.fit.residuals_px).all()
    assert found.fit.known[:, 0].mean() == pytest.approx(0.8, abs=0.05)


def test_the_misfit_of_each_pair_adds_up_to_that_of_all(views, fitted):
    each = fitted.pair_rms_px
    assert each.shape == (len(views), 2) and (each > 0).all()
    found = np.stack([views.left_px, views.right_px], axis=1)
    second = np.sqrt((fitted.residuals_px[1, 0] ** 2).sum() / found.shape[2])  # rms over distances, as `rms_px`
    assert each[1, 0] == pytest.approx(second)
    assert np.sqrt(np.mean(each**2)) == pytest.approx(fitted.rms_px)


@pytest.mark.parametrize("away_mm", [1e200, np.nan])
def test_a_pose_that_runs_away_gains_nothing(views, rig, away_mm, monkeypatch):
    """Corners that fit no board send it where no camera tells its place: its poses stay those of one camera."""
    step = bundle_adjustment._pose_step
    monkeypatch.setattr(bundle_adjustment, "_pose_step", lambda *args: (step(*args)[0], step(*args)[1] + away_mm))
    stays = bundle_adjustment.fit_rig(views, rig, free=False)
    assert stays.shifts == pytest.approx(board_poses(views.board.points_mm, views.left_px, rig.left)[1])
