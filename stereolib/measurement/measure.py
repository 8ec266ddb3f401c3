"""From one pair and one scan to the objects in front of the rig: length, width and height with standard deviations."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import cv2
import numpy as np

from stereolib.calibration import LidarCamera
from stereolib.laser import Footprint, LaserScan, find_segments, fit_footprint, points_mm
from stereolib.matching import SGBMParams, compute_disparity
from stereolib.measurement.face_lines import LaserOnFloor
from stereolib.measurement.faces import Face, find_faces
from stereolib.measurement.floor import Floor, fit_floor, floor_from_pose
from stereolib.measurement.fusion import fuse
from stereolib.measurement.measured_object import MeasuredObject, from_faces, from_scan
from stereolib.measurement.object_height import Uncertainty, measure_height
from stereolib.measurement.plane_alignment import AlignedPair, CannotMeasure
from stereolib.measurement.regions import Region, find_objects
from stereolib.rig import RectifiedRig, pose_left_world, rigid, to_grey

Array = np.ndarray
#: The pictures are matched in half size: planes and edges are found in the full ones afterwards.
HALF = SGBMParams(num_disparities=96, mode="3way")
_BELOW = LaserOnFloor(np.eye(2), np.zeros(2), np.diag([10.0**2, 10.0**2, np.radians(1.0) ** 2]))
_FLOOR_ROWS = 0.25  # see `ground.Uncertainty`
_SAME_DISTANCE = 0.25  # scan and pair mean the same thing up to this relative difference


@dataclass(frozen=True, eq=False)
class Measurement:
    """What one pair and one scan tell.

    Attributes
    ----------
    objects : tuple of MeasuredObject
        Nearest first.
    warnings : tuple of str
        What did not fit together, or was not found.
    floor : Floor or None
        None if it was not seen: then all comes from the scan, in the frame of a floor below its plane.
    laser : LaserOnFloor
    scan_mm : (N, 2) float64
        All readings on the floor.
    left, right : (H, W, 3) uint8
        Rectified.
    disparity_px : (H, W) float32
        NaN where nothing was matched.
    """

    objects: tuple[MeasuredObject, ...]
    warnings: tuple[str, ...]
    floor: Floor | None
    laser: LaserOnFloor
    scan_mm: Array
    left: Array
    right: Array
    disparity_px: Array


def measure_objects(
    left: Array,
    right: Array,
    scan: LaserScan | None,
    rectified: RectifiedRig,
    lidar: LidarCamera | None,
    *,
    rng: np.random.Generator,
    floor: Floor | None = None,
    uncertainty: Uncertainty | None = None,
    params: SGBMParams = HALF,
    bias_mm: float = 1.0,
) -> Measurement:
    """Measure everything that stands on the floor in front of the rig.

    Parameters
    ----------
    left, right : (H, W, 3) uint8
        As the cameras gave them.
    scan : LaserScan, optional
        A turn, or better the average of some, taken at the same time; None: the pair alone.
    rectified : RectifiedRig
    lidar : LidarCamera, optional
        Where the laser stands to the left camera; None: straight below it, within 10 mm and one degree.
    rng : numpy.random.Generator
        Of the search for the floor.
    floor : Floor, optional
        Where it is known beforehand (`stereolib.floor.floor_from_pose`); else it is found in the pictures.
    uncertainty : Uncertainty, optional
        Of the calibration.
    params : SGBMParams
        Of the matching, in half size.
    bias_mm : float
        Error that all readings of the laser on one face share.

    Raises
    ------
    CannotMeasure
        "no floor", if there is no scan either. What concerns one object or one size is said in its ``reasons``.
    ValueError
        If pictures and calibration do not fit together.
    """
    uncertainty, warnings = _for_half_size(uncertainty or Uncertainty()), []
    left, right = rectified.rectify(left, right)
    disparity = half_size_disparity(left, right, params)
    pair = AlignedPair.of(left, right)
    regions: list[Region] = []
    seen, blind = floor, ""
    try:
        seen = floor or fit_floor(disparity, rectified, rng=rng, pair=pair)
        regions = find_objects(disparity, seen)
    except CannotMeasure as error:
        if scan is None:
            raise
        blind = str(error)
        warnings.append(f"{blind}. What follows is the scan's alone")
    ground = seen or _below(rectified, lidar)
    if scan is not None and lidar is None:
        warnings.append("the laser's pose is not known: it is taken to stand straight below the left camera")
    laser = _BELOW if lidar is None else LaserOnFloor.of(lidar, ground)
    prints: list[Footprint] = []
    if scan is not None:
        prints = [fit_footprint(part, bias_mm=bias_mm) for part in find_segments(scan) if part.kind == "object"]
        if not prints:
            warnings.append("the scan shows no object within 3 m: sizes come from the pair alone")
    together, apart = _same_things(regions, prints, ground, laser)
    found = []
    for region, footprint in together:
        thing, warning = _measure_one(
            (left, right), ground, pair, region, footprint, laser, uncertainty, bias_mm, blind, bool(prints)
        )
        found.append(thing)
        apart += warning
    if not found:
        apart.append("nothing stands on the floor within 1.8 m of the cameras or 3 m of the laser")
    found.sort(key=lambda thing: float(np.hypot(*thing.position_mm)))
    readings = np.zeros((0, 2)) if scan is None else laser.points_mm(points_mm(scan))
    return Measurement(tuple(found), tuple(warnings + apart), seen, laser, readings, left, right, disparity)


def _for_half_size(given: Uncertainty) -> Uncertainty:
    """Planes that begin in a map of half size end a little farther off."""
    return replace(given, floor_rows=max(given.floor_rows, _FLOOR_ROWS))


def _below(rectified: RectifiedRig, lidar: LidarCamera | None) -> Floor:
    """A floor nobody saw: parallel to the laser's plane, and below it and the camera."""
    if lidar is None:
        return floor_from_pose(rectified, rigid(rectified.R1.T, np.zeros(3)) @ pose_left_world(0.0, 100.0))
    up = lidar.T_left_lidar[:3, 2]
    camera_mm = -float(up @ lidar.T_left_lidar[:3, 3])  # above the laser's plane
    return floor_from_pose(rectified, lidar.T_left_lidar @ rigid(np.eye(3), [0.0, 0.0, min(camera_mm, 0.0) - 100.0]))


def half_size_disparity(left: Array, right: Array, params: SGBMParams = HALF) -> Array:
    """Disparity matched in pictures of half size, in pixels of the full ones: (H, W) float32, NaN invalid."""
    small = [cv2.resize(to_grey(i), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for i in (left, right)]
    found = 2 * compute_disparity(small[0], small[1], params, whole=True)
    return cv2.resize(found, left.shape[1::-1], interpolation=cv2.INTER_NEAREST)


def _same_things(
    regions: list[Region], prints: list[Footprint], floor: Floor, laser: LaserOnFloor
) -> tuple[list[tuple[Region | None, Footprint | None]], list[str]]:
    """Pair what the picture shows with what the scan shows, by bearing and distance; the rest stays alone."""
    rectified = floor.rectified
    spans, distances = [], []
    for region in regions:
        edges = (rectified.P1[0, 2] - np.array([region.bounds[2], region.bounds[0]])) / rectified.f_px
        spans.append(np.arctan(edges))
        distances.append(float(np.hypot(*region.position_mm)))
    seen = [laser.points_mm(footprint.segment.points_mm) for footprint in prints]
    bearings = [np.arctan2(p[:, 1], p[:, 0]) for p in seen]
    near, far = ([float(pick(np.linalg.norm(p, axis=1))) for p in seen] for pick in (np.min, np.max))

    def overlap(i: int, j: int) -> float:
        low, high = max(spans[i][0], bearings[j].min()), min(spans[i][1], bearings[j].max())
        return float(high - low) / float(min(np.ptp(spans[i]), max(np.ptp(bearings[j]), 0.02)))

    candidates = [
        (abs(distances[i] - near[j]) / near[j], i, j)
        for i in range(len(regions))
        for j in range(len(prints))
        if overlap(i, j) > 0.3
    ]
    pairs: list[tuple[Region | None, Footprint | None]] = []
    warnings: list[str] = []
    free_regions, free_prints = set(range(len(regions))), set(range(len(prints)))
    for off, i, j in sorted(candidates):
        if i not in free_regions or j not in free_prints:
            continue
        if off > _SAME_DISTANCE:
            warnings.append(
                f"in one direction the scan shows something at {near[j]:.0f} mm and the pair at {distances[i]:.0f} mm: "
                f"were they taken at the same time? They are not combined"
            )
            continue
        free_regions.remove(i)
        free_prints.remove(j)
        pairs.append((regions[i], prints[j]))
    for i in sorted(free_regions):  # a piece of what the scan shows whole
        whole = [j for j in range(len(prints)) if j not in free_prints and overlap(i, j) > 0.5]
        if any((1 - _SAME_DISTANCE) * near[j] < distances[i] < (1 + _SAME_DISTANCE) * far[j] for j in whole):
            free_regions.remove(i)
    pairs += [(regions[i], None) for i in sorted(free_regions)] + [(None, prints[j]) for j in sorted(free_prints)]
    return pairs, warnings


def _measure_one(
    images: tuple[Array, Array], floor: Floor, pair: AlignedPair, region: Region | None, footprint: Footprint | None,
    laser: LaserOnFloor, uncertainty: Uncertainty, bias_mm: float, blind: str, scanned: bool,
) -> tuple[MeasuredObject, list[str]]:  # fmt: skip
    reasons: dict[str, str] = {}
    faces: tuple[Face, ...] = ()
    height, top = (np.nan, np.nan), np.nan
    if region is None:
        reasons["height"] = blind or _unseen(footprint, floor, laser)
    else:
        try:
            seen = measure_height(*images, floor, region, pair=pair, uncertainty=uncertainty)
            faces, height, top = seen.faces, (seen.height_mm, seen.height_std_mm), seen.height_mm
        except CannotMeasure as error:
            reasons["height"] = str(error)
            if error.reason in ("cut by the frame", "no top edge"):  # else what was matched is chance
                with suppress(CannotMeasure):
                    faces, top = find_faces(floor, region, pair), region.top_mm
    if footprint is None and scanned:
        reasons["object"] = "it is not in the scan (lower than its plane, or dark): its sizes come from the pair alone"
    round_or_odd = (
        footprint is not None and footprint.shape in ("circle", "irregular") and len(footprint.segment.points_mm) > 6
    )
    fused = None
    if not round_or_odd:
        fused = fuse(
            pair.light, floor, footprint=footprint, laser=laser, faces=faces, top_mm=top, uncertainty=uncertainty,
            bias_mm=bias_mm,
        )  # fmt: skip
    if fused is None:
        return from_scan(footprint, region, laser, height, reasons), []
    scale = (uncertainty.baseline_mm / floor.rectified.baseline_mm, uncertainty.f_px / floor.rectified.f_px)
    thing = from_faces(fused, height, reasons, float(np.hypot(*scale)))
    return thing, [fused.disagreement] if fused.disagreement else []


def _unseen(footprint: Footprint | None, floor: Floor, laser: LaserOnFloor) -> str:
    """Why the picture says nothing of something in the scan."""
    assert footprint is not None
    p = laser.points_mm(footprint.segment.points_mm)
    rectified = floor.rectified
    u = rectified.P1[0, 2] - rectified.f_px * p[:, 1] / np.maximum(p[:, 0], 1.0)
    if ((p[:, 0] > 0) & (u > 0) & (u < rectified.size[0])).sum() < 2:
        return "outside the picture: turn the rig towards it"
    shift = rectified.f_px * rectified.baseline_mm / np.maximum(p[:, 0], 1.0)
    if ((p[:, 0] > 0) & (u - shift > 0) & (u < rectified.size[0])).mean() < 0.5:
        return "only one camera sees it whole: turn the rig towards it"
    if np.linalg.norm(p, axis=1).min() > 1800.0:
        return "too far for the pair: go nearer than 1.8 m"
    return "no texture: the pair matched nothing there; light or texture it"
