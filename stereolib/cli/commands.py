"""All commands of ``stereolib COMMAND``, and the parser that is made of them."""

from __future__ import annotations

import argparse
import io
import os
import re
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from stereolib import __version__
from stereolib.cli.bake import BAKE
from stereolib.cli.board import BOARD
from stereolib.cli.calibrate import CALIBRATE
from stereolib.cli.calibrate_laser import CALIBRATE_LASER
from stereolib.cli.capture import CAPTURE
from stereolib.cli.check import CHECK
from stereolib.cli.command import Command
from stereolib.cli.data import DATA
from stereolib.cli.disparity import DISPARITY
from stereolib.cli.emulate_cameras import EMULATE_CAMERAS
from stereolib.cli.errors import WRONG_INPUT, as_wide_as_the_terminal, calibration_named, guarded
from stereolib.cli.explore import EXPLORE
from stereolib.cli.handout import HANDOUT
from stereolib.cli.lrf import LRF
from stereolib.cli.map import MAP
from stereolib.cli.measure import MEASURE
from stereolib.cli.new import NEW
from stereolib.cli.report import REPORT
from stereolib.cli.reproduce import REPRODUCE

COMMANDS = (
    REPRODUCE, EXPLORE, BAKE, DATA, NEW, REPORT, BOARD, CAPTURE, EMULATE_CAMERAS, CALIBRATE, CHECK, CALIBRATE_LASER,
    DISPARITY, MEASURE, MAP, LRF, HANDOUT,
)  # fmt: skip


#: OpenCV and the video library in it write notes of their own about damaged files; ours are enough.
_QUIET = {"OPENCV_LOG_LEVEL": "SILENT", "OPENCV_FFMPEG_LOGLEVEL": "-8"}


class _Parser(argparse.ArgumentParser):
    """A parser that refuses words in one line, as all other input is refused, and takes -1,2,3 for no option."""

    def __init__(self, *words: Any, **options: Any) -> None:
        super().__init__(*words, **options)
        self._negative_number_matcher = re.compile(r"-\.?\d")  # as Python has it from 3.14 on

    def error(self, message: str) -> NoReturn:
        if message.endswith("expected 2 arguments"):
            message += ", with a blank between them, neither of which begins with a minus"
        line = f"stereolib: error: {message}; see {self.prog} --help"
        self.exit(WRONG_INPUT, as_wide_as_the_terminal(line) + "\n")


def _add(commands: Sequence[Command], parser: argparse.ArgumentParser) -> None:
    choices = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in commands:
        child = choices.add_parser(
            command.name,
            help=command.summary,
            description=command.summary[0].upper() + command.summary[1:] + ".",
            epilog="\n\n".join(
                filter(None, (command.notes, "\n  ".join(("example:", *command.before, command.example))))
            ),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        if command.configure:
            command.configure(child)
        if command.commands:
            _add(command.commands, child)
        else:
            child.set_defaults(run=command.run, interrupted=command.interrupted, parser=child)


def make_parser() -> argparse.ArgumentParser:
    """Make the parser of the whole command line from `COMMANDS`.

    Returns
    -------
    argparse.ArgumentParser
    """
    parser = _Parser(
        prog="stereolib",
        description="Object dimensions from two webcams and a laser range finder: a paper, reproduced.",
        epilog="example:\n  stereolib reproduce",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"stereolib {__version__}")
    _add(COMMANDS, parser)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    argv : sequence of str, optional
        The words after ``stereolib``; default: those of this process.

    Returns
    -------
    int
        Exit code: 0 done, 1 the work says no, 2 wrong input, 130 interrupted.
    """
    for variable, silence in _QUIET.items():
        os.environ.setdefault(variable, silence)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal that has no ± gets its code: no work ends for that
            stream.reconfigure(errors="backslashreplace")
    arguments, unknown = make_parser().parse_known_args(argv)
    if empty := [word for word in (sys.argv[1:] if argv is None else argv) if not word.rpartition("=")[2].strip()]:
        which = f"nothing stands behind {empty[0]}" if empty[0].strip() else "an argument is empty"
        arguments.parser.error(f"{which}: give its value (a shell's variable that is not set leaves nothing)")
    if unknown:  # said by the command's own parser, whose help lists its options
        arguments.parser.error(f"unrecognized arguments: {' '.join(unknown)}")

    def run() -> int:
        with calibration_named(getattr(arguments, "calibration", None)):
            return int(arguments.run(arguments))

    return guarded(run, arguments.interrupted)
