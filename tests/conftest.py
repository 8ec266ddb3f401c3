"""What every test gets: figures go to a temporary folder, and property tests draw the same examples each time."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import TypeAlias

# One thread for each worker, set before numpy and OpenCV are loaded: more get in each other's way.
os.environ |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "OPENCV_FOR_THREADS_NUM": "1"}
# As the command line does: OpenCV says nothing of its own about damaged files.
os.environ |= {"OPENCV_LOG_LEVEL": "SILENT", "OPENCV_FFMPEG_LOGLEVEL": "-8"}

import cv2
import pytest
from hypothesis import settings

from stereolib.base import datasets, write_atomic
from stereolib.calibration import BoardViews, Checkerboard, find_in_pairs
from stereolib.rig import read_pair
from stereolib.virtual import recordings

settings.register_profile("repeatable", derandomize=True, deadline=None, database=None)
settings.load_profile("repeatable")


def pytest_configure() -> None:
    """Stop when another OpenCV is loaded than the one that this run is to test."""
    expected = os.environ.get("STEREOLIB_EXPECT_OPENCV", version("opencv-python-headless"))
    if not expected.startswith(f"{cv2.__version__}."):
        pytest.exit(f"OpenCV {cv2.__version__} is loaded, this run is to test {expected}", returncode=3)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--fuzz-minutes", default="0", metavar="N", help="tests/test_untrusted.py for so many minutes")
    parser.addoption(
        "--interruptions", default="0", metavar="N", help="tests/test_interruptions.py: stop every command so often"
    )
    parser.addoption("--browser", action="store_true", help="also tests/browser: the bench in Chromium")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave tests/browser out unless it is asked for: it needs Voila, Playwright and Chromium."""
    is_left_out = collection_path == Path(__file__).parent / "browser" and not config.getoption("--browser")
    return True if is_left_out else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the files that hold slow tests: none of two workers is left alone with one of them at the end."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say which OpenCV it was: the tests are run with two."""
    terminalreporter.write_line(f"with OpenCV {cv2.__version__}")


@pytest.fixture(autouse=True)
def figures_in_temporary_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Keep the committed figures out of reach of the tests; return the folder they write to instead."""
    folder = tmp_path / "figures"
    monkeypatch.setenv("STEREOLIB_FIGURES", str(folder))
    return folder


Views: TypeAlias = Callable[[str, Callable[[], BoardViews]], BoardViews]


@pytest.fixture(scope="session")
def found_once(tmp_path_factory: pytest.TempPathFactory) -> Views:
    """What one of xdist's workers has found, also for the other: it takes each some seconds."""
    own = tmp_path_factory.getbasetemp()
    folder = own.parent if "PYTEST_XDIST_WORKER" in os.environ else own  # of this run alone

    def found(name: str, find: Callable[[], BoardViews]) -> BoardViews:
        file = folder / f"{name}.pickle"
        if not file.exists():
            write_atomic(file, pickle.dumps(find()))
        return pickle.loads(file.read_bytes())

    return found


@pytest.fixture(scope="session")
def recorded_views(found_once: Views) -> BoardViews:
    """The committed boards, found."""
    pairs, names = recordings.load_boards()
    return found_once("recorded", lambda: find_in_pairs(pairs, recordings.BOARD, names, progress=False))


@pytest.fixture(scope="session")
def minoru_views(found_once: Views) -> BoardViews:
    """The boards of a real webcam pair, found; without them and without a network: skipped."""
    try:
        left, right = (datasets.real_recordings(f"minoru3d/{side}") for side in ("left", "right"))
    except datasets.NotAvailable as error:
        pytest.skip(str(error))
    pairs = [read_pair(*files) for files in zip(left, right, strict=True)]
    names = [file.name for file in left]
    return found_once("minoru", lambda: find_in_pairs(pairs, Checkerboard(8, 6, 30.0), names, progress=False))
