"""Matching where the laser points: the scan and the floor say which disparity to expect, pixel by pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from stereolib.base import Bools, Float32, Float64, UInt8, turn_2d, wrap_rad
from stereolib.laser import LaserScan, rays
from stereolib.matching.sgbm import SGBMParams
from stereolib.rig import RectifiedRig, check_pair, rigid, to_grey

_CELLS = 4096  # of the table over the tangent of the bearing, 0.5 px apart
_TANGENTS = (-2.0, 2.0)  # its ends: 63 degrees to either side
_CLEARLY = 2  # grey levels by which the room has to look more alike
_ROOM = 4  # the room is matched in pictures so many times smaller
_JUMP_PX = 6.0  # neighbouring beams that differ by more stand on different surfaces
_AHEAD_MM = 50.0  # readings nearer before the camera, or behind it, are of the rig


@dataclass(frozen=True, eq=False)
class ExpectedDisparity:
    """What the laser and the floor lead one to expect in the rectified left image.

    Parameters
    ----------
    near_px : (H, W) float32
        Disparity of the nearest surface that a pixel can show: what the scan met, thought upright and endless, and
        the floor before it.
    room_px : (H // 4, W // 4) float32
        The same without what stands free in the room, for every fourth pixel: what shows above and beside it.
    free : (top, bottom, left, right) or None
        The box in which the two differ, px.
    """

    near_px: Float32
    room_px: Float32
    free: tuple[int, int, int, int] | None


def expected_disparity(
    scan: LaserScan, rectified: RectifiedRig, T_left_world: Float64, laser_pose: Sequence[float] = (0.0, 0.0, 0.0)
) -> ExpectedDisparity:
    """Predict every pixel's disparity from a scan and the ground plane.

    Parameters
    ----------
    scan : LaserScan
        One turn or an average.
    rectified : RectifiedRig
    T_left_world : (4, 4) array
        Pose of the left camera above the floor, before rectification.
    laser_pose : (x_mm, y_mm, yaw_rad)
        Where the laser stands in the world and where its beam 0 looks.

    Returns
    -------
    ExpectedDisparity

    Raises
    ------
    ValueError
        If fewer than two beams in the cameras' view met anything.

    Notes
    -----
    The ray of a pixel has the direction ``D`` in the world, scaled to reach depth 1. It meets the floor at depth
    ``h / -D_z``, h the camera's height, and an upright surface ``X`` forward of the camera at ``X / D_x``. So
    ``d = f B max(-D_z / h, D_x / X)``, with X looked up by the tangent ``D_y / D_x``. Between beams on one surface X is
    interpolated in 1 / X, which is exact for planes; between surfaces the nearer one goes on to the next beam, which
    misses it. What it hides from the camera, beside which the laser's light starts, is left out.
    """
    T = rigid(rectified.R1, np.zeros(3)) @ T_left_world
    R, origin = T[:3, :3], -T[:3, :3].T @ T[:3, 3]
    if origin[2] <= 0:
        raise ValueError(f"the camera stands {origin[2]:.0f} mm above the floor; it must stand above it")
    fB = rectified.f_px * rectified.baseline_mm
    tangent, inverse = _profile(scan, origin, laser_pose, _JUMP_PX / fB)
    grid = np.linspace(*_TANGENTS, _CELLS)
    near, room = _tables(tangent, inverse, grid, _JUMP_PX / fB)
    rays = np.linalg.inv(rectified.left.K).T @ R @ np.diag([fB, fB, -fB / origin[2]])
    width, height = rectified.size
    u, v = np.arange(width), np.arange(height)[:, None]
    nearest = _nearest_px(near, rays, u, v)
    n, middle = _ROOM, (_ROOM - 1) / 2
    behind = _nearest_px(room, rays, u[: width // n * n : n] + middle, v[: height // n * n : n] + middle)
    differ = nearest[n // 2 :: n, n // 2 :: n][: height // n, : width // n] > behind + 1
    rows, columns = n * np.flatnonzero(differ.any(axis=1)), n * np.flatnonzero(differ.any(axis=0))
    free = (int(rows[0]), int(rows[-1]) + n, int(columns[0]), int(columns[-1]) + n) if rows.size else None
    return ExpectedDisparity(nearest, behind, free)


def compute_disparity_guided(
    left: UInt8, right: UInt8, expected: ExpectedDisparity, params: SGBMParams | None = None, *, margin_px: int = 8
) -> Float32:
    """Match a rectified pair only around the disparity that the laser leads one to expect.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        Rectified.
    expected : ExpectedDisparity
        From `expected_disparity`.
    params : SGBMParams, optional
        Its window is not used: the laser sets it. By default three paths and no search for specks, the quickest: in
        so narrow a window few false matches are left to be found, but where one camera alone sees.
    margin_px : int
        Searched around the expectation, a multiple of 8: from so many px below it to one less above it. It has to
        cover the laser's error (at 0.7 m one pixel is 7 mm), a tilted camera (half a degree moves the floor by 6 px at
        most) and surfaces that lean.

    Returns
    -------
    (H, W) float32, px, NaN where no match was accepted

    Raises
    ------
    ValueError
        If the images are no pair, or of another size than the expectation; if `margin_px` is no positive multiple of
        8; if the penalties of `params` do not fit their block (see `SGBMParams`).

    Notes
    -----
    The right image's rows are shifted by whole pixels, so that what is expected has disparity 0; then one narrow
    window serves every pixel, and nothing is interpolated. Twice: the room in quarter size, where what stands in front
    is taken away, and the box that holds it in full size. Where both return something, the one whose
    neighbourhoods look more alike wins. What it costs: of what both cameras see fewer pixels are wrong by more than 2
    px, but those within 4 px are less exact, and what one alone sees is filled with nonsense. On the virtual cube the
    rms error is about twice that of the full window, the pull towards whole pixels four to five times (notebook 10).
    """
    check_pair(left, right)
    if left.shape[:2] != expected.near_px.shape:
        raise ValueError(f"the expectation is for {expected.near_px.shape}, the images are {left.shape[:2]}")
    if margin_px < 8 or margin_px % 8:
        raise ValueError(f"margin_px must be a positive multiple of 8, got {margin_px}")
    params = params or SGBMParams(mode="3way", speckle_window_size=0)
    params = replace(params, num_disparities=2 * margin_px, min_disparity=-margin_px)
    left, right = to_grey(left), to_grey(right)
    height, width = left.shape
    half, quarter = (
        [cv2.resize(image, (width // n, height // n), interpolation=cv2.INTER_AREA) for image in (left, right)]
        for n in (2, _ROOM)
    )
    coarse = replace(params, speckle_window_size=params.speckle_window_size // _ROOM**2)
    room = _around(quarter[0], quarter[1], expected.room_px / np.float32(_ROOM), coarse)
    # What differs from the expectation is enlarged in steps, the expectation itself smoothly: the floor is steep.
    surprise = cv2.resize(_ROOM * room - expected.room_px, (width, height), interpolation=cv2.INTER_NEAREST)
    disparity: Float32 = surprise + cv2.resize(expected.room_px, (width, height), interpolation=cv2.INTER_LINEAR)
    if expected.free is not None:
        top, bottom, first, last = expected.free
        rim = params.block_size + 2
        top, bottom = max(0, top - rim), min(height, bottom + rim)
        first, last = max(0, first - rim), min(width, last + rim)
        box = (slice(top, bottom), slice(first, last))
        near = _around(left[box], right[top:bottom], expected.near_px[box], params, first)
        disparity[box] = _nearer_wins(half, near, disparity[box], (top, first))
    return disparity


def _profile(scan: LaserScan, origin: Float64, laser_pose: Sequence[float], jump: float) -> tuple[Float64, Float64]:
    """Tangents of the bearings seen from the camera, ascending, and 1 / forward distance (1/mm)."""
    x, y, yaw = laser_pose
    around = np.argsort(wrap_rad(scan.angles_rad + yaw), kind="stable")  # from behind to behind
    beams = rays(scan)[around].placed(turn_2d(yaw), np.array([x, y]) - origin[:2])
    ahead = beams.at(scan.ranges_mm[around])[:, 0] > _AHEAD_MM
    beams, ranges = beams[ahead], scan.ranges_mm[around][ahead]
    tangent, inverse = _seen_from_camera(beams.at(ranges))
    # Where neighbours meet different surfaces, the nearer one may go on as far as the farther one's beam.
    last = np.flatnonzero(np.abs(np.diff(inverse)) > jump)
    far = last + (inverse[last] > inverse[last + 1])
    ends = _seen_from_camera(beams[far].at(ranges[2 * last + 1 - far]))
    tangent, inverse = (np.insert(v, last + 1, end) for v, end in zip((tangent, inverse), ends, strict=True))
    seen = ~_behind(tangent, inverse, jump)
    order = np.argsort(tangent[seen], kind="stable")
    tangent, inverse = tangent[seen][order], inverse[seen][order]
    in_view = (tangent > _TANGENTS[0]) & (tangent < _TANGENTS[1])
    if in_view.sum() < 2:
        met = f"only {in_view.sum()} of {len(scan.ranges_mm)} beams met something in the cameras' view"
        advice = "Check the laser's pose, or use compute_disparity"
        raise ValueError(f"{met}: no window can be set from this scan. {advice}")
    return tangent[in_view], inverse[in_view]


def _seen_from_camera(points: Float64) -> tuple[Float64, Float64]:
    """Tangent of the bearing and 1 / forward distance of points (N, 2) before the camera."""
    forward = np.maximum(points[:, 0], _AHEAD_MM)
    return points[:, 1] / forward, 1 / forward


def _behind(tangent: Float64, inverse: Float64, jump: float) -> Bools:
    """Readings, in the order of the beams, that a surface between two neighbours hides from the camera. (N,) bool.

    The laser's light starts beside the camera: past an object's end it meets what the camera does not see.
    """
    width, steps = np.diff(tangent), np.diff(inverse)
    share = (tangent[:, None] - tangent[:-1]) / np.where(width == 0, np.inf, width)
    hides = (share > 0) & (share < 1) & (np.abs(steps) <= jump)
    return np.asarray((hides & (inverse[:-1] + share * steps > inverse[:, None] + jump)).any(axis=1))


def _tables(tangent: Float64, inverse: Float64, grid: Float64, jump: float) -> tuple[Float64, Float64]:
    """Look up 1 / forward distance over a grid of tangents: of the nearest surface, of the room behind what is free."""
    steps = np.diff(inverse)
    after = np.clip(np.searchsorted(tangent, grid), 1, len(tangent) - 1)
    past = np.minimum(inverse[after - 1], inverse[after])  # of two surfaces: the nearer one's end is in the profile
    near = np.where(np.abs(steps[after - 1]) > jump, past, np.interp(grid, tangent, inverse))
    pieces = np.split(np.arange(len(inverse)), np.flatnonzero(np.abs(steps) > jump) + 1)
    free = np.zeros(len(inverse), bool)
    for piece in pieces:  # nearer than what is on either side of it
        a, b = piece[0], piece[-1]
        free[piece] = a > 0 and b < len(inverse) - 1 and steps[a - 1] > 0 and steps[b] < 0
    return near, np.interp(grid, tangent[~free], inverse[~free])


def _nearest_px(table: Float64, rays: Float64, u: Any, v: Any) -> Float32:
    """Disparity (H, W) float32 at columns u (W,) and rows v (H, 1), of what stands there or the floor before it."""
    forward, side, floor = ((a * u).astype(np.float32) + (b * v + c).astype(np.float32) for a, b, c in rays.T)
    side /= forward
    side -= np.float32(_TANGENTS[0])
    side *= np.float32((_CELLS - 1) / (_TANGENTS[1] - _TANGENTS[0]))
    forward *= np.take(table.astype(np.float32), side.astype(np.int32), mode="clip")
    return np.asarray(np.maximum(forward, floor, out=forward))


def _around(left: UInt8, right: UInt8, expected: Float32, params: SGBMParams, first: int = 0) -> Float32:
    """Match `left`, which begins at column `first`, around an expected disparity; `right` is as wide as the image."""
    columns = np.arange(first, first + left.shape[1], dtype=np.int16)
    rows, shift = np.arange(len(left), dtype=np.int16)[:, None], np.rint(expected).astype(np.int16)
    where = np.stack(np.broadcast_arrays(columns - shift, rows), axis=-1)
    aligned = cv2.remap(right, where, None, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    rim = params.num_disparities // 2
    roomy = (cv2.copyMakeBorder(image, 0, 0, rim, rim, cv2.BORDER_REPLICATE) for image in (left, aligned))
    raw = params.matcher().compute(*roomy)[:, rim:-rim]
    disparity: Float32 = raw.astype(np.float32)
    disparity *= 1 / 16
    disparity += shift
    disparity[(raw < 16 * params.min_disparity) | (disparity > columns.astype(np.float32))] = np.nan
    return disparity


def _nearer_wins(small: list[UInt8], near: Float32, room: Float32, corner: tuple[int, int]) -> Float32:
    """`near` where it has a match that looks no worse than the room's, compared in half size."""
    top, first = corner
    a, b = top % 2, first % 2
    part = small[0][(top + a) // 2 :, (first + b) // 2 :]
    layers = [layer[a::2, b::2][: part.shape[0], : part.shape[1]] for layer in (near, room)]
    height, width = layers[0].shape
    row, column = np.arange(height, dtype=np.float32)[:, None], np.arange(width, dtype=np.float32)
    unlike = []
    for layer in layers:
        at = column + (first + b) // 2 - layer / 2
        at[np.isnan(at)] = -1e4
        rows = np.broadcast_to(row + (top + a) // 2, at.shape)
        matched = cv2.remap(small[1], at, rows, cv2.INTER_LINEAR, borderValue=255)
        unlike.append(cv2.blur(cv2.absdiff(matched, part[:height, :width]), (3, 3)))
    worse = (cv2.subtract(unlike[0], unlike[1]) > _CLEARLY).view(np.uint8)
    # single pixels look alike by chance, neighbourhoods do not: the majority of 9 x 9
    worse = cv2.boxFilter(worse, -1, (9, 9), normalize=False, borderType=cv2.BORDER_REPLICATE)
    worse = cv2.resize(worse, near.shape[::-1], interpolation=cv2.INTER_NEAREST) > 40
    worse &= ~np.isnan(room)
    return np.where(np.isnan(near) | worse, room, near)
