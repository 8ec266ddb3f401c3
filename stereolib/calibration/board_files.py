"""Boards in image files: found over all cores, kept beside the images as they are found."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from os import PathLike
from pathlib import Path

import numpy as np

from stereolib.base import Float32, read_bytes, write_atomic
from stereolib.calibration.board_views import BoardViews, pair_views
from stereolib.calibration.boards import Board, Charuco
from stereolib.calibration.find_boards import find_board
from stereolib.rig import one_size, over_cores, read_image

#: Folder beside the images; one small file for each view, named by what was in the image and which board was sought.
CACHE = ".stereolib_corners"
_VERSION = 3  # of the detector: a change of its results must change it
_CACHE_LIMIT_BYTES = 2**20  # corners of a board are some kB
_LISTED = 20  # lines of an error's list, a screen
Files = Sequence[str | PathLike[str]]
View = tuple[Float32 | None, tuple[int, int]]


def find_in_files(left: Files, right: Files, board: Board, *, cache: bool = True, progress: bool = True) -> BoardViews:
    """Find the board in paired image files; pairs carry the left files' names.

    Each view is kept as soon as it is done (in a folder ``.stereolib_corners`` beside the pictures, by the sha256
    of the file's bytes), so that an interruption
    loses nothing and a second run reads. A folder that cannot be written to is searched anew each time.

    Parameters
    ----------
    left, right : sequences of path
        Image files, one for one.
    board : Checkerboard or Charuco
    cache : bool
        Read and keep what was found.
    progress : bool
        Show a bar.

    Returns
    -------
    BoardViews

    Raises
    ------
    ValueError
        Lists of different length, unreadable files or mixed sizes (of many, the first are listed), or no board in any
        pair.
    """
    if isinstance(left, str | PathLike) or isinstance(right, str | PathLike):
        raise ValueError("left and right are lists of files, one file was given: put it into a list")
    if len(left) != len(right) or not len(left):
        raise ValueError(f"expected as many right images as left ones, got {len(left)} left and {len(right)} right")
    files = [Path(file) for pair in zip(left, right, strict=True) for file in pair]
    results = list(over_cores(partial(_find, board=board, cache=cache), files, "finding boards", progress=progress))
    if wrong := [text for text in results if isinstance(text, str)]:
        shown = "".join(f"\n  {text}" for text in (*wrong[:_LISTED], *["..."] * (len(wrong) > _LISTED)))
        raise ValueError(f"{len(wrong)} of {len(files)} files are no readable images:{shown}")
    size = one_size({file: result[1] for file, result in zip(files, results, strict=True)})
    return pair_views([result[0] for result in results], board, [file.name for file in files[::2]], size)


def _find(file: Path, *, board: Board, cache: bool) -> View | str:
    """Corners and size of one file, or what is wrong with it."""
    try:
        data = read_bytes(file)
        key = hashlib.sha256(data + f"|{_sought(board)}|{_VERSION}".encode()).hexdigest()
        kept = file.parent / CACHE / f"{key[:32]}.npz"
        if cache and (known := _load(kept, board)) is not None:
            return known
        image = read_image(file)
    except OSError as error:
        return f"{file}: {error.strerror or error}"
    except ValueError as error:
        return str(error)
    corners, size = find_board(image, board), (image.shape[1], image.shape[0])
    if cache:
        _keep(kept, corners, size)
    return corners, size


def _sought(board: Board) -> str:
    """All that a search depends on: a board's pattern, not its size in mm."""
    if not isinstance(board, Charuco):
        return f"{board.columns}x{board.rows}"
    markers = f"{board.dictionary} {board.marker_mm / board.square_mm:.6f}{' legacy' * board.legacy}"
    return f"{board.columns}x{board.rows} {markers}"


def _keep(kept: Path, corners: Float32 | None, size: tuple[int, int]) -> None:
    stream = io.BytesIO()
    np.savez(stream, corners=np.zeros((0, 2), np.float32) if corners is None else corners, size=np.array(size))
    with suppress(OSError, ValueError):  # a folder for reading only: nothing is lost but time
        write_atomic(kept, stream.getvalue())


def _load(kept: Path, board: Board) -> View | None:
    """What `_keep` wrote; None if there is nothing, or nothing of its kind: it is computed again and replaced."""
    try:
        with np.load(io.BytesIO(read_bytes(kept, limit_bytes=_CACHE_LIMIT_BYTES)), allow_pickle=False) as stored:
            corners, size = stored["corners"], stored["size"]
    except Exception:  # whatever stands in that file, it was not written here
        return None
    shapes = ((0, 2), (board.columns * board.rows, 2))
    if corners.dtype != np.float32 or corners.shape not in shapes or size.dtype.kind != "i" or size.shape != (2,):
        return None
    return (corners if len(corners) else None), (int(size[0]), int(size[1]))
