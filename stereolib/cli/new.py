"""The command ``stereolib new``: a folder for a rig of one's own."""

from __future__ import annotations

import argparse
from pathlib import Path
from shlex import quote

from stereolib.cli.command import Command
from stereolib.cli.errors import DONE

_NOTES = """\
FOLDER gets
  rig.toml  what your board is, and what you know by a ruler; every entry has a comment
  boards/   for the pairs of the board: left01.jpg, right01.jpg, ... (as `stereolib calibrate` reads them)
  pairs/    for the pairs of what you measure: 1_left.jpg, 1_right.jpg, 2_left.jpg, ...
  scans/    for the laser's recordings of the same moments: 1.bin, 2.bin, ... (stereolib lrf record)
Pairs and scans that lie in FOLDER itself, as `stereolib map` reads them, or pairs in FOLDER/left and FOLDER/right, as
`stereolib capture` writes them, are entered as what is to be measured.
What lies elsewhere is named in rig.toml, as boards = "../boards"; what you have not got stays empty. Then:
stereolib report FOLDER. A folder that is there keeps what is in it."""


def _configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="what to make, for example my_rig")


def _run(arguments: argparse.Namespace) -> int:
    from stereolib.base import check_target
    from stereolib.mapping import RIG_FILE, RIG_FOLDERS, lying_there, write_rig_file

    folder = arguments.folder
    if in_the_way := [path for path in (folder, *folder.parents) if path.exists() and not path.is_dir()]:
        raise ValueError(f"{folder} cannot be a folder: {in_the_way[0]} is a file; choose another name")
    if (folder / RIG_FILE).exists():
        raise FileExistsError(f"{folder / RIG_FILE} is there already: edit it, or choose another folder")
    check_target(folder / RIG_FILE)
    for name in RIG_FOLDERS:
        (folder / name).mkdir(parents=True, exist_ok=True)
    found = lying_there(folder)
    write_rig_file(folder / RIG_FILE, **found)
    print(f"{folder}: {RIG_FILE}, {', '.join(f'{name}/' for name in RIG_FOLDERS)}")
    print(
        f"1. say in {folder / RIG_FILE} what your board is; 2. put your pictures there, or say in it where "
        f'they lie, as boards = "../boards"; 3. stereolib report {quote(str(folder))}'
    )
    if found:
        names = ", ".join("left/ and right/" if pattern == "." else pattern for pattern in found.values())
        print(f"pairs and scans that lie in {folder} itself are taken for what is to be measured, as map takes them: "
              f"{names}")  # fmt: skip
    return DONE


NEW = Command(
    "new",
    "make a folder for a rig of your own, to be filled and reported on",
    "stereolib new my_rig",
    _run,
    _configure,
    notes=_NOTES,
)
