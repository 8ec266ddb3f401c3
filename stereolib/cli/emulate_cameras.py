"""The command ``stereolib emulate-cameras``: two webcams of the virtual rig, on addresses of this machine."""

from __future__ import annotations

import argparse
import sys
import time

from stereolib.cli.command import Command
from stereolib.cli.errors import INTERRUPTED

_NOTES = """somebody holds a board before the virtual rig, the two cameras of the paper, still in one place after the
other, again and again. The faults are the right camera's. Ctrl-C ends it."""


def _configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--places", type=int, default=24, metavar="N", help="where the board is held (default: 24)")
    parser.add_argument("--fps", type=float, default=10.0, metavar="N", help="pictures a second (default: 10)")
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
    import numpy as np

    from stereolib.virtual import camera_emulator
    from stereolib.virtual.recordings import BOARD

    never = float("inf")
    times = [never if value is None else value for value in (arguments.freeze_after_s, arguments.unplug_after_s)]
    faults = camera_emulator.CameraFaults(arguments.late_ms / 1000, arguments.drop_rate, *times)
    cable = never if arguments.cable_kb_s is None else 1000 * arguments.cable_kb_s
    if not cable > 0:
        raise ValueError(f"--cable-kb-s must be more than 0, got {arguments.cable_kb_s:g}")
    if arguments.seed < 0:
        raise ValueError(f"--seed must be 0 or more, got {arguments.seed}")
    show = camera_emulator.show_boards(
        arguments.places, np.random.default_rng(arguments.seed), fps=arguments.fps, scale=arguments.scale,
        progress=sys.stderr.isatty(),
    )  # fmt: skip
    board = f"--board {BOARD.columns}x{BOARD.rows} --square-mm {BOARD.square_mm:g}"
    both = camera_emulator.CameraFaults(), faults
    with camera_emulator.serve_cameras(show, both, bus_bytes_per_s=cable, seed=arguments.seed) as (left, right):
        print(f"left   {left}\nright  {right}", flush=True)
        print(f"try in another terminal: stereolib capture {left} {right} {board} --output rig", flush=True)
        try:
            while True:
                time.sleep(0.5)
        except KeyboardInterrupt:
            return INTERRUPTED


EMULATE_CAMERAS = Command(
    "emulate-cameras",
    "be two webcams before which a board is held, on addresses of this machine",
    "stereolib emulate-cameras --late-ms 50 --drop-rate 0.05",
    _run,
    _configure,
    notes=_NOTES,
)
