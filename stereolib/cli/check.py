"""The command ``stereolib check``: a calibration held against board pictures that it has never seen."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stereolib.base import plus_minus
from stereolib.cli.boards import add_board, board_of, said_of
from stereolib.cli.command import Command
from stereolib.cli.errors import DONE, REFUSED, WRONG_INPUT
from stereolib.cli.outputs import check_ending, check_outputs
from stereolib.cli.told import plain, wrapped

if TYPE_CHECKING:
    from stereolib.calibration import CalibrationCheck, Estimate

_NOTES = """verdict, from boards that the calibration has never seen; one pair is enough, more tell more:
  still good   lengths and depths are right to 0.5 %, rows agree to 0.3 px (of pictures 640 px wide, in proportion for
               wider ones): measure with it
  usable       2 % and 1 px: sizes and depths to a few per cent; calibrate again for more
  recalibrate  beyond that
  no verdict   the board is not flat, and its rows alone say nothing against the calibration

what has moved is named if it is more than four standard deviations: of the calibration, as it states them itself, and
of the noise of the corners. exit code: 0 still good or usable, 1 recalibrate, 2 wrong input or no verdict.

with the virtual boards of this repository, calibrated on the first 24 pairs:
  mkdir left right; cp data/virtual/boards/[01]?_left.jpg data/virtual/boards/2[0-4]_left.jpg left
  cp data/virtual/boards/[01]?_right.jpg data/virtual/boards/2[0-4]_right.jpg right
  stereolib calibrate left right --board 9x6 --square-mm 25 --output rig
  stereolib check data/virtual/boards/2[5-9]_*.jpg --board 9x6 --square-mm 25 --calibration rig/calibration.json"""


def _configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "pairs",
        nargs="+",
        metavar="PAIR",
        help="as for stereolib calibrate: folders, patterns, videos; or files left right left right ...",
    )
    add_board(parser)
    parser.add_argument("--calibration", type=Path, required=True, metavar="FILE", help="the rig's calibration.json")
    parser.add_argument("--picture", type=Path, metavar="PNG", help="draw the board and the rows")
    parser.add_argument("--force", action="store_true", help="replace the picture if it is there")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def _run(arguments: argparse.Namespace) -> int:
    if arguments.picture:
        check_ending(arguments.picture, ".png", "the picture")
        check_outputs([arguments.picture], force=arguments.force, option="--picture")
    board = board_of(arguments)
    left, right = zip(*_pairs(arguments.pairs), strict=True)

    from stereolib.calibration import CalibrationRecord, check_calibration, find_in_files
    from stereolib.rig import StereoRig

    rig = StereoRig.load(arguments.calibration)
    record = CalibrationRecord.load(arguments.calibration, rig)
    said = said_of(arguments.calibration, board.square_mm, (board.columns, board.rows))
    try:
        views = find_in_files(left, right, board, progress=sys.stderr.isatty())
        check = check_calibration(rig, views, record=record)
    except ValueError as error:
        raise ValueError("; ".join([str(error), *said])) from error
    if arguments.picture:
        from stereolib.base import write_atomic
        from stereolib.plotting import check_figure, show_figure

        write_atomic(arguments.picture, show_figure(None, check_figure(check)).data)
    for text in said:
        print(f"warning: {text}", file=sys.stderr)
    print(json.dumps(_facts(check), indent=1, allow_nan=False) if arguments.json else wrapped(_lines(check)))
    if arguments.picture and not arguments.json:
        print(f"picture: {arguments.picture}")
    return {"recalibrate": REFUSED, "no verdict": WRONG_INPUT}.get(check.verdict, DONE)


def _pairs(sources: Sequence[str]) -> Sequence[tuple[Path, Path]]:
    """A recording of both cameras, one of each, or files two by two."""
    from stereolib.rig import find_pairs

    paths = [Path(source) for source in sources]
    if len(sources) <= 2:
        return find_pairs(*sources)
    if folders := [path for path in paths if path.is_dir()]:
        raise ValueError(f"{folders[0]} is a folder: expected one or two of them, or files only")
    if len(paths) % 2:
        raise ValueError(f"{paths[-1]} has no partner: expected left right left right ..., got {len(paths)} in all")
    pairs = list(zip(paths[::2], paths[1::2], strict=True))
    if twice := [path for path in paths if [other.resolve() for other in paths].count(path.resolve()) > 1]:
        raise ValueError(f"{twice[0]} was given twice: expected left right left right ..., each picture once")
    return pairs


def _facts(check: CalibrationCheck) -> dict[str, Any]:
    """All numbers, ready for JSON."""
    from stereolib.calibration import MOVEMENTS

    def told(estimate: Estimate) -> dict[str, float | None]:
        return {"value": plain(estimate.value), "std": plain(estimate.std)}

    movement = check.movement
    facts: dict[str, Any] = {"verdict": check.verdict, "findings": check.findings, "notes": check.notes}
    facts |= {"pairs": check.views.names, "pairs_refused": check.pairs_refused, "not_found": check.views.missing}
    facts |= {"distance_mm": [plain(distance) for distance in check.distance_mm]}
    facts |= {"square_pct": told(check.square_pct), "board_pct": told(check.board_pct)}
    facts |= {"flat_rms_mm": plain(check.flat_rms_mm), "flat_worst_mm": plain(check.flat_worst_mm)}
    facts |= {"bend_mm": {name: told(bend) for name, bend in check.bend_mm.items()}}
    facts |= {"row_rms_px": plain(check.row_rms_px), "row_offset_px": told(check.row_offset_px)}
    facts |= {"row_slope_px": told(check.row_slope_px)}
    facts |= {"checks": [one._asdict() for one in check.checks], "moved": [one._asdict() for one in movement.named]}
    fitted = zip(MOVEMENTS, movement.values.tolist(), movement.std.tolist(), strict=False)
    return facts | {"fitted_together": {name: {"value": value, "std": std} for name, value, std in fitted}}


def _lines(check: CalibrationCheck) -> list[str]:
    """The verdict, what speaks for and against it, and the numbers."""
    from stereolib.calibration import CHECK_MEANINGS

    near, far = check.distance_mm.min(), check.distance_mm.max()
    where = f"{near:.0f} mm" if near == far else f"{near:.0f} to {far:.0f} mm"
    bends = ", ".join(f"{plus_minus(*bend)} {name}" for name, bend in check.bend_mm.items())
    lines = [f"{check.verdict}: {CHECK_MEANINGS[check.verdict]}"]
    lines += [f"  {text}" for text in check.findings] + [f"  note: {text}" for text in check.notes]
    count = len(check.views)
    lines += [f"{count} pair{'s' * (count > 1)} ({', '.join(check.views.names)}), the board at {where}"]
    lines += [f"size: squares {_signed(check.square_pct)}, the longer side {_signed(check.board_pct)}"]
    lines += [f"flatness: {check.flat_rms_mm:.2f} mm rms, worst {check.flat_worst_mm:.2f} mm; bent by {bends} (mm)"]
    offset, slope = (plus_minus(*estimate) for estimate in (check.row_offset_px, check.row_slope_px))
    rows = f"off by {offset} px in the middle, by {slope} px more from left to right"
    lines += [f"rows: {check.row_rms_px:.2f} px rms, {rows}"]
    return lines + [f"the board was not found in both views of {name}" for name in check.views.missing]


def _signed(size: Estimate) -> str:
    return f"{plus_minus(abs(size.value), size.std)} % too {'large' if size.value > 0 else 'small'}"


CHECK = Command(
    "check",
    "hold a calibration against fresh pictures of the board: is it still good, and what has moved",
    "stereolib check left.jpg right.jpg --board 9x6 --square-mm 25 --calibration rig/calibration.json",
    _run,
    _configure,
    notes=_NOTES,
    interrupted="the boards found so far are kept: run it again and it goes on from there",
)
