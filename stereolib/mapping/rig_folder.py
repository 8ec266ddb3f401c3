"""A folder of one's own rig: boards, pairs, scans, and ``rig.toml``, which says what they are."""

from __future__ import annotations

import difflib
import glob
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from os import PathLike
from pathlib import Path
from shlex import quote
from typing import Any, TypeVar

from stereolib.base import UInt8, counted, listed, read_toml, write_atomic
from stereolib.calibration import (
    JUDGED_AT_MM,
    LENS_MODELS,
    MIN_PAIRS,
    Board,
    BoardViews,
    Charuco,
    Checkerboard,
    Diagnosis,
    diagnose,
    find_in_files,
    rig_covariance,
    save_calibration,
)
from stereolib.mapping.asked_length import AskedLength
from stereolib.mapping.station_folder import (
    CALIBRATION,
    POSES,
    RecordedStation,
    known_poses,
    list_stations,
    name_scans,
    no_scans,
    pair_stations,
)
from stereolib.measurement import Instrument, SystematicUncertainty, save_laser_pose
from stereolib.rig import PairFile, find_pairs, read_pair

_Result = TypeVar("_Result")
RIG_FILE = "rig.toml"
#: What a folder holds, and where unless its file says otherwise.
RIG_FOLDERS = {"boards": "boards", "pairs": "pairs", "scans": "scans"}
#: Everything that a rig's file may say, by part.
_ENTRIES = {
    "board": ("inner_corners", "square_mm", "marker_mm", "dictionary", "legacy"),
    "cameras": ("at_mm", "ruler_mm", "model"),
    "recordings": tuple(RIG_FOLDERS),
    "length": ("pair", "from", "to", "rectified", "ruler_mm"),
}
_LEAST_MM = 1.0  # nothing shorter is meant in millimetres


@dataclass(frozen=True)
class RigFolder:
    """What a folder of a rig holds.

    Attributes
    ----------
    folder : Path
    board : Checkerboard, Charuco or None
        None where there are no boards, and nothing is said of one.
    at_mm : float
        Where the calibration is judged.
    ruler_mm : float or None
        Distance of the lenses by a ruler.
    model : str
        Of the lens.
    boards : tuple of PairFile
    stations : tuple of RecordedStation
        Pairs and scans, by name.
    lengths : tuple of AskedLength
    absent : tuple of str
        What is not there, and what is left out for it.
    """

    folder: Path
    board: Board | None
    at_mm: float
    ruler_mm: float | None
    model: str
    boards: tuple[PairFile, ...]
    stations: tuple[RecordedStation, ...]
    lengths: tuple[AskedLength, ...]
    absent: tuple[str, ...]

    @cached_property
    def views(self) -> BoardViews | None:
        """Corners of the boards, kept beside the pictures; None where there are too few pairs of them."""
        if not self.boards or self.board is None:
            return None
        left, right = zip(*self.boards, strict=True)
        return find_in_files(left, right, self.board, progress=False)

    def read_boards(self) -> tuple[list[tuple[UInt8, UInt8]], list[str]]:
        """Read the pictures of the board.

        Returns
        -------
        pairs : list of (left, right)
            Each (H, W, 3) uint8.
        names : list of str

        Raises
        ------
        ValueError
            If there are none, or one cannot be read.
        """
        if not self.boards:
            raise ValueError(f"{self.folder} holds no pairs of a board, so that nothing can be calibrated")
        return [read_pair(*files) for files in self.boards], [files.left.name for files in self.boards]

    def calibrate(self) -> Diagnosis | None:
        """Calibrate with the boards.

        Returns
        -------
        Diagnosis or None
            None where there are no boards.

        Raises
        ------
        ValueError
            As `find_in_files` and `diagnose`.
        """
        if self.views is None:
            return None
        return diagnose(self.views, model=self.model, ruler_mm=self.ruler_mm, at_mm=self.at_mm)

    def instrument(self, diagnosis: Diagnosis | None) -> Instrument | None:
        """Make an instrument of the folder's own ``calibration.json``, if it is there, else of the boards.

        Parameters
        ----------
        diagnosis : Diagnosis or None
            From `calibrate`.

        Returns
        -------
        Instrument or None
            None where neither is there, or the cameras cannot be rectified. Only a file knows where the laser stands.

        Raises
        ------
        ValueError
            If that file cannot be used.
        """
        if (own := self.folder / CALIBRATION).is_file():
            return Instrument.load(own)
        if diagnosis is None or diagnosis.unrectified:
            return None
        rectified = diagnosis.rig.rectify()
        if not diagnosis.rectified_std:
            return Instrument(rectified)
        return Instrument(rectified, None, SystematicUncertainty.of(rectified, rig_covariance(diagnosis.fit)))

    def save_calibration(self, path: str | PathLike[str], diagnosis: Diagnosis) -> Path:
        """Write the calibration of the boards, with the laser's pose where the folder's own calibration knows it.

        Parameters
        ----------
        path : path
        diagnosis : Diagnosis
            From `calibrate`.

        Returns
        -------
        Path

        Raises
        ------
        ValueError
            If the folder's own ``calibration.json`` cannot be used.
        """
        own = self.folder / CALIBRATION
        lidar = Instrument.load(own).lidar if own.is_file() else None
        save_calibration(path, diagnosis)
        return Path(path) if lidar is None else save_laser_pose(path, lidar)

    def __str__(self) -> str:
        pairs, scans = (sum(bool(getattr(each, what)) for each in self.stations) for what in ("left", "scan"))
        boards = f"{counted(len(self.boards), 'pair')} of the board"
        return f"{boards}, {counted(pairs, 'pair')} to measure, {counted(scans, 'scan')}"


def write_demo_file(folder: str | PathLike[str]) -> Path:
    """Write the ``rig.toml`` of the demo rig, the virtual rig's recordings.

    Parameters
    ----------
    folder : path
        Where they are.

    Returns
    -------
    Path
    """
    typed = "`stereolib report data/virtual --output demo_report`"
    values: dict[str, Any] = {"about": f"The virtual rig, taken for one of which nothing is known: {typed}."}
    values |= {"square_mm": [25.0, 25.0], "ruler_mm": 93.0, "pairs": "room/*.jpg", "scans": "room/*.bin"}
    asked = AskedLength("3", ((299, 368), (298, 218)), 240.0), AskedLength("2", ((313, 380), (225, 121)), 336.0)
    return write_rig_file(Path(folder) / RIG_FILE, lengths=asked, **values)


def write_rig_file(path: str | PathLike[str], **values: Any) -> Path:
    """Write a ``rig.toml`` with a comment at every entry.

    Parameters
    ----------
    path : path
    **values
        ``about`` (a sentence), ``corners``, ``square_mm``, ``at_mm``, ``ruler_mm``, ``boards``, ``pairs``, ``scans``,
        ``lengths`` (of `AskedLength`): in place of what stands there else.

    Returns
    -------
    Path
    """
    from jinja2 import Environment, PackageLoader

    page = Environment(loader=PackageLoader("stereolib.mapping", "."), autoescape=False, keep_trailing_newline=True)
    usual: dict[str, Any] = {"corners": [9, 6], "at_mm": JUDGED_AT_MM, **RIG_FOLDERS}
    return write_atomic(path, page.get_template("rig.toml.jinja").render(usual | values))


def load_rig_folder(folder: str | PathLike[str], *, with_boards: bool = True) -> RigFolder:
    """Read what a rig's folder holds.

    Parameters
    ----------
    folder : path
        With ``rig.toml`` in it.
    with_boards : bool
        Look for boards, of which the file must then say what they are.

    Returns
    -------
    RigFolder

    Raises
    ------
    ValueError
        If there is no such folder or file, the file says something else than it should, or recordings cannot be
        paired. The text names the file and the remedy.
    """
    folder = Path(folder)
    if folder.is_file():
        raise ValueError(f"{folder} is a file: name the folder of your rig; stereolib new my_rig makes one")
    new = f"stereolib new {quote(str(folder))}"
    if not folder.is_dir():
        raise ValueError(f"{folder} is no folder: {new} makes one")
    if not (folder / RIG_FILE).is_file():
        raise ValueError(f"{folder} has no {RIG_FILE}, which says what lies there: {new} writes one")
    said = _Said(folder / RIG_FILE, f"{new} writes another" if with_boards else "then the folder alone is asked")
    places = {kind: said.text("recordings", kind, usual) for kind, usual in RIG_FOLDERS.items()}
    model = said.text("cameras", "model", "brown3")
    if model not in LENS_MODELS:
        raise said.wrong("cameras", "model", f"unknown lens model {model!r}; choose one of {', '.join(LENS_MODELS)}")
    boards = _pairs(folder, places["boards"]) if with_boards else ()
    if 0 < len(boards) < MIN_PAIRS:
        raise ValueError(
            f"{folder / places['boards']}: {counted(len(boards), 'pair')} of the board; at least {MIN_PAIRS} with "
            f"different tilts are needed, and 15 to 30 give a trustworthy rig"
        )
    pairs, scans_at = _pairs(folder, places["pairs"]), folder / places["scans"]
    scans = sorted(scans_at.iterdir() if scans_at.is_dir() else _matching(folder, places["scans"]))
    stations, alone = pair_stations(pairs, name_scans(scans))
    stations = known_poses(stations, folder / POSES)
    lengths, names = said.lengths(), [station.name for station in stations if station.left]
    for length in lengths:
        if length.pair not in names:
            raise said.wrong("length", "pair", f"there is no pair {length.pair!r}, only {listed(names) or 'none'}")
    at_mm, ruler = said.length("cameras", "at_mm", JUDGED_AT_MM), said.length("cameras", "ruler_mm")
    board = said.board() if boards else None
    lonely = [station.scan.name for station in alone if station.scan] if pairs else []
    has_boards, is_calibrated = bool(boards) or not with_boards, (folder / CALIBRATION).is_file()
    absent = [*_absent(places, has_boards, is_calibrated, stations, lonely, no_scans(scans))]
    if not pairs and (pattern := lying_there(folder).get("pairs")):
        lie = "left/ and right/" if pattern == "." else pattern
        absent.append(f'pairs lie in {folder}, {lie}: write pairs = "{pattern}" into its {RIG_FILE}, or move them')
    known = tuple(stations), lengths, tuple(absent)
    return RigFolder(folder, board, at_mm or JUDGED_AT_MM, ruler, model, boards, *known)


def _absent(
    places: Mapping[str, str],
    boards: bool,
    calibrated: bool,
    stations: Sequence[RecordedStation],
    alone: Sequence[str],
    others: Sequence[str],
) -> Iterator[str]:
    """What is not there, and what is left out for it."""
    if not boards:
        without = f"its {CALIBRATION} is taken as it is, without a verdict"
        nothing = f"no calibration and no verdict, and without {CALIBRATION} no lengths either"
        yield f"nothing in {places['boards']}: {without if calibrated else nothing}"
    if not any(station.left for station in stations):
        yield f"nothing in {places['pairs']}: no sizes, and no depth but that of a board"
    if not any(station.scan for station in stations):
        yield f"{'no scan' if others else 'nothing'} in {places['scans']}: no word about the laser"
    if others:
        ask = "name a recording of the laser .bin, a table of angles and ranges .csv"
        yield f"{listed(others)} in {places['scans']} is no .bin or .csv: not read; {ask}"
    if alone:
        yield f"no pair is named like {listed(alone)}: used by themselves"


def lying_there(folder: str | PathLike[str]) -> dict[str, str]:
    """Tell how pairs and scans that lie in a folder itself are named in its ``rig.toml``.

    Parameters
    ----------
    folder : path

    Returns
    -------
    dict of str to str
        Patterns of ``"pairs"`` and ``"scans"``, as ``"*.jpg"``; ``"."`` of pairs in its folders left/ and right/. What
        one pattern would not name is left out.
    """
    folder = Path(folder)
    try:
        stations = list_stations(folder).stations
    except ValueError:  # there are none
        return {}
    kinds = {"pairs": [each.left for each in stations], "scans": [each.scan for each in stations]}
    files = {kind: [path for path in paths if path and path.parent == folder] for kind, paths in kinds.items()}
    ends = {kind: {path.suffix for path in paths} for kind, paths in files.items()}
    found = {kind: f"*{next(iter(known))}" for kind, known in ends.items() if len(known) == 1}
    in_sides = any(each.left and each.left.parent.parent == folder for each in stations)
    return found | ({"pairs": "."} if in_sides else {})


def tried(work: Callable[..., _Result], *given: Any) -> tuple[_Result | None, str]:
    """Do a step that one's own recordings may not allow.

    Parameters
    ----------
    work : callable
    *given
        What it takes.

    Returns
    -------
    result : object or None
        None where the recordings did not allow it.
    why_not : str
        Why; empty where they did.

    Examples
    --------
    >>> tried(float, "2.5"), tried(float, "two")[0]
    ((2.5, ''), None)
    """
    try:
        return work(*given), ""
    except ValueError as error:
        return None, str(error)


class _Said:
    """A rig's file, its entries asked for one by one."""

    def __init__(self, path: Path, without: str) -> None:
        self.path = path
        try:
            self.parts = read_toml(path)
        except ValueError as error:
            raise ValueError(f"{error}; mend it there, or move the file away: {without}") from None
        for part, entries in self.parts.items():
            self._known(part, _ENTRIES, "part")
            tables, head = (entries, "[[length]]") if part == "length" else ([entries], f"[{part}]")
            if not isinstance(tables, list) or not all(isinstance(table, Mapping) for table in tables):
                raise ValueError(f"{path}: {part} is a part of its own, {head}, with entries below it")
            for name in chain.from_iterable(tables):
                self._known(name, _ENTRIES[part], f"entry of [{part}]")

    def _known(self, name: str, names: Sequence[str] | Mapping[str, Any], what: str) -> None:
        if name not in names:
            near = difflib.get_close_matches(name, list(names), 1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(names)}"
            raise ValueError(f"{self.path}: {name!r} is no {what}; {hint}")

    def wrong(self, part: str, name: str, why: str) -> ValueError:
        return ValueError(f"{self.path}: [{part}] {name}: {why}")

    def text(self, part: str, name: str, usual: str) -> str:
        value = self.parts.get(part, {}).get(name, usual)
        if not isinstance(value, str) or not value.strip():
            raise self.wrong(part, name, f"a text is expected, as {usual!r}, got {value!r}")
        return value

    def length(self, part: str, name: str, usual: float | None = None) -> float | None:
        return self._millimetres(self.parts.get(part, {}).get(name, usual), part, name)

    def _millimetres(self, value: Any, part: str, name: str) -> float | None:
        if value is None:
            return None
        if not _is_number(value) or not math.isfinite(value) or value < _LEAST_MM:
            raise self.wrong(part, name, f"a number of millimetres is expected, {_LEAST_MM:g} or more, got {value!r}")
        return float(value)

    def _flag(self, entries: Mapping[str, Any], part: str, name: str) -> bool:
        if not isinstance(value := entries.get(name, False), bool):
            raise self.wrong(part, name, f"true or false is expected, got {value!r}")
        return value

    def _two(self, value: Any, part: str, name: str, expected: str) -> tuple[Any, Any]:
        if not (isinstance(value, list) and len(value) == 2 and all(map(_is_number, value))):
            raise self.wrong(part, name, f"{expected}, got {value!r}")
        return value[0], value[1]

    def board(self) -> Board:
        """The board; its own checks speak with the file's name."""
        part = self.parts.get("board", {})
        if "square_mm" not in part:
            raise self.wrong("board", "square_mm", "say how large a square is, by a ruler: take away the # before it")
        columns, rows = self._two(
            part.get("inner_corners"), "board", "inner_corners", "columns and rows are expected, as [9, 6]"
        )
        edges = part["square_mm"]
        is_legacy = self._flag(part, "board", "legacy")
        one_or_two = "a length or two are expected, as 25 or [24.9, 25.1]"
        width, height = (edges, edges) if _is_number(edges) else self._two(edges, "board", "square_mm", one_or_two)
        try:
            if (marker := self.length("board", "marker_mm")) is None:
                return Checkerboard(columns, rows, (width + height) / 2, height / width)
            if width != height:
                raise ValueError(f"a ChArUco board's squares are taken for square, got {edges}")
            dictionary = self.text("board", "dictionary", "5X5_100")
            return Charuco(columns, rows, width, marker, dictionary, is_legacy)
        except (ValueError, TypeError, ZeroDivisionError) as error:
            raise ValueError(f"{self.path}: [board]: {error}") from None

    def lengths(self) -> tuple[AskedLength, ...]:
        found = []
        for entry in self.parts.get("length", []):
            pixel = "a column and a row are expected, as [320, 240]"
            ends = tuple(self._two(entry.get(name), "length", name, pixel) for name in ("from", "to"))
            ruler = self._millimetres(entry.get("ruler_mm"), "length", "ruler_mm")
            is_rectified = self._flag(entry, "length", "rectified")
            found.append(AskedLength(str(entry.get("pair", "")), (ends[0], ends[1]), ruler, is_rectified))
        return tuple(found)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _matching(folder: Path, pattern: str) -> list[Path]:
    """Files of a pattern, which may lead out of the folder."""
    return [folder / name for name in glob.glob(pattern, root_dir=folder)]


def _pairs(folder: Path, place: str) -> tuple[PairFile, ...]:
    """Pairs of a folder or a pattern; none where it is missing or empty."""
    at = folder / place
    if at.is_dir() and not any(not path.name.startswith(".") for path in at.iterdir()):
        return ()
    if not at.exists() and not _matching(folder, place):
        return ()
    return tuple(find_pairs(at))
