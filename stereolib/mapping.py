"""The map: what several stations measured, brought together (sections I and V, the paper's future work).

A station is a place of the rig on the floor. Its objects, seen from other places too, are merged; its scan's straight
stretches are walls. The map's frame is that of the poses: x forward, y left, z up, mm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from stereolib.camera import finite_array, set_frozen
from stereolib.objects import MeasuredObject
from stereolib.lrf_walls import fit_walls
from stereolib.sightings import MapObject, Sighting, merged, same_thing

Array = np.ndarray
_BIAS_MM = 2.0  # of one station's readings on one wall: the laser's, which no averaging removes


@dataclass(frozen=True, eq=False)
class Station:
    """Where the rig stood, and what it measured there.

    Attributes
    ----------
    pose : (x_mm, y_mm, yaw_rad)
        Of its floor frame in the map: the place below the left camera, and where the camera looks.
    objects : tuple of MeasuredObject
        In its floor frame.
    scan_mm : (N, 2) float64
        The laser's readings in its floor frame, in the order of their angles.
    laser_mm : (2,) float64
        Where the laser stands in its floor frame.
    covariance : (3, 3) float64
        Of `pose`, mm and rad; zero if the pose is known.
    """

    pose: Array
    objects: tuple[MeasuredObject, ...]
    scan_mm: Array = field(default_factory=lambda: np.zeros((0, 2)))
    laser_mm: Array = field(default_factory=lambda: np.zeros(2))
    covariance: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def __post_init__(self) -> None:
        scan = np.asarray(self.scan_mm, float)
        if scan.ndim != 2 or scan.shape[1] != 2:
            raise ValueError(f"a station's scan is (N, 2) mm in its floor frame, got shape {scan.shape}")
        set_frozen(self, pose=finite_array(self.pose, (3,), "pose"), scan_mm=scan[np.isfinite(scan).all(axis=1)])
        set_frozen(self, laser_mm=finite_array(self.laser_mm, (2,), "laser_mm"))
        set_frozen(self, covariance=finite_array(self.covariance, (3, 3), "covariance"))

    def to_map(self, points_mm: Array) -> Array:
        """Points (..., 2) of its floor frame in the map, mm."""
        c, s = np.cos(self.pose[2]), np.sin(self.pose[2])
        return np.asarray(points_mm) @ np.array([[c, s], [-s, c]]) + self.pose[:2]


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


@dataclass(frozen=True, eq=False)
class Map:
    """Objects, walls and stations in one frame.

    Attributes
    ----------
    objects : tuple of MapObject
        By their distance from the map's origin.
    walls : tuple of MapWall
        The one with the most readings first.
    stations : tuple of Station
    warnings : tuple of str
        Sightings that disagree, sizes that nobody saw.
    """

    objects: tuple[MapObject, ...]
    walls: tuple[MapWall, ...]
    stations: tuple[Station, ...]
    warnings: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the objects: A, B, C, ..."""
        return tuple(chr(65 + k % 26) + str(k // 26 or "") for k in range(len(self.objects)))

    @property
    def things(self) -> tuple[MeasuredObject, ...]:
        """The objects alone."""
        return tuple(found.thing for found in self.objects)

    @property
    def volume_l(self) -> tuple[float, float]:
        """Volume of all objects whose sizes are known, and its standard deviation, litres."""
        return self._total(lambda thing: thing.volume_l)

    @property
    def surface_m2(self) -> tuple[float, float]:
        """Area of their sides and tops, and its standard deviation, m^2."""
        return self._total(lambda thing: thing.surface_m2)

    @property
    def readings_mm(self) -> Array:
        """All stations' readings, (N, 2) mm."""
        return np.concatenate([station.to_map(station.scan_mm) for station in self.stations])

    def _total(self, of: Callable[[MeasuredObject], tuple[float, float]]) -> tuple[float, float]:
        known = np.array([of(thing) for thing in self.things if np.isfinite(of(thing)).all()])
        if not len(known):
            raise ValueError("the map has no object of which all three sizes are known: nothing to add up")
        return float(known[:, 0].sum()), float(np.sqrt((known[:, 1] ** 2).sum()))


def merge(
    stations: Sequence[Station],
    *,
    rng: np.random.Generator,
    gate: float = 4.0,
    max_size_mm: float = 800.0,
    least_wall_mm: float = 700.0,
) -> Map:
    """Merge what several stations measured into one map.

    Parameters
    ----------
    stations : sequence of Station
        Their poses known, or refined by `stereolib.scan_matching.refine_poses`.
    rng : numpy.random.Generator
        For the walls.
    gate : float
        In standard deviations: how far sightings of one thing may lie apart, and what counts as a disagreement.
    max_size_mm : float
        Deepest object that two opposite faces are joined to.
    least_wall_mm : float
        Straight stretches that are longer are walls.

    Raises
    ------
    ValueError
        If there is no station, or neither an object nor a wall in all of them.
    """
    if not stations:
        raise ValueError("a map needs at least one station (a pose, and what was measured there); none was given")
    objects = _objects(stations, gate, max_size_mm)
    walls = find_walls(stations, [f.thing for f in objects], rng=rng, least_mm=least_wall_mm)
    if not objects and not walls:
        readings = sum(len(station.scan_mm) for station in stations)
        raise ValueError(
            f"the map is empty: none of the {len(stations)} stations measured an object, and their {readings} readings "
            f"make no wall of {least_wall_mm:g} mm. See the warnings of the single measurements, or go nearer"
        )
    found = Map(tuple(objects), tuple(walls), tuple(stations), ())
    warnings = [] if objects else [f"no object: none of the {len(stations)} stations measured one"]
    for name, each in zip(found.names, objects, strict=True):
        warnings += [f"{name}: {text}" for text in each.conflicts]
        unknown = (
            (size, each.thing.reasons[size]) for size in ("length", "width", "height") if size in each.thing.reasons
        )
        warnings += [f"{name}: its {size} is unknown, {reason}" for size, reason in unknown]
    return Map(found.objects, found.walls, found.stations, tuple(warnings))


def _objects(stations: Sequence[Station], gate: float, max_size_mm: float) -> list[MapObject]:
    """Sightings grouped, two faces before single ones, the surer first; each group is one object."""
    seen = [
        Sighting.of(k, thing, station.pose, station.covariance)
        for k, station in enumerate(stations, start=1)
        for thing in station.objects
        if np.isfinite(thing.position_mm).all()
    ]
    rank = {"box": 0, "circle": 0, "irregular": 1, "face": 2}
    groups: list[MapObject] = []
    for sighting in sorted(seen, key=lambda s: (rank[s.seen.shape], s.spread_mm)):
        near = [
            k
            for k, group in enumerate(groups)
            if sighting.station not in {s.station for s in group.sightings}
            and same_thing(group, sighting, gate=gate, max_size_mm=max_size_mm)
        ]
        if near:
            off = [np.linalg.norm(groups[k].thing.position_mm - sighting.values[:2]) for k in near]
            k = near[int(np.argmin(off))]
            groups[k] = merged([*groups[k].sightings, sighting], gate=gate)
        else:
            groups.append(merged([sighting], gate=gate))
    return sorted(groups, key=lambda group: float(np.linalg.norm(group.thing.position_mm)))


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
    order = np.argsort(t)
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
    return MapWall(
        ends, (kinds[0], kinds[1]), wall.normal, wall.offset_mm, wall.offset_std_mm, wall.angle_std_rad, wall.rms_mm,
        wall.readings,
    )  # fmt: skip


def _distance_mm(points: Array, outline: Array) -> Array:
    """Distance of points from an outline; negative inside. (N,)."""
    finite = outline[np.isfinite(outline).all(axis=1)].astype(np.float32)
    if len(finite) < 2:
        return np.full(len(points), np.inf)
    hull = cv2.convexHull(finite) if len(finite) > 2 else finite[:, None]
    return -np.array([cv2.pointPolygonTest(hull, (float(x), float(y)), True) for x, y in points])
