"""Whatever is wrong with an input: one line that names it, exit code 2, nothing written, no end without an end."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from support import bad_inputs
from support.bad_inputs import TABLE, Bad

from stereolib.base import files
from stereolib.cli import commands
from stereolib.cli.commands import _QUIET

_MOST_S = 20  # any refusal; what hangs does so for ever

pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="pipes and alarms are of Unix")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("inputs")
    bad_inputs.make(made)
    return made


@pytest.fixture(autouse=True)
def here(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Run in the folder of inputs, wait for no silent pipe, and end what hangs."""
    monkeypatch.chdir(folder)
    monkeypatch.setattr(files, "SILENCE_S", 0.05)

    def hangs(*_: object) -> None:
        raise AssertionError(f"not refused within {_MOST_S} s")

    before = signal.signal(signal.SIGALRM, hangs)
    signal.alarm(_MOST_S)
    there = _there(folder)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)
    for path in _there(folder).keys() - there.keys():  # so that one failure does not make the next
        os.unlink(path)


def _there(folder: Path | str) -> dict[str, int]:
    """Every file and when it was written; kept corners are no output."""
    found: dict[str, int] = {}
    with os.scandir(folder) as entries:  # six times as fast as rglob: this is asked four times in each test
        for entry in entries:
            if entry.name.startswith(".stereolib_"):
                continue
            if entry.is_dir(follow_symlinks=False):
                found |= _there(entry.path)
            else:
                found[entry.path] = entry.stat(follow_symlinks=False).st_mtime_ns
    return found


def test_the_table_is_long_and_names_every_command() -> None:
    assert len({bad.words for bad in TABLE}) == len(TABLE) >= 150
    named = {bad.words.split()[0] for bad in TABLE}
    assert named == {command.name for command in commands.COMMANDS}


@pytest.mark.parametrize("bad", TABLE, ids=[bad.words for bad in TABLE])
def test_is_refused_in_one_line(bad: Bad, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    before = _there(folder)
    try:
        code = commands.main(bad.words.split())
    except SystemExit as stop:  # argparse's way, with the same line and code
        assert isinstance(stop.code, int)
        code = stop.code
    said = capfd.readouterr()
    assert code == 2
    assert said.err.startswith("stereolib: error: ") and said.err.count("\n") == 1 and said.err.endswith("\n")
    assert re.search(bad.says, said.err)
    assert said.out == ""
    assert _there(folder) == before


@pytest.mark.parametrize(
    "words",
    [
        "disparity gif.gif good/right.jpg",
        "check video.mp4 --board 9x6 --square-mm 25 --calibration good/calibration.json",
    ],
)
def test_libraries_in_between_say_nothing_of_their_own(words: str) -> None:
    """OpenCV and FFmpeg write past Python, where nobody tells them not to, as conftest does."""
    env = {name: value for name, value in os.environ.items() if name not in _QUIET}
    command = [sys.executable, "-m", "stereolib", *words.split()]
    done = subprocess.run(command, env=env, capture_output=True, check=False)
    assert done.returncode == 2 and done.stderr.startswith(b"stereolib: error: ")
    assert (done.stdout + done.stderr).count(b"\n") == 1
