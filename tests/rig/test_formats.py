"""Files of other tools: rigs go out and come back to the last digit, in each tool's own convention."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from stereolib.paper import paper_rig
from stereolib.rig import Camera, StereoRig, formats, matlab_format

FLOATS = st.floats(-1, 1, allow_subnormal=False)


@st.composite
def rigs(draw: st.DrawFn, coefficients: tuple[int, ...] = (0, 4, 5, 8, 12, 14)) -> StereoRig:
    """Rigs with digits everywhere, right camera to the right; lenses weak enough to be rectified."""
    size = draw(st.sampled_from([(640, 480), (1281, 719)]))
    cameras = []
    for _ in range(2):
        fx, fy = 700 + 200 * draw(FLOATS), 700 + 200 * draw(FLOATS)
        K = [[fx, 0, size[0] / 2 + 30 * draw(FLOATS)], [0, fy, size[1] / 2 + 30 * draw(FLOATS)], [0, 0, 1]]
        dist = [0.01 * draw(FLOATS) for _ in range(draw(st.sampled_from(coefficients)))]
        cameras.append(Camera(np.array(K), np.array(dist), size))
    R, _ = cv2.Rodrigues(np.array([0.1 * draw(FLOATS) for _ in range(3)]))
    T = np.array([-90 + 30 * draw(FLOATS), 10 * draw(FLOATS), 10 * draw(FLOATS)])
    return StereoRig(cameras[0], cameras[1], R, T)


def assert_same(ours: StereoRig, other: StereoRig, *, R: float = 0.0, T_mm: float = 0.0) -> None:
    """Lenses equal bit by bit (missing coefficients are zeros), R and T within what the format rounds."""
    for a, b in ((ours.left, other.left), (ours.right, other.right)):
        assert a.size == b.size
        np.testing.assert_array_equal(a.K, b.K)
        np.testing.assert_array_equal(np.pad(a.dist, (0, 14 - a.dist.size)), np.pad(b.dist, (0, 14 - b.dist.size)))
    np.testing.assert_allclose(ours.R, other.R, rtol=0, atol=R)
    np.testing.assert_allclose(ours.T, other.T, rtol=0, atol=T_mm)


@given(rigs())
@settings(max_examples=40)
def test_our_own_file_keeps_every_bit(tmp_path_factory: pytest.TempPathFactory, rig: StereoRig) -> None:
    path = rig.save(tmp_path_factory.mktemp("rig") / "rig.json", calibration={"rms_px": 0.1})
    assert_same(rig, formats.load_rig(path))
    assert json.loads(path.read_text())["calibration"] == {"rms_px": 0.1}


def test_our_own_file_refuses_what_json_does_not_hold(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="JSON compliant"):
        paper_rig().save(tmp_path / "rig.json", calibration={"rms_px": float("nan")})
    assert not list(tmp_path.iterdir())


@given(rigs(), st.sampled_from(["rig.yml", "rig.xml"]))
@settings(max_examples=40)
def test_opencv_keeps_every_bit(tmp_path_factory: pytest.TempPathFactory, rig: StereoRig, name: str) -> None:
    assert_same(rig, formats.load_rig(formats.save_opencv(tmp_path_factory.mktemp("cv") / name, rig)))


@given(rigs(coefficients=(0, 4, 5, 8)))
@settings(max_examples=40)
def test_ros_keeps_every_bit_of_the_lenses_and_the_pose_to_rounding(
    tmp_path_factory: pytest.TempPathFactory, rig: StereoRig
) -> None:
    folder = tmp_path_factory.mktemp("ros")
    files = formats.save_ros(folder / "left.yaml", folder / "right.yaml", rig)
    assert_same(rig, formats.load_rig(*files), R=2e-15, T_mm=2e-13)


def test_ros_keeps_the_pose_of_nearly_parallel_cameras(tmp_path: Path) -> None:
    # cv2.stereoRectify takes turns below 1e-5 rad for none: R2' R1 of its result would be off by as much
    lens, turn = paper_rig().left, cv2.Rodrigues(np.array([3e-6, -8e-6, 5e-6]))[0]
    rig = StereoRig(lens, lens, turn, np.array([-90.0, 1e-4, -3e-4]))
    files = formats.save_ros(tmp_path / "left.yaml", tmp_path / "right.yaml", rig)
    assert_same(rig, formats.load_rig(*files), R=2e-15, T_mm=2e-13)


@given(rigs(coefficients=(0, 4)))
@settings(max_examples=40)
def test_kalibr_keeps_every_bit_but_the_millimetres_last(
    tmp_path_factory: pytest.TempPathFactory, rig: StereoRig
) -> None:
    path = formats.save_kalibr(tmp_path_factory.mktemp("k") / "chain.yaml", rig)
    assert_same(rig, formats.load_rig(path), T_mm=3e-14)


@given(rigs(coefficients=(0, 4, 5)))
def test_matlab_keeps_every_bit_but_the_centres_last(rig: StereoRig) -> None:
    back = matlab_format.from_matlab_struct(matlab_format.to_matlab_struct(rig))
    for a, b in ((rig.left, back.left), (rig.right, back.right)):
        np.testing.assert_allclose(a.K, b.K, rtol=0, atol=2.3e-13)  # the shift by one rounds once
        np.testing.assert_array_equal(np.pad(a.dist, (0, 5 - a.dist.size)), b.dist)
    np.testing.assert_array_equal(rig.R, back.R)
    np.testing.assert_array_equal(rig.T, back.T)


# --- what the files mean to the tools that they are for


@pytest.fixture(scope="module")
def point_mm() -> np.ndarray:
    """A point before both cameras, in the left one's frame."""
    return np.array([60.0, -45.0, 800.0])


def test_opencv_reads_what_we_write(tmp_path: Path) -> None:
    rig = paper_rig()
    storage = cv2.FileStorage(str(formats.save_opencv(tmp_path / "rig.yml", rig)), cv2.FILE_STORAGE_READ)
    np.testing.assert_array_equal(storage.getNode("M2").mat(), rig.right.K)
    np.testing.assert_array_equal(storage.getNode("D1").mat(), rig.left.dist[None])
    np.testing.assert_array_equal(storage.getNode("P2").mat(), rig.rectify().P2)
    storage.release()


def test_opencvs_sample_files_are_read_with_their_unit_and_size(tmp_path: Path) -> None:
    # as the sample stereo_calib leaves them: two files, float matrices, no size, the board measured in metres
    rig = paper_rig()
    for name, entries in (
        (
            "intrinsics.yml",
            {"M1": rig.left.K, "D1": rig.left.dist[None], "M2": rig.right.K, "D2": rig.right.dist[None]},
        ),
        ("extrinsics.yml", {"R": rig.R, "T": rig.T[:, None] / 1000}),
    ):
        storage = cv2.FileStorage(str(tmp_path / name), cv2.FILE_STORAGE_WRITE)
        for key, matrix in entries.items():
            storage.write(key, matrix)
        storage.release()
    files = [tmp_path / "intrinsics.yml", tmp_path / "extrinsics.yml"]
    assert_same(rig, formats.load_opencv(*files, size=(640, 480), unit_mm=1000.0), T_mm=3e-14)
    with pytest.raises(ValueError, match=r"intrinsics\.yml and .*extrinsics\.yml: .*pass size"):
        formats.load_opencv(*files)


def test_ros_projection_sees_a_point_of_the_world_in_metres(tmp_path: Path, point_mm: np.ndarray) -> None:
    # sensor_msgs/CameraInfo: [u v w] = P (X Y Z 1), X in the rectified left camera, metres; row and shift as ours
    rig = paper_rig()
    files = formats.save_ros(tmp_path / "left.yaml", tmp_path / "right.yaml", rig)
    left, right = (yaml.safe_load(path.read_text()) for path in files)
    P1, P2 = (np.reshape(info["projection_matrix"]["data"], (3, 4)) for info in (left, right))
    turn = np.reshape(left["rectification_matrix"]["data"], (3, 3))
    homogeneous = np.append(turn @ point_mm / 1000, 1)
    (u1, v1, w1), (u2, v2, w2) = P1 @ homogeneous, P2 @ homogeneous
    assert v1 / w1 == pytest.approx(v2 / w2, abs=1e-9)
    rectified = rig.rectify()
    truth = rectified.rectify_points(rig.left.project(point_mm), "left")
    np.testing.assert_allclose([u1 / w1, v1 / w1], truth[0], atol=1e-6)
    assert u1 / w1 - u2 / w2 == pytest.approx(rectified.f_px * rig.baseline_mm / (turn @ point_mm)[2])
    assert P2[0, 3] == pytest.approx(-rectified.f_px * rig.baseline_mm / 1000)
    assert left["distortion_coefficients"]["data"] == rig.left.dist.tolist()


def test_kalibr_takes_points_of_cam0_into_cam1_in_metres(tmp_path: Path, point_mm: np.ndarray) -> None:
    paper = paper_rig()
    rig = StereoRig(*(Camera(c.K, c.dist[:4], c.size) for c in (paper.left, paper.right)), paper.R, paper.T)
    chain = yaml.safe_load(formats.save_kalibr(tmp_path / "chain.yaml", rig).read_text())
    moved = np.array(chain["cam1"]["T_cn_cnm1"]) @ np.append(point_mm / 1000, 1)
    np.testing.assert_allclose(moved[:3] * 1000, rig.R @ point_mm + rig.T, rtol=1e-14)
    assert chain["cam0"]["intrinsics"] == [729.9077, 729.4782, 322.5457, 226.0965]
    assert chain["cam0"]["distortion_coeffs"] == [0.0644, -0.2494, 6.9078e-04, -0.0011]


def test_matlab_multiplies_rows_and_counts_pixels_from_one(point_mm: np.ndarray) -> None:
    rig = paper_rig()
    fields = matlab_format.to_matlab_struct(rig)
    np.testing.assert_allclose(
        point_mm[None] @ fields["RotationOfCamera2"] + fields["TranslationOfCamera2"], [rig.R @ point_mm + rig.T]
    )
    pinhole = Camera(rig.left.K, np.zeros(0), rig.left.size)
    u, v, w = point_mm @ fields["CameraParameters1"]["IntrinsicMatrix"]
    np.testing.assert_allclose([u / w - 1, v / w - 1], pinhole.project(point_mm)[0])
    assert fields["CameraParameters1"]["ImageSize"].tolist() == [480, 640]
    assert fields["CameraParameters1"]["RadialDistortion"].tolist() == [0.0644, -0.2494, -0.6359]  # Table I's order


def test_matlab_goes_through_a_mat_file_and_other_units(tmp_path: Path) -> None:
    from scipy.io import loadmat, savemat

    fields = matlab_format.to_matlab_struct(paper_rig())
    fields["CameraParameters2"]["WorldUnits"] = "meters"
    fields["TranslationOfCamera2"] = fields["TranslationOfCamera2"] / 1000
    savemat(tmp_path / "rig.mat", {"rig": fields})
    rig = matlab_format.from_matlab_struct(loadmat(tmp_path / "rig.mat", simplify_cells=True)["rig"])
    np.testing.assert_allclose(rig.T, paper_rig().T, rtol=1e-15)
    np.testing.assert_array_equal(rig.R, paper_rig().R)


def test_kalibrs_own_layout_is_read(tmp_path: Path) -> None:
    # the layout of Kalibr's documentation, with an exponent that YAML 1.1 takes for a text
    path = tmp_path / "camchain.yaml"
    path.write_text(
        "cam0:\n  camera_model: pinhole\n  intrinsics: [461.629, 460.152, 362.680, 246.049]\n"
        "  distortion_model: radtan\n  distortion_coeffs: [-0.27695497, 0.06712482, 8.7e-4, 1e-05]\n"
        "  T_cam_imu:\n  - [1, 0, 0, 0]\n  timeshift_cam_imu: -8.1e-05\n  rostopic: /cam0\n  resolution: [752, 480]\n"
        "cam1:\n  camera_model: pinhole\n  intrinsics: [461.7, 460.2, 362.1, 246.1]\n"
        "  distortion_model: none\n  distortion_coeffs: []\n"
        "  T_cn_cnm1:\n  - [1.0, 0.0, 0.0, -0.11003785]\n  - [0.0, 1.0, 0.0, 0.00045792]\n"
        "  - [0.0, 0.0, 1.0, -0.0003]\n  - [0.0, 0.0, 0.0, 1.0]\n  rostopic: /cam1\n  resolution: [752, 480]\n"
    )
    rig = formats.load_rig(path)
    assert rig.left.dist.tolist() == [-0.27695497, 0.06712482, 8.7e-4, 1e-5] and rig.right.dist.size == 0
    np.testing.assert_allclose(rig.T, [-110.03785, 0.45792, -0.3], rtol=1e-15)
    assert rig.left.size == (752, 480)


# --- what does not fit is refused, what is damaged is named


def long_lens(count: int) -> StereoRig:
    paper = paper_rig()
    cameras = (Camera(c.K, np.full(count, 1e-3), c.size) for c in (paper.left, paper.right))
    return StereoRig(*cameras, paper.R, paper.T)


def test_lenses_that_a_format_cannot_hold_are_refused_and_nothing_is_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no lens model of 12 coefficients"):
        formats.save_ros(tmp_path / "left.yaml", tmp_path / "right.yaml", long_lens(12))
    with pytest.raises(ValueError, match=r"left camera has k3 = -0\.6359 and 5 coefficients"):
        formats.save_kalibr(tmp_path / "chain.yaml", paper_rig())
    with pytest.raises(ValueError, match=r"MATLAB's lens holds .* this one has 8"):
        matlab_format.to_matlab_struct(long_lens(8))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("", "no calibration that we read"),
        ("fx = 700", "no calibration that we read"),
        ('{"format": "stereolib.rig/9"}', "stereolib.rig/9"),
        ("%YAML:1.0\n---\nopencv: 3\n", "no M1, D1, M2, D2 in it, only opencv"),
        ("%YAML:1.0\n---\nM1: !!opencv-matrix\n   rows: 3\n", "damaged"),
        ("cam0: [", "not a YAML file"),
        ("cam0:\n  camera_model: omni\n  distortion_model: radtan\n", "omni with radtan"),
        ("cam0:\n  camera_model: pinhole\n", "no distortion_model"),
        ("cam0: 3\n", "no camera_model"),
        ("- cam0: 3\n", "it has no cam0"),
        ("cam0: !!python/object/apply:os.getcwd []\n", "not a YAML file"),
        ("cam0: " + "[" * 3000, "nested more than 64 deep"),
        ("%YAML:1.0\n---\nopencv: " + "[" * 3000, "nested more than 64 deep"),
    ],
)
def test_damaged_files_are_named(text: str, hint: str, tmp_path: Path) -> None:
    path = tmp_path / "camchain.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"camchain\.yaml") as caught:
        formats.load_rig(path)
    assert hint in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "hint"),
    [
        ("plumb_bob", "equidistant", "'equidistant' is none of plumb_bob"),
        ("plumb_bob", "rational_polynomial", None),  # five of its eight coefficients: the rest are zeros
        ("rows: 3\n  cols: 4", "rows: 2\n  cols: 4", "cannot reshape"),
        ("image_width: 640", "image_width: 0", "positive"),
        ("image_width: 640", "image_width: 320", "differ in size"),
        ("rectification_matrix:", "spare:", "no rectification_matrix"),
    ],
)
def test_damaged_camera_info_is_named(old: str, new: str, hint: str | None, tmp_path: Path) -> None:
    left, right = formats.save_ros(tmp_path / "left.yaml", tmp_path / "right.yaml", paper_rig())
    text = right.read_text()
    assert old in text
    right.write_text(text.replace(old, new))
    if hint is None:
        assert_same(paper_rig(), formats.load_ros(left, right), R=2e-15, T_mm=2e-13)
        return
    with pytest.raises(ValueError, match=r"right\.yaml: .*" + hint):
        formats.load_ros(left, right)


def test_two_left_cameras_are_no_rig(tmp_path: Path) -> None:
    left, _ = formats.save_ros(tmp_path / "left.yaml", tmp_path / "right.yaml", paper_rig())
    with pytest.raises(ValueError, match="no baseline"):
        formats.load_ros(left, left)
    other = tmp_path / "other.yaml"
    other.write_text(left.read_text().replace("camera_name: left", "camera_name: other"))
    with pytest.raises(ValueError, match="holds no baseline"):
        formats.load_ros(left, other)


def test_one_file_twice_is_no_rig(tmp_path: Path) -> None:
    _, right = formats.save_ros(tmp_path / "left.yaml", tmp_path / "right.yaml", paper_rig())
    copy = tmp_path / "copy.yaml"
    copy.write_text(right.read_text())
    for again in (right, copy):
        with pytest.raises(ValueError, match=rf"right\.yaml and .*{again.name}: both say the same"):
            formats.load_rig(right, again)


def test_matlab_without_a_field_says_which() -> None:
    fields = matlab_format.to_matlab_struct(paper_rig())
    del fields["CameraParameters2"]["RadialDistortion"]
    with pytest.raises(ValueError, match="MATLAB structure: it has no RadialDistortion"):
        matlab_format.from_matlab_struct(fields)
    with pytest.raises(ValueError, match="'feet', expected one of mm"):
        fields = matlab_format.to_matlab_struct(paper_rig())
        fields["CameraParameters2"]["WorldUnits"] = "feet"
        matlab_format.from_matlab_struct(fields)


def test_one_file_or_two(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="one file or two, got 3"):
        formats.load_rig("a", "b", "c")
    with pytest.raises(ValueError, match=r"nowhere\.yaml: no such file"):
        formats.load_rig(tmp_path / "nowhere.yaml")


def test_a_second_file_beside_a_whole_rig_is_refused(tmp_path: Path) -> None:
    rig = StereoRig(*(Camera(paper_rig().left.K, [], (640, 480)),) * 2, np.eye(3), np.array([-90.0, 0.0, 0.0]))
    for path in (rig.save(tmp_path / "rig.json"), formats.save_kalibr(tmp_path / "chain.yaml", rig)):
        with pytest.raises(ValueError, match=rf"{path.name} holds the whole rig: leave out .*such"):
            formats.load_rig(path, "/no/such")


def test_size_and_unit_go_to_opencvs_files_alone(tmp_path: Path) -> None:
    rig = paper_rig()
    path = formats.save_opencv(tmp_path / "rig.yml", StereoRig(rig.left, rig.right, rig.R, rig.T))
    kept = [line for line in path.read_text().splitlines() if not line.startswith("image_")]
    path.write_text("\n".join(kept) + "\n")
    with pytest.raises(ValueError, match=r"pass size=\(width, height\)"):
        formats.load_rig(path)
    read = formats.load_rig(path, size=(640, 480), unit_mm=10.0)
    assert_same(StereoRig(rig.left, rig.right, rig.R, 10 * rig.T), read)
    ros = formats.save_ros(tmp_path / "left.yaml", tmp_path / "right.yaml", rig)
    for files in ([rig.save(tmp_path / "rig.json")], ros):
        with pytest.raises(ValueError, match="leave out size and unit_mm"):
            formats.load_rig(*files, size=(640, 480))
        with pytest.raises(ValueError, match="leave out size and unit_mm"):
            formats.load_rig(*files, unit_mm=1000.0)
