"""A folder of one's own recordings: which files belong to which station, read and refused by name.

``1_left.png`` and ``1_right.png`` are the pair of station 1, ``1_scan.bin`` or ``1_scan.csv`` its scan; one of both is
enough, and pairs may be named as `stereolib.rig.find_pairs` reads them. ``calibration.json`` describes the rig,
``poses.csv`` the poses that are known.
"""

from __future__ import annotations

import csv
import math
import re
import reprlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path

import numpy as np

from stereolib.base import Float64, UInt8, check_name, counted, read_text
from stereolib.calibration import CAPTURE_NOTES
from stereolib.laser import LaserScan, average, read_recording, turns
from stereolib.rig import PICTURES, PairFile, find_pairs, pair_name, pair_sides, read_pair

CALIBRATION, POSES, SCANS = "calibration.json", "poses.csv", "scans"
_SIDES = {"left", "right"}
_SCANS = (".bin", ".csv")
_SCAN_WORDS = {"scan", "laser", "lidar", "lrf"}
_POSE_COLUMNS, _SCAN_COLUMNS = ("station", "x_mm", "y_mm", "yaw_deg"), ("angle_deg", "range_mm")
_MOST = 1e7  # mm, degrees: ten kilometres
_METRES_POSES = 20.0  # and places that all lie nearer to the origin: stations stand a metre or so apart
_NEAREST_MM = 150.0  # nearer hardly a reading of such a laser is
_METRES = 60.0  # ranges in millimetres that are all less were told in metres: no laser of this kind sees so near
_LEAST_BEAMS = 30  # of a scan
_LEAST_TURNS = 3  # that may stand for a whole one, if each of them lost a packet
_UNEVEN = 0.01  # share of a step by which beams of a file may stand off their even places


class NoStation(ValueError):
    """A folder holds no recordings of a station."""


@dataclass(frozen=True)
class RecordedStation:
    """The files of one station.

    Attributes
    ----------
    name : str
    left, right : Path or None
        Its pair, or neither.
    scan : Path or None
    pose : (x_mm, y_mm, yaw_rad) or None
        Of its floor frame in the map, where it is known.
    """

    name: str
    left: Path | None = None
    right: Path | None = None
    scan: Path | None = None
    pose: tuple[float, float, float] | None = None

    def read_pair(self, size: tuple[int, int]) -> tuple[UInt8, UInt8] | None:
        """Read its pictures.

        Parameters
        ----------
        size : (width, height), px
            That of the calibration.

        Returns
        -------
        left, right : (H, W, 3) uint8, or None

        Raises
        ------
        ValueError
            If they cannot be read, or are of another size.
        """
        if self.left is None or self.right is None:
            return None
        pair = read_pair(self.left, self.right)
        if (found := pair[0].shape[1::-1]) != size:
            which = f"{self.left} is {found[0]}x{found[1]}, the calibration is for {size[0]}x{size[1]}"
            raise ValueError(f"{which}: take all pictures in that size, or calibrate again in this one")
        return pair

    def read_scan(self) -> LaserScan | None:
        """Read its scan.

        Returns
        -------
        LaserScan or None

        Raises
        ------
        ValueError
            As `read_scan`.
        """
        return None if self.scan is None else read_scan(self.scan)


def read_scan(path: str | PathLike[str]) -> LaserScan:
    """Read a scan: the median of all turns of a recording, or a table of angles and ranges.

    Parameters
    ----------
    path : path
        As `stereolib.laser.record_port` writes it; or a .csv with the columns ``angle_deg,range_mm``.

    Returns
    -------
    LaserScan
        Where every turn lost a packet, of what is left of three at least.

    Raises
    ------
    ValueError
        If it is no recording, most of it is damaged, it holds no whole turn, or its columns are no scan.
    """
    path = Path(path)
    if path.suffix.lower() == ".csv":
        return _scan_of_table(path)
    try:
        found = turns(read_recording(path))
        return average(found, complete_only=len(found) < _LEAST_TURNS or any(turn.complete for turn in found))
    except ValueError as error:
        text = str(error)
        raise ValueError(text if text.startswith(str(path)) else f"{path}: {text}") from None


@dataclass(frozen=True)
class StationFolder:
    """What is in a folder of recordings.

    Attributes
    ----------
    stations : tuple of RecordedStation
        In the order of their numbers, or names.
    unused : tuple of str
        Files that belong to no station.
    """

    stations: tuple[RecordedStation, ...]
    unused: tuple[str, ...] = field(default=())


def list_stations(folder: str | PathLike[str], poses: str | PathLike[str] | None = None) -> StationFolder:
    """Find the stations of a folder.

    Parameters
    ----------
    folder : path
    poses : path, optional
        Default: ``poses.csv`` in the folder, if it is there.

    Returns
    -------
    StationFolder

    Raises
    ------
    ValueError
        If there is no folder or no station in it, a picture has no partner, a station has two files of one kind, or
        the poses cannot be used.

    Examples
    --------
    >>> from stereolib.base import data_path
    >>> found = list_stations(data_path("virtual/room/1_scan.bin").parent)
    >>> [station.name for station in found.stations], found.stations[0].left.name
    (['1', '2', '3', '4', '5'], '1_left.jpg')
    """
    folder, poses = Path(folder), None if poses is None else Path(poses)
    if not folder.is_dir():
        raise ValueError(
            f"{folder} is no folder: expected one with 1_left.png, 1_right.png, 1_scan.bin, 2_left.png, ..."
        )
    pictures, scans, unused = list[Path](), list[Path](), list[str]()
    own = {CALIBRATION, POSES, CAPTURE_NOTES}
    own |= {poses.name} if poses and poses.resolve().parent == folder.resolve() else set()
    for path in sorted(path for path in folder.iterdir() if path.is_file() and not path.name.startswith(".")):
        is_scan = "scan" in pair_name(path).split()
        is_named = is_scan or path.suffix.lower() == ".bin" or _names_a_side(path)
        if path.suffix.lower() in _SCANS and is_named:
            scans.append(path)
        elif path.suffix.lower() in PICTURES:
            if is_scan:
                raise ValueError(f"{path}: the scan of a station is {' or '.join(_SCANS)}; name it so, or move it away")
            pictures.append(path)
        elif path.name not in own and path.with_suffix("") not in scans:  # 1_scan.bin has 1_scan.bin.json
            unused.append(path.name)
    for path in (*pictures, *scans):
        check_name(path)
    pairs, others = pair_sides(pictures, str(folder))
    if not pairs and {path.name for path in folder.iterdir() if path.is_dir()} >= _SIDES:
        pairs = find_pairs(folder)
    further = _files(folder / SCANS)
    unused += [f"{SCANS}/{name}" for name in no_scans(further)]
    stations, _ = pair_stations(pairs, name_scans([*scans, *further]))
    if not stations:
        raise NoStation(
            f"{folder} holds no station: expected 1_left.png and 1_right.png (a pair), 1_scan.bin or 1_scan.csv (a "
            f"scan), then 2_left.png, and so on"
        )
    stations = known_poses(stations, poses or folder / POSES, needed=poses is not None)
    return StationFolder(tuple(stations), tuple(sorted([*unused, *(path.name for path in others)])))


def name_scans(files: Iterable[str | PathLike[str]]) -> dict[str, Path]:
    """Tell of each recording of the laser to which pair it belongs by name.

    Parameters
    ----------
    files : iterable of path
        Others than .bin and .csv are left out.

    Returns
    -------
    dict of str to Path
        By the pair's name, as `pair_name` tells it.

    Raises
    ------
    ValueError
        If two are of one pair, or one is named as a camera's picture.

    Examples
    --------
    >>> sorted(name_scans([Path("02_scan.bin"), Path("door.csv"), Path("notes.txt")]))
    ['2', 'door']
    """
    found: dict[str, Path] = {}
    for path in (path for path in map(Path, files) if path.suffix.lower() in _SCANS):
        if _names_a_side(path):
            raise ValueError(f"{path}: a side of a station is a picture (PNG, JPEG, ...); name it so, or move it away")
        words = pair_name(path).split()
        name = " ".join(word for word in words if word not in _SCAN_WORDS)
        if name in found:
            twice = f"{found[name].name} and {path.name}"
            station = f"station {name}" if name else "a station"
            raise ValueError(f"{station} has two files for its scan, {twice}: keep one")
        found[name] = path
    return found


def no_scans(files: Iterable[Path]) -> list[str]:
    """Tell which files `name_scans` leaves out, but for hidden ones and the notes beside a recording.

    Parameters
    ----------
    files : iterable of Path

    Returns
    -------
    list of str
        Their names, sorted.

    Examples
    --------
    >>> no_scans([Path("1.bin"), Path("1.bin.json"), Path("2.txt")])
    ['2.txt']
    """
    others = [path for path in files if path.suffix.lower() not in _SCANS and not path.name.startswith(".")]
    return sorted(path.name for path in others if path.with_suffix("").suffix.lower() not in _SCANS)


def pair_stations(
    pairs: Sequence[PairFile], scans: Mapping[str, Path]
) -> tuple[list[RecordedStation], list[RecordedStation]]:
    """Bring pairs and scans of one name together, or of one number where no name agrees.

    Parameters
    ----------
    pairs : sequence of PairFile
    scans : mapping of str to Path
        As `name_scans` makes it.

    Returns
    -------
    stations : list of RecordedStation
        In the order of their numbers, or names.
    alone : list of RecordedStation
        Those of them that are scans without a pair.
    """
    by_name = {pair_name(pair.left): pair for pair in pairs}
    left_over = dict(scans)
    found = {name: left_over.pop(name, None) for name in by_name}
    numbers = [_numbers_of(name) for name in by_name]
    for name in by_name:
        same = [scan for scan in left_over if _numbers_of(scan) == _numbers_of(name) != ()]
        if found[name] is None and len(same) == 1 and numbers.count(_numbers_of(name)) == 1:
            found[name] = left_over.pop(same[0])
    stations = [RecordedStation(name, *by_name[name], scan) for name, scan in found.items()]
    alone = [RecordedStation(name, scan=scan) for name, scan in left_over.items()]
    return sorted([*stations, *alone], key=lambda station: _by_number(station.name)), alone


def known_poses(
    stations: Sequence[RecordedStation], path: str | PathLike[str], *, needed: bool = False
) -> list[RecordedStation]:
    """Give stations the poses of a file.

    Parameters
    ----------
    stations : sequence of RecordedStation
    path : path
        As ``poses.csv``.
    needed : bool
        Whether it must be there.

    Returns
    -------
    list of RecordedStation

    Raises
    ------
    ValueError
        If it cannot be used.
    """
    path = Path(path)
    if not (needed or path.is_file()):
        return list(stations)
    known = _read_poses(path, [station.name for station in stations])
    return [replace(station, pose=known.get(station.name)) for station in stations]


def _names_a_side(path: Path) -> bool:
    return bool(set(re.findall("[a-z]+", path.stem.lower())) & _SIDES)


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.is_file()) if folder.is_dir() else []


def _numbers_of(name: str) -> tuple[int, ...]:
    return tuple(map(int, re.findall(r"\d+", name)))


def _by_number(name: str) -> list[tuple[int, int, str]]:
    parts = re.findall(r"\d+|\D+", name)
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts]


def _read_poses(path: Path, names: Iterable[str]) -> dict[str, tuple[float, float, float]]:
    """Poses by station; every one of them must be there."""
    found: dict[str, tuple[float, float, float]] = {}
    names = list(names)
    for line, row in _table(path, _POSE_COLUMNS):
        name = pair_name(row[0].strip())
        if name not in names:
            raise ValueError(f"{path}, line {line}: there is no station {reprlib.repr(name)}, only {', '.join(names)}")
        if name in found:
            raise ValueError(f"{path}, line {line}: the pose of station {name} stands there twice: keep one")
        x, y, yaw = _numbers(path, line, row[1:])
        found[name] = (x, y, math.radians(yaw))
    most = max((abs(mm) for pose in found.values() for mm in pose[:2]), default=0.0)
    if len(found) > 1 and 0 < most < _METRES_POSES:
        why = f"x_mm and y_mm are {most:g} at most, as if in metres: millimetres are asked for"
        raise ValueError(f"{path}: {why} (of stations on one spot write 0)")
    return found


def _table(path: Path, columns: tuple[str, ...]) -> list[tuple[int, list[str]]]:
    """Rows of a file with a known head, each with its line's number."""
    try:
        lines = list(csv.reader(read_text(path).splitlines()))
    except csv.Error as error:
        raise ValueError(f"{path}: not a table of {','.join(columns)} ({error})") from None
    head = tuple(cell.strip().lower() for cell in lines[0]) if lines else ()
    if head != columns:
        commas = ": commas between columns, points in numbers" if set(",".join(head)) & set(";\t") else ""
        which = f"its first line must be {','.join(columns)}; it is {reprlib.repr(','.join(head))}{commas}"
        raise ValueError(f"{path}: {which}")
    rows = [(k, row) for k, row in enumerate(lines[1:], start=2) if any(cell.strip() for cell in row)]
    for line, row in rows:
        if len(row) != len(columns):
            wanted = f"{len(columns)} values are expected ({','.join(columns)}; points in numbers)"
            raise ValueError(f"{path}, line {line}: {wanted}, got {reprlib.repr(row)}")
    return rows


def _numbers(path: Path, line: int, cells: Iterable[str], *, empty: float | None = None) -> list[float]:
    values = []
    for cell in cells:
        try:
            value = empty if empty is not None and not cell.strip() else float(cell)
        except ValueError:
            value = math.inf
        if value is None or abs(value) > _MOST or (math.isnan(value) and empty is None):
            raise ValueError(
                f"{path}, line {line}: {reprlib.repr(cell.strip())} is no number up to {_MOST:g}"
            ) from None
        values.append(value)
    return values


def _scan_of_table(path: Path) -> LaserScan:
    """A turn as angles, counter-clockwise from ahead, and ranges; 0 or nothing where none was measured."""
    rows = [_numbers(path, line, row, empty=math.nan) for line, row in _table(path, _SCAN_COLUMNS)]
    if len(rows) < _LEAST_BEAMS:
        raise ValueError(f"{path}: {counted(len(rows), 'beam')}: too few for a scan; a turn of an XV-11 has 360")
    angles, ranges = np.array(rows).T
    if (ranges < 0).any():
        why = (
            f"range_mm is {ranges[ranges < 0][0]:g} at {angles[ranges < 0][0]:g} degrees, a distance is never negative"
        )
        raise ValueError(f"{path}: {why}; leave it empty where nothing was measured")
    if 0 < (most := float(np.nanmax(ranges, initial=0.0))) < _METRES:
        raise ValueError(f"{path}: range_mm is {most:g} at most, as if in metres: millimetres are asked for")
    if np.ptp(angles) <= 2 * np.pi:
        turn = f"angle_deg runs from {angles.min():.3g} to {angles.max():.3g} only"
        raise ValueError(f"{path}: {turn}, as if in radians: degrees are asked for")
    start, step = _even_angles(path, np.radians(angles))
    _check_ranges(path, ranges[ranges > 0])
    return LaserScan(ranges, np.full(len(ranges), np.nan), angle_min_rad=start, angle_increment_rad=step)


def _check_ranges(path: Path, read: Float64) -> None:
    """Refuse readings in centimetres, and those of no place at all."""
    if read.size and (middle := float(np.median(read))) < _NEAREST_MM:
        why = f"half of range_mm is {middle:.3g} or less, nearer than such a laser reads, as if in centimetres"
        raise ValueError(f"{path}: {why}: millimetres are asked for")
    if read.size and np.ptp(read) == 0:
        why = f"range_mm is {read[0]:g} in all {len(read)} beams with a reading, as no room is round about a laser"
        raise ValueError(f"{path}: {why}: record again, or see what wrote the file")


def _even_angles(path: Path, angles: Float64) -> tuple[float, float]:
    """First angle and step of a scan, rad."""
    step = float(angles[-1] - angles[0]) / (len(angles) - 1)
    off = np.abs(angles - angles[0] - step * np.arange(len(angles)))
    if not (step > 0 and off.max() < _UNEVEN * step and step * (len(angles) - 1) < 2 * np.pi):
        raise ValueError(
            f"{path}: angle_deg must grow in even steps (counter-clockwise, 0 ahead) within one turn; leave range_mm "
            f"empty where nothing was measured"
        )
    return float(angles[0]), step
