"""The commands ``stereolib data ...``: the recordings made, checked and fetched."""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path
from shlex import quote

from stereolib.cli.command import Command
from stereolib.cli.errors import DONE, REFUSED
from stereolib.cli.outputs import check_outputs
from stereolib.cli.told import say_on_a_terminal

_FETCH_NOTES = """an installed package fetches the demo rig from the address that STEREOLIB_DATA_URL names, or its own
if it was built with one (Data, among the addresses of the project). Where neither is known, this renders them:
stereolib data build --output DIR/virtual, and STEREOLIB_DATA=DIR names them."""
_BUILD_NOTES = """without the repository these are the demo rig, which README and --help name data/virtual:
  stereolib data build --output DIR/virtual
and STEREOLIB_DATA=DIR names them. With the versions of requirements.txt each file is the same, by its sha256."""


def _configure_build(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--output", type=Path, metavar="FOLDER", help="default: data/virtual of the repository")
    parser.add_argument("--force", action="store_true", help="replace recordings that are in FOLDER")


def _build(arguments: argparse.Namespace) -> int:
    from stereolib.base import datasets, read_text
    from stereolib.mapping import write_demo_file
    from stereolib.virtual import build_recordings

    output = arguments.output or datasets.repository() / "data" / "virtual"
    known = read_text(datasets.data_path("virtual/SHA256SUMS")).splitlines()  # before they are replaced
    made = ["SHA256SUMS", *(line.split(maxsplit=1)[1] for line in known)]
    is_asked_for = arguments.force or arguments.output is None  # the repository's own are there to be made again
    check_outputs([output / name for name in made], force=is_asked_for, option="--output")
    write_demo_file(output)
    build_recordings(output)
    same = len(set(known) & set(read_text(output / "SHA256SUMS").splitlines()))
    print(f"{output}: {same} of {len(known)} files are as their sha256 says", end="")
    print("" if same == len(known) else "; the others are of the same scenes, by other versions of numpy or OpenCV")
    return DONE


def _verify(arguments: argparse.Namespace) -> int:
    from stereolib.base import datasets, read_text

    datasets.repository()  # an installed package has checked what it fetched
    sums = datasets.data_path("virtual/SHA256SUMS")
    problems = []
    for line in read_text(sums).splitlines():
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
    return REFUSED if problems else DONE


def _fetch(arguments: argparse.Namespace) -> int:
    from stereolib.base import datasets

    if datasets.INSTALLED:
        print(f"{datasets.demo_rig()}: the demo rig, sha256 as expected")
    for folder in ("xv11", "minoru3d/left", "minoru3d/right"):
        files = datasets.real_recordings(folder)
        print(f"{files[0].parent}: {len(files)} files, sha256 as expected")
    return DONE


def _configure_walk(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="what to make, for example walk")
    parser.add_argument("--force", action="store_true", help="replace files that are there")


def _walk(arguments: argparse.Namespace) -> int:
    from stereolib.virtual import walk, walk_folder

    check_outputs([arguments.folder / name for name in walk_folder.WALK_FILES], force=arguments.force, option="FOLDER")
    say_on_a_terminal("rendering boards for the laser, in some seconds ...")
    written = walk_folder.write_walk(arguments.folder)
    print(f"{arguments.folder}: {len(written)} files; the map of them: stereolib map {quote(str(arguments.folder))}")
    sizes = ", ".join(" x ".join(f"{size:.0f}" for size in box.size_mm) for box in walk.objects())
    boards = arguments.folder / "laser"
    print(f"{boards}: boards that the camera and the laser saw, 6x9 inner corners of 30 mm (calibrate-laser)")
    print(f"the true sizes of what stands there: {sizes} mm; true_poses.csv is the truth, too (--poses)")
    return DONE


DATA = Command(
    "data",
    "make, check or fetch recordings, or write some to try",
    "stereolib data verify",
    commands=(
        Command(
            "build",
            "render the virtual rig's recordings again (some minutes)",
            "stereolib data build",
            _build,
            _configure_build,
            notes=_BUILD_NOTES,
        ),
        Command("verify", "compare the committed recordings with their sha256", "stereolib data verify", _verify),
        Command(
            "fetch",
            "download the real recordings (an installed package: the demo rig, too), or say where they are",
            "stereolib data fetch",
            _fetch,
            notes=_FETCH_NOTES,
        ),
        Command(
            "walk",
            "write a walk of the virtual rig through a room, as recordings of your own would lie in a folder",
            "stereolib data walk walk",
            _walk,
            _configure_walk,
            interrupted="files that were written stay; run it again, with --force if there are any",
        ),
    ),
)
