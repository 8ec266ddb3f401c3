"""Boards that the camera and the laser both saw: the picture gives the board's plane, the scan a line on it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from stereolib.base import Float64, UInt8, finite_array, set_frozen
from stereolib.calibration.board_poses import board_pose
from stereolib.calibration.boards import Board, Charuco
from stereolib.calibration.find_boards import find_board
from stereolib.calibration.first_boards import size_seen
from stereolib.laser import LaserScan, find_segments, fit_line
from stereolib.rig import Camera, read_image, rigid, to_grey

_FLAT_MM = 6.0  # rms off a line: black squares read longer than white ones
_LONGER = 1.1  # times the diagonal: the beams at a board's ends read too wide


@dataclass(frozen=True, eq=False)
class LaserBoardView:
    """One pose of the board, as both saw it.

    Parameters
    ----------
    T_left_board : (4, 4) array
        Pose of the board in the left camera's frame; its plane is z = 0 (`board_pose`).
    points_mm : (N, 2) array
        Readings on the board, in the laser's frame.
    sigma_mm : (N,) array
        Standard deviation of each along its beam.
    """

    T_left_board: Float64
    points_mm: Float64
    sigma_mm: Float64

    def __post_init__(self) -> None:
        set_frozen(self, T_left_board=finite_array(self.T_left_board, (4, 4), "T_left_board"))
        count = len(self.points_mm)
        if count < 2:
            raise ValueError(f"a line on the board needs at least 2 readings, got {count}; hold it nearer to the laser")
        set_frozen(self, points_mm=finite_array(self.points_mm, (count, 2), "points_mm"))
        set_frozen(self, sigma_mm=finite_array(self.sigma_mm, (count,), "sigma_mm"))


def find_board_in_scan(scan: LaserScan, T_left_board: Float64, *, diagonal_mm: float) -> LaserBoardView:
    """Find the board in a scan: the straight object that is not larger than it.

    Parameters
    ----------
    scan : LaserScan
    T_left_board : (4, 4) array
        From the picture taken with it.
    diagonal_mm : float
        Of the board.

    Returns
    -------
    LaserBoardView

    Raises
    ------
    ValueError
        If no object in the scan, or more than one, could be the board.
    """
    objects = [part for part in find_segments(scan) if part.kind == "object"]
    short = [part for part in objects if part.extent_mm < _LONGER * diagonal_mm]
    fitting = [part for part in short if fit_line(part.points_mm).rms_mm < _FLAT_MM]
    if len(fitting) != 1:
        why = f"{len(fitting)} things in the scan could be the board (straight, at most {diagonal_mm:.0f} mm long)"
        remedy = "see that its squares are as told, that the laser's plane cuts it and nothing like it stands near"
        raise ValueError(f"{why}: {remedy}")
    return LaserBoardView(T_left_board, fitting[0].points_mm, fitting[0].sigma_mm)


def find_laser_boards_in_files(
    pictures: Sequence[Path],
    scans: Sequence[Path],
    board: Board,
    left: Camera,
    read_scan: Callable[[Path], LaserScan],
    *,
    margin_mm: float = 0.0,
) -> list[LaserBoardView]:
    """Find the boards that both saw in pictures of the left camera and recordings of the laser, one for one.

    Parameters
    ----------
    pictures, scans : sequences of Path
    board : Checkerboard or Charuco
    left : Camera
    read_scan : callable
        Reads a file of the laser and names it where it cannot (`stereolib.mapping.read_scan`).
    margin_mm : float
        By how much the board reaches beyond its squares.

    Returns
    -------
    list of LaserBoardView

    Raises
    ------
    ValueError
        Naming the file in which the board was not found.
    """
    views = list[LaserBoardView]()
    diagonal = float(np.hypot(*(np.ptp(board.points_mm[:, :2], axis=0) + 2 * (board.square_mm + margin_mm))))
    for picture, scan in zip(pictures, scans, strict=True):
        image = read_image(picture)
        corners = find_board(image, board)
        if corners is None:
            corners_told = "" if views else ": count its inner corners, not squares, or"  # none so far has it
            what = f"the board was not found in it{corners_told or ';'}"
            other = "" if views else _seen_instead(image, board)
            raise ValueError(f"{picture}: {what} take this pose out, or take it again{other}")
        known = np.isfinite(corners).all(axis=1)
        turn, t = board_pose(board.points_mm[known], corners[known], left)
        seen = read_scan(scan)
        try:
            views.append(find_board_in_scan(seen, rigid(cv2.Rodrigues(turn)[0], t), diagonal_mm=diagonal))
        except ValueError as error:
            raise ValueError(f"{scan}: {error}") from error
    return views


def _seen_instead(image: UInt8, board: Board) -> str:
    """Which checkerboard a picture shows in place of the one that was told; empty where there is no other."""
    size = None if isinstance(board, Charuco) else size_seen(to_grey(image))
    if size is None or set(size) == {board.columns, board.rows}:
        return ""
    return f"; it shows a board of {size[0]}x{size[1]} inner corners"
