"""The laser's commands, as a user types them."""

from __future__ import annotations

import json
import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from stereolib import laser
from stereolib.base import data_path
from stereolib.cli import commands
from stereolib.virtual import emulator, recordings

ROOM = str(data_path("virtual/lrf/room.bin"))


def test_info_tells_what_the_room_recording_holds(capsys: pytest.CaptureFixture[str]) -> None:
    assert commands.main(["lrf", "info", ROOM, "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["packets"], facts["bad_checksums"], facts["skipped_bytes"], facts["turns"]) == (450, 0, 0, 5)
    assert 295 < facts["rpm_min"] <= facts["rpm_median"] <= facts["rpm_max"] < 305
    readings = laser.decode(recordings.load_laser("lrf/room"))
    assert facts["invalid_share"] == pytest.approx(np.isnan(readings.distance_mm).mean())


def test_record_writes_what_was_sent_and_never_overwrites(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sent = recordings.load_laser("lrf/room")
    target = tmp_path / "room.bin"
    with emulator.serve(emulator.replay(sent), "socket") as served:
        assert commands.main(["lrf", "record", served.port, str(target)]) == 0
    assert target.read_bytes() == sent
    assert json.loads((tmp_path / "room.bin.json").read_text())["bytes"] == len(sent)
    assert "went away" in capsys.readouterr().out
    assert commands.main(["lrf", "record", "socket://127.0.0.1:1", str(target)]) == 2
    assert "--force" in capsys.readouterr().err
    assert target.read_bytes() == sent


def test_show_draws_a_picture_and_keeps_one_that_is_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "room.png"
    assert commands.main(["lrf", "show", ROOM, "--output", str(picture)]) == 0
    assert "of 360 beams" in capsys.readouterr().out
    drawn = cv2.imread(str(picture))
    assert drawn.shape[0] > 500
    assert (drawn < 250).any(axis=2).mean() > 0.01
    before = picture.read_bytes()
    assert commands.main(["lrf", "show", ROOM, "--output", str(picture)]) == 2
    assert "would be overwritten" in capsys.readouterr().err
    assert picture.read_bytes() == before


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["info", "no_such_file.bin"], "no_such_file.bin"),
        (["info", str(data_path("paper/published.toml"))], "no XV-11 recording"),
        (["replay", os.devnull], "device"),
        (["show", "no_such_port"], "Ports found"),
        (["emulate", "--bit-error-rate", "2"], "bit_error_rate must be 0 to 1"),
        (["show", ROOM, "--turns", "0"], "--turns"),
    ],
)
def test_bad_input_is_one_line_that_says_what_to_do(
    words: list[str], hint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert commands.main(["lrf", *words]) == 2
    error = capsys.readouterr().err
    assert hint in error
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())
