"""A folder for a while among the system's temporary ones; what killed processes left of theirs goes with the next."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from stereolib.base.files import hold, unlink_unheld

_PREFIX = "stereolib-"
_LOCK = "in_use"  # held as long as its process lives


@contextmanager
def work_folder() -> Iterator[Path]:
    """Make a folder that is removed at the end, however the block ends.

    Yields
    ------
    Path

    Raises
    ------
    OSError
        If the system has no place for temporary files.

    Examples
    --------
    >>> with work_folder() as folder:
    ...     _ = (folder / "a.txt").write_text("a")
    >>> folder.exists()
    False
    """
    _sweep(Path(tempfile.gettempdir()))
    folder = Path(tempfile.mkdtemp(prefix=_PREFIX))
    try:
        with (folder / _LOCK).open("wb") as stream:
            hold(stream)
            yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _sweep(place: Path) -> None:
    """Remove the user's own folders that nobody holds any more."""
    for folder in place.glob(f"{_PREFIX}*"):
        with suppress(OSError):
            if hasattr(os, "getuid") and folder.lstat().st_uid != os.getuid():
                continue
            unlink_unheld(folder / _LOCK)  # one without it is just being made, or none of ours
            shutil.rmtree(folder, ignore_errors=True)
