"""The calibrate command: pairs by name, bad folders by name, and a verdict that holds against the virtual rig."""

from __future__ import annotations

import argparse
import base64
import json
import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image

from stereolib import plotting
from stereolib.base import datasets, plus_minus
from stereolib.calibration import JUDGED_AT_MM, LENS_MODELS, Charuco, boards_per_cell, wording
from stereolib.cli import commands
from stereolib.cli.boards import parse_board
from stereolib.cli.calibrate import CALIBRATE
from stereolib.paper import paper_rig
from stereolib.plotting import calibration_report, lens_shift_px, uncovered_text, write_calibration_report
from stereolib.rig import Camera, formats
from stereolib.virtual.recordings import BOARD

BOARDS = datasets.ROOT / "data" / "virtual" / "boards"
WORDS = ["--board", "9x6", "--square-mm", "25"]


def copy_boards(folder: Path, numbers: range) -> list[str]:
    """The committed board pairs as ``left/01.jpg`` and ``right/01.jpg``; returns the two folders."""
    for side in ("left", "right"):
        (folder / side).mkdir(parents=True)
        for k in numbers:
            shutil.copy(BOARDS / f"{k:02d}_{side}.jpg", folder / side / f"{k:02d}.jpg")
    return [str(folder / "left"), str(folder / "right")]


def make_files(folder: Path, *names: str) -> Path:
    """Small pictures by these names; other kinds of files get a text."""
    folder.mkdir(parents=True, exist_ok=True)
    picture = cv2.imencode(".png", np.zeros((8, 8), np.uint8))[1].tobytes()
    for name in names:
        (folder / name).write_bytes(picture if name.endswith((".png", ".jpg")) else b"notes")
    return folder


def named(pairs: list[tuple[Path, Path]]) -> list[tuple[str, str]]:
    return [(a.name, b.name) for a, b in pairs]


@pytest.mark.parametrize("turned", [("left",), ("left", "right")])
def test_a_camera_that_exif_turns_is_named_as_the_cause(turned: tuple[str], tmp_path: Path, capsys) -> None:
    for side in ("left", "right"):
        (tmp_path / side).mkdir()
        for k in range(1, 8):
            exif = Image.Exif()
            exif[0x0112] = 3 if side in turned else 1
            Image.open(BOARDS / f"{k:02d}_{side}.jpg").save(tmp_path / side / f"{k:02d}.jpg", exif=exif.tobytes())
    assert commands.main(["calibrate", str(tmp_path), *WORDS, "--output", str(tmp_path / "rig")]) == 2
    said = capsys.readouterr().err
    assert ("exchanged" if len(turned) > 1 else "Is one camera upside down, or mirrored? 01.jpg, 02.jpg") in said
    assert "01.jpg, 02.jpg, 03.jpg and" in said and "were turned by 180 degrees as the EXIF in them says" in said


def test_errors_are_judged_where_the_library_judges_them() -> None:
    assert commands.make_parser().parse_args(["calibrate", "pairs", *WORDS]).at_mm == JUDGED_AT_MM


def test_board_in_inner_corners() -> None:
    assert parse_board("9x6", "25") == parse_board(" 9 X 6 ", "25.0") == BOARD
    np.testing.assert_allclose(parse_board("9x6", "24.8x25.1").points_mm[-1], [8 * 24.8, 5 * 25.1, 0], rtol=1e-6)
    for text in ("9", "9x6x2", "axb", "-9x6", "9.5x6", ""):
        with pytest.raises(ValueError, match="inner corners"):
            parse_board(text, "25")
    assert parse_board("6x6", "25", marker_mm=18.5, legacy=True) == Charuco(6, 6, 25, 18.5, legacy=True)
    with pytest.raises(ValueError, match="unknown ArUco dictionary '7X7'"):
        parse_board("6x6", "25", marker_mm=18.5, dictionary="7X7")


def test_every_is_taken_for_a_video(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "board.MP4").write_bytes(b"")
    assert commands.main(["calibrate", str(tmp_path / "board.MP4"), *WORDS, "--every", "3"]) == 2
    assert "board.MP4" in (said := capsys.readouterr().err) and "--every" not in said


def test_a_file_in_the_way_is_said_before_any_work(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = [f"{k}.png" for k in range(5)]
    folders = [str(make_files(tmp_path / side, *names)) for side in ("left", "right")]
    (tmp_path / "rig").write_text("notes")
    assert commands.main(["calibrate", *folders, *WORDS, "--output", str(tmp_path / "rig" / "new")]) == 2
    assert "--output must name a folder" in capsys.readouterr().err


def test_help_states_the_limits_that_are_applied() -> None:
    from stereolib.calibration import findings

    for limit, line in zip(findings.ERROR_PCT, ("good", "usable"), strict=True):
        assert re.search(rf"{line}.*\b{limit:g} %", CALIBRATE.notes), limit
        assert f"{limit:g} %" in wording.VERDICT_MEANINGS[line]
    assert "default: 1000" in make_help()
    assert all(name in make_help() for name in LENS_MODELS)


def make_help() -> str:
    parser = argparse.ArgumentParser()
    CALIBRATE.configure(parser)
    return parser.format_help()


# --- folders as they come


@pytest.fixture(scope="module")
def boards(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Five pairs of the virtual boards, found once: later searches take them from beside the pictures."""
    return copy_boards(tmp_path_factory.mktemp("boards"), range(1, 6))


@pytest.mark.parametrize(
    ("harm", "hints"),
    [
        ("cut", ["03.jpg", "cut short"]),
        ("size", ["03.jpg", "320x240", "640x480"]),
        ("blank", ["found in both views of only 2 pairs (01.jpg, 02.jpg)", "03.jpg, 04.jpg, 05.jpg"]),
    ],
)
def test_bad_pictures_are_named(
    harm: str, hints: list[str], boards: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folders = [str(shutil.copytree(folder, tmp_path / Path(folder).name)) for folder in boards]
    third = Path(folders[1]) / "03.jpg"
    if harm == "cut":
        third.write_bytes(third.read_bytes()[:5000])
    elif harm == "size":
        cv2.imwrite(str(third), np.zeros((240, 320), np.uint8))
    else:
        for name in ("03.jpg", "04.jpg", "05.jpg"):
            cv2.imwrite(str(third.with_name(name)), np.zeros((480, 640), np.uint8))
    assert commands.main(["calibrate", *folders, *WORDS, "--output", str(tmp_path / "rig")]) == 2
    error = capsys.readouterr().err
    assert not [hint for hint in hints if hint not in error], error
    assert not (tmp_path / "rig").exists()


@pytest.mark.slow
def test_the_wrong_board_is_said(boards: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["calibrate", *boards, "--board", "10x7", "--square-mm", "25", "--output", str(tmp_path)]
    assert commands.main(words) == 2
    error = capsys.readouterr().err
    assert "10x7 inner corners" in error and "01.jpg" in error
    words = ["calibrate", *boards, *WORDS, "--marker-mm", "18", "--dictionary", "4X4_50", "--output", str(tmp_path)]
    assert commands.main(words) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in ("4X4_50, 18 mm on squares of 25 mm", "legacy", "no markers?"))


# --- a good set: the verdict against the rig that the pictures were rendered through


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[int, Path, list[str]]:
    folder = tmp_path_factory.mktemp("good")
    words = ["calibrate", *copy_boards(folder, range(1, 19)), *WORDS, "--output", str(folder / "rig"), "--json"]
    return commands.main(words), folder / "rig", words


@pytest.fixture(scope="module")
def kept(done: tuple[int, Path, list[str]]) -> dict[str, Any]:
    return json.loads((done[1] / "calibration.json").read_text(encoding="utf-8"))


def test_truth_lies_within_four_standard_deviations(done: tuple[int, Path, list[str]], kept: dict[str, Any]) -> None:
    assert done[0] == 0
    truth, found, std = paper_rig(), formats.load_rig(done[1] / "calibration.json"), kept["calibration"]["std"]
    for side in ("left", "right"):
        ours, true = getattr(found, side), getattr(truth, side)
        off = np.append((ours.K - true.K)[[0, 1, 0, 1], [0, 1, 2, 2]], ours.dist - true.dist)
        assert (np.abs(off) < 4 * np.append(std["K"][side], std["dist"][side])).all(), off
    assert (np.abs(found.T - truth.T) < 4 * np.array(std["T"])).all()
    assert abs(found.baseline_mm - truth.baseline_mm) < min(0.05, 4 * std["baseline_mm"])
    turn = np.ravel(cv2.Rodrigues(found.R @ truth.R.T)[0])
    assert (np.abs(turn) < 4 * np.array(std["R_rad"])).all()
    assert kept["calibration"]["rms_px"] < 0.1 and kept["calibration"]["verdict"] in ("good", "usable")
    assert kept["calibration"]["pairs_used"] == [f"{k:02d}.jpg" for k in range(1, 19)]


@pytest.mark.slow
def test_nothing_is_overwritten_unless_forced(
    done: tuple[int, Path, list[str]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    rig = shutil.copytree(done[1], tmp_path / "rig")
    words = [str(rig) if word == str(done[1]) else word for word in done[2]]
    files = [rig / name for name in ("calibration.json", "report.html")]
    before = [path.read_bytes() for path in files]
    assert commands.main(words) == 2
    assert re.search(r"calibration\.json, \S+report\.html would be overwritten.*--force", capsys.readouterr().err)
    assert [path.read_bytes() for path in files] == before
    files[0].write_text("older")
    monkeypatch.setattr(plotting, "write_calibration_report", lambda path, *_: path.write_text("anew"))
    assert commands.main([*words, "--force"]) == 0
    assert files[1].read_text() == "anew"
    printed, kept = json.loads(capsys.readouterr().out), json.loads(files[0].read_text(encoding="utf-8"))
    assert {"verdict", "rms_px", "K", "dist", "R", "T", "baseline_mm", "std", "pairs_used", "pairs_refused"} <= set(
        printed
    )
    assert printed["R"] == kept["R"] and printed["T"] == kept["T_mm"] and printed["K"]["left"] == kept["left"]["K"]
    assert {name: printed[name] for name in kept["calibration"]} == kept["calibration"]


def test_a_ruler_that_agrees_is_told(
    done: tuple[int, Path, list[str]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(plotting, "write_calibration_report", lambda *_: None)  # that of `done` is looked at
    folders = done[2][1:3]
    rig = tmp_path / "my rig"  # whose name a shell takes in quotes alone
    assert commands.main(["calibrate", *folders, *WORDS, "--ruler-mm", "93", "--output", str(rig)]) == 0
    said = capsys.readouterr().out
    assert "distance of the lenses 93.1 mm; the ruler says 93.0 mm: +0.1 mm off\n" in said
    assert f"next: open '{rig / 'report.html'}'; then stereolib measure" in said
    assert f"--calibration '{rig / 'calibration.json'}'\n" in said


def test_without_a_ruler_one_is_asked_for_and_a_terminal_sees_what_is_done(
    boards: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(plotting, "write_calibration_report", lambda *_: None)
    words = ["calibrate", *boards, "--board", "9x6", "--square-mm", "26", "--output", str(tmp_path / "rig")]
    commands.main(words)
    printed = capsys.readouterr()
    assert re.search(r"\ndistance of the lenses 9\d\.\d mm; does a ruler say so\? .*--ruler-mm", printed.out)
    assert not printed.err
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    commands.main([*words, "--force"])
    assert re.search(r"calibrating with 5 pairs \.\.\.\ndrawing the report", capsys.readouterr().err)


@pytest.mark.slow
def test_files_of_other_tools_hold_the_same_rig(
    done: tuple[int, Path, list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plotting, "write_calibration_report", lambda *_: None)  # that of `done` is looked at
    words = [
        *done[2][:-2],
        str(tmp_path),
        "--model",
        "brown2",
        *["--format", "opencv", "--format", "ros", "--format", "kalibr"],
    ]
    assert commands.main(words) == 0
    kept = formats.load_rig(tmp_path / "calibration.json")
    for names in (["opencv.yml"], ["left.yaml", "right.yaml"], ["camchain.yaml"]):
        read = formats.load_rig(*(tmp_path / name for name in names))
        np.testing.assert_allclose(read.T, kept.T, atol=1e-6)
        np.testing.assert_allclose(read.right.dist[:4], kept.right.dist, atol=1e-12)


def test_report_is_one_file_with_the_pictures(done: tuple[int, Path, list[str]]) -> None:
    page = (done[1] / "report.html").read_text(encoding="utf-8")
    assert "9 x 6 inner corners, squares of 25 mm; 18 of 18 pairs of 640 x 480 px; lens model brown3" in page
    assert re.findall(r"<h2>(.*?)</h2>", page) == [
        "Checked", "Result", "Corners found", "Coverage", "Errors", "Worst corners", "Lenses",
        "Uncertainty", "Pairs"]  # fmt: skip
    sources = re.findall(r"<img[^>]*src=\"([^\"]*)\"", page)
    assert len(sources) == 7 and not re.search(r"https?:|<script|<link|url\(", page)
    for source in sources:
        picture = base64.b64decode(source.removeprefix("data:image/png;base64,"))
        drawn = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
        assert (drawn < 200).any(axis=2).mean() > 0.01
    assert str(done[1]) not in page and len(page) < 3e6


# --- what is printed of a result


@pytest.fixture(scope="module")
def diagnosis() -> Any:
    from support.corners import corner_set

    from stereolib.calibration import diagnose

    return diagnose(corner_set(np.random.default_rng(5), pairs=12))


def test_text_says_what_is_asked_with_deviations(diagnosis: Any) -> None:
    shown = wording.calibration_text(
        replace(diagnosis, verdict="bad", reasons=("too <few>",), pairs_refused={"odd.jpg": "moved"})
    )
    lines = shown.splitlines()
    assert sum(line.startswith("advice") for line in lines) <= 3
    assert re.match(r"bad +do not measure with it", lines[0]) and re.match(r"because +too <few>$", lines[2])
    assert re.match(r"at 1000 mm +depth ± 0\.\d+ mm \(0\.\d+ %\), a length of 100 mm ± 0\.\d+ mm$", lines[1])
    assert re.search(r"^baseline \(mm\) +93\.\d+ ± 0\.\d\d+$", shown, re.M)
    assert re.search(r"^K left \(px\) +fx 7\d\d\.\d+ ± 0\.\d+  fy .* cx .* cy ", shown, re.M)
    assert re.search(r"^dist right +k1 .*±.* p2 .*\s+k3 .*±", shown, re.M)
    assert re.search(r"^T \(mm\) +x -93\.\d+ ± ", shown, re.M)
    assert "odd.jpg: moved" in shown and re.search(r"^pairs refused +1$", shown, re.M)


def test_numbers_carry_two_digits_of_their_deviation() -> None:
    assert plus_minus(729.9077, 0.1234) == "729.91 ± 0.12"
    assert plus_minus(-0.00069, 0.000123) == "-0.00069 ± 0.00012"
    assert plus_minus(-0.0012, 0.62) == "0.00 ± 0.62"
    assert plus_minus(1234.5, 45.6) == "1234 ± 46"
    assert plus_minus(5.25, float("nan")) == "5.25"


def test_facts_are_json_even_where_something_is_unknown(diagnosis: Any) -> None:
    unknown = replace(diagnosis, square_error_pct=float("nan"), pairs_refused={"x": "y"})
    told = json.loads(json.dumps(wording.calibration_facts(unknown), allow_nan=False))
    assert told["errors"]["square_pct"] is None and told["pairs_refused"] == {"x": "y"}
    np.testing.assert_array_equal(told["K"]["right"], diagnosis.rig.right.K)


def test_what_the_rim_costs_is_told_beside_what_is_covered(diagnosis: Any) -> None:
    size = diagnosis.views.size
    cells = [boards_per_cell(diagnosis.views.left_px, size) == 0, diagnosis.error_map.depth_mm]
    said = re.fullmatch(
        r"no board was seen in (\d+) % of the left picture, hatched: a depth there is unsure by (\S+) mm \(median\), "
        r"elsewhere by (\S+) mm",
        uncovered_text(diagnosis),
    )
    assert said and int(said[1]) == round(100 * cells[0].mean()) and float(said[2]) > float(said[3])
    assert cells[1][np.isfinite(cells[1])].min() < float(said[3]) < float(said[2]) < np.nanmax(cells[1])


def test_report_escapes_names_and_does_without_pictures(
    diagnosis: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(calibration_report, "_embedded", lambda _: "")  # the figures of `done` are looked at
    odd = replace(diagnosis, pairs_refused={"<b>.jpg": "moved & turned"}, advice=("a < b",))
    page = write_calibration_report(tmp_path / "report.html", odd, {}).read_text(encoding="utf-8")
    assert "&lt;b&gt;.jpg: moved &amp; turned" in page and "a &lt; b" in page and "<b>.jpg" not in page


def test_lens_map_is_the_shift_that_the_lens_makes() -> None:
    K = np.array([[700.0, 0, 320], [0, 700, 240], [0, 0, 1]])
    columns, rows, shift = lens_shift_px(Camera(K, np.zeros(0), (640, 480)))
    assert (columns[-1], rows[-1]) == (639, 479) and np.abs(shift).max() < 1e-9
    lens = Camera(K, np.array([-0.2, 0, 0, 0]), (640, 480))
    columns, rows, shift = lens_shift_px(lens)
    x, y = (columns[3] - 320) / 700, (rows[2] - 240) / 700  # where a pixel is; its ideal place by fixed point
    ideal = np.array([x, y])
    for _ in range(200):
        ideal = np.array([x, y]) / (1 - 0.2 * ideal @ ideal)
    assert shift[2, 3] == pytest.approx(700 * np.hypot(*(ideal - [x, y])), abs=1e-9)
    folding = paper_rig().right  # Table I's right lens has pixels without a direction, lower right
    assert np.isnan(lens_shift_px(folding)[2][-1, -1])
