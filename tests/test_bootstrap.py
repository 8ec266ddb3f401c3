"""The set-up script: what it refuses, when it does nothing, what it says when installing fails."""

from __future__ import annotations

import argparse
import ast
import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import bootstrap


def test_old_python_is_named_with_its_fix(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "version_info", (3, 9, 2))
    with pytest.raises(SystemExit, match=r"needs Python 3\.11 or newer; .* is older: 3\.9\.(.|\n)*python3-venv"):
        bootstrap.check_python()


def test_missing_venv_module_is_named_with_its_fix(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "ensurepip" else object())
    version = "{}.{}".format(*sys.version_info)
    with pytest.raises(SystemExit, match=f"has no ensurepip .*\n.*apt install python{version}-venv"):
        bootstrap.check_python()


def test_script_is_short_and_readable_for_old_pythons() -> None:
    """Python 3.6 must get as far as the message that it is too old."""
    source = Path(bootstrap.__file__).read_text(encoding="utf-8")
    assert len(source.splitlines()) <= 170
    imported = set()
    for node in ast.walk(ast.parse(source, feature_version=(3, 6))):
        if isinstance(node, ast.Import):
            imported |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            imported.add((node.module or "").split(".")[0])
    assert imported <= sys.stdlib_module_names and "__future__" not in imported


def test_other_environments_stay_out() -> None:
    assert not set(bootstrap.ELSEWHERE) & set(bootstrap.ENVIRON) and bootstrap.ENVIRON["PYTHONNOUSERSITE"] == "1"


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder whose environment looks freshly made."""
    monkeypatch.delenv("PYTHON", raising=False)
    for name, path in {"ROOT": "", "VENV": ".venv", "PYTHON": "python", "STAMP": "stamp"}.items():
        monkeypatch.setattr(bootstrap, name, tmp_path / path)
    for name in ("requirements.txt", "pyproject.toml", "python"):
        (tmp_path / name).write_text(name)
    bootstrap.STAMP.write_text(bootstrap.stamp())
    return tmp_path


@pytest.mark.parametrize("name", ["requirements.txt", "pyproject.toml"])
def test_changed_pins_make_it_stale(made: Path, name: str) -> None:
    assert bootstrap.is_fresh()
    (made / name).write_text("changed")
    assert not bootstrap.is_fresh()


def test_moved_folder_missing_python_and_other_python_make_it_stale(
    made: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHON", "python3")
    assert bootstrap.is_fresh()  # asked for the Python that it has
    monkeypatch.setattr(sys, "version_info", (3, 99, 0))
    assert not bootstrap.is_fresh()
    monkeypatch.delenv("PYTHON")
    assert bootstrap.is_fresh()  # asked for none in particular
    bootstrap.PYTHON.unlink()
    assert not bootstrap.is_fresh()
    bootstrap.PYTHON.touch()
    assert bootstrap.is_fresh()  # that alone was missing
    monkeypatch.setattr(bootstrap, "ROOT", made / ".." / made.name)
    assert not bootstrap.is_fresh()


@pytest.mark.parametrize("uv_works", [True, False])
def test_uv_installs_and_pip_does_where_uv_fails(made: Path, monkeypatch: pytest.MonkeyPatch, uv_works: bool) -> None:
    calls = []

    def call(command: list[str], **options: object) -> int:
        calls.append("uv" if command[0] == "uv" else command[2])
        return int(command[0] == "uv" and not uv_works)

    monkeypatch.setattr(bootstrap.shutil, "which", lambda name: name)
    monkeypatch.setattr(subprocess, "call", call)
    bootstrap.STAMP.unlink()
    bootstrap.setup()
    assert calls == (["venv", "uv", "uv"] if uv_works else ["venv", "uv", "pip", "uv", "pip"])
    assert bootstrap.is_fresh()


def test_pip_leaves_compiling_to_all_cores_at_once(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a fresh environment; what is added later is little, and compiled as it comes."""
    calls = []
    monkeypatch.setattr(bootstrap.shutil, "which", lambda _: None)
    monkeypatch.setattr(subprocess, "call", lambda command, **_: calls.append(command[2:]) or 0)
    bootstrap.STAMP.unlink()
    bootstrap.setup()
    assert [words[0] for words in calls] == ["venv", "pip", "pip", "compileall"]
    assert all("--no-compile" in words for words in calls[1:3]) and calls[3][-3:-1] == ["-j", "0"]
    assert bootstrap.install("-r", "requirements-site.txt") and "--no-compile" not in calls[4]


def test_failed_installing_says_what_to_do_and_leaves_it_stale(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subprocess, "call", lambda command, **options: int("install" in command))
    bootstrap.STAMP.unlink()
    with pytest.raises(SystemExit, match=r"could not be made; .*\n.*mirror or a proxy, tell pip"):
        bootstrap.setup()
    assert not bootstrap.is_fresh()


def test_what_one_command_needs_is_installed_once(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[list[str]] = []
    monkeypatch.setattr(bootstrap.shutil, "which", lambda name: None)
    monkeypatch.setattr(subprocess, "call", lambda command, **options: calls.append(command) or 0)
    (made / ".venv").mkdir()
    (made / "requirements-explore.txt").write_text("voila==1")
    bootstrap.add("explore")
    bootstrap.add("explore")
    assert [call[-2:] for call in calls] == [["-r", "requirements-explore.txt"]]
    (made / "requirements-explore.txt").write_text("voila==2")
    bootstrap.add("explore")
    assert len(calls) == 2


def test_a_handout_installs_from_its_own_packages(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[list[str]] = []
    monkeypatch.setattr(bootstrap.shutil, "which", lambda name: name)
    monkeypatch.setattr(subprocess, "call", lambda command, **options: calls.append(command) or 1)
    (made / "wheels").mkdir()
    assert not bootstrap.install("-r", "requirements.txt")
    assert len(calls) == 2  # by uv, then by pip, and by neither from elsewhere
    assert all(call[-5:] == ["--no-index", "--find-links", "wheels", "-r", "requirements.txt"] for call in calls)


def test_failed_addition_says_what_to_do_and_is_tried_again(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subprocess, "call", lambda command, **options: 1)
    (made / ".venv").mkdir()
    (made / "requirements-explore.txt").write_text("voila==1")
    for _ in range(2):
        with pytest.raises(
            SystemExit, match=r"requirements-explore\.txt could not be installed(.|\n)*a proxy, tell pip"
        ):
            bootstrap.add("explore")


def test_a_finished_set_up_says_what_to_try() -> None:
    done = subprocess.run([sys.executable, *bootstrap.COMMANDS["setup"]], capture_output=True, text=True, check=True)
    (said,) = done.stdout.splitlines()
    tried = re.fullmatch(r"Ready\. Try first: (\S+) (.+) \(.+\)", said)
    assert tried and Path(tried[1]) == Path(".venv") / ("Scripts" if os.name == "nt" else "bin") / "stereolib"
    assert f"`stereolib {tried[2]}`" in (bootstrap.ROOT / "README.md").read_text(encoding="utf-8")  # tried there


def test_unknown_command_shows_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match=r"no command 'nonsense'(.|\n)*make reproduce"):
        bootstrap.main(["nonsense"])
    assert bootstrap.main([]) == 0
    assert "make reproduce" in capsys.readouterr().out


def test_python_2_stops_at_a_line_that_says_what_it_lacks() -> None:
    """It cannot parse the file at all, and shows the first line that it does not understand."""
    lines = Path(bootstrap.__file__).read_text(encoding="utf-8").splitlines()
    only_python3 = [line for line in lines if re.search(r"""(^|[^\w"'])f["']|-> |\*\*\{""", line)]
    assert only_python3[0] == 'NEEDS = f"stereolib needs Python 3.11 or newer; {sys.executable} is older"'


@pytest.mark.parametrize(
    ("writable", "free", "says"),
    [
        (False, 10**12, "cannot be written. Remove it if it is a .venv of somebody else"),
        (True, 4 * 10**6, "has less than 900 MB free"),
        (True, 10**12, "No network?"),
    ],
)
def test_a_failed_set_up_says_the_likeliest_reason(
    made: Path, monkeypatch: pytest.MonkeyPatch, writable: bool, free: int, says: str
) -> None:
    monkeypatch.setattr(bootstrap, "install", lambda *wanted: False)
    monkeypatch.setattr(subprocess, "call", lambda *words, **_: 1)
    monkeypatch.setattr(os, "access", lambda path, mode: writable)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: argparse.Namespace(free=free))
    with pytest.raises(SystemExit, match=re.escape(says)):
        bootstrap.setup()


def test_a_stamp_that_cannot_be_read_or_written_is_one_line(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bootstrap.STAMP.unlink()
    bootstrap.STAMP.mkdir()  # whoever is root may read and write all else
    with pytest.raises(SystemExit, match=r"\.venv could not be made: .*stamp.*is it yours\?"):
        bootstrap.main(["reproduce"])
