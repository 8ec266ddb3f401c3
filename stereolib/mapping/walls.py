"""The walls of a map: straight stretches in the scans of all stations, joined where they meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from stereolib.base import Bools, Float64, Ints
from stereolib.laser import fit_walls
from stereolib.mapping.stations import XV11_BIAS, Station, laser_errors_mm
from stereolib.measurement import MeasuredObject

_THRESHOLD_MM = 15.0  # farthest reading from its wall: five deviations at 2 m
_GAP_MM = 300.0  # a wall ends where it has no reading for so long: a door, or another wall
_MARGIN_MM = 60.0  # readings that near to an object are the object's
_LEAST_LINE_MM = 250.0  # shortest line that is tried
_LEAST_READINGS = 10  # of a line: fewer are chance
LEAST_WALL_MM = 700.0  # shortest wall
_REACH_MM = 250.0  # walls that end so near to where they meet end there
_ACROSS = 0.5  # sine of the least angle at which walls are taken to meet


@dataclass(frozen=True, eq=False)
class MapWall:
    """A straight wall: ``normal @ p = offset_mm`` between two ends.

    Attributes
    ----------
    ends_mm : (2, 2) float64
    ends : (str, str)
        ``"corner"`` (where it meets another wall) or ``"open"`` (the last reading).
    normal : (2,) float64
        Into the room, where the laser stood.
    offset_mm : float
    offset_std_mm, angle_std_rad : float
        Of where it stands in the middle of its readings, across it, and of its turn about there.
    rms_mm : float
        Of its readings.
    readings : int
    """

    ends_mm: Float64
    ends: tuple[str, str]
    normal: Float64
    offset_mm: float
    offset_std_mm: float
    angle_std_rad: float
    rms_mm: float
    readings: int

    @property
    def length_mm(self) -> float:
        """Distance of its ends, mm."""
        return float(np.linalg.norm(self.ends_mm[1] - self.ends_mm[0]))

    def near(self, point_mm: Float64, reach_mm: float) -> bool:
        """Find out whether a point lies on the wall, behind it, or up to a distance before it.

        Parameters
        ----------
        point_mm : (2,) float64
        reach_mm : float

        Returns
        -------
        bool
        """
        along = (self.ends_mm[1] - self.ends_mm[0]) / self.length_mm
        t = float((point_mm - self.ends_mm[0]) @ along)
        return bool(-reach_mm < t < self.length_mm + reach_mm and point_mm @ self.normal - self.offset_mm < reach_mm)


def find_walls(
    stations: Sequence[Station],
    objects: Sequence[MeasuredObject] = (),
    *,
    rng: np.random.Generator,
    least_mm: float = LEAST_WALL_MM,
    bias_mm: tuple[float, float] = XV11_BIAS,
) -> list[MapWall]:
    """Find the walls in the scans of all stations.

    Parameters
    ----------
    stations : sequence of Station
    objects : sequence of MeasuredObject
        In the map; readings near to them are theirs.
    rng : numpy.random.Generator
    least_mm : float
        Shortest wall.
    bias_mm : (a, b)
        Standard deviations of what averaging does not remove (see `refine_poses`), mm and 1/mm.

    Returns
    -------
    list of MapWall
        The one with the most readings first.

    Notes
    -----
    Lines are found one after the other (`stereolib.laser.fit_walls`). A wall is as uncertain as its scatter over the
    root of the readings, and as what no averaging removes: the bias of each station's readings on it, and the bias,
    place, turn and scale of the laser that all of them share (as in `refine_poses`); and the stations' poses.
    """
    points = np.concatenate([station.to_map(station.scan_mm) for station in stations])
    owner = np.repeat(np.arange(len(stations)), [len(station.scan_mm) for station in stations])
    free = np.ones(len(points), bool)
    for each in objects:
        free &= _distance_mm(points, each.outline_mm) > _MARGIN_MM
    lines = []
    while free.sum() > _LEAST_READINGS:
        left = np.where(free[:, None], points, np.nan)
        try:
            (line,) = fit_walls(left, 1, threshold_mm=_THRESHOLD_MM, min_length_mm=_LEAST_LINE_MM, rng=rng)
        except ValueError:  # what is left makes no line
            break
        stretch = _longest_stretch(points, line.normal, line.inliers)
        long = bool(np.ptp(_along(points[stretch], line.normal)) >= least_mm)
        free &= ~(stretch if long else line.inliers)
        if long and stretch.sum() >= _LEAST_READINGS:
            lines.append(_wall(points, owner, stretch, stations, bias_mm))
        elif line.inliers.sum() < _LEAST_READINGS:
            break
    return [_joined(wall, lines) for wall in sorted(lines, key=lambda wall: -wall.readings)]


def _along(points: Float64, normal: Float64) -> Float64:
    return np.asarray(points @ np.array([-normal[1], normal[0]]))


def _longest_stretch(points: Float64, normal: Float64, inliers: Bools) -> Bools:
    """The inliers of the longest stretch without a gap. (N,) bool."""
    index = np.flatnonzero(inliers)
    t = _along(points[index], normal)
    order = np.argsort(t, kind="stable")
    parts = np.split(index[order], np.flatnonzero(np.diff(t[order]) > _GAP_MM) + 1)
    best = max(parts, key=lambda part: float(np.ptp(_along(points[part], normal))))
    return np.isin(np.arange(len(points)), best)


def _wall(
    points: Float64, owner: Ints, members: Bools, stations: Sequence[Station], bias_mm: tuple[float, float]
) -> MapWall:
    p = points[members]
    centre = p.mean(axis=0)
    normal = np.linalg.svd(p - centre, full_matrices=False)[2][1]
    sources = np.unique(owner[members])
    inside = np.mean([stations[k].to_map(stations[k].laser_mm.reshape(-1, 2).mean(axis=0)) for k in sources], axis=0)
    normal = normal if (inside - centre) @ normal > 0 else -normal
    t, rms = _along(p, normal), float(np.sqrt(np.mean(((p - centre) @ normal) ** 2)))
    ends = (normal @ centre) * normal + np.array([[t.min()], [t.max()]]) * np.array([-normal[1], normal[0]])
    lever = (t - t.mean()) / np.sum((t - t.mean()) ** 2)
    across = _across_mm(points, owner, normal, stations, bias_mm)[:, members]
    offset_std, angle_std = (
        float(np.sqrt(rms**2 * by @ by + np.sum((across @ by) ** 2))) for by in (np.full(len(p), 1 / len(p)), lever)
    )
    return MapWall(ends, ("open", "open"), normal, float(normal @ centre), offset_std, angle_std, rms, len(p))


def _across_mm(
    points: Float64, owner: Ints, normal: Float64, stations: Sequence[Station], bias_mm: tuple[float, float]
) -> Float64:
    """By how much each error but noise shifts all readings across a wall, for one standard deviation of it: (k, N)."""
    shifts = [laser_errors_mm(stations, bias_mm[1]) @ normal]
    for k, station in enumerate(stations):
        turned = (points - station.pose[:2]) @ [normal[1], -normal[0]]
        J = np.column_stack([np.tile(normal, (len(points), 1)), turned])
        values, vectors = np.linalg.eigh(station.covariance)
        here = np.column_stack([J @ (vectors * np.sqrt(np.maximum(values, 0.0))), np.full(len(points), bias_mm[0])])
        shifts.append(np.where(owner == k, here.T, 0.0))
    return np.concatenate(shifts)


def _joined(wall: MapWall, others: Sequence[MapWall]) -> MapWall:
    """A wall, its ends moved to where it meets others that end there too."""
    ends, kinds = wall.ends_mm.copy(), list(wall.ends)
    for other in others:
        across = np.stack([wall.normal, other.normal])
        if other is wall or abs(np.linalg.det(across)) < _ACROSS:
            continue
        meeting = np.linalg.solve(across, [wall.offset_mm, other.offset_mm])
        k = int(np.linalg.norm(wall.ends_mm - meeting, axis=1).argmin())
        theirs = np.linalg.norm(other.ends_mm - meeting, axis=1).min()
        if np.linalg.norm(wall.ends_mm[k] - meeting) < _REACH_MM and theirs < _REACH_MM:
            ends[k], kinds[k] = meeting, "corner"
    return replace(wall, ends_mm=ends, ends=(kinds[0], kinds[1]))


def _distance_mm(points: Float64, outline: Float64) -> Float64:
    """Distance of points from an outline; negative inside. (N,)."""
    finite = outline[np.isfinite(outline).all(axis=1)].astype(np.float32)
    if len(finite) < 2:
        return np.full(len(points), np.inf)
    hull = cv2.convexHull(finite) if len(finite) > 2 else finite[:, None]
    return -np.array([cv2.pointPolygonTest(hull, (float(x), float(y)), True) for x, y in points])
