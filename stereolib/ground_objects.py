"""What stands on the floor, in a disparity map: told from the floor, from the background, and from each other."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.floor import Floor, checked_disparity, scaled_pixels

Array = np.ndarray
#: Every third pixel of every third row: faces are planes, and edges are looked for in the pictures.
STEP = 3


@dataclass(frozen=True, eq=False)
class Region:
    """Pixels of one thing that stands on the floor: every third of every third row.

    Attributes
    ----------
    u, v, disparity_px, height_mm : (N,) float64
        Pixels of the rectified left image, what was matched there, and the height above the floor that it means.
    position_mm : (x, y)
        Of its nearest part, on the floor: forward and left of the camera.
    bounds : (left, top, right, bottom)
        px, both ends included.
    """

    u: Array
    v: Array
    disparity_px: Array
    height_mm: Array
    position_mm: tuple[float, float]
    bounds: tuple[int, int, int, int]


def find_objects(
    disparity_px: Array,
    floor: Floor,
    *,
    min_height_mm: float = 20.0,
    max_distance_mm: float = 1800.0,
    least_px: int = 600,
) -> list[Region]:
    """Separate what stands on the floor, from the floor, from the background and from each other.

    Parameters
    ----------
    disparity_px : (H, W) float, px
        Of the rectified left image, NaN where invalid.
    floor : Floor
    min_height_mm : float
        What is lower belongs to the floor.
    max_distance_mm : float
        What is farther is background.
    least_px : int
        What has fewer pixels is no object.

    Returns
    -------
    list of Region, nearest first
    """
    disparity = checked_disparity(disparity_px, floor.rectified)[::STEP, ::STEP].astype(np.float32)
    rectified = floor.rectified
    rows, columns = disparity.shape
    u, v = np.arange(columns, dtype=np.float32) * STEP, np.arange(rows, dtype=np.float32)[:, None] * STEP
    ground = (floor.plane[0] * u + floor.plane[1] * v + floor.plane[2]).astype(np.float32)
    forward = floor.axes[0] / [rectified.f_px, rectified.f_px, 1.0]
    ahead = (forward[0] * (u - rectified.P1[0, 2]) + forward[1] * (v - rectified.P1[1, 2]) + forward[2]).astype(
        np.float32
    )
    least_disparity = rectified.f_px * rectified.baseline_mm / max_distance_mm
    lift = np.float32(min_height_mm / floor.camera_height_mm)
    mask = (
        (ahead > 0.2) & (disparity > least_disparity * ahead) & (disparity - ground > np.maximum(lift * disparity, 1.0))
    )
    filled = np.where(mask, disparity, 0)
    jump = np.zeros(mask.shape, bool)
    for axis in (0, 1):  # neighbours of different depth are different things
        step = np.abs(np.diff(filled, axis=axis)) > 1.5 + 0.02 * np.delete(filled, -1, axis=axis)
        np.logical_or(jump[:-1] if axis == 0 else jump[:, :-1], step, out=jump[:-1] if axis == 0 else jump[:, :-1])
    count, labels, stats, _ = cv2.connectedComponentsWithStats((mask & ~jump).astype(np.uint8), connectivity=4)
    found = []
    for k in range(1, count):
        x, y, w, h, area = stats[k]
        if area * STEP**2 < least_px:
            continue
        part = labels[y : y + h, x : x + w] == k
        row, column = np.nonzero(part)
        d = filled[y : y + h, x : x + w][part].astype(float)
        pu, pv = float(STEP) * (column + x), float(STEP) * (row + y)
        t, w_inverse = bearing_of(floor, pu, pv, d)
        near = int(np.argpartition(w_inverse, -len(d) // 50)[-len(d) // 50])
        position = (1 / w_inverse[near], t[near] / w_inverse[near])
        bounds = (int(STEP * x), int(STEP * y), int(STEP * (x + w - 1)), int(STEP * (y + h - 1)))
        found.append(Region(pu, pv, d, floor.height_mm(pu, pv, d), position, bounds))
    return sorted(found, key=lambda region: region.position_mm[0])


def bearing_of(floor: Floor, u: Array, v: Array, d: Array) -> tuple[Array, Array]:
    """Tangent of the bearing (left positive) and inverse forward distance (1/mm) of pixels, each (N,)."""
    ray = scaled_pixels(u, v, floor.rectified) @ floor.axes[:2].T
    return ray[:, 1] / ray[:, 0], d / (floor.rectified.f_px * floor.rectified.baseline_mm * ray[:, 0])
