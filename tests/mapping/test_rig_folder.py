"""A folder of one's own rig: what its file may say, what is paired with what, and what is said to be missing."""

from __future__ import annotations

import glob
from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.corners import corner_set
from support.instruments import LIDAR

from stereolib.base import data_path
from stereolib.calibration import Charuco, Checkerboard, diagnose
from stereolib.mapping import (
    RIG_FILE,
    RIG_FOLDERS,
    load_rig_folder,
    lying_there,
    tried,
    write_demo_file,
    write_rig_file,
)
from stereolib.measurement import Between, Instrument, save_laser_pose
from stereolib.paper import paper_rig
from stereolib.virtual import recordings, walk

PICTURE = cv2.imencode(".png", np.zeros((8, 8), np.uint8))[1].tobytes()
BOARDS = [f"boards/{side}{k}.png" for k in range(6) for side in ("left", "right")]
SIDES = "1_left.png", "1_right.png"
SQUARE = "[board]\ninner_corners = [9, 6]\nsquare_mm = 25\n"


@pytest.fixture
def folder(tmp_path):
    for name in RIG_FOLDERS:
        (tmp_path / name).mkdir()
    write_rig_file(tmp_path / RIG_FILE)
    return tmp_path


def fill(folder, *names):
    for name in names:
        (folder / name).write_bytes(PICTURE if name.endswith(".png") else b"")
    return folder


def test_an_empty_folder_says_what_it_leaves_out(folder):
    own = load_rig_folder(folder)
    assert (own.boards, own.stations, own.lengths) == ((), (), ())
    assert [text.split(":")[0] for text in own.absent] == [f"nothing in {name}" for name in RIG_FOLDERS]
    assert own.calibrate() is None and own.instrument(None) is None
    assert str(own) == "0 pairs of the board, 0 pairs to measure, 0 scans"


def test_scans_belong_to_pairs_by_name(folder):
    fill(folder, "pairs/01_left.png", "pairs/1_right.png", "pairs/left_door.png", "pairs/right_door.png")
    own = load_rig_folder(fill(folder, "scans/1_scan.bin", "scans/scan-door.csv", "scans/7.bin", "scans/notes.txt"))
    assert {each.name: (each.left is not None, each.scan and each.scan.name) for each in own.stations} == {
        "1": (True, "1_scan.bin"),
        "door": (True, "scan-door.csv"),
        "7": (False, "7.bin"),
    }
    assert own.absent[-1] == "no pair is named like 7.bin: used by themselves"
    assert own.absent[-2].startswith("notes.txt in scans is no .bin or .csv")


def test_a_scan_with_another_ending_is_named(folder):
    (folder / "scans" / "1.txt").write_bytes(walk.scan_bytes("room/1"))
    own = load_rig_folder(folder)
    assert own.absent[-2] == "no scan in scans: no word about the laser"
    assert own.absent[-1].startswith("1.txt in scans is no .bin or .csv: not read; name a recording of the laser .bin")
    (folder / "scans" / "1.txt").rename(folder / "scans" / "1.bin")
    assert str(load_rig_folder(folder)).endswith("1 scan") and "laser" not in " ".join(load_rig_folder(folder).absent)


def test_patterns_may_lead_out_of_the_folder(folder, tmp_path):
    other = tmp_path.with_name(tmp_path.name + " elsewhere [1]")
    other.mkdir()
    fill(other, "a_left.png", "a_right.png", "a_scan.bin")
    for way in (other.as_posix(), "../" + other.name):
        inside = glob.escape(way)
        text = f'[recordings]\npairs = "{inside}/a_*.png"\nscans = "{inside}/*.bin"\n'
        (folder / RIG_FILE).write_text(text)
        (station,) = load_rig_folder(folder).stations
        assert station.left.name == "a_left.png" and station.scan.name == "a_scan.bin"


def test_a_board_is_asked_for_only_where_there_are_some(folder):
    fill(folder, *BOARDS)
    with pytest.raises(ValueError, match=r"rig.toml: \[board\] square_mm: say how large a square is"):
        load_rig_folder(folder)
    write_rig_file(folder / RIG_FILE, corners=[8, 5], square_mm=[24.9, 25.1], ruler_mm=63.5, at_mm=700.0)
    own = load_rig_folder(folder)
    assert own.board == Checkerboard(8, 5, 25.0, 25.1 / 24.9) and (own.ruler_mm, own.at_mm) == (63.5, 700.0)
    assert len(own.boards) == 6
    (folder / RIG_FILE).write_text(SQUARE + "marker_mm = 18\ndictionary = '4X4_50'\nlegacy = true\n")
    assert load_rig_folder(folder).board == Charuco(9, 6, 25, 18.0, "4X4_50", True)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("[board", r"not a TOML file \(.*\); mend it there, or move the file away: stereolib new .* writes another$"),
        ("[bord]\n", "'bord' is no part; did you mean board?"),
        ("board = 3\n", "board is a part of its own"),
        ("board = []\n", "board is a part of its own"),
        ("length = 5\n", r"length is a part of its own, \[\[length\]\], with entries"),
        ("length = true\n", "length is a part of its own"),
        ("length = [3]\n", "length is a part of its own"),
        ("[length]\npair = '9'\n", "length is a part of its own"),
        ("[board]\nsquares = 3\n", r"'squares' is no entry of \[board\]; did you mean square_mm?"),
        (SQUARE.replace("25", '"25"'), r"\[board\] square_mm: a length or two are expected, as 25 or \[24.9, 25.1\]"),
        (SQUARE.replace("25", "0.025"), "millimetres are expected"),
        (SQUARE.replace("25", "[25, 0]"), "height over its width must be near 1"),
        (SQUARE.replace("25", "[0, 25]"), "rig.toml"),
        (SQUARE.replace("[9, 6]", "[9.5, 6]"), "whole numbers"),
        (SQUARE + "legacy = 'false'\n", r"rig.toml: \[board\] legacy: true or false is expected, got 'false'$"),
        (SQUARE + "marker_mm = 18\nlegacy = 0\n", r"rig.toml: \[board\] legacy: true or false is expected, got 0$"),
        (SQUARE.replace("[9, 6]", "9"), r"\[board\] inner_corners: columns and rows are expected"),
        (SQUARE + "[cameras]\nat_mm = -3\n", r"\[cameras\] at_mm: a number of millimetres is expected"),
        (SQUARE + "[cameras]\nruler_mm = nan\n", r"\[cameras\] ruler_mm"),
        (SQUARE + "[cameras]\nmodel = 'fisheye'\n", "unknown lens model 'fisheye'; choose one of"),
        (SQUARE + "[recordings]\npairs = ''\n", r"\[recordings\] pairs: a text is expected"),
        (SQUARE + "[[length]]\npair = '9'\nfrom = [1, 2]\nto = [3, 4]\n", "there is no pair '9', only none"),
        (SQUARE + "[[length]]\nfrom = [1]\nto = [3, 4]\n", r"\[length\] from: a column and a row are expected"),
    ],
)
def test_a_file_that_says_something_else_is_refused_by_name(folder, text, why):
    fill(folder, *BOARDS)
    (folder / RIG_FILE).write_text(text)
    with pytest.raises(ValueError, match=why) as caught:
        load_rig_folder(folder)
    assert str(folder / RIG_FILE) in str(caught.value)


def test_no_folder_no_file_and_too_few_boards(folder):
    with pytest.raises(ValueError, match=r"nowhere is no folder: stereolib new .*nowhere makes one"):
        load_rig_folder(folder / "nowhere")
    fill(folder, *BOARDS[:4])
    with pytest.raises(ValueError, match="boards: 2 pairs of the board; at least"):
        load_rig_folder(folder)
    fill(folder, "scans/1.bin", "scans/01.csv")
    (folder / "boards" / "left0.png").unlink()
    with pytest.raises(ValueError, match=r"without a partner .*right0.png"):
        load_rig_folder(folder)
    for path in (folder / "boards").iterdir():
        path.unlink()
    with pytest.raises(ValueError, match=r"station 1 has two files for its scan, 01\.csv and 1\.bin: keep one"):
        load_rig_folder(folder)
    (folder / RIG_FILE).unlink()
    with pytest.raises(ValueError, match=r"has no rig.toml, which says what lies there"):
        load_rig_folder(folder)


def test_a_calibration_in_the_folder_tells_lengths(folder):
    paper_rig().save(folder / "calibration.json")
    own = load_rig_folder(folder)
    found = own.instrument(own.calibrate())
    assert isinstance(found, Instrument) and found.rectified.baseline_mm == pytest.approx(paper_rig().baseline_mm)
    assert own.absent[0] == "nothing in boards: its calibration.json is taken as it is, without a verdict"


def test_the_calibration_of_the_boards_keeps_where_the_laser_stands(folder):
    own, diagnosis = load_rig_folder(folder), diagnose(corner_set(np.random.default_rng(1), pairs=8))
    path = own.save_calibration(folder / "of_the_boards.json", diagnosis)
    assert Instrument.load(path).lidar is None
    save_laser_pose(paper_rig().save(folder / "calibration.json"), LIDAR)
    found = Instrument.load(own.save_calibration(path, diagnosis))
    np.testing.assert_allclose(found.lidar.T_left_lidar, LIDAR.T_left_lidar)
    assert found.rectified.baseline_mm == pytest.approx(diagnosis.rig.baseline_mm)


@pytest.mark.parametrize(("names", "pattern"), [(("left/1.png", "right/1.png"), "."), (SIDES, "*.png")])
def test_pairs_beside_their_empty_folder_are_told_with_the_remedy(folder, names, pattern):
    for name in names:
        (folder / name).parent.mkdir(exist_ok=True)
    fill(folder, *names)
    *_, said = load_rig_folder(folder).absent
    assert said.startswith(f"pairs lie in {folder}, ") and f'write pairs = "{pattern}" into its {RIG_FILE}' in said
    (folder / RIG_FILE).write_text((folder / RIG_FILE).read_text().replace('"pairs"', f'"{pattern}"'))
    own = load_rig_folder(folder)
    assert [station.left.name for station in own.stations] == [names[0].rpartition("/")[2]]
    assert not any("write pairs" in text for text in own.absent)


def test_the_demo_rig_is_told_as_it_is():
    """Its rig.toml: the board, the lenses' distance by a ruler, and two lengths between true marks on boxes."""
    own, rig = load_rig_folder(data_path("virtual/rig.toml").parent), paper_rig()
    assert own.board == recordings.BOARD and not own.absent
    assert own.ruler_mm == round(rig.baseline_mm)
    marks = {"3": (0, (-1, 0, -0.8), (-1, 0, 0.8)), "2": (4, (-1, -0.8, -0.8), (-1, 0.8, 0.8))}
    assert [length.pair for length in own.lengths] == list(marks)
    for length in own.lengths:
        k, *ends = marks[length.pair]
        box, T = walk.objects()[k], recordings.setup(f"room/{length.pair}")
        ends_mm = np.array(ends) * np.array(box.size_mm) / 2 @ box.T_world_box[:3, :3].T + box.T_world_box[:3, 3]
        np.testing.assert_allclose(length.pixels, rig.left.project(ends_mm @ T[:3, :3].T + T[:3, 3]), atol=0.5)
        assert length.ruler_mm == round(float(np.linalg.norm(ends_mm[1] - ends_mm[0])))
    assert [(each.name, bool(each.left), bool(each.scan)) for each in own.stations] == [
        (str(k), True, True) for k in range(1, 6)
    ]


def test_a_length_may_be_of_the_rectified_picture(folder):
    fill(folder, "pairs/1_left.png", "pairs/1_right.png")
    length = '[[length]]\npair = "1"\nfrom = [5, 6]\nto = [7, 8]\nruler_mm = 240\n'
    (folder / RIG_FILE).write_text(length)
    (raw,) = load_rig_folder(folder).lengths
    (folder / RIG_FILE).write_text(length + "rectified = true\n")
    (flat,) = load_rig_folder(folder).lengths
    assert (raw.is_rectified, flat.is_rectified) == (False, True) and raw.pixels == flat.pixels
    found = Between(np.zeros((2, 3)), np.zeros(2), 236.9, 1.0)
    assert "-3.1 mm off, which is more than 3 standard deviations (3.0 mm). Do the pixels" in raw.told(found)
    assert raw.told(replace(found, std_mm=1.1)).endswith("-3.1 mm off, within 3 standard deviations (3.3 mm)")


def test_what_recordings_do_not_allow_is_a_reason_and_a_fault_of_ours_is_none():
    assert tried(int, "5") == (5, "")
    assert tried(int, "five")[0] is None and "five" in tried(int, "five")[1]
    with pytest.raises(TypeError):
        tried(int, [])


def test_poses_of_the_folder_are_read(folder):
    fill(folder, "scans/1.bin", "scans/2.bin")
    (folder / "poses.csv").write_text("station,x_mm,y_mm,yaw_deg\n2,100,-50,90\n")
    first, second = load_rig_folder(folder).stations
    assert first.pose is None and second.pose == pytest.approx((100, -50, 1.5707963))
    (folder / "poses.csv").write_text("station,x_mm,y_mm,yaw_deg\n7,0,0,0\n")
    with pytest.raises(ValueError, match=r"poses\.csv, line 2: there is no station '7', only 1, 2"):
        load_rig_folder(folder)


def test_the_demo_rig_is_written_as_it_is_committed(tmp_path):
    committed = data_path("virtual/rig.toml").read_text()
    assert write_demo_file(tmp_path).read_text() == committed
    assert write_demo_file(str(tmp_path)).read_text() == committed


def test_paths_may_be_texts(folder):
    fill(folder, "1_left.png", "1_right.png", "scans/1.bin")
    assert load_rig_folder(str(folder)).folder == folder
    assert lying_there(str(folder)) == {"pairs": "*.png"} == lying_there(folder)
