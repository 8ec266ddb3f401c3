"""Commands stopped at random moments: older outputs stay whole, and a second run leaves what a first one does.

One command a little on every run; all of them with ``--interruptions 10``.
"""

from __future__ import annotations

import io
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from stereolib.base import datasets
from stereolib.laser import decode
from stereolib.measurement import save_laser_pose
from stereolib.paper import paper_rig
from stereolib.virtual import emulator, walk_folder
from stereolib.virtual.measured_walk import walk_laser

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals are of Unix")
VIRTUAL = datasets.ROOT / "data" / "virtual"
_OLDER = b"older\n"  # stands in every output before the command begins
_STAGED = ".staging/"  # where `reproduce` works; the next run empties it
_STARTED_S = 0.3  # before, the interpreter itself is not up
_BOARD = "--board 9x6 --square-mm 25"


class Writing(NamedTuple):
    """A command that writes into ``out``.

    Attributes
    ----------
    words : str
        With ``{laser}`` for the address of an emulated one.
    quick : bool
        Tried on every run.
    begins_anew : bool
        It writes over nothing: ``out`` is empty before it.
    over : str
        The folder of which ``out`` is a copy before it, where it completes or refreshes what is there.
    varies : tuple of str
        Endings of what differs from run to run: it has to be whole, not the same.
    most_s : float
        When it is stopped at the latest, s.
    """

    words: str
    quick: bool = False
    begins_anew: bool = False
    over: str = ""
    varies: tuple[str, ...] = ()
    most_s: float = 60.0


WRITING = [
    Writing("board --out out/board.pdf --charuco --force", quick=True),
    Writing("new out/rig", begins_anew=True),
    Writing("lrf show room.bin --output out/room.png --force"),
    Writing("lrf export room.bin out/room.csv --force"),
    Writing("lrf export room.bin out/room.ply --force"),
    Writing("lrf record {laser} out/room.bin --seconds 1.5 --force", varies=(".bin", ".json")),
    Writing("measure l.jpg r.jpg --scan room.bin --calibration rig.json --output out/m.png --force"),
    Writing("disparity l.jpg r.jpg --calibration rig.json --pipeline paper --output out/d.npy --force"),
    Writing("disparity l.jpg r.jpg --calibration rig.json --max-disparity 96 --output out/d.npy --force"),
    Writing(f"calibrate left right {_BOARD} --output out --format opencv --force", varies=(".html",)),
    Writing(f"check left right {_BOARD} --calibration rig.json --picture out/c.png --force"),
    Writing(
        "calibrate-laser walk/laser walk/laser --calibration out/rig.json --board 6x9 --square-mm 30 --margin-mm 24",
        over="without_laser",
    ),
    Writing(
        "capture left/%02d.jpg right/%02d.jpg --output out --pairs 6 --no-preview",
        begins_anew=True,
        varies=(".png", ".json"),
    ),
    Writing("map walk --output out --force"),
    Writing("data walk out --force"),
    Writing("data build --output out --force", most_s=40.0),
    Writing("report rig --output out --force", varies=(".html",)),
    Writing("bake out --force"),
    Writing("handout --out out/class.zip --no-wheels --force", varies=(".zip",)),
    Writing("reproduce 02 --jobs 1 --accept", over="checkout"),
]


def make(folder: Path) -> None:
    """Recordings for all of them."""
    for side, short in (("left", "l"), ("right", "r")):
        shutil.copy(VIRTUAL / "conditions" / f"texture_{side}.jpg", folder / f"{short}.jpg")
        (folder / side).mkdir()
        for k in range(1, 7):
            shutil.copy(VIRTUAL / "boards" / f"{k:02d}_{side}.jpg", folder / side / f"{k:02d}.jpg")
    shutil.copy(VIRTUAL / "lrf" / "room.bin", folder)
    (folder / "out").mkdir()
    (folder / "tmp").mkdir()


def make_more(folder: Path) -> None:
    """What only those need that are not tried on every run."""
    paper_rig().save(folder / "rig.json")
    save_laser_pose(folder / "rig.json", walk_laser())
    (folder / "without_laser").mkdir()
    paper_rig().save(folder / "without_laser" / "rig.json")
    walk_folder.write_walk(folder / "walk")
    (folder / "rig").mkdir()
    for name in ("boards", "pairs", "scans"):
        (folder / "rig" / name).mkdir()
    (folder / "rig" / "rig.toml").write_text("[board]\ninner_corners = [9, 6]\nsquare_mm = [25.0, 25.0]\n")
    for side in ("left", "right"):
        shutil.copy(VIRTUAL / "room" / f"3_{side}.jpg", folder / "rig" / "pairs")
        for board in VIRTUAL.glob(f"boards/[01]*_{side}.jpg"):
            shutil.copy(board, folder / "rig" / "boards")
    shutil.copy(VIRTUAL / "room" / "3_scan.bin", folder / "rig" / "scans" / "3.bin")
    for part in ("stereolib", "notebooks", "figures", "data", "benchmarks"):
        leave = shutil.ignore_patterns("__pycache__", "recordings", ".*")
        shutil.copytree(datasets.ROOT / part, folder / "checkout" / part, ignore=leave)
    for name in ("README.md", "pyproject.toml"):
        shutil.copy(datasets.ROOT / name, folder / "checkout")
    for figure in folder.glob("checkout/figures/fig*.png"):  # of an older version, so that they are drawn anew
        figure.write_bytes(figure.read_bytes() + _OLDER)


def run(folder: Path, words: list[str]) -> subprocess.Popen[bytes]:
    # one thread: OpenCV's calibration adds up in the order in which threads come
    own = {"TMPDIR": str(folder / "tmp"), "PYTHONDONTWRITEBYTECODE": "1", "OPENCV_FOR_THREADS_NUM": "1"}
    if (folder / "out" / "stereolib").is_dir():  # a checkout works on itself
        own["PYTHONPATH"] = str(folder / "out")
    return subprocess.Popen(
        [sys.executable, "-m", "stereolib", *words],
        cwd=folder,
        env={name: value for name, value in os.environ.items() if name != "STEREOLIB_FIGURES"} | own,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # a job in the background has none
    )


def finish(process: subprocess.Popen[bytes]) -> None:
    said = process.communicate()[1]
    assert process.returncode in (0, 1) or b"asked for already" in said, said


def there(folder: Path) -> dict[str, bytes]:
    """All files below a folder."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def prepare(folder: Path, writing: Writing, outputs: Iterable[str]) -> dict[str, bytes]:
    """Put older files where these outputs are to be, and take away whatever else is there."""
    shutil.rmtree(folder / "out")
    for side in ("left", "right", "rig/boards"):
        shutil.rmtree(folder / side / ".stereolib_corners", ignore_errors=True)
    if writing.over:
        shutil.copytree(folder / writing.over, folder / "out")
        return there(folder / "out")
    (folder / "out").mkdir()
    for name in () if writing.begins_anew else outputs:
        (folder / "out" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "out" / name).write_bytes(_OLDER)
    return there(folder / "out")


def is_whole(name: str, content: bytes, finished: bytes, varies: tuple[str, ...]) -> bool:
    """Whether a file is what a whole run writes; of one that varies, whether nothing of it is missing."""
    ending = Path(name).suffix
    if ending not in varies:
        return content == finished
    if ending == ".zip":
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            return archive.testzip() is None
    if ending == ".json":
        return isinstance(json.loads(content), dict)
    if ending == ".bin":  # of a port: what it has delivered
        return len(decode(content)) > 0
    return content.endswith(finished[-8:])


@pytest.fixture(scope="module")
def folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("interrupted")
    make(made)
    if int(request.config.getoption("--interruptions")):
        make_more(made)
    return made


@pytest.fixture
def laser(folder: Path) -> Iterator[str]:
    """The address of a laser that turns for ten minutes."""
    with emulator.serve(emulator.replay((folder / "room.bin").read_bytes() * 600), "socket") as served:
        yield served.port


@pytest.mark.timeout(0)
@pytest.mark.parametrize("writing", WRITING, ids=[writing.words for writing in WRITING])
def test_an_interruption_loses_nothing_and_leaves_nothing(
    writing: Writing, folder: Path, request: pytest.FixtureRequest
) -> None:
    times = int(request.config.getoption("--interruptions")) or (2 if writing.quick else 0)
    if not times:
        pytest.skip("with --interruptions 10")
    laser = request.getfixturevalue("laser") if "{laser}" in writing.words else ""
    words, rng = writing.words.format(laser=laser).split(), random.Random(writing.words)
    prepare(folder, writing, ())
    begin = time.monotonic()
    finish(run(folder, words))
    took, finished = time.monotonic() - begin, there(folder / "out")
    latest_s, stopped_at_work = min(max(took, 2 * _STARTED_S), writing.most_s), 0
    for k in range(times):
        before, strays = prepare(folder, writing, finished), set((folder / "tmp").iterdir())  # of one that was killed
        stopped, sent = run(folder, words), (signal.SIGINT, signal.SIGKILL)[k % 2]
        time.sleep(rng.uniform(_STARTED_S, latest_s))
        stopped.send_signal(sent)
        said, code = stopped.communicate()[1].decode(), stopped.returncode
        stopped_at_work += code not in (0, 1)
        left = {name: content for name, content in there(folder / "out").items() if not name.startswith(_STAGED)}
        if sent == signal.SIGINT:
            assert code in (0, 1, 130, -signal.SIGINT) and not re.search("Traceback|Warning", said), said
            assert code != 130 or not said or "stereolib: interrupted" in said.splitlines()[-1], said
            assert left.keys() <= finished.keys()
            assert strays.issuperset((folder / "tmp").iterdir())
        assert left.keys() >= before.keys()
        for name in finished.keys() & left.keys():
            kept = name in before and left[name] == before[name]
            assert kept or is_whole(name, left[name], finished[name], writing.varies), f"{name} after {k + 1}"
    finish(run(folder, words))
    again = there(folder / "out")
    assert again.keys() == finished.keys()
    assert all(is_whole(name, again[name], finished[name], writing.varies) for name in finished)
    unfinished = [path for path in folder.rglob(".*") if re.fullmatch(r"\..+\.[0-9a-f]{8}", path.name)]
    assert unfinished == [] and list((folder / "tmp").iterdir()) == []
    with request.config.pluginmanager.getplugin("capturemanager").global_and_fixture_disabled():
        print(f"\n{writing.words}: {took:.1f} s, {stopped_at_work} of {times} stopped at work")
