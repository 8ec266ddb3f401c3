"""What a calibration leaves open in rectified pictures: against calibrations from other corners."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.corners import corner_set

from stereolib.calibration import (
    DisparityErrors,
    fit_rig,
    rectified_std,
    rig_covariance,
    rig_parameter_names,
    triangulate,
)
from stereolib.calibration.bundle_adjustment import moved_rig
from stereolib.calibration.uncertainty import triangulation_jacobian
from stereolib.paper import paper_rig
from stereolib.rig import Camera, StereoRig

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


def test_rectified_errors_of_single_parameters():
    """A principal point shifts all disparities, a longer T only the baseline, and a focal length only itself."""
    rig = paper_rig()
    rectified, names = rig.rectify(0.0), rig_parameter_names(rig)
    zoom = rectified.f_px / np.mean([camera.K[i, i] for camera in (rig.left, rig.right) for i in (0, 1)])

    def moved_by(rectified=rectified, **parts):
        moves = np.array([parts.get(name.replace(" ", "_"), 0.0) for name in names])
        found = rectified_std(rectified, np.outer(moves, moves))
        return {name: found[name] for name in ("f_px", "baseline_mm", "offset_px")}

    assert moved_by(right_cx=0.5) == pytest.approx(
        {"f_px": 0, "baseline_mm": 0, "offset_px": 0.5 * zoom}, rel=0.02, abs=2e-3
    )
    along = rig.T / rig.baseline_mm
    longer = moved_by(**{f"T{axis}": 0.2 * part for axis, part in zip("xyz", along, strict=True)})
    assert longer == pytest.approx({"f_px": 0, "baseline_mm": 0.2, "offset_px": 0}, abs=2e-3)
    left, right = (Camera(camera.K, 0 * camera.dist, camera.size) for camera in (rig.left, rig.right))
    plain = StereoRig(left, right, rig.R, rig.T).rectify(0.0)  # a lens that distorts spreads its rays a little more
    focal = moved_by(plain, **{f"{side}_f{axis}": 2.0 for side in ("left", "right") for axis in "xy"})
    share = 2.0 / np.mean([left.K[i, i] for i in (0, 1)])  # of the left picture, in which lengths are taken
    assert (focal["f_px"], focal["baseline_mm"]) == pytest.approx((share * plain.f_px, 0), abs=1e-2)
    # A turn of the right camera about y and the opposite shift of its principal point cancel, but for the middle.
    turn = 0.5 / rig.right.K[0, 0]
    both = [moved_by(right_cx=0.5, Ry=sign * turn)["offset_px"] for sign in (-1, 1)]
    assert min(both) < 0.1 * max(both)


def test_what_is_stated_of_a_height_is_near_what_the_calibration_knows_of_it():
    """An upright length before the camera hangs on baseline and offset together, as the whole covariance knows them."""
    rig = paper_rig()
    shares = []
    for seed in range(3):
        fit = fit_rig(corner_set(np.random.default_rng([seed, 11]), rig=rig), rig)
        rectified, covariance = fit.rig.rectify(0.0), rig_covariance(fit, method="corners")
        told, correlation = rectified_std(rectified, covariance), np.eye(3)
        std = [told[name] for name in ("f_px", "baseline_mm", "offset_px")]
        correlation[np.triu_indices(3, 1)] = told["correlation"]
        stated = np.outer(std, std) * (correlation + correlation.T - np.eye(3))
        for depth_mm in (700.0, 1000.0):
            ends = fit.rig.left.rays(np.array([[340.0, 240.0]])) * depth_mm + np.array([[0, 80.0, 0], [0, -80.0, 0]])
            low, high = triangulation_jacobian(fit.rig, ends)[:, 1]
            known = np.sqrt((high - low) @ covariance @ (high - low)) / 160
            slope = np.array([0, 1 / rectified.baseline_mm, depth_mm / rectified.f_px / rectified.baseline_mm])
            shares.append(np.sqrt(slope @ stated @ slope) / known)
    assert 0.7 < np.median(shares) < 2.3


def test_stated_errors_are_those_of_many_calibrations():
    """Offset and baseline of rigs calibrated from different corners, against what one of them states."""
    rig = paper_rig()
    fits = [fit_rig(corner_set(np.random.default_rng([k, 9]), rig=rig), rig) for k in range(12)]
    stated = rectified_std(fits[0].rig.rectify(0.0), rig_covariance(fits[0]))
    assert np.std([f.rig.baseline_mm for f in fits], ddof=1) == pytest.approx(stated["baseline_mm"], rel=0.6)
    points = rig.left.rays(np.stack(np.meshgrid([120.0, 320, 520], [100.0, 240, 380]), -1).reshape(-1, 2)) * 5000
    left, right = rig.left.project(points), rig.right.project(points @ rig.R.T + rig.T)
    scale = rig.rectify(0.0).f_px * rig.baseline_mm
    shifts = [scale * np.mean(1 / triangulate(f.rig, left, right)[:, 2] - 1 / points[:, 2]) for f in fits]
    assert np.std(shifts, ddof=1) == pytest.approx(stated["offset_px"], rel=0.6)


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


def test_points_and_lengths_err_by_what_is_stated(calibrated):
    """Depths, and lengths between points at one depth and at two, in the middle of the picture and beside it."""
    truth, every = calibrated
    ends = AHEAD_MM * np.array([[0.0, 0.0, 1.0], [-0.25, 0.0, 1.0], [0.25, 0.15, 1.0], [0.1, -0.15, 1.4]])
    depth_z, length_z = [], []
    for errors in every:
        pixels, disparity = seen_by(truth, errors.rectified, ends)
        found, moved = errors.rectified.triangulate(pixels, disparity), errors.of_points(*pixels.T, disparity)
        true = ends @ errors.rectified.R1.T
        depth_z.append((found - true)[:, 2] / np.linalg.norm(moved[:, 2], axis=1))
        for i, j in ((0, 1), (1, 2), (0, 3)):
            length = np.linalg.norm(found[i] - found[j])
            along = (found[i] - found[j]) / length @ (moved[i] - moved[j])
            length_z.append((length - np.linalg.norm(ends[i] - ends[j])) / np.linalg.norm(along))
    for z in (depth_z, length_z):
        assert 0.5 < np.sqrt(np.mean(np.square(z))) < 1.4


def test_rows_err_as_a_rig_that_was_moved_rectifies_them():
    """By each parameter: pixels stay, and are rectified by the moved rig."""
    rig = paper_rig()
    rectified, u = rig.rectify(), np.array([150.0, 320.0, 320.0, 540.0, 600.0])
    v, disparity = np.array([80.0, 240.0, 400.0, 60.0, 430.0]), np.array([40.0, 60.0, 25.0, 90.0, 30.0])
    points = rectified.triangulate(np.stack([u, v], axis=1), disparity) @ rectified.R1
    left, right = rig.left.project(points), rig.right.project(points @ rig.R.T + rig.T)
    names = rig_parameter_names(rig)
    told = DisparityErrors(rectified, np.eye(len(names))).of_rows(u, v, disparity)
    told = told @ np.linalg.inv(DisparityErrors(rectified, np.eye(len(names)))._root)
    for k, name in enumerate(names):
        step = np.eye(len(names))[k] * (1e-2 if name[-2:] in ("fx", "fy", "cx", "cy", "Tx", "Ty", "Tz") else 1e-5)
        rows = []
        for sign in (1, -1):
            other = moved_rig(rig, sign * step).rectify()
            # what its rows are, in pixels of the first one: its scale and height may be others
            seen = [other.rectify_points(pixels, side)[:, 1] for pixels, side in ((left, "left"), (right, "right"))]
            rows.append((seen[1] - seen[0]) * rectified.f_px / other.f_px)
        np.testing.assert_allclose(
            told[:, k], (rows[0] - rows[1]) / (2 * step.sum()), rtol=2e-2, atol=2e-3, err_msg=name
        )
