"""A pair and a scan to objects: recordings of known truth, and everything that can be wrong with the input."""

from __future__ import annotations

import json
import re
from functools import cache

import cv2
import numpy as np
import pytest

from stereolib import laser
from stereolib.calibration import LidarCamera
from stereolib.cli import commands
from stereolib.measurement import Instrument, draw_objects, floor_from_pose, measure_objects, save_lidar
from stereolib.measurement.overlay import size_text
from stereolib.rig import StereoRig, rigid
from stereolib.virtual import VirtualLidar, Webcam, cube_scene, laser_boards, recordings, render

RECT = recordings.rectified()
SENSOR = VirtualLidar()
LIDAR = LidarCamera(
    recordings.setup() @ rigid(np.eye(3), [0.0, 0.0, SENSOR.height_mm]), np.zeros(3), np.zeros(3),
    np.diag([1e-6] * 3 + [0.25] * 3), np.zeros(0),
)  # fmt: skip


def empty_scan() -> laser.LaserScan:
    return laser.LaserScan(np.full(360, 4500.0), np.full(360, 100.0))


@cache
def measured(name="conditions/texture", scan="conditions/texture", floor=None, lidar=LIDAR):
    readings = scan and (empty_scan() if scan == "empty" else recordings.scan(scan))
    pair = recordings.load_pair(name)
    return measure_objects(*pair, readings, RECT, lidar, rng=np.random.default_rng(0), floor=floor)


def the_cube(found):
    return min(found.objects, key=lambda thing: abs(np.hypot(*thing.position_mm) - 912))


@pytest.mark.parametrize("name", ["conditions/texture", "series/medium_600", "series/fine_800", "series/coarse_700"])
def test_the_recorded_cube_within_its_deviations(name):
    thing = the_cube(measured(name, name))
    assert thing.shape == "box" and np.abs(thing.size_mm - 300).max() < 3
    assert (np.abs(thing.size_mm - 300) < 3 * thing.std_mm).all() and thing.std_mm.max() < 3
    volume, std = thing.volume_l
    assert abs(volume - 27) < 3 * std < 1
    distance = {"conditions/texture": 700}.get(name) or int(name.split("_")[1])
    np.testing.assert_allclose(thing.position_mm, [distance + 150 * np.sqrt(2), 0], atol=3)
    assert np.degrees(thing.yaw_rad) % 90 == pytest.approx(45, abs=0.5)


def test_without_a_scan_the_pair_alone_measures():
    thing = the_cube(measured(scan=None))
    np.testing.assert_allclose(thing.size_mm, 300, atol=3)
    assert thing.sources["lines"] == "image" and not thing.reasons


def test_a_scan_without_an_object_is_said():
    found = measured(scan="empty")
    assert "the scan shows no object within 3 m" in found.warnings[0]
    np.testing.assert_allclose(the_cube(found).size_mm, 300, atol=3)


def test_a_scan_of_another_moment_is_said_with_both_distances():
    found = measured(scan="series/medium_1000")
    assert re.search(r"at 100\d mm and the pair at 70\d mm: were they taken at the same time", " ".join(found.warnings))
    np.testing.assert_allclose(the_cube(found).size_mm, 300, atol=3)
    near = measured("series/medium_700", "series/medium_800")
    assert any("disagree about the distance" in text for text in near.warnings)


def blank(scan):
    grey = np.full((480, 640, 3), 128, np.uint8)
    return measure_objects(grey, grey, scan, RECT, LIDAR, rng=np.random.default_rng(0))


def test_no_floor_leaves_what_the_scan_tells():
    found = blank(recordings.scan("conditions/texture"))
    assert found.floor is None and found.warnings[0].startswith("no floor") and "scan's alone" in found.warnings[0]
    thing = the_cube(found)
    assert np.isnan(thing.size_mm[2]) and thing.reasons["height"].startswith("no floor")
    assert (np.abs(thing.size_mm - 300)[:2] < 3 * thing.std_mm[:2]).all() and thing.sources["left end"] == "scan"
    np.testing.assert_array_equal(draw_objects(found), found.left)


def test_no_floor_and_no_scan_is_refused():
    with pytest.raises(ValueError, match="no floor"):
        blank(None)


def test_glare_is_refused_not_guessed():
    thing = the_cube(measured("conditions/glare", "conditions/glare"))
    assert np.isnan(thing.size_mm).all() and "irregular" in thing.reasons["length"]


def test_a_plain_cube_is_not_measured_in_height():
    thing = the_cube(measured("conditions/plain", "conditions/plain"))
    assert np.isnan(thing.size_mm[2]) and thing.reasons["height"]


def test_a_known_floor_is_taken():
    floor = floor_from_pose(RECT, recordings.setup())
    found = measured(floor=floor)
    assert found.floor is floor
    np.testing.assert_allclose(the_cube(found).size_mm, 300, atol=3)


def test_what_lies_beside_the_picture_is_told_from_the_scan():
    data = SENSOR.scan(cube_scene(700.0, lateral_mm=900.0), recordings.LASER_POSE, np.random.default_rng(3), turns=5)
    from stereolib import laser

    scan = laser.average(laser.turns(laser.decode(data)))
    found = measure_objects(
        *recordings.load_pair("conditions/texture"), scan, RECT, LIDAR, rng=np.random.default_rng(0)
    )
    aside = max(found.objects, key=lambda thing: thing.position_mm[1])
    assert "outside the picture" in aside.reasons["height"]


def test_pictures_of_another_size_are_refused():
    small = [cv2.resize(image, (320, 240)) for image in recordings.load_pair("conditions/texture")]
    with pytest.raises(ValueError, match=r"320x240.*640x480"):
        measure_objects(*small, None, RECT, LIDAR, rng=np.random.default_rng(0))


def test_a_laser_nobody_calibrated_is_assumed_below_the_camera():
    found = measured(lidar=None)
    assert "straight below the left camera" in found.warnings[0]
    np.testing.assert_allclose(the_cube(found).size_mm, 300, atol=3)


def test_the_boxes_are_drawn_where_the_cube_is():
    found = measured()
    drawn = (draw_objects(found, scan=False) != found.left).any(axis=2)
    rows, columns = np.nonzero(drawn)
    truth = recordings.load_truth("conditions/texture").box == 1
    seen_rows, seen_columns = np.nonzero(truth)
    assert abs(columns.min() - seen_columns.min()) < 5 and abs(columns.max() - seen_columns.max()) < 5
    assert abs(rows.max() - seen_rows.max()) < 5 and size_text(the_cube(found)).endswith(" mm")


@pytest.fixture
def files(tmp_path):
    StereoRig.save(
        RECT.rig, tmp_path / "rig.json", calibration={"std": {"rectified": {"f_px": 0.1, "baseline_mm": 0.01}}}
    )
    save_lidar(tmp_path / "rig.json", LIDAR)
    for side, image in zip(("left", "right"), recordings.load_pair("conditions/texture"), strict=True):
        cv2.imwrite(str(tmp_path / f"{side}.png"), image)
    scene = recordings.pairs()["conditions/texture"][1]
    (tmp_path / "scan.bin").write_bytes(SENSOR.scan(scene, recordings.LASER_POSE, np.random.default_rng(1), turns=5))
    return tmp_path


def run(folder, *more, right="right.png", rig="rig.json", scan="scan.bin"):
    words = ["measure", folder / "left.png", folder / right, "--calibration", folder / rig, "--scan", folder / scan]
    return commands.main([str(word) for word in (*words, "--picture", folder / "out.png", *more)])


def test_instrument_file_goes_round(files):
    instrument = Instrument.load(files / "rig.json")
    np.testing.assert_array_equal(instrument.lidar.T_left_lidar, LIDAR.T_left_lidar)
    np.testing.assert_array_equal(instrument.lidar.covariance, LIDAR.covariance)
    assert instrument.uncertainty.f_px == 0.1 and instrument.rectified.f_px == RECT.f_px
    text = json.loads((files / "rig.json").read_text())
    text["lidar"]["T_left_lidar"][0][0] = 3.0
    (files / "rig.json").write_text(json.dumps(text))
    with pytest.raises(ValueError, match="laser or of deviations is damaged"):
        Instrument.load(files / "rig.json")


def test_command_prints_json_and_draws(files, capsys):
    assert run(files, "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    (cube,) = [thing for thing in facts["objects"] if thing["height_mm"]]
    for name in ("length", "width", "height"):
        assert cube[f"{name}_mm"] == pytest.approx(300, abs=3) and 0 < cube[f"{name}_std_mm"] < 3
    assert cube["volume_l"] == pytest.approx(27, abs=0.6) and cube["shape"] == "box"
    assert cv2.imread(str(files / "out.png")).shape == (480, 640, 3)
    assert run(files) == 2 and "would be overwritten" in capsys.readouterr().err
    assert run(files, "--force") == 0 and "± one standard deviation" in capsys.readouterr().out


@pytest.fixture
def boards(files):
    """Pictures and scans of the laser's boards, and the rig without its laser."""
    StereoRig.save(RECT.rig, files / "rig.json")
    rng, camera = np.random.default_rng(5), RECT.rig.left
    (files / "pictures").mkdir()
    (files / "scans").mkdir()
    for k, pose in enumerate(laser_boards.POSES):
        scene = laser_boards.board_scene(pose, height_mm=180.0)
        light = render(scene, camera, recordings.setup(), samples=1, light_samples=1)
        cv2.imwrite(str(files / "pictures" / f"{k:02d}.png"), Webcam().shoot(light, rng))
        data = SENSOR.scan(scene, recordings.LASER_POSE, rng, turns=5)
        (files / "scans" / f"{k:02d}.bin").write_bytes(data)
    return files


def test_command_finds_the_laser_from_files(boards, capsys):
    words = ["calibrate-laser", boards / "pictures", boards / "scans", "--calibration", boards / "rig.json"]
    words = [str(word) for word in (*words, "--board", "6x9", "--square-mm", "30")]
    assert commands.main([*words, "--margin-mm", "24"]) == 0
    assert "10 poses" in capsys.readouterr().out
    found = Instrument.load(boards / "rig.json").lidar
    off = (np.linalg.inv(LIDAR.T_left_lidar) @ found.T_left_lidar)[:3, 3]
    assert (np.abs(off) < 4 * found.std_mm).all() and found.std_mm.max() < 5
    (boards / "scans" / "03.bin").unlink()
    assert commands.main(words) == 2 and "one scan for each picture" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"right": "none.png"}, "none.png"),
        ({"rig": "left.png"}, "is not a rig file"),
        ({"scan": "left.png"}, "no XV-11 recording"),
        ({"scan": "none.bin"}, "no such recording"),
    ],
)
def test_bad_files_are_named(files, capsys, change, message):
    assert run(files, **change) == 2
    assert message in capsys.readouterr().err and not (files / "out.png").exists()
