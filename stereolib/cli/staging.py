"""What both emulators are told of the scene before them: the same words make one rig of cameras and laser."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from stereolib.cli.ranges import MM, number, whole

if TYPE_CHECKING:
    from stereolib.virtual import Staged

_IN_TURN = ("walk", "laser-board")  # scenes whose places --at counts; the pictures of all make one set
SCENES_TOLD = """scenes, the same for cameras and laser:
  cube          the paper's cube, --distance-mm away
  box           a box of sizes that nobody told you; --at 2 is another one, up to 1000
  room          their room, empty
  walk          a room with five boxes; --at 1 to 5 are five places in it, which make a map
  laser-board   a board (6x9 inner corners of 30 mm, 24 mm beyond its squares) that camera and laser see;
                --at 1 to 10 are poses of it, for calibrate-laser"""


def add_scene(parser: argparse.ArgumentParser, *first: str) -> None:
    """Add the options of rig and scene; `first` are scenes of this command alone, the first of all is the default."""
    names = (*first, "cube", "box", "room", "walk", "laser-board")
    parser.add_argument("--scene", choices=names, default=names[0], help=f"as below (default: {names[0]})")
    parser.add_argument("--at", type=whole(1, 1000), default=1, metavar="N", help="which of them (default: 1)")
    parser.add_argument("--distance-mm", type=number(1, MM), metavar="MM", help="of the cube (default: 700)")
    parser.add_argument("--rig", type=whole(0, 10**6), default=0, metavar="N", help="which rig (default: 0)")
    parser.add_argument("--truth", action="store_true", help="print what is true of the rig and the scene")


def staged(arguments: argparse.Namespace) -> Staged:
    """The scene that was asked for, before the rig that was asked for."""
    from stereolib.virtual import stage

    given = {} if arguments.distance_mm is None else {"distance_mm": arguments.distance_mm}
    return stage(arguments.scene, arguments.at, rig=arguments.rig, **given)


def check_scene(arguments: argparse.Namespace) -> None:
    """Refuse an option that is about another scene than the one asked for."""
    if arguments.distance_mm is not None and arguments.scene != "cube":
        raise ValueError(f"--distance-mm is of the cube, not of {arguments.scene}: leave it out, or take --scene cube")


def place_folder(arguments: argparse.Namespace) -> str:
    """Where the recordings of a place go: in a folder of the rig, all places of one set together."""
    alone = arguments.at > 1 and arguments.scene not in _IN_TURN
    return f"rig{arguments.rig}/{arguments.scene}{f'_{arguments.at}' * alone}"


def place_number(arguments: argparse.Namespace) -> int:
    """Which pair and which scan of that folder a place is."""
    return int(arguments.at) if arguments.scene in _IN_TURN else 1


def try_line(command: str, number: int = 1) -> str:
    """The line of a command to be typed elsewhere; before that of a later place stands what has to be there first."""
    earlier = "" if number == 1 else f", after the place{'s 1 to' * (number > 2)} {number - 1}"
    return f"try in another terminal{earlier}: {command}"


def truth(arguments: argparse.Namespace, shown: Staged) -> str:
    """What is true of both, in the words of the commands that measure it; the same for cameras and laser."""
    import numpy as np

    from stereolib.virtual import staged_laser, staged_rig

    x, y, z = shown.T_left_laser[:3, 3]
    turned = np.degrees(staged_laser(arguments.rig)[2])
    said = [f"true distance of the lenses: {staged_rig(arguments.rig).baseline_mm:.2f} mm"]
    said += [
        f"true place of the laser: {x:.1f} mm right of, {y:.1f} mm below and {z:.1f} mm before the left lens "
        f"(negative: the other way), turned by {turned:.2f} degrees counter-clockwise"
    ]
    if shown.sizes_mm:
        said += [f"true sizes: {', '.join(' x '.join(f'{mm:g}' for mm in size) for size in shown.sizes_mm)} mm"]
    return "\n".join(said)
