"""The command ``stereolib measure``: sizes of objects from a pair of pictures and a scan."""

from __future__ import annotations

import argparse
import json
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stereolib.base import plus_minus
from stereolib.cli.command import Command
from stereolib.cli.errors import DONE, REFUSED
from stereolib.cli.outputs import check_ending, check_outputs

if TYPE_CHECKING:
    from stereolib.measurement import MeasuredObject, Measurement

_NOTES = """\
A box shows two faces: length, width, height. A face shows one: its width, as its depth is hidden. Round things have a
diameter. Irregular ones and pieces of wall have no sizes. Deviations (±) are one standard deviation: the truth lies
within twice that in 19 of 20 cases. Places are told from the floor below the left camera: ahead along its axis, and to
the left; turned: the direction of the length (of a face: of the face), counter-clockwise from ahead.
exit code: 0 something was measured, 1 nothing was, 2 wrong input"""


def _configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("left", type=Path, metavar="LEFT", help="picture of the left camera, as it comes")
    parser.add_argument("right", type=Path, metavar="RIGHT", help="picture of the right camera")
    parser.add_argument("--scan", type=Path, metavar="FILE", help="the laser, recorded at the same time (lrf record)")
    parser.add_argument("--calibration", type=Path, required=True, metavar="FILE", help="calibration.json")
    parser.add_argument("--picture", type=Path, metavar="PNG", help="default: LEFT's name with _measured.png, here")
    parser.add_argument("--force", action="store_true", help="replace the picture if it is there")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def _run(arguments: argparse.Namespace) -> int:
    import cv2
    import numpy as np

    from stereolib import laser
    from stereolib.base import write_atomic
    from stereolib.measurement import Instrument, draw_objects, measure_objects
    from stereolib.rig import read_pair

    picture = arguments.picture or Path(f"{arguments.left.stem}_measured.png")
    check_ending(picture, ".png", "the picture")
    check_outputs([picture], force=arguments.force, option="--picture")
    instrument = Instrument.load(arguments.calibration)
    pair = read_pair(arguments.left, arguments.right)
    scan = None if arguments.scan is None else laser.average(laser.turns(laser.read_recording(arguments.scan)))
    rng = np.random.default_rng(0)  # of the search for the floor: the same pair gives the same sizes
    measured = measure_objects(*pair, scan, instrument, rng=rng)
    write_atomic(picture, cv2.imencode(".png", draw_objects(measured))[1].tobytes())
    facts = measured_facts(measured) | {"picture": str(picture)}
    print(json.dumps(facts, indent=1, allow_nan=False) if arguments.json else measured_text(measured))
    if not arguments.json:
        print(f"picture: {picture}")
    return DONE if any(entry["height_mm"] or entry["width_mm"] for entry in facts["objects"]) else REFUSED


def measured_facts(measured: Measurement) -> dict[str, Any]:
    """What was measured, ready for JSON: None where a thing is not known."""
    import numpy as np

    def plain(value: float) -> float | None:
        return round(float(value), 4) if np.isfinite(value) else None

    entries = []
    for item in measured.objects:
        entry: dict[str, Any] = {"shape": item.shape}
        for name, size, std in zip(("length", "width", "height"), item.size_mm, item.std_mm, strict=True):
            entry |= {f"{name}_mm": plain(size), f"{name}_std_mm": plain(std)}
        volume, area = item.volume_l, item.surface_m2
        entry |= {"volume_l": plain(volume[0]), "volume_std_l": plain(volume[1])}
        entry |= {"surface_m2": plain(area[0]), "surface_std_m2": plain(area[1])}
        entry["position_mm"] = [plain(value) for value in item.position_mm]
        entry["position_std_mm"] = [plain(value) for value in np.sqrt(np.diag(item.position_covariance))]
        entry |= {"yaw_rad": plain(item.yaw_rad), "yaw_std_rad": plain(item.yaw_std_rad)}
        entries.append(entry | {"sources": item.sources, "reasons": item.reasons})
    return {
        "frame": "floor below the left camera; x forward, y left, mm, rad; one standard deviation",
        "objects": entries,
        "warnings": list(measured.warnings),
    }


def measured_text(measured: Measurement) -> str:
    """A block for each object: sizes with one standard deviation, place, and what is not known, and why."""
    import numpy as np

    lines, nameless = [], [item for item in measured.objects if np.isnan(item.size_mm).all()]
    for k, item in enumerate(item for item in measured.objects if item not in nameless):
        sizes = " x ".join(plus_minus(size, std) for size, std in zip(item.size_mm, item.std_mm, strict=True))
        lines.append(f"{k + 1}  {item.shape}: {sizes} mm (length x width x height, ± one standard deviation)")
        lines += [f"   {line}" for line in _details(item)]
    if nameless:
        places = "; ".join(f"{x:.0f} mm ahead, {y:+.0f} mm left" for x, y in (item.position_mm for item in nameless))
        lines.append(f"also seen, but not measurable (pieces of wall, what is cut or hidden): {places}")
    lines += [f"warning: {text}" for text in measured.warnings]
    return "\n".join(
        part for line in lines for part in textwrap.wrap(line, 120, subsequent_indent="     ", drop_whitespace=False)
    )


def _details(item: MeasuredObject) -> list[str]:
    import numpy as np

    x, y = item.position_mm
    place = f"at {x:.0f} mm ahead, {abs(y):.0f} mm {'left' if y >= 0 else 'right'}"
    turned = "" if np.isnan(item.yaw_rad) else f", turned by {np.degrees(item.yaw_rad):.1f} degrees"
    lines = [place + turned]
    volume, std = item.volume_l
    if np.isfinite(volume):
        area, area_std = item.surface_m2
        lines.append(f"volume {plus_minus(volume, std)} l, surface {plus_minus(area, area_std)} m2 (sides and top)")
    if item.sources:
        lines.append("; ".join(f"{what}: {who}" for what, who in item.sources.items()))
    return lines + [f"no {what}: {why}" if what != "object" else why for what, why in item.reasons.items()]


MEASURE = Command(
    "measure",
    "sizes of the things in a pair of pictures and a scan, with standard deviations",
    "stereolib measure left.jpg right.jpg --scan scan.bin --calibration calibration.json",
    _run,
    _configure,
    notes=_NOTES,
)
