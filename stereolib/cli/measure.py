"""The commands that give sizes of things: ``stereolib measure``, and ``calibrate-laser`` before it."""

from __future__ import annotations

import argparse
import json
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stereolib.cli.command import Command

if TYPE_CHECKING:
    from stereolib.measurement import MeasuredObject, Measurement

_NOTES = """\
A box shows two faces: length, width, height. A face shows one: its width, as its depth is hidden. Round things have a
diameter. Irregular ones and pieces of wall have no sizes. Deviations (±) are one standard deviation: the truth lies
within twice that in 19 of 20 cases. Places are told from the floor below the left camera: ahead along its axis, and to
the left; turned: the direction of the length (of a face: of the face), counter-clockwise from ahead.
exit code: 0 something was measured, 1 nothing was, 2 wrong input"""
_PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")


def _measure_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("left", type=Path, metavar="LEFT", help="picture of the left camera, as it comes")
    parser.add_argument("right", type=Path, metavar="RIGHT", help="picture of the right camera")
    parser.add_argument("--scan", type=Path, metavar="FILE", help="the laser, recorded at the same time (lrf record)")
    parser.add_argument("--calibration", type=Path, required=True, metavar="FILE", help="calibration.json")
    parser.add_argument("--picture", type=Path, metavar="PNG", help="default: LEFT's name with _measured.png, here")
    parser.add_argument("--force", action="store_true", help="replace the picture if it is there")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def _measure(arguments: argparse.Namespace) -> int:
    import cv2
    import numpy as np

    from stereolib import laser
    from stereolib.base import write_atomic
    from stereolib.measurement import Instrument, draw_objects, measure_objects
    from stereolib.rig import read_pair

    picture = arguments.picture or Path(f"{arguments.left.stem}_measured.png")
    if picture.suffix != ".png":
        raise ValueError(f"the picture is a PNG: name it so, not {picture}")
    if picture.exists() and not arguments.force:
        raise FileExistsError(f"{picture} exists and is not overwritten: name another with --picture, or pass --force")
    instrument = Instrument.load(arguments.calibration)
    pair = read_pair(arguments.left, arguments.right)
    scan = None if arguments.scan is None else laser.average(laser.turns(laser.load(arguments.scan)))
    measured = measure_objects(
        *pair, scan, instrument.rectified, instrument.lidar, rng=np.random.default_rng(0),
        uncertainty=instrument.uncertainty,
    )  # fmt: skip
    write_atomic(picture, cv2.imencode(".png", draw_objects(measured))[1].tobytes())
    facts = measured_facts(measured) | {"picture": str(picture)}
    print(json.dumps(facts, indent=1, allow_nan=False) if arguments.json else measured_text(measured))
    if not arguments.json:
        print(f"picture: {picture}")
    return 0 if any(entry["height_mm"] or entry["width_mm"] for entry in facts["objects"]) else 1


def measured_facts(measured: Measurement) -> dict[str, Any]:
    """What was measured, ready for JSON: None where a thing is not known."""
    import numpy as np

    def plain(value: float) -> float | None:
        return round(float(value), 4) if np.isfinite(value) else None

    entries = []
    for thing in measured.objects:
        entry: dict[str, Any] = {"shape": thing.shape}
        for name, size, std in zip(("length", "width", "height"), thing.size_mm, thing.std_mm, strict=True):
            entry |= {f"{name}_mm": plain(size), f"{name}_std_mm": plain(std)}
        volume, area = thing.volume_l, thing.surface_m2
        entry |= {"volume_l": plain(volume[0]), "volume_std_l": plain(volume[1])}
        entry |= {"surface_m2": plain(area[0]), "surface_std_m2": plain(area[1])}
        entry["position_mm"] = [plain(value) for value in thing.position_mm]
        entry["position_std_mm"] = [plain(value) for value in np.sqrt(np.diag(thing.position_covariance))]
        entry |= {"yaw_rad": plain(thing.yaw_rad), "yaw_std_rad": plain(thing.yaw_std_rad)}
        entries.append(entry | {"sources": thing.sources, "reasons": thing.reasons})
    return {
        "frame": "floor below the left camera; x forward, y left, mm, rad; one standard deviation",
        "objects": entries,
        "warnings": list(measured.warnings),
    }


def measured_text(measured: Measurement) -> str:
    """A block for each object: sizes with one standard deviation, place, and what is not known, and why."""
    import numpy as np

    lines, nameless = [], [thing for thing in measured.objects if np.isnan(thing.size_mm).all()]
    for k, thing in enumerate(thing for thing in measured.objects if thing not in nameless):
        sizes = " x ".join(_pm(size, std) for size, std in zip(thing.size_mm, thing.std_mm, strict=True))
        lines.append(f"{k + 1}  {thing.shape}: {sizes} mm (length x width x height, ± one standard deviation)")
        lines += [f"   {line}" for line in _details(thing)]
    if nameless:
        places = "; ".join(f"{x:.0f} mm ahead, {y:+.0f} mm left" for x, y in (thing.position_mm for thing in nameless))
        lines.append(f"also seen, but not measurable (pieces of wall, what is cut or hidden): {places}")
    lines += [f"warning: {text}" for text in measured.warnings]
    return "\n".join(
        part for line in lines for part in textwrap.wrap(line, 120, subsequent_indent="     ", drop_whitespace=False)
    )


def _details(thing: MeasuredObject) -> list[str]:
    import numpy as np

    x, y = thing.position_mm
    place = f"at {x:.0f} mm ahead, {abs(y):.0f} mm {'left' if y >= 0 else 'right'}"
    turned = "" if np.isnan(thing.yaw_rad) else f", turned by {np.degrees(thing.yaw_rad):.1f} degrees"
    lines = [place + turned]
    volume, std = thing.volume_l
    if np.isfinite(volume):
        area, area_std = thing.surface_m2
        lines.append(f"volume {_pm(volume, std)} l, surface {_pm(area, area_std)} m2 (sides and top)")
    if thing.sources:
        lines.append("; ".join(f"{what}: {who}" for what, who in thing.sources.items()))
    return lines + [f"no {what}: {why}" if what != "object" else why for what, why in thing.reasons.items()]


def _pm(value: float, std: float) -> str:
    """A value with its deviation, to two digits of the deviation."""
    import numpy as np

    if not np.isfinite(value):
        return "?"
    digits = max(0, 1 - int(np.floor(np.log10(std)))) if std > 0 else 1
    return f"{value:.{digits}f} ± {std:.{digits}f}"


def _laser_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("pictures", type=Path, metavar="PICTURES", help="folder: the board, seen by the left camera")
    parser.add_argument("scans", type=Path, metavar="SCANS", help="folder: a recording of the laser for each picture")
    parser.add_argument(
        "--calibration", type=Path, required=True, metavar="FILE", help="calibration.json: is completed"
    )
    parser.add_argument("--board", required=True, metavar="9x6", help="inner corners, columns x rows")
    parser.add_argument("--square-mm", required=True, metavar="MM", help="edge of a square, or width x height")
    parser.add_argument(
        "--margin-mm", type=float, default=0.0, metavar="MM", help="board beyond its squares (default: 0)"
    )


def _calibrate_laser(arguments: argparse.Namespace) -> int:
    import numpy as np

    from stereolib.calibration import calibrate_lidar_to_camera, find_laser_boards_in_files
    from stereolib.cli.calibrate import parse_board
    from stereolib.measurement import save_lidar
    from stereolib.rig import StereoRig

    rig = StereoRig.load(arguments.calibration)
    board = parse_board(arguments.board, arguments.square_mm)
    files = []
    for folder, endings, what in ((arguments.pictures, _PICTURES, "pictures"), (arguments.scans, (".bin",), "scans")):
        if not folder.is_dir():
            raise ValueError(f"{folder} is no folder: it should hold the {what}")
        files.append(sorted(path for path in folder.iterdir() if path.suffix.lower() in endings))
    if len(files[0]) != len(files[1]) or not files[0]:
        raise ValueError(
            f"{len(files[0])} pictures ({' '.join(_PICTURES)}) and {len(files[1])} scans (.bin): there must be one "
            f"scan for each picture, in the order of their names"
        )
    views = find_laser_boards_in_files(files[0], files[1], board, rig.left, margin_mm=arguments.margin_mm)
    found = calibrate_lidar_to_camera(views)
    save_lidar(arguments.calibration, found)
    turn, shift = float(np.degrees(found.std_rad).max()), float(found.std_mm.max())
    x, y, z = found.T_left_lidar[:3, 3]
    print(f"laser: {len(views)} poses; known to {shift:.1f} mm and {turn:.2f} degrees (one standard deviation)")
    print(f"it stands {x:.0f} mm right of, {y:.0f} mm below and {z:.0f} mm before the left lens: check with a ruler")
    print(f"written into {arguments.calibration}")
    return 0


MEASURE = Command(
    "measure",
    "sizes of the things in a pair of pictures and a scan, with standard deviations",
    "stereolib measure left.jpg right.jpg --scan scan.bin --calibration calibration.json",
    _measure,
    _measure_arguments,
    notes=_NOTES,
)
CALIBRATE_LASER = Command(
    "calibrate-laser",
    "find where the laser stands to the left camera, from boards that both see",
    "stereolib calibrate-laser boards/left boards/scans --calibration calibration.json --board 6x9 --square-mm 30",
    _calibrate_laser,
    _laser_arguments,
)
