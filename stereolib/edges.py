"""Straight edges of known direction to a fraction of a pixel: where neighbouring lines of a picture differ the most."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.floor import Floor
from stereolib.rig import RectifiedRig

Array = np.ndarray
#: Lines are compared at this distance from each other, px: the width of a webcam's edge.
_SPAN_PX = 1.5
#: Cameras send light to this power; a blurred edge between light and dark stands right in light, not in grey levels.
_GAMMA = 2.2
_CLEAR = 1.5  # least contrast of an edge that is looked for far and wide
#: Least standard deviation of an edge: its own blur and staircase, px.
_FLOOR_PX = 0.12


@dataclass(frozen=True)
class Edge:
    """Where an edge was found among parallel lines.

    Attributes
    ----------
    position : float
        In the lines' own unit.
    std : float
        Its standard deviation, in the same unit.
    contrast : float
        How much the edge stands out: its difference over the median one.
    """

    position: float
    std: float
    contrast: float


def locate_edge(
    images: tuple[Array, ...], rectified: RectifiedRig, points_mm: Array, positions: Array,
    prior: tuple[float, float], step_px: float,
) -> Edge | None:  # fmt: skip
    """Find the one of many parallel lines in space along which both pictures have an edge.

    Parameters
    ----------
    images : (left, right) or (left,), (H, W, 3) or (H, W) uint8
        Rectified.
    rectified : RectifiedRig
    points_mm : (lines, samples, 3) array
        Points of each line, in the rectified left camera's frame.
    positions : (lines,) array
        Where each line stands, evenly spaced.
    prior : (position, standard deviation)
        What is known beforehand, from the disparity.
    step_px : float
        Distance of neighbouring lines in the picture.

    Returns
    -------
    Edge, or None where fewer than 8 samples lie inside either picture.

    Notes
    -----
    ``E(k) = mean over samples and colours of |I(k + m) - I(k - m)|`` of the light I, 2 m steps being 1.5 px. The prior
    chooses the peak; a parabola refines it. On a texture neighbouring lines resemble each other, across an outline
    they do not. The deviation comes from eight groups of samples, each located by itself.
    """
    lines = len(points_mm)
    half = max(1, round(_SPAN_PX / 2 / step_px))
    height, width = images[0].shape[:2]
    depth = points_mm[..., 2]
    u, v = (points_mm[..., i] / depth * rectified.f_px + rectified.P1[i, 2] for i in (0, 1))
    seen = []
    shifts = (0.0, rectified.f_px * rectified.baseline_mm / depth)
    for image, shift in zip(images, shifts, strict=False):
        x = u - shift
        inside = ((x > 1) & (x < width - 2) & (v > 1) & (v < height - 2)).all(axis=0)
        if inside.sum() < 8:
            continue
        x, y = np.ascontiguousarray(x[:, inside], np.float32), np.ascontiguousarray(v[:, inside], np.float32)
        values = cv2.remap(image, x, y, cv2.INTER_LINEAR).astype(np.float32).reshape(lines, x.shape[1], -1)
        values = cv2.pow(values / 255, _GAMMA).reshape(values.shape)
        seen.append(np.abs(values[2 * half :] - values[: -2 * half]).sum(axis=2))
    if not seen:
        return None
    difference = np.concatenate(seen, axis=1)
    middle = positions[half:-half]
    belief = np.exp(-0.5 * ((middle - prior[0]) / prior[1]) ** 2)
    strength = difference.mean(axis=1)
    best = int((strength * belief).argmax())
    start = max(best - 3 * half, 0)
    best = start + int(
        strength[start : best + 3 * half + 1].argmax()
    )  # the prior chooses the peak, it does not move it
    groups = [g.mean(axis=1) for g in np.array_split(difference, 8, axis=1)]
    window = slice(max(best - 2 * half, 0), best + 2 * half + 1)
    own = np.array([middle[window][g[window].argmax()] for g in groups])
    step = float(positions[1] - positions[0])
    found = float(middle[best]) + step * _parabola(strength, best)
    scatter = 1.48 * float(np.median(np.abs(own - np.median(own)))) / np.sqrt(len(groups) / 1.57)
    std = float(np.hypot(scatter, _FLOOR_PX * step / step_px))
    return Edge(found, std, float(strength[best] / max(np.median(strength), 1e-9)))


def vertical_edge(
    images: tuple[Array, ...],
    floor: Floor,
    place_mm: Array,
    heights_mm: tuple[float, float],
    *,
    prior_std_px: float,
    normal: Array | None = None,
) -> Edge | None:
    """Bearing of an upright edge whose place is roughly known, from a laser for example.

    Parameters
    ----------
    images : (left, right) or (left,), (H, W, 3) or (H, W) uint8
        Rectified.
    floor : Floor
    place_mm : (2,) array
        Where the edge stands: forward and left of the left camera, along the floor (`Floor.axes`).
    heights_mm : (low, high)
        The edge is looked for between these heights.
    prior_std_px : float
        How well the place is known, across the line of sight, as pixels: what a scan's beam spacing leaves open.
    normal : (2,) array, optional
        Of the face that the edge ends: its line is searched; without it a circle around the camera.

    Returns
    -------
    Edge, or None outside the picture or where no edge stands out clearly
        `position` and `std` are the angle from the forward axis, counter-clockwise, rad.
    """
    f, step_px = floor.rectified.f_px, 0.25
    forward, left = np.asarray(place_mm, float)
    start, distance = float(np.arctan2(left, forward)), float(np.hypot(forward, left))
    step = step_px / f * float(np.cos(start)) ** 2
    reach = min(max(3.0 * prior_std_px, 4.0), 30.0)
    angles = start + step * np.arange(-round(reach / step_px), round(reach / step_px) + 1)
    up = np.linspace(*heights_mm, 120) - floor.camera_height_mm
    path = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    facing = distance if normal is None else normal @ [forward, left] / np.maximum(path @ normal, 0.05)
    path = path * np.reshape(facing, (-1, 1))
    ground = np.broadcast_to(path[:, None], (len(angles), len(up), 2))
    lines = np.concatenate([ground, np.broadcast_to(up[:, None], (len(angles), len(up), 1))], axis=2) @ floor.axes
    edge = locate_edge(images, floor.rectified, lines, angles, (start, prior_std_px / step_px * step), step_px)
    return edge if edge is not None and edge.contrast >= _CLEAR else None


def _parabola(values: Array, at: int) -> float:
    """Offset of the peak from its highest sample, -0.5..0.5."""
    if not 0 < at < len(values) - 1:
        return 0.0
    a, b, c = values[at - 1 : at + 2]
    bend = a - 2 * b + c
    return float(np.clip(0.5 * (a - c) / bend, -0.5, 0.5)) if bend < 0 else 0.0
