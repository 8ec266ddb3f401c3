"""The command ``stereolib calibrate-laser``: where the laser stands to the left camera."""

from __future__ import annotations

import argparse
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

from stereolib.base import check_target, counted, listed
from stereolib.cli.boards import parse_board
from stereolib.cli.command import Command
from stereolib.cli.errors import DONE, Refused
from stereolib.cli.ranges import MM, number

if TYPE_CHECKING:
    from stereolib.base import Float64
    from stereolib.calibration import LidarCamera

_MANY = 6  # poses: enough, if they are held as they should be
_MIXED = (
    "Does each scan belong to its picture (a missing one shifts all that follow)? Are the pictures upside down, or "
    "pictures or scans mirrored?"
)
_MOVED_STDS, _LEAST_MOVED_MM, _LEAST_MOVED_DEG = 4.0, 5.0, 0.5  # by which a pose is another one
_CLOCKWISE = (
    "this laser hangs upside down, or its angles run clockwise. If it stands upright, mirror its scans (what stands at "
    "1, 2, 3 ... degrees belongs to 359, 358, 357 ...) and calibrate again: where its light starts was taken on the "
    "wrong side"
)


def _configure(parser: argparse.ArgumentParser) -> None:
    about = "the board, seen by the left camera: a folder or a pattern; right pictures in it are left out"
    parser.add_argument("pictures", metavar="PICTURES", help=about)
    parser.add_argument(
        "scans",
        type=Path,
        metavar="SCANS",
        help="folder: a recording of the laser for each picture, or its scan as .csv",
    )
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
        help="board beyond its squares (default: 0); readings on it count as the board's",
    )
    about = "replace a pose that is there by a doubtful one, or by one elsewhere: the laser was moved"
    parser.add_argument("--force", action="store_true", help=about)


def _run(arguments: argparse.Namespace) -> int:
    import numpy as np

    from stereolib.calibration import ViewsDisagree, calibrate_lidar_to_camera, find_laser_boards_in_files
    from stereolib.mapping import read_scan
    from stereolib.measurement import save_laser_pose
    from stereolib.rig import StereoRig

    rig = StereoRig.load(arguments.calibration)
    check_target(arguments.calibration)
    before = _pose_before(arguments.calibration)
    board = parse_board(arguments.board, arguments.square_mm)
    pictures, scans = _paired(arguments.pictures, arguments.scans)
    views = find_laser_boards_in_files(pictures, scans, board, rig.left, read_scan, margin_mm=arguments.margin_mm)
    try:
        pose = calibrate_lidar_to_camera(views)
    except ViewsDisagree as error:
        if error.view is None:
            raise ValueError(f"{error}. {_MIXED}") from error
        raise ValueError(f"{pictures[error.view]} with {scans[error.view]} {error.text}") from error
    except ValueError as error:
        raise ValueError(f"{error}. If they were held so: {_MIXED}" if len(views) >= _MANY else str(error)) from error
    if before is not None and not arguments.force:
        _check_replaced(before, pose, arguments.calibration)
    save_laser_pose(arguments.calibration, pose)
    turn, shift = float(np.degrees(pose.std_rad).max()), float(pose.std_mm.max())
    x, y, z = pose.T_left_lidar[:3, 3]
    print(f"laser: {len(views)} poses; known to {shift:.1f} mm and {turn:.2f} degrees (one standard deviation)")
    print(f"it stands {place_text(x, y, z)} the left lens: check with a ruler")
    print(f"its angle 0 points {turn_text(*pose.T_left_lidar[:3, 0])} where the left lens looks")
    too = "far" if pose.scale >= 0 else "near"
    off = f"{100 * abs(pose.scale):.1f} ± {100 * pose.std_scale:.1f} % too {too}"
    print(f"it reads {off} if the squares are {arguments.square_mm} mm: taken off in what is measured")
    if before is not None:
        moved_mm, turned_deg = apart(before.T_left_lidar, pose.T_left_lidar)
        by = f"{moved_mm:.1f} mm and {turned_deg:.2f} degrees"
        print(f"the pose that stood in the file is replaced: this one lies {by} off it")
    warnings = [pose.warning] if pose.warning else []
    if pose.T_left_lidar[1, 2] > 0:  # the axis about which its angles grow points down
        warnings.append(_CLOCKWISE)
    if unread := _unread(arguments.scans):
        warnings.append(unread)
    for text in warnings:
        print(f"warning: {text}")
    print(f"written into {arguments.calibration}")
    print(f"next: stereolib measure LEFT RIGHT --scan FILE --calibration {quote(str(arguments.calibration))}")
    return DONE


def _check_replaced(before: LidarCamera, pose: LidarCamera, calibration: Path) -> None:
    """Refuse a doubtful pose in place of one that stands in the file, and one farther off it than both are unsure."""
    import numpy as np

    kept = f"the pose that stands in {calibration} is kept"
    if pose.warning:
        order = " and give that as --square-mm" if pose.is_beyond_lasers else ""
        raise Refused(f"{pose.doubt}{order}; {kept}; to replace it all the same, add --force")
    moved_mm, turned_deg = apart(before.T_left_lidar, pose.T_left_lidar)
    std_mm = float(np.hypot(before.std_mm.max(), pose.std_mm.max()))
    std_rad = float(np.hypot(before.std_rad.max(), pose.std_rad.max()))
    most_mm = max(_MOVED_STDS * std_mm, _LEAST_MOVED_MM)
    most_deg = max(_MOVED_STDS * float(np.degrees(std_rad)), _LEAST_MOVED_DEG)
    if moved_mm > most_mm or turned_deg > most_deg:
        off = f"{moved_mm:.1f} mm and {turned_deg:.2f} degrees off the pose that stands in {calibration}"
        unsure = f"{_MOVED_STDS:g} standard deviations of both, {most_mm:.1f} mm and {most_deg:.2f} degrees"
        raise Refused(f"the laser was found {off}, beyond {unsure}: that is kept; if it was moved since, add --force")


def _pose_before(calibration: Path) -> LidarCamera | None:
    """Where the file had the laser; None if nowhere, or where that is damaged, which this command mends."""
    from stereolib.measurement import Instrument

    try:
        return Instrument.load(calibration).lidar
    except ValueError:
        return None


def apart(one: Float64, other: Float64) -> tuple[float, float]:
    """How far two poses (4, 4) lie apart: mm, and degrees of turn."""
    import cv2
    import numpy as np

    turn = cv2.Rodrigues(other[:3, :3] @ one[:3, :3].T)[0]
    return float(np.linalg.norm(other[:3, 3] - one[:3, 3])), float(np.degrees(np.linalg.norm(turn)))


def place_text(x_mm: float, y_mm: float, z_mm: float) -> str:
    """Where something stands to a lens, whose axes run right, down and ahead, without a minus."""
    ways = (x_mm, "right of", "left of"), (y_mm, "below", "above"), (z_mm, "before", "behind")
    first, second, third = (f"{abs(mm):.0f} mm {one if mm >= 0 else other}" for mm, one, other in ways)
    return f"{first}, {second} and {third}"


def turn_text(right: float, down: float, ahead: float) -> str:
    """Where a direction of length 1 points to a lens, by its parts in the lens's frame, without a minus."""
    import numpy as np

    turned, lowered = np.degrees([np.arctan2(right, ahead), np.arcsin(down)])
    ways = (turned, "right of", "left of"), (lowered, "below", "above")
    return " and ".join(f"{abs(angle):.1f} degrees {one if angle >= 0 else other}" for angle, one, other in ways)


def _paired(pictures: str, scans: Path) -> tuple[list[Path], list[Path]]:
    """Each picture and the recording that belongs to it, by name or number as the stations of a map."""
    from stereolib.mapping import name_scans, pair_stations
    from stereolib.rig import PairFile, left_pictures

    if not scans.is_dir():
        raise ValueError(f"{scans} is no folder: it should hold the scans")
    seen = left_pictures(pictures)
    files = name_scans(sorted(scans.iterdir()))
    stations, _ = pair_stations([PairFile(picture, picture) for picture in seen], files)
    both = [(station.left, station.scan) for station in stations if station.left and station.scan]
    if not len(both) == len(seen) == len(files) > 0:
        used = {path.name for pair in both for path in pair}
        alone = [path.name for path in (*seen, *files.values()) if path.name not in used]
        told = f"; without a partner: {listed(alone)}" if alone else ""
        told += f"; {unread}" if (unread := _unread(scans)) else ""
        here = (
            f"{counted(len(seen), 'picture')} in {pictures} and {counted(len(files), 'scan')} (.bin, .csv) in {scans}"
        )
        raise ValueError(f"{here}: there must be one scan for each picture, of its name or number{told}")
    return [left for left, _ in both], [scan for _, scan in both]


def _unread(scans: Path) -> str:
    """Which files beside the scans, but for pictures, are none; "" if there are none."""
    from stereolib.mapping import no_scans
    from stereolib.rig import PICTURES

    others = no_scans(path for path in scans.iterdir() if path.suffix.lower() not in PICTURES)
    return f"not read, as no .bin or .csv: {listed(others)}" if others else ""


CALIBRATE_LASER = Command(
    "calibrate-laser",
    "find where the laser stands to the left camera, from boards that both see",
    "stereolib calibrate-laser boards/left boards/scans --calibration calibration.json --board 6x9 --square-mm 30",
    _run,
    _configure,
)
