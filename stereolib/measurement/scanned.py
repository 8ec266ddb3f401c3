"""What the scan shows of boxes: readings on their faces, and between which beams these end."""

from __future__ import annotations

import numpy as np

from stereolib.base import wrap_rad
from stereolib.laser import Footprint
from stereolib.measurement.box import Own, Side
from stereolib.measurement.laser_on_floor import LaserOnFloor
from stereolib.measurement.observations import EndBetweenBeams, Observation, RangesSeen, weak_priors
from stereolib.measurement.scene_solver import Seen

_ALIKE_RAD = np.pi / 4  # directions of one face as both sensors have it differ by less
_HIDDEN_MM = _HEIGHT_MM = 100.0  # what an extent is taken as that nobody sees


def sides_of(footprint: Footprint, laser: LaserOnFloor, turn_rad: float) -> dict[int, Side]:
    """Which faces of a box the lines of a footprint are.

    Parameters
    ----------
    footprint : Footprint
    laser : LaserOnFloor
    turn_rad : float
        Of the box.

    Returns
    -------
    dict of Side
        By the line's number, from right to left; lines that are turned by more than 45 degrees from either are not in
        it.
    """
    found: dict[int, Side] = {}
    for k, face in enumerate(footprint.faces):
        angle = float(np.arctan2(face.normal[1], face.normal[0])) + laser.yaw_rad
        for side, normal in ((Side.RIGHT, turn_rad), (Side.LEFT, turn_rad - np.pi / 2)):
            if abs(wrap_rad(angle - normal)) < _ALIKE_RAD:
                found[k] = side
    return found


def scan_observations(footprint: Footprint, laser: LaserOnFloor, turn_rad: float) -> list[Observation]:
    """Readings on a box's faces, and their ends: those that the pictures show too tell whether both saw the same box.

    Parameters
    ----------
    footprint : Footprint
    laser : LaserOnFloor
    turn_rad : float
        Of the box.

    Returns
    -------
    list of Observation
    """
    segment, fit, found = footprint.segment, footprint.fit, list[Observation]()
    if fit is None:
        return found
    parts = (slice(None, fit.split), slice(fit.split, None))
    for k, side in sides_of(footprint, laser, turn_rad).items():
        mine, face = parts[k], footprint.faces[k]
        rays, points = segment.rays[mine], segment.points_mm[mine]
        if not len(points):
            continue
        ranges = np.linalg.norm(points - rays.origins_mm, axis=1)
        found.append(RangesSeen(side, rays.origins_mm, rays.directions, ranges, segment.sigma_mm[mine]))
        for end, name in enumerate(face.ends):
            at_corner = (side is Side.RIGHT) == (end == 1)
            if name == "free":
                bounds = segment.bounds[end]
                found.append(EndBetweenBeams(side, at_corner, bounds.origins_mm, bounds.directions))
    return found


def scanned_box(footprint: Footprint, laser: LaserOnFloor) -> Seen | None:
    """A box that only the scan shows; None without straight faces.

    Parameters
    ----------
    footprint : Footprint
    laser : LaserOnFloor

    Returns
    -------
    Seen or None
    """
    if footprint.fit is None:
        return None
    faces = footprint.faces
    normal, own = laser.R @ faces[0].normal, np.zeros(len(Own))
    corner = laser.points_mm(faces[0].ends_mm[1:])[0]
    own[[Own.X, Own.Y, Own.TURN, Own.HEIGHT]] = *corner, np.arctan2(normal[1], normal[0]), _HEIGHT_MM
    extents = [float(np.linalg.norm(face.ends_mm[1] - face.ends_mm[0])) for face in faces]
    own[[Own.RIGHT, Own.LEFT]] = extents[0], extents[1] if len(faces) > 1 else _HIDDEN_MM
    readings = scan_observations(footprint, laser, float(own[Own.TURN]))
    return Seen(own, (*weak_priors(own, laser.bias_mm), *readings))
