"""Boards in image files: found over all cores, kept beside the images as they are found."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from stereolib.targets import BoardViews, Checkerboard


def find_in_files(
    left: Sequence[Path], right: Sequence[Path], board: Checkerboard, *, cache: bool = True, progress: bool = True
) -> BoardViews:
    """Find the board in paired image files; pairs carry the left files' names.

    Raises
    ------
    ValueError
        Lists of different length, unreadable files, mixed sizes (all of them are listed), or no board in any pair.
    """
    raise NotImplementedError
