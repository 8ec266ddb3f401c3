"""Boards in image files: found over all cores, kept beside the images as they are found."""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Sequence
from functools import partial
from os import PathLike
from pathlib import Path

import numpy as np

from stereolib.base import write_atomic
from stereolib.calibration.boards import Board, BoardViews, Charuco, find_board, over_cores, paired
from stereolib.rig import read_image

Array = np.ndarray
#: Folder beside the images; one small file for each view, named by what was in the image and which board was sought.
CACHE = ".stereolib_corners"
_VERSION = 2  # of the detector: a change of its results must change it


def find_in_files(
    left: Sequence[str | PathLike[str]],
    right: Sequence[str | PathLike[str]],
    board: Board,
    *,
    cache: bool = True,
    progress: bool = True,
) -> BoardViews:
    """Find the board in paired image files; pairs carry the left files' names.

    Each view is kept as soon as it is done (`CACHE`, by the sha256 of the file's bytes), so that an interruption
    loses nothing and a second run reads. A folder that cannot be written to is searched anew each time.

    Raises
    ------
    ValueError
        Lists of different length, unreadable files, mixed sizes (all of them are listed), or no board in any pair.
    """
    if len(left) != len(right) or not len(left):
        raise ValueError(f"expected as many right images as left ones, got {len(left)} left and {len(right)} right")
    files = [Path(file) for pair in zip(left, right, strict=True) for file in pair]
    search = partial(_find, board=board, cache=cache)
    results = list(over_cores(search, files, "finding boards", progress=progress))
    if wrong := [text for text in results if isinstance(text, str)]:
        listed = "\n  ".join(wrong[:20]) + ("\n  ..." if len(wrong) > 20 else "")
        raise ValueError(f"{len(wrong)} of {len(files)} files are no readable images:\n  {listed}")
    sizes = [result[1] for result in results]
    usual = max(sorted(set(sizes)), key=sizes.count)
    if odd := [f"{file} is {w}x{h}" for file, (w, h) in zip(files, sizes, strict=True) if (w, h) != usual]:
        listed = "\n  ".join(odd[:20]) + ("\n  ..." if len(odd) > 20 else "")
        raise ValueError(f"all images must have one size, most are {usual[0]}x{usual[1]}, but:\n  {listed}")
    return paired([result[0] for result in results], board, [file.name for file in files[::2]], usual)


def _find(file: Path, *, board: Board, cache: bool) -> tuple[Array | None, tuple[int, int]] | str:
    """Corners and size of one file, or what is wrong with it."""
    try:
        data = file.read_bytes()
    except OSError as error:
        return f"{file}: {error.strerror or error}"
    key = hashlib.sha256(data + f"|{_sought(board)}|{_VERSION}".encode()).hexdigest()
    kept = file.parent / CACHE / f"{key[:32]}.npz"
    if cache and (known := _load(kept)) is not None:
        return known
    try:
        image = read_image(file)
    except ValueError as error:
        return str(error)
    corners, size = find_board(image, board), (image.shape[1], image.shape[0])
    if cache:
        _keep(kept, corners, size)
    return corners, size


def _sought(board: Board) -> str:
    """All that a search depends on: a board's pattern, not its size in mm."""
    pattern = f"{board.columns}x{board.rows}"
    if isinstance(board, Charuco):
        pattern += f" {board.dictionary} {board.marker_mm / board.square_mm:.6f}{' legacy' * board.legacy}"
    return pattern


def _keep(kept: Path, corners: Array | None, size: tuple[int, int]) -> None:
    stream = io.BytesIO()
    np.savez(stream, corners=np.zeros((0, 2), np.float32) if corners is None else corners, size=np.array(size))
    try:
        write_atomic(kept, stream.getvalue())
    except OSError:
        return  # a folder for reading only: nothing is lost but time


def _load(kept: Path) -> tuple[Array | None, tuple[int, int]] | None:
    """What `_keep` wrote; None if there is nothing, or nothing readable."""
    try:
        with np.load(io.BytesIO(kept.read_bytes()), allow_pickle=False) as stored:
            corners, (width, height) = stored["corners"], stored["size"].tolist()
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        return None
    return (corners if len(corners) else None), (width, height)
