"""Boards that the virtual rig's camera and laser both see: what the laser's pose is calibrated from."""

from __future__ import annotations

import cv2
import numpy as np

from stereolib import laser
from stereolib.base import Float64, turn_about_z
from stereolib.calibration import Checkerboard, LaserBoardView, find_board_in_scan
from stereolib.calibration import board_pose as pose_of
from stereolib.rig import Camera, rigid
from stereolib.virtual import recordings
from stereolib.virtual.lidar import VirtualLidar
from stereolib.virtual.scene import Scene, board_box, room

#: Held upright, tall enough for the laser's plane to cut it.
BOARD = Checkerboard(6, 9, 30.0)
#: (forward mm, left mm, turn about the vertical, lean back in degrees), from the rig.
POSES = (
    (700, 0, 0, 0), (600, 120, 35, 30), (600, -120, -35, 30), (1000, 200, -30, -30), (1000, -200, 30, -30),
    (550, 0, 20, -30), (1100, 60, 0, 35), (700, -80, 40, 0), (750, 90, -40, -25), (900, -250, 10, 35),
)  # fmt: skip
_CORNER_PX = 0.1  # standard deviation of a corner, per coordinate
_SHEET_SQUARES = 2.6  # what the sheet has beyond its inner corners: a square and a rim on either side
_FACING = np.array([[0.0, 0, -1], [-1, 0, 0], [0, 1, 0]])  # z towards the rig, y up


def laser_board_views(
    sensor: VirtualLidar,
    true_left: Camera,
    rng: np.random.Generator,
    *,
    believed_left: Camera | None = None,
    height_mm: float = 180.0,
) -> list[LaserBoardView]:
    """Show a board in ten poses to the camera and the laser of the pitched set-up.

    Parameters
    ----------
    sensor : VirtualLidar
        It stands at `recordings.LASER_POSE`.
    true_left : Camera
        Projects the corners, which get 0.1 px of noise.
    rng : numpy.random.Generator
    believed_left : Camera, optional
        The calibrated lens that finds the board's pose; by default the true one.
    height_mm : float
        Of the board's centre above the floor, mm.

    Returns
    -------
    list of LaserBoardView
    """
    believed = believed_left or true_left
    points = BOARD.points_mm - BOARD.points_mm.mean(axis=0)
    diagonal_mm = float(np.hypot(BOARD.columns + _SHEET_SQUARES, BOARD.rows + _SHEET_SQUARES) * BOARD.square_mm)
    views = []
    for pose in POSES:
        T = recordings.setup() @ _held(*pose, height_mm)
        pixels = true_left.project(points @ T[:3, :3].T + T[:3, 3])
        pixels = pixels + rng.normal(0, _CORNER_PX, pixels.shape)
        turn, t = pose_of(points, pixels, believed)
        data = sensor.scan(board_scene(pose, height_mm), recordings.LASER_POSE, rng, turns=5)
        scan = laser.average(laser.turns(laser.decode(data)))
        views.append(find_board_in_scan(scan, rigid(cv2.Rodrigues(turn)[0], t), diagonal_mm=diagonal_mm))
    return views


def board_scene(pose: tuple[float, float, float, float], height_mm: float) -> Scene:
    """Hold the board in one of `POSES`, in a room.

    Parameters
    ----------
    pose : (forward_mm, left_mm, turn_deg, lean_deg)
    height_mm : float
        Of the board's centre above the floor, mm.

    Returns
    -------
    Scene
    """
    return Scene((room(), board_box((BOARD.columns, BOARD.rows), BOARD.square_mm, _held(*pose, height_mm))))


def _held(forward_mm: float, left_mm: float, turn_deg: float, lean_deg: float, height_mm: float) -> Float64:
    """T_world_board: facing the rig, then turned about the vertical and leant back."""
    turn, lean = np.radians([turn_deg, lean_deg])
    back = np.array([[1, 0, 0], [0, np.cos(lean), np.sin(lean)], [0, -np.sin(lean), np.cos(lean)]])
    return rigid(turn_about_z(turn) @ _FACING @ back, [forward_mm, left_mm, height_mm])
