"""Where boards are before a camera, and which views are enough to tell."""

from __future__ import annotations

import cv2
import numpy as np

from stereolib.base import Bools, Float64, Floats
from stereolib.rig import Camera

#: Gauss-Newton steps after `cv2.solvePnP`, which stops at 1e-7 rad: each gains two digits or more, six reach rounding.
_POSE_STEPS = 6
LEAST_POSED = 4  # corners of a flat board, not all on one line: fewer have no pose
_LEAST_SOLID = 6  # points that lie in no plane
_FLAT = 1e-6  # of their extent: points that leave a plane, or a line, by less lie in it
_POSE_WORSE = 1e-6  # of the sum of squares: far above rounding, so that every processor decides alike
_POSE_SAME_PX2 = 1e-12  # sums of squares below are a perfect fit


def can_be_posed(corners_px: Floats) -> Bools:
    """Tell which views show enough of a board to say where it is: four corners, not all on one line.

    Parameters
    ----------
    corners_px : (views, corners, 2) array
        NaN where a corner was not found.

    Returns
    -------
    (views,) bool

    Examples
    --------
    >>> can_be_posed(np.array([[[0.0, 0], [10, 0], [20, 0], [30, 1]], [[0, 0], [10, 0], [20, 0], [30, 0]]]))
    array([ True, False])
    """
    corners = np.asarray(corners_px, float)
    known = np.isfinite(corners).all(axis=-1, keepdims=True)
    middle = np.where(known, corners, 0).sum(axis=1, keepdims=True) / np.maximum(known.sum(axis=1, keepdims=True), 1)
    off = np.where(known, corners - middle, 0)
    across, along = np.linalg.eigvalsh(off.transpose(0, 2, 1) @ off).T
    return np.asarray((known.sum(axis=(1, 2)) >= LEAST_POSED) & (across > _FLAT**2 * along))


def board_poses(board_mm: Floats, corners_px: Floats, camera: Camera) -> tuple[Float64, Float64]:
    """Pose each board by one camera.

    Parameters
    ----------
    board_mm : (N, 3) array
    corners_px : (n, N, 2) array
        NaN where not found.
    camera : Camera

    Returns
    -------
    turns, shifts : (n, 3, 3) and (n, 3) float64, mm

    Raises
    ------
    ValueError
        As `board_pose`.
    """
    turns, shifts = [], []
    for corners in np.asarray(corners_px, float):
        known = np.isfinite(corners).all(axis=1)
        turn, shift = board_pose(board_mm[known], corners[known], camera)
        turns.append(cv2.Rodrigues(turn)[0])
        shifts.append(shift)
    return np.array(turns), np.array(shifts)


def boards_before(board_mm: Floats, corners_px: Floats, camera: Camera) -> tuple[Float64, Float64, Float64]:
    """Pose each board by one camera, and place its corners before it.

    Parameters
    ----------
    board_mm : (N, 3) array
    corners_px : (n, N, 2) array
        NaN where not found.
    camera : Camera

    Returns
    -------
    turns, shifts : (n, 3, 3) and (n, 3) float64, mm
    points_mm : (n, N, 3) float64
        All corners of the boards, in the camera's frame.
    """
    turns, shifts = board_poses(board_mm, corners_px, camera)
    return turns, shifts, board_mm @ turns.transpose(0, 2, 1) + shifts[:, None]


def board_pose(board_mm: Floats, corners_px: Floats, camera: Camera) -> tuple[Float64, Float64]:
    """Pose one board by one camera, to rounding: the same on every processor.

    Parameters
    ----------
    board_mm : (N, 3) array
        In one plane, or six and more of them.
    corners_px : (N, 2) array
        All of them found, four at least, and not all on one line.
    camera : Camera

    Returns
    -------
    turn, shift : (3,) float64, rad and mm
        ``x_camera = Rodrigues(turn) @ x_board + shift``.

    Raises
    ------
    ValueError
        If corners are missing, NaN, too few, or on one line.

    Notes
    -----
    Minimises distances in pixels, as `cv2.solvePnP` does, which stops early and at another place for every order of
    summation. `cv2.solvePnPRefineVVS` would minimise them after undistorting, by a few fixed-point steps. Steps that
    lead away from what `cv2.solvePnP` found are undone: of both poses the one that fits better is returned.

    Examples
    --------
    >>> camera = Camera([[700, 0, 320], [0, 700, 240], [0, 0, 1]], [], (640, 480))
    >>> board = np.array([[0.0, 0, 0], [80, 0, 0], [0, 50, 0], [80, 50, 0], [40, 20, 0]])
    >>> turn, shift = board_pose(board, camera.project(board + [-30, 10, 600]), camera)
    >>> bool(abs(turn).max() < 1e-9), shift.round(6)
    (True, array([-30.,  10., 600.]))
    """
    points, corners = np.asarray(board_mm, float), np.asarray(corners_px, float)
    _check_posable(points, corners)
    _, turn, shift = cv2.solvePnP(points, corners, camera.K, camera.dist)
    first, misses = (turn, shift), []
    for _ in range(_POSE_STEPS + 1):
        pixels, J = cv2.projectPoints(points, turn, shift, camera.K, camera.dist)
        residuals = (corners - pixels[:, 0]).ravel()
        misses.append(float(residuals @ residuals))
        if not np.isfinite(misses[-1]) or len(misses) > _POSE_STEPS:
            break
        step = np.linalg.lstsq(J[:, :6], residuals, rcond=None)[0]
        turn, shift = turn + step[:3, None], shift + step[3:, None]
    if not misses[-1] <= misses[0] * (1 + _POSE_WORSE) + _POSE_SAME_PX2:
        turn, shift = first
    return turn.ravel(), shift.ravel()


def _check_posable(points: Float64, corners: Float64) -> None:
    if points.shape != (len(corners), 3) or corners.shape != (len(points), 2):
        raise ValueError(f"a pose needs (N, 3) points and (N, 2) corners, got {points.shape} and {corners.shape}")
    if not (np.isfinite(points).all() and np.isfinite(corners).all()):
        raise ValueError("a pose needs points and corners that are known: leave out those that are NaN")
    count, needed, enough = len(points), LEAST_POSED, False
    if count >= needed:
        spread = (np.linalg.svd(some - some.mean(axis=0), compute_uv=False) for some in (points, corners))
        (width, height, depth), (along, across) = spread
        needed = LEAST_POSED if depth <= _FLAT * width else _LEAST_SOLID
        enough = count >= needed and height > _FLAT * width and across > _FLAT * along
    if not enough:
        raise ValueError(f"{count} corners tell no pose: it takes {needed} at least, not all on one line")
