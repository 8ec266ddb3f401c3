"""The committed recordings: whole, small enough, true to their scenes."""

from __future__ import annotations

import hashlib

import cv2
import numpy as np
import pytest

from stereolib import laser
from stereolib.base import ROOT
from stereolib.rig import read_image, rigid
from stereolib.virtual import Scene, VirtualLidar, cube_scene, recordings, render_truth, walk

FOLDER = ROOT / "data" / "virtual"


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
    files = [p for p in FOLDER.rglob("*") if p.suffix in {".jpg", ".bin", ".toml"}]
    assert {p.relative_to(FOLDER).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest() for p in files} == sums
    assert sum(p.stat().st_size for p in files) < 45e6


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


@pytest.mark.slow
def test_boxes_of_the_walk_are_seen_from_two_sides():
    """By the truth: whole in both pictures of two stations whose directions differ by 30 degrees; the fourth in one."""
    seen = {k: [] for k in range(1, 6)}
    scene = walk.walk_scene()
    for name, (x, y, _) in walk.POSES.items():
        truth = recordings.load_truth(name)
        for k, directions in seen.items():
            v, u = np.nonzero(truth.box == k)
            inside = len(u) and u.min() > 3 and u.max() < 636 and v.min() > 3
            if not inside or (truth.visible & (truth.box == k)).sum() <= 0.8 * len(u):
                continue
            by_itself = Scene((scene.boxes[0], scene.boxes[k]))
            alone = render_truth(by_itself, recordings.rectified(), recordings.setup(name))
            if len(u) > 0.98 * (alone.box == 1).sum() > 0:
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


def test_laser_stands_before_the_cube():
    ranges = VirtualLidar().truth_mm(cube_scene(), recordings.LASER_POSE)
    x, y = laser.points_mm(laser.LaserScan(ranges, np.ones(360))).T
    assert (y[90], x[180], y[270]) == pytest.approx((1900, -1800, -1700), abs=0.5)  # left, behind, to the right
    cube = (x > 0) & (abs(y) < 200)  # its corner looks at the laser
    assert (x - abs(y))[cube] == pytest.approx(700, abs=0.5)
