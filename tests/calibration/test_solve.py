"""Known cameras come back: exactly from exact corners, within the promised bounds from the recorded boards."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from stereolib.calibration import (
    LENS_MODELS,
    BoardViews,
    calibrate_camera,
    calibrate_stereo,
    epipolar_errors_px,
    find_in_pairs,
)
from stereolib.calibration.lens_models import fold_inside
from stereolib.paper import paper_rig
from stereolib.rig import Camera, StereoRig, rigid
from stereolib.virtual import recordings

BOARD = recordings.BOARD
CENTRED_MM = (BOARD.points_mm - BOARD.points_mm.mean(axis=0)) * [1.0, -1.0, 1.0]  # in the virtual board's frame


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def projected(rig, poses):
    """True pixels of the corners, (poses, corners, 2) for the left and the right camera."""
    right = rigid(rig.R, rig.T)
    return tuple(
        np.array([c.project(CENTRED_MM @ (M @ T)[:3, :3].T + (M @ T)[:3, 3]) for T in poses])
        for c, M in ((rig.left, np.eye(4)), (rig.right, right))
    )


@pytest.fixture(scope="module")
def poses():
    return recordings.board_poses()


@pytest.fixture(scope="module")
def exact(poses):
    left, right = projected(paper_rig(), poses[:12])
    return BoardViews(BOARD, (640, 480), left, right, tuple(f"{i}" for i in range(12)), ())


@pytest.fixture(scope="module")
def recorded():
    """Corners of the committed boards, found once."""
    return find_in_pairs(*recordings.load_boards()[:1], BOARD, recordings.load_boards()[1], progress=False)


@pytest.fixture(scope="module")
def calibrated(recorded):
    return calibrate_stereo(recorded)


def test_exact_corners_give_the_exact_rig(exact):
    truth, found = paper_rig(), calibrate_stereo(exact)
    assert found.rms_px < 1e-3
    for side in ("left", "right"):
        single, joint, true = getattr(found, side).camera, getattr(found.rig, side), getattr(truth, side)
        for camera in (single, joint):
            np.testing.assert_allclose(camera.K, true.K, atol=0.02)
            np.testing.assert_allclose(camera.dist[:4], true.dist[:4], atol=2e-3)
    np.testing.assert_allclose(found.rig.R, truth.R, atol=2e-6)
    np.testing.assert_allclose(found.rig.T, truth.T, atol=2e-3)
    assert np.abs(epipolar_errors_px(found.rig.rectify(), exact)).max() < 1e-2
    assert np.abs(epipolar_errors_px(truth.rectify(), exact)).max() < 1e-4


@pytest.mark.parametrize("model", LENS_MODELS)
def test_every_lens_model_finds_a_lens_of_its_kind(model, poses):
    count = LENS_MODELS[model][0]
    dist = np.array([0.06, -0.2, 7e-4, -1e-3, 0.0, 0, 0, 0, 1e-3, 0, -1e-3, 0, 0.01, -0.02])[:count]
    lens = Camera(paper_rig().left.K, dist, (640, 480))
    corners = np.array([lens.project(CENTRED_MM @ T[:3, :3].T + T[:3, 3]) for T in poses[:12]])
    found = calibrate_camera(BOARD, corners, lens.size, model=model)
    assert found.camera.dist.size == count
    assert found.std.shape == (4 + count,)
    assert found.view_rms_px.shape == (12,)
    assert found.rms_px < 0.01
    np.testing.assert_allclose(np.diag(found.camera.K), np.diag(lens.K), rtol=2e-3)


def test_rms_is_that_of_a_projection_by_hand(exact):
    """Against corners with known noise, by OpenCV's own pose of every view."""
    corners = exact.left_px + np.random.default_rng(3).normal(0, 0.1, exact.left_px.shape)
    found = calibrate_camera(BOARD, corners, exact.size)
    per_view = []
    for view in corners:
        _, rvec, tvec = cv2.solvePnP(BOARD.points_mm, view, found.camera.K, found.camera.dist)
        rvec, tvec = cv2.solvePnPRefineLM(BOARD.points_mm, view, found.camera.K, found.camera.dist, rvec, tvec)
        pixels = cv2.projectPoints(BOARD.points_mm, rvec, tvec, found.camera.K, found.camera.dist)[0][:, 0]
        per_view.append(rms(np.hypot(*(pixels - view).T)))
    np.testing.assert_allclose(found.view_rms_px, per_view, rtol=2e-3)
    assert found.rms_px == pytest.approx(rms(per_view), rel=2e-3)
    assert found.rms_px == pytest.approx(0.1 * np.sqrt(2), rel=0.08)
    truth = paper_rig().left
    errors = found.camera.K[[0, 1, 0, 1], [0, 1, 2, 2]] - truth.K[[0, 1, 0, 1], [0, 1, 2, 2]]
    assert (np.abs(errors) < 4 * found.std[:4]).all()  # the standard deviations are of the right size
    assert (np.abs(errors) > 0.01 * found.std[:4]).any()


def test_recorded_boards_give_the_true_intrinsics(calibrated):
    """The promise: f within 0.1 %, principal point within 1 px."""
    for side in ("left", "right"):
        found, true = getattr(calibrated.rig, side).K, getattr(paper_rig(), side).K
        np.testing.assert_allclose(np.diag(found)[:2], np.diag(true)[:2], rtol=1e-3)
        np.testing.assert_allclose(found[:2, 2], true[:2, 2], atol=1)


def test_recorded_boards_give_the_true_baseline(calibrated):
    """The promise: within 0.05 mm; and the cameras turned against each other by less than 0.1 degrees."""
    truth = paper_rig()
    assert calibrated.rig.baseline_mm == pytest.approx(truth.baseline_mm, abs=0.05)
    assert np.degrees(np.linalg.norm(cv2.Rodrigues(calibrated.rig.R @ truth.R.T)[0])) < 0.1


def test_recorded_boards_are_rectified(calibrated, recorded):
    """The promise: rows agree within 0.1 px rms, by our calibration and by the true rig."""
    for rig in (calibrated.rig, paper_rig()):
        errors = epipolar_errors_px(rig.rectify(), recorded)
        assert errors.shape == (len(recorded), 54)
        assert rms(errors) < 0.1


def test_recorded_corners_are_where_they_were_rendered(recorded, poses):
    at = [int(name[-2:]) - 1 for name in recorded.names]
    assert len(at) >= 28
    for found, truth in zip((recorded.left_px, recorded.right_px), projected(paper_rig(), poses), strict=True):
        truth = truth[at]
        turned = np.linalg.norm(found[:, 0] - truth[:, 0], axis=1) > np.linalg.norm(found[:, 0] - truth[:, -1], axis=1)
        truth[turned] = truth[turned, ::-1]
        assert rms(np.linalg.norm(found - truth, axis=2)) < 0.1


def test_left_and_right_exchanged(exact):
    views = BoardViews(BOARD, exact.size, exact.right_px, exact.left_px, exact.names, ())
    with pytest.raises(
        ValueError, match="comes out 93 mm to the LEFT of the left one: the two image sets are exchanged"
    ):
        calibrate_stereo(views)


def test_left_and_right_the_same(exact):
    corners = exact.left_px.copy()
    corners[2, 5] = np.nan
    views = BoardViews(BOARD, exact.size, corners, corners.copy(), exact.names, ())
    with pytest.raises(ValueError, match="both are the same pictures"):
        calibrate_stereo(views)


def test_the_same_rig_comes_from_any_number_of_threads(recorded):
    some, before, found = recorded.only(range(0, len(recorded), 2)), cv2.getNumThreads(), []
    try:
        for threads in (1, 2, 2):
            cv2.setNumThreads(threads)
            rig = calibrate_stereo(some, model="rational8").rig
            assert cv2.getNumThreads() == threads
            found.append(np.concatenate([rig.left.dist, rig.right.dist, rig.T]))
    finally:
        cv2.setNumThreads(before)
    assert np.array_equal(found[0], found[1]) and np.array_equal(found[0], found[2])


def test_a_view_without_corners_is_refused_by_its_number(exact):
    corners = exact.left_px.copy()
    corners[4, 2:] = np.nan
    with pytest.raises(ValueError, match=r"too few corners of the board, .*: view 5; leave such"):
        calibrate_camera(BOARD, corners, exact.size)


def test_refuses(exact):
    with pytest.raises(ValueError, match="2 views of the board are too few: at least 3"):
        calibrate_camera(BOARD, exact.left_px[:2], exact.size)
    with pytest.raises(ValueError, match="2 views of the board are too few"):
        calibrate_stereo(exact.only([0, 1]))
    with pytest.raises(ValueError, match="all 5 views show the board in the same place"):
        calibrate_camera(BOARD, exact.left_px[[0] * 5], exact.size)
    unseen = exact.left_px[[0] * 5]
    unseen[:, 7] = np.nan  # in no view, as of a ChArUco board
    with pytest.raises(ValueError, match="all 5 views show the board in the same place"):
        calibrate_camera(BOARD, unseen, exact.size)
    with pytest.raises(ValueError, match="unknown lens model 'fisheye'; choose one of pinhole, brown2, brown3"):
        calibrate_camera(BOARD, exact.left_px, exact.size, model="fisheye")


RATIONAL = np.array([0.3, -0.2, 1e-3, -1e-3, 0.1, 0.35, -0.15, 0.05])


@pytest.fixture(scope="module")
def rational(poses):
    """Exact corners through lenses that need k4 to k6."""
    truth = paper_rig()
    left, right = (Camera(c.K, RATIONAL, c.size) for c in (truth.left, truth.right))
    rig = StereoRig(left, right, truth.R, truth.T)
    corners = projected(rig, poses[:15])
    return rig, BoardViews(BOARD, rig.left.size, *corners, tuple(f"{i}" for i in range(15)), ())


def test_fixed_lenses_keep_their_long_models(rational):
    """The trap: OpenCV drops k4 and up of fixed lenses unless it is told the model's flags again."""
    rig, views = rational
    found = calibrate_stereo(views, model="rational8", fixed=True)
    assert found.rms_px < 0.01
    np.testing.assert_allclose(found.rig.T, rig.T, atol=0.02)
    np.testing.assert_array_equal(found.rig.left.dist, found.left.camera.dist)  # fixed: those of the single camera
    points = [BOARD.points_mm] * len(views)
    images = [[np.float32(c).reshape(-1, 1, 2) for c in corners] for corners in (views.left_px, views.right_px)]
    lenses = [part for c in (rig.left, rig.right) for part in (c.K.copy(), c.dist[None].copy())]
    fixed = cv2.CALIB_FIX_INTRINSIC
    bare, told = (
        cv2.stereoCalibrate(points, *images, *lenses, views.size, flags=fixed | more)[0]
        for more in (0, LENS_MODELS["rational8"][1])
    )
    assert told < 0.01
    assert bare > 50 * told  # in silence


def test_joint_fit_frees_what_the_fixed_one_keeps(recorded):
    fixed, joint = (calibrate_stereo(recorded, fixed=choice) for choice in (True, False))
    assert joint.rms_px < fixed.rms_px
    assert fixed.left.camera is fixed.rig.left
    errors = [abs(c.rig.baseline_mm - paper_rig().baseline_mm) for c in (fixed, joint)]
    assert max(errors) < 0.2


def test_a_fold_is_found_where_it_is():
    """Table I's right lens folds in the lower right corner; every pixel there has no direction, the others have one."""
    assert fold_inside(paper_rig().left) is None
    right = paper_rig().right
    fold = fold_inside(right)
    u, v = np.meshgrid(np.arange(640), np.arange(480))
    lost = np.isnan(right.rays(np.column_stack([u.ravel(), v.ravel()]))[:, 0])
    assert fold.pixels == lost.sum() == pytest.approx(60, abs=1)
    assert fold.where == f"lower right corner ({fold.pixels} px)"
    assert str(fold).startswith("folds over in the lower right corner")
    radius = np.hypot(u.ravel()[lost] - right.K[0, 2], v.ravel()[lost] - right.K[1, 2]).min()
    assert fold.radius_px == pytest.approx(radius)


def test_a_strong_fold_is_found_in_every_corner():
    lens = Camera([[700, 0, 320], [0, 700, 240], [0, 0, 1]], [-0.9, 0, 0, 0, 0], (640, 480))
    fold = fold_inside(lens)
    assert fold.where.count("corner") == 4
    distorted = lens.fold_radius * (1 - 0.9 * lens.fold_radius**2)  # r g at d(r g)/dr = 0
    assert lens.fold_radius == pytest.approx(np.sqrt(1 / 2.7), abs=1e-3)
    assert fold.radius_px == pytest.approx(700 * distorted, abs=2)
