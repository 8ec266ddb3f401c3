"""The example in a command's help, typed into an empty folder, after the lines that stand before it."""

from __future__ import annotations

from pathlib import Path

import pytest

from stereolib import reproduction
from stereolib.cli import commands
from stereolib.mapping import load_rig_folder
from stereolib.virtual import emulator

WRITES = {
    "capture": "taken/left/01.png",
    "new": "my_rig/rig.toml",
    "board": "board.pdf",
    "report": "walk/report",
    "lrf show": "room.png",
    "lrf export": "room.ply",
    "lrf info": "walk/1_scan.bin",
    "lrf replay": "walk/1_scan.bin",
}


def own_folder(folder: Path, out: Path, chapter: str) -> list[Path]:
    """In place of a report: see that there is something to report on."""
    found = load_rig_folder(folder).stations
    assert [bool(each.left and each.scan) for each in found] == [True] * 5 and chapter == "report"
    out.mkdir()
    return [out]


@pytest.mark.parametrize("words", WRITES)
def test_the_example_works_in_an_empty_folder(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(reproduction, "report_rig", own_folder)  # what it makes of one is in test_report
    monkeypatch.setattr(emulator.Served, "wait", lambda *_: True)  # nobody comes to read
    known = commands.COMMANDS
    for word in words.split():
        command = next(each for each in known if each.name == word)
        known = command.commands
    for line in (*command.before, command.example):
        name, *typed = line.split()
        assert name == "stereolib"
        assert commands.main(typed) == 0, capfd.readouterr().err
    assert (tmp_path / WRITES[words]).exists()
