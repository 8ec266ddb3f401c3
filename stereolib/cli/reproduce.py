"""The command ``stereolib reproduce``."""

from __future__ import annotations

import argparse
import os
import shutil
import sys
from pathlib import Path

from stereolib.cli.command import Command
from stereolib.cli.errors import DONE, REFUSED
from stereolib.cli.outputs import check_outputs
from stereolib.cli.ranges import whole


def _configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("names", nargs="*", metavar="NAME", help="notebooks by number or name; default: all")
    parser.add_argument("--jobs", type=whole(1, 64), default=2, metavar="N", help="notebooks at once (default: 2)")
    parser.add_argument(
        "--output", type=Path, metavar="DIR", help="work on a copy of the notebooks and figures, made there"
    )
    outcome = parser.add_mutually_exclusive_group()
    outcome.add_argument("--check", action="store_true", help="compare only; replace no file")
    outcome.add_argument("--accept", action="store_true", help="replace the files although numbers changed")


def _run(arguments: argparse.Namespace) -> int:
    from stereolib.base import figures_dir
    from stereolib.reproduction import REPEAT_RTOL, NotebookError, reproduce

    notebooks, figures = _copied(arguments.output) if arguments.output else (None, None)
    try:
        changed = reproduce(notebooks, figures, arguments.names, arguments.jobs, arguments.check, arguments.accept)
    except NotebookError as error:
        print(f"stereolib: failed, nothing was replaced\n{error}", file=sys.stderr)
        return REFUSED
    if changed:
        print(f"\nchanged by more than {REPEAT_RTOL:.0%} or one unit of the last digit:", *changed, sep="\n  ")
    if changed and not arguments.accept:
        print(
            "The committed files are as they were; the new ones are in .staging/ until the next run.\n"
            "If the change is meant: stereolib reproduce --accept",
            file=sys.stderr,
        )
        return REFUSED
    if arguments.check and not changed:
        print(f"\n{', '.join(arguments.names) or 'all notebooks'}: every number is that of the committed files")
    page = (figures or figures_dir()) / "report.html"
    if not arguments.check and page.is_file():
        print(f"open {os.path.relpath(page)}: every number of the paper beside ours")
    return DONE


def _copied(folder: Path) -> tuple[Path, Path]:
    """Copies of the notebooks and figures, for a checkout that cannot be written."""
    from stereolib.base import datasets

    places = folder / "notebooks", folder / "figures"
    if there := [place for place in places if place.exists()]:
        raise FileExistsError(f"{there[0]} is there already: name another folder with --output")
    check_outputs([folder / "figures"], force=True, option="--output")
    for place in places:
        shutil.copytree(datasets.repository() / place.name, place, copy_function=shutil.copyfile)
    return places


REPRODUCE = Command(
    "reproduce",
    "execute the notebooks, redraw all figures, and hold every number against the paper's",
    "stereolib reproduce 03 04 --check",
    _run,
    _configure,
    interrupted="the committed files are as they were",
)
