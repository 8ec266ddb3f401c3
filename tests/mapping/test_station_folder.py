"""Folders of recordings: what belongs together, and what is wrong with files."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from stereolib.mapping import list_stations, name_scans, read_scan
from stereolib.virtual import walk

GREY = np.full((48, 64, 3), 90, np.uint8)


@pytest.fixture
def folder(tmp_path):
    for name in ("1_left", "1_right", "10_left", "10_right"):
        cv2.imwrite(str(tmp_path / f"{name}.png"), GREY)
    for name in ("1", "02"):
        (tmp_path / f"{name}_scan.bin").write_bytes(walk.scan_bytes("room/1"))
    return tmp_path


def test_files_are_told_apart_by_their_names(folder):
    for name in ("door_left.JPG", "door-right.jpg"):
        cv2.imwrite(str(folder / name), GREY)
    for name in ("calibration.json", "1_scan.bin.json", ".hidden_left.png", "notes.txt"):
        (folder / name).write_text("{}")
    (folder / "poses.csv").write_text("station, x_mm,y_mm,yaw_deg\n01,10,-20.5,90\n\ndoor,0,0,0\n")
    found = list_stations(folder)
    assert [s.name for s in found.stations] == ["1", "2", "10", "door"]
    kinds = [(s.left is not None, s.scan is not None) for s in found.stations]
    assert kinds == [(True, True), (False, True), (True, False), (True, False)]
    assert found.unused == ("notes.txt",)  # what `lrf record` writes beside a scan belongs to it
    assert found.stations[0].pose == pytest.approx((10, -20.5, np.pi / 2)) and found.stations[1].pose is None
    assert found.stations[0].read_pair((64, 48))[1].shape == (48, 64, 3) and found.stations[1].read_pair((1, 1)) is None
    assert list_stations(folder, _poses(folder, "2,1,2,3")).stations[1].pose == pytest.approx((1, 2, np.radians(3)))


def test_what_lies_with_the_scans_and_is_none_is_unused(folder):
    (folder / "scans").mkdir()
    (folder / "scans" / "10.txt").write_bytes(walk.scan_bytes("room/1"))
    found = list_stations(folder)
    assert found.unused == ("scans/10.txt",) and found.stations[-1].scan is None


def test_paths_may_be_texts(folder):
    assert list_stations(str(folder)) == list_stations(folder)
    assert read_scan(str(folder / "1_scan.bin")).complete and name_scans(["2_scan.bin"]).keys() == {"2"}
    assert list_stations(str(folder), str(_poses(folder, "2,1,2,3"))).stations[1].pose
    with pytest.raises(ValueError, match="x is no folder"):
        list_stations("x")


def test_a_scan_of_which_every_turn_lost_a_packet_is_read(folder):
    """22 bytes make a packet, 90 of them a turn: one of each is damaged."""
    scan = folder / "1_scan.bin"
    whole, data = read_scan(scan), bytearray(scan.read_bytes())
    for at in range(10 * 22 + 5, len(data), 90 * 22):
        data[at] ^= 0xFF
    scan.write_bytes(data)
    seen = read_scan(scan)
    assert (
        np.isfinite(whole.ranges_mm).sum() - 4
        <= np.isfinite(seen.ranges_mm).sum()
        <= np.isfinite(whole.ranges_mm).sum()
    )
    both = np.isfinite(whole.ranges_mm) & np.isfinite(seen.ranges_mm)
    assert np.abs(seen.ranges_mm - whole.ranges_mm)[both].max() < 20
    scan.write_bytes(data[: 45 * 22])  # half a turn is none
    with pytest.raises(ValueError, match=r"1_scan\.bin: .*turn"):
        read_scan(scan)


def test_a_scan_of_which_most_is_damaged_is_refused(folder):
    """Of a hundred bytes ten are others: a checksum fits some packets by chance."""
    scan = next(folder.glob("*scan.bin"))
    data = np.frombuffer(scan.read_bytes(), np.uint8).copy()
    rng = np.random.default_rng(4)
    hit = rng.random(len(data)) < 0.1
    data[hit] = rng.integers(0, 256, hit.sum())
    scan.write_bytes(data.tobytes())
    with pytest.raises(ValueError, match=rf"{scan.name}: \d+ of \d+ packets are damaged: see to cable"):
        read_scan(scan)


def test_scan_as_a_table_is_the_recorded_one(folder):
    recorded = list_stations(folder).stations[0].read_scan()
    rows = [f"{k},{'' if np.isnan(r) else r}" for k, r in enumerate(recorded.ranges_mm)]
    rows[7] = "7,0"
    (folder / "3_scan.csv").write_text("\n".join(["angle_deg,range_mm", *rows]))
    table = list_stations(folder).stations[2].read_scan()
    expected = np.where(np.arange(360) == 7, np.nan, recorded.ranges_mm)
    np.testing.assert_array_equal(table.ranges_mm, expected)
    np.testing.assert_allclose(table.angles_rad, recorded.angles_rad, atol=1e-12)
    assert table.emitter_offset_mm == recorded.emitter_offset_mm


def _poses(folder, *rows, head="station,x_mm,y_mm,yaw_deg"):
    path = folder / "other.csv"
    path.write_text("\n".join([head, *rows]))
    return path


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda f: (f / "1_right.png").unlink(), r"without a partner of the right one in .*: 1_left\.png"),
        (lambda f: (f / "1_scan.csv").touch(), "station 1 has two files for its scan, 1_scan.bin and 1_scan.csv"),
        (lambda f: (f / "2_scan.bin").touch(), "station 2 has two files for its scan, 02_scan.bin and 2_scan.bin"),
        (lambda f: (f / "1_scan.bin").rename(f / "1_scan.png"), r"1_scan\.png: the scan of a station is .bin or .csv"),
        (lambda f: [path.unlink() for path in f.iterdir()], "holds no station: expected 1_left.png"),
    ],
)
def test_folders_that_make_no_sense_are_refused(folder, spoil, message):
    spoil(folder)
    with pytest.raises(ValueError, match=message):
        list_stations(folder)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (["7,0,0,0"], r"line 2: there is no station '7', only 1, 2, 10"),
        (["1,0,0,0", "", "01,0,0,0"], "line 4: the pose of station 1 stands there twice"),
        (["1,0,nowhere,0"], "line 2: 'nowhere' is no number"),
        (["1,0,nan,0"], "line 2: 'nan' is no number"),
        (["1,0,0"], "line 2: 4 values are expected"),
        (["1,-0.675,-0.2,50", "2,1.52,-0.66,123"], "x_mm and y_mm are 1.52 at most, as if in metres: millimetres"),
    ],
)
def test_poses_that_make_no_sense_are_refused(folder, rows, message):
    with pytest.raises(ValueError, match=message):
        list_stations(folder, _poses(folder, *rows))
    with pytest.raises(ValueError, match="first line must be station,x_mm,y_mm,yaw_deg"):
        list_stations(folder, _poses(folder, *rows, head="name,x,y"))


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([f"{k},500" for k in range(20)], "20 beams: too few"),
        ([f"{-k},500" for k in range(100)], "grow in even steps"),
        ([f"{k**1.01},500" for k in range(100)], "grow in even steps"),
        ([f"{4 * k},500" for k in range(100)], "within one turn"),
        ([f"{k},far" for k in range(100)], "line 2: 'far' is no number"),
        ([f"{k},{500 - 600 * (k == 7)}" for k in range(100)], "range_mm is -100 at 7 degrees, a distance is never"),
        (
            [f"{k},{1.5 + k / 100}" for k in range(360)],
            "range_mm is 5.09 at most, as if in metres",
        ),
        ([f"{k},{80 + k // 6}" for k in range(360)], "half of range_mm is 110 or less, .* as if in centimetres"),
        ([f"{k},1500" for k in range(360)], "range_mm is 1500 in all 360 beams with a reading"),
        ([f"{np.radians(k)},500" for k in range(360)], "angle_deg runs from 0 to 6.27 only, as if in radians"),
        ([f"{np.radians(k)},500" for k in range(-180, 180)], "from -3.14 to 3.12 only, as if in radians"),
        (["0,0,500,5"], r"line 2: 2 values are expected \(angle_deg,range_mm; points in numbers\)"),
    ],
)
def test_tables_that_are_no_scan_are_refused(folder, rows, message):
    (folder / "5_scan.csv").write_text("\n".join(["angle_deg,range_mm", *rows]))
    with pytest.raises(ValueError, match=message):
        list_stations(folder).stations[2].read_scan()


@pytest.mark.parametrize("mark", [";", "\t"])
def test_a_table_of_another_mark_between_columns_is_told_which_to_take(folder, mark):
    (folder / "5_scan.csv").write_text(f"angle_deg{mark}range_mm\n0{mark}500,5\n")
    with pytest.raises(ValueError, match=r"must be angle_deg,range_mm; .*: commas between columns, points in"):
        list_stations(folder).stations[2].read_scan()


@pytest.mark.parametrize("rows", [["1,0,0,0", "2,0,0,90"], ["1,2,1,0"], ["1,0,0,0", "2,0,-25,90"]])
def test_poses_near_the_origin_that_may_be_right_are_taken(folder, rows):
    assert list_stations(folder, _poses(folder, *rows)).stations[0].pose is not None


def test_files_of_the_tool_and_the_poses_that_were_given_are_not_unused(folder):
    (folder / "capture.json").write_text("{}")
    assert list_stations(folder, _poses(folder, "1,0,0,0")).unused == ()
    assert list_stations(folder).unused == ("other.csv",)


@pytest.mark.parametrize(
    "names",
    [
        ("left01.png", "right01.png", "left02.png", "right02.png", "scan_1.bin"),
        ("Im_L_1.png", "Im_R_1.png", "Im_L_2.png", "Im_R_2.png", "1_scan.bin"),
        ("left/01.png", "right/01.png", "left/02.png", "right/02.png", "scans/1.bin"),
        ("chessboard-L1.png", "chessboard-R1.png", "chessboard-L2.png", "chessboard-R2.png", "01.bin"),
    ],
)
def test_pairs_are_named_as_everywhere_and_scans_follow_their_number(tmp_path, names):
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        if name.endswith(".png"):
            cv2.imwrite(str(tmp_path / name), GREY)
    (tmp_path / names[-1]).write_bytes(walk.scan_bytes("room/1"))
    found = list_stations(tmp_path)
    assert [(bool(s.left), bool(s.scan)) for s in found.stations] == [(True, True), (True, False)]
    assert found.stations[0].scan.name == names[-1].rsplit("/", maxsplit=1)[-1] and not found.unused
