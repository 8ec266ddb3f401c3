"""``stereolib capture``: from an empty folder to a verdict without hands, and what it refuses."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.shows import BOARD, small_show, write_show

from stereolib import plotting
from stereolib.calibration import CaptureSession, CaptureState
from stereolib.cli import capture, commands
from stereolib.cli.errors import Ended
from stereolib.rig import StereoRig, find_pairs
from stereolib.virtual.camera_emulator import CameraFaults, serve_cameras


def run(*words: object) -> int:
    return commands.main(["capture", "--no-preview", *map(str, words)])


@pytest.mark.slow
def test_from_an_empty_folder_to_a_verdict_without_hands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Live: one camera late and losing pictures. The report's figures are `stereolib calibrate`'s, and tested there."""
    monkeypatch.setattr(plotting, "write_calibration_report", lambda *_: None)
    show, rig = small_show(), tmp_path / "rig"
    faults = CameraFaults(), CameraFaults(late_s=0.05, drop_rate=0.05)
    with serve_cameras(show, faults) as cameras:
        words = (*cameras, *BOARD, "--pairs", 7, "--patience-s", 1, "--output", rig, "--max-skew-ms", 150)
        assert run(*words, "--ruler-mm", 93) == 0
    told = capsys.readouterr()
    assert "\ngood " in told.out and "skew between the arrivals of both pictures: 95 % up to" in told.out
    assert "not taken: fixed exposure" in told.err and "pair 07 taken" in told.err
    found = StereoRig.load(rig / "calibration.json")
    assert found.baseline_mm == pytest.approx(show.rig.baseline_mm, abs=0.3)
    np.testing.assert_allclose(np.diag(found.left.K)[:2], np.diag(show.rig.left.K)[:2], rtol=0.01)
    assert len(find_pairs(rig / "left", rig / "right")) == json.loads((rig / "capture.json").read_text())["pairs"] >= 7
    assert f"{rig / 'report.html'}\n" in told.out


def test_too_few_pairs_are_kept_and_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sources = write_show(tmp_path / "show", small_show())
    assert run(*sources, *BOARD, "--pairs", 1, "--patience-s", 0.3, "--output", tmp_path / "rig") == 1
    told = capsys.readouterr()
    assert "1 pair in" in told.out and "fewer" not in told.out
    assert "too few for a calibration" in told.err and not (tmp_path / "rig" / "calibration.json").exists()
    assert (tmp_path / "rig" / "left" / "01.png").is_file()


@pytest.mark.parametrize(
    ("ending", "after", "code"),
    [(KeyboardInterrupt, 6, 0), (KeyboardInterrupt, 2, 130), (Ended, 6, 130), (Ended, 0, 130)],
)
def test_ctrl_c_calibrates_what_was_taken_where_that_is_enough(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    ending: type[BaseException],
    after: int,
    code: int,
) -> None:
    runs, calibrated = CaptureSession.run, []

    def until(session: CaptureSession) -> Iterator[CaptureState]:
        for state in runs(session):
            yield state
            if state.taken == after:
                raise ending

    monkeypatch.setattr(CaptureSession, "run", until)
    monkeypatch.setattr(capture, "_calibrated", lambda _, session: calibrated.append(session.taken) or 0)
    sources = write_show(tmp_path / "show", small_show())
    assert run(*sources, *BOARD, "--output", tmp_path / "rig") == code
    told = capsys.readouterr()
    if code:
        said = "the pairs taken so far are kept: run it again" if after else "interrupted; no pair was taken"
        assert not calibrated and said in told.err and ("kept" in told.err) == bool(after)
    else:
        assert calibrated == [6] and "6 pairs in" in told.out
        assert "fewer than the 20 wanted, as was asked" in told.out and "coverage: " in told.out


def test_a_scene_without_a_board_is_one_pair(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    sources = write_show(tmp_path / "show", small_show())
    assert run(*sources, "--output", tmp_path / "scene") == 0
    assert "1 pair in" in capfd.readouterr().out
    assert run(*sources, "--output", tmp_path / "scene") == 2, "what stands there now may be another thing"
    assert "holds 1 of the 1 pairs asked for already: choose another --output" in capfd.readouterr().err
    assert run(*sources, "--output", tmp_path / "scene", "--pairs", 500) == 0, "a recording that ends before"
    told = capfd.readouterr()
    assert "going on after 1 pair that is there" in told.err and f"{len(small_show().left) + 1} pairs in" in told.out
    assert "WARN" not in told.err
    assert [pair.left.name for pair in find_pairs(tmp_path / "scene")][:2] == ["01.png", "02.png"]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["L", "L"], "was given for both cameras"),
        (["L", "none_%02d.png"], "no picture of this pattern"),
        (["L", "R", "--board", "9x6"], "both --board and --square-mm"),
        (["L", "R", "--square-mm", "25"], "both --board and --square-mm"),
        (["L", "R", "--board", "9", "--square-mm", "25"], "--board is columns x rows"),
        (["L", "R", "--board", "9x6", "--square-mm", "0"], "positive number of mm"),
        (["L", "R", "--pairs", "0"], "--pairs must be 1 or more"),
        (["L", "R", "--every-s", "-1"], "--every-s must be 0 or more"),
        (["L", "R", "--patience-s", "nan"], "--patience-s must be 0 or more"),
        (["L", "R", "--max-skew-ms", "0"], "skew must be more than 0"),
        (["L", "R", "--size", "640"], "--size is width x height"),
        (["L", "R", "--size", "0x0"], "1x1 to 16384x16384"),
        (["L", "R", "--fps", "0"], "pictures a second"),
        (["L", "R", "--code", "MJPEG"], "four letters"),
        (["L", "R", "--automatic", "--focus", "3"], "--automatic contradicts"),
        (["L", "R", "--pairs", "few"], "invalid int value"),
        (["L", "R", "--legacy"], "--legacy is about a board"),
        (["L", "R", "--dictionary", "4X4_50"], "--dictionary is about a board"),
        (["L", "R", *BOARD, "--dictionary", "4X4_50"], "--dictionary is about ChArUco boards"),
        (["L", "R", "--board", "9x6", "--square-mm", "25", "--ruler-mm", "-5"], "not a number from 1 to 1000000"),
        (["L", "R", "--exposure", "nan"], "finite numbers"),
        (["L", "R", "--port", "70000"], "--port: '70000' is not a whole number from 0 to 65535"),
        ([".", "R"], "it is a folder; stereolib calibrate reads"),
        (["99", "R"], "left camera 99 cannot be opened"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(
    tmp_path: Path, words: list[str], text: str, capfd: pytest.CaptureFixture[str]
) -> None:
    left, right = write_show(tmp_path / "show", small_show())
    named = [{"L": left, "R": right}.get(word, word) for word in words]
    try:
        code = run(*named, "--output", tmp_path / "out")
    except SystemExit as refused:  # by argparse
        code = refused.code
    told = capfd.readouterr().err.replace(f"left: {left}, 320x240\nright: {right}, 320x240\n", "")
    assert code == 2
    assert text in told and told.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_the_output_is_no_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("mine")
    assert run("0", "1", "--output", tmp_path / "file" / "rig") == 2
    assert "--output must name a folder" in capsys.readouterr().err


def test_a_board_that_nobody_sees_is_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    show, few = small_show(), slice(12)  # a search that finds nothing takes long
    sources = write_show(tmp_path / "show", replace(show, left=show.left[few], right=show.right[few]))
    words = ("--board", "8x7", "--square-mm", 25, "--pairs", 1, "--patience-s", 0.3, "--output", tmp_path / "rig")
    assert run(*sources, *words) == 2
    told = capsys.readouterr()
    assert "no pair was taken, since the recording ended: " in told.err and "is it one of 8x7 inner corners" in told.err
    assert "a board of 9x6 is there" in told.err
    assert "calibrating" not in told.err and told.out == ""
