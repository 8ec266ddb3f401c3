"""What stands on the floor in one pair: the floor, the objects, and each of them as a box."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stereolib.calibration import LASER_SCALE_STD
from stereolib.measurement.floor import Floor, floor_from_pose
from stereolib.measurement.instrument import Instrument
from stereolib.measurement.laser_on_floor import LaserOnFloor
from stereolib.measurement.missing_floor import find_floor
from stereolib.measurement.pictured import Pictured, see_box
from stereolib.measurement.plane_alignment import CannotMeasure
from stereolib.measurement.regions import ObjectRegion, find_objects
from stereolib.measurement.scene_solver import Priors
from stereolib.measurement.views import Views
from stereolib.rig import pose_left_world, rigid

#: A laser that nobody calibrated: straight below the camera within 50 mm and five degrees.
_BELOW = LaserOnFloor(np.eye(2), np.zeros(2), np.diag([50.0**2, 50.0**2, np.radians(5.0) ** 2, LASER_SCALE_STD**2]))
_LASER_ABOVE_FLOOR_MM = 100.0  # where no floor is seen; the scan's sizes do not depend on it
_LEAST_STD = 1e-5  # of what a calibration knows, px or mm
_TALL_MM = 1000.0  # from there on tenths are not told
_MOST_TIMES = 3.0  # as high or low as the pictures show it, a floor is no slip of a ruler
_COMMON_PX = 0.3  # of all disparities, by which a calibration may have the floor seen elsewhere
_OTHER_FLOOR = 16.3  # squared deviations of three numbers, which chance passes once in 1,000
_ASKED = 60  # pixels of objects, what the calibration leaves open there
_CALIBRATED = [2, 3, 0]  # of offset, rows, focal length and baseline: in the order of `SystematicUncertainty`


@dataclass(frozen=True, eq=False)
class Standing:
    """All that the pictures of one pair show, before any scan.

    Attributes
    ----------
    views : Views
    instrument : Instrument
    priors : Priors
        Where no floor was seen, those of one below camera and laser.
    floor : Floor or None
    no_floor : CannotMeasure or None
        Why there is no floor.
    regions : tuple of ObjectRegion
        Nearest first.
    boxes : tuple of Pictured or CannotMeasure
        Each region as a box, or why it is none.
    said : tuple of str
        That the pictures show another floor than the one that was given, or none. Where they show another, `floor` is
        the given one, as uncertain as both differ.
    """

    views: Views
    instrument: Instrument
    priors: Priors
    floor: Floor | None
    no_floor: CannotMeasure | None
    regions: tuple[ObjectRegion, ...]
    boxes: tuple[Pictured | CannotMeasure, ...]
    said: tuple[str, ...] = ()


def see_standing(views: Views, instrument: Instrument, *, floor: Floor | None = None) -> Standing:
    """Find floor, objects and their faces in a pair.

    Parameters
    ----------
    views : Views
        Of the instrument's cameras.
    instrument : Instrument
    floor : Floor, optional
        Where it is known; else it is found in the pictures.

    Returns
    -------
    Standing

    Raises
    ------
    ValueError
        If the pictures show a floor three times as high or low as the one that was given.
    """
    if floor is not None and floor.rectified is not instrument.rectified:  # its cameras were turned back
        floor = floor.seen_by(instrument.rectified)
    no_floor: CannotMeasure | None = None
    regions, said = list[ObjectRegion](), tuple[str, ...]()
    views = replace(views, pair=replace(views.pair, errors=instrument.uncertainty.errors))
    if floor is not None:
        floor, said = _against_pictures(floor, views)
    try:
        floor = floor or find_floor(views, instrument.rectified)
        regions = find_objects(views.disparity_px, floor)
    except CannotMeasure as error:
        no_floor = error
    priors = scene_priors(views, instrument, floor or _floor_below(instrument), regions)
    boxes = tuple(_box(views, priors, region) for region in regions)
    return Standing(views, instrument, priors, floor, no_floor, tuple(regions), boxes, said)


def _against_pictures(given: Floor, views: Views) -> tuple[Floor, tuple[str, ...]]:
    """The given floor, and that the pictures show another one, from which it is a standard deviation then, or none."""
    try:
        seen = find_floor(views, given.rectified)
    except CannotMeasure:
        if views.rows.is_known:
            text = "the pictures do not show whether the given floor is right: heights are as true as it is"
            return given, (f"{text}, and where its pitch is wrong, what stands upright seems to lean",)
        text = "rows of the two pictures that belong together are not found: what is measured is left to chance"
        return given, (f"{text}. See that both are of this rig and moment, left and right; else calibrate again",)
    off = seen.plane - given.plane
    known = seen.covariance + given.covariance + np.diag([0.0, 0.0, _COMMON_PX**2])
    if off @ np.linalg.solve(known, off) < _OTHER_FLOOR:
        return given, ()
    text = f"the given floor contradicts the pictures: they show a floor {_told(seen)}; given is {_told(given)}"
    text += ". Leave it away, or correct it"
    if given.pitch_rad * seen.pitch_rad < 0:
        text += "; is its pitch's sign right?"
    if abs(np.log(seen.camera_height_mm / given.camera_height_mm)) > np.log(_MOST_TIMES):
        raise ValueError(
            f"{text}{'' if text.endswith('?') else '.'} Its height is asked for in millimetres, its pitch in degrees"
        )
    text += ". Until then all that hangs on it is as uncertain as both differ"
    return replace(given, covariance=given.covariance + np.outer(off, off)), (text,)


def _told(floor: Floor) -> str:
    """Where a floor lies, in words."""
    high, way = floor.camera_height_mm, "up" if floor.pitch_rad >= 0 else "down"
    below = f"{high:.{0 if high >= _TALL_MM else 1}f} mm below the camera"
    return f"{below}, which looks {abs(np.degrees(floor.pitch_rad)):.1f} degrees {way}"


def _box(views: Views, priors: Priors, region: ObjectRegion) -> Pictured | CannotMeasure:
    try:
        return see_box(views, priors, region)
    except CannotMeasure as error:
        return error


def scene_priors(views: Views, instrument: Instrument, floor: Floor, regions: Sequence[ObjectRegion] = ()) -> Priors:
    """What calibration, pictures and floor tell of what all objects share.

    Parameters
    ----------
    views : Views
    instrument : Instrument
    floor : Floor
    regions : sequence of ObjectRegion
        Where the objects are: what the calibration leaves open is told there.

    Returns
    -------
    Priors
    """
    rectified, share = instrument.rectified, np.ones(4)
    share[2:] = rectified.f_px, rectified.baseline_mm
    cameras = np.diag([_LEAST_STD**2] * 4)
    cameras[1, 1] += views.rows.std_px**2
    known = instrument.uncertainty
    if regions:
        u, v = np.concatenate([(region.u, region.v) for region in regions], axis=1)
        every = -(-len(u) // _ASKED)
        known = known.at(u[::every], v[::every])
    known = known.with_offset(float(np.hypot(views.rows.columns_std_px, instrument.turn_std_px)))
    cameras[np.ix_(_CALIBRATED, _CALIBRATED)] += known.covariance
    laser = _BELOW if instrument.lidar is None else LaserOnFloor.of(instrument.lidar, floor)
    return Priors(floor, laser, cameras / np.outer(share, share))


def _floor_below(instrument: Instrument) -> Floor:
    """A floor nobody saw: parallel to the laser's plane, and below it and the camera."""
    rectified, lidar, above = instrument.rectified, instrument.lidar, _LASER_ABOVE_FLOOR_MM
    if lidar is None:
        return floor_from_pose(rectified, rigid(rectified.R1.T, np.zeros(3)) @ pose_left_world(0.0, above))
    up = lidar.T_left_lidar[:3, 2]
    camera_mm = -float(up @ lidar.T_left_lidar[:3, 3])  # above the laser's plane
    return floor_from_pose(rectified, lidar.T_left_lidar @ rigid(np.eye(3), [0.0, 0.0, min(camera_mm, 0.0) - above]))
