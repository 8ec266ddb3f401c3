"""Where stations stand that nobody told the pose of: each scan is tried everywhere on the map (Olson 2009).

A place is good if readings fall onto what the other scans saw from the same side, and bad if they fall where a beam
went through; and the same the other way round: what stands in a room tells it from itself turned by half a turn.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from stereolib.base import Bools, Float64, rounded, turn_2d, wrap_rad
from stereolib.mapping.occupancy import FREE, OCCUPIED, OccupancyGrid, occupancy_grid
from stereolib.mapping.scan_matching import refine_poses
from stereolib.mapping.stations import Station, station_names

_CELL_MM = 50.0  # of the grids that scans are laid over: `refine_poses` mends several times as much
_TURN_RAD = np.deg2rad(2.0)  # between tried directions: 100 mm at 3 m
_BESIDE = 0.6  # what a reading beside a taken cell counts
_PLACES_A_TURN, _PLACES = 3, 6  # best places of each direction, and of all that are refined
_APART_MM, _APART_RAD = 250.0, np.deg2rad(10.0)  # places that are farther apart are not the same
_AGREES_MM = 50.0  # from what is taken, at most
_SIDE_MM = 150.0  # before and behind a reading: which side of what is taken the others saw
_OPPOSES_MM = 100.0  # within the free, at least: beams that pass along a face free the cells before it
_OPPOSED = 3.0  # what a reading where a beam went through counts against one that agrees
_LEAST_AGREEING = 0.35  # share of a scan's readings that lie on what others saw, from the same side
_MOST_OPPOSED = 0.05  # share of two scans' common readings: what was moved between them, and mixed readings
_BY_NOISE = 0.01  # the same share where nothing was moved
_RIVAL = 0.7  # share of the best place's votes that makes another one its rival
_DECIDE = 12  # readings: places that are opposed by so many more are wrong; noise and moved things make fewer
_HELP = "add a station between, or give its pose, to 50 mm and 3 degrees"
_PARTNERS = 4  # nearest stations that a place is refined with


@dataclass(frozen=True, eq=False)
class Placing:
    """Stations at their poses, and those that have none.

    Attributes
    ----------
    stations : tuple of Station
        In the order they were given.
    left_out : dict
        Why a station could not be placed, by its name.
    warnings : tuple of str
        Poses that were given and that the scans do not hold.
    """

    stations: tuple[Station, ...]
    left_out: dict[str, str]
    warnings: tuple[str, ...]


def place_stations(stations: Sequence[Station], known: Collection[str] = ()) -> Placing:
    """Find the poses of stations by their scans.

    Parameters
    ----------
    stations : sequence of Station
        No two with one name; those without are called by their number among all, from 1.
    known : collection of str
        Names of those whose pose is known, to some 50 mm and 3 degrees if they have a scan, else exactly. The first of
        them with a scan keeps its pose; where none is known, the first station with a scan is the map's origin.

    Returns
    -------
    Placing
        Yaws that were found lie within half a turn of zero.

    Raises
    ------
    ValueError
        If there is no station, or two have one name.

    Notes
    -----
    Stations are placed one after the other, each where it fits those that are placed and nowhere else nearly as well;
    who does not fit yet is tried again when more are placed. Beams that went through rule a place out, however much
    agrees there; the next best is taken only if next to nothing opposes it. In the end all poses are refined together,
    without those, last ones first, that leave them open.
    """
    if not stations:
        raise ValueError("a map needs at least one station, none was given")
    names = station_names(stations)
    stations = [s if s.name else replace(s, name=name) for s, name in zip(stations, names, strict=True)]
    if twice := [name for name in names if names.count(name) > 1]:
        raise ValueError(f"{len(twice)} stations are named {twice[0]!r}: give each a name of its own")
    scanned = [s for s in stations if len(s.scan_mm)]
    stays = [s for s in stations if s.name in known and not len(s.scan_mm)]
    given = [s for s in scanned if s.name in known]
    lost = [s for s in scanned if s.name not in known]
    if not given and not stays:  # the map begins where the first one stands
        first = replace((scanned or list(stations))[0], pose=np.zeros(3))
        given, lost = [first], [s for s in lost if s.name != first.name]
    placed, given, loose = _grown(given[:1], given[1:], _held)
    stays += given
    placed, lost, why = _grown(placed, lost, _found)
    placed, apart = _refined_together(placed)
    why |= apart
    loose |= {name: text for name, text in apart.items() if name in known}
    stays += [s for s in stations if s.name in apart and s.name in known]
    poses = {s.name: s if s.name in known else _wrapped(s) for s in (*placed, *stays)}
    warnings = [f"station {name} stays at the pose that was given for it: {text}" for name, text in loose.items()]
    left_out = {s.name: why.get(s.name, _untied(s)) for s in stations if s.name not in poses}
    return Placing(tuple(poses[s.name] for s in stations if s.name in poses), left_out, tuple(warnings))


def _wrapped(station: Station) -> Station:
    """A station whose yaw was found, within half a turn of zero."""
    yaw = float(station.pose[2])
    return station if -np.pi <= yaw < np.pi else replace(station, pose=np.append(station.pose[:2], wrap_rad(yaw)))


def _untied(station: Station) -> str:
    """Why nothing ties a station to the others."""
    if len(station.scan_mm):
        return "no station of a known pose has a scan that this one could be laid over: give its pose"
    return "it has no scan to be placed by: give its pose"


def _grown(
    placed: Sequence[Station],
    waiting: Sequence[Station],
    find: Callable[[Sequence[Station], _Ground, Station], Station],
) -> tuple[list[Station], list[Station], dict[str, str]]:
    """Stations placed one after the other until none of those that wait finds its place; these, and why."""
    placed, waiting, why = list(placed), list(waiting), dict[str, str]()
    more = bool(placed)
    while more and waiting:
        more, ground = False, _Ground.of(placed)
        for station in waiting:
            try:
                placed.append(find(placed, ground, station))
            except ValueError as error:
                why[station.name] = str(error)
                continue
            more, waiting = True, [s for s in waiting if s is not station]
            break
    return placed, waiting, {s.name: why[s.name] for s in waiting if s.name in why}


def _refined(placed: Sequence[Station], station: Station) -> Station:
    """A station at the pose that its scan and those of its neighbours hold."""
    near = sorted(placed, key=lambda other: float(np.linalg.norm(other.pose[:2] - station.pose[:2])))
    return refine_poses([*near[:_PARTNERS], station]).stations[-1]


def _refined_together(placed: Sequence[Station]) -> tuple[list[Station], dict[str, str]]:
    """All stations at the poses that all scans hold; who was placed last goes until they do: these, and why."""
    placed, apart = list(placed), dict[str, str]()
    while len(placed) > 1:
        try:
            return list(refine_poses(placed).stations), apart
        except ValueError as error:
            apart[placed.pop().name] = str(error)
    return placed, apart


@dataclass(frozen=True, eq=False)
class _Ground:
    """What some scans saw taken and free, in their frame."""

    grid: OccupancyGrid
    taken_mm: Float64  # distance of each cell from what is taken
    free_mm: Float64  # and from what is not free
    readings_mm: Float64
    beams: Float64  # of the readings, away from the laser

    @classmethod
    def of(cls, stations: Sequence[Station]) -> _Ground:
        grid = occupancy_grid(stations, resolution_mm=_CELL_MM, least_share=0.0)
        masks = (grid.cells != OCCUPIED).astype(np.uint8), (grid.cells == FREE).astype(np.uint8)
        taken, free = (cv2.distanceTransform(mask, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * _CELL_MM for mask in masks)
        readings = np.concatenate([station.to_map(station.scan_mm) for station in stations])
        way = readings - np.concatenate([np.broadcast_to(s.to_map(s.laser_mm), s.scan_mm.shape) for s in stations])
        beams = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1.0)
        return cls(grid, taken.astype(float), free.astype(float), readings, beams)

    @property
    def votes(self) -> Float64:
        """What a reading in each cell tells for a place: (rows, columns)."""
        near = np.where(self.taken_mm <= 1.5 * _CELL_MM, _BESIDE, np.where(self.grid.cells == FREE, -1.0, 0.0))
        return np.where(self.taken_mm == 0, 1.0, near)

    def judge(self, readings_mm: Float64, beams: Float64) -> tuple[Bools, Bools]:
        """Which readings lie on what is taken, seen from the same side, and which where beams went through."""
        cell = np.floor((readings_mm - self.grid.origin_mm) / _CELL_MM).astype(int)
        inside = np.asarray(((cell >= 0) & (cell < self.grid.cells.shape[::-1])).all(axis=1))
        column, row = np.where(inside[:, None], cell, 0).T
        on_taken, in_free = self.taken_mm[row, column] <= _AGREES_MM, self.free_mm[row, column] >= _OPPOSES_MM
        before, behind = (self.grid.at(readings_mm + side * beams) == FREE for side in (-_SIDE_MM, _SIDE_MM))
        return inside & on_taken & (before | ~behind), inside & in_free


@dataclass(frozen=True, eq=False)
class _Place:
    """A station at a pose: readings of both sides that agree with the other, and that oppose it."""

    station: Station
    agree: int
    opposed: int
    share: float
    open_: str = ""

    @property
    def votes(self) -> float:
        """What speaks for the place."""
        return self.agree - _OPPOSED * self.opposed

    def is_opposed(self, most: float = _MOST_OPPOSED) -> bool:
        """Whether too many readings lie where the other side's beams went through."""
        return self.opposed > most * (self.agree + self.opposed)

    def rivals(self, best: _Place) -> bool:
        """Another place that may be the true one: nearly as good as the best one, or not opposed as that one is."""
        if not _differ(self.station.pose, best.station.pose):
            return False
        nearly = self.votes > _RIVAL * best.votes and self.opposed < best.opposed + _DECIDE
        return nearly or (self.share > _LEAST_AGREEING and self.opposed + _DECIDE <= best.opposed)


def _held(placed: Sequence[Station], ground: _Ground, station: Station) -> Station:
    """A station near the pose that was given for it, where its scan and the others hold it."""
    place = _tried(placed, ground, _own_ground(station), station)
    if place.open_:
        raise ValueError(place.open_)
    _check_not_opposed(place, "there", "give its true pose")
    return place.station


def _found(placed: Sequence[Station], ground: _Ground, lost: Station) -> Station:
    """Put a station where it fits the others, and nowhere else nearly as well.

    Most may agree in a place that is opposed: the walls of a room the wrong way round. Either that place is false, or
    it is true and something was moved; the next best one is taken only if noise alone opposes it.
    """
    own = _own_ground(lost)
    places = [_tried(placed, ground, own, replace(lost, pose=pose)) for pose in _candidates(ground, own)]
    places.sort(key=lambda place: -place.votes)
    most = _BY_NOISE if places[0].is_opposed() else _MOST_OPPOSED
    fitting = [place for place in places if place.share >= _LEAST_AGREEING and not place.is_opposed(most)]
    if not fitting:
        _check_not_opposed(places[0], "in the best place", _HELP)
        raise ValueError(
            f"its scan fits nowhere on the map: in the best place {places[0].share:.0%} of its readings lie on what "
            f"other scans saw. Scan where it sees more of that, {_HELP}"
        )
    best = fitting[0]
    rivals = [place for place in places if place.rivals(best)]
    if rivals:
        at = " and ".join(_told(place.station.pose) for place in (best, *rivals[:1]))
        raise ValueError(
            f"its scan fits in more than one place ({at}): give its pose, add a station between, or put something into "
            f"the room that makes it less regular"
        )
    if best.open_:
        raise ValueError(best.open_)
    return best.station


def _own_ground(station: Station) -> _Ground:
    """What a station's own scan saw, in its frame."""
    return _Ground.of([replace(station, pose=np.zeros(3))])


def _check_not_opposed(place: _Place, where: str, remedy: str) -> None:
    """Refuse a place where too many readings lie where the other side's beams went through."""
    if place.is_opposed():
        raise ValueError(
            f"its scan does not fit the map: {where}, {place.opposed} of its readings and theirs lie where the others' "
            f"beams went through, and {place.agree} agree. Scan again if something was moved; else {remedy}"
        )


def _tried(placed: Sequence[Station], ground: _Ground, own: _Ground, station: Station) -> _Place:
    open_ = ""
    try:
        station = _refined(placed, station)
    except ValueError as error:
        open_ = str(error)
    to_map = turn_2d(station.pose[2])
    agree, opposed = ground.judge(station.to_map(own.readings_mm), own.beams @ to_map.T)
    theirs = (ground.readings_mm - station.pose[:2]) @ to_map
    also, against = own.judge(theirs, ground.beams @ to_map)
    count = min(int(also.sum()), int(agree.sum()))
    return _Place(station, int(agree.sum()) + count, int(opposed.sum() + against.sum()), float(agree.mean()), open_)


def _candidates(ground: _Ground, own: _Ground) -> list[Float64]:
    """Poses at which most readings fall onto what is taken: correlations of all directions."""
    votes, reach = ground.votes, int(np.ceil(np.linalg.norm(own.readings_mm, axis=1).max() / _CELL_MM)) + 1
    rows, columns = shape = tuple(cv2.getOptimalDFTSize(size + 2 * reach) for size in votes.shape)
    field, found = np.fft.rfft2(votes, shape), list[tuple[float, Float64]]()
    for turn in np.arange(0, 2 * np.pi, _TURN_RAD):
        cells = np.unique(np.rint(own.readings_mm @ turn_2d(-turn) / _CELL_MM).astype(int), axis=0)
        mask = np.zeros(shape)
        mask[cells[:, 1] % rows, cells[:, 0] % columns] = 1 / len(cells)
        score = np.fft.irfft2(field * np.conj(np.fft.rfft2(mask)), shape)
        for _ in range(_PLACES_A_TURN):
            row, column = (int(k) for k in np.unravel_index(np.argmax(score), shape))
            shift = [column - columns * (column >= columns - reach), row - rows * (row >= rows - reach)]
            place = ground.grid.origin_mm + (np.array(shift) + 0.5) * _CELL_MM
            found.append((float(score[row, column]), np.append(place, turn)))
            around = np.arange(-_APART_MM // _CELL_MM, _APART_MM // _CELL_MM + 1).astype(int)
            score[np.ix_((row + around) % rows, (column + around) % columns)] = -np.inf
    best: list[Float64] = []
    for _, pose in sorted(found, key=lambda each: -each[0]):
        if all(_differ(pose, other) for other in best):
            best.append(pose)
    return best[:_PLACES]


def _differ(one: Float64, other: Float64) -> bool:
    turned = abs(float(wrap_rad(one[2] - other[2], 2 * np.pi)))
    return bool(np.linalg.norm(one[:2] - other[:2]) > _APART_MM or turned > _APART_RAD)


def _told(pose: Float64) -> str:
    return f"x {rounded(pose[0])}, y {rounded(pose[1])} mm, {np.degrees(pose[2]) % 360:.0f} degrees"
