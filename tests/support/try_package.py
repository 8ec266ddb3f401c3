"""Try an installed stereolib as its user would, in a folder that is not the repository: ``try_package.py FOLDER``.

Run by the Python that it is installed for; stops at the first thing that does not work. The recordings that it hands
to the commands come from the repository which this file belongs to.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
VIRTUAL = ROOT / "data" / "virtual"
RIG_AND_SCAN = """
import stereolib
assert stereolib.base.datasets.INSTALLED, stereolib.__file__
rig = stereolib.paper.paper_rig()
assert rig.left.size == (640, 480)
rig.save("paper.json")
assert len(stereolib.base.datasets._registry()) == 61
"""
HELPS = """
from stereolib import cli
def leaves(commands, *above):
    for command in commands:
        yield from leaves(command.commands, *above, command.name) if command.commands else [(*above, command.name)]
for words in [(), *leaves(cli.COMMANDS)]:
    try:
        cli.main([*words, "--help"])
    except SystemExit as stopped:
        assert stopped.code == 0, words
"""


def run(folder: Path, *words: str, code: int = 0) -> str:
    """Run Python with some words in the folder; return what it printed."""
    command = [sys.executable, "-I", *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=180)
    assert done.returncode == code, f"{words}: exit code {done.returncode}\n{done.stdout}{done.stderr}"
    return done.stdout + done.stderr


def stereolib(folder: Path, *words: str, code: int = 0) -> str:
    return run(folder, "-m", "stereolib", *words, code=code)


def main(folder: Path) -> None:
    run(folder, "-c", RIG_AND_SCAN)
    run(folder, "-c", HELPS)
    script = Path(sys.executable).with_name("stereolib")
    told = subprocess.run([script, "--version"], cwd=folder, capture_output=True, text=True, check=True).stdout
    assert told == stereolib(folder, "--version") and told.startswith("stereolib ")

    for side in ("left", "right"):
        (folder / side).mkdir()
        for board in sorted((VIRTUAL / "boards").glob(f"*_{side}.jpg"))[:6]:
            shutil.copy(board, folder / side / board.name.replace(f"_{side}", ""))
    stereolib(folder, "calibrate", "left", "right", "--board", "9x6", "--square-mm", "25", "--output", "rig")
    assert (folder / "rig" / "calibration.json").is_file() and (folder / "rig" / "report.html").is_file()

    pair = [str(VIRTUAL / "conditions" / f"texture_{side}.jpg") for side in ("left", "right")]
    measured = json.loads(stereolib(folder, "measure", *pair, "--calibration", "paper.json", "--json"))
    assert any(abs((found["height_mm"] or 0) - 300) < 15 for found in measured["objects"])
    emulator = [sys.executable, "-I", "-m", "stereolib", "lrf", "emulate", "--link", "socket"]
    with subprocess.Popen(emulator, cwd=folder, stdout=subprocess.PIPE, text=True) as emulated:
        assert emulated.stdout is not None and emulated.stdout.readline().startswith("socket://")
        emulated.terminate()

    told = stereolib(folder, "data", "fetch", code=2)
    assert "Clone the repository" in told and "STEREOLIB_DATA_URL" in told, told
    told = stereolib(folder, "data", "verify", code=2)
    assert "not the installed package: clone it" in told
    told = stereolib(folder, "reproduce", code=2)
    assert "repository" in told or "pip install '.[notebooks]'" in told, told
    assert told.count("\n") == 1
    print("the installed package works")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
