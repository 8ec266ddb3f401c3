"""The command ``stereolib emulate-cameras``: two webcams of a virtual rig, on addresses of this machine."""

from __future__ import annotations

import argparse
import math
import sys
import time
from typing import TYPE_CHECKING

from stereolib.base import counted
from stereolib.cli.command import Command
from stereolib.cli.errors import INTERRUPTED
from stereolib.cli.ranges import number, whole
from stereolib.cli.staging import (
    SCENES_TOLD,
    add_scene,
    check_scene,
    place_folder,
    place_number,
    staged,
    truth,
    try_line,
)

if TYPE_CHECKING:
    from stereolib.rig import StereoRig
    from stereolib.virtual.camera_emulator import Show

_BOARD = "board"
_S_PER_PLACE, _S_PER_SCENE = 1.2, 9.0  # to draw one at 640 x 480 on one core that has nothing else to do
_PLACES, _MOST_PLACES, _LEAST_FPS, _MOST_FPS = 24, 1000, 0.1, 120.0  # more are drawn for hours
_NOTES = f"""somebody holds a board before a virtual rig, still in one place after the other, again and again; or the
cameras see another scene, in which nothing moves. --rig 0 are the two cameras of the paper, every other number is a rig
that nobody has described. What is true of rig and scene is printed with --truth only. With

  stereolib emulate-cameras --rig 7 --scale 1              then: stereolib capture ..., to rig7/boards/calibration.json
  stereolib emulate-cameras --rig 7 --scale 1 --scene box  then: stereolib capture ... --output rig7/box
  stereolib lrf emulate --rig 7 --scene box                then: stereolib lrf record ... rig7/box/scans/01.bin

one rig leads from its boards to the sizes of a box; each prints the whole line.
The faults are the right camera's. Ctrl-C ends it.

{SCENES_TOLD}"""


def _configure(parser: argparse.ArgumentParser) -> None:
    add_scene(parser, _BOARD)
    parser.add_argument(
        "--places", type=whole(1, _MOST_PLACES), metavar="N", help=f"where the board is held (default: {_PLACES})"
    )
    fps = number(_LEAST_FPS, _MOST_FPS)
    parser.add_argument("--fps", type=fps, default=10.0, metavar="N", help="pictures a second (default: 10)")
    parser.add_argument(
        "--scale", type=float, default=0.5, metavar="X", help="1 is 640x480 px, which takes longer (default: 0.5)"
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of places, noise and faults (default: 0)")
    parser.add_argument("--late-ms", type=float, default=0.0, metavar="MS", help="its pictures come so much later")
    parser.add_argument("--drop-rate", type=float, default=0.0, metavar="X", help="chance of each picture to be lost")
    parser.add_argument("--freeze-after-s", type=float, metavar="S", help="it sends nothing from then on")
    parser.add_argument("--unplug-after-s", type=float, metavar="S", help="it is gone from then on")
    parser.add_argument(
        "--cable-kb-s", type=float, metavar="KB", help="what the cable of both carries in a second (default: all)"
    )


def _run(arguments: argparse.Namespace) -> int:
    from stereolib.virtual import camera_emulator

    never = float("inf")
    times = [never if value is None else value for value in (arguments.freeze_after_s, arguments.unplug_after_s)]
    faults = camera_emulator.CameraFaults(arguments.late_ms / 1000, arguments.drop_rate, *times)
    cable = never if arguments.cable_kb_s is None else 1000 * arguments.cable_kb_s
    if not cable > 0:
        raise ValueError(f"--cable-kb-s must be more than 0, got {arguments.cable_kb_s:g}")
    if arguments.seed < 0:
        raise ValueError(f"--seed must be 0 or more, got {arguments.seed}")
    _check_scene(arguments)
    show, about, words = _show(arguments)
    both = camera_emulator.CameraFaults(), faults
    with camera_emulator.serve_cameras(show, both, bus_bytes_per_s=cable, seed=arguments.seed) as (left, right):
        print(f"left   {left}\nright  {right}")
        if arguments.truth:
            print(about)
        place = 1 if arguments.scene == _BOARD else place_number(arguments)
        print(try_line(f"stereolib capture {left} {right} {words}", place), flush=True)
        try:
            while True:
                time.sleep(0.5)
        except KeyboardInterrupt:
            return INTERRUPTED


def _check_scene(arguments: argparse.Namespace) -> None:
    check_scene(arguments)
    if arguments.scene == _BOARD and arguments.at != 1:
        raise ValueError("--at is of the other scenes: in how many places the board is held, --places says")
    if arguments.scene != _BOARD and arguments.places is not None:
        raise ValueError(f"--places is of the scene {_BOARD}, not of {arguments.scene}: leave it out")


def _show(arguments: argparse.Namespace) -> tuple[Show, str, str]:
    """What is shown, what is true of it, and the words that capture it."""
    import numpy as np

    from stereolib.virtual import camera_emulator, stage, staged_rig
    from stereolib.virtual.recordings import BOARD

    rig = camera_emulator.scaled_rig(staged_rig(arguments.rig), arguments.scale)
    rng, focal = np.random.default_rng(arguments.seed), [camera.K[0, 0] for camera in (rig.left, rig.right)]
    scene = stage("room", rig=arguments.rig) if arguments.scene == _BOARD else staged(arguments)
    about = f"true focal lengths: {focal[0]:.2f}, {focal[1]:.2f} px\n{truth(arguments, scene)}"
    if arguments.scene == _BOARD:
        places, progress = arguments.places or _PLACES, sys.stderr.isatty()
        _say_drawing(f"a board in {counted(places, 'place')}", rig, places * _S_PER_PLACE)
        show = camera_emulator.show_boards(places, rng, rig, fps=arguments.fps, progress=progress)
        board = f"--board {BOARD.columns}x{BOARD.rows} --square-mm {BOARD.square_mm:g}"
        return show, about, f"{board} --ruler-mm {rig.baseline_mm:.0f} --output rig{arguments.rig}/boards"
    _say_drawing(f"the scene {arguments.scene}, place {arguments.at}", rig, _S_PER_SCENE)
    place = place_number(arguments)
    words = f"--output {place_folder(arguments)}{f' --pairs {place}' * (place > 1)} --no-preview"
    return camera_emulator.show_scene(scene, rng, rig, fps=arguments.fps), about, words


def _say_drawing(what: str, rig: StereoRig, seconds: float) -> None:
    """Say at once what keeps the addresses waiting, and for how long; also where no bar can be drawn."""
    width, height = rig.left.size
    said_s = math.ceil(seconds * width * height / (640 * 480) / 5) * 5
    print(f"drawing {what}, {width}x{height}: about {said_s} s, longer on a busy machine", file=sys.stderr, flush=True)


EMULATE_CAMERAS = Command(
    "emulate-cameras",
    "be two webcams before which a board is held, or a box stands, on addresses of this machine",
    "stereolib emulate-cameras --late-ms 50 --drop-rate 0.05",
    _run,
    _configure,
    notes=_NOTES,
)
