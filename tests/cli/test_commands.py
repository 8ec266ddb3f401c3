"""The command line: help, exit codes, one-line errors."""

from __future__ import annotations

import argparse
import hashlib
import os
import subprocess
import sys
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

from stereolib import __version__, reproduction
from stereolib.base import datasets
from stereolib.cli import commands
from stereolib.reproduction import NotebookError

_MAKE_ROOM = "; make room, or write to another place (of temporary files: the variable TMPDIR)\n"
_MEMORY, _LESS = "stereolib: error: too little memory", ": try smaller pictures, or close other programs\n"


def leaves(
    commands: Sequence[commands.Command] = commands.COMMANDS, above: str = ""
) -> Iterator[tuple[str, commands.Command]]:
    for command in commands:
        if command.commands:
            yield from leaves(command.commands, f"{above}{command.name} ")
        else:
            yield f"{above}{command.name}", command


def test_help_names_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        commands.main(["--help"])
    text = capsys.readouterr().out
    assert all(command.name in text for command in commands.COMMANDS) and "example:" in text


@pytest.mark.parametrize(("words", "command"), list(leaves()))
def test_every_example_is_in_the_help_and_parses(
    words: str, command: commands.Command, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="0"):
        commands.main([*words.split(), "--help"])
    assert f"\n  {command.example}\n" in capsys.readouterr().out.partition("example:")[2]
    assert command.example.startswith(f"stereolib {words}")
    parsed = commands.make_parser().parse_args(command.example.split()[1:])
    assert parsed.run is command.run


@pytest.mark.parametrize("pose", ["-1,2,3", "-.5,-2,3"])
def test_a_list_that_begins_with_a_minus_is_no_option(pose: str) -> None:
    parser = commands.make_parser()
    for words in (["--pose", pose], [f"--pose={pose}"]):
        assert parser.parse_args(["lrf", "export", "scan.bin", "room.ply", *words]).pose == pose


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        commands.main(["--version"])
    assert capsys.readouterr().out == f"stereolib {__version__}\n"


@pytest.mark.parametrize("words", [[], ["nonsense"], ["data"], ["reproduce", "--check", "--accept"]])
def test_wrong_words_are_refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        commands.main(words)
    said = capsys.readouterr().err
    assert said.startswith("stereolib: error: ") and "--help" in said and said.count("\n") == 1


def test_an_error_is_broken_between_words_on_a_terminal_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = str(tmp_path / "a-folder-with-a-name-longer-than-the-terminal-is-wide" / "left.png")
    words = ["measure", missing, missing, "--calibration", missing]
    assert commands.main(words) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and len(line) > 100
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "60")
    assert commands.main(words) == 2
    broken = capsys.readouterr().err.splitlines()
    assert missing in {part.strip(" :") for part in broken}
    assert all(len(part) <= 60 or " " not in part.strip() for part in broken)
    assert " ".join(part.strip() for part in broken) == line.strip()
    with pytest.raises(SystemExit, match="2"):
        commands.main(["measure", "left.png", "--calibration", missing, "--floor", "nothing-of-the-kind"])
    broken = capsys.readouterr().err.splitlines()
    assert len(broken) > 1 and all(len(part) <= 60 or " " not in part.strip() for part in broken)


@pytest.mark.parametrize(
    ("words", "said"),
    [(["new", ""], "an argument is empty"), (["new", " "], "an argument is empty"),
     (["map", "walk", "--output="], "nothing stands behind --output=")],
)  # fmt: skip
def test_an_empty_word_is_no_folder_of_that_name(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """``Path("")`` would be the folder one stands in."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit, match="2"):
        commands.main(words)
    assert said in capsys.readouterr().err and not list(tmp_path.iterdir())


def test_an_unknown_option_leads_to_the_help_that_lists_them(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        commands.main(["data", "verify", "--ouput", "x"])
    said = capsys.readouterr().err
    assert said == "stereolib: error: unrecognized arguments: --ouput x; see stereolib data verify --help\n"


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (ValueError("three\nlines  of text"), 2, "stereolib: error: three lines of text\n"),
        (FileNotFoundError(2, "No such file", "left.png"), 2, "stereolib: error: left.png: No such file\n"),
        (OSError(28, "No space left", "m.png"), 2, f"stereolib: error: m.png: No space left{_MAKE_ROOM}"),
        (OSError(28, "No space left"), 2, f"stereolib: error: No space left{_MAKE_ROOM}"),
        (
            OSError(13, "Permission denied", "c.json"),
            2,
            "stereolib: error: c.json: Permission denied; see whether you may read and write there, or name another "
            "place\n",
        ),
        (FileExistsError("d.npy would be overwritten"), 2, "stereolib: error: d.npy would be overwritten\n"),
        (
            ModuleNotFoundError("no", name="trimesh.x"),
            2,
            "stereolib: error: this needs trimesh.x: pip install '.[notebooks]' in the project's folder\n",
        ),
        (
            MemoryError("Unable to allocate 3 GiB"),
            2,
            f"{_MEMORY} (Unable to allocate 3 GiB){_LESS}",
        ),
        (MemoryError(), 2, f"{_MEMORY} (none is left){_LESS}"),
        (cv2.error("std::bad_alloc"), 2, f"{_MEMORY} (std::bad_alloc){_LESS}"),
        (ImportError("a.so: failed to map segment"), 2, f"{_MEMORY} (a.so: failed to map segment){_LESS}"),
        (RuntimeError("can't start new thread"), 2, f"{_MEMORY} (can't start new thread){_LESS}"),
        (OSError(12, "Cannot allocate memory"), 2, f"{_MEMORY} ([Errno 12] Cannot allocate memory){_LESS}"),
        (ValueError("bad \udcff name"), 2, "stereolib: error: bad \\udcff name\n"),
        (FileExistsError("pass force (--force) to replace it"), 2, "stereolib: error: pass --force to replace it\n"),
        (ValueError("record longer, or, in Python, take all: parts=True"), 2, "stereolib: error: record longer\n"),
        (ValueError("tell it (--floor; in Python, floor_from_pose)"), 2, "stereolib: error: tell it (--floor)\n"),
        (ValueError(), 2, "stereolib: error: ValueError\n"),
        (KeyboardInterrupt(), 130, "stereolib: interrupted; all is kept\n"),
    ],
)
def test_errors_are_one_line(
    error: BaseException,
    code: int,
    line: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def fail(arguments: argparse.Namespace) -> int:
        raise error

    command = commands.Command("fail", "fails", "stereolib fail", fail, interrupted="all is kept")
    monkeypatch.setattr(commands, "COMMANDS", (command,))
    assert commands.main(["fail"]) == code
    assert capsys.readouterr().err == line


@pytest.mark.parametrize(
    "words",
    [
        ["board", "--out", "file/board.pdf"],
        ["disparity", "left.png", "right.png", "--output", "file/d.npy"],
        ["data", "build", "--output", "file/deeper"],
        ["reproduce", "03", "--output", "file/deeper"],
        ["map", ".", "--output", "folder"],
        ["board", "--out", "folder.pdf"],
    ],
)
def test_a_place_that_cannot_be_written_is_told_with_its_option(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("mine")
    for folder in ("folder/map.json", "folder.pdf"):
        (tmp_path / folder).mkdir(parents=True)
    assert commands.main(words) == 2
    remedy = "name a file to write" if words[-1].startswith("folder") else "choose another place"
    assert capsys.readouterr().err.endswith(f"{remedy} with {words[-2]}\n")


def test_an_interruption_that_a_library_turned_into_an_error_is_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As modules in C do where Ctrl-C comes while they are loaded."""

    def fail(arguments: argparse.Namespace) -> int:
        raise ImportError("initialization failed") from KeyboardInterrupt()

    monkeypatch.setattr(commands, "COMMANDS", (commands.Command("fail", "fails", "stereolib fail", fail),))
    assert commands.main(["fail"]) == 130
    assert capsys.readouterr().err == "stereolib: interrupted\n"


def test_work_that_ctrl_c_drops_says_nothing_of_itself(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As joblib warns of results that nobody took, when its generator goes with the error that held it."""

    def results() -> Iterator[int]:
        try:
            yield from range(9)
        finally:
            warnings.warn("results have not been used", stacklevel=1)

    def fail(_: argparse.Namespace) -> int:
        for _ in (running := results()):
            raise KeyboardInterrupt
        return len(list(running))

    command = commands.Command("fail", "fails", "stereolib fail", fail)
    monkeypatch.setattr(commands, "COMMANDS", (command,))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        assert commands.main(["fail"]) == 130
    assert said == [] and capsys.readouterr().err == "stereolib: interrupted\n"


@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are not held elsewhere")
def test_opencv_without_memory_ends_in_one_line(tmp_path: Path) -> None:
    """A real one: so much is matched that OpenCV gets no memory for what it computes."""
    noise = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 256, (2000, 3000), np.uint8), (0, 0), 2)
    for name, picture in (("l.png", noise), ("r.png", np.roll(noise, -16, 1))):
        cv2.imwrite(str(tmp_path / name), cv2.resize(picture, (6000, 4000)))
    limited = (
        "import sys, resource, cv2, numpy, scipy.linalg; from stereolib import cli, matching, rig\n"
        "used = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (used + 250 * 2**20,) * 2)\nsys.exit(cli.main(sys.argv[1:]))"
    )
    words = ["disparity", "l.png", "r.png", "--pipeline", "paper", "--max-disparity", "128"]
    done = subprocess.run(
        [sys.executable, "-c", limited, *words], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and done.stderr.startswith(_MEMORY), done.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"l.png", "r.png"}


@pytest.mark.skipif(os.name == "nt", reason="pipes break otherwise there")
def test_nobody_reading_is_no_error() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "stereolib", "data", "verify"]
    done = subprocess.run(command, cwd=datasets.ROOT, stdout=writing, stderr=subprocess.PIPE, check=False)
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.parametrize("fault", [KeyError("a bug"), cv2.error("Assertion failed"), RuntimeError("a bug")])
def test_a_fault_of_ours_keeps_its_traceback(fault: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(arguments: argparse.Namespace) -> int:
        raise fault

    monkeypatch.setattr(commands, "COMMANDS", (commands.Command("fail", "fails", "stereolib fail", fail),))
    with pytest.raises(type(fault), match=str(fault)):
        commands.main(["fail"])


@pytest.mark.parametrize(
    ("outcome", "words", "code", "said"),
    [
        ([], [], 0, ""),
        (["x: 1 before, 2 now"], [], 1, "stereolib reproduce --accept"),
        (["x: 1 before, 2 now"], ["--accept"], 0, ""),
        (NotebookError("02.ipynb, cell 3: KeyError"), [], 1, "02.ipynb, cell 3: KeyError"),
        (ValueError("notebook '99' fits 0"), ["99"], 2, "stereolib: error: notebook '99' fits 0"),
    ],
)
def test_reproduce_says_how_it_went(
    outcome: list[str] | Exception,
    words: list[str],
    code: int,
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def answer(*options: object) -> list[str]:
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    monkeypatch.setattr(reproduction, "reproduce", answer)
    assert commands.main(["reproduce", *words]) == code
    output = capsys.readouterr()
    assert said in output.err
    assert all(line in output.out for line in (outcome if isinstance(outcome, list) else []))


def test_reproduce_works_on_a_copy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """For a checkout that cannot be written; what is there is not copied over."""
    checkout = tmp_path / "checkout"
    for name in ("notebooks/01.ipynb", "figures/fig01.png"):
        (checkout / name).parent.mkdir(parents=True)
        (checkout / name).write_text(name)
        (checkout / name).chmod(0o444)
    given = []
    monkeypatch.setattr(datasets, "ROOT", checkout)
    monkeypatch.setattr(reproduction, "reproduce", lambda *options: given.extend(options) or [])
    assert commands.main(["reproduce", "01", "--output", str(tmp_path / "own")]) == 0
    assert given[:3] == [tmp_path / "own" / "notebooks", tmp_path / "own" / "figures", ["01"]]
    (tmp_path / "own" / "figures" / "fig01.png").write_text("new")  # the copy can be written
    assert commands.main(["reproduce", "--output", str(tmp_path / "own")]) == 2
    assert "is there already" in capsys.readouterr().err


def test_data_verify_names_damaged_and_missing_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(datasets, "ROOT", tmp_path)
    assert commands.main(["data", "verify"]) == 2
    assert "data/virtual/SHA256SUMS is missing" in capsys.readouterr().err
    folder = tmp_path / "data" / "virtual"
    folder.mkdir(parents=True)
    names = ["left.jpg", "right.jpg", "scan.bin"]
    for name in names:
        (folder / name).write_bytes(name.encode())
    sums = "".join(f"{hashlib.sha256(name.encode()).hexdigest()}  {name}\n" for name in names)
    (folder / "SHA256SUMS").write_text(sums)
    assert commands.main(["data", "verify"]) == 0
    (folder / "left.jpg").write_bytes(b"left.jpg ")
    (folder / "right.jpg").unlink()
    capsys.readouterr()
    assert commands.main(["data", "verify"]) == 1
    output = capsys.readouterr().out
    assert "left.jpg differs from its sha256" in output and "right.jpg is missing" in output
    assert "scan.bin" not in output
