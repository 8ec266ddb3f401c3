"""The map: what several stations measured, brought together (sections I and V, the paper's future work).

A station is a place of the rig on the floor. Its objects, seen from other places too, are merged; its scan's straight
stretches are walls. The map's frame is that of the poses: x forward, y left, z up, mm.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from stereolib.base import Float64, counted, rounded
from stereolib.mapping.sightings import (
    GATE,
    MAX_SIZE_MM,
    MapObject,
    Sighting,
    is_within,
    may_be_same,
    merge_sightings,
)
from stereolib.mapping.stations import Station, station_names
from stereolib.mapping.walls import LEAST_WALL_MM, MapWall, find_walls
from stereolib.measurement import SIZE_NAMES, MeasuredObject, Why

if TYPE_CHECKING:
    import pandas as pd

_ON_MM = 30.0  # from an outline: the middle of a face that is seen alone lies on it
_WALL_MM = 60.0  # what lies nearer to a wall belongs to it


class NothingToMap(ValueError):
    """No station shows an object or a wall."""


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
    said : tuple of str
        Sightings that disagree, and what was left out.
    """

    objects: tuple[MapObject, ...]
    walls: tuple[MapWall, ...]
    stations: tuple[Station, ...]
    said: tuple[str, ...]

    @property
    def warnings(self) -> tuple[str, ...]:
        """All that is to be said of it: what did not fit together, then the sizes that nobody saw."""
        unknown = (
            f"{name}: its {size} is unknown, {each.reasons[size]}"
            for name, each in zip(self.names, self.measured, strict=True)
            for size in SIZE_NAMES
            if size in each.reasons
        )
        return *self.said, *unknown

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the objects: A, B, C, ..."""
        return tuple(chr(65 + k % 26) + str(k // 26 or "") for k in range(len(self.objects)))

    @property
    def measured(self) -> tuple[MeasuredObject, ...]:
        """The objects' sizes and places, without their sightings."""
        return tuple(each.fused for each in self.objects)

    @property
    def volume_l(self) -> tuple[float, float]:
        """Volume of all objects whose sizes are known, and its standard deviation, litres."""
        return self._total(lambda each: each.volume_slope)

    @property
    def surface_m2(self) -> tuple[float, float]:
        """Area of their sides and tops, and its standard deviation, m^2."""
        return self._total(lambda each: each.surface_slope)

    @property
    def readings_mm(self) -> Float64:
        """All stations' readings, (N, 2) mm."""
        return np.concatenate([station.to_map(station.scan_mm) for station in self.stations])

    def names_of(self, number: int) -> list[str]:
        """List what the objects that a station measured are called in the map.

        Parameters
        ----------
        number : int
            Of the station, from 1.

        Returns
        -------
        list of str
            Of what no object was made of: the one in or on whose outline it lies; empty if there is none.
        """
        station, known = self.stations[number - 1], list(zip(self.names, self.measured, strict=True))
        names = []
        for thing in station.objects:
            at_mm = station.to_map(thing.position_mm)
            lies_on = (name for name, each in known if is_within(at_mm, each.outline_mm, _ON_MM))
            names.append(self.name_of(thing, number) or next(lies_on, ""))
        return names

    def name_of(self, thing: MeasuredObject, number: int) -> str:
        """Tell which object of the map was made of one that a station measured.

        Parameters
        ----------
        thing : MeasuredObject
            In the station's floor frame.
        number : int
            Of the station, from 1.

        Returns
        -------
        str
            Its name; empty if it went into none.
        """
        place_mm = self.stations[number - 1].to_map(thing.position_mm)
        for name, each in zip(self.names, self.objects, strict=True):
            seen = [it.measured.position_mm for it in each.sightings if it.station == number]
            if any(np.allclose(position_mm, place_mm) for position_mm in seen):
                return name
        return ""

    def _total(self, of: Callable[[MeasuredObject], tuple[float, Float64]]) -> tuple[float, float]:
        """A sum over all objects; errors of the calibration that they share do not average away in it."""
        known = [each for each in self.measured if np.isfinite(each.size_mm).all()]
        if not known:
            raise ValueError("the map has no object of which all three sizes are known: nothing to add up")
        total, own, common = 0.0, 0.0, np.zeros(known[0].common_mm.shape[1])
        for each in known:
            value, slope = of(each)
            shared = slope @ each.common_mm
            total, common = total + value, common + shared
            own += float(slope @ each.covariance @ slope - shared @ shared)
        return float(total), float(np.sqrt(max(own, 0.0) + common @ common))


def merge_stations(stations: Sequence[Station], *, rng: np.random.Generator) -> Map:
    """Merge what several stations measured into one map.

    Parameters
    ----------
    stations : sequence of Station
        Their poses known, or refined by `refine_poses`.
    rng : numpy.random.Generator
        For the walls.

    Returns
    -------
    Map

    Raises
    ------
    ValueError
        If there is no station.
    NothingToMap
        If there is neither an object nor a wall in all of them.
    """
    if not stations:
        raise ValueError("a map needs at least one station (a pose, and what was measured there); none was given")
    walls = find_walls(stations, rng=rng)
    objects, lost = _objects(stations, walls)
    if objects:  # their readings make no walls
        walls = find_walls(stations, [each.fused for each in objects], rng=rng)
    if not objects and not walls:
        readings = sum(len(station.scan_mm) for station in stations)
        raise NothingToMap(
            f"the map is empty: {counted(len(stations), 'station')} measured no object, and {readings} readings of "
            f"scans make no wall of {LEAST_WALL_MM:g} mm. See the warnings of the single measurements, or go nearer"
        )
    result = Map(tuple(objects), tuple(walls), tuple(stations), ())
    none = [] if objects else [f"no object: {counted(len(stations), 'station')} measured none"]
    apart = [f"{name}: {text}" for name, each in zip(result.names, objects, strict=True) for text in each.conflicts]
    return replace(result, said=(*none, *apart, *lost))


def _objects(stations: Sequence[Station], walls: Sequence[MapWall]) -> tuple[list[MapObject], list[str]]:
    """Sightings grouped, two faces before single ones, the surer first: objects, and what could not be measured."""
    sightings = [
        Sighting.of(k, each, station.pose, station.covariance, name)
        for k, (station, name) in enumerate(zip(stations, station_names(stations), strict=True), start=1)
        for each in station.objects
        if np.isfinite(each.position_mm).all()
    ]
    rank = {"box": 0, "circle": 0, "irregular": 1, "face": 2}
    groups: list[MapObject] = []
    lost = []
    for s in sorted(sightings, key=lambda s: (np.isnan(s.values[3:]).all(), rank[s.measured.shape], s.spread_mm)):
        reach_mm = _WALL_MM + GATE * (s.spread_mm if np.isfinite(s.spread_mm) else 0.0)
        if s.measured.shape != "box" and any(wall.near(s.values[:2], reach_mm) for wall in walls):
            continue  # a piece of wall that stood by itself in a picture
        near = [
            k
            for k, group in enumerate(groups)
            if s.station not in {other.station for other in group.sightings} and may_be_same(group, s)
        ]
        if near:
            off = [np.linalg.norm(groups[k].fused.position_mm - s.values[:2]) for k in near]
            k = near[int(np.argmin(off))]
            groups[k] = merge_sightings([*groups[k].sightings, s])
        elif np.isfinite(s.values[3:]).any():
            groups.append(merge_sightings([s]))
        elif not any(np.linalg.norm(group.fused.position_mm - s.values[:2]) < MAX_SIZE_MM / 2 for group in groups):
            x, y = s.values[:2]
            why = _why_lost(s.measured.reasons)
            where = f"x {rounded(x)}, y {rounded(y)} mm"
            lost.append(f"station {s.name} saw something at {where} and could not measure it: {why}")
    return sorted(groups, key=lambda group: float(np.linalg.norm(group.fused.position_mm))), lost


def _why_lost(reasons: Mapping[str, Why]) -> str:
    """Why nothing of an object was measured: what holds for all of it, else for one of its sizes."""
    whole = reasons.get("object")
    if whole and not whole.reason.leaves_the_pair:
        return str(whole)
    return next((str(reasons[name]) for name in SIZE_NAMES if name in reasons), "no size is known")


def size_table(objects: Sequence[MeasuredObject], names: Sequence[str]) -> pd.DataFrame:
    """Lay out sizes: ``"400.9 ± 0.8"`` mm with one standard deviation, ``"?"`` where unknown.

    Parameters
    ----------
    objects : sequence of MeasuredObject
    names : sequence of str

    Returns
    -------
    pandas.DataFrame
        Columns name, shape, length_mm, width_mm, height_mm, volume_l.
    """
    import pandas as pd

    def text(value: float, std: float, digits: int = 1) -> str:
        return f"{value:.{digits}f} ± {std:.{digits}f}" if np.isfinite(value) else "?"

    rows = []
    for name, each in zip(names, objects, strict=True):
        sizes = [text(*size) for size in zip(each.size_mm, each.std_mm, strict=True)]
        rows.append([name, each.shape, *sizes, text(*each.volume_l, 2)])
    return pd.DataFrame(rows, columns=["name", "shape", "length_mm", "width_mm", "height_mm", "volume_l"])
