"""The command ``stereolib explore``: the whole measurement on one page in the browser."""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path

from stereolib.cli.command import Command
from stereolib.cli.ranges import whole
from stereolib.cli.voila import INSTALL, free_port, has_voila, serving

_NOTES = f"""\
The page shows the virtual rig, whose scene, cameras, laser and settings have sliders, every recording of the project,
or your own pair. It is served on this machine alone, with a token, and asks for nothing from elsewhere. Ctrl-C ends it.
It needs Voila: {INSTALL}."""


def _configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "pair", type=Path, nargs="*", metavar="LEFT RIGHT", help="an own pair, left one first, or what holds one"
    )
    parser.add_argument("--calibration", type=Path, metavar="FILE", help="calibration.json, for lengths")
    parser.add_argument("--scan", type=Path, metavar="FILE", help="the laser, recorded at the same time")
    parser.add_argument("--port", type=whole(0, 65535), default=0, metavar="N", help="default: a free one")
    parser.add_argument("--no-browser", action="store_true", help="print the address and open nothing")


def _run(arguments: argparse.Namespace) -> int:
    from stereolib.notebook.offered import OWN_FILES
    from stereolib.reproduction import ONE_THREAD

    environment = ONE_THREAD | dict(os.environ)  # the page has threads of its own, for both cameras
    environment.pop("JUPYTER_TOKEN", None)  # Voila draws one of its own, and prints no other
    if own := _own_pair(arguments):
        environment[OWN_FILES] = json.dumps(own)
    if not has_voila():
        raise ValueError(f"explore needs Voila: {INSTALL}")
    opened = ["--no-browser"] if arguments.no_browser else []
    with serving("explore.ipynb", free_port(arguments.port), environment, *opened) as server:
        return server.wait()


def _own_pair(arguments: argparse.Namespace) -> tuple[str, ...]:
    """Paths of an own pair, tried once to be sure: as `check_own` takes them; empty if there is none."""
    from stereolib.notebook.offered import check_own
    from stereolib.rig import find_pair

    if not arguments.pair:
        if arguments.calibration or arguments.scan:
            raise ValueError("--calibration and --scan belong to a pair: add LEFT RIGHT")
        return ()
    if len(arguments.pair) > 2:
        raise ValueError(f"LEFT RIGHT are two pictures, got {len(arguments.pair)}")
    files = (*find_pair(*arguments.pair), arguments.calibration, arguments.scan)
    check_own(tuple(str(file or "") for file in files))
    return tuple(str(file.resolve()) if file else "" for file in files)


EXPLORE = Command(
    name="explore",
    summary="open the whole measurement in the browser, with a slider for everything",
    example="stereolib explore walk/3_left.jpg walk/3_right.jpg --calibration walk/calibration.json",
    run=_run,
    configure=_configure,
    notes=_NOTES,
    before=("stereolib data walk walk",),
    interrupted="",
)
