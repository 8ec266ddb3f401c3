"""From one pair and one scan to the objects in front of the rig: length, width and height with standard deviations."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import cv2
import numpy as np

from stereolib.base import Float32, Float64, UInt8
from stereolib.laser import Footprint, LaserScan, find_segments, fit_footprint, points_mm
from stereolib.matching import SGBMParams, compute_disparity
from stereolib.measurement.face_lines import LaserOnFloor
from stereolib.measurement.faces import find_faces
from stereolib.measurement.floor import Floor, fit_floor, floor_from_pose
from stereolib.measurement.fusion import Evidence, fuse
from stereolib.measurement.instrument import Instrument
from stereolib.measurement.measured_object import MeasuredObject, from_faces, from_region, from_scan
from stereolib.measurement.object_height import SystematicUncertainty, measure_height
from stereolib.measurement.plane_alignment import AlignedPair, CannotMeasure
from stereolib.measurement.regions import OBJECTS_WITHIN_MM, ObjectRegion, find_objects
from stereolib.rig import pose_left_world, rigid, to_grey

#: The pictures are matched in half size: planes and edges are found in the full ones afterwards.
_HALF = SGBMParams(num_disparities=96, mode="3way")
_HALF_FLOOR_ROWS = 0.25  # `SystematicUncertainty.floor_rows`: planes that begin in such a map end farther off
#: A laser that nobody calibrated: straight below the camera within 10 mm and one degree.
_BELOW = LaserOnFloor(np.eye(2), np.zeros(2), np.diag([10.0**2, 10.0**2, np.radians(1.0) ** 2]))
_LASER_ABOVE_FLOOR_MM = 100.0  # where no floor is seen; the scan's sizes do not depend on it
_SCAN_REACH_M = 3  # of `stereolib.laser.find_segments`
_SAME_DISTANCE = 0.25  # scan and pair show the same object up to this relative difference
_OVERLAP = 0.3  # share of the narrower one's bearings that they then have in common
_WITHIN = 0.5  # share of a region's bearings that lie within a footprint, of which it is then a piece
_LEAST_SPAN_RAD = 0.02  # a footprint counts as so wide at least
_FEW_BEAMS = 6  # so few tell no round or irregular outline from faces
_SHOWN = 0.5  # share of a footprint that the right camera must show


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
    scan_mm: Float64
    left: UInt8
    right: UInt8
    disparity_px: Float32


def measure_objects(
    left: UInt8,
    right: UInt8,
    scan: LaserScan | None,
    instrument: Instrument,
    *,
    rng: np.random.Generator,
    floor: Floor | None = None,
) -> Measurement:
    """Measure everything that stands on the floor in front of the rig.

    Parameters
    ----------
    left, right : (H, W, 3) uint8
        As the cameras gave them.
    scan : LaserScan or None
        A turn, or better the average of some, taken at the same time; None: the pair alone.
    instrument : Instrument
        The calibrated rig, with its laser if it has one.
    rng : numpy.random.Generator
        Of the search for the floor.
    floor : Floor, optional
        Where it is known beforehand (`floor_from_pose`); else it is found in the pictures.

    Returns
    -------
    Measurement

    Raises
    ------
    CannotMeasure
        "no floor", if there is no scan either. What concerns one object or one size is said in its ``reasons``.
    ValueError
        If pictures and calibration do not fit together.
    """
    rectified, lidar, warnings = instrument.rectified, instrument.lidar, list[str]()
    rows = max(instrument.uncertainty.floor_rows, _HALF_FLOOR_ROWS)
    left, right = rectified.rectify(left, right)
    disparity = _half_size_disparity(left, right)
    pair = AlignedPair.of(left, right)
    regions, no_floor = list[ObjectRegion](), ""
    try:
        floor = floor or fit_floor(disparity, rectified, rng=rng, pair=pair)
        regions = find_objects(disparity, floor)
    except CannotMeasure as error:
        if scan is None:
            raise
        no_floor = str(error)
        warnings.append(f"{no_floor}. What follows is the scan's alone")
    ground = floor or _floor_below(instrument)
    if scan is not None and lidar is None:
        warnings.append("the laser's pose is not known: it is taken to stand straight below the left camera")
    laser = _BELOW if lidar is None else LaserOnFloor.of(lidar, ground)
    parts = [] if scan is None else find_segments(scan)
    footprints = [fit_footprint(part, bias_mm=laser.bias_mm) for part in parts if part.kind == "object"]
    if scan is not None and not footprints:
        warnings.append(f"the scan shows no object within {_SCAN_REACH_M} m: sizes come from the pair alone")
    scene = _Scene(ground, pair, laser, replace(instrument.uncertainty, floor_rows=rows), bool(footprints), no_floor)
    together, unlike = _paired(regions, footprints, ground, laser)
    warnings, objects = warnings + unlike, list[MeasuredObject]()
    for region, footprint in together:
        measured, disagreement = _measure_one(scene, region, footprint)
        objects.append(measured)
        warnings += [disagreement] if disagreement else []
    if not objects:
        reach = f"{OBJECTS_WITHIN_MM / 1000:g} m of the cameras or {_SCAN_REACH_M} m of the laser"
        warnings.append(f"nothing stands on the floor within {reach}")
    objects.sort(key=lambda measured: float(np.hypot(*measured.position_mm)))
    readings = np.zeros((0, 2)) if scan is None else laser.points_mm(points_mm(scan))
    return Measurement(tuple(objects), tuple(warnings), floor, laser, readings, left, right, disparity)


@dataclass(frozen=True, eq=False)
class _Scene:
    """What all objects of one pair and one scan share; `no_floor` says why the pair has none, if so."""

    floor: Floor
    pair: AlignedPair
    laser: LaserOnFloor
    uncertainty: SystematicUncertainty
    scanned: bool
    no_floor: str


def _floor_below(instrument: Instrument) -> Floor:
    """A floor nobody saw: parallel to the laser's plane, and below it and the camera."""
    rectified, lidar, above = instrument.rectified, instrument.lidar, _LASER_ABOVE_FLOOR_MM
    if lidar is None:
        return floor_from_pose(rectified, rigid(rectified.R1.T, np.zeros(3)) @ pose_left_world(0.0, above))
    up = lidar.T_left_lidar[:3, 2]
    camera_mm = -float(up @ lidar.T_left_lidar[:3, 3])  # above the laser's plane
    return floor_from_pose(rectified, lidar.T_left_lidar @ rigid(np.eye(3), [0.0, 0.0, min(camera_mm, 0.0) - above]))


def _half_size_disparity(left: UInt8, right: UInt8) -> Float32:
    """Disparity matched in pictures of half size, in pixels of the full ones: (H, W) float32, NaN invalid."""
    small = [cv2.resize(to_grey(i), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for i in (left, right)]
    half = 2 * compute_disparity(small[0], small[1], _HALF, whole=True)
    return np.asarray(cv2.resize(half, left.shape[1::-1], interpolation=cv2.INTER_NEAREST))


def _paired(
    regions: list[ObjectRegion], footprints: list[Footprint], floor: Floor, laser: LaserOnFloor
) -> tuple[list[tuple[ObjectRegion | None, Footprint | None]], list[str]]:
    """Pair what the picture shows with what the scan shows, by bearing and distance; the rest stays alone."""
    rectified = floor.rectified
    edges = [np.array([region.bounds[2], region.bounds[0]]) for region in regions]
    spans = [np.arctan((rectified.P1[0, 2] - columns) / rectified.f_px) for columns in edges]
    distances = [float(np.hypot(*region.position_mm)) for region in regions]
    readings = [laser.points_mm(footprint.segment.points_mm) for footprint in footprints]
    bearings = [np.arctan2(p[:, 1], p[:, 0]) for p in readings]
    near, far = ([float(pick(np.linalg.norm(p, axis=1))) for p in readings] for pick in (np.min, np.max))

    def overlap(i: int, j: int) -> float:
        low, high = max(spans[i][0], bearings[j].min()), min(spans[i][1], bearings[j].max())
        return float(high - low) / float(min(np.ptp(spans[i]), max(np.ptp(bearings[j]), _LEAST_SPAN_RAD)))

    both = [(i, j) for i in range(len(regions)) for j in range(len(footprints)) if overlap(i, j) > _OVERLAP]
    candidates = [(abs(distances[i] - near[j]) / near[j], i, j) for i, j in both]
    pairs, warnings = list[tuple[ObjectRegion | None, Footprint | None]](), list[str]()
    free_regions, free_footprints = set(range(len(regions))), set(range(len(footprints)))
    for off, i, j in sorted(candidates):
        if i not in free_regions or j not in free_footprints:
            continue
        if off > _SAME_DISTANCE:
            why = f"the scan shows something at {near[j]:.0f} mm and the pair at {distances[i]:.0f} mm"
            warnings.append(f"in one direction {why}: were they taken at the same time? They are not combined")
            continue
        free_regions.remove(i)
        free_footprints.remove(j)
        pairs.append((regions[i], footprints[j]))
    for i in sorted(free_regions):  # a piece of what the scan shows whole
        whole = [j for j in range(len(footprints)) if j not in free_footprints and overlap(i, j) > _WITHIN]
        if any((1 - _SAME_DISTANCE) * near[j] < distances[i] < (1 + _SAME_DISTANCE) * far[j] for j in whole):
            free_regions.remove(i)
    pairs += [(regions[i], None) for i in sorted(free_regions)]
    return pairs + [(None, footprints[j]) for j in sorted(free_footprints)], warnings


def _measure_one(scene: _Scene, region: ObjectRegion | None, footprint: Footprint | None) -> tuple[MeasuredObject, str]:
    """One object, and in what laser and picture contradict each other about it."""
    reasons: dict[str, str] = {}
    floor, uncertainty = scene.floor, scene.uncertainty
    evidence, height = Evidence(footprint), (np.nan, np.nan)
    if region is not None:
        evidence, height, reasons = _pictured(scene, region, footprint)
    elif footprint is not None:
        reasons["height"] = scene.no_floor or _why_unseen(footprint, floor, scene.laser)
    if footprint is None and scene.scanned:
        reasons["object"] = "it is not in the scan (lower than its plane, or dark): its sizes come from the pair alone"
    fused = None
    if footprint is None or not _is_round_or_irregular(footprint):
        fused = fuse(scene.pair.light, floor, evidence, laser=scene.laser, uncertainty=uncertainty)
    if fused is not None:
        scale = (uncertainty.baseline_mm / floor.rectified.baseline_mm, uncertainty.f_px / floor.rectified.f_px)
        return from_faces(fused, height, reasons, float(np.hypot(*scale))), fused.disagreement
    if footprint is not None:
        return from_scan(footprint, scene.laser, height, reasons), ""
    assert region is not None
    return from_region(region, height, reasons), ""


def _pictured(
    scene: _Scene, region: ObjectRegion, footprint: Footprint | None
) -> tuple[Evidence, tuple[float, float], dict[str, str]]:
    """What the pair shows of an object: its evidence, its height with the deviation, and why it has none."""
    try:
        measured = measure_height(scene.pair, scene.floor, region, uncertainty=scene.uncertainty)
    except CannotMeasure as error:
        evidence = Evidence(footprint)
        if error.reason in ("cut by the frame", "no top edge"):  # else what was matched is chance
            with suppress(CannotMeasure):
                evidence = Evidence(footprint, find_faces(scene.floor, region, scene.pair), region.top_mm)
        return evidence, (np.nan, np.nan), {"height": str(error)}
    height = (measured.height_mm, measured.height_std_mm)
    return Evidence(footprint, measured.faces, measured.height_mm), height, {}


def _is_round_or_irregular(footprint: Footprint) -> bool:
    return footprint.shape in ("circle", "irregular") and len(footprint.segment.points_mm) > _FEW_BEAMS


def _why_unseen(footprint: Footprint, floor: Floor, laser: LaserOnFloor) -> str:
    """Why the picture says nothing of an object in the scan."""
    p = laser.points_mm(footprint.segment.points_mm)
    rectified = floor.rectified
    u = rectified.P1[0, 2] - rectified.f_px * p[:, 1] / np.maximum(p[:, 0], 1.0)
    if ((p[:, 0] > 0) & (u > 0) & (u < rectified.size[0])).sum() < 2:
        return "outside the picture: turn the rig towards it"
    shift = rectified.f_px * rectified.baseline_mm / np.maximum(p[:, 0], 1.0)
    if ((p[:, 0] > 0) & (u - shift > 0) & (u < rectified.size[0])).mean() < _SHOWN:
        return "only one camera sees it whole: turn the rig towards it"
    if np.linalg.norm(p, axis=1).min() > OBJECTS_WITHIN_MM:
        return f"too far for the pair: go nearer than {OBJECTS_WITHIN_MM / 1000:g} m"
    return "no texture: the pair matched nothing there; light or texture it"
