"""Every command of the README typed as it stands there, in order, by somebody without cameras."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from support.shows import write_show

from stereolib.base import ROOT
from stereolib.cli import commands
from stereolib.reproduction import own_rig
from stereolib.virtual import VirtualLidar, camera_emulator, cube_scene, emulator, stage, staged_rig

#: What is asked for its --help alone, and why.
HELP_ALONE = {
    "explore": "serves a page until Ctrl-C; tests/browser opens it",
    "bake": "minutes of work; tests/notebook bakes a page",
    "capture": "needs two cameras; tests/capture emulates them",
    "emulate-cameras": "plays until Ctrl-C",
    "data fetch": "asks the network",
    "lrf live": "serves a page until Ctrl-C",
    "lrf emulate": "plays until Ctrl-C; here the port below is one",
    "lrf replay": "plays until Ctrl-C; tests/cli/test_lrf.py listens",
}
PORT = "/dev/ttyUSB0"  # in its place an emulated laser
_CODE = re.compile(r"```(\w*)\n(.*?)```|`(stereolib [^`]+)`", re.DOTALL)


def typed() -> list[str]:
    """Commands and Python code of the README, in its order; what it generates has none."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    found = []
    for language, block, inline in _CODE.findall(text):
        if language == "python":
            found.append(block)
        elif language != "bash":  # a script, which is run as a whole
            found += [line for line in map(str.strip, (inline or block).splitlines()) if line.startswith("stereolib ")]
    return found


def words_of(command: str) -> list[str]:
    return shlex.split(command, comments=True)[1:]


def run(words: Sequence[str], port: str) -> int:
    """Run one command, or ask for its help."""
    if any(words[: len(name.split())] == name.split() for name in HELP_ALONE):
        words = [*words, "--help"]
    seconds = ["--seconds", "1"] if words[:2] == ["lrf", "record"] else []
    try:
        return commands.main([*(port if word == PORT else word for word in words), *seconds])
    except SystemExit as stopped:
        return int(stopped.code or 0)


def take_box(rig: int, scale: float, folder: Path) -> None:
    """What `capture` and `lrf record` take of an emulated rig's box, and its true calibration, in smaller pictures."""
    staged, true = stage("box", rig=rig), camera_emulator.scaled_rig(staged_rig(rig), scale)
    shown = camera_emulator.show_scene(staged, np.random.default_rng(1), true)
    addresses = write_show("shown", shown)
    assert commands.main(["capture", *map(str, addresses), "--no-preview", "--output", str(folder / "box")]) == 0
    played = emulator.emulate(
        staged.scene,
        staged.laser_pose,
        lidar=VirtualLidar(height_mm=staged.laser_height_mm),
        rng=np.random.default_rng(1),
    )
    with emulator.serve(played, "socket") as served:
        scan = str(folder / "box" / "scans" / "01.bin")
        assert commands.main(["lrf", "record", served.port, scan, "--seconds", "3"]) == 0
    (folder / "boards").mkdir()
    true.save(folder / "boards" / "calibration.json")


def test_what_is_typed_are_commands_of_ours() -> None:
    names = {words_of(command)[0] for command in typed() if command.startswith("stereolib ")}
    assert {"calibrate", "disparity", "measure", "map", "report"} <= names <= {each.name for each in commands.COMMANDS}
    assert all(name.split()[0] in names for name in HELP_ALONE)
    assert len(typed()) > 20


@pytest.mark.slow
def test_every_command_can_be_typed_as_it_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def as_committed(sources: Sequence[Path], target_dir: Path, *_: object, **__: object) -> None:
        """The chapter on the demo rig, which the suite of notebooks executes."""
        target_dir.mkdir()
        shutil.copy(ROOT / "notebooks" / f"{own_rig.CHAPTER}.ipynb", target_dir / sources[0].name)

    monkeypatch.setattr(own_rig, "execute_notebooks", as_committed)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").symlink_to(ROOT / "data", target_is_directory=True)
    schedule = emulator.emulate(cube_scene(), rng=np.random.default_rng(0))
    take_box(7, 1.0, Path("rig7"))
    told = []
    with emulator.serve(schedule, "socket") as served:
        for command in typed():
            if command.startswith("stereolib "):
                told.append(capsys.readouterr().out)
                code = run(words_of(command), served.port)
                assert code == 0, f"{command}: {code}\n{capsys.readouterr()}"
                if "rig7/box" in command:
                    said = capsys.readouterr().out
                    sizes = [float(mm) for mm in re.findall(r"([\d.]+) ±", said)[:3]]
                    assert sizes == pytest.approx(stage("box", rig=7).sizes_mm[0], abs=5), said
            else:
                exec(compile(command, "README.md", "exec"), {})
    assert "matched" in "".join([*told, capsys.readouterr().out])
    made = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if "data" not in path.parts}
    assert {"board.pdf", "rig/calibration.json", "demo_report/report.html", "d_depth_mm.png", "room.bin"} <= made
    page = (tmp_path / "demo_report" / "report.html").read_text(encoding="utf-8")
    assert page.count("<img") == 5 and "No description" not in page
    assert {"my_rig/rig.toml", "3_left_measured.png", "length.png", "walk_map/map.glb"} <= made


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.skipif(shutil.which("bash") is None, reason="it is a script for bash")
def test_the_script_takes_a_pair_and_a_scan_at_each_place(tmp_path: Path) -> None:
    """As it stands, but for fewer places, smaller pictures, and the rig that capture would have calibrated before."""
    (script,) = (
        block for language, block, _ in _CODE.findall((ROOT / "README.md").read_text("utf-8")) if language == "bash"
    )
    loop, last, after = script.partition("done\nrig=")
    assert last and [words_of(line)[0] for line in after.splitlines()[1:]] == ["calibrate-laser", "map"]
    for many, few in (("walk/{1..5} laser-board/{1..10}", "walk/{1..2} laser-board/1"), ("--scale 1", "--scale 0.25")):
        assert loop.count(many) == 1
        loop = loop.replace(many, few)
    command = tmp_path / "bin" / "stereolib"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m stereolib "$@"\n')
    command.chmod(0o755)
    path = os.pathsep.join([str(command.parent), os.environ["PATH"]])
    environment = os.environ | {"PATH": path, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(["bash", "-c", f"{loop}done"], cwd=tmp_path, env=environment, capture_output=True, text=True)
    made = {
        file.relative_to(tmp_path / "rig7").as_posix() for file in (tmp_path / "rig7").rglob("*.*") if file.is_file()
    }
    pairs = {f"{name}.png" for name in ("walk/left/01", "walk/right/02", "laser-board/left/01", "laser-board/right/01")}
    scans = {f"{name}.bin" for name in ("walk/scans/01", "walk/scans/02", "laser-board/scans/01")}
    assert pairs | scans <= made and not any("03" in name for name in made), done.stderr
