"""What stands on the floor, in a disparity map: told from the floor, from the background, and from each other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from stereolib.measurement.floor import Floor, checked_disparity

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

    @cached_property
    def top_mm(self) -> float:
        """Height below which 97 of 100 of its pixels lie: its top, roughly."""
        at = int(0.97 * len(self.height_mm))
        return float(np.partition(self.height_mm, at)[at])


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
    ground, ahead = (a * u + (b * v + c) for a, b, c in (floor.plane.tolist(), floor.along[0].tolist()))
    least_disparity = rectified.f_px * rectified.baseline_mm / max_distance_mm
    lift = min_height_mm / floor.camera_height_mm
    mask = (ahead > 0.2) & (disparity > least_disparity * ahead)
    mask &= disparity - ground > np.maximum(lift * disparity, 1.0)
    filled = np.where(mask, disparity, 0)
    for first, second, kept in (
        (filled[:-1], filled[1:], mask[:-1]),
        (filled[:, :-1], filled[:, 1:], mask[:, :-1]),
    ):  # neighbours of different depth are different things
        kept &= np.abs(second - first) <= 1.5 + 0.02 * first
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=4)
    found = []
    for k in range(1, count):
        x, y, w, h, area = stats[k]
        if area * STEP**2 < least_px:
            continue
        part = labels[y : y + h, x : x + w] == k
        row, column = np.nonzero(part)
        d = filled[y : y + h, x : x + w][part].astype(float)
        pu, pv = float(STEP) * (column + x), float(STEP) * (row + y)
        ray = rays(floor, pu, pv)
        ahead = d / ray[0]
        near = int(np.argmax(ahead == np.partition(ahead, -len(d) // 50)[-len(d) // 50]))  # the first of equal ones
        x_mm, y_mm = rectified.f_px * rectified.baseline_mm / d[near] * ray[:, near]
        bounds = (int(STEP * x), int(STEP * y), int(STEP * (x + w - 1)), int(STEP * (y + h - 1)))
        found.append(Region(pu, pv, d, floor.height_mm(pu, pv, d), (float(x_mm), float(y_mm)), bounds))
    return sorted(found, key=lambda region: region.position_mm[0])


def rays(floor: Floor, u: Array, v: Array) -> Array:
    """How far the rays of pixels go forward and left along the floor per unit of depth, (2, N)."""
    of_u, of_v, constant = floor.along.T[..., None]
    return np.asarray(of_u * u + of_v * v + constant)
