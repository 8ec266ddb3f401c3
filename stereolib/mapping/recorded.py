"""From a folder of recordings to its map: every station measured, placed, and merged with the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from stereolib.base import UInt8, listed
from stereolib.calibration import LASER_SCALE_STD, LidarCamera
from stereolib.laser import LaserScan
from stereolib.mapping.assemble import Map, NothingToMap, merge_stations
from stereolib.mapping.placing import place_stations
from stereolib.mapping.shapes import Cloud, colored_cloud, join_clouds
from stereolib.mapping.station_folder import RecordedStation
from stereolib.mapping.stations import Station
from stereolib.measurement import (
    CannotMeasure,
    Instrument,
    Measurement,
    Reason,
    ScanFit,
    Source,
    Why,
    disagreement,
    measure_objects,
)
from stereolib.rig import Camera, StereoRig, rigid

if TYPE_CHECKING:
    from tqdm.auto import tqdm

_CLOUD_STEP, _CLOUD_MM = 4, 2000.0  # every so many pixels; points farther ahead are left out
_EXACT = 1e-6  # mm and rad: the deviation of a place that is so by what it is called
_SEED = 8  # of the walls' search: the same recordings make the same map
_TURNED = (
    "no scan agrees with its pictures: do the laser's angles run counter-clockwise, in degrees, with 0 where the "
    "cameras look, and are its distances in mm? Run calibrate-laser"
)
_OPPOSED = "its scan agrees with nothing that its pictures show"
_NO_PICTURES = Why(Reason.NO_FLOOR, "the station has no pictures")


@dataclass(frozen=True, eq=False)
class RecordedMap:
    """The map of a folder, and what every station gave to it.

    Attributes
    ----------
    room : Map
        Of the stations that have a pose.
    measured : dict of Measurement
        By the stations' names, of those in the map.
    left_out : dict of str
        Why a station is not in the map, by its name.
    warnings : tuple of str
        Of poses.
    apart : dict of Measurement
        By name, of stations that are not in the map and yet measured something.
    """

    room: Map
    measured: dict[str, Measurement]
    left_out: dict[str, str]
    warnings: tuple[str, ...]
    apart: dict[str, Measurement]

    def said_of(self, name: str) -> list[str]:
        """List what is to be said of a station's measurement; of an object, with what the map calls it.

        Parameters
        ----------
        name : str
            Of a station in the map.

        Returns
        -------
        list of str
        """
        found = self.measured[name]
        number = next(k for k, each in enumerate(self.room.stations, start=1) if each.name == name)
        apart = [item for item in found.objects if item.disagrees]
        return [*found.said, *(disagreement(item, self.room.name_of(item, number)) for item in apart)]

    def cloud(self) -> Cloud | None:
        """Make coloured points of all pairs that show the floor.

        Returns
        -------
        Cloud or None
            None if there is no such pair.
        """
        clouds = [
            colored_cloud(each.disparity_px, each.left, each.floor, pose=pose, step=_CLOUD_STEP, max_mm=_CLOUD_MM)
            for pose, each in ((s.pose, self.measured[s.name]) for s in self.room.stations)
            if each.floor is not None
        ]
        return join_clouds(clouds) if clouds else None


def laser_alone() -> Instrument:
    """Make the instrument of a laser without cameras: a station's frame is the laser's own.

    Returns
    -------
    Instrument
        Its cameras are of no rig, and see nothing.
    """
    camera = Camera(np.array([[300.0, 0, 159.5], [0, 300.0, 119.5], [0, 0, 1]]), np.zeros(5), (320, 240))
    axes = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])  # ahead, left and up, of a camera that looks ahead
    covariance = np.diag([_EXACT**2] * 6 + [LASER_SCALE_STD**2])
    laser = LidarCamera(rigid(axes, np.zeros(3)), 0.0, covariance)
    return Instrument(StereoRig(camera, camera, np.eye(3), np.array([-60.0, 0, 0])).rectify(), laser)


def map_recordings(
    stations: Sequence[RecordedStation], instrument: Instrument, *, progress: bool = False
) -> RecordedMap:
    """Measure recorded stations, find their poses, and merge them.

    Parameters
    ----------
    stations : sequence of RecordedStation
    instrument : Instrument
        The calibrated rig they were taken with; `laser_alone`, if no station has pictures.
    progress : bool
        Show a bar.

    Returns
    -------
    RecordedMap

    Raises
    ------
    ValueError
        If no station has files that can all be read and fit the calibration. One that has some is mapped from the
        scan alone, or from the pair; one that has none is left out.
    NothingToMap
        If no station shows an object or a wall; the text says what each one says.
    """
    from tqdm.auto import tqdm

    with tqdm(total=len(stations), desc="measuring", unit="station", disable=not progress, leave=False) as bar:
        return _map(stations, instrument, bar)


def _map(stations: Sequence[RecordedStation], instrument: Instrument, bar: tqdm[Any]) -> RecordedMap:
    """The same, with a bar that is told of each station."""
    size = instrument.rectified.size
    measured, left_out, unread, unfit = dict[str, Measurement](), dict[str, str](), dict[str, str](), dict[str, str]()
    for each in stations:
        try:
            pair, scan, wrong = _read(each, size)
            unread |= {each.name: wrong} if wrong else {}
            measured[each.name] = measure_station(pair, scan, instrument)
        except CannotMeasure as error:
            left_out[each.name] = str(error)
        except ValueError as error:  # of its own files, as one cut short or a pair exchanged: the others may do
            left_out[each.name] = unfit[each.name] = str(error)
        bar.update()
    if (unread or unfit) and not measured.keys() - unread.keys():
        name = next(each.name for each in stations if each.name in unread.keys() | unfit.keys())
        raise ValueError(f"station {name}: {unread.get(name) or unfit[name]}")
    bar.set_description("placing")
    known = {each.name: each.pose for each in stations if each.pose is not None}
    somewhere = [_station(it, known.get(name, (0.0, 0.0, 0.0)), name) for name, it in measured.items()]
    opposed = {name for name, it in measured.items() if it.scan_fit is ScanFit.OPPOSES}
    if not somewhere:
        raise NothingToMap(f"no station could be measured. {_listed(left_out)}")
    placing = place_stations(somewhere, known)
    turned = len(opposed) > 1 and not any(it.scan_fit is ScanFit.AGREES for it in measured.values())
    again = "see the first warning" if turned else "take both again, at one place and moment"
    lost = f"{_OPPOSED}, and nothing tells where it stood: {again}, or give its pose"
    left_out |= placing.left_out | dict.fromkeys(opposed & placing.left_out.keys(), lost)
    left_out |= {name: f"{why}; {left_out[name]}" for name, why in unread.items() if name in left_out}
    bare = [station.name for station in placing.stations if station.name in opposed]
    warnings = *placing.warnings, *(f"station {name}: {_OPPOSED}; the scan is left out of the map" for name in bare)
    warnings = (_TURNED, *warnings) if turned else warnings
    warnings += tuple(
        f"station {name}: {why}; mapped without it" for name, why in unread.items() if name not in left_out
    )
    try:
        room = merge_stations(placing.stations, rng=np.random.default_rng(_SEED))
    except NothingToMap as error:
        said = {name: "; ".join(it.warnings) for name, it in measured.items() if it.warnings}
        raise NothingToMap(f"{error}. {_listed(said | left_out)}") from None
    placed = {s.name: measured[s.name] for s in room.stations}
    apart = {name: it for name, it in measured.items() if name not in placed and it.objects}
    return RecordedMap(room, placed, left_out, warnings, apart)


def _read(station: RecordedStation, size: tuple[int, int]) -> tuple[tuple[UInt8, UInt8] | None, LaserScan | None, str]:
    """A station's pair and scan; where one of them cannot be read the other alone, and what is wrong."""
    pair, scan, wrong = None, None, list[str]()
    try:
        pair = station.read_pair(size)
    except ValueError as error:
        wrong.append(str(error))
    try:
        scan = station.read_scan()
    except ValueError as error:
        wrong.append(str(error))
    if wrong and pair is None and scan is None:
        raise ValueError("; ".join(wrong))
    return pair, scan, "; ".join(wrong)


def _station(measured: Measurement, pose: tuple[float, float, float], name: str) -> Station:
    """A station; where its scan opposes its pictures it may be of another place: then of what the pictures show."""
    station = Station.of(measured, pose, name=name)
    if measured.scan_fit is not ScanFit.OPPOSES:
        return station
    pictured = tuple(item for item in measured.objects if item.sources.get("lines") is not Source.SCAN)
    return replace(station, objects=pictured, scan_mm=np.zeros((0, 2)))


def measure_station(pair: tuple[UInt8, UInt8] | None, scan: LaserScan | None, instrument: Instrument) -> Measurement:
    """Measure a pair and a scan, or one of them.

    Parameters
    ----------
    pair : (left, right), (H, W, 3) uint8, or None
        As the cameras gave them.
    scan : LaserScan or None
    instrument : Instrument

    Returns
    -------
    Measurement
        Without pictures it has no floor and no heights; their reason says why.

    Raises
    ------
    CannotMeasure
        If the pair shows no floor, and there is no scan.
    """
    if pair is not None:
        return measure_objects(*pair, scan, instrument)
    black = np.zeros((*instrument.rectified.size[::-1], 3), np.uint8)  # shows nothing: what is left is the scan's
    measured = measure_objects(black, black, scan, instrument)
    objects = [replace(item, reasons=_without_pictures(item.reasons)) for item in measured.objects]
    return replace(measured, objects=tuple(objects), said=())


def _without_pictures(reasons: Mapping[str, Why]) -> dict[str, Why]:
    return {name: _NO_PICTURES if why.reason is Reason.NO_FLOOR else why for name, why in reasons.items()}


def _listed(why: Mapping[str, str]) -> str:
    """Stations and what is said of them, those together of which the same is said."""
    of = dict[str, list[str]]()
    for name, text in why.items():
        of.setdefault(text, []).append(name)
    return "; ".join(f"station{'s' * (len(names) > 1)} {listed(names)}: {text}" for text, names in of.items())
