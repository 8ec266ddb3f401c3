"""The pair of cameras: epipolar geometry, rectification, triangulation, and the file it is kept in."""

from __future__ import annotations

import json
import re

import cv2
import numpy as np
import pytest

from stereolib.paper import paper_rig
from stereolib.rig import Camera, RectifiedRig, StereoRig


@pytest.fixture(scope="module")
def rig():
    return paper_rig()


@pytest.fixture(scope="module")
def rectified(rig):
    return rig.rectify()


@pytest.fixture(scope="module")
def points_mm():
    """Points in the left camera's frame that both cameras see, away from the fold of the right one."""
    rng = np.random.default_rng(2)
    z = rng.uniform(400, 2500, 300)
    return np.column_stack([rng.uniform(-0.25, 0.35, 300) * z, rng.uniform(-0.28, 0.28, 300) * z, z])


def in_right(rig, points_mm):
    return points_mm @ rig.R.T + rig.T


def homogeneous(xy):
    return np.column_stack([xy, np.ones(len(xy))])


def test_essential_matrix_on_random_points(rig, points_mm):
    right = in_right(rig, points_mm)
    x_left, x_right = points_mm / points_mm[:, 2:], right / right[:, 2:]
    np.testing.assert_allclose(np.einsum("ni,ij,nj->n", x_right, rig.E, x_left), 0, atol=1e-12)
    singular = np.linalg.svd(rig.E, compute_uv=False)  # two equal to |T|, one 0
    np.testing.assert_allclose(singular, [rig.baseline_mm, rig.baseline_mm, 0], atol=1e-9)


def test_fundamental_matrix_on_random_pixels(rig, points_mm):
    left, right = (
        homogeneous(Camera(c.K, [], c.size).project(p))
        for c, p in ((rig.left, points_mm), (rig.right, in_right(rig, points_mm)))
    )
    lines = left @ rig.F.T
    distance_px = (right * lines).sum(1) / np.hypot(*lines[:, :2].T)
    np.testing.assert_allclose(distance_px, 0, atol=1e-9)
    assert np.linalg.det(rig.F) == pytest.approx(0, abs=1e-18)


@pytest.mark.parametrize("alpha", [0.0, 0.5, 1.0])
def test_rectified_rows_agree_and_columns_give_the_depth(rig, points_mm, alpha):
    rectified = rig.rectify(alpha)
    left = rectified.rectify_points(rig.left.project(points_mm), "left")
    right = rectified.rectify_points(rig.right.project(in_right(rig, points_mm)), "right")
    np.testing.assert_allclose(left[:, 1], right[:, 1], atol=1e-7)
    disparity = left[:, 0] - right[:, 0]
    assert (disparity > 0).all()
    depth = (points_mm @ rectified.R1.T)[:, 2]
    np.testing.assert_allclose(rectified.f_px * rectified.baseline_mm / disparity, depth, rtol=1e-9)
    xyzw = np.column_stack([left, disparity, np.ones(len(left))]) @ rectified.Q.T
    np.testing.assert_allclose(xyzw[:, :3] / xyzw[:, 3:], points_mm @ rectified.R1.T, rtol=1e-8, atol=1e-6)


def test_against_opencvs_triangulation(rig, rectified, points_mm):
    left = rectified.rectify_points(rig.left.project(points_mm), "left")
    right = rectified.rectify_points(rig.right.project(in_right(rig, points_mm)), "right")
    xyzw = cv2.triangulatePoints(rectified.P1, rectified.P2, left.T, right.T)
    np.testing.assert_allclose((xyzw[:3] / xyzw[3]).T @ rectified.R1, points_mm, rtol=1e-7, atol=1e-5)
    ours = rectified.triangulate(left, left[:, 0] - right[:, 0])
    np.testing.assert_allclose(ours, (xyzw[:3] / xyzw[3]).T, rtol=1e-7, atol=1e-5)


def test_rectification_keeps_the_baseline_and_magnifies(rig, rectified):
    assert rectified.baseline_mm == pytest.approx(rig.baseline_mm, rel=1e-12)
    assert rig.baseline_mm == pytest.approx(np.sqrt(93.1032**2 + 1.2802**2 + 0.1104**2), rel=1e-12)
    assert rectified.f_px == pytest.approx(763.7, abs=0.05)
    assert rig.rectify(alpha=1).f_px < 731 < rectified.f_px


def test_every_pixel_is_valid_at_alpha_0(rig, rectified):
    white = np.full((480, 640), 255, np.uint8)
    for image in rectified.rectify(white, white):
        assert (image == 255).mean() > 0.999
    assert min((image == 255).mean() for image in rig.rectify(alpha=1).rectify(white, white)) < 0.99


@pytest.mark.parametrize("side", ["left", "right"])
def test_images_are_moved_as_points_are(rig, rectified, side):
    """Waves along the columns (rows): the rectified picture tells where each pixel came from, to a tenth of a pixel."""
    camera = getattr(rig, side)
    R, P = (rectified.R1, rectified.P1) if side == "left" else (rectified.R2, rectified.P2)
    u, v = np.meshgrid(np.arange(20, 620, 7), np.arange(20, 460, 7))
    rays = (homogeneous(np.column_stack([u.ravel(), v.ravel()])) @ np.linalg.inv(P[:, :3]).T) @ R
    origin = camera.project(rays)
    for axis, length in ((0, 640), (1, 480)):
        for period_px in (40, 57):  # no two places within 2000 px look alike in both

            def wave(at, period_px=period_px):
                return 127 + 120 * np.sin(2 * np.pi * at / period_px)

            stripes = np.rint(wave(np.arange(length))).astype(np.uint8)
            picture = np.broadcast_to(stripes if axis == 0 else stripes[:, None], (480, 640)).copy()
            pair = (picture, 0 * picture) if side == "left" else (0 * picture, picture)
            moved = rectified.rectify(*pair)[side == "right"][v.ravel(), u.ravel()]
            inside = ((origin > 1) & (origin < [638, 478])).all(1)
            assert inside.mean() > 0.95
            np.testing.assert_allclose(moved[inside], wave(origin[inside, axis]), atol=2)  # 19 grey levels a pixel


def test_points_go_through_and_back(rectified):
    """Pixels without a direction come back as NaN, all others where OpenCV's own maps fetch them from."""
    pixels = np.array([[639.0, 479.0], [320, 240]])
    out = rectified.rectify_points(pixels, "right")
    assert np.isnan(out[0]).all()
    camera = rectified.rig.right
    map_x, map_y = cv2.initUndistortRectifyMap(camera.K, camera.dist, rectified.R2, rectified.P2, (640, 480), 5)
    around = np.rint(out[1]).astype(int)
    slope = [[(m[around[1], around[0] + 1] - m[around[1], around[0]]) for m in (map_x, map_y)]]
    assert np.abs(np.array([map_x[*around[::-1]], map_y[*around[::-1]]]) - pixels[1]).max() < np.abs(slope).max()


@pytest.mark.parametrize(
    ("left", "right", "text"),
    [
        (np.zeros((640, 480)), np.zeros((640, 480)), "the left image is 480x640, .* for 640x480: it lies on its side"),
        (np.zeros((480, 640)), np.zeros((240, 320)), "the right image is 320x240, the calibration is for 640x480"),
        (np.zeros((640, 480)), np.zeros((480, 640)), "the left image is 480x640"),
        (np.zeros((480, 640)), np.zeros((480, 640, 3)), "one image is grey, the other in colour"),
    ],
)
def test_refuses_images(rectified, left, right, text):
    with pytest.raises(ValueError, match=text):
        rectified.rectify(left.astype(np.uint8), right.astype(np.uint8))


def test_refuses_points_of_another_orientation(rectified):
    with pytest.raises(ValueError, match=r"\(2, 3\): transpose it"):
        rectified.rectify_points(np.ones((2, 3)), "left")
    with pytest.raises(ValueError, match=r"\(2, 3\): transpose it"):
        rectified.triangulate(np.ones((2, 3)), [1, 2, 3])
    with pytest.raises(ValueError, match="got 2 pixels and 3 disparities"):
        rectified.triangulate(np.ones((2, 2)), [1, 2, 3])


def test_refuses_bad_rigs(rig):
    with pytest.raises(ValueError, match="R is not a rotation"):
        StereoRig(rig.left, rig.right, np.round(rig.R, 3), rig.T)
    with pytest.raises(ValueError, match="R is not a rotation"):
        StereoRig(rig.left, rig.right, np.diag([1.0, 1, -1]), rig.T)
    with pytest.raises(ValueError, match=r"differ in size: \(640, 480\) and \(320, 240\)"):
        StereoRig(rig.left, Camera(rig.right.K, [], (320, 240)), rig.R, rig.T)
    with pytest.raises(ValueError, match=r"T must be \(3,\)"):
        StereoRig(rig.left, rig.right, rig.R, [1, 2])
    with pytest.raises(ValueError, match="alpha must lie between"):
        rig.rectify(alpha=-1)
    with pytest.raises(ValueError, match='side must be "left" or "right"'):
        rig.rectify().rectify_points(np.zeros((1, 2)), "middle")


@pytest.mark.parametrize("T", [[-0.06, 0, 0], [0, 0, 0]])
def test_a_baseline_in_metres_is_refused(rig, T, tmp_path):
    with pytest.raises(ValueError, match=r"T is 0(\.06)? mm long.*metres times 1000"):
        StereoRig(rig.left, rig.right, rig.R, T)
    path = tmp_path / "metres.json"
    path.write_text(broken(lambda r: r.update(T_mm=T)))
    with pytest.raises(ValueError, match=r"metres\.json.*no two lenses stand so near.*metres times 1000"):
        StereoRig.load(path)
    assert StereoRig(rig.left, rig.right, rig.R, [-1.0, 0, 0]).baseline_mm == 1


def test_centres_that_differ_are_refused(rig):
    lenses = rig.left.K, rig.left.dist, rig.right.K, rig.right.dist, rig.left.size, rig.R, rig.T[:, None]
    for flags in (0, cv2.CALIB_ZERO_DISPARITY):
        R1, R2, P1, P2, Q, *_ = cv2.stereoRectify(*lenses, flags=flags, alpha=0)
        if flags:
            assert RectifiedRig(rig, R1, R2, P1, P2, Q).baseline_mm == pytest.approx(rig.baseline_mm)
            continue
        off_px = abs(P1[0, 2] - P2[0, 2])
        assert off_px > 1
        with pytest.raises(ValueError, match=rf"P1 and P2 differ by {off_px:.3g} px .*StereoRig\.rectify, .*ZERO_DISP"):
            RectifiedRig(rig, R1, R2, P1, P2, Q)


def test_a_rig_turns_no_pictures(rig):
    picture = np.zeros((480, 640), np.uint8)
    for pictures in ((picture, picture), (picture,), (0.0, picture), ("0",), (None,)):
        with pytest.raises(ValueError, match=r"makes the RectifiedRig: rig\.rectify\(\)\.rectify\(left, right\) turns"):
            rig.rectify(*pictures)
    for alpha in (0, np.float32(0), np.int64(0)):
        np.testing.assert_array_equal(rig.rectify(alpha).P1, rig.rectify().P1)


@pytest.mark.parametrize("T", [[93.0, 1, 0], [-1.0, 93, 0]])
def test_refuses_to_rectify_exchanged_or_stacked_cameras(rig, T):
    with pytest.raises(ValueError, match="to the right of the left"):
        StereoRig(rig.left, rig.right, rig.R, T).rectify()


def test_file_keeps_every_digit(rig, tmp_path):
    path = rig.save(tmp_path / "rig.json")
    again = StereoRig.load(path)
    for name in ("R", "T"):
        np.testing.assert_array_equal(getattr(again, name), getattr(rig, name))
    for side in ("left", "right"):
        one, two = getattr(again, side), getattr(rig, side)
        np.testing.assert_array_equal(one.K, two.K)
        np.testing.assert_array_equal(one.dist, two.dist)
        assert one.size == two.size
    assert again.save(tmp_path / "again.json").read_bytes() == path.read_bytes()
    assert json.loads(path.read_text())["format"] == "stereolib.rig/1"


def broken(change):
    camera = {"K": [[700, 0, 320], [0, 700, 240], [0, 0, 1]], "dist": [], "size": [640, 480]}
    rig = {
        "format": "stereolib.rig/1",
        "left": camera,
        "right": dict(camera),
        "R": np.eye(3).tolist(),
        "T_mm": [-90, 0, 0],
    }
    change(rig)
    return json.dumps(rig)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "not a JSON file"),
        (b"{", "not a JSON file"),
        (b"[" * 5000, "not a JSON file (nested more than 64 deep"),
        (b"\xe9", "not a text file in UTF-8"),
    ],
)
def test_files_of_another_kind_are_named(content, why, tmp_path):
    path = tmp_path / "bad_rig.json"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=re.escape(f"bad_rig.json: {why}") + ".*`stereolib calibrate` makes"):
        StereoRig.load(path)


@pytest.mark.parametrize(
    "text",
    [
        "[1, 2]",
        '"text"',
        broken(lambda r: r.update(format="other/1")),
        broken(lambda r: r.pop("R")),
        broken(lambda r: r.pop("left")),
        broken(lambda r: r.update(left=None)),
        broken(lambda r: r["left"].update(size=[640])),
        broken(lambda r: r["left"].update(size=[float("inf"), 480])),
        broken(lambda r: r["left"].update(size=640)),
        broken(lambda r: r["left"].update(K="abc")),
        broken(lambda r: r["left"].update(dist=[1, 2, 3])),
        broken(lambda r: r["left"].update(dist=[float("nan")] * 5)),
        broken(lambda r: r.update(R=[[1, 0.1, 0], [0, 1, 0], [0, 0, 1]])),
        broken(lambda r: r.update(T_mm=[[1], [2, 3]])),
    ],
)
def test_bad_files_are_named(text, tmp_path):
    path = tmp_path / "bad_rig.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"bad_rig\.json is not a rig file of stereolib.*`stereolib calibrate` makes"):
        StereoRig.load(path)


def test_a_picture_is_no_rig(tmp_path):
    (tmp_path / "x.jpg").write_bytes(b"\xff\xd8\xff" + bytes(5000))
    with pytest.raises(ValueError) as caught:
        StereoRig.load(tmp_path / "x.jpg")
    assert len(str(caught.value)) < 200


def test_a_good_file_of_the_same_kind_is_read(tmp_path):
    path = tmp_path / "good.json"
    path.write_text(broken(lambda r: None))
    rig = StereoRig.load(path)
    for camera in (rig.left, rig.right):
        assert (camera.K.tolist(), camera.size) == ([[700, 0, 320], [0, 700, 240], [0, 0, 1]], (640, 480))
        assert not camera.dist.any()
    assert (rig.R.tolist(), rig.T.tolist(), rig.baseline_mm) == (np.eye(3).tolist(), [-90, 0, 0], 90)


@pytest.mark.parametrize("alpha", [-0.1, 1.1, float("nan")])
def test_alpha_lies_between_valid_and_all_pixels(rig, alpha):
    with pytest.raises(ValueError, match="alpha must lie between 0"):
        rig.rectify(alpha=alpha)
