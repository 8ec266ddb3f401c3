"""The command line: ``stereolib COMMAND``. A new command is one more `Command` in ``COMMANDS``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from stereolib import __version__
from stereolib.cli.calibrate import CALIBRATE
from stereolib.cli.command import Command
from stereolib.cli.disparity import DISPARITY
from stereolib.cli.lrf import LRF_COMMANDS
from stereolib.cli.measure import CALIBRATE_LASER, MEASURE


def _reproduce_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("names", nargs="*", metavar="NAME", help="notebooks by number or name; default: all")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="notebooks at once (default: 2)")
    outcome = parser.add_mutually_exclusive_group()
    outcome.add_argument("--check", action="store_true", help="compare only; replace no file")
    outcome.add_argument("--accept", action="store_true", help="replace the files although numbers changed")


def _reproduce(arguments: argparse.Namespace) -> int:
    from stereolib.reproduction import REPEAT_RTOL, NotebookError, reproduce

    try:
        changed = reproduce(names=arguments.names, jobs=arguments.jobs, check=arguments.check, accept=arguments.accept)
    except NotebookError as error:
        print(f"stereolib: failed, nothing was replaced\n{error}", file=sys.stderr)
        return 1
    if not changed:
        return 0
    print(f"\nchanged by more than {REPEAT_RTOL:.0%} or one unit of the last digit:", *changed, sep="\n  ")
    if arguments.accept:
        return 0
    print(
        "The committed files are as they were; the new ones are in .staging/ until the next run.\n"
        "If the change is meant: stereolib reproduce --accept",
        file=sys.stderr,
    )
    return 1


def _data_build_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--output", type=Path, metavar="FOLDER", help="default: data/virtual")


def _data_build(arguments: argparse.Namespace) -> int:
    from stereolib.base import datasets
    from stereolib.virtual import build_recordings

    build_recordings(arguments.output or datasets.ROOT / "data" / "virtual")
    return 0


def _data_verify(arguments: argparse.Namespace) -> int:
    import hashlib

    from stereolib.base import datasets

    sums = datasets.data_path("virtual/SHA256SUMS")
    problems = []
    for line in sums.read_text(encoding="utf-8").splitlines():
        known, name = line.split(maxsplit=1)
        path = sums.parent / name.removeprefix("*")
        if not path.is_file():
            problems.append(f"{name} is missing")
        elif hashlib.sha256(path.read_bytes()).hexdigest() != known:
            problems.append(f"{name} differs from its sha256")
    for problem in problems:
        print(f"data/virtual/{problem}; restore it: git checkout -- data, or: stereolib data build")
    if not problems:
        print("every file of data/virtual is as its sha256 says")
    return 1 if problems else 0


def _data_fetch(arguments: argparse.Namespace) -> int:
    from stereolib.base import datasets

    for folder in ("xv11", "minoru3d/left", "minoru3d/right"):
        files = datasets.real_recordings(folder)
        print(f"{files[0].parent}: {len(files)} files, sha256 as expected")
    return 0


COMMANDS = (
    Command(
        "reproduce",
        "execute the notebooks, redraw all figures, and hold every number against the paper's",
        "stereolib reproduce 03 04 --check",
        _reproduce,
        _reproduce_arguments,
        interrupted="the committed files are as they were",
    ),
    Command(
        "data",
        "make, check or fetch the recordings",
        "stereolib data verify",
        commands=(
            Command(
                "build",
                "render the virtual rig's recordings again (some minutes)",
                "stereolib data build",
                _data_build,
                _data_build_arguments,
            ),
            Command(
                "verify",
                "compare the committed recordings with their sha256",
                "stereolib data verify",
                _data_verify,
            ),
            Command(
                "fetch",
                "download the real recordings, or find them in $STEREOLIB_DATA, and say where they are",
                "stereolib data fetch",
                _data_fetch,
            ),
        ),
    ),
    DISPARITY,
    Command(
        "lrf", "read, record, replay or emulate the laser range finder", "stereolib lrf emulate", commands=LRF_COMMANDS
    ),
    CALIBRATE,
    CALIBRATE_LASER,
    MEASURE,
)


def _add(commands: Sequence[Command], parser: argparse.ArgumentParser) -> None:
    choices = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in commands:
        child = choices.add_parser(
            command.name,
            help=command.summary,
            description=command.summary[0].upper() + command.summary[1:] + ".",
            epilog="\n\n".join(filter(None, (command.notes, f"example:\n  {command.example}"))),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        if command.configure:
            command.configure(child)
        if command.commands:
            _add(command.commands, child)
        else:
            child.set_defaults(run=command.run, interrupted=command.interrupted)


def make_parser() -> argparse.ArgumentParser:
    """Parser of the whole command line."""
    parser = argparse.ArgumentParser(
        prog="stereolib",
        description="Object dimensions from two webcams and a laser range finder: a paper, reproduced.",
        epilog="example:\n  stereolib reproduce",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"stereolib {__version__}")
    _add(COMMANDS, parser)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code.

    Parameters
    ----------
    argv : sequence of str, optional
        The words after ``stereolib``; default: those of this process.
    """
    arguments = make_parser().parse_args(argv)
    try:
        return int(arguments.run(arguments))
    except (ValueError, OSError) as error:
        text = " ".join(str(error).split()) or type(error).__name__
        print(f"stereolib: error: {text}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("; ".join(filter(None, ("stereolib: interrupted", arguments.interrupted))), file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
