"""The command ``stereolib board``: a calibration board to print."""

from __future__ import annotations

import argparse
from pathlib import Path

from stereolib.cli.boards import parse_board, square_edges
from stereolib.cli.command import Command
from stereolib.cli.errors import DONE
from stereolib.cli.outputs import check_ending, check_outputs
from stereolib.cli.ranges import MM, number

_MARKER = 0.72  # share of a square, if nothing else is asked; the white around it is needed


def _configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", type=Path, default=Path("board.pdf"), metavar="PDF", help="default: board.pdf")
    parser.add_argument("--board", default="9x6", metavar="9x6", help="inner corners, columns x rows (default: 9x6)")
    parser.add_argument("--square-mm", metavar="MM", help="edge of a square (default: the largest that fits)")
    parser.add_argument("--charuco", action="store_true", help="with a marker in each white square: may be cut off")
    parser.add_argument("--marker-mm", type=number(1, MM), metavar="MM", help="edge of a marker: a ChArUco board")
    parser.add_argument("--dictionary", metavar="NAME", help="its markers (default: 5X5_100)")
    parser.add_argument("--paper", default="a4", metavar="NAME", help="a4 (default), letter or a3")
    parser.add_argument("--force", action="store_true", help="replace the file if it is there")


def _run(arguments: argparse.Namespace) -> int:
    check_ending(arguments.out, ".pdf", "the board")
    check_outputs([arguments.out], force=arguments.force, option="--out")
    from stereolib.base import write_atomic
    from stereolib.plotting import BAR_MM, board_sheet, board_words, largest_square_mm, measures

    square_mm, marker_mm = arguments.square_mm, arguments.marker_mm
    if arguments.dictionary and not arguments.charuco and marker_mm is None:
        raise ValueError("--dictionary is about ChArUco boards: add --charuco, or leave it out")
    if square_mm is None:
        any_marker = 1.0 if arguments.charuco or marker_mm is not None else None
        counted = parse_board(arguments.board, "25", any_marker, arguments.dictionary)
        square_mm = f"{largest_square_mm(counted.columns, counted.rows, arguments.paper):g}"
    if arguments.charuco and marker_mm is None:
        marker_mm = round(_MARKER * square_edges(square_mm)[0], 1)
    board = parse_board(arguments.board, square_mm, marker_mm, arguments.dictionary)
    write_atomic(arguments.out, board_sheet(board, arguments.paper))
    print(f"written: {arguments.out}; print it in actual size, and measure it: the bar is {BAR_MM:g} mm long,")
    print(f"{measures(board)}; if not, divide by their number, and give what one square is")
    print(f"then: stereolib capture 0 2 {board_words(board)} --output rig, or of pairs that you have:")
    print(f"stereolib calibrate left right {board_words(board)}")
    return DONE


BOARD = Command(
    "board",
    "write a calibration board to print, true to scale, with a bar to check the printer",
    "stereolib board --out board.pdf --charuco",
    _run,
    _configure,
)
