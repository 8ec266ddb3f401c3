"""The committed recordings: whole, small enough, and what the code would render again."""

from __future__ import annotations

import hashlib
import zlib

import cv2
import numpy as np
import pytest

from stereolib import laser, paper
from stereolib.base import datasets
from stereolib.rig import Camera, read_image, rigid
from stereolib.virtual import Scene, VirtualLidar, Webcam, cube_scene, recordings, render, walk
from stereolib.virtual import truth as render_truth

FOLDER = datasets.ROOT / "data" / "virtual"
TOLERANCE = 1.0  # mean absolute difference, grey levels: another processor rounds otherwise, and JPEG with it


def test_every_recording_is_there_and_no_other():
    sides = [f"{name}_{side}.jpg" for name in recordings.pairs() for side in ("left", "right")]
    boards = [f"boards/{i:02d}_{side}.jpg" for i in range(1, 31) for side in ("left", "right")]
    scans = ["lrf/room.bin"] + [
        f"lrf/range/{t}_{d:04d}.bin" for t in ("white", "grey", "dark") for d in recordings.RANGES_MM
    ]
    scans += [f"{name}_scan.bin" for name in walk.POSES]
    found = {p.relative_to(FOLDER).as_posix() for p in FOLDER.rglob("*") if p.suffix in {".jpg", ".bin"}}
    assert found == {*sides, *boards, *scans}


def test_recordings_the_paper_calls_for():
    names = recordings.pairs()
    assert {"conditions/plain", "conditions/poor_light", "conditions/glare", "conditions/texture"} <= set(names)
    distances = {int(name.split("_")[-1]) for name in names if name.startswith("series/")}
    assert len(distances) >= 6 and (min(distances), max(distances)) == (500, 1000)
    assert len({name.split("_")[0] for name in names if name.startswith("series/")}) == 3
    assert recordings.BOARD_PAIRS >= 30
    assert min(recordings.RANGES_MM) == 150 and max(recordings.RANGES_MM) == 5000


def test_manifest_holds_for_every_file():
    lines = (FOLDER / "SHA256SUMS").read_text().splitlines()
    sums = {name: digest for digest, name in (line.split("  ") for line in lines)}
    files = [p for p in FOLDER.rglob("*") if p.suffix in {".jpg", ".bin"}]
    assert {p.relative_to(FOLDER).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest() for p in files} == sums
    assert sum(p.stat().st_size for p in files) < 45e6


def test_manifest_is_written_as_sha256sum_does(tmp_path):
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "x.jpg").write_bytes(b"1")
    (tmp_path / "a.bin").write_bytes(b"2")
    (tmp_path / "README.md").write_bytes(b"not listed")
    recordings.write_sums(tmp_path)
    assert (tmp_path / "SHA256SUMS").read_text() == (
        f"{hashlib.sha256(b'2').hexdigest()}  a.bin\n{hashlib.sha256(b'1').hexdigest()}  b/x.jpg\n"
    )


def test_build_writes_pairs_streams_and_sums(tmp_path, monkeypatch):
    """With a renderer that takes no time: the files, the seeds, and what `only` leaves alone."""
    light = np.full((48, 64, 3), 0.4, np.float32)
    monkeypatch.setattr(recordings, "render_pair", lambda *_, **__: (light, light))
    monkeypatch.setattr(recordings, "laser_recordings", lambda: [("lrf/room", b"turn")])
    recordings.build(tmp_path, progress=False)
    made = {p.relative_to(tmp_path).as_posix(): p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    assert len(made) == 2 * (len(recordings.pairs()) + 30) + 2
    assert len(set(made.values())) == len(made)  # each with noise of its own
    sums = made["SHA256SUMS"].decode().splitlines()
    assert f"{hashlib.sha256(b'turn').hexdigest()}  lrf/room.bin" in sums and len(sums) == len(made) - 1
    again = tmp_path / "again"
    recordings.build(again, only="boards/0", progress=False)
    files = [p for p in again.rglob("*.jpg")]
    assert len(files) == 18
    assert all(p.read_bytes() == made[p.relative_to(again).as_posix()] for p in files)


@pytest.mark.slow
def test_picture_made_again():
    """Poor light: the noisiest of all, so that the seed, the noise and the exposure are held too."""
    name = "conditions/poor_light"
    where, scene = recordings.pairs()[name]
    light = render(scene, paper.paper_rig().left, recordings.setup(where), samples=3)
    rng = np.random.default_rng([zlib.crc32(name.encode()), False])
    ours = Webcam().shoot(light, rng).astype(float)
    committed = recordings.load_pair(name)[0]
    assert np.abs(ours - committed).mean() < TOLERANCE
    other = Webcam().shoot(light, np.random.default_rng(0)).astype(float)
    assert np.abs(other - committed).mean() > 5 * TOLERANCE  # the noise is that of the seed


@pytest.mark.parametrize(
    ("name", "side", "corner"),
    [("conditions/glare", "right", (280, 250)), ("boards/03", "left", None), ("room/2", "left", (330, 200))],
)
def test_part_of_a_picture_made_again(name, side, corner):
    """A part of the same pixels; exposure and vignetting are a smooth factor, fitted, the noise is not made again."""
    rig, board = paper.paper_rig(), name.startswith("boards/")
    lens = getattr(rig, side)
    if board:
        pose = recordings.board_poses()[int(name[-2:]) - 1]
        where, scene = "bench", recordings.board_scene(pose)
        corner = (lens.project(pose[None, :3, 3])[0] - [60, 45]).astype(int)
    else:
        where, scene = recordings.pairs()[name]
    T = recordings.setup(where) if side == "left" else rigid(rig.R, rig.T) @ recordings.setup(where)
    K = lens.K - [[0, 0, corner[0]], [0, 0, corner[1]], [0, 0, 0]]
    light = render(scene, Camera(K, lens.dist, (120, 90)), T, samples=3)
    light = cv2.GaussianBlur(light, (0, 0), Webcam().psf_sigma_px)[5:-5, 5:-5]
    part = read_image(FOLDER / f"{name}_{side}.jpg")[corner[1] + 5 : corner[1] + 85, corner[0] + 5 : corner[0] + 115]
    received = (part / 255.0) ** 2.2
    clear = part.max(axis=2) < 250
    y, x = np.indices(clear.shape) / 100
    terms = np.stack([light.mean(axis=2) * t for t in (np.ones_like(x), x, y)], axis=-1)
    factor = np.linalg.lstsq(terms[clear], received.mean(axis=2)[clear], rcond=None)[0]
    gain = factor[0] + factor[1] * x + factor[2] * y
    ours = 255 * np.clip(light * gain[..., None], 0, 1) ** (1 / 2.2)
    assert np.abs(ours - part)[clear].mean() < 3  # the noise that was not made again
    assert np.abs(ours.mean(axis=2) - part.mean(axis=2))[clear].mean() < 2
    assert part[clear].std() > 10
    slipped = np.abs(ours[:, 1:] - part[:, :-1])[clear[:, :-1]].mean()
    assert slipped > 1.2 * np.abs(ours - part)[clear].mean()


def test_laser_streams_made_again():
    """But for beam 0, which meets the cube exactly on its edge, and strengths that OpenCV 4 rounds otherwise."""
    count = 0
    for name, ours in recordings.laser_recordings():
        committed = recordings.load_laser(name)
        assert len(ours) == len(committed)
        assert np.mean(np.frombuffer(ours, np.uint8) == np.frombuffer(committed, np.uint8)) > 0.95, name
        first, second = (laser.decode(data) for data in (ours, committed))
        equal = (first.distance_mm == second.distance_mm) | (np.isnan(first.distance_mm) & np.isnan(second.distance_mm))
        assert equal.mean() > 0.995, name
        assert np.abs(first.strength.astype(int) - second.strength).max() <= 1, name
        count += 1
    assert count == 64 + len(walk.POSES)


def test_pairs_are_read_as_the_webcams_sent_them():
    left, right = recordings.load_pair("conditions/texture")
    assert left.shape == right.shape == (480, 640, 3)
    np.testing.assert_array_equal(left, read_image(FOLDER / "conditions" / "texture_left.jpg"))
    np.testing.assert_array_equal(right, read_image(FOLDER / "conditions" / "texture_right.jpg"))
    boards, names = recordings.load_boards()
    assert (len(boards), names[0], names[-1]) == (30, "boards/01", "boards/30")


def test_stations_of_the_walk_stand_where_they_should():
    for name, (x, y, yaw) in walk.POSES.items():
        T = rigid(recordings.rectified().R1, np.zeros(3)) @ recordings.setup(name)
        np.testing.assert_allclose(-T[:3, :3].T @ T[:3, 3], [x, y, 85], atol=1.5)
        assert np.arctan2(T[2, 1], T[2, 0]) == pytest.approx(yaw, abs=1e-6)
        assert T[2, 2] == pytest.approx(np.sin(np.radians(8.27)), abs=1e-3)


def test_boxes_of_the_walk_are_seen_from_two_sides():
    """By the truth: whole in both pictures of two stations whose directions differ by 30 degrees; the fourth in one."""
    seen = {k: [] for k in range(1, 6)}
    scene = walk.walk_scene()
    for name, (x, y, _) in walk.POSES.items():
        truth = recordings.load_truth(name)
        for k, directions in seen.items():
            v, u = np.nonzero(truth.box == k)
            alone = render_truth(
                Scene((scene.boxes[0], scene.boxes[k])), recordings.rectified(), recordings.setup(name)
            )
            whole = len(u) > 0.98 * (alone.box == 1).sum() > 0 and u.min() > 3 and u.max() < 636 and v.min() > 3
            if whole and (truth.visible & (truth.box == k)).sum() > 0.8 * len(u):
                directions.append(np.arctan2(*(scene.boxes[k].T_world_box[:2, 3] - [x, y])[::-1]))
    assert len(seen.pop(4)) == 1
    for directions in seen.values():
        spread = max(np.abs(np.angle(np.exp(1j * (a - b)))) for a in directions for b in directions)
        assert len(directions) >= 2 and spread > np.radians(30)


def test_scans_of_the_walk_read_what_is_there():
    sensor = VirtualLidar(height_mm=walk.LASER_HEIGHT_MM)
    for name, pose in walk.POSES.items():
        error = recordings.scan(name).ranges_mm - sensor.truth_mm(walk.walk_scene(), pose)
        assert np.nanmedian(np.abs(error)) < 4 and np.isfinite(error).mean() > 0.95


def test_unknown_names_are_answered_with_the_known_ones():
    with pytest.raises(ValueError, match="no virtual recording 'glare'; there are conditions/plain"):
        recordings.load_pair("glare")
    with pytest.raises(ValueError, match="no virtual recording"):
        recordings.load_truth("boards/01")
    with pytest.raises(ValueError, match=r"data/virtual/lrf/no\.bin is missing"):
        recordings.load_laser("lrf/no")
    with pytest.raises(ValueError, match='"bench" or "room/1" to "room/5", got \'tilted\''):
        recordings.setup("tilted")


@pytest.mark.parametrize(
    ("name", "height_mm", "pitch_deg"), [("pitched", 85, 8.27), ("level", 190, 0), ("bench", 1000, 0)]
)
def test_set_ups_stand_where_they_should(name, height_mm, pitch_deg):
    T = rigid(recordings.rectified().R1, np.zeros(3)) @ recordings.setup(name)
    eye, axis = -T[:3, :3].T @ T[:3, 3], T[2, :3]
    np.testing.assert_allclose(eye[:2], 0, atol=1e-6)
    assert eye[2] == pytest.approx(height_mm, abs=1.5)
    assert np.degrees(np.arcsin(axis[2])) == pytest.approx(pitch_deg, abs=0.06)


@pytest.mark.parametrize("name", ["conditions/texture", "conditions/level"])
def test_truth_has_the_papers_constant_of_53_rows(name):
    """The cube's foot on its near edge stands 53 rows above the bottom of the rectified image."""
    truth = recordings.load_truth(name)
    cube = truth.box == 1
    near_column = np.nanargmax(np.where(cube, truth.disparity_px, 0).max(axis=0))
    assert 479 - np.flatnonzero(cube[:, near_column]).max() == pytest.approx(53, abs=1.5)
    assert truth.disparity_px[cube].max() == pytest.approx(104.5 if name.endswith("texture") else 101.6, abs=0.4)


def test_pictures_agree_with_their_truth():
    """What the left camera sees at a visible pixel, the right one sees a disparity further left."""
    left, right = recordings.rectified().rectify(*recordings.load_pair("conditions/texture"))
    truth = recordings.load_truth("conditions/texture")
    v, u = np.meshgrid(np.arange(480, dtype=np.float32), np.arange(640, dtype=np.float32), indexing="ij")
    moved = cv2.remap(right, u - truth.disparity_px.astype(np.float32), v, cv2.INTER_LINEAR)
    inside = np.zeros((480, 640), bool)
    inside[10:-10, 10:-10] = True
    difference = np.abs(moved.astype(float) - left).mean(axis=2)
    assert np.median(difference[truth.visible & inside]) < 4
    for shift in (-3, 3):
        wrong = cv2.remap(right, u - truth.disparity_px.astype(np.float32) + shift, v, cv2.INTER_LINEAR)
        wrong_by = np.abs(wrong.astype(float) - left).mean(axis=2)
        assert wrong_by[truth.visible & inside].mean() > 1.5 * difference[truth.visible & inside].mean()


@pytest.fixture(scope="module")
def poses():
    return recordings.board_poses()


def test_boards_stay_in_view_above_the_floor_and_cover_the_image(poses):
    rig, target = paper.paper_rig(), recordings.BOARD
    half = (target.columns + 1) * target.square_mm / 2, (target.rows + 1) * target.square_mm / 2
    rim = np.array([[a * half[0], b * half[1], 0.0] for a in (-1, 1) for b in (-1, 1)])
    inner = (target.points_mm - target.points_mm.mean(axis=0)) * [1, -1, 1]
    seen, tilts = [], []
    for T in poses:
        for camera, M in ((rig.left, T), (rig.right, rigid(rig.R, rig.T) @ T)):
            outer = camera.project(rim @ M[:3, :3].T + M[:3, 3])
            assert ((outer > 0) & (outer < [639, 479])).all()
            # and none by way of the fold: every pixel leads back to its corner
            points = np.vstack([rim, inner]) @ M[:3, :3].T + M[:3, 3]
            np.testing.assert_allclose(camera.rays(camera.project(points)), points / points[:, 2:], atol=1e-6)
        seen.append(rig.left.project(inner @ T[:3, :3].T + T[:3, 3]))
        tilts.append(np.degrees(np.arccos(-T[2, 2])))
        world = np.linalg.inv(recordings.setup("bench")) @ T @ np.column_stack([rim * 1.3, np.ones(4)]).T
        assert world[2].min() > 50
    # the left camera's first columns lie outside the right one's image at these distances
    seen = np.concatenate(seen)
    counts = np.histogram2d(seen[:, 0], seen[:, 1], bins=(4, 3), range=((120, 640), (0, 480)))[0]
    assert (counts > 20).all()
    assert np.percentile(tilts, 25) > 10 and max(tilts) < 60


def test_boards_are_the_same_for_the_same_seed(poses):
    again = recordings.draw_board_poses(4, np.random.default_rng(30))
    np.testing.assert_array_equal(again, poses[:4])
    assert not np.allclose(recordings.draw_board_poses(1, np.random.default_rng(31))[0], poses[0])


def test_board_too_large_for_the_image():
    with pytest.raises(ValueError, match=r"only 0 of 1 poses keep .* inside both images: use a smaller board"):
        recordings.draw_board_poses(1, np.random.default_rng(0), recordings.Checkerboard(20, 15, 60.0))


def test_laser_stands_before_the_cube():
    ranges = recordings.lidar.VirtualLidar().truth_mm(cube_scene(), recordings.LASER_POSE)
    assert ranges[0] == pytest.approx(700, abs=0.5)
    assert ranges[180] == pytest.approx(1800, abs=0.5)
