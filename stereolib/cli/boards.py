"""Boards and pairs as they are given on the command line: a board's size in words, what was noted of it."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from stereolib.cli.ranges import MM, number, whole

if TYPE_CHECKING:
    from stereolib.calibration import Board
    from stereolib.rig import PairFile

_OTHER_SQUARE = 0.005  # share of an edge: rulers differ by less


def add_board(parser: argparse.ArgumentParser, *, required: bool = True) -> None:
    """Add the options that say what a board is."""
    parser.add_argument("--board", required=required, metavar="9x6", help="inner corners, columns x rows")
    parser.add_argument(
        "--square-mm", required=required, metavar="MM", help="edge of a square, or width x height, as 24.9x25.1"
    )
    parser.add_argument(
        "--marker-mm", type=number(1, MM), metavar="MM", help="edge of a marker, if the board is ChArUco"
    )
    parser.add_argument("--dictionary", metavar="NAME", help="its markers (default: 5X5_100)")
    parser.add_argument("--legacy", action="store_true", help="a ChArUco board printed by OpenCV before 4.6")


def add_recording(parser: argparse.ArgumentParser) -> None:
    """Add the options that say where pairs of pictures are."""
    parser.add_argument(
        "left",
        metavar="LEFT",
        help="pictures of the left camera: a folder, a pattern in quotes or a video; or of both cameras, by names as "
        "left01 and right01, in folders left and right, or beside each other in one picture",
    )
    parser.add_argument("right", nargs="?", metavar="RIGHT", help="of the right one, by the same names or numbers")
    parser.add_argument(
        "--every",
        type=whole(1, 10**6),
        metavar="N",
        help="of a video: the sharpest of so many frames (default: 60 in all)",
    )


def recording_of(arguments: argparse.Namespace, least: int) -> list[PairFile]:
    """The pairs of these options."""
    from stereolib.rig import find_pairs
    from stereolib.rig.unpacked import VIDEOS

    sources = filter(None, (arguments.left, arguments.right))
    if arguments.every is not None and not any(Path(source).suffix.lower() in VIDEOS for source in sources):
        raise ValueError("--every is about a video, of which it takes frames; of pictures all are taken: leave it out")
    return find_pairs(arguments.left, arguments.right, every=arguments.every, least=least)


def add_pair(parser: argparse.ArgumentParser) -> None:
    """Add the words that name one pair."""
    about = "picture of the left camera; or what holds both: pictures beside each other in one, or a folder of one pair"
    parser.add_argument("left", type=Path, metavar="LEFT", help=about)
    parser.add_argument("right", type=Path, nargs="?", metavar="RIGHT", help="picture of the right camera")


def board_of(arguments: argparse.Namespace) -> Board:
    """The board of these options."""
    return parse_board(
        arguments.board, arguments.square_mm, arguments.marker_mm, arguments.dictionary, arguments.legacy
    )


def parse_board(
    text: str,
    square_mm: str,
    marker_mm: float | None = None,
    dictionary: str | None = None,
    legacy: bool = False,
) -> Board:
    """A board from ``"9x6"`` inner corners, a square's ``"25"`` or width x height ``"24.9x25.1"``, and its markers.

    Raises
    ------
    ValueError
        If a text is no board's size, a number no length, or something is said of markers that the board has not.
    """
    from stereolib.calibration import Charuco, Checkerboard

    found = re.fullmatch(r"\s*(\d{1,3})\s*[x×X*,]\s*(\d{1,3})\s*", text)
    if not found:
        raise ValueError(f"--board is columns x rows of inner corners, as 9x6 for 10 x 7 squares; got {text!r}")
    columns, rows = int(found[1]), int(found[2])
    edges = square_edges(square_mm)
    mean, aspect = sum(edges) / len(edges), edges[-1] / edges[0]
    if marker_mm is None:
        if idle := "--legacy" if legacy else "--dictionary" if dictionary else "":
            remedy = "give the edge of their markers with --marker-mm, or leave it out"
            raise ValueError(f"{idle} is about ChArUco boards: {remedy}")
        return Checkerboard(columns, rows, mean, aspect)
    if aspect != 1:
        raise ValueError(f"a ChArUco board's squares are taken for square, got {square_mm}")
    return Charuco(columns, rows, mean, marker_mm, dictionary or Charuco.dictionary, legacy)


def square_edges(text: str) -> list[float]:
    """The edge of a square, mm, or its width and height.

    Raises
    ------
    ValueError
        If the text is neither, or no camera sees such squares.
    """
    try:
        edges = [float(part) for part in re.split("[x×X*]", text)]
    except ValueError:
        edges = []
    if len(edges) not in (1, 2):
        raise ValueError(f"--square-mm is an edge in mm, as 25, or width x height, as 24.9x25.1; got {text!r}")
    for edge in edges:
        if not 0 < edge <= MM:
            raise ValueError(f"--square-mm must be a positive number of mm, got {edge:g}; {MM:g} at most")
    return edges


def said_of(calibration: Path, square_mm: float | None = None, corners: tuple[int, int] | None = None) -> list[str]:
    """What is to be said first to whoever uses a rig file: that it was judged bad, or that its board was another."""
    from stereolib.rig import calibration_notes

    notes, said = calibration_notes(calibration), []
    board = notes.get("board")
    square = board.get("square_mm") if isinstance(board, Mapping) else None
    if notes.get("verdict") == "bad":
        said.append(
            f"{calibration} was judged bad when it was made ({'; '.join(map(str, notes.get('reasons') or ['?']))})"
        )
    if (
        square_mm is not None
        and isinstance(square, int | float)
        and square > 0
        and abs(square_mm / square - 1) > _OTHER_SQUARE
    ):
        said.append(
            f"{calibration} was made with squares of {square:g} mm, now they are {square_mm:g} mm: which is right?"
        )
    made = (board.get("columns"), board.get("rows")) if isinstance(board, Mapping) else None
    if corners is not None and made is not None and all(made) and {*made} != {*corners}:
        before, now = ("x".join(map(str, each)) for each in (made, corners))
        said.append(f"{calibration} was made with a board of {before} inner corners, now it is {now}: which is right?")
    return said
