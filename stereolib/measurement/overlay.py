"""Measured objects drawn into the picture they were measured in."""

from __future__ import annotations

import cv2
import numpy as np

from stereolib.measurement.measure import Measurement
from stereolib.measurement.measured_object import MeasuredObject

Array = np.ndarray
_COLORS = ((60, 220, 255), (255, 190, 70), (120, 240, 120), (220, 130, 255))  # BGR
_FAINT = 0.55


def size_text(thing: MeasuredObject) -> str:
    """``"302 x 198 x 251 mm"``; a question mark where a size is unknown."""
    return " x ".join("?" if np.isnan(size) else f"{size:.0f}" for size in thing.size_mm) + " mm"


def draw_objects(measured: Measurement, *, scan: bool = True) -> Array:
    """The rectified left picture with a wire box and the sizes (length x width x height) at each object.

    Parameters
    ----------
    measured : Measurement
    scan : bool
        Also the laser's readings, as points on the floor.

    Returns
    -------
    (H, W, 3) uint8
    """
    picture = cv2.cvtColor(measured.left, cv2.COLOR_GRAY2BGR) if measured.left.ndim == 2 else measured.left.copy()
    if measured.floor is None:
        return picture
    if scan and len(measured.scan_mm):
        ahead = measured.scan_mm[measured.scan_mm[:, 0] > 100]
        for u, v in _pixels(measured, ahead, 0.0):
            if -1e4 < u < 1e4 and -1e4 < v < 1e4:
                cv2.circle(picture, (round(u), round(v)), 2, (80, 80, 255), -1, cv2.LINE_AA)
    taken: list[int] = []
    for k, thing in enumerate(measured.objects):
        height = thing.size_mm[2]
        rings = [_pixels(measured, thing.outline_mm, z) for z in (0.0, 0.0 if np.isnan(height) else height)]
        inside = [((ring >= 0) & (ring < picture.shape[1::-1])).all(axis=1).any() for ring in rings]
        if not np.isfinite(rings).all() or np.abs(rings).max() > 1e4 or not any(inside):
            continue  # beside the picture
        color = _COLORS[k % len(_COLORS)]
        closed = thing.shape in ("box", "circle")
        layer = picture.copy()
        for ring in rings:
            cv2.polylines(layer, [np.rint(ring).astype(np.int32)], closed, color, 2, cv2.LINE_AA)
        for low, high in zip(*rings, strict=True):
            if thing.shape in ("box", "face"):
                cv2.line(
                    layer, tuple(np.rint(low).astype(int)), tuple(np.rint(high).astype(int)), color, 2, cv2.LINE_AA
                )
        picture = cv2.addWeighted(layer, 1 - _FAINT / 4, picture, _FAINT / 4, 0)
        _label(picture, size_text(thing), np.concatenate(rings), color, taken)
    return picture


def _pixels(measured: Measurement, points_mm: Array, z_mm: float) -> Array:
    assert measured.floor is not None
    return measured.floor.pixels(np.column_stack([points_mm, np.full(len(points_mm), z_mm)]))


def _label(picture: Array, text: str, corners: Array, color: tuple[int, int, int], taken: list[int]) -> None:
    """Text above an object, inside the picture and below what was written before."""
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.5, 1)
    x = int(np.clip(corners[:, 0].mean() - width / 2, 4, picture.shape[1] - width - 4))
    y = int(np.clip(corners[:, 1].min() - 8, height + 4, picture.shape[0] - 6))
    while any(abs(y - other) < height + 6 for other in taken):
        y += height + 6
    taken.append(y)
    cv2.rectangle(picture, (x - 3, y - height - 4), (x + width + 3, y + 5), (30, 30, 30), -1)
    cv2.putText(picture, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.5, color, 1, cv2.LINE_AA)
