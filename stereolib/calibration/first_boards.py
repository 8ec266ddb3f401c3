"""What the first boards tell already: a wrong count of corners, and left and right exchanged."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from stereolib.base import Float64, UInt8, counted
from stereolib.calibration.board_files import find_in_files
from stereolib.calibration.board_poses import board_poses
from stereolib.calibration.board_views import BoardViews
from stereolib.calibration.boards import Board, Charuco, Checkerboard
from stereolib.rig import Camera, PairFile, read_image

_LEAST_PAIRS = 3  # that tell it
_LOOKED_AT = 6  # pairs, from all over a recording, before the others
_SMALLEST, _LEAST_SEEN = (3, 3), 3  # corners of a board that is looked for by itself; pictures that must agree
_FOCAL_WIDTHS = 0.9  # of a webcam, before it is known: 58 degrees across
_SURE = 3.0  # standard deviations of the mean over pairs


def guessed_camera(size: tuple[int, int]) -> Camera:
    """Give a webcam as it is taken for before it is known: 58 degrees across, without distortion.

    Parameters
    ----------
    size : (width, height), px

    Returns
    -------
    Camera
    """
    (width, height), f = size, _FOCAL_WIDTHS * max(size)
    K = np.array([[f, 0, (width - 1) / 2], [0, f, (height - 1) / 2], [0, 0, 1]])
    return Camera(K, np.zeros(5), size)


def exchanged_mm(views: BoardViews) -> float:
    """Tell how far the camera that is called left stands to the right of the other.

    Parameters
    ----------
    views : BoardViews
        Three pairs at least.

    Returns
    -------
    float, mm
        Roughly; NaN where the pairs do not show it for certain, or the left camera stands left.

    Notes
    -----
    Each pair's board has a pose in either camera, by a guessed lens; from both follows where the right camera has the
    left one. The middle of all pairs counts, if it is surely more sideways than up or down.
    """
    if len(views) < _LEAST_PAIRS:
        return np.nan
    camera, points = guessed_camera(views.size), views.board.points_mm
    (left_turns, left_shifts), (right_turns, right_shifts) = (
        board_poses(points, corners, camera) for corners in (views.left_px, views.right_px)
    )
    between = right_turns @ np.swapaxes(left_turns, 1, 2)
    shifts: Float64 = right_shifts - np.einsum("nij,nj->ni", between, left_shifts)
    middle = np.median(shifts, axis=0)
    spread = 1.5 * np.median(np.abs(shifts - middle), axis=0) / np.sqrt(len(shifts))
    is_sure = middle[0] > _SURE * spread[0] and middle[0] > abs(middle[1]) and (shifts[:, 0] > 0).mean() > 0.8
    return float(middle[0]) if is_sure else np.nan


def check_sides(views: BoardViews, given: str) -> None:
    """Refuse pairs of a board that show that left and right are exchanged.

    Parameters
    ----------
    views : BoardViews
    given : str
        Where the pairs are.

    Raises
    ------
    ValueError
        If they are; the text names them.
    """
    if np.isfinite(off_mm := exchanged_mm(views)):
        raise ValueError(
            f"left and right are exchanged in {given}: by {counted(len(views), 'pair')} of the board ({views.names[0]} "
            f"...) the camera that is called left stands some {off_mm:.0f} mm to the right of the other. Give them the "
            f"other way round, or rename them, unless both cameras hang upside down (turn the pictures by 180 degrees) "
            f"or mirror (switch it off)"
        )


def check_first_boards(pairs: Sequence[PairFile], board: Board, given: str, *, progress: bool = False) -> None:
    """Look at some pairs of a recording before all the others are searched: what is found there is kept.

    Parameters
    ----------
    pairs : sequence of PairFile
    board : Checkerboard or Charuco
    given : str
        Where they are.
    progress : bool
        Show a bar.

    Raises
    ------
    ValueError
        If left and right are exchanged, or they show a checkerboard of another size and none of this one. Whatever
        else may be wrong is told by the search of all pairs.
    """
    some = pairs[:: max(1, len(pairs) // _LOOKED_AT)][:_LOOKED_AT]
    left, right = zip(*some, strict=True)
    try:
        views = find_in_files(left, right, board, progress=progress)
    except ValueError:
        if not isinstance(board, Charuco):
            _check_size(some, board, given)
        return
    check_sides(views, given)


def _check_size(pairs: Sequence[PairFile], board: Checkerboard, given: str) -> None:
    """Refuse pictures that show a checkerboard of another size."""
    seen = Counter(size for files in pairs for file in files if (size := _size_in(file)))
    (size, count), *_ = seen.most_common(1) or [((0, 0), 0)]
    if count >= _LEAST_SEEN and size != _unordered(board.columns, board.rows):
        raise ValueError(
            f"{given}: none of the {counted(len(pairs), 'pair')} looked at first ({pairs[0].left.name} ...) shows a "
            f"board of {board.columns}x{board.rows} inner corners; {counted(count, 'picture')} of theirs "
            f"show one of {size[0]}x{size[1]}. Say so (corners inside the board are "
            f"counted, not squares)"
        )


def _size_in(file: Path) -> tuple[int, int] | None:
    try:
        return size_seen(read_image(file, grey=True))
    except (ValueError, OSError):
        return None


def size_seen(grey: UInt8) -> tuple[int, int] | None:
    """Count the inner corners of the checkerboard in a picture, whichever it is.

    Parameters
    ----------
    grey : (H, W) uint8

    Returns
    -------
    (int, int) or None
        The more first; None where there is none that says.
    """
    flags = cv2.CALIB_CB_LARGER | cv2.CALIB_CB_NORMALIZE_IMAGE
    is_found, _, cells = cv2.findChessboardCornersSBWithMeta(grey, _SMALLEST, flags)
    size = _unordered(*cells.shape[:2]) if is_found else _SMALLEST
    return None if size == _SMALLEST else size


def _unordered(columns: int, rows: int) -> tuple[int, int]:
    return max(columns, rows), min(columns, rows)
