"""Folders for a while: gone at the end, and what killed processes left goes with the next."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from stereolib.base import work_folder


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_it_goes_however_the_block_ends(place: Path, error: type[BaseException]) -> None:
    with pytest.raises(error), work_folder() as folder:
        (folder / "a").mkdir()
        assert list(place.iterdir()) == [folder]
        raise error
    assert list(place.iterdir()) == []


@pytest.mark.skipif(os.name == "nt", reason="signals are of Unix")
def test_what_a_killed_process_left_goes_with_the_next_one(place: Path) -> None:
    (place / "stereolib-of-somebody").mkdir()  # no lock in it: not known to be one of these
    code = (
        "import os, signal; from stereolib.base import work_folder\n"
        "with work_folder() as folder:\n    (folder / 'half').touch()\n    os.kill(os.getpid(), signal.SIGKILL)"
    )
    subprocess.run([sys.executable, "-c", code], env=os.environ | {"TMPDIR": str(place)}, check=False)
    assert len([path for path in place.glob("*/half")]) == 1
    with work_folder() as first, work_folder() as second:
        assert set(place.iterdir()) == {first, second, place / "stereolib-of-somebody"}
    assert list(place.iterdir()) == [place / "stereolib-of-somebody"]
