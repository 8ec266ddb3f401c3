"""Boards as they are given on the command line: their size in words, their pictures in two folders."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from stereolib.cli.outputs import listed

if TYPE_CHECKING:
    from stereolib.calibration import Board

_OTHER_SQUARE = 0.005  # share of an edge: rulers differ by less
_SIDES = {"left", "right", "l", "r"}
_Key = tuple[tuple[bool, int, str], ...]


def add_board(parser: argparse.ArgumentParser) -> None:
    """Add the options that say what a board is."""
    parser.add_argument("--board", required=True, metavar="9x6", help="inner corners, columns x rows")
    parser.add_argument(
        "--square-mm", required=True, metavar="MM", help="edge of a square, or width x height, as 24.9x25.1"
    )
    parser.add_argument("--marker-mm", type=float, metavar="MM", help="edge of a marker, if the board is ChArUco")
    parser.add_argument("--dictionary", default="5X5_100", metavar="NAME", help="its markers (default: 5X5_100)")
    parser.add_argument("--legacy", action="store_true", help="a ChArUco board printed by OpenCV before 4.6")


def board_of(arguments: argparse.Namespace) -> Board:
    """The board of these options."""
    return parse_board(
        arguments.board, arguments.square_mm, arguments.marker_mm, arguments.dictionary, arguments.legacy
    )


def parse_board(
    text: str,
    square_mm: str,
    marker_mm: float | None = None,
    dictionary: str = "5X5_100",
    legacy: bool = False,
) -> Board:
    """A board from ``"9x6"`` inner corners, a square's ``"25"`` or width x height ``"24.9x25.1"``, and its markers.

    Raises
    ------
    ValueError
        If a text is no board's size, or a number no length.
    """
    from stereolib.calibration import Charuco, Checkerboard

    found = re.fullmatch(r"\s*(\d{1,3})\s*[x×X*,]\s*(\d{1,3})\s*", text)
    if not found:
        raise ValueError(f"--board is columns x rows of inner corners, as 9x6 for 10 x 7 squares; got {text!r}")
    columns, rows = int(found[1]), int(found[2])
    try:
        edges = [float(part) for part in re.split("[x×X*]", square_mm)]
    except ValueError:
        edges = []
    if len(edges) not in (1, 2):
        raise ValueError(f"--square-mm is an edge in mm, as 25, or width x height, as 24.9x25.1; got {square_mm!r}")
    for edge in edges:
        if not (math.isfinite(edge) and edge > 0):
            raise ValueError(f"the square's edge must be a positive number of mm, got {edge:g}")
    mean, aspect = sum(edges) / len(edges), edges[-1] / edges[0]
    if marker_mm is None:
        if legacy:
            raise ValueError("--legacy is about ChArUco boards: give the edge of their markers with --marker-mm")
        return Checkerboard(columns, rows, mean, aspect)
    if aspect != 1:
        raise ValueError(f"a ChArUco board's squares are taken for square, got {square_mm}")
    return Charuco(columns, rows, mean, marker_mm, dictionary, legacy)


def said_of(calibration: Path, square_mm: float | None = None) -> list[str]:
    """What is to be said first to whoever uses a rig file: that it was judged bad, or that its squares were others."""
    from stereolib.base import read_json

    notes = read_json(calibration).get("calibration") or {}
    said, square = [], (notes.get("board") or {}).get("square_mm")
    if notes.get("verdict") == "bad":
        said.append(f"{calibration} was judged bad when it was made ({'; '.join(notes.get('reasons') or ['?'])})")
    if square_mm is not None and square is not None and abs(square_mm / square - 1) > _OTHER_SQUARE:
        said.append(
            f"{calibration} was made with squares of {square:g} mm, now they are {square_mm:g} mm: which is right?"
        )
    return said


def pair_files(left: Path, right: Path, *, least: int) -> list[tuple[Path, Path]]:
    """Pair the pictures of two folders by their names, in the order of the numbers in them.

    Names belong together if they agree but for words for the side: ``left03.png`` and ``right03.png``, ``3_L.jpg`` and
    ``3_R.jpg``, ``03.png`` and ``3.png``. Where no name occurs on both sides (time stamps, for instance) and there are
    equally many, they are paired in sorted order. Hidden files and folders are passed over.

    Parameters
    ----------
    left, right : Path
        Folders.
    least : int
        Pairs that there must be.

    Raises
    ------
    ValueError
        If a folder is missing, one given twice or empty, or files are no images, have no partner, share a number or
        are too few; they are listed.
    """
    if left.resolve() == right.resolve():
        raise ValueError(f"{left} was given for both cameras: the left and the right pictures need a folder each")
    named = [_by_key(files) for files in _pictures(left, right)]
    if set(named[0]).isdisjoint(named[1]) and len(named[0]) == len(named[1]):
        return _enough(
            [(named[0][a], named[1][b]) for a, b in zip(sorted(named[0]), sorted(named[1]), strict=True)], least
        )
    alone = [
        f"without a partner in {other}: {_listed(files[key] for key in sorted(set(files) - set(others)))}"
        for files, others, other in ((named[0], named[1], right), (named[1], named[0], left))
        if set(files) - set(others)
    ]
    if alone:
        raise ValueError(
            f"pictures {'; '.join(alone)}. Expected the same names or numbers in both folders, as 01.png in each, or "
            f"left01.png and right01.png: add the partner or move the odd one away"
        )
    return _enough([(named[0][key], named[1][key]) for key in sorted(named[0])], least)


def _enough(pairs: list[tuple[Path, Path]], least: int) -> list[tuple[Path, Path]]:
    if len(pairs) < least:
        raise ValueError(
            f"too few pairs, {len(pairs)} ({_listed(a for a, _ in pairs)}): at least {least} with different tilts "
            f"are needed, and 15 to 30 give a trustworthy rig"
        )
    return pairs


def _pictures(*folders: Path) -> list[list[Path]]:
    """Files of each folder, all of them images."""
    import cv2

    found, others = [], []
    for folder in folders:
        if not folder.is_dir():
            raise ValueError(f"{folder} is no folder: expected one with the pictures of one camera")
        files = [path for path in sorted(folder.iterdir()) if path.is_file() and not path.name.startswith(".")]
        if not files:
            raise ValueError(f"{folder} is empty: expected the pictures of one camera")
        found.append(files)
        if wrong := [path for path in files if not cv2.haveImageReader(str(path))]:
            others.append(f"{folder}: {_listed(wrong)}")
    if others:
        raise ValueError(
            f"files that are no readable images, in {'; in '.join(others)}. Expected only pictures (JPEG, PNG, ...): "
            f"move the others away, copy damaged ones again"
        )
    return found


def _by_key(files: Iterable[Path]) -> dict[_Key, Path]:
    found: dict[_Key, list[Path]] = {}
    for path in files:
        words = re.findall(r"\d+|[A-Z]?[a-z]+|[A-Z]+|[^\W\d_]+", path.stem)
        stripped = (re.sub("left|right", "", word.lower()) for word in words if word.lower() not in _SIDES)
        key = tuple((True, int(word), "") if word.isdecimal() else (False, 0, word) for word in stripped if word)
        found.setdefault(key, []).append(path)
    if twice := [path for paths in found.values() if len(paths) > 1 for path in paths]:
        raise ValueError(f"{_listed(twice)} cannot be told apart by name: expected one number or name for each picture")
    return {key: paths[0] for key, paths in found.items()}


def _listed(files: Iterable[Path]) -> str:
    return listed(path.name for path in files)
