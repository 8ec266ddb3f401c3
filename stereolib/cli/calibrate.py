"""The command ``stereolib calibrate``: pictures of a board in, a rig and its report out."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from shlex import quote

from stereolib.base import counted
from stereolib.cli.boards import add_board, add_recording, board_of, recording_of
from stereolib.cli.command import Command
from stereolib.cli.errors import DONE, REFUSED, turns_named
from stereolib.cli.outputs import check_outputs
from stereolib.cli.ranges import MM, number
from stereolib.cli.told import say_on_a_terminal

#: Kind of file that `stereolib.rig` saves -> its names, and how many lens coefficients it holds at most.
_FORMATS = {"opencv": (["opencv.yml"], 14), "ros": (["left.yaml", "right.yaml"], 8), "kalibr": (["camchain.yaml"], 4)}
_NEAREST_MM = 50.0  # nearer no two cameras see the same
_NO_RULER = "does a ruler say so? Give its reading as --ruler-mm: it tells mistyped squares"
_NOTES = """verdict, by the errors of depth and of length at --at-mm (one standard deviation, median over the picture):
  good    both are up to 0.5 %: measure with it
  usable  up to 2 %: measure with it, to 2 %; mend what is named for more
  bad     beyond that, or nothing can be said of the errors: do not measure with it
What makes these errors untrue counts as well: a lens model too short, squares of boards left out that come out wrong
or not as high as wide (by the same limits); a ruler that contradicts, or, without one, squares by which the lenses
stand nearer than 15 mm or farther apart than 500 mm; a rig that moved, cameras that cannot be rectified or do not
overlap there, a lens that folds where boards were seen (bad). All else is advice, at most three lines, to be followed
in their order; --json has the rest.

exit code: 0 good or usable, 1 bad, 2 wrong input. Boards found are kept in .stereolib_corners beside the pictures, so
that a second run does not search again; delete that folder at will."""


def _configure(parser: argparse.ArgumentParser) -> None:
    add_recording(parser)
    add_board(parser)
    parser.add_argument(
        "--model",
        default="brown3",
        help="lens: pinhole, brown2, brown3 (default), rational8, thin_prism12 or tilted14",
    )
    parser.add_argument(
        "--ruler-mm", type=number(1, MM), metavar="MM", help="distance of the lenses by a ruler: a check"
    )
    parser.add_argument(
        "--at-mm",
        type=number(_NEAREST_MM, MM),
        default=1000.0,
        metavar="MM",
        help="where you measure: judged there (default: 1000)",
    )
    parser.add_argument("--output", type=Path, default=Path(), metavar="DIR", help="default: this folder")
    parser.add_argument(
        "--format", action="append", default=[], choices=list(_FORMATS), help="write the rig for another tool as well"
    )
    parser.add_argument("--force", action="store_true", help="replace files that are there")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def _run(arguments: argparse.Namespace) -> int:
    others = {kind: [arguments.output / name for name in _FORMATS[kind][0]] for kind in arguments.format}
    written = [arguments.output / name for name in ("calibration.json", "report.html")]
    written += [path for paths in others.values() for path in paths]
    if in_the_way := [path for path in (arguments.output, *arguments.output.parents) if path.is_file()]:
        raise ValueError(f"--output must name a folder, but {in_the_way[0]} is a file")
    check_outputs(written, force=arguments.force, option="--output")
    board = board_of(arguments)
    from stereolib.calibration import (
        LENS_MODELS,
        MIN_PAIRS,
        calibration_facts,
        calibration_text,
        check_first_boards,
        check_sides,
        diagnose,
        find_in_files,
        save_calibration,
    )
    from stereolib.mapping import beside_ruler
    from stereolib.plotting import write_calibration_report
    from stereolib.rig import formats

    pairs = recording_of(arguments, MIN_PAIRS)
    if arguments.model not in LENS_MODELS:  # before the boards are searched for
        raise ValueError(f"unknown lens model {arguments.model!r}; choose one of {', '.join(LENS_MODELS)}")
    for kind in others:
        if LENS_MODELS[arguments.model][0] > (most := _FORMATS[kind][1]):
            fits = [name for name, (count, _) in LENS_MODELS.items() if count <= most]
            raise ValueError(f"--format {kind} cannot hold a {arguments.model} lens: pass --model {fits[-1]}")
    left, right = zip(*pairs, strict=True)
    given = " and ".join(filter(None, (arguments.left, arguments.right)))
    with turns_named(left + right):
        check_first_boards(pairs, board, given, progress=sys.stderr.isatty())
    views = find_in_files(left, right, board, progress=sys.stderr.isatty())
    with turns_named(left + right):
        check_sides(views, given)
    if len(views) < MIN_PAIRS:
        raise ValueError(
            f"the board of {arguments.board} inner corners was found in both views of only "
            f"{counted(len(views), 'pair')} ({', '.join(views.names)}), not in {', '.join(views.missing)}: at least "
            f"{MIN_PAIRS} are needed, 15 to 30 give a trustworthy rig; is the board's size right?"
        )
    say_on_a_terminal(f"calibrating with {counted(len(views), 'pair')} ...")
    with turns_named(left + right):
        result = diagnose(views, model=arguments.model, ruler_mm=arguments.ruler_mm, at_mm=arguments.at_mm)
    say_on_a_terminal("drawing the report, in some seconds ...")
    write_calibration_report(written[1], result, dict(zip((path.name for path in left), pairs, strict=True)))
    save_calibration(written[0], result)
    for kind, paths in others.items():
        getattr(formats, f"save_{kind}")(*paths, result.rig)
    if arguments.json:
        print(json.dumps(calibration_facts(result), indent=1, allow_nan=False))
    else:
        print(calibration_text(result))
        found_mm, ruler_mm = result.rig.baseline_mm, arguments.ruler_mm
        ruler = _NO_RULER if ruler_mm is None else beside_ruler(found_mm, ruler_mm)
        print(f"distance of the lenses {found_mm:.1f} mm; {ruler}")
        print(f"written: {' '.join(map(str, written))}")
        if result.verdict != "bad":
            rig, page = (quote(str(path)) for path in written[:2])
            print(f"next: open {page}; then stereolib measure LEFT RIGHT --calibration {rig}")
    return REFUSED if result.verdict == "bad" else DONE


CALIBRATE = Command(
    "calibrate",
    "calibrate a stereo camera from pictures of a checkerboard, and say how far to trust it",
    "stereolib calibrate left right --board 9x6 --square-mm 30 --output rig",
    _run,
    _configure,
    notes=_NOTES,
    interrupted="the boards found so far are kept: run it again and it goes on from there",
)
