"""Files that a command is to write: refused before the work where they are in the way or cannot be written."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from stereolib.base import check_target, listed

_MOST_NAMED = 3  # files in the way that are named, which is enough to know them by


def check_outputs(paths: Iterable[Path], *, force: bool, option: str) -> None:
    """Refuse to overwrite, and find out before the work whether each file can be written.

    Parameters
    ----------
    paths : iterable of Path
    force : bool
        Whether files that are there may be replaced.
    option : str
        The option that names another place, for the message.

    Raises
    ------
    FileExistsError
        If a file is there and `force` is not given.
    ValueError
        If one cannot be written.
    """
    paths = list(paths)
    if (there := [path for path in paths if path.is_file()]) and not force:
        which = listed(there, _MOST_NAMED)
        raise FileExistsError(f"{which} would be overwritten: name another place with {option}, or pass --force")
    for path in paths:
        check_target(path)


def check_ending(path: Path, ending: str, what: str) -> None:
    """Refuse a file whose name says another format than it is written in; `what` names it in the message."""
    if path.suffix.lower() != ending:
        raise ValueError(f"{what} is written as {ending}: name it so, not {path}")
