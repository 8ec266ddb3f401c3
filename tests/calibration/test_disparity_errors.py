"""How disparities err from place to place: against calibrations from other corners."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.corners import corner_set

from stereolib.calibration import DisparityErrors, fit_rig, rig_covariance, rig_parameter_names
from stereolib.paper import paper_rig

PLACES = [(x, y) for x in (-0.2, 0.0, 0.2) for y in (-0.15, 0.1)]
SLANTS_RAD = (-0.7, 0.0, 0.5)
HALF_MM, AHEAD_MM = 100.0, 800.0


def face(at, slant_rad):
    """An upright square face before the left camera, turned about the vertical. (25, 3)."""
    side = np.linspace(-HALF_MM, HALF_MM, 5)
    across, down = (a.ravel() for a in np.meshgrid(side, side))
    sides = np.stack([across * np.cos(slant_rad), down, across * np.sin(slant_rad)], axis=1)
    return AHEAD_MM * np.array([*at, 1.0]) + sides


def seen_by(truth, rectified, points):
    """Pixels of points and their disparities as the true cameras see them and a calibration rectifies them."""
    left = rectified.rectify_points(truth.left.project(points), "left")
    right = rectified.rectify_points(truth.right.project(points @ truth.R.T + truth.T), "right")
    return left, left[:, 0] - right[:, 0]


def turn_and_tilt(points):
    """Of a face, against the line of sight to its middle, rad. (2,)."""
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle)[2][2]
    normal *= np.sign(normal[2])
    return np.arctan2(normal[:2], normal[2]) - np.arctan2(middle[:2], middle[2])


def stated(errors, pixels, disparity_px):
    """Standard deviations of turn and tilt (2,) of a face that is seen at these pixels."""
    x = np.column_stack([pixels - pixels.mean(axis=0), np.ones(len(pixels))])
    plane = np.linalg.lstsq(x, disparity_px, rcond=None)[0]
    moved = np.linalg.lstsq(x, errors.within(*pixels.T, disparity_px), rcond=None)[0]
    steps = np.diag([1e-5, 1e-5, 1e-3])

    def seen(plane):
        return turn_and_tilt(errors.rectified.triangulate(pixels, x @ plane))

    slopes = [(seen(plane + step) - seen(plane - step)) / (2 * step.sum()) for step in steps]
    return np.linalg.norm(np.transpose(slopes) @ moved, axis=1)


@pytest.fixture(scope="module")
def calibrated():
    """Rigs that were calibrated from other corners, each with what it states."""
    truth, found = paper_rig(), []
    for k in range(12):
        fitted = fit_rig(corner_set(np.random.default_rng([k, 77]), rig=truth, noise_px=0.15), truth)
        found.append(DisparityErrors(fitted.rig.rectify(), rig_covariance(fitted)))
    return truth, found


def test_faces_turn_and_tilt_by_what_is_stated(calibrated):
    truth, every = calibrated
    z = []
    for errors in every:
        rectified = errors.rectified
        for points in (face(at, slant) for at in PLACES for slant in SLANTS_RAD):
            left, disparity = seen_by(truth, rectified, points)
            believed = rectified.triangulate(left, disparity) @ rectified.R1
            off = turn_and_tilt(believed) - turn_and_tilt(points)
            z.append(off / stated(errors, left, disparity))
    turn, tilt = np.sqrt(np.mean(np.square(z), axis=0))
    assert 0.75 < turn < 1.3 and 0.75 < tilt < 1.3


def test_disparities_are_shifted_and_scaled_by_what_is_stated(calibrated):
    """At each place of the picture; a turn of all rays is no error."""
    truth, every = calibrated
    z = []
    for errors in every:
        rectified = errors.rectified
        for points in (face(at, 0.0) for at in PLACES):
            left, disparity = seen_by(truth, rectified, points)
            believed = rectified.triangulate(left, disparity)
            turn, _ = Rotation.align_vectors(*(a / np.linalg.norm(a, axis=1)[:, None] for a in (believed, points)))
            true = rectified.f_px * rectified.baseline_mm / turn.apply(points)[:, 2]
            by = np.array([true.mean() / rectified.f_px, true.mean() / rectified.baseline_mm, 1.0])
            z.append((disparity - true).mean() / np.sqrt(by @ errors.alike(*left.T) @ by))
    by_place = np.sqrt(np.mean(np.square(z).reshape(len(every), len(PLACES)), axis=0))
    assert by_place.min() > 0.5 and by_place.max() < 1.5


def test_what_scales_the_whole_scene_is_no_error_of_one_place():
    """A longer baseline is told of the whole picture; two focal lengths that differ turn what they see."""
    rig = paper_rig()
    rectified, names = rig.rectify(), rig_parameter_names(rig)
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(250, 390, 8), np.linspace(180, 300, 8)))
    plane = 60 + 0.03 * (u - 320) - 0.02 * (v - 240)

    def moved_by(**parts):
        move = np.array([parts.get(name.replace(" ", "_"), 0.0) for name in names])
        return float(np.linalg.norm(DisparityErrors(rectified, np.outer(move, move)).within(u, v, plane), axis=1).max())

    longer = {f"T{axis}": 0.01 * part for axis, part in zip("xyz", rig.T, strict=True)}
    assert moved_by(**longer) < 0.01 * moved_by(right_fx=0.01 * rig.right.K[0, 0])
    assert not moved_by()
