"""The command ``stereolib measure``: sizes of objects from a pair of pictures and a scan."""

from __future__ import annotations

import argparse
import itertools
import json
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stereolib.cli.boards import add_pair, said_of
from stereolib.cli.command import Command
from stereolib.cli.errors import DONE, REFUSED, Refused, named
from stereolib.cli.outputs import check_ending, check_outputs, default_name
from stereolib.cli.ranges import MM, number
from stereolib.cli.told import SIZES, object_details, object_facts, object_sizes, object_title, wrapped

if TYPE_CHECKING:
    from stereolib.base import UInt8
    from stereolib.measurement import Floor, Instrument, MeasuredObject, Measurement
    from stereolib.rig import RectifiedRig

_FLOOR_STD = (1.0, 0.2)  # mm, degrees: what a ruler and a phone's level tell
_STEEPEST = 90.0  # degrees
_LAST_PX = 2**15  # no picture is larger
_LEAST_MM = 15.0  # above its floor: half of the smallest webcam; 8.5 was meant in centimetres
#: Below a picture: whose pixels are its own.
_BLACK, _RED = "#000000", "#b00000"
_AS_GIVEN = "LEFT as the camera gave it: pixels for --between"
_READINGS = "green: the laser's readings, as if they lay on the floor"
_HIDDEN = "dashed: edges that the box itself hides"
_BESIDE = ", beside the left picture"
_RECTIFIED = "rectified: its pixels are for --between ... --rectified, they are not those of LEFT"

_NOTES = """\
A box shows two faces: length, width, height. A face shows one: its width, as its depth is hidden. Round things have a
diameter. Irregular ones and pieces of wall have no sizes. Deviations (±) are one standard deviation: the truth lies
within twice that in 19 of 20 cases. Places are told from the floor below the left camera: ahead along its axis, and to
the left; turned: the direction of the length (of a face: of the face), counter-clockwise from ahead. Several pairs with
their scans, taken in one place after the other, are one map: stereolib map FOLDER.
exit code: 0 something was measured, 1 nothing was, 2 wrong input"""


def _configure(parser: argparse.ArgumentParser) -> None:
    add_pair(parser)
    parser.add_argument(
        "--scan",
        type=Path,
        metavar="FILE",
        help="the laser, recorded at the same time (lrf record), or a .csv: angle_deg,range_mm",
    )
    parser.add_argument("--calibration", type=Path, required=True, metavar="FILE", help="calibration.json")
    parser.add_argument(
        "--floor",
        type=_floor,
        metavar="HEIGHT,PITCH",
        help="height of the left camera over the floor, mm, and angle of its view above the horizon, degrees, where no "
        f"floor is seen; taken as right to {_FLOOR_STD[0]:g} mm and {_FLOOR_STD[1]:g} degrees, or to what is added "
        "(HEIGHT,PITCH,STD,STD). --floor=450,-20 looks down by 20 degrees",
    )
    parser.add_argument(
        "--between",
        nargs=2,
        type=_pixel,
        metavar="X,Y",
        help="only this, without a floor: how far the points at two pixels, columns and rows, lie apart, pixels of "
        "LEFT as the camera gave it, or with --rectified; its ± holds half a pixel of picking in each",
    )
    parser.add_argument(
        "--rectified",
        action="store_true",
        help="the pixels of --between are those of the rectified left picture, which is what this command draws else, "
        "and what all pictures and maps of disparity and of report are",
    )
    parser.add_argument(
        "--output", type=Path, metavar="PNG", help="default: LEFT's name with _measured.png, here; numbered"
    )
    parser.add_argument("--picture", dest="output", type=Path, help=argparse.SUPPRESS)  # what it was called
    parser.add_argument("--force", action="store_true", help="replace the picture if it is there")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def _run(arguments: argparse.Namespace) -> int:
    from stereolib.base import write_atomic
    from stereolib.mapping import read_scan
    from stereolib.matching import check_matchable
    from stereolib.measurement import CannotMeasure, Instrument, draw_objects, measure_objects
    from stereolib.plotting import picture_with_pixels
    from stereolib.rig import find_pair, read_pair

    own = Path(f"{arguments.left.stem}_measured.png")
    picture = arguments.output or default_name(own, force=arguments.force)
    check_ending(picture, ".png", "the picture")
    check_outputs([picture], force=arguments.force, option="--output")
    if arguments.rectified and not arguments.between:
        raise ValueError("--rectified says of which picture the pixels of --between are: give both, or neither")
    if arguments.between and (idle := [f"--{n}" for n in ("scan", "floor") if getattr(arguments, n) is not None]):
        raise ValueError(f"--between measures in the pictures alone: leave {' and '.join(idle)} away")
    instrument, files = Instrument.load(arguments.calibration), find_pair(arguments.left, arguments.right)
    pair = read_pair(*files)
    check_matchable(*pair, (str(files[0]), str(files[1])))
    if arguments.between:
        with named(*files):
            drawn, facts, told = between(pair, arguments.between, instrument, is_rectified=arguments.rectified)
        caption = _RECTIFIED if arguments.rectified else _AS_GIVEN
        first, then = said_of(arguments.calibration), facts["warnings"]
        facts |= {"warnings": first + then, "picture": str(picture)}
        lines = [(told.splitlines()[0], _BLACK), *_warning_lines(facts["warnings"]), (caption, _BLACK)]
        write_atomic(picture, picture_with_pixels(drawn, lines))
        said = [*_warned(first), told, *_warned(then), f"picture: {picture}"]
        print(json.dumps(facts, indent=1, allow_nan=False) if arguments.json else "\n".join(said))
        return DONE
    scan = None if arguments.scan is None else read_scan(arguments.scan)
    floor = None if arguments.floor is None else floor_by_hand(instrument.rectified, arguments.floor)
    first = said_of(arguments.calibration)
    try:
        with named(*files):
            measured = measure_objects(*pair, scan, instrument, floor=floor)
    except ValueError as error:
        if not isinstance(error.__cause__ or error, CannotMeasure):
            raise
        raise Refused(str(error)) from error
    measured, first = replace(measured, said=(*first, *measured.said)), [*first, *measured.doubts]
    key = [_READINGS, _HIDDEN] if len(measured.scan_mm) else [_HIDDEN]
    about = [*_size_lines(measured), *_warning_lines(measured.warnings)]
    lines = [*about, *((text, _BLACK) for text in (SIZES, "; ".join(key), _RECTIFIED))]
    write_atomic(picture, picture_with_pixels(draw_objects(measured), lines))
    facts = measured_facts(measured) | {"picture": str(picture)}
    print(json.dumps(facts, indent=1, allow_nan=False) if arguments.json else measured_text(measured, first))
    if not arguments.json:
        print(f"picture: {picture}")
    return DONE if any(entry["height_mm"] or entry["width_mm"] for entry in facts["objects"]) else REFUSED


def between(
    pair: tuple[UInt8, UInt8],
    pixels: Sequence[tuple[float, float]],
    instrument: Instrument,
    *,
    is_rectified: bool = False,
) -> tuple[UInt8, dict[str, Any], str]:
    """A picture with the line between two pixels, its length as facts and as a sentence."""
    from stereolib.measurement import draw_length, length_between, moved_back

    if pixels[0] == pixels[1]:
        raise ValueError(f"--between needs two pixels, got {pixels[0][0]:g},{pixels[0][1]:g} twice")
    try:
        found = length_between(*pair, pixels, instrument, is_rectified=is_rectified)
    except ValueError as error:
        other = "" if is_rectified else "; pixels that were read off a rectified picture need --rectified"
        raise ValueError(f"{error}{other}") from None
    left, frame = pair[0], "left, as the camera gave it"
    if is_rectified:
        now = moved_back(*pair, instrument)
        left, frame = now.rectified.rectify(*pair)[0], "left, rectified"
    facts: dict[str, Any] = {"length_mm": found.length_mm, "std_mm": found.std_mm}
    facts |= {"pixels": [list(at) for at in pixels], "pixels_of": frame}
    facts |= {"points_mm": found.points_mm.tolist(), "disparity_px": found.disparity_px.tolist()}
    facts |= {"warnings": list(found.warnings)}
    depths = " and ".join(f"{depth:.0f} mm" for depth in found.depth_mm)
    told = f"{found.length_mm:.1f} ± {found.std_mm:.1f} mm (one standard deviation), at depths of {depths}"
    told += "\nfrom pixel to pixel: what lies between a pixel and the thing's edge is not in it"
    told += "; without --between, things are told from edge to edge"
    told += f"\nthe pixels were taken for those of this picture: {frame}"
    drawn = f"{found.length_mm:.1f}+-{found.std_mm:.1f} mm"  # OpenCV 4 cannot write a ±
    return draw_length(left, pixels, drawn), facts, told


def _pixel(text: str) -> tuple[float, float]:
    """Column and row of ``X,Y``."""
    inside = number(0, _LAST_PX)
    try:
        column, row = (inside(part) for part in text.split(","))
    except (ValueError, argparse.ArgumentTypeError):
        raise argparse.ArgumentTypeError(f"{text!r} is not X,Y: a column and a row from 0 on, as 320,240") from None
    return column, row


def _floor(text: str) -> tuple[float, ...]:
    """Height and pitch with their deviations, mm and degrees, from ``HEIGHT,PITCH`` or ``HEIGHT,PITCH,STD,STD``."""
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    numbers += _FLOOR_STD if len(numbers) == len(_FLOOR_STD) else ()
    if len(numbers) != 2 * len(_FLOOR_STD):
        why = f"{text!r} is not HEIGHT,PITCH (mm, degrees; negative looks down)"
        raise argparse.ArgumentTypeError(f"{why}: write for example --floor=450,-20")
    height, pitch, *deviations = numbers
    if 0 < height < _LEAST_MM:
        raise argparse.ArgumentTypeError(f"{text!r}: the height is in millimetres, and no lens is {height:g} mm up")
    if not (0 < height <= MM and abs(pitch) < _STEEPEST and all(0 <= std < height for std in deviations)):
        heights = f"the height must be above 0 mm and up to {MM:g}"
        why = f"{text!r}: {heights}, the pitch between -{_STEEPEST:g} and {_STEEPEST:g} degrees"
        raise argparse.ArgumentTypeError(f"{why}, deviations not negative")
    return numbers


def floor_by_hand(rectified: RectifiedRig, numbers: tuple[float, ...]) -> Floor:
    """The floor below a camera that is level from side to side: height, pitch and their deviations, mm and degrees."""
    import numpy as np

    from stereolib.measurement import floor_from_pose
    from stereolib.rig import pose_left_world, rigid

    (height, _), (pitch, std) = numbers[::2], np.radians(numbers[1::2]).tolist()
    pose = rigid(rectified.R1.T, np.zeros(3)) @ pose_left_world(pitch, height)
    return floor_from_pose(rectified, pose, height_std_mm=numbers[2], pitch_std_rad=std, roll_std_rad=std)


def measured_facts(measured: Measurement) -> dict[str, Any]:
    """What was measured, ready for JSON: None where a thing is not known."""
    from stereolib.measurement import is_pictured

    return {
        "frame": "floor below the left camera; x forward, y left, mm, rad; one standard deviation",
        "objects": [object_facts(item) | {"in_picture": is_pictured(measured, item)} for item in measured.objects],
        "warnings": list(measured.warnings),
    }


def measured_text(measured: Measurement, first: Sequence[str] = ()) -> str:
    """A block for each object: sizes with one standard deviation, place, and what is not known, and why.

    Those of the warnings that make all sizes doubtful, `first`, stand before them.
    """
    from stereolib.measurement import is_pictured

    lines, nameless = _warned(first), [item for item in measured.objects if _is_nameless(item)]
    for k, item in enumerate((item for item in measured.objects if item not in nameless), start=1):
        beside = "" if measured.floor is None or is_pictured(measured, item) else _BESIDE
        details = object_details(item, f"at {_place(*item.position_mm)}{beside}")
        lines += [object_title(str(k), item), *(f"   {line}" for line in details)]
    if nameless:
        lines.append("also seen, but not measurable:")
        lines += [f"   {_place(*item.position_mm)}: {_why_none(item)}" for item in nameless]
    return wrapped([*lines, *_warned(text for text in measured.warnings if text not in first)])


def _warned(texts: Iterable[str]) -> list[str]:
    return [f"warning: {text}" for text in texts]


def _size_lines(measured: Measurement) -> list[tuple[str, str]]:
    """What is written below the picture: sizes with their deviations, numbered as in the terminal, in its colours.

    Then why what else the picture shows has none.
    """
    from stereolib.measurement import OBJECT_RGB, is_pictured
    from stereolib.measurement.overlay import why_text

    colors = (f"#{r:02x}{g:02x}{b:02x}" for r, g, b in itertools.cycle(OBJECT_RGB))
    every = list(zip(measured.objects, colors, strict=False))
    things = [(item, color) for item, color in every if not _is_nameless(item)]
    lines = [(object_sizes(str(k), item), color) for k, (item, color) in enumerate(things, start=1)]
    nameless = [(item, color) for item, color in every if _is_nameless(item) and is_pictured(measured, item)]
    return lines + [(why_text(item), color) for item, color in nameless]


def _warning_lines(warnings: Sequence[str]) -> list[tuple[str, str]]:
    """What of the warnings is written below a picture, which may be looked at without the text: what is wrong."""
    return [(f"warning: {re.split('[:;]', text)[0]}", _RED) for text in warnings]


def _is_nameless(item: MeasuredObject) -> bool:
    """Tell whether nothing of its size is known."""
    return all(map(math.isnan, item.size_mm))


def _why_none(item: MeasuredObject) -> str:
    """Why a thing has no size at all."""
    return "; ".join(dict.fromkeys(map(str, item.reasons.values()))) or "a piece of wall, or of something larger"


def _place(ahead_mm: float, left_mm: float) -> str:
    """Where on the floor, in words."""
    return f"{ahead_mm:.0f} mm ahead, {abs(left_mm):.0f} mm {'left' if left_mm >= 0 else 'right'}"


MEASURE = Command(
    "measure",
    "sizes of the things in a pair of pictures and a scan, with standard deviations",
    "stereolib measure left.jpg right.jpg --scan scan.bin --calibration calibration.json --floor=450,-20",
    _run,
    _configure,
    notes=_NOTES,
)
