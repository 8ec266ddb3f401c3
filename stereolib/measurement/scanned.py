"""What the scan shows of boxes: readings on their faces, and between which beams these end."""

from __future__ import annotations

import numpy as np

from stereolib.base import Bools, Float64, wrap_rad
from stereolib.laser import Footprint, fit_line
from stereolib.measurement.box import Own, Side
from stereolib.measurement.floor import Floor
from stereolib.measurement.laser_on_floor import LaserOnFloor
from stereolib.measurement.observations import EndBetweenBeams, Observation, RangesSeen, weak_priors
from stereolib.measurement.regions import LEAST_PX, STEP, ObjectRegion
from stereolib.measurement.scene_solver import Seen

_ALIKE_RAD = np.pi / 4  # directions of one face as both sensors have it differ by less
_WALL_PX, _WALL = 4.0, 0.8  # of disparity, two of the half size: so near it lies so much of what a wall's part matches
_STRAIGHT_PX = 0.5  # what lies in front of a wall by more, of disparity, is no wall
_AROUND = 2.0  # a wall is looked for in so many times the directions of what may be a part of it
_LEAST_READINGS = 3  # of a straight line that is more than two points
_HIGHER, _OFF, _INNER = 1.25, 0.15, 0.5  # times the laser's plane; of the distance; share of the directions
_ON, _GAP = 0.07, 3  # of the distance; beams that go through a face and, on either side, meet it, together
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


def reads_otherwise(ends_mm: Float64, height_mm: float, laser: LaserOnFloor, readings_mm: Float64) -> bool:
    """Whether the laser reads something nearer or farther where a box stands that is higher than its plane.

    Parameters
    ----------
    ends_mm : (N, 2) float64
        Where the box's faces end, on the floor.
    height_mm : float
        Of the box.
    laser : LaserOnFloor
    readings_mm : (M, 2) float64
        All of the scan, on the floor.

    Returns
    -------
    bool
        In the inner half of the directions in which the box stands there are three readings or more, and each is off
        by more than 15 %. The box has to be higher than the laser's plane by a quarter; False where nobody knows how
        high that is.
    """
    if laser.lean is None:
        return False
    ends, seen = ends_mm - laser.t, readings_mm - laser.t
    if height_mm < _HIGHER * (laser.lean.height_mm + float(laser.lean.slope @ laser.R.T @ ends.mean(axis=0))):
        return False
    bearings, off = _bearings(ends, ends), _bearings(seen, ends)
    there = np.abs(off - (bearings.max() + bearings.min()) / 2) < _INNER * np.ptp(bearings) / 2
    order = np.argsort(bearings)
    expected = np.interp(off[there], bearings[order], 1 / np.linalg.norm(ends, axis=1)[order])
    apart = np.abs(np.linalg.norm(seen[there], axis=1) * expected - 1)
    return bool(there.sum() >= _LEAST_READINGS and (apart > _OFF).all())


def is_seen_through(ends_mm: Float64, laser: LaserOnFloor, readings_mm: Float64) -> bool:
    """Whether beams go through a face, between others that meet it: it is no single one, but has a gap.

    Parameters
    ----------
    ends_mm : (2, 2) float64
        Of the face, on the floor.
    laser : LaserOnFloor
    readings_mm : (M, 2) float64
        All of the scan, on the floor.

    Returns
    -------
    bool
        Beams side by side read more than 15 % too far, and those next to them on either side meet it to 7 %: in all
        three, or two beams on either side of a single one.
    """
    from scipy.ndimage import find_objects, label

    ends, seen = ends_mm - laser.t, readings_mm - laser.t
    bearings, off = _bearings(ends, ends), _bearings(seen, ends)
    there = np.flatnonzero((off > bearings.min()) & (off < bearings.max()))
    if not len(there):
        return False
    seen = seen[there[np.argsort(off[there])]]
    along = ends[1] - ends[0]
    normal = np.array([-along[1], along[0]])
    apart = seen @ normal / float(ends[0] @ normal) - 1  # of the face's distance, along each beam
    meets = np.abs(apart) < _ON
    return any(
        min(_run(meets[: gap.start][::-1]), _run(meets[gap.stop :])) >= max(1, _GAP - (gap.stop - gap.start))
        for (gap,) in find_objects(label(apart > _OFF)[0])
    )


def _bearings(points_mm: Float64, around_mm: Float64) -> Float64:
    """Directions of points (N, 2) from the laser, from that of the middle of others. (N,) rad."""
    middle = np.arctan2(*around_mm.mean(axis=0)[::-1])
    return np.asarray(wrap_rad(np.arctan2(points_mm[:, 1], points_mm[:, 0]) - middle))


def _run(flags: Bools) -> int:
    """How many are true before the first that is not."""
    return int(np.argmin(np.append(flags, False)))


def is_wall(region: ObjectRegion, floor: Floor, walls_mm: Float64, objects_mm: Float64) -> bool:
    """Whether what the pictures show is a part of a wall of the scan.

    Parameters
    ----------
    region : ObjectRegion
    floor : Floor
    walls_mm, objects_mm : (N, 2) and (M, 2) float64
        What the scan has of walls and of objects, on the floor: forward and left of the camera.

    Returns
    -------
    bool
        The readings there, and half as far again beside it, lie on one straight line, half a pixel of disparity off it
        at most, no object of the scan is within four pixels of it, four of five pixels of the region are, and what of
        it lies farther in front is too small to be an object.
    """
    rays, px_mm = floor.rays(region.u, region.v), floor.rectified.f_px * floor.rectified.baseline_mm
    bearing = np.arctan2(rays[1], rays[0])
    middle, half = (bearing.max() + bearing.min()) / 2, np.ptp(bearing) / 2

    def there(points_mm: Float64) -> Float64:
        off = np.arctan2(points_mm[:, 1], points_mm[:, 0]) - middle
        return np.asarray(points_mm[(np.abs(off) < _AROUND * half) & (points_mm[:, 0] > 0)])

    walls_mm = there(walls_mm)
    if len(walls_mm) < _LEAST_READINGS:
        return False
    wall = fit_line(walls_mm)

    def before_px(points_mm: Float64) -> Float64:
        return px_mm / points_mm[:, 0] * (1 - points_mm @ wall.normal / wall.offset_mm)

    straight = (np.abs(before_px(walls_mm)) < _STRAIGHT_PX).all() and (before_px(there(objects_mm)) > _WALL_PX).all()
    nearer_px = region.disparity_px - px_mm * (wall.normal @ rays) / wall.offset_mm
    on_it = (np.abs(nearer_px) < _WALL_PX).mean() > _WALL and (nearer_px > _WALL_PX).sum() * STEP**2 < LEAST_PX
    return bool(straight and on_it)
