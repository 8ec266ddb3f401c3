"""What every test gets: figures go to a temporary folder, and property tests draw the same examples each time."""

from __future__ import annotations

import os
from importlib.metadata import version
from pathlib import Path

import cv2
import pytest
from hypothesis import settings

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
