"""Corners of calibration boards in pictures, to sub-pixel."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import cv2
import numpy as np

from stereolib.base import Float32, UInt8
from stereolib.calibration.board_poses import can_be_posed
from stereolib.calibration.board_views import BoardViews, pair_views
from stereolib.calibration.boards import Board, Charuco, Checkerboard
from stereolib.calibration.refinement import refine
from stereolib.rig import check_image, check_pair, over_cores, to_grey

_LEAST_NUMBERED = 8  # corners of a ChArUco board: a pose has six unknowns, some are to spare


def find_checkerboard(image: UInt8, board: Checkerboard) -> Float32 | None:
    """Find the corners of a checkerboard to sub-pixel.

    The sector-based detector goes first (Duda & Frese, BMVC 2018: robust to noise and blur), where it finds nothing
    the classic one. Both are refined on the grey-value gradient (`refine`) in a window that reaches half way to the
    nearest corner, and over no rim of the board: the sector-based corners alone are off by 0.1 px rms and at times by
    pixels on tilted boards, the refined ones by 0.04 px.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
    board : Checkerboard

    Returns
    -------
    (columns * rows, 2) float32, px, or None
        In the order of `Checkerboard.points_mm`, up to a half turn of the board (see `match_order`); NaN for an
        outermost corner too near the board's rim.

    Raises
    ------
    ValueError
        If `image` is no such picture.
    """
    check_image(image)
    grey, inner = to_grey(image), (board.columns, board.rows)
    detected, corners = cv2.findChessboardCornersSB(grey, inner, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
    if not detected:  # stretching the contrast can close the gaps between the squares of an overexposed board
        detected, corners = cv2.findChessboardCornersSB(grey, inner, flags=0)
    if not detected:
        flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
        detected, corners = cv2.findChessboardCorners(grey, inner, flags=flags)
    return refine(grey, corners.reshape(-1, 2), board.rows) if detected else None


def find_charuco(image: UInt8, board: Charuco) -> Float32 | None:
    """Find the corners of a ChArUco board to sub-pixel, by their numbers, refined as those of a checkerboard.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
    board : Charuco

    Returns
    -------
    (columns * rows, 2) float32, px, or None
        In the order of `Charuco.points_mm`; NaN where a corner was not found. None for fewer than eight corners, or
        for corners on one line, which say nothing about a pose, or where refining leaves no more than that.

    Raises
    ------
    ValueError
        If `image` is no such picture.
    """
    check_image(image)
    grey = to_grey(image)
    corners, ids, *_ = cv2.aruco.CharucoDetector(board.printed).detectBoard(grey)
    if ids is None or len(ids) < _LEAST_NUMBERED:
        return None
    row_column = np.unravel_index(ids.ravel(), (board.rows, board.columns))
    if min(len(np.unique(index)) for index in row_column) < 2:
        return None
    all_corners = np.full((board.columns * board.rows, 2), np.nan, np.float32)
    all_corners[ids.ravel()] = corners.reshape(-1, 2)
    # the window reaches no marker, whose edges would pull at it
    found = refine(grey, all_corners, board.rows, reach=(1 - board.marker_mm / board.square_mm) / 2)
    return found if can_be_posed(found[None])[0] else None


def find_board(image: UInt8, board: Board) -> Float32 | None:
    """Find a board's corners by `find_checkerboard` or `find_charuco`, as the board is.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
    board : Checkerboard or Charuco

    Returns
    -------
    (columns * rows, 2) float32, px, or None

    Raises
    ------
    ValueError
        If `image` is no such picture.

    Examples
    --------
    >>> find_board(np.full((240, 320), 128, np.uint8), Checkerboard(9, 6, 25.0)) is None
    True
    """
    return find_charuco(image, board) if isinstance(board, Charuco) else find_checkerboard(image, board)


def find_in_pairs(
    pairs: Iterable[tuple[UInt8, UInt8]], board: Board, names: Sequence[str] | None = None, *, progress: bool = True
) -> BoardViews:
    """Find the board in stereo pairs, as many views at a time as there are cores.

    Parameters
    ----------
    pairs : iterable of (left, right)
        Images, (H, W) or (H, W, 3) uint8.
    board : Checkerboard or Charuco
    names : sequence of str, optional
        What to call the pairs in messages.
    progress : bool
        Show a bar.

    Returns
    -------
    BoardViews

    Raises
    ------
    ValueError
        If sizes differ, or the board is found in no pair; the pairs are named.
    """
    pairs = list(pairs)
    names = [f"pair {i + 1}" for i in range(len(pairs))] if names is None else list(names)
    if not pairs:
        raise ValueError("no image pairs were given to look for the board in")
    for (left, right), name in zip(pairs, names, strict=True):
        check_pair(left, right, names=(f"{name} (left)", f"{name} (right)"))
        if left.shape[:2] != pairs[0][0].shape[:2]:
            sizes = [f"{image.shape[1]}x{image.shape[0]}" for image in (left, pairs[0][0])]
            raise ValueError(f"{name} is {sizes[0]}, {names[0]} is {sizes[1]}: all pairs must have one size")
    images = [image for pair in pairs for image in pair]
    corners = list(over_cores(lambda image: find_board(image, board), images, "finding boards", progress=progress))
    return pair_views(corners, board, names, pairs[0][0].shape[1::-1])
