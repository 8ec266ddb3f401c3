"""The walls of a map: straight stretches in the scans of all stations, joined where they meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from stereolib.laser import fit_walls
from stereolib.mapping.stations import Station
from stereolib.measurement import MeasuredObject

Array = np.ndarray
_BIAS_MM = 2.0  # of one station's readings on one wall: the laser's, which no averaging removes


@dataclass(frozen=True, eq=False)
class MapWall:
    """A straight wall: ``normal . p = offset_mm`` between two ends.

    Attributes
    ----------
    ends_mm : (2, 2) float64
    ends : two of ``"corner"`` (where it meets another wall), ``"open"`` (the last reading)
    normal : (2,) float64
        Into the room, where the laser stood.
    offset_mm, offset_std_mm, angle_std_rad : float
    rms_mm : float
        Of its readings.
    readings : int
    """

    ends_mm: Array
    ends: tuple[str, str]
    normal: Array
    offset_mm: float
    offset_std_mm: float
    angle_std_rad: float
    rms_mm: float
    readings: int

    @property
    def length_mm(self) -> float:
        """Distance of its ends, mm."""
        return float(np.linalg.norm(self.ends_mm[1] - self.ends_mm[0]))

    def near(self, point_mm: Array, reach_mm: float) -> bool:
        """Whether a point (2,) lies on the wall or behind it, up to a distance before it."""
        along = (self.ends_mm[1] - self.ends_mm[0]) / self.length_mm
        t = float((point_mm - self.ends_mm[0]) @ along)
        return bool(-reach_mm < t < self.length_mm + reach_mm and point_mm @ self.normal - self.offset_mm < reach_mm)


def find_walls(
    stations: Sequence[Station],
    things: Sequence[MeasuredObject] = (),
    *,
    rng: np.random.Generator,
    least_mm: float = 700.0,
    threshold_mm: float = 15.0,
    gap_mm: float = 300.0,
    margin_mm: float = 60.0,
) -> list[MapWall]:
    """Walls in the scans of all stations.

    Parameters
    ----------
    stations : sequence of Station
    things : sequence of MeasuredObject
        In the map; readings within `margin_mm` of them are theirs.
    rng : numpy.random.Generator
    least_mm : float
        Shortest wall.
    threshold_mm : float
        Farthest reading from its wall.
    gap_mm : float
        A wall ends where it has no reading for so long.

    Notes
    -----
    Lines are found one after the other (`stereolib.lrf_walls.fit_walls`). An offset is as uncertain as its scatter
    over the root of the readings, and as the bias and the poses of the stations that see it.
    """
    points = np.concatenate([station.to_map(station.scan_mm) for station in stations])
    owner = np.repeat(np.arange(len(stations)), [len(station.scan_mm) for station in stations])
    free = np.ones(len(points), bool)
    for thing in things:
        free &= _distance_mm(points, thing.outline_mm) > margin_mm
    lines = []
    while free.sum() > 10:
        try:
            (line,) = fit_walls(
                np.where(free[:, None], points, np.nan), 1, threshold_mm=threshold_mm, min_length_mm=250.0, rng=rng
            )
        except ValueError:  # what is left makes no line
            break
        stretch = _longest_stretch(points, line.normal, line.inliers, gap_mm)
        free &= ~(line.inliers if np.ptp(_along(points[stretch], line.normal)) < least_mm else stretch)
        if np.ptp(_along(points[stretch], line.normal)) >= least_mm and stretch.sum() >= 10:
            lines.append(_wall(points, owner, stretch, stations))
        elif line.inliers.sum() < 10:
            break
    return [_joined(wall, lines) for wall in sorted(lines, key=lambda wall: -wall.readings)]


def _along(points: Array, normal: Array) -> Array:
    return points @ np.array([-normal[1], normal[0]])


def _longest_stretch(points: Array, normal: Array, inliers: Array, gap_mm: float) -> Array:
    """The inliers of the longest stretch without a gap. (N,) bool."""
    index = np.flatnonzero(inliers)
    t = _along(points[index], normal)
    order = np.argsort(t, kind="stable")
    parts = np.split(index[order], np.flatnonzero(np.diff(t[order]) > gap_mm) + 1)
    best = max(parts, key=lambda part: float(np.ptp(_along(points[part], normal))))
    return np.isin(np.arange(len(points)), best)


def _wall(points: Array, owner: Array, members: Array, stations: Sequence[Station]) -> MapWall:
    p = points[members]
    centre = p.mean(axis=0)
    normal = np.linalg.svd(p - centre, full_matrices=False)[2][1]
    seen = sorted(set(owner[members].tolist()))
    inside = np.mean([stations[k].to_map(stations[k].laser_mm) for k in seen], axis=0)
    normal = normal if (inside - centre) @ normal > 0 else -normal
    t, rms = _along(p, normal), float(np.sqrt(np.mean(((p - centre) @ normal) ** 2)))
    weights = []
    for k in seen:
        lever = centre - stations[k].pose[:2]
        J = np.array([normal[0], normal[1], normal @ [-lever[1], lever[0]]])
        weights.append(1 / (J @ stations[k].covariance @ J + _BIAS_MM**2))
    shared = 1 / np.sqrt(np.sum(weights))
    offset = float(normal @ centre)
    along = np.array([-normal[1], normal[0]])
    ends = offset * normal + np.array([[t.min()], [t.max()]]) * along
    spread = float(np.hypot(rms / np.sqrt(len(p)), shared))
    return MapWall(ends, ("open", "open"), normal, offset, spread, spread / float(np.std(t)), rms, len(p))


def _joined(wall: MapWall, others: Sequence[MapWall], reach_mm: float = 250.0) -> MapWall:
    """The same wall, its ends moved to where it meets others that end there too."""
    ends, kinds = wall.ends_mm.copy(), list(wall.ends)
    for other in others:
        across = np.stack([wall.normal, other.normal])
        if other is wall or abs(np.linalg.det(across)) < 0.5:
            continue
        meeting = np.linalg.solve(across, [wall.offset_mm, other.offset_mm])
        k = int(np.linalg.norm(wall.ends_mm - meeting, axis=1).argmin())
        theirs = np.linalg.norm(other.ends_mm - meeting, axis=1).min()
        if np.linalg.norm(wall.ends_mm[k] - meeting) < reach_mm and theirs < reach_mm:
            ends[k], kinds[k] = meeting, "corner"
    return replace(wall, ends_mm=ends, ends=(kinds[0], kinds[1]))


def _distance_mm(points: Array, outline: Array) -> Array:
    """Distance of points from an outline; negative inside. (N,)."""
    finite = outline[np.isfinite(outline).all(axis=1)].astype(np.float32)
    if len(finite) < 2:
        return np.full(len(points), np.inf)
    hull = cv2.convexHull(finite) if len(finite) > 2 else finite[:, None]
    return -np.array([cv2.pointPolygonTest(hull, (float(x), float(y)), True) for x, y in points])
