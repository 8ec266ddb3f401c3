"""What every test gets: figures go to a temporary folder, and property tests draw the same examples each time."""

from __future__ import annotations

import os
from importlib.metadata import version
from pathlib import Path

import cv2
import pytest
from hypothesis import settings

from stereolib.base import datasets
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


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say which OpenCV it was: the tests are run with two."""
    terminalreporter.write_line(f"with OpenCV {cv2.__version__}")


@pytest.fixture(autouse=True)
def figures_in_temporary_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Keep the committed figures out of reach of the tests; return the folder they write to instead."""
    folder = tmp_path / "figures"
    monkeypatch.setenv("STEREOLIB_FIGURES", str(folder))
    return folder


@pytest.fixture(scope="session")
def recorded_views() -> BoardViews:
    """The committed boards, found."""
    pairs, names = recordings.load_boards()
    return find_in_pairs(pairs, recordings.BOARD, names, progress=False)


@pytest.fixture(scope="session")
def minoru_views() -> BoardViews:
    """The boards of a real webcam pair, found; without them and without a network: skipped."""
    try:
        left, right = (datasets.real_recordings(f"minoru3d/{side}") for side in ("left", "right"))
    except datasets.NotAvailable as error:
        pytest.skip(str(error))
    pairs = [read_pair(*files) for files in zip(left, right, strict=True)]
    return find_in_pairs(pairs, Checkerboard(8, 6, 30.0), [file.name for file in left], progress=False)
