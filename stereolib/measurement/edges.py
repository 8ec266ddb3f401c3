"""Straight edges of known direction to a fraction of a pixel: where neighbouring lines of a picture differ the most."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.base import Float32, Float64, Ints, direction
from stereolib.measurement.floor import Floor
from stereolib.measurement.plane_alignment import median
from stereolib.rig import RectifiedRig

#: Lines of neighbouring positions are so far apart in the picture, px.
STEP_PX = 0.25
_SPAN_PX = 1.5  # lines are compared at this distance from each other: the width of a webcam's edge
_GROUPS = 8  # of samples, each located by itself: their scatter is the edge's
_LEAST_SAMPLES = 8
_CLEAR = 1.5  # least contrast of an edge that is looked for far and wide
_FLOOR_PX = 0.12  # least standard deviation of an edge: its own blur and staircase
_LEAST_REACH_PX, _MOST_REACH_PX = 4.0, 30.0  # how far from its prior an upright edge is looked for
_GRAZING = 0.05  # cosine: a face that is seen flatter is not followed


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


@dataclass(frozen=True, eq=False)
class ParallelLines:
    """Parallel lines in space, one of which is an edge.

    Attributes
    ----------
    ends_mm : (pieces, lines, 2, 3) float64
        Both ends of each line, in the rectified left camera's frame; a line may consist of several pieces.
    positions : (lines,) float64
        Where each line stands, evenly spaced, in a unit of their own.
    step_px : float
        Distance of neighbouring lines in the picture.
    """

    ends_mm: Float64
    positions: Float64
    step_px: float


@dataclass(frozen=True)
class EdgePrior:
    """What is known of an edge beforehand, in the unit of its lines' positions.

    Attributes
    ----------
    position, std : float
        From the disparity or a scan.
    flat : float
        All positions up to so far from the prior one are equally likely.
    """

    position: float
    std: float
    flat: float = 0.0


def locate_edge(
    light: tuple[Float32, ...], rectified: RectifiedRig, lines: ParallelLines, prior: EdgePrior, *, samples: int = 96
) -> Edge | None:
    """Find the one of many parallel lines in space along which both pictures have an edge.

    Parameters
    ----------
    light : (left, right) or (left,), (H, W, 3) or (H, W) float32
        Rectified pictures as light (`stereolib.rig.to_light`).
    rectified : RectifiedRig
    lines : ParallelLines
    prior : EdgePrior
    samples : int
        Points of each line, shared out to its pieces by their lengths.

    Returns
    -------
    Edge or None
        None where fewer than 8 samples lie inside either picture.

    Notes
    -----
    ``E(k) = mean over samples and colours of |I(k + m) - I(k - m)|`` of the light I, 2 m steps being 1.5 px. The prior
    chooses the peak; a parabola refines it. On a texture neighbouring lines resemble each other, across an outline
    they do not. The deviation comes from eight groups of samples, each located by itself. Lines are straight in the
    pictures, and so is the disparity along them.
    """
    ends_mm, positions, step_px = lines.ends_mm, lines.positions, lines.step_px
    half = max(1, round(_SPAN_PX / 2 / step_px))
    height, width = light[0].shape[:2]
    depth = ends_mm[..., 2]
    u, v = (ends_mm[..., i] / depth * rectified.f_px + rectified.P1[i, 2] for i in (0, 1))
    shift = rectified.f_px * rectified.baseline_mm / depth
    length = np.hypot(*(a[:, len(positions) // 2] @ [-1.0, 1.0] for a in (u, v)))
    counts = np.maximum(np.rint(samples * length / max(length.sum(), 1.0)), 1).astype(int)
    points = _along(np.stack([u, u - shift, v]), counts)
    outer = points[:, [0, -1]]  # between the first and the last line lie all others
    limits = np.array([width - 2, width - 2, height - 2])[:, None, None]
    within = np.all((outer > 1) & (outer < limits), axis=1).reshape(3, -1)
    differences: list[Float32] = []
    for picture, x, in_width in zip(light, points, within, strict=False):
        y, inside = points[2], in_width & within[2]
        if (count := np.count_nonzero(inside)) < _LEAST_SAMPLES:
            continue
        if count < len(inside):
            x, y = x[:, inside], y[:, inside]
        values = cv2.remap(picture, x, y, cv2.INTER_LINEAR).reshape(len(x), -1)
        difference = cv2.absdiff(values[2 * half :], values[: -2 * half])
        differences.append(cv2.resize(difference, (_GROUPS, len(difference)), interpolation=cv2.INTER_AREA))
    if not differences:
        return None
    groups = np.mean(differences, axis=0)
    middle = positions[half:-half]
    belief = np.exp(-0.5 * (np.maximum(np.abs(middle - prior.position) - prior.flat, 0) / prior.std) ** 2)
    strength = groups.mean(axis=1)
    best = int((strength * belief).argmax())
    start = max(best - 3 * half, 0)
    best = start + int(strength[start : best + 3 * half + 1].argmax())  # the prior chooses the peak, it moves none
    first = max(best - 2 * half, 0)
    own = middle[first + groups[first : best + 2 * half + 1].argmax(axis=0)]
    step = float(positions[1] - positions[0])
    position = float(middle[best]) + step * _parabola(strength, best)
    scatter = 1.48 * median(np.abs(own - median(own))) / (_GROUPS / 1.57) ** 0.5
    std = float(np.hypot(scatter, _FLOOR_PX * step / step_px))
    return Edge(position, std, float(strength[best] / max(median(strength), 1e-9)))


def _along(ends: Float64, counts: Ints) -> Float32:
    """Values between both ends of each piece (K, pieces, lines, 2), as many as counted: (K, lines, samples) float32."""
    shares = [(np.arange(n, dtype=np.float32) + 0.5) / n for n in counts.tolist()]
    start, end = ends.astype(np.float32).transpose(3, 1, 0, 2)[..., None]
    return np.concatenate([a + (b - a) * share for a, b, share in zip(start, end, shares, strict=True)], axis=2)


def vertical_edge(
    light: tuple[Float32, ...],
    floor: Floor,
    place_mm: Float64,
    heights_mm: tuple[float, float],
    prior_px: tuple[float, float],
    normal: Float64 | None = None,
) -> Edge | None:
    """Find the bearing of an upright edge whose place is roughly known, from a laser for example.

    Parameters
    ----------
    light : (left, right) or (left,), (H, W, 3) or (H, W) float32
        Rectified pictures as light (`stereolib.rig.to_light`).
    floor : Floor
    place_mm : (2,) float64
        Where the edge stands: forward and left of the left camera, along the floor (`Floor.axes`).
    heights_mm : (low, high)
        The edge is looked for between these heights.
    prior_px : (standard deviation, flat)
        How well the place is known, across the line of sight, as pixels; and up to how far from it all is equally
        likely, as half of what a scan's beam spacing leaves open.
    normal : (2,) float64, optional
        Of the face that the edge ends: its line is searched; without it a circle around the camera.

    Returns
    -------
    Edge or None
        `position` and `std` are the angle from the forward axis, counter-clockwise, rad. None outside the picture or
        where no edge stands out clearly.
    """
    (std_px, flat_px), (forward, left) = prior_px, np.asarray(place_mm, float)
    start, distance = float(np.arctan2(left, forward)), float(np.hypot(forward, left))
    step = STEP_PX / floor.rectified.f_px * float(np.cos(start)) ** 2
    reach = min(max(3.0 * std_px, _LEAST_REACH_PX) + flat_px, _MOST_REACH_PX)
    half = round(reach / STEP_PX)
    angles = start + step * np.arange(-half, half + 1).astype(float)
    path = direction(angles)
    facing = distance if normal is None else normal @ [forward, left] / np.maximum(path @ normal, _GRAZING)
    path = path * np.reshape(facing, (-1, 1)) @ floor.axes[:2]
    up = (np.reshape(heights_mm, (2, 1)) - floor.camera_height_mm) * floor.axes[2]
    per_px = step / STEP_PX
    lines = ParallelLines((path[:, None] + up)[None], angles, STEP_PX)
    edge = locate_edge(light, floor.rectified, lines, EdgePrior(start, std_px * per_px, flat_px * per_px))
    return edge if edge is not None and edge.contrast >= _CLEAR else None


def _parabola(values: Float64, at: int) -> float:
    """Offset of the peak from its highest sample, -0.5..0.5."""
    if not 0 < at < len(values) - 1:
        return 0.0
    a, b, c = values[at - 1 : at + 2]
    bend = a - 2 * b + c
    return float(np.clip(0.5 * (a - c) / bend, -0.5, 0.5)) if bend < 0 else 0.0
