"""What a class without internet gets, and that it is enough."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from stereolib.base import ROOT, datasets
from stereolib.cli import commands, handout
from stereolib.exercises import SHEETS

SOLVE = """
import stereolib
from stereolib.exercises import WrongAnswer, exercise
for number in ("00.1", "00.2", "03.1", "06.1"):
    one = exercise(number, "anna")
    answer = one._task.answer.right_answer()
    try:
        one.check(answer / 2)
    except WrongAnswer as wrong:
        print(number, one.check(answer), wrong)
print(stereolib.__file__)
"""


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A handout without packages."""
    target = tmp_path_factory.mktemp("handout") / "class.zip"
    assert commands.main(["handout", "--out", str(target), "--no-wheels"]) == 0
    return target


def test_it_has_what_a_class_needs_and_nothing_hidden(packed: Path) -> None:
    names = {name.removeprefix(f"{handout.FOLDER}/") for name in zipfile.ZipFile(packed).namelist()}
    assert {"START.txt", "bootstrap.py", "requirements.txt", "notebooks/00_two_pictures.ipynb"} <= names
    assert "requirements-explore.txt" in names  # `make explore` asks for it
    assert {f"notebooks/exercises/{name}.ipynb" for name in SHEETS.values()} <= names
    listed = (ROOT / "data" / "virtual" / "SHA256SUMS").read_text(encoding="utf-8").splitlines()
    assert {f"data/virtual/{line.split(maxsplit=1)[1]}" for line in listed} <= names
    assert not [name for name in names if "__pycache__" in name or name.startswith(("tests/", ".")) or "/." in name]


def test_it_can_be_installed(packed: Path, tmp_path: Path) -> None:
    """As `python bootstrap.py lab` does: its own build backend, in the unpacked folder."""
    with zipfile.ZipFile(packed) as archive:
        archive.extractall(tmp_path)
    program = f"from hatchling.build import build_editable, build_wheel; {{}}({str(tmp_path)!r})"
    for build in ("build_editable", "build_wheel"):
        command = [sys.executable, "-c", program.format(build)]
        done = subprocess.run(command, cwd=tmp_path / handout.FOLDER, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    (wheel,) = tmp_path.glob("stereolib-*.whl")  # the second took the place of the first
    assert {"stereolib/__init__.py", "stereolib/data/paper/published.toml"} <= set(zipfile.ZipFile(wheel).namelist())


def test_a_file_of_before_1980_is_packed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An archive knows no earlier time; disks and other archives give it."""
    old = tmp_path / "old.txt"
    old.write_bytes(b"old")
    os.utime(old, (0, 0))
    monkeypatch.setattr(handout, "_files", lambda root: iter([old]))
    monkeypatch.setattr(datasets, "repository", lambda: tmp_path)
    assert commands.main(["handout", "--out", str(tmp_path / "class.zip"), "--no-wheels"]) == 0
    assert zipfile.ZipFile(tmp_path / "class.zip").read(f"{handout.FOLDER}/old.txt") == b"old"


def test_exercises_work_from_it_alone(packed: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(packed) as archive:
        archive.extractall(tmp_path)
    folder = tmp_path / handout.FOLDER
    done = subprocess.run([sys.executable, "-c", SOLVE], cwd=folder, capture_output=True, text=True, check=True)
    *said, where = done.stdout.splitlines()
    assert Path(where).is_relative_to(folder)
    assert len(said) == 4 and all("Right. Not yet." in line for line in said)


def test_everybody_may_read_what_is_in_it(packed: Path) -> None:
    assert {info.external_attr >> 16 for info in zipfile.ZipFile(packed).infolist()} == {0o100644}


def test_a_start_is_told(packed: Path) -> None:
    text = zipfile.ZipFile(packed).read(f"{handout.FOLDER}/START.txt").decode()
    assert "python bootstrap.py lab" in text and "You need Python 3.11 or newer, and the internet once." in text


def test_packages_are_those_of_the_pins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    called: list[list[str]] = []

    def call(command: list[str], cwd: Path) -> int:
        called.append(command)
        Path(command[command.index("--dest") + 1], "numpy-2.0-any.whl").write_bytes(b"wheel")
        return 0

    monkeypatch.setattr(handout.subprocess, "call", call)
    monkeypatch.setattr(handout, "_files", lambda root: iter([root / "LICENSE"]))
    target = tmp_path / "class.zip"
    words = ["--platform", "win_amd64", "--python", "3.12"]
    assert commands.main(["handout", "--out", str(target), *words]) == 0
    (command,) = called
    assert {str(ROOT / "requirements.txt"), str(ROOT / "requirements-explore.txt")} < set(command)
    assert command[-4:] == ["--platform", "win_amd64", "--python-version", "3.12"]
    with zipfile.ZipFile(target) as archive:
        assert archive.read(f"{handout.FOLDER}/wheels/numpy-2.0-any.whl") == b"wheel"
        start = " ".join(archive.read(f"{handout.FOLDER}/START.txt").decode().split())
    assert (
        "You need Python 3.12, and no internet: the packages in the folder wheels are for Python 3.12 on win" in start
    )
    assert "1 package for Python 3.12" in capsys.readouterr().out


def test_failed_fetching_says_what_to_do_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(handout.subprocess, "call", lambda command, cwd: 1)
    assert commands.main(["handout", "--out", str(tmp_path / "class.zip")]) == 2
    assert "leave them out with --no-wheels" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_interrupted_packing_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(root: Path) -> None:
        raise KeyboardInterrupt

    target = tmp_path / "class.zip"
    target.write_bytes(b"before")
    monkeypatch.setattr(handout, "_files", stop)
    assert commands.main(["handout", "--out", str(target), "--no-wheels", "--force"]) == 130
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"class.zip": b"before"}


@pytest.mark.parametrize(("name", "hint"), [("class.tar", "written as .zip"), ("there.zip", "pass --force")])
def test_wrong_targets_are_refused(name: str, hint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "there.zip").write_bytes(b"before")
    assert commands.main(["handout", "--out", str(tmp_path / name), "--no-wheels"]) == 2
    assert hint in capsys.readouterr().err
    assert (tmp_path / "there.zip").read_bytes() == b"before"
