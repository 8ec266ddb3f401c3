"""The command ``stereolib calibrate-laser``: where the laser stands to the left camera."""

from __future__ import annotations

import argparse
from pathlib import Path

from stereolib.base import check_target, counted
from stereolib.cli.boards import parse_board
from stereolib.cli.command import Command
from stereolib.cli.errors import DONE
from stereolib.cli.ranges import MM, number

_PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")


def _configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("pictures", type=Path, metavar="PICTURES", help="folder: the board, seen by the left camera")
    parser.add_argument("scans", type=Path, metavar="SCANS", help="folder: a recording of the laser for each picture")
    parser.add_argument(
        "--calibration", type=Path, required=True, metavar="FILE", help="calibration.json: is completed"
    )
    parser.add_argument("--board", required=True, metavar="9x6", help="inner corners, columns x rows")
    parser.add_argument("--square-mm", required=True, metavar="MM", help="edge of a square, or width x height")
    parser.add_argument(
        "--margin-mm",
        type=number(0, MM),
        default=0.0,
        metavar="MM",
        help="board beyond its squares (default: 0)",
    )


def _run(arguments: argparse.Namespace) -> int:
    import numpy as np

    from stereolib.calibration import calibrate_lidar_to_camera, find_laser_boards_in_files
    from stereolib.measurement import save_laser_pose
    from stereolib.rig import StereoRig

    rig = StereoRig.load(arguments.calibration)
    check_target(arguments.calibration)
    board = parse_board(arguments.board, arguments.square_mm)
    files = []
    for folder, endings, what in ((arguments.pictures, _PICTURES, "pictures"), (arguments.scans, (".bin",), "scans")):
        if not folder.is_dir():
            raise ValueError(f"{folder} is no folder: it should hold the {what}")
        files.append(sorted(path for path in folder.iterdir() if path.suffix.lower() in endings))
    if len(files[0]) != len(files[1]) or not files[0]:
        raise ValueError(
            f"{counted(len(files[0]), 'picture')} ({' '.join(_PICTURES)}) in {arguments.pictures} and "
            f"{counted(len(files[1]), 'scan')} (.bin) in {arguments.scans}: there must be one scan for each picture, "
            f"in the order of their names"
        )
    views = find_laser_boards_in_files(files[0], files[1], board, rig.left, margin_mm=arguments.margin_mm)
    pose = calibrate_lidar_to_camera(views)
    save_laser_pose(arguments.calibration, pose)
    turn, shift = float(np.degrees(pose.std_rad).max()), float(pose.std_mm.max())
    x, y, z = pose.T_left_lidar[:3, 3]
    print(f"laser: {len(views)} poses; known to {shift:.1f} mm and {turn:.2f} degrees (one standard deviation)")
    print(f"it stands {x:.0f} mm right of, {y:.0f} mm below and {z:.0f} mm before the left lens: check with a ruler")
    print(f"written into {arguments.calibration}")
    return DONE


CALIBRATE_LASER = Command(
    "calibrate-laser",
    "find where the laser stands to the left camera, from boards that both see",
    "stereolib calibrate-laser boards/left boards/scans --calibration calibration.json --board 6x9 --square-mm 30",
    _run,
    _configure,
)
