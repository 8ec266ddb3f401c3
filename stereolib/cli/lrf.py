"""The commands of the laser range finder: ``stereolib lrf ...``."""

from __future__ import annotations

import argparse
import contextlib
import itertools
import json
import re
import sys
from pathlib import Path
from typing import Any

from stereolib.base import check_target, counted, read_bytes
from stereolib.cli.command import Command
from stereolib.cli.errors import DONE, INTERRUPTED, REFUSED
from stereolib.cli.lrf_live import EXPORT, LIVE, MOST_TURNS, NO_LASER, combined
from stereolib.cli.outputs import check_ending, check_outputs, default_name
from stereolib.cli.ranges import FOR_EVER, number, whole
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

_LEAST_PARTS = 3  # turns that lack packets, from which map makes a scan where none is whole
_LOSSY = 0.05  # share of the packets; then hardly a turn is whole
_TOO_SHORT = "nothing can use it: a turn takes the sensor 0.2 s; record for a second or longer"
#: Fact of a recording -> what it is called for people.
_TOLD = {
    "firmware": "sent as", "packets": "packets", "bad_checksums": "packets with a wrong checksum",
    "skipped_bytes": "bytes that are of no packet", "index_jumps": "gaps where packets are missing",
    "turns": "whole turns", "partial_turns": "turns that lack packets", "rpm_min": "slowest, turns a minute",
    "rpm_median": "median, turns a minute", "rpm_max": "fastest, turns a minute",
    "lost_share": "packets that are missing", "invalid_share": "readings without a distance",
}  # fmt: skip
_SECONDS = 3  # of a recording that is proposed: 15 turns
_EMULATE_NOTES = f"""it prints a port, which the other commands take, and plays when that is opened, until Ctrl-C.
--rig 0 is the laser below the left camera of the paper's rig, every other number that of a rig which nobody has
described: the one whose cameras stereolib emulate-cameras shows with the same --rig, --scene and --at.

{SCENES_TOLD}"""


def _configure_info(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE", help="raw bytes, as `lrf record` writes them")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def _info(arguments: argparse.Namespace) -> int:
    from stereolib import laser

    _check_no_table(arguments.file)
    facts = laser.recording_info(arguments.file)
    if arguments.json:
        print(json.dumps(facts, indent=1))
    else:
        width = max(map(len, _TOLD.values()))
        print(*(f"{what:{width}}  {_in_words(name, facts[name])}" for name, what in _TOLD.items()), sep="\n")
    if facts["damage"]:
        print(f"{arguments.file}: {facts['damage']}", file=sys.stderr)
        return REFUSED
    if not facts["turns"] and facts["partial_turns"] < _LEAST_PARTS:
        print(f"{arguments.file} holds no whole turn, and {_TOO_SHORT}", file=sys.stderr)
        return REFUSED
    return DONE


def _in_words(name: str, value: Any) -> str:
    if value is None:
        return "unknown"
    if name.endswith("_share"):
        return f"{100 * value:.1f} %"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _check_no_table(path: Path) -> None:
    """Refuse a table of ranges, in whose text a recording's packets would be looked for."""
    if path.suffix.lower() == ".csv":
        raise ValueError(f"{path}: a table of ranges is for measure, map and calibrate-laser; this takes recordings")


def _configure_show(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("source", metavar="FILE|PORT", help="a recording, or the port of a sensor or emulator")
    parser.add_argument(
        "--turns", type=whole(1, MOST_TURNS), default=5, metavar="N", help="turns combined by the median (default: 5)"
    )
    parser.add_argument("--output", type=Path, metavar="PNG", help="default: NAME.png in this folder; numbered")
    parser.add_argument("--force", action="store_true", help="replace the picture if it is there")


def _show(arguments: argparse.Namespace) -> int:
    from stereolib import plotting
    from stereolib.base import write_atomic

    _check_no_table(Path(arguments.source))
    stem, name = _called(arguments.source)
    output = arguments.output or default_name(Path(f"{stem}.png"), force=arguments.force)
    check_ending(output, ".png", "the picture")
    check_outputs([output], force=arguments.force, option="--output")
    scan = combined(arguments.source, arguments.turns)
    figure, ax = plotting.panels(1, width_in=7, aspect=1.0, subplot_kw={"projection": "polar"})
    title = f"{plotting.as_written(name)}: median of {counted(scan.n_turns, 'turn')}, mm"
    plotting.plot_scan_polar(scan.angles_rad, scan.ranges_mm, ax[0], title)
    write_atomic(output, plotting.show_figure(None, figure).data)
    print(f"{output}: {int((scan.count > 0).sum())} of 360 beams with a reading, {scan.speed_rpm:.0f} turns a minute")
    return DONE


def _called(source: str) -> tuple[str, str]:
    """How a picture of a file or a port is named, and what its title calls it."""
    if (path := Path(source)).is_file():
        return path.stem, path.name
    if path.is_dir():
        raise ValueError(f"{path}: is a folder; name a file in it")
    port = source.removeprefix("/dev/").rpartition("://")[2] or source
    return re.sub(r"[^\w.-]+", "_", port), port


def _configure_record(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("port", metavar="PORT", help="for example /dev/ttyUSB0, COM3 or socket://127.0.0.1:4000")
    parser.add_argument("file", type=Path, metavar="FILE", help="what to write; FILE.json beside it has the notes")
    parser.add_argument(
        "--seconds", type=number(0, FOR_EVER), default=FOR_EVER, metavar="S", help="default: until Ctrl-C"
    )
    parser.add_argument("--force", action="store_true", help="replace a recording that is there")


def _record(arguments: argparse.Namespace) -> int:
    from stereolib import laser

    def live(state: dict[str, Any]) -> None:
        speed = "no packets yet"
        if state["rpm"] is not None:
            speed = f"{state['rpm']:.0f} rpm, {state['valid_share']:.0%} valid, {state['lost_share']:.0%} lost"
        line = f"{state['seconds']:6.1f} s  {state['turns']} turns  {state['bytes']} bytes  {speed}"
        print(f"\r{line:70}", end="", file=sys.stderr, flush=True)

    file = arguments.file
    check_target(file)
    missing = [folder for folder in file.parents if not folder.exists()]
    file.parent.mkdir(parents=True, exist_ok=True)
    try:
        notes = laser.record_port(arguments.port, file, force=arguments.force, seconds=arguments.seconds, progress=live)
    finally:
        for folder in missing:  # that nothing came into
            with contextlib.suppress(OSError):
                folder.rmdir()
    print(file=sys.stderr)
    if notes["failed"]:
        raise laser.LidarError(f"{notes['ended']}; kept in {file}: {notes['bytes']} bytes")
    print(f"{file}: {notes['bytes']} bytes; ended: {notes['ended']}")
    more = f"stereolib lrf info {file} says more"
    if (lost := notes["lost_share"]) is None:
        print(f"warning: no XV-11 packet is in it: {more}", file=sys.stderr)
    elif lost > _LOSSY:
        advice = "see to cable, plug and port, and record again"
        print(f"warning: {lost:.0%} of the packets were lost or damaged on the line: {advice}; {more}", file=sys.stderr)
    return DONE


def _configure_replay(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, metavar="FILE", help="a recording")
    parser.add_argument("--link", choices=("auto", "pty", "socket"), default="auto", help="what to serve it on")


def _replay(arguments: argparse.Namespace) -> int:
    from stereolib import laser
    from stereolib.virtual import emulator

    _check_no_table(arguments.file)
    data = read_bytes(arguments.file)
    laser.decode_recording(data, str(arguments.file))  # says what is wrong with a file that is no recording
    return _serve(emulator.replay(data), arguments.link)


def _configure_emulate(parser: argparse.ArgumentParser) -> None:
    add_scene(parser)
    parser.add_argument(
        "--seconds", type=number(0, FOR_EVER), default=FOR_EVER, metavar="S", help="default: until Ctrl-C"
    )
    parser.add_argument(
        "--seed", type=whole(0, 2**32 - 1), default=0, metavar="N", help="of noise and faults (default: 0)"
    )
    parser.add_argument("--link", choices=("auto", "pty", "socket"), default="auto", help="what to serve it on")
    for name, what in (
        ("bit-error-rate", "chance of each bit to flip"),
        ("lost-byte-rate", "chance of each byte to be lost"),
        ("stall-every-s", "the line is silent this often"),
        ("stall-s", "and for so long"),
        ("spin-down-after-s", "the motor runs out from then on"),
        ("disconnect-after-s", "the port goes away"),
    ):
        most = 1.0 if name.endswith("rate") else FOR_EVER
        parser.add_argument(f"--{name}", type=number(0, most), metavar="X", help=what)


def _emulate(arguments: argparse.Namespace) -> int:
    from dataclasses import fields

    import numpy as np

    from stereolib.virtual import VirtualLidar, emulator

    check_scene(arguments)
    if (arguments.stall_s is None) != (arguments.stall_every_s is None):
        raise ValueError("--stall-every-s and --stall-s belong together: give both, or neither")
    names = [field.name for field in fields(emulator.Faults)]
    given = {name: getattr(arguments, name) for name in names if getattr(arguments, name) is not None}
    shown, rng = staged(arguments), np.random.default_rng(arguments.seed)
    lidar = VirtualLidar(height_mm=shown.laser_height_mm)
    schedule = emulator.emulate(shown.scene, shown.laser_pose, lidar=lidar, rng=rng, seconds=arguments.seconds)
    first = list(itertools.islice(schedule, 1))  # takes seconds on a busy machine: before somebody listens and gives up
    schedule = itertools.chain(first, schedule)
    if given:
        schedule = emulator.with_faults(schedule, emulator.Faults(**given), rng)
    place = place_number(arguments)
    file = f"{place_folder(arguments)}/scans/{place:02d}.bin"
    return _serve(schedule, arguments.link, truth(arguments, shown) if arguments.truth else "", file, place)


def _serve(schedule: Any, link: Any, about: str = "", file: str = "", place: int = 1) -> int:
    """Play until Ctrl-C; `file` is where a recording of this place belongs."""
    from stereolib.virtual import emulator

    with emulator.serve(schedule, link) as served:
        example = f"plays when it is opened, for example: stereolib lrf show {served.port}"
        record = file and try_line(f"stereolib lrf record {served.port} {file} --seconds {_SECONDS}", place)
        print(*filter(None, (served.port, about, example, record)), sep="\n", flush=True)
        try:
            while not served.wait(0.5):
                pass
        except KeyboardInterrupt:
            return INTERRUPTED
    return DONE


_COMMANDS = (
    Command(
        "info",
        "say what a recording holds",
        "stereolib lrf info walk/1_scan.bin",
        _info,
        _configure_info,
        notes="exit code: 0 it can be used, 1 it holds too little or most of it is damaged, 2 wrong input",
        before=("stereolib data walk walk",),
    ),
    Command(
        "show",
        "draw the polar picture of a recording or of a sensor",
        "stereolib lrf show walk/1_scan.bin --output room.png",
        _show,
        _configure_show,
        notes=NO_LASER,
        before=("stereolib data walk walk",),
    ),
    LIVE,
    EXPORT,
    Command(
        "record",
        "write the raw bytes of a sensor to a file, as they come",
        "stereolib lrf record /dev/ttyUSB0 room.bin --seconds 10",
        _record,
        _configure_record,
        notes=NO_LASER,
    ),
    Command(
        "replay",
        "play a recording at its true rate onto a port of this machine",
        "stereolib lrf replay walk/1_scan.bin",
        _replay,
        _configure_replay,
        before=("stereolib data walk walk",),
    ),
    Command(
        "emulate",
        "be an XV-11 in the virtual room, on a port of this machine",
        "stereolib lrf emulate --scene cube --lost-byte-rate 0.001",
        _emulate,
        _configure_emulate,
        notes=_EMULATE_NOTES,
    ),
)
LRF = Command(
    "lrf", "read, record, replay or emulate the laser range finder", "stereolib lrf emulate", commands=_COMMANDS
)
