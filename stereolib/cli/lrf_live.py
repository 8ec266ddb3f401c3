"""The commands ``stereolib lrf live`` and ``export``: the laser in the browser, its scans for other programs."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING

from stereolib.base import counted
from stereolib.cli.command import Command
from stereolib.cli.errors import DONE
from stereolib.cli.live_page import add_page, live_page
from stereolib.cli.outputs import check_outputs
from stereolib.cli.ranges import MM, number, whole

if TYPE_CHECKING:
    from stereolib.laser import AveragedScan, LaserScan

MOST_TURNS = 10_000  # that are combined
_DRAWN = 5  # turns in the picture
_SAY_EVERY_S = 1.0
_LASER_RGB = (0, 158, 115)
#: Of commands that take a port.
NO_LASER = (
    "no laser? stereolib lrf emulate, in another terminal, is one: type the port that it prints in place of this one"
)
_EXPORT_NOTES = """a .csv has the columns angle_deg,range_mm, one line a beam, counter-clockwise from ahead, empty where
nothing was measured; stereolib measure, map, calibrate-laser and explore read it. A .ply has points in metres, z up,
moved by --pose."""


def _configure_live(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("source", metavar="PORT", help="for example /dev/ttyUSB0, COM3 or socket://127.0.0.1:4000")
    parser.add_argument("--seconds", type=float, default=float("inf"), metavar="S", help="default: until Ctrl-C")
    add_page(parser)


def _live(arguments: argparse.Namespace) -> int:
    from stereolib.laser import watch_turns
    from stereolib.notebook.laser_view import END, LASER_BUTTONS, LASER_TITLE, draw_turns, laser_line

    if not arguments.seconds > 0:
        raise ValueError(f"--seconds must be more than 0, got {arguments.seconds:g}")
    if Path(arguments.source).is_file():
        raise ValueError(f"{arguments.source} is a file: stereolib lrf replay plays it on a port, which is watched")
    turns = watch_turns(arguments.source)
    recent = deque([next(turns)], maxlen=_DRAWN)  # what is wrong with the port is said before a page is served
    begun_s = said_s = time.monotonic()
    try:
        with live_page(arguments, LASER_TITLE, LASER_BUTTONS) as page:
            for turn in turns:
                recent.append(turn)
                if page is not None:
                    page.show(draw_turns(recent))
                    if END in page.pressed():
                        break
                if (now_s := time.monotonic()) - said_s > _SAY_EVERY_S:
                    _say(laser_line(turn))
                    said_s = now_s
                if now_s - begun_s >= arguments.seconds:
                    break
    finally:
        turns.close()
    _say("")
    print(laser_line(recent[-1]))
    return DONE


def _say(text: str) -> None:
    if sys.stderr.isatty():
        print(f"\r{text:110}\r", end="", file=sys.stderr, flush=True)
    elif text:
        print(text, file=sys.stderr, flush=True)


def _configure_export(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("source", metavar="FILE|PORT", help="a recording, or the port of a sensor or emulator")
    parser.add_argument("output", type=Path, metavar="OUT", help="what to write: a .csv or a .ply")
    parser.add_argument(
        "--turns", type=whole(1, MOST_TURNS), default=5, metavar="N", help="turns combined by the median (default: 5)"
    )
    parser.add_argument(
        "--pose", metavar="X,Y,YAW", help="of a .ply: where the sensor stood, mm, mm and degrees counter-clockwise"
    )
    parser.add_argument(
        "--height-mm", type=number(-MM, MM), default=0.0, metavar="MM", help="of a .ply: of the laser's plane"
    )
    parser.add_argument("--force", action="store_true", help="replace the file if it is there")


def combined(source: str, turns: int) -> AveragedScan:
    """Take some turns of a recording or a port and combine them; say it where none was whole.

    Parameters
    ----------
    source : str
    turns : int

    Returns
    -------
    AveragedScan
    """
    from stereolib import laser

    scans = laser.take_scans(source, turns)
    is_whole = any(scan.complete for scan in scans)
    if not is_whole:
        advice = "packets are lost on the line: see to cable, plug and port"
        print(f"warning: no turn came whole, {len(scans)} with gaps are combined; {advice}", file=sys.stderr)
    return laser.average(scans, complete_only=is_whole)


def _export(arguments: argparse.Namespace) -> int:
    output, ending = arguments.output, arguments.output.suffix.lower()
    if ending not in (".csv", ".ply"):
        raise ValueError(f"a scan is written as .csv or .ply: name it so, not {output}")
    check_outputs([output], force=arguments.force, option="OUT")
    if ending == ".csv" and (arguments.pose or arguments.height_mm):
        raise ValueError("--pose and --height-mm are for a .ply: a table has the sensor's own angles")
    pose = _pose(arguments.pose)
    scan = combined(arguments.source, arguments.turns)
    count = _write_table(output, scan) if ending == ".csv" else _write_points(output, scan, pose, arguments.height_mm)
    print(f"{output}: {count} of 360 beams with a reading, median of {counted(scan.n_turns, 'turn')}")
    return DONE


def _pose(text: str | None) -> tuple[float, float, float]:
    """x and y in mm, the yaw in rad."""
    try:
        x_mm, y_mm, yaw_deg = (float(part) for part in (text or "0,0,0").split(","))
        if not (abs(x_mm) <= MM and abs(y_mm) <= MM and math.isfinite(yaw_deg)):
            raise ValueError
    except ValueError:
        raise ValueError(f"--pose is X,Y,YAW in mm, mm and degrees, as 1200,-300,90; got {text!r}") from None
    return x_mm, y_mm, math.radians(yaw_deg)


def _write_table(output: Path, scan: LaserScan) -> int:
    import numpy as np

    from stereolib.base import write_atomic

    told = np.isfinite(scan.ranges_mm)
    angles_deg = np.degrees(scan.angles_rad)
    rows = [f"{angle:.6g},{range_mm:.6g}" if there else f"{angle:.6g}," for angle, range_mm, there in
            zip(angles_deg, scan.ranges_mm, told, strict=True)]  # fmt: skip
    write_atomic(output, "\n".join(["angle_deg,range_mm", *rows, ""]))
    return int(told.sum())


def _write_points(output: Path, scan: LaserScan, pose: tuple[float, float, float], height_mm: float) -> int:
    import numpy as np

    from stereolib.base import turn_2d
    from stereolib.laser import points_mm
    from stereolib.mapping import Cloud, write_cloud

    flat = points_mm(scan) @ turn_2d(pose[2]).T + pose[:2]
    points = np.column_stack([flat, np.full(len(flat), height_mm)])
    write_cloud(output, Cloud(points, np.tile(np.array(_LASER_RGB, np.uint8), (len(points), 1))), overwrite=True)
    return len(points)


LIVE = Command(
    "live",
    "watch the laser turn, in the browser: its readings, rate, speed, and what is lost",
    "stereolib lrf live /dev/ttyUSB0",
    _live,
    _configure_live,
    notes=NO_LASER,
    interrupted="nothing is written; stereolib lrf record keeps what a sensor sends",
)
EXPORT = Command(
    "export",
    "write a scan for other programs: a table, or points where the sensor stood",
    "stereolib lrf export walk/1_scan.bin room.ply --pose 1200,-300,90",
    _export,
    _configure_export,
    notes=_EXPORT_NOTES,
    before=("stereolib data walk walk",),
)
