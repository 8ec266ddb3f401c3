"""Files that a command is to write: refused before the work where they are in the way or cannot be written."""

from __future__ import annotations

import itertools
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
        try:
            check_target(path)
        except ValueError as error:  # whose last words are what to do: choose another place, name a file
            raise ValueError(f"{error} with {option}") from None


def default_name(path: Path, *, force: bool, ends: Iterable[str] = ("",)) -> Path:
    """Give the name that a command chooses by itself: where a file is there already, the next number is added.

    Parameters
    ----------
    path : Path
    force : bool
        Whether files that are there may be replaced: then it is the plain name.
    ends : iterable of str
        In place of the name's ending, of all files that are written; "" is its own.

    Returns
    -------
    Path
    """
    ends = list(ends)
    for number in itertools.count(2):
        if force or not any((path.with_name(path.stem + end) if end else path).exists() for end in ends):
            return path
        stem = path.stem if number == 2 else path.stem.rpartition("_")[0]
        path = path.with_name(f"{stem}_{number}{path.suffix}")
    raise AssertionError


def check_ending(path: Path, ending: str, what: str) -> None:
    """Refuse a file whose name says another format than it is written in; `what` names it in the message."""
    if path.suffix.lower() != ending:
        raise ValueError(f"{what} is written as {ending}: name it so, not {path}")
