"""Boards that the virtual rig's camera and laser both see: what the laser's pose is calibrated from."""

from __future__ import annotations

import cv2
import numpy as np

from stereolib import laser
from stereolib.calibration import Checkerboard, LaserBoardView, board_pose, find_board_in_scan
from stereolib.rig import Camera, rigid
from stereolib.virtual.lidar import VirtualLidar
from stereolib.virtual.scene import Scene, board, room

Array = np.ndarray
#: Held upright, tall enough for the laser's plane to cut it.
BOARD = Checkerboard(6, 9, 30.0)
#: (forward mm, left mm, turn about the vertical, lean back in degrees), from the rig.
POSES = (
    (700, 0, 0, 0), (600, 120, 35, 30), (600, -120, -35, 30), (1000, 200, -30, -30), (1000, -200, 30, -30),
    (550, 0, 20, -30), (1100, 60, 0, 35), (700, -80, 40, 0), (750, 90, -40, -25), (900, -250, 10, 35),
)  # fmt: skip
_CORNER_PX = 0.1


def laser_board_views(
    sensor: VirtualLidar,
    laser_pose: tuple[float, float, float],
    T_left_world: Array,
    true_left: Camera,
    rng: np.random.Generator,
    *,
    believed_left: Camera | None = None,
    height_mm: float = 180.0,
) -> list[LaserBoardView]:
    """Ten poses of a board, as the camera and the laser see them.

    Parameters
    ----------
    sensor : VirtualLidar
    laser_pose : (x_mm, y_mm, yaw_rad)
        Where it stands in the world.
    T_left_world : (4, 4) array
        Where the camera stands.
    true_left : Camera
        Projects the corners, which get 0.1 px of noise.
    rng : numpy.random.Generator
    believed_left : Camera, optional
        The calibrated lens that finds the board's pose; by default the true one.
    height_mm : float
        Of the board's centre above the floor.
    """
    believed = believed_left or true_left
    points = BOARD.points_mm - BOARD.points_mm.mean(axis=0)
    diagonal_mm = float(np.hypot(BOARD.columns + 2.6, BOARD.rows + 2.6) * BOARD.square_mm)
    found = []
    for pose in POSES:
        T_world_board = _held(*pose, height_mm)
        T = T_left_world @ T_world_board
        pixels = true_left.project(points @ T[:3, :3].T + T[:3, 3])
        pixels = pixels + rng.normal(0, _CORNER_PX, pixels.shape)
        turn, t = board_pose(points, pixels, believed)
        scene = board_scene(pose, height_mm)
        scan = laser.average(laser.turns(laser.decode(sensor.scan(scene, laser_pose, rng, turns=5))))
        found.append(find_board_in_scan(scan, rigid(cv2.Rodrigues(turn)[0], t), diagonal_mm=diagonal_mm))
    return found


def board_scene(pose: tuple[float, float, float, float], height_mm: float) -> Scene:
    """The board in one of `POSES`, in a room."""
    return Scene((room(), board((BOARD.columns, BOARD.rows), BOARD.square_mm, _held(*pose, height_mm))))


def _held(forward_mm: float, left_mm: float, turn_deg: float, lean_deg: float, height_mm: float) -> Array:
    """T_world_board: z towards the rig, y up, then turned about the vertical and leant back."""
    t, a = np.radians([turn_deg, lean_deg])
    facing = np.array([[0.0, 0, -1], [-1, 0, 0], [0, 1, 0]])
    spin = np.array([[np.cos(t), -np.sin(t), 0], [np.sin(t), np.cos(t), 0], [0, 0, 1]])
    back = np.array([[1, 0, 0], [0, np.cos(a), np.sin(a)], [0, -np.sin(a), np.cos(a)]])
    return rigid(spin @ facing @ back, [forward_mm, left_mm, height_mm])
