"""From one pair and one scan to the objects in front of the rig: length, width and height with standard deviations.

Picture -> faces and edges (`pictured`); scan -> lines (`scanned`); laser and cameras as calibrated, or moved
(`hypotheses`); one least squares over all (`scene_solver`); objects (`measured_object`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stereolib.base import Float32, Float64, UInt8
from stereolib.calibration import LidarCamera, is_beyond_lasers, read_share
from stereolib.laser import LaserScan, points_mm
from stereolib.measurement.box import Shared
from stereolib.measurement.camera_moves import see_pair
from stereolib.measurement.floor import Floor
from stereolib.measurement.hypotheses import Judged
from stereolib.measurement.instrument import Instrument
from stereolib.measurement.laser_on_floor import LaserOnFloor, Lean
from stereolib.measurement.measured_object import MeasuredObject
from stereolib.measurement.reasons import ScanFit
from stereolib.measurement.regions import OBJECTS_WITHIN_MM
from stereolib.measurement.standing import Standing, see_standing
from stereolib.measurement.things import NOWHERE, SCAN_REACH_M, Scene, nearest_mm, scan_fit, scanned_parts
from stereolib.measurement.views import Views

_LIKELY = 0.5  # probability from which something is said to have moved
_BY_CHANCE = 0.15  # share of matched pixels: pictures of two places have 0.08 to 0.14
_BELOW_CAMERA = "the laser's pose is not known: it is taken to stand straight below the left camera"
_LEFT_OUT = (
    "its readings are left out, its sizes come from the pictures. Were both taken at one moment, with nothing touching "
    "it? If this is said of many objects, the laser is elsewhere or was turned: run calibrate-laser (again); or the "
    "cameras' scale is off (the board's squares, the distance between the cameras): calibrate with --ruler-mm"
)


@dataclass(frozen=True, eq=False)
class Measurement:
    """What one pair and one scan tell.

    Attributes
    ----------
    objects : tuple of MeasuredObject
        Nearest first.
    said : tuple of str
        What did not fit together, or was not found, besides objects about which scan and pair disagree.
    floor : Floor or None
        None if it was not seen: then all comes from the scan, in the frame of a floor below its plane.
    laser : LaserOnFloor
        Where the scene has it.
    scan_mm : (N, 2) float64
        All readings on the floor.
    left, right : (H, W) or (H, W, 3) uint8
        Rectified, as they were given.
    disparity_px : (H, W) float32
        NaN where nothing was matched.
    scan_fit : ScanFit
        Whether the scan is of what the pictures show: where it opposes them, it tells no place of theirs.
    doubts : tuple of str
        Of `said`, what makes all sizes doubtful: a given floor that is not the one seen, a scan that opposes the pair.
    """

    objects: tuple[MeasuredObject, ...]
    said: tuple[str, ...]
    floor: Floor | None
    laser: LaserOnFloor
    scan_mm: Float64
    left: UInt8
    right: UInt8
    disparity_px: Float32
    scan_fit: ScanFit = ScanFit.UNTOLD
    doubts: tuple[str, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """All that is to be said of it: of single objects last."""
        return *self.said, *(disagreement(item) for item in self.objects if item.disagrees)


def measure_objects(
    left: UInt8, right: UInt8, scan: LaserScan | None, instrument: Instrument, *, floor: Floor | None = None
) -> Measurement:
    """Measure everything that stands on the floor in front of the rig.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        As the cameras gave them.
    scan : LaserScan or None
        A turn, or better the average of some, taken at the same time; None: the pair alone.
    instrument : Instrument
        The calibrated rig, with its laser if it has one.
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
    TypeError
        If scan or instrument are something else, as exchanged ones are.

    Notes
    -----
    Cameras that moved since their calibration are moved back as the rows tell (`moved_back`).
    """
    if not (scan is None or isinstance(scan, LaserScan)) or not isinstance(instrument, Instrument):
        got = f"{type(scan).__name__} and {type(instrument).__name__}"
        raise TypeError(f"after both pictures come a LaserScan or None, and an Instrument; got {got}")
    return measure_standing(see_standing(*see_pair(left, right, instrument), floor=floor), scan)


def measure_standing(standing: Standing, scan: LaserScan | None) -> Measurement:
    """Measure what `measure_objects` does in a pair in which all that stands is seen already.

    Parameters
    ----------
    standing : Standing
    scan : LaserScan or None
        As for `measure_objects`.

    Returns
    -------
    Measurement

    Raises
    ------
    CannotMeasure
        As `measure_objects` does.
    """
    views, instrument, priors, warnings = standing.views, standing.instrument, standing.priors, list(standing.said)
    if standing.no_floor is not None:
        if scan is None:
            raise standing.no_floor
        warnings.append(f"{standing.no_floor}. What follows is the scan's alone")
    if scan is not None and instrument.lidar is None:
        warnings.append(_BELOW_CAMERA)
    if scan is not None:
        scan = _above_floor(_as_cameras_tell(scan, instrument.lidar), priors.laser.lean)
        warnings += _said_of_lean(priors.laser.lean)
    footprints, walls_mm, no_object = ([], NOWHERE, "") if scan is None else scanned_parts(scan, priors.laser.bias_mm)
    warnings += [no_object] if no_object else []
    on_floor = NOWHERE if scan is None else priors.laser.points_mm(points_mm(scan))
    scene = Scene(standing, bool(footprints), priors.laser.points_mm(walls_mm), on_floor)
    things, unlike = scene.things(footprints)
    judged, things = scene.solved(things)
    fit, everything = scan_fit(things, is_placed=instrument.lidar is not None), len(things)
    judged, things = scene.without_phantoms(judged, things, fit)
    elsewhere = [f"{fit.value} What it alone shows is left out"] if len(things) < everything else []
    objects = sorted(scene.measured(judged, things), key=lambda thing: float(np.hypot(*thing.position_mm)))
    if not objects:
        reach = f"{OBJECTS_WITHIN_MM / 1000:g} m of the cameras or {SCAN_REACH_M} m of the laser"
        warnings.append(f"nothing stands on the floor within {reach}")
    laser = judged.solution.on_floor(priors.laser)
    readings = NOWHERE if scan is None else laser.points_mm(points_mm(scan))
    warnings += [*unlike, *elsewhere, *_said_of_the_rig(views, judged, nearest_mm(judged, things), instrument, fit)]
    pictures = views.left, views.right, views.disparity_px
    doubts = (*standing.said, *elsewhere)
    return Measurement(tuple(objects), tuple(warnings), standing.floor, laser, readings, *pictures, fit, doubts)


def disagreement(item: MeasuredObject, name: str = "") -> str:
    """Say that scan and pair disagree about an object, told by its place.

    Parameters
    ----------
    item : MeasuredObject
    name : str
        What it is called.

    Returns
    -------
    str
    """
    called = f" ({name})" if name else ""
    away = f"{np.hypot(*item.position_mm):.0f} mm away"
    return f"scan and pair disagree about the object {away}{called}: {_LEFT_OUT}"


def _as_cameras_tell(scan: LaserScan, lidar: LidarCamera | None) -> LaserScan:
    """A scan in the cameras' scale, against which the laser was calibrated."""
    return scan if lidar is None else replace(scan, ranges_mm=(1 - lidar.scale) * scan.ranges_mm)


def _above_floor(scan: LaserScan, lean: Lean | None) -> LaserScan:
    """A scan without what a leaning laser reads of the floor."""
    if lean is None or not lean.is_sure:
        return scan
    with np.errstate(invalid="ignore"):
        on_floor = lean.meets_floor(points_mm(scan, keep_invalid=True))
    return replace(scan, ranges_mm=np.where(on_floor, np.nan, scan.ranges_mm))


def _said_of_lean(lean: Lean | None) -> list[str]:
    """That the laser's plane leans, if it does."""
    if lean is None or not lean.is_sure:
        return []
    how = f"the laser's plane leans by {np.degrees(lean.angle_rad):.1f} degrees, down {lean.down}"
    where = f"its beams meet the floor {lean.floor_at_mm / 1000:.1f} m off, what it reads of it is left out"
    return [f"{how}: {where}; for objects and walls there level it over the floor, and run calibrate-laser again"]


def _said_of_matches(views: Views) -> list[str]:
    """That hardly a pixel is found in both pictures, if it is so."""
    matched = float(np.isfinite(views.disparity_px).mean())
    if matched >= _BY_CHANCE:
        return []
    how = f"only {100 * matched:.0f} % of the pixels are found in both pictures, as chance finds in those of two places"
    return [f"{how}: are they of one place and moment, left and right, with light enough?"]


def _off(value_mm: float, std_mm: float, first: str, second: str) -> str:
    """How far off something is, and to which of two sides."""
    return f"{abs(value_mm):.0f} ± {std_mm:.0f} mm {first if value_mm >= 0 else second}"


def _said_of_the_rig(views: Views, judged: Judged, near_mm: float, instrument: Instrument, fit: ScanFit) -> list[str]:
    """What has moved since its calibration, and what nobody could tell."""
    by_chance, solution = _said_of_matches(views), judged.solution
    said = [*(by_chance or views.rows.warnings), *instrument.warnings]  # rows matched by chance tell nothing
    if np.isfinite(near_mm) and not judged.scanned:
        said.append(instrument.turned_unseen(near_mm, is_opposed=fit is ScanFit.OPPOSES))
    if instrument.lidar is None and judged.scanned:
        (x, y, yaw, _), std = solution.laser, solution.laser_std
        place = f"{_off(x, std[0], 'ahead', 'behind')}, {_off(y, std[1], 'to the left', 'to the right')}"
        turn = f"turned by {np.degrees(yaw):z.1f} ± {np.degrees(std[2]):.1f} degrees against the pictures' axis"
        said.append(f"the objects place the laser {place}, {turn}")
    elif judged.chance(laser=True) > _LIKELY:
        (x, y, yaw, _), std = solution.laser, solution.laser_std
        move = f"{np.hypot(x, y):.0f} mm and {np.degrees(yaw):z.1f} ± {np.degrees(std[2]):.1f} degrees"
        said.append(
            f"the laser has moved since its calibration, by {move}; corrected here: calibrate it again. If nobody "
            "moved it, the cameras' scale has changed (check it with --ruler-mm), or the laser's"
        )
    known = 0.0 if instrument.lidar is None else instrument.lidar.scale
    scale, scale_std = known + float(solution.laser[-1]), float(solution.laser_std[-1])
    if judged.scanned and not is_beyond_lasers(known, 0.0) and is_beyond_lasers(scale, scale_std):
        said.append(
            f"the laser reads {read_share(scale)} than the pictures have it, more than such a laser errs: where it is "
            "right, all sizes are off by as much; measure the squares of the cameras' boards over many of them and the "
            "distance of the lenses, and calibrate again with --ruler-mm"
        )
    if judged.chance(cameras=True) > _LIKELY:
        off, off_std = (float(a[Shared.OFFSET]) for a in (solution.shared, np.sqrt(np.diag(solution.covariance))))
        how = f"all disparities are off by {off:.2f} ± {off_std:.2f} px; corrected here: calibrate again"
        unless = "So it is if the laser reads as at its calibration, and its board's squares are as they were told"
        said.append(
            f"the cameras have turned since their calibration: {how}. {unless}; else the pair alone is right: measure "
            "without the scan"
        )
    return said
