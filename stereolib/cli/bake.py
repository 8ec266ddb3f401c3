"""The command ``stereolib bake``: the chapters' sliders as pages that need no Python."""

from __future__ import annotations

import argparse
from pathlib import Path

from stereolib.cli.command import Command
from stereolib.cli.errors import DONE
from stereolib.cli.outputs import check_outputs

_NOTES = """\
Each page is a file that needs no other: it holds its pictures, at most 1.5 MB of them, and asks for nothing from
elsewhere. Open FOLDER/index.html in a browser, or put the folder on any web server."""


def _configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "folder", type=Path, nargs="?", metavar="FOLDER", help="default: build/explore in the project's folder"
    )
    parser.add_argument("--force", action="store_true", help="replace files that are there")


def _run(arguments: argparse.Namespace) -> int:
    from tqdm import tqdm

    from stereolib.base import datasets
    from stereolib.notebook.baked import INDEX, PAGES, bake

    folder = arguments.folder or datasets.repository() / "build" / "explore"
    check_outputs([folder / name for name in (INDEX, *(page.file for page in PAGES))], force=arguments.force,
                  option="FOLDER")  # fmt: skip
    with tqdm(total=sum(len(page.positions) for page in PAGES), unit="picture", leave=False, disable=None) as bar:

        def advance(title: str) -> None:
            bar.set_description(title)
            bar.update()

        written = bake(folder, advance=lambda page: advance(page.stem))
    size_mb = sum(path.stat().st_size for path in written) / 1e6
    print(f"{folder}: {len(written)} pages, {size_mb:.1f} MB; open {folder / INDEX}")
    return DONE


BAKE = Command(
    name="bake",
    summary="write the chapters' sliders as pages that move without Python",
    example="stereolib bake sliders",
    run=_run,
    configure=_configure,
    notes=_NOTES,
    interrupted="pages that were finished are whole; run it again, with --force if there are any",
)
