"""Commands stopped at random moments: older outputs stay whole, and a second run leaves what a first one does.

One command a little on every run; all of them with ``--interruptions 10``.
"""

from __future__ import annotations

import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import pytest

from stereolib.base import datasets
from stereolib.measurement import save_laser_pose
from stereolib.paper import paper_rig
from stereolib.virtual import walk_folder
from stereolib.virtual.measured_walk import walk_laser

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals are of Unix")
VIRTUAL = datasets.ROOT / "data" / "virtual"
_OLDER = b"older\n"  # stands in every output before the command begins
_STARTED_S = 0.3  # before, the interpreter itself is not up
_BOARD = "--board 9x6 --square-mm 25"


class Writing(NamedTuple):
    """A command that writes into ``out``, and whether it is tried on every run."""

    words: str
    quick: bool = False


WRITING = [
    Writing("board --out out/board.pdf --charuco --force", quick=True),
    Writing("lrf show room.bin --output out/room.png --force"),
    Writing("measure l.jpg r.jpg --scan room.bin --calibration rig.json --output out/m.png --force"),
    Writing("disparity l.jpg r.jpg --calibration rig.json --pipeline paper --output out/d.npy --force"),
    Writing("disparity l.jpg r.jpg --calibration rig.json --max-disparity 96 --output out/d.npy --force"),
    Writing(f"calibrate left right {_BOARD} --output out --format opencv --force"),
    Writing(f"check left right {_BOARD} --calibration rig.json --picture out/c.png --force"),
    Writing("map walk --output out --force"),
    Writing("data walk out --force"),
    Writing("bake out --force"),
]


def make(folder: Path) -> None:
    """Recordings for all of them."""
    for side, short in (("left", "l"), ("right", "r")):
        shutil.copy(VIRTUAL / "conditions" / f"texture_{side}.jpg", folder / f"{short}.jpg")
        (folder / side).mkdir()
        for k in range(1, 7):
            shutil.copy(VIRTUAL / "boards" / f"{k:02d}_{side}.jpg", folder / side / f"{k:02d}.jpg")
    shutil.copy(VIRTUAL / "lrf" / "room.bin", folder)
    paper_rig().save(folder / "rig.json")
    save_laser_pose(folder / "rig.json", walk_laser())

    (folder / "out").mkdir()


def run(folder: Path, words: list[str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "stereolib", *words],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # a job in the background has none
    )


def finish(process: subprocess.Popen[bytes]) -> None:
    said = process.communicate()[1]
    assert process.returncode in (0, 1), said


def there(folder: Path) -> dict[str, bytes]:
    """All files below a folder."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def older(folder: Path, outputs: dict[str, bytes]) -> None:
    """Put older files where these outputs are to be, and take away whatever else is there."""
    shutil.rmtree(folder / "out")
    for name in outputs:
        (folder / "out" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "out" / name).write_bytes(_OLDER)


@pytest.fixture(scope="module")
def folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("interrupted")
    make(made)
    if int(request.config.getoption("--interruptions")):
        walk_folder.write_walk(made / "walk")
    return made


@pytest.mark.timeout(0)
@pytest.mark.parametrize("writing", WRITING, ids=[writing.words for writing in WRITING])
def test_an_interruption_loses_nothing_and_leaves_nothing(
    writing: Writing, folder: Path, request: pytest.FixtureRequest
) -> None:
    times = int(request.config.getoption("--interruptions")) or (2 if writing.quick else 0)
    if not times:
        pytest.skip("with --interruptions 10")
    words, rng = writing.words.split(), random.Random(writing.words)
    shutil.rmtree(folder / "out")
    (folder / "out").mkdir()
    begin = time.monotonic()
    finish(run(folder, words))
    took, finished = time.monotonic() - begin, there(folder / "out")
    for k in range(times):
        older(folder, finished)
        before = there(folder / "out")
        shutil.rmtree(folder / "left" / ".stereolib_corners", ignore_errors=True)
        shutil.rmtree(folder / "right" / ".stereolib_corners", ignore_errors=True)
        stopped, sent = run(folder, words), (signal.SIGINT, signal.SIGKILL)[k % 2]
        time.sleep(rng.uniform(_STARTED_S, max(took, 2 * _STARTED_S)))
        stopped.send_signal(sent)
        said, code = stopped.communicate()[1].decode(), stopped.returncode
        if sent == signal.SIGINT:
            assert code in (0, 1, 130, -signal.SIGINT) and said.count("\n") <= 1 and "Traceback" not in said, said
        left = there(folder / "out")
        assert left.keys() >= finished.keys()
        for name, content in finished.items():
            whole = content if name != "report.html" else left[name][-8:]  # which differs from run to run
            assert left[name].endswith(whole) or left[name] == before[name], f"{name} after {k + 1}"
        if sent == signal.SIGINT:
            assert left.keys() == finished.keys()
    finish(run(folder, words))
    again = there(folder / "out")
    assert again.keys() == finished.keys()
    assert all(again[name] == finished[name] for name in finished if name != "report.html")
    strays = [path for path in folder.rglob(".*") if re.fullmatch(r"\..+\.[0-9a-f]{8}", path.name)]
    assert strays == []
