"""Recordings as people have them, turned into pairs of files."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from stereolib.rig import find_pair, find_pairs, left_pictures, read_image, turned_by_exif

RNG = np.random.default_rng(0)


def make_files(folder: Path, *names: str, shape: tuple[int, int] = (8, 8)) -> Path:
    """Small pictures by these names; other kinds of files get a text."""
    folder.mkdir(parents=True, exist_ok=True)
    picture = cv2.imencode(".png", np.zeros(shape, np.uint8))[1].tobytes()
    for name in names:
        (folder / name).write_bytes(picture if name.endswith((".png", ".jpg")) else b"notes")
    return folder


def named(pairs: list) -> list[tuple[str, str]]:
    return [(a.name, b.name) for a, b in pairs]


def noisy(k: int, width: int = 64) -> np.ndarray:
    """A picture whose middle tells its number; sharp if the number is odd."""
    picture = RNG.integers(0, 255, (48, width, 3), np.uint8)
    if k % 2 == 0:
        picture = cv2.GaussianBlur(picture, (0, 0), 3)
    picture[16:32, 8:24] = picture[16:32, width - 24 : width - 8] = 8 * k
    return picture


def film(path: Path, frames: list[np.ndarray]) -> Path:
    size = frames[0].shape[1::-1]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10, size)
    for frame in frames:
        writer.write(frame)
    writer.release()
    return path


@pytest.mark.parametrize(
    ("left", "right", "expected"),
    [
        (["1", "2", "10"], ["1", "2", "10"], ["1 1", "2 2", "10 10"]),  # by number, not by letter
        (["left01", "left02", "left03"], ["right01", "right02", "right03"], ["left01 right01", "left02 right02"]),
        (["1_L", "2_L", "3_L"], ["3_R", "2_R", "1_R"], ["1_L 1_R", "2_L 2_R"]),
        (["imgL1", "imgL2", "imgL3"], ["imgR1", "imgR2", "imgR3"], ["imgL1 imgR1", "imgL2 imgR2"]),
        (["01", "02", "03"], ["1", "2", "3"], ["01 1", "02 2"]),
        (["bright-1", "bright-2", "bright-3"], ["bright-1", "bright-2", "bright-3"], ["bright-1 bright-1"]),
        (
            ["104.2", "99.1", "250.7", "8.1", "9.1"],
            ["104.3", "99.4", "251.0", "8.2", "9.2"],
            ["8.1 8.2", "9.1 9.2", "99.1 99.4"],
        ),
    ],
)
def test_names_that_belong_together(left: list[str], right: list[str], expected: list[str], tmp_path: Path) -> None:
    folders = [
        make_files(tmp_path / side, *(f"{name}.png" for name in [*names, "998", "999"][:5]))
        for side, names in (("a", left), ("b", right))
    ]
    (folders[0] / ".thumbs").write_text("hidden files are passed over")
    (folders[0] / "old").mkdir()
    pairs = named(find_pairs(*folders, least=5))
    assert len(pairs) == 5
    assert [" ".join(name.removesuffix(".png") for name in pair) for pair in pairs][: len(expected)] == expected


@pytest.mark.parametrize(
    ("left", "right", "hints"),
    [
        ("1.png 2.png 3.png 4.png 9.png", "1.png 2.png 3.png 4.png 7.png 8.png",
         ["without a partner in", "right: 9.png (8.png or 7.png?)", "left: 7.png (9.png?), 8.png (9.png?)"]),
        ("1.png 2.png 3.png", "1.png 2.png", ["without a partner in", "right: 3.png (3.png is missing)"]),
        ("1.png 2.png 3.png notes.txt Thumbs.db", "1.png 2.png 3.txt",
         ["no readable images", "left: Thumbs.db, notes.txt; in ", "right: 3.txt. Expected only pictures"]),
        ("1.png 2.png", "1.png 2.png", ["too few pairs, 2 (1.png, 2.png)", "at least 5"]),
        ("1.png 01.png 2.png", "1.png 2.png 3.png", ["01.png, 1.png cannot be told apart"]),
        ("", "1.png", ["left is empty"]),
        (" ".join(f"{k}.png" for k in range(12)), "50.png",
         ["0.png (50.png?), 1.png", "and 9 more", "as many on both sides (not 12 and 1)"]),
    ],
)  # fmt: skip
def test_folders_that_do_not_fit_are_listed(left: str, right: str, hints: list[str], tmp_path: Path) -> None:
    folders = [make_files(tmp_path / side, *names.split()) for side, names in (("left", left), ("right", right))]
    with pytest.raises(ValueError) as caught:
        find_pairs(*folders, least=5)
    assert not [hint for hint in hints if hint not in str(caught.value)], str(caught.value)


def test_many_without_a_partner_are_counted_in_a_short_text(tmp_path: Path) -> None:
    folder = make_files(tmp_path, *(f"left_{1000 + 14 * k}.png" for k in range(20)))
    make_files(tmp_path, *(f"right_{1003 + 14 * k}.png" for k in range(19)))
    with pytest.raises(ValueError) as caught:
        find_pairs(folder)
    text = str(caught.value).replace(str(folder), "")
    assert "left_1000.png" in text and "right_1003.png" in text
    assert "and 17 more; without" in text and "and 16 more. Expected" in text
    assert len(text) < 600


@pytest.mark.parametrize(
    ("above", "below"),
    [
        (("boards/left01.png", "boards/right01.png"), "boards"),
        (("rig.toml", "boards/left/1.png", "boards/right/1.png", ".old/left1.png"), "boards"),
        (("notes.txt", "boards/left01.png", "boards/right01.png", "empty/readme.txt", "pairs/1.png"), "boards pairs"),
    ],
)
def test_a_folder_one_level_too_high_is_told_which_is_meant(above: tuple[str], below: str, tmp_path: Path) -> None:
    for name in above:
        make_files((tmp_path / name).parent, Path(name).name)
    meant = " or ".join(str(tmp_path / name) for name in below.split())
    for find in (find_pairs, left_pictures):
        with pytest.raises(ValueError, match=re.escape(f"{tmp_path} itself holds no pictures: did you mean {meant}?")):
            find(tmp_path)


def test_pictures_of_a_rare_kind_stand_beside_a_folder_of_others(tmp_path: Path) -> None:
    for name in ("left1", "right1"):
        cv2.imwrite(str(tmp_path / f"{name}.pgm"), np.zeros((8, 8), np.uint8))
    make_files(tmp_path / "preview", "left1.png", "right1.png")
    assert named(find_pairs(tmp_path)) == [("left1.pgm", "right1.pgm")]


def test_one_folder_twice_and_none(tmp_path: Path) -> None:
    folder = make_files(tmp_path / "left", "1.png", "2.png", "3.png")
    with pytest.raises(ValueError, match="given for both cameras"):
        find_pairs(folder, tmp_path / "left" / ".." / "left", least=5)
    with pytest.raises(ValueError, match="nowhere: no such file or folder"):
        find_pairs(folder, tmp_path / "nowhere", least=5)


@pytest.mark.parametrize(
    "names",
    ["left01 right01 left02 right02", "L_3 R_3 L_10 R_10", "chessboard-L0 chessboard-R0 chessboard-L1 chessboard-R1",
     "3_L 3_R 4_L 4_R", "Im_L_1 Im_R_1 Im_L_2 Im_R_2", "cam0_5 cam1_5 cam0_12 cam1_12",
     "01_left 01_right 2_left 2_right", "brightleft1 brightright1 brightleft2 brightright2"],
)  # fmt: skip
def test_one_folder_with_both_sides(names: str, tmp_path: Path) -> None:
    expected = [f"{name}.png" for name in names.split()]
    folder = make_files(tmp_path, *expected)
    assert [name for pair in named(find_pairs(folder)) for name in pair] == expected
    assert find_pairs(f"{folder}/*.png") == find_pairs(folder)


@pytest.mark.parametrize("sides", [("left", "right"), ("L", "R"), ("cam0", "cam1")])
def test_a_folder_of_two_folders(sides: tuple[str, str], tmp_path: Path) -> None:
    for side in sides:
        make_files(tmp_path / side, "1.png", "2.png")
    assert [(a.parent.name, b.parent.name) for a, b in find_pairs(tmp_path)] == [sides, sides]


def test_patterns(tmp_path: Path) -> None:
    make_files(tmp_path, "a1.png", "a2.png", "b1.png", "b2.png")
    assert named(find_pairs(f"{tmp_path}/a*", f"{tmp_path}/b*")) == [("a1.png", "b1.png"), ("a2.png", "b2.png")]
    with pytest.raises(ValueError, match="no file has such a name"):
        find_pairs(f"{tmp_path}/c*", f"{tmp_path}/b*")


def test_the_likeliest_partners_are_named(tmp_path: Path) -> None:
    folder = make_files(tmp_path, "left01.png", "right01.png", "left02.png", "right2b.png")
    with pytest.raises(ValueError, match=r"left02.png \(left01.png|left02.png \(right"):
        find_pairs(folder)


@pytest.mark.parametrize(
    ("names", "alone", "missing"),
    [
        ("7_left 8_left 8_right", "7_left", "7_right"),
        ("R_3 R_10 L_10", "R_3", "L_3"),
        ("cam0_5 cam1_5 cam1_6", "cam1_6", "cam0_6"),
        ("Left1 Left2 Right2", "Left1", "Right1"),
    ],
)
def test_the_missing_partner_is_named_where_no_other_is_alone(
    names: str, alone: str, missing: str, tmp_path: Path
) -> None:
    folder = make_files(tmp_path, *(f"{name}.png" for name in names.split()))
    with pytest.raises(ValueError, match=rf": {alone}\.png \({missing}\.png is missing\)\. Expected"):
        find_pairs(folder)


def test_pictures_beside_each_other_are_cut_once(tmp_path: Path) -> None:
    for k in (1, 2):
        cv2.imwrite(str(tmp_path / f"{k}.png"), np.hstack([noisy(k), noisy(k + 8)]))
    pairs = find_pairs(tmp_path)
    assert named(pairs) == [("1_left.png", "1_right.png"), ("2_left.png", "2_right.png")]
    for k, (left, right) in enumerate(pairs, 1):
        assert (read_image(left)[20, 12, 0], read_image(right)[20, 12, 0]) == (8 * k, 8 * (k + 8))
    before = pairs[0].left.stat().st_mtime_ns
    assert find_pairs(tmp_path / "1.png") == pairs[:1]
    assert pairs[0].left.stat().st_mtime_ns == before
    cv2.imwrite(str(tmp_path / "1.png"), np.hstack([noisy(5), noisy(6), noisy(6)]))
    assert read_image(find_pairs(tmp_path / "1.png")[0].left).shape[1] == 96  # another picture, cut again


def test_a_video_for_each_camera(tmp_path: Path) -> None:
    videos = [film(tmp_path / f"{side}.avi", [noisy(k) for k in range(12)]) for side in ("l", "r")]
    pairs = find_pairs(*videos, every=4)
    assert len(pairs) == 3
    for left, right in pairs:
        tones = [np.median(read_image(side)[18:30, 10:22]) / 8 for side in (left, right)]
        assert tones == pytest.approx([int(left.stem[:6])] * 2, abs=0.5)
        assert int(left.stem[:6]) % 2, "a blurred frame was taken"
    assert len(find_pairs(*videos)) >= 6  # all that are sharp enough
    film(tmp_path / "short.avi", [noisy(k) for k in range(5)])
    with pytest.raises(ValueError, match=r"l.avi has 12 and short.avi has 5 frames"):
        find_pairs(videos[0], tmp_path / "short.avi")


def test_a_video_with_both_sides(tmp_path: Path) -> None:
    film(tmp_path / "both.avi", [np.hstack([noisy(k), noisy(k + 1)]) for k in range(6)])
    film(tmp_path / "one.avi", [noisy(k) for k in range(6)])
    assert [read_image(side).shape for side in find_pairs(tmp_path / "both.avi", every=3)[0]] == [(48, 64, 3)] * 2
    with pytest.raises(ValueError, match=r"one.avi is 64x48: .* Is it one camera's"):
        find_pairs(tmp_path / "one.avi")
    (tmp_path / "text.mp4").write_text("no video")
    with pytest.raises(ValueError, match=r"text.mp4: not a readable video"):
        find_pairs(tmp_path / "text.mp4")
    with pytest.raises(ValueError, match="every 0 frames"):
        find_pairs(tmp_path / "both.avi", every=0)


def test_sizes_are_told_before_anything_is_searched(tmp_path: Path) -> None:
    make_files(tmp_path / "left", "1.png", "2.png")
    make_files(tmp_path / "right", "1.png")
    make_files(tmp_path / "right", "2.png", shape=(8, 10))
    with pytest.raises(ValueError, match=r"most are 8x8, but:\n.*2.png is 10x8"):
        find_pairs(tmp_path)


def test_cameras_of_a_size_each_are_told(tmp_path: Path) -> None:
    make_files(tmp_path / "left", "1.png", "2.png")
    make_files(tmp_path / "right", "1.png", "2.png", shape=(8, 10))
    with pytest.raises(ValueError, match=r"^left pictures are 8x8, right ones 10x8: set both cameras to one size"):
        find_pairs(tmp_path)


def test_half_the_pictures_are_not_most(tmp_path: Path) -> None:
    make_files(tmp_path, "left1.png", "right1.png")
    make_files(tmp_path, "left2.png", "right2.png", shape=(8, 10))
    with pytest.raises(ValueError, match=r"some are 8x8, but:\n.*left2.png is 10x8\n.*right2.png is 10x8"):
        find_pairs(tmp_path)


def test_scans_of_a_laser_are_passed_over(tmp_path: Path) -> None:
    folder = make_files(tmp_path, "1_left.png", "1_right.png", "1_scan.bin")
    assert named(find_pairs(folder)) == [("1_left.png", "1_right.png")]
    with pytest.raises(ValueError, match=r"no readable images, in .*1_scan\.bin"):
        find_pairs(make_files(tmp_path / "scans", "1_scan.bin"))


def test_names_that_tell_no_side(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="tell no side"):
        find_pairs(make_files(tmp_path / "a", "1.png", "2.png"))
    with pytest.raises(ValueError, match=r"other.png .* neither of the left nor of the right"):
        find_pairs(make_files(tmp_path / "b", "left1.png", "right1.png", "other.png"))


def test_one_pair(tmp_path: Path) -> None:
    """Two pictures belong together whatever their names; what holds several pairs has to be told apart."""
    folder = make_files(tmp_path / "some", "left1.png", "right1.png")
    assert named([find_pair(folder)]) == [("left1.png", "right1.png")]
    assert find_pair(folder / "right1.png", folder / "none.png") == (folder / "right1.png", folder / "none.png")
    wide = folder / "wide.png"
    cv2.imwrite(str(wide), noisy(1, 128))
    assert [read_image(side).shape for side in find_pair(wide)] == [(48, 64, 3)] * 2
    with pytest.raises(ValueError, match=r"left1\.png is 8x8, the picture of one camera"):
        find_pair(folder / "left1.png")
    wide.unlink()
    make_files(folder, "left2.png", "right2.png")
    with pytest.raises(ValueError, match=r"some: 2 pairs, one is wanted: .*left1.png .*right1.png"):
        find_pair(folder)


def test_all_pictures_that_are_cut_short_are_named_at_once(tmp_path):
    whole = cv2.imencode(".jpg", np.random.default_rng(0).integers(0, 255, (48, 64), np.uint8))[1].tobytes()
    for k in range(4):
        for side in ("left", "right"):
            (tmp_path / f"{side}{k}.jpg").write_bytes(whole)
    (tmp_path / "left0.jpg").write_bytes(whole[:20])
    (tmp_path / "right2.jpg").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ValueError, match=r"2 of 8 files are no readable images:(?s:.*)left0\.jpg(?s:.*)right2\.jpg"):
        find_pairs(tmp_path)
    (tmp_path / "right3.jpg").write_bytes(b"none")
    with pytest.raises(ValueError, match=r"no readable images, in .*: left0\.jpg, right2\.jpg, right3\.jpg"):
        find_pairs(tmp_path)


def test_a_single_picture_where_many_pairs_are_wanted_is_told_what_is_wanted(tmp_path):
    cv2.imwrite(str(tmp_path / "01_left.png"), np.zeros((48, 64), np.uint8))
    for source in (tmp_path, tmp_path / "01_left.png"):
        with pytest.raises(ValueError, match=r"01_left\.png is a single picture, pairs .* wanted: at least 5 with"):
            find_pairs(source, least=5)


def with_exif(path: Path, orientation: int) -> Path:
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(noisy(1)).save(path, exif=exif.tobytes())
    return path


def test_pictures_of_one_camera_of_which_exif_turns_some_are_named(tmp_path: Path) -> None:
    for k in range(4):
        with_exif(tmp_path / f"{k}_left.jpg", 3)  # a camera that hangs upside down, and says so
        with_exif(tmp_path / f"{k}_right.jpg", 1)
    assert len(find_pairs(tmp_path)) == 4
    with_exif(tmp_path / "2_right.jpg", 3)
    with pytest.raises(
        ValueError, match=r"^2_right\.jpg in .*: EXIF turns it unlike the other pictures of that camera"
    ):
        find_pairs(tmp_path)


def test_what_exif_turned_is_told(tmp_path: Path) -> None:
    files = [with_exif(tmp_path / f"{turn}.jpg", turn) for turn in (1, 3, 6, 5)]
    (text := tmp_path / "notes.txt").write_text("no picture")
    assert turned_by_exif([*files[:1], text]) == ""
    assert turned_by_exif(files[:2]).startswith("3.jpg was turned by 180 degrees as the EXIF in it says: ")
    many = "3.jpg, 6.jpg, 5.jpg were turned by 180 degrees or mirrored or turned by 90 degrees as the EXIF in them"
    assert turned_by_exif(files).startswith(many)
