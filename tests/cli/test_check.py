"""The check command: a calibration tried on other pictures, and one line for everything that is no check."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from stereolib import plotting
from stereolib.base import datasets
from stereolib.calibration import findings, fresh_check
from stereolib.cli import commands
from stereolib.cli.boards import said_of
from stereolib.cli.check import CHECK
from stereolib.rig import StereoRig

BOARDS = datasets.ROOT / "data" / "virtual" / "boards"
WORDS = ["--board", "9x6", "--square-mm", "25"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first twelve pairs calibrated, into rig; two others as fresh pictures."""
    folder = tmp_path_factory.mktemp("check")
    for side in ("left", "right"):
        (folder / side).mkdir()
        for k in range(1, 13):
            shutil.copy(BOARDS / f"{k:02d}_{side}.jpg", folder / side / f"{k:02d}.jpg")
        (folder / f"new_{side}").mkdir()
        for k in (17, 22):
            shutil.copy(BOARDS / f"{k:02d}_{side}.jpg", folder / f"new_{side}")
    sides = [str(folder / side) for side in ("left", "right")]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plotting, "write_calibration_report", lambda *_: None)  # stereolib calibrate's tests look at it
        assert commands.main(["calibrate", *sides, *WORDS, "--output", str(folder / "rig")]) == 0
    return folder


def words(folder: Path, *pairs: str, calibration: str = "rig/calibration.json") -> list[str]:
    return ["check", *(str(folder / pair) for pair in pairs), *WORDS, "--calibration", str(folder / calibration)]


def test_fresh_pictures_tell_that_it_is_still_good(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = folder / "check.png"
    assert commands.main([*words(folder, "new_left", "new_right"), "--picture", str(picture)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("still good: measure with it\n  nothing has moved that these pairs can tell\n")
    assert "2 pairs (17_left.jpg, 22_left.jpg), the board at" in said and "size: squares 0.0" in said
    drawn = cv2.imread(str(picture))
    assert f"picture: {picture}" in said
    assert drawn.shape[1] >= 1200 and (drawn < 200).any(axis=2).mean() > 0.01
    assert commands.main([*words(folder, "new_left", "new_right"), "--picture", str(picture)]) == 2
    assert "check.png would be overwritten" in capsys.readouterr().err


def test_one_pair_twice_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pair = "new_left/17_left.jpg", "new_right/17_right.jpg"
    assert commands.main(words(folder, *pair, *pair)) == 2
    assert "was given twice" in capsys.readouterr().err


def test_other_squares_and_a_bad_verdict_are_said_first(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stored = json.loads((folder / "rig" / "calibration.json").read_text(encoding="utf-8"))
    stored["calibration"] |= {"verdict": "bad", "reasons": ["the board or the ruler is measured wrong"]}
    (folder / "bad.json").write_text(json.dumps(stored), encoding="utf-8")
    assert said_of(folder / "rig" / "calibration.json", 25.0) == []
    bad, squares = said_of(folder / "bad.json", 24.0)
    assert "was judged bad when it was made (the board or the ruler is measured wrong)" in bad
    assert "was made with squares of 25 mm, now they are 24 mm" in squares
    commands.main(words(folder, "new_left", "new_right", calibration="bad.json"))
    assert "warning: " in capsys.readouterr().err
    (other,) = said_of(folder / "rig" / "calibration.json", 25.0, (8, 6))
    assert "with a board of 9x6 inner corners, now it is 8x6: which is right?" in other
    assert said_of(folder / "rig" / "calibration.json", 25.0, (6, 9)) == []


def test_one_pair_by_its_files_and_a_wrong_square_as_json(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one = words(folder, "new_left/17_left.jpg", "new_right/17_right.jpg")
    assert commands.main([*one, "--square-mm", "24", "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["verdict"] == "recalibrate" and told["moved"][0]["what"] == "baseline"
    assert told["board_pct"]["value"] == pytest.approx(4.17, abs=0.2)
    assert {"tilt", "yaw", "roll", "baseline"} <= set(told["fitted_together"])


def test_help_states_the_limits_that_are_applied() -> None:
    for limits, unit in ((fresh_check.ROWS_PX, "px"), (findings.ERROR_PCT, "%")):
        for limit, name in zip(limits, (r"still good.*(?:\n.*)?", "usable.*"), strict=True):
            assert re.search(rf"{name}\b{limit:g} {unit}", CHECK.notes), (limit, unit)


def test_what_made_the_calibration_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert commands.main(words(folder, "left", "right")) == 2
    assert "12 of 12 pairs made the calibration (01.jpg, 02.jpg" in capsys.readouterr().err


def test_a_rig_of_another_program_says_what_it_does_not_know(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    StereoRig.load(folder / "rig" / "calibration.json").save(folder / "bare.json")
    commands.main(words(folder, "new_left", "new_right", calibration="bare.json"))
    assert "whether these are fresh cannot be checked" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("pairs", "more", "hint"),
    [
        ("new_left", [], ": 17_left.jpg"),
        ("new_left new_right rig", [], "expected one or two of them"),
        ("new_left/17_left.jpg", [], ": 17_left.jpg"),
        ("new_left/17_left.jpg new_left/17_left.jpg", [], "was given for both cameras"),
        ("new_left/17_left.jpg nowhere.jpg", [], "nowhere.jpg: no such file"),
        ("new_left/17_left.jpg rig/calibration.json", [], "calibration.json"),
        ("new_left/17_left.jpg small.png", [], "17_left.jpg is 640x480"),
        ("new_left/17_left.jpg new_right/22_right.jpg", [], "do not fit together"),
        ("new_right/17_right.jpg new_left/17_left.jpg", [], "exchanged"),
        ("small.png small2.png", [], "no board of 9x6 inner corners was found"),
        ("new_left new_right", ["--board", "8x5"], "no board of 8x5 inner corners"),
        ("new_left new_right", ["--board", "8x5"], "with a board of 9x6 inner corners, now it is 8x5: which is right?"),
        ("new_left new_right", ["--square-mm", "2.5"], "with squares of 25 mm, now they are 2.5 mm: which is right?"),
        ("new_left new_right", ["--board", "9"], "inner corners, as 9x6"),
        ("new_left new_right", ["--square-mm", "no"], "--square-mm is an edge in mm"),
        ("new_left new_right", ["--calibration", "nowhere.json"], "nowhere.json: no such file"),
        ("new_left new_right", ["--calibration", str(BOARDS / "01_left.jpg")], "01_left.jpg"),
        ("new_left new_right", ["--picture", "check.jpg"], "the picture is written as .png"),
        ("new_left empty", [], "empty is empty"),
    ],
)
def test_wrong_input_is_one_line(
    pairs: str, more: list[str], hint: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("small.png", "small2.png"):
        cv2.imwrite(str(folder / name), np.zeros((240, 320), np.uint8))
    (folder / "empty").mkdir(exist_ok=True)
    assert commands.main([*words(folder, *pairs.split()), *more]) == 2
    error = capsys.readouterr().err
    assert hint in error and error.count("\n") == 1, error
