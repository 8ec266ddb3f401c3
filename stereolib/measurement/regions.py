"""What stands on the floor, in a disparity map: told from the floor, from the background, and from each other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from stereolib.base import Bools, Float32, Float64, Floats, Ints
from stereolib.measurement.disparity_map import check_disparity_map
from stereolib.measurement.floor import Floor

#: Every third pixel of every third row: faces are planes, and edges are looked for in the pictures.
STEP = 3
#: What is farther is background, mm: disparities of the rig's 93 mm baseline tell little beyond.
OBJECTS_WITHIN_MM = 1800.0
#: What has fewer pixels is no object.
LEAST_PX = 600
_LEAST_HEIGHT_MM = 20.0  # what is lower belongs to the floor
_LEAST_RISE_PX = 1.0  # what rises less above the floor's disparity belongs to the floor: SGBM's own error
_LEAST_AHEAD = 0.2  # of a ray's depth: steeper ones meet the floor at the rig's feet
_JUMP_PX, _JUMP = 1.5, 0.02  # neighbours whose disparities differ by more, px and share, are different objects
_PART, _COLUMNS = 24, 6  # pixels, of every third one, of a part of a thing, and columns in which it stands over another
_AS_FAR, _SEEN_THROUGH = 0.03, 0.5  # share by which their distances differ, and of what is matched in between, at most
_VALLEY, _VALLEY_PX = 0.05, 120  # share by which two parts rise above what is between, of so many of those pixels each
_LOWER = 2 / 3  # of a column's pixels: those above may be of a top, which is farther
_SMOOTH = 5  # columns
_CORE = 11  # of five by five pixels, every third one: fewer are an edge, or a streak of wrong matches
_NEAREST = 50  # one in so many pixels is nearer than what is told as the place: wrong matches
_TOP = 0.97  # share of the pixels below the rough top, for the same reason


@dataclass(frozen=True, eq=False)
class ObjectRegion:
    """Pixels of one object that stands on the floor: every third of every third row.

    Attributes
    ----------
    u, v, disparity_px, height_mm : (N,) float64
        Pixels of the rectified left image, what was matched there, and the height above the floor that it means.
    position_mm : (x, y)
        Of its nearest part, on the floor: forward and left of the camera.
    bounds : (left, top, right, bottom)
        px, both ends included.
    """

    u: Float64
    v: Float64
    disparity_px: Float64
    height_mm: Floats
    position_mm: tuple[float, float]
    bounds: tuple[int, int, int, int]

    @cached_property
    def top_mm(self) -> float:
        """Height below which 97 of 100 of its pixels lie: its top, roughly."""
        at = int(_TOP * len(self.height_mm))
        return float(np.partition(self.height_mm, at)[at])


def find_objects(disparity_px: Floats, floor: Floor) -> list[ObjectRegion]:
    """Separate what stands on the floor, from the floor, from the background and from each other.

    Parameters
    ----------
    disparity_px : (H, W) float, px
        Of the rectified left image, NaN where invalid.
    floor : Floor

    Returns
    -------
    list of ObjectRegion
        Nearest first.

    Raises
    ------
    ValueError
        If the map does not fit the floor's rig.

    Notes
    -----
    What is lower than 20 mm belongs to the floor, what is farther than `OBJECTS_WITHIN_MM` is background, and what has
    fewer pixels than `LEAST_PX` is no object. Neighbours belong together where their disparities differ by less than
    1.5 px and 2 %. What two rows of pixels join, every third one, of objects side by side, is cut apart. So is what
    joins two parts that are both nearer by 5 %: one box bulges, wherever it is seen from, and between two there is a
    valley. Of one upright thing are also parts one above the other, as far away to 3 %, between which most pixels were
    not matched: a plain face is torn.

    Examples
    --------
    A wall of a box 700 mm ahead, over the floor of a level camera:

    >>> from stereolib.measurement import floor_from_pose
    >>> from stereolib.paper import paper_rig, rig_pose
    >>> rig = paper_rig().rectify()
    >>> floor = floor_from_pose(rig, rig_pose(rig, pitch_rad=0.0, camera_height_mm=200.0))
    >>> disparity = np.array(floor.disparity(*np.meshgrid(np.arange(640.0), np.arange(480.0))))
    >>> disparity[180:400, 250:400] = rig.f_px * rig.baseline_mm / 700
    >>> [region] = find_objects(disparity, floor)
    >>> round(region.position_mm[0]), region.bounds
    (700, (252, 180, 396, 396))
    """
    rectified = floor.rectified
    disparity = check_disparity_map(disparity_px, rectified)[::STEP, ::STEP].astype(np.float32)
    rows, columns = disparity.shape
    u, v = np.arange(columns, dtype=np.float32) * STEP, np.arange(rows, dtype=np.float32)[:, None] * STEP
    ground, ahead = (a * u + (b * v + c) for a, b, c in (floor.plane.tolist(), floor.along[0].tolist()))
    least_disparity = rectified.f_px * rectified.baseline_mm / OBJECTS_WITHIN_MM
    lift = _LEAST_HEIGHT_MM / floor.camera_height_mm
    mask = (ahead > _LEAST_AHEAD) & (disparity > least_disparity * ahead)
    mask &= disparity - ground > np.maximum(lift * disparity, _LEAST_RISE_PX)
    filled = np.where(mask, disparity, 0)
    below, beside = (filled[:-1], filled[1:], mask[:-1]), (filled[:, :-1], filled[:, 1:], mask[:, :-1])
    for first, second, kept in (below, beside):
        kept &= np.abs(second - first) <= _JUMP_PX + _JUMP * first
    mask = _without_streaks(mask)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=4)
    nearness = filled / ahead
    labels, stats = _joined(labels, stats, np.isfinite(disparity), nearness)
    labels, stats = _cut_in_valleys(labels, stats, nearness)
    regions = []
    for k in 1 + np.flatnonzero(stats[1:, cv2.CC_STAT_AREA] * STEP**2 >= LEAST_PX):
        x, y, w, h, _ = stats[k]
        part = labels[y : y + h, x : x + w] == k
        row, column = np.nonzero(part)
        d = filled[y : y + h, x : x + w][part].astype(float)
        pu, pv = float(STEP) * (column + x), float(STEP) * (row + y)
        ray = floor.rays(pu, pv)
        nearness = d / ray[0]
        near = -(-len(d) // _NEAREST)
        at = int(np.argmax(nearness == np.partition(nearness, -near)[-near]))  # the first of equal ones
        x_mm, y_mm = rectified.f_px * rectified.baseline_mm / d[at] * ray[:, at]
        bounds = (int(STEP * x), int(STEP * y), int(STEP * (x + w - 1)), int(STEP * (y + h - 1)))
        regions.append(ObjectRegion(pu, pv, d, floor.height_mm(pu, pv, d), (float(x_mm), float(y_mm)), bounds))
    return sorted(regions, key=lambda region: region.position_mm[0])


def _without_streaks(mask: Bools) -> Bools:
    """Cut, half-way, what joins two parts side by side, each large enough for an object, by a few rows of pixels."""
    core = mask & (cv2.boxFilter(mask.view(np.uint8), -1, (5, 5), normalize=False) >= _CORE)
    _, cores, stats, _ = cv2.connectedComponentsWithStats(core.view(np.uint8), connectivity=4)
    large = 1 + np.flatnonzero(stats[1:, cv2.CC_STAT_AREA] * STEP**2 >= LEAST_PX)
    _, whole = cv2.connectedComponents(mask.view(np.uint8), connectivity=4)
    ends, cut = dict[int, int](), mask.copy()
    for k in large[np.argsort(stats[large, cv2.CC_STAT_LEFT])]:
        left, top, width, height, _ = stats[k]
        part = int(whole[top : top + height, left][cores[top : top + height, left] == k][0])
        end = ends.get(part, left)
        if end < left:
            middle = (end + left) // 2
            cut[:, middle] &= whole[:, middle] != part
        ends[part] = max(end, left + width)
    return cut


def _joined(labels: Ints, stats: Ints, matched: Bools, nearness: Float32) -> tuple[Ints, Ints]:
    """Number alike what stands above each other as far away, where most in between was not matched; the numbers' stats.

    What was joined to another keeps its row of stats, without pixels.
    """
    is_part = stats[:, cv2.CC_STAT_AREA] >= _PART
    is_part[0] = False
    if is_part.sum() < 2:
        return labels, stats
    part, row = is_part[labels], np.arange(len(labels))[:, None]
    above = np.maximum.accumulate(np.where(part, row, -1), axis=0)
    v, u = np.nonzero(part[1:] & (above[:-1] >= 0) & ~part[:-1])
    last, v = above[v, u], v + 1
    between = np.cumsum(matched & ~part, axis=0)
    as_far = np.abs(nearness[v, u] - nearness[last, u]) < _AS_FAR * nearness[v, u]
    torn = as_far & (between[v, u] - between[last, u] < _SEEN_THROUGH * (v - last))
    pairs, columns = np.unique(np.sort([labels[v, u][torn], labels[last, u][torn]], axis=0), axis=1, return_counts=True)
    numbers, stats = np.arange(len(stats)), stats.copy()
    for first, second in pairs[:, columns >= _COLUMNS].T:
        a, b = numbers[first], numbers[second]
        if a != b:
            numbers[numbers == b] = a
            corner = np.minimum(stats[a, :2], stats[b, :2])
            stats[a, 2:4] = np.maximum(stats[a, :2] + stats[a, 2:4], stats[b, :2] + stats[b, 2:4]) - corner
            stats[a, :2] = corner
            stats[a, cv2.CC_STAT_AREA] += stats[b, cv2.CC_STAT_AREA]
            stats[b, cv2.CC_STAT_AREA] = 0
    return numbers[labels], stats


def _cut_in_valleys(labels: Ints, stats: Ints, nearness: Float32) -> tuple[Ints, Ints]:
    """Number two things side by side apart, each part as often as it holds another valley; the numbers' stats."""
    labels, found, k = labels.copy(), list(stats), 0
    while (k := k + 1) < len(found):
        x, y, w, h, pixels = (int(n) for n in found[k])
        if pixels < 2 * _VALLEY_PX:
            continue
        part = labels[y : y + h, x : x + w] == k
        at = _valley(part, nearness[y : y + h, x : x + w])
        if at:
            labels[y : y + h, x + at : x + w][part[:, at:]] = len(found)
            found.append(_stats(part[:, at:], x + at, y))
            found[k] = _stats(part[:, :at], x, y)
            k -= 1
    return labels, np.array(found)


def _valley(part: Bools, nearness: Float32) -> int:
    """Column of the deepest valley between two parts that are large enough; 0 where there is none."""
    count = part.sum(axis=0)
    lower = part & (np.cumsum(part[::-1], axis=0)[::-1] <= np.ceil(_LOWER * count))
    mean = np.where(lower, nearness, 0).sum(axis=0) / np.maximum(lower.sum(axis=0), 1)
    near = np.median(sliding_window_view(np.pad(mean, _SMOOTH // 2, "edge"), _SMOOTH), axis=1)
    rises = np.where(near * (1 - _VALLEY) > near[:, None], count, 0)  # [column, what rises above it]
    between = np.minimum(np.tril(rises).sum(axis=1), np.triu(rises).sum(axis=1)) >= _VALLEY_PX
    return int(np.argmin(np.where(between, near, np.inf))) if between.any() else 0


def _stats(part: Bools, x: int, y: int) -> Ints:
    """Stats of a part whose corner is at column x, row y, as OpenCV tells them."""
    rows, columns = np.flatnonzero(part.any(axis=1)), np.flatnonzero(part.any(axis=0))
    left, top = columns[0], rows[0]
    return np.array([x + left, y + top, 1 + columns[-1] - left, 1 + rows[-1] - top, part.sum()], np.int32)
