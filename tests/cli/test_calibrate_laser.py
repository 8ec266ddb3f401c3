"""The command `calibrate-laser`: which pose it replaces, and what it says of boards that do not fit."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import pytest

from stereolib.cli import commands
from stereolib.virtual import walk_folder

BOARD = ("--board", "6x9", "--margin-mm", "24")


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("walk")
    walk_folder.write_walk(folder)
    return folder


@pytest.fixture
def boards(walked: Path, tmp_path: Path) -> Path:
    """The walk's boards, and its rig with the laser's pose."""
    folder = tmp_path / "my walk"
    shutil.copytree(walked / "laser", folder / "laser")
    shutil.copy(walked / "calibration.json", folder / "rig.json")
    return folder


def run(boards: Path, *words: str, square_mm: str = "30") -> int:
    laser, rig = str(boards / "laser"), str(boards / "rig.json")
    given = ["calibrate-laser", laser, laser, "--calibration", rig, *BOARD, "--square-mm", square_mm, *words]
    return commands.main(given)


def shifted(rig: Path, mm: float) -> str:
    """The laser's pose in a rig file put elsewhere."""
    facts = json.loads(rig.read_text())
    facts["lidar"]["T_left_lidar"][0][3] += mm
    rig.write_text(json.dumps(facts))
    return rig.read_text()


def test_a_pose_found_again_is_replaced_and_one_elsewhere_is_kept(
    boards: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(boards) == 0 and run(boards) == 0
    said = capsys.readouterr().out
    assert "is replaced: this one lies 0.0 mm" in said
    assert f"next: stereolib measure LEFT RIGHT --scan FILE --calibration '{boards / 'rig.json'}'\n" in said
    shifted(boards / "rig.json", 4.0)
    assert run(boards) == 0
    before = shifted(boards / "rig.json", 30.0)
    assert run(boards) == 1 and (boards / "rig.json").read_text() == before
    said = capsys.readouterr().err
    assert "the laser was found 30.0 mm and 0.00 degrees off the pose that stands in" in said
    assert "beyond 4 standard deviations of both" in said and "that is kept; if it was moved since, add --force" in said
    assert run(boards, "--force") == 0 and (boards / "rig.json").read_text() != before


def test_squares_of_another_size_are_one_order(boards: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(boards, square_mm="25") == 1
    said = capsys.readouterr().err
    assert "the laser reads 16.6 % longer than the boards have it" in said
    assert "measure the squares of its board over many of them and give that as --square-mm; the pose that" in said
    assert "all is well" not in said and "use no scan" not in said


def test_the_picture_that_contradicts_is_named(boards: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(boards / "laser" / "10.jpg")
    nearer = cv2.getRotationMatrix2D((320, 240), 0, 1.05)
    cv2.imwrite(path, cv2.warpAffine(cv2.imread(path), nearer, (640, 480)))
    assert run(boards) == 2
    said = capsys.readouterr().err
    assert f"{boards / 'laser' / '10.jpg'} with {boards / 'laser' / '10.bin'} contradicts the other " in said
    assert "view" not in said and "If they were held so" not in said


def test_pictures_upside_down_are_among_the_causes(boards: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for path in (boards / "laser").glob("*.jpg"):
        cv2.imwrite(str(path), cv2.imread(str(path))[::-1, ::-1])
    assert run(boards) == 2
    assert "Are the pictures upside down, or pictures or scans mirrored?" in capsys.readouterr().err


def test_squares_counted_in_place_of_corners_are_among_the_causes(
    boards: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(boards, "--board", "7x10") == 2
    said = capsys.readouterr().err
    assert "01.jpg: the board was not found in it: count its inner corners, not squares, or take this pose out" in said
    assert said.endswith("; it shows a board of 9x6 inner corners\n")
    cv2.imwrite(str(boards / "laser" / "02.jpg"), cv2.imread(str(boards / "laser" / "02.jpg")) * 0)
    assert run(boards) == 2
    said = capsys.readouterr().err
    assert "02.jpg: the board was not found in it; take this pose out" in said and "shows" not in said
