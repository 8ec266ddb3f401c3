"""The command ``stereolib map``: recordings of several stations to one map, its files and pictures."""

from __future__ import annotations

import argparse
import csv
import io
import json
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stereolib.base import counted, listed, plus_minus, rounded
from stereolib.cli.command import Command
from stereolib.cli.errors import DONE, REFUSED, without_python
from stereolib.cli.outputs import check_outputs, default_name
from stereolib.cli.told import object_details, object_facts, object_title, plain, say_on_a_terminal, wrapped

if TYPE_CHECKING:
    from stereolib.mapping import Map, RecordedMap, Station, StationFolder
    from stereolib.measurement import Instrument

#: Files of a map, and what they are.
_FILES = {
    "map.json": "objects, walls, stations and warnings, as --json prints them",
    "objects.csv": "the objects alone, for a spreadsheet",
    "map.png": "the map from above",
    "view.png": "the map in space",
    "map.glb": "objects and walls as solids, y up, m",
    "map.ply": "the same as one mesh, z up, m",
    "points.ply": "coloured points of all pairs, m",
    "grid.yaml": "free, taken and unknown cells, for ROS's map_server",
    "grid.pgm": "their picture",
}
_UNKNOWN = "red outline: not all of its sizes are known, and it is drawn thin or flat"
_WIDTH_IN, _MAP_IN = 9.5, 6.0  # of the picture, and of the map beside its legend
_NOTES = """\
FOLDER holds, for each place where the rig stood (its station):
  1_left.png 1_right.png   the pair, as the cameras gave it (PNG, JPEG, ...)
  1_scan.bin               the laser, as `stereolib lrf record` writes it, or 1_scan.csv: first line angle_deg,range_mm,
                           then a turn in even steps, counter-clockwise, 0 ahead, range empty where nothing was
                           measured; both of an XV-11, whose light starts 25 mm beside its axis
  2_left.png ...           and so on; names may be words, as door_left.png, and pairs as calibrate reads them (left01,
                           L_1, left/ and right/), scans then in scans/. A pair or a scan alone is a station, too
and for all of them:
  calibration.json         the rig and its laser (stereolib calibrate, calibrate-laser); scans alone need none, and
                           where poses have the left camera they then have the laser
  rig.toml                 instead of all that, a folder as `stereolib new` makes it
  poses.csv                if poses are known: first line station,x_mm,y_mm,yaw_deg, then a line a station: the place on
                           the floor below its left camera and where that looks, counter-clockwise from x
Without poses the first station with a scan is the origin, and the others are placed where their scans fit; given
poses are taken as known to 50 mm and 3 degrees and refined by the scans. Who has neither pose nor scan, fits in
several places, or has a scan that shows other things than its pictures, is left out and named; of a pair and a scan
one of which cannot be read, the other is mapped. Take stations a metre or so apart, each with a look at what the last
one saw.

written:
""" + "\n".join(f"  {name:12} {what}" for name, what in _FILES.items()) + """

exit code: 0 something was mapped, 1 nothing was, 2 wrong input
no rig yet? stereolib data walk walk; stereolib map walk"""  # fmt: skip


def _configure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="with the recordings, as below")
    parser.add_argument("--calibration", type=Path, metavar="FILE", help="default: FOLDER/calibration.json")
    parser.add_argument("--poses", type=Path, metavar="CSV", help="default: FOLDER/poses.csv, if it is there")
    parser.add_argument(
        "--output", type=Path, metavar="DIR", help="where to write; default: FOLDER's name with _map, here, numbered"
    )
    parser.add_argument("--force", action="store_true", help="replace a map that is there")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def _run(arguments: argparse.Namespace) -> int:
    from stereolib.mapping import NothingToMap, map_recordings

    out = arguments.output or default_name(Path(f"{arguments.folder.resolve().name}_map"), force=arguments.force)
    if in_the_way := [path for path in (out, *out.parents) if path.is_file()]:
        raise ValueError(f"--output must name a folder, but {in_the_way[0]} is a file")
    check_outputs([out / name for name in _FILES], force=arguments.force, option="--output")
    found, absent = _stations(arguments.folder, arguments.poses)
    instrument = _instrument(arguments, found)
    say_on_a_terminal(f"measuring {counted(len(found.stations), 'station')}, in some seconds ...")
    try:
        recorded = map_recordings(found.stations, instrument, progress=sys.stderr.isatty())
    except NothingToMap as error:
        print(wrapped([f"nothing was mapped: {_without_floor(str(error))}"]), file=sys.stderr)
        return REFUSED
    recorded = replace(recorded, left_out={name: _without_floor(why) for name, why in recorded.left_out.items()})
    unused = [name for name in found.unused if not _is_calibration(arguments.folder / name, arguments.calibration)]
    facts = map_facts(recorded) | {"unused_files": unused}
    say_on_a_terminal("drawing the map, in some seconds ...")
    written = _write(out, recorded, facts)
    if arguments.json:
        print(json.dumps(facts | {"written": [str(path) for path in written]}, indent=1, allow_nan=False))
        return DONE
    print(map_text(recorded))
    print(wrapped(f"left out: {text}" for text in absent), end="\n" if absent else "")
    if unused:
        print(wrapped([f"not used, as they belong to no station: {', '.join(unused)}"]))
    print(f"written to {out}: {', '.join(path.name for path in written)}")
    return DONE


def _without_floor(text: str) -> str:
    """What the library says, without the option --floor, which this command has not."""
    from stereolib.measurement import FLOOR_BY_HAND

    return without_python(text.replace(FLOOR_BY_HAND, ""))


def _stations(folder: Path, poses: Path | None) -> tuple[StationFolder, tuple[str, ...]]:
    """The stations of a folder; of a rig's folder those that its file names, and what lacks; else those in it."""
    from stereolib.mapping import RIG_FILE, NoStation, StationFolder, list_stations, load_rig_folder

    is_rig = (folder / RIG_FILE).is_file()
    if poses is None and is_rig and (own := load_rig_folder(folder, with_boards=False)).stations:
        return StationFolder(own.stations), own.absent
    try:
        found = list_stations(folder, poses)
    except NoStation as error:
        elsewhere = f"; nor are there any where its {RIG_FILE} says" if is_rig else ""
        raise ValueError(f"{error}{elsewhere}") from None
    return StationFolder(found.stations, tuple(name for name in found.unused if name != RIG_FILE)), ()


def _instrument(arguments: argparse.Namespace, found: StationFolder) -> Instrument:
    """The rig of the calibration; a laser that stands alone, where there is none and no station has a pair."""
    from stereolib.mapping import CALIBRATION, laser_alone
    from stereolib.measurement import Instrument

    path = arguments.calibration or arguments.folder / CALIBRATION
    if arguments.calibration is not None or path.is_file():
        return Instrument.load(path)
    if any(station.left for station in found.stations):
        raise ValueError(f"{arguments.folder} has no {CALIBRATION}: say with --calibration where the rig's is")
    return laser_alone()


def _is_calibration(path: Path, calibration: Path | None) -> bool:
    return calibration is not None and path.resolve() == calibration.resolve()


def map_facts(recorded: RecordedMap) -> dict[str, Any]:
    """What is in the map, ready for JSON: None where a thing is not known."""
    room = recorded.room
    objects = [
        {"name": name, **object_facts(each.fused), "seen_from": _seen_from(room, each.stations)}
        for name, each in zip(room.names, room.objects, strict=True)
    ]
    walls = [
        {
            "ends_mm": [[plain(v) for v in end] for end in wall.ends_mm],
            "ends": list(wall.ends),
            "length_mm": plain(wall.length_mm),
            "offset_std_mm": plain(wall.offset_std_mm),
        }
        for wall in room.walls
    ]
    return {
        "frame": "x forward, y left, mm, rad; one standard deviation; origin and x as poses.csv has them, else on the "
        "floor below the left camera (without a calibration: the laser) of the first station with a scan, x ahead",
        "objects": objects,
        "walls": walls,
        "stations": [_station_facts(recorded, station) for station in room.stations],
        "left_out": recorded.left_out,
        "measured_apart": {name: [object_facts(item) for item in it.objects] for name, it in recorded.apart.items()},
        "warnings": [*room.warnings, *recorded.warnings],
    }


def _station_facts(recorded: RecordedMap, station: Station) -> dict[str, Any]:
    x, y, yaw = station.pose
    std = [math.sqrt(station.covariance[k, k]) for k in range(3)]
    return {
        "name": station.name,
        "pose": {"x_mm": plain(x), "y_mm": plain(y), "yaw_rad": plain(yaw)},
        "pose_std": {"x_mm": plain(std[0]), "y_mm": plain(std[1]), "yaw_rad": plain(std[2])},
        "objects_seen": len(station.objects),
        "readings": len(station.scan_mm),
        "warnings": recorded.said_of(station.name),
    }


def map_text(recorded: RecordedMap) -> str:
    """A block for each object, their sums, and a line for each station with what is to be said of it."""
    import numpy as np

    room = recorded.room
    stations = counted(len(room.stations), "station")
    lines = [f"{counted(len(room.objects), 'object')}, {counted(len(room.walls), 'wall')}, from {stations}"]
    for name, each in zip(room.names, room.objects, strict=True):
        x, y = each.fused.position_mm
        place = f"at x {rounded(x)}, y {rounded(y)} mm, seen from station {', '.join(_seen_from(room, each.stations))}"
        lines += [object_title(name, each.fused), *(f"   {line}" for line in object_details(each.fused, place))]
    whole = sum(math.isfinite(item.volume_l[0]) for item in room.measured)
    if whole > 1:
        (volume, std), (area, area_std) = room.volume_l, room.surface_m2
        sums = f"{plus_minus(volume, std)} l, {plus_minus(area, area_std)} m2"
        lines.append(f"the {whole} objects of which all sizes are known: {sums}")
    for station in room.stations:
        lines.append(f"station {station.name}: {_pose_text(station)}")
    for name, why in recorded.left_out.items():
        lines.append(f"station {name} is left out: {why}")
        alone = recorded.apart[name].objects if name in recorded.apart else ()
        for item in (item for item in alone if np.isfinite(item.size_mm).any()):
            lines.append(object_title("   measured there, not in the map:", item))
    warnings = *room.said, *recorded.warnings, *_said_at_stations(recorded)
    return wrapped([*lines, *(f"warning: {text}" for text in warnings)])


def _said_at_stations(recorded: RecordedMap) -> list[str]:
    """What is to be said of stations' measurements; what is said of several, once."""
    at = dict[str, list[str]]()
    for station in recorded.room.stations:
        for text in recorded.said_of(station.name):
            at.setdefault(text, []).append(station.name)
    return [f"station{'s' * (len(names) > 1)} {listed(names)}: {text}" for text, names in at.items()]


def _pose_text(station: Station) -> str:
    x, y, yaw = station.pose
    place = f"x {rounded(x)}, y {rounded(y)} mm, looks {rounded(math.degrees(yaw), 1)} degrees"
    if not station.covariance.any():
        return place
    dx, dy, turn = (math.sqrt(station.covariance[k, k]) for k in range(3))
    return f"{place} (± {dx:.1f} mm, {dy:.1f} mm, {math.degrees(turn):.2f} degrees by its scan)"


def _seen_from(room: Map, numbers: tuple[int, ...]) -> list[str]:
    return [room.stations[k - 1].name for k in sorted(numbers)]


def _write(out: Path, recorded: RecordedMap, facts: dict[str, Any]) -> list[Path]:
    """Write all files that the map can fill; those of an older map that it cannot are taken away."""
    import cv2

    from stereolib.base import write_atomic
    from stereolib.mapping import map_solids, occupancy_grid, view_map, write_cloud, write_grid, write_mesh
    from stereolib.measurement import add_caption
    from stereolib.plotting import panels, plot_top_view, show_figure

    room, solids, points = recorded.room, map_solids(recorded.room), recorded.cloud()
    figure, ax = panels(1, width_in=_WIDTH_IN)
    low, high = zip(*(plot_top_view(room, ax[0]).get_xlim(), ax[0].get_ylim()), strict=True)
    figure.set_size_inches(_WIDTH_IN, 1 + _MAP_IN * max((high[1] - low[1]) / (high[0] - low[0]), 0.5))
    view = view_map(room, solids)
    if not all(solid.known for solid in solids):
        view = add_caption(view, _UNKNOWN)
    written = [
        write_atomic(out / "map.json", json.dumps(facts, indent=1, allow_nan=False) + "\n"),
        write_atomic(out / "objects.csv", _table(facts["objects"])),
        write_atomic(out / "map.png", show_figure(None, figure).data),
        write_atomic(out / "view.png", cv2.imencode(".png", view)[1].tobytes()),
        *(write_mesh(out / f"map.{kind}", solids, overwrite=True) for kind in ("glb", "ply")),
    ]
    if points is not None and len(points.points_mm):
        written.append(write_cloud(out / "points.ply", points, overwrite=True))
    if len(room.readings_mm):
        written += write_grid(out / "grid.yaml", occupancy_grid(room.stations, objects=room.measured), overwrite=True)
    for name in _FILES:
        if out / name not in written:
            (out / name).unlink(missing_ok=True)
    return written


def _table(objects: list[dict[str, Any]]) -> str:
    """Objects as CSV: a line each, lists and texts joined."""
    stream = io.StringIO()
    sizes = [f"{size}{kind}" for size in ("length", "width", "height") for kind in ("_mm", "_std_mm")]
    sums = ("volume_l", "volume_std_l", "surface_m2", "surface_std_m2")
    columns = ("name", "shape", *sizes, *sums, "x_mm", "y_mm", "yaw_rad", "yaw_deg", "seen_from", "unknown")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    for each in objects:
        x, y = each["position_mm"]
        texts = {
            "seen_from": " ".join(each["seen_from"]),
            "unknown": "; ".join(map(": ".join, each["reasons"].items())),
        }
        turned = None if each["yaw_rad"] is None else plain(math.degrees(each["yaw_rad"]))
        row = each | {"x_mm": x, "y_mm": y, "yaw_deg": turned} | texts
        writer.writerow(["" if row[column] is None else row[column] for column in columns])
    return stream.getvalue()


MAP = Command(
    "map",
    "one map of several stations: objects with sizes, walls, free floor, from pairs of pictures and scans",
    "stereolib map walk --output walk_map",
    _run,
    _configure,
    notes=_NOTES,
    interrupted="files that were written stay; run it again, with --force if there are any",
)
