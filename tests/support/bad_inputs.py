"""A folder full of what people's disks and cables make of inputs, and what each command is to say of them."""

from __future__ import annotations

import copy
import csv
import io
import json
import math
import os
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from stereolib.base import datasets
from stereolib.measurement import save_laser_pose
from stereolib.paper import paper_rig
from stereolib.virtual.measured_walk import walk_laser

VIRTUAL = datasets.ROOT / "data" / "virtual"
PAIR = "good/left.jpg good/right.jpg"
_BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 9)
)


class Bad(NamedTuple):
    """A command line, and a regular expression of what its one line of refusal has to say."""

    words: str
    says: str


def _set(*path: str | int, to: Any) -> Callable[[dict[str, Any]], object]:
    """Change one entry of a rig file, and leave the rest."""

    def change(rig: dict[str, Any]) -> None:
        at: Any = rig
        for name in path[:-1]:
            at = at[name]
        at[path[-1]] = to

    return change


def _take(*path: str) -> Callable[[dict[str, Any]], object]:
    def change(rig: dict[str, Any]) -> None:
        at: Any = rig
        for name in path[:-1]:
            at = at[name]
        del at[path[-1]]

    return change


_HUGE = 10**400  # more than a float holds
#: Rig files that parse and are wrong: what is changed in a good one -> what is to be said.
RIGS: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "T_zero": (_set("T_mm", to=[0, 0, 0]), "no two lenses stand so near"),
    "T_tiny": (_set("T_mm", to=[1e-300, 0, 0]), "no two lenses stand so near"),
    "T_metres": (
        _set("T_mm", to=[-0.093, 0, 0]),
        r"json is not a rig file of stereolib: T is 0\.093 mm long.*millimetres",
    ),
    "T_huge": (_set("T_mm", to=[-1e200, 0, 0]), "T"),
    "T_int": (_set("T_mm", to=[_HUGE, 0, 0]), "T"),
    "T_null": (_set("T_mm", to=None), "T"),
    "T_none": (_set("T_mm", to=[None, 0, 0]), "T"),
    "T_word": (_set("T_mm", to="far"), "T"),
    "T_map": (_set("T_mm", to={"x": 1}), "T"),
    "T_long": (_set("T_mm", to=[-93, 0, 0, 1]), "T must be"),
    "T_nan": (_set("T_mm", to=[float("nan"), 0, 0]), "T must be"),
    "T_inf": (_set("T_mm", to=[float("-inf"), 0, 0]), "T must be"),
    "T_right": (_set("T_mm", to=[93, 0, 0]), "right of the left"),
    "T_up": (_set("T_mm", to=[-1, 93, 0]), "right of the left"),
    "R_zero": (_set("R", to=[[0] * 3] * 3), "R is not a rotation"),
    "R_twice": (_set("R", to=[[2, 0, 0], [0, 2, 0], [0, 0, 2]]), "R is not a rotation"),
    "R_mirror": (_set("R", to=[[-1, 0, 0], [0, 1, 0], [0, 0, 1]]), "R is not a rotation"),
    "R_back": (_set("R", to=[[-1, 0, 0], [0, 1, 0], [0, 0, -1]]), "look away from each other"),
    "R_huge": (_set("R", to=[[1e200, 0, 0], [0, 1e200, 0], [0, 0, 1e200]]), "R must be"),
    "R_ragged": (_set("R", to=[[1, 0], [0, 1, 0], [0, 0, 1]]), "R"),
    "R_deep": (_set("R", to=[[[1]]]), "R must be"),
    "R_none": (_take("R"), "has no 'R'"),
    "left_none": (_take("left"), "has no 'left'"),
    "left_list": (_set("left", to=[1, 2]), "left"),
    "K_none": (_take("left", "K"), "has no 'K'"),
    "K_zero": (_set("left", "K", to=[[0, 0, 320], [0, 0, 240], [0, 0, 1]]), "focal lengths"),
    "K_negative": (_set("left", "K", 0, 0, to=-700.0), "focal lengths"),
    "K_tiny": (_set("left", "K", 0, 0, to=1e-300), "focal length"),
    "K_huge": (_set("left", "K", 0, 0, to=1e300), "K must be numbers up to"),
    "K_far": (_set("right", "K", 0, 2, to=1e12), "K must be numbers up to"),
    "K_last": (_set("left", "K", 2, to=[0, 0, 0]), r"K must be \[\[fx"),
    "K_lower": (_set("left", "K", 1, 0, to=5.0), r"K must be \[\[fx"),
    "K_skew": (_set("left", "K", 0, 1, to=1e9), "K must be numbers up to"),
    "K_ragged": (_set("left", "K", to=[[700, 0], [0]]), "K"),
    "K_words": (_set("left", "K", to=[["a"] * 3] * 3), "K"),
    "K_int": (_set("left", "K", 0, 0, to=_HUGE), "K"),
    "dist_three": (_set("left", "dist", to=[1, 2, 3]), "dist has 3"),
    "dist_null": (_set("left", "dist", to=None), "dist"),
    "dist_words": (_set("left", "dist", to=["k1"] * 5), "dist"),
    "dist_huge": (_set("left", "dist", to=[1e200, 0, 0, 0, 0]), "dist"),
    "dist_nan": (_set("left", "dist", to=[float("nan")] * 5), "dist"),
    "dist_map": (_set("left", "dist", to={"k1": 0.1}), "dist"),
    "size_zero": (_set("left", "size", to=[0, 0]), "size"),
    "size_minus": (_set("left", "size", to=[-640, 480]), "size"),
    "size_huge": (_set("left", "size", to=[1e30, 480]), "size"),
    "size_int": (_set("left", "size", to=[_HUGE, 480]), "size"),
    "size_large": (_set("left", "size", to=[10**6, 10**6]), "size"),
    "size_half": (_set("left", "size", to=[640.5, 480]), "size"),
    "size_three": (_set("left", "size", to=[640, 480, 3]), "size"),
    "size_word": (_set("left", "size", to="VGA"), "size"),
    "size_null": (_set("left", "size", to=None), "size"),
    "size_other": (_set("right", "size", to=[800, 600]), "differ in size"),
    "format_old": (_set("format", to="stereolib.rig/0"), "its format is"),
    "format_none": (_take("format"), "has no 'format'"),
    "notes_list": (_set("calibration", to=[1]), "calibration"),
    "notes_word": (_set("calibration", to="good"), "calibration"),
    "notes_number": (_set("calibration", to=7), "calibration"),
    "std_list": (_set("calibration", to={"std": [1]}), "damaged"),
    "std_null": (_set("calibration", to={"std": None}), "damaged"),
    "std_unknown": (_set("calibration", to={"std": {"rectified": {"zoom": 1}}}), "damaged"),
    "std_minus": (_set("calibration", to={"std": {"rectified": {"f_px": -1}}}), "damaged"),
    "std_word": (_set("calibration", to={"std": {"rectified": {"f_px": "small"}}}), "damaged"),
    "std_huge": (_set("calibration", to={"std": {"rectified": {"f_px": 1e200}}}), "damaged"),
    "std_int": (_set("calibration", to={"std": {"rectified": {"f_px": _HUGE}}}), "damaged"),
    "std_two": (_set("calibration", to={"std": {"rectified": {"correlation": [0, 0]}}}), "damaged"),
    "std_beyond": (_set("calibration", to={"std": {"rectified": {"correlation": [2, 0, 0]}}}), "damaged"),
    "laser_list": (_set("lidar", to=[]), "laser"),
    "laser_empty": (_set("lidar", to={}), "laser"),
    "laser_word": (_set("lidar", to="below"), "laser"),
    "laser_inf": (_set("lidar", "T_left_lidar", 0, 3, to=float("inf")), "finite"),
    "laser_int": (_set("lidar", "T_left_lidar", 0, 3, to=_HUGE), "laser"),
    "laser_huge": (_set("lidar", "T_left_lidar", 0, 3, to=1e200), "laser"),
    "laser_turn": (_set("lidar", "T_left_lidar", 0, to=[9, 0, 0, 0]), "must be a rotation"),
    "laser_last": (_set("lidar", "T_left_lidar", 3, to=[0, 0, 0, 2]), "must be a rotation"),
    "laser_flat": (_set("lidar", "T_left_lidar", to=[1, 2]), "laser"),
    "laser_sure": (_set("lidar", "covariance", 0, 0, to=-1.0), "covariance"),
    "laser_scale": (_set("lidar", "scale", to=float("nan")), "finite"),
    "laser_half": (_set("lidar", "scale", to=-3.0), "scale"),
    "laser_vague": (_set("lidar", "covariance", 0, 0, to=1e300), "covariance"),
}
_KEPT = {"sigma_px": 0.1, "scatter": 1.0, "outer_px": {}}
#: What only `check` reads of them.
RECORDS: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "record_word": (_set("calibration", to={"record": "none"}), "damaged"),
    "record_empty": (_set("calibration", to={"record": {}}), "damaged"),
    "record_flat": (_set("calibration", to={"record": _KEPT | {"covariance": [1.0]}}), "damaged"),
    "record_int": (_set("calibration", to={"record": _KEPT | {"covariance": [[_HUGE]]}}), "damaged"),
    "record_words": (_set("calibration", to={"record": _KEPT | {"outer_px": "none", "covariance": [[1]]}}), "damaged"),
    "record_std": (_set("calibration", to={"std": {"K": 1, "dist": 2}}), "damaged"),
    "record_std_list": (_set("calibration", to={"std": [1]}), "damaged"),
}
#: Rig files that are no JSON, or no rig.
TEXTS: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "not a JSON file"),
    "blank": (b" \n\n", "not a JSON file"),
    "words": (b"the left one is 700 px", "not a JSON file"),
    "cut": (b'{"format": "stereolib.rig/1", "left": {"K": [[7', "not a JSON file"),
    "list": (b"[]", "no named entries"),
    "null": (b"null", "no named entries"),
    "number": (b"12", "no named entries"),
    "string": (b'"rig"', "no named entries"),
    "other": (b'{"type": "FeatureCollection"}', "has no 'format'"),
    "deep_list": (b"[" * 100_000, "nested more than"),
    "deep_map": (b'{"a":' * 100_000, "nested more than"),
    "long_int": (b'{"format": ' + b"9" * 5000 + b"}", "not a JSON file"),
    "broken_byte": (b'{"format": "\xff"}', "UTF-8"),
    "utf16": ('{"format": "stereolib.rig/1"}'.encode("utf-16"), "UTF-8"),
    "zeros": (bytes(300), "not a JSON file"),
    "png": (b"\x89PNG\r\n\x1a\n" + bytes(50), "png.json: not a text file in UTF-8"),
}


def _png(image: Any) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()


def _claims(width: int, height: int) -> bytes:
    """A PNG of a few bytes whose head claims to be so large."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    body = chunk(b"IDAT", zlib.compress(bytes(1000)))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + body + chunk(b"IEND", b"")


def _pictures() -> dict[str, bytes]:
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 256, (480, 640), np.uint8)
    jpeg = (VIRTUAL / "conditions" / "texture_left.jpg").read_bytes()
    return {
        "nothing.png": b"",
        "text.png": b"not a picture",
        "rubbish.png": noise.tobytes()[:9000],
        "cut.jpg": jpeg[: len(jpeg) // 2],
        "cut.png": _png(noise)[:5000],
        "head_only.png": _png(noise)[:33],
        "claims_32000.png": _claims(32000, 32000),
        "claims_max.png": _claims(2**31 - 1, 2**31 - 1),
        "claims_zero.png": _claims(0, 0),
        "deep16.png": _png(noise.astype(np.uint16) * 256),
        "row.png": _png(noise[:1]),
        "row2.png": _png(noise[1:2]),
        "column.png": _png(noise[:, :1]),
        "column2.png": _png(noise[:, 1:2]),
        "pixel.png": _png(noise[:1, :1]),
        "pixel2.png": _png(noise[1:2, 1:2]),
        "small.png": _png(noise[:8, :8]),
        "small2.png": _png(noise[8:16, :8]),
        "wide.png": _png(np.tile(noise[:16], (1, 10))),
        "wide2.png": _png(np.tile(noise[16:32], (1, 10))),
        "other.png": _png(noise[:, :320]),
        "grey.png": _png(np.full((480, 640), 128, np.uint8)),
        "black.png": _png(np.zeros((480, 640), np.uint8)),
        "noise_a.png": _png(noise),
        "noise_b.png": _png(rng.integers(0, 256, (480, 640), np.uint8)),
        "svg.png": b'<svg xmlns="http://www.w3.org/2000/svg"/>',
        "gif.gif": b"GIF89a" + bytes(20),
    }


def _recordings() -> dict[str, bytes]:
    rng = np.random.default_rng(1)
    good = (VIRTUAL / "lrf" / "room.bin").read_bytes()
    table = io.StringIO()
    csv.writer(table).writerows([("angle_deg", "range_mm"), *((k, 1000) for k in range(360))])
    rows = table.getvalue().splitlines()
    return {
        "empty.bin": b"",
        "zeros.bin": bytes(5000),
        "noise.bin": rng.bytes(100_000),
        "words.bin": b"Laser ready\n" * 50,
        "greeting.bin": b"Piccolo Laser Distance Scanner\n#Spin...press ESC",
        "one_packet.bin": good[:22],
        "half_turn.bin": good[: 22 * 45],
        "heads.bin": b"\xfa\xa0" * 5000,
        "old_heads.bin": b"\x5a\xa5\x00\xc0" * 5000,
        "wrong_sums.bin": bytes(b ^ 0x10 if k % 22 == 7 else b for k, b in enumerate(good)),
        "table_empty.csv": b"",
        "table_head.csv": b"angle_deg,range_mm\n",
        "table_words.csv": b"angle_deg,range_mm\n" + b"a,b\n" * 40,
        "table_other.csv": b"angle,range\n0,1\n",
        "table_inf.csv": "\n".join([rows[0], "0,inf", *rows[2:]]).encode(),
        "table_1e300.csv": "\n".join([rows[0], *(f"{k}e300,1" for k in range(360))]).encode(),
        "table_uneven.csv": "\n".join([rows[0], "0,1", "0,1", *rows[3:]]).encode(),
        "table_short.csv": "\n".join(rows[:10]).encode(),
        "table_wide.csv": "\n".join(f"{row},1" for row in rows).encode(),
        "table_quote.csv": b'angle_deg,range_mm\n"0,1\n' + b"1,2\n" * 40,
        "table_nul.csv": b"angle_deg,range_mm\n0,\x001\n" + b"1,2\n" * 40,
        "table_latin.csv": b"angle_deg,range_mm\n0,\xe4\n",
        "table_field.csv": b"angle_deg,range_mm\n0," + b"9" * 200_000 + b"\n",
    }


def make(folder: Path) -> None:
    """Fill a folder with good files and bad ones."""
    good = folder / "good"
    good.mkdir()
    for side in ("left", "right"):
        (good / f"{side}.jpg").write_bytes((VIRTUAL / "conditions" / f"texture_{side}.jpg").read_bytes())
    (good / "scan.bin").write_bytes((VIRTUAL / "lrf" / "room.bin").read_bytes())
    rig = paper_rig()
    rig.save(good / "calibration.json")
    save_laser_pose(good / "calibration.json", walk_laser())
    entries = json.loads((good / "calibration.json").read_text())
    for name, (change, _) in (RIGS | RECORDS).items():
        changed = copy.deepcopy(entries)
        change(changed)
        (folder / f"rig_{name}.json").write_text(json.dumps(changed))
    for name, (data, _) in TEXTS.items():
        (folder / f"rig_{name}.json").write_bytes(data)
    for name, data in (_pictures() | _recordings()).items():
        (folder / name).write_bytes(data)
    with (folder / "sparse.json").open("wb") as stream:
        stream.truncate(2 * 10**9)
    (folder / "sparse.bin").hardlink_to(folder / "sparse.json")
    (folder / "hollow.png").hardlink_to(folder / "sparse.json")
    (folder / "folder").mkdir()
    (folder / "folder.bin").mkdir()
    (folder / "loop.bin").symlink_to("loop.bin")
    (folder / "loop.json").symlink_to("loop.json")
    (folder / "dangling.png").symlink_to("nowhere.png")
    if hasattr(os, "mkfifo"):
        for ending in ("bin", "json", "png", "npy", "pdf"):
            os.mkfifo(folder / f"silent.{ending}")
    for name, (text, _) in FOLDERS.items():
        (folder / f"rig_{name}").mkdir()
        (folder / f"rig_{name}" / "rig.toml").write_bytes(text)
    _boards(folder)
    _stations(folder)


def _boards(folder: Path) -> None:
    """Recordings of boards, each spoilt in its own way."""
    picture = (VIRTUAL / "boards" / "01_left.jpg").read_bytes()
    small = _png(np.zeros((8, 8), np.uint8))

    def files(name: str, **contents: bytes) -> None:
        (folder / name).mkdir()
        for file, data in contents.items():
            (folder / name / file.replace("__", ".")).write_bytes(data)

    files("boards_notes", left01__png=small, right01__png=small, notes__txt=b"x")
    files("boards_alone", left01__png=small, left02__png=small, right01__png=small)
    files("boards_sideless", a__png=small, b__png=small)
    files("boards_twice", left1__png=small, left01__png=small, right1__png=small)
    files("boards_few", left1__jpg=picture, right1__jpg=picture)
    files("boards_cut", **{f"{s}{k}__jpg": picture[:5000] for s in ("left", "right") for k in range(6)})
    files("boards_black", **{f"{s}{k}__png": small for s in ("left", "right") for k in range(6)})
    wide = _png(np.zeros((8, 10), np.uint8))
    files("boards_sizes", **{f"{s}{k}__png": picture for s, picture in (("left", small), ("right", wide))
                             for k in range(6)})  # fmt: skip
    files("boards_none", scan__bin=b"", **{f"{s}{k}__png": small for s in ("left", "right") for k in range(6)})
    files("boards_rows", **{f"{s}{k}__png": _png(np.zeros((1, 640), np.uint8)) for s in ("left", "right")
                            for k in range(6)})  # fmt: skip
    files("boards_left", **{f"{k}__png": small for k in range(6)})
    files("scans_none")
    files("scans_empty", **{f"{k}__bin": b"" for k in range(6)})
    files("scans_few", a__bin=b"")
    (folder / "video.mp4").write_bytes(b"\0\0\0\x18ftypmp42" + bytes(500))
    (folder / "video2.mp4").write_bytes(b"")


def _stations(folder: Path) -> None:
    """Folders for a map, each spoilt in its own way."""
    good = {name: (folder / "good" / name).read_bytes() for name in ("left.jpg", "right.jpg", "scan.bin")}
    rig = (folder / "good" / "calibration.json").read_bytes()

    def station(name: str, calibration: bytes | None = rig, **files: bytes) -> None:
        (folder / name).mkdir()
        for file, data in files.items():
            (folder / name / file.replace("__", ".").removeprefix("_")).write_bytes(data)
        if calibration is not None:
            (folder / name / "calibration.json").write_bytes(calibration)

    left, right, scan = good.values()
    station("map_bare")
    station("map_rigless", calibration=None, _1_left__jpg=left, _1_right__jpg=right)
    station("map_lonely", _1_left__jpg=left)
    station("map_twins", _1_scan__bin=scan, _1_scan__csv=b"")
    station("map_numbers", _1_scan__bin=scan, _01_scan__bin=scan)
    station("map_pictureless", _1_left__csv=b"", _1_right__csv=b"")
    station("map_cut", _1_left__jpg=left[:4000], _1_right__jpg=right)
    station("map_small", _1_left__png=_png(np.zeros((8, 8), np.uint8)), _1_right__png=_png(np.ones((8, 8), np.uint8)))
    station("map_scanless", _1_scan__bin=b"")
    station("map_noise", _1_scan__bin=b"abc" * 900)
    station("map_column", _1_scan__csv=b"angle_deg,range_mm\n1,2\n")
    turn = "".join(f"{math.radians(degrees)},1000\n" for degrees in range(360))
    station("map_radians", _1_scan__csv=f"angle_deg,range_mm\n{turn}".encode())
    station("map_semicolons", _1_scan__csv=b"angle_deg;range_mm\n1,5;2\n")
    metres = b"station,x_mm,y_mm,yaw_deg\n1,0,0,0\n2,1.0,-1.9,1.28\n"
    station("map_metres", _1_scan__bin=scan, _2_scan__bin=scan, poses__csv=metres)
    head = b"station,x_mm,y_mm,yaw_deg\n"
    for name, poses in {
        "head": b"station,x,y,yaw\n1,0,0,0\n",
        "stranger": head + b"7,0,0,0\n",
        "twice": head + b"1,0,0,0\n1,0,0,0\n",
        "word": head + b"1,here,0,0\n",
        "nan": head + b"1,nan,0,0\n",
        "inf": head + b"1,0,0,-inf\n",
        "huge": head + b"1,1e300,0,0\n",
        "short": head + b"1,0,0\n",
        "bytes": head + b"1,\xff,0,0\n",
        "empty": b"",
    }.items():
        station(f"map_poses_{name}", _1_scan__bin=scan, poses__csv=poses)


_TOML = '[board]\ninner_corners = [9, 6]\nsquare_mm = [25.0, 25.0]\n[recordings]\nboards = "../boards_cut"\n'
#: Folders of a rig whose file is wrong: what stands in it -> what is to be said.
FOLDERS: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "no recordings yet"),
    "cut": (b"[board", "rig.toml"),
    "bytes": (b"\xff\xfe[board]", "UTF-8"),
    "deep": (b"a = " + b"[" * 100_000, "nested"),
    "flat": (b"board = 3\nrecordings = 4\n", "rig.toml"),
    "lengths": (b"length = 5\n", "length is a part of its own"),
    "corners": (_TOML.replace("[9, 6]", '"many"').encode(), "inner_corners"),
    "corner": (_TOML.replace("[9, 6]", "[9]").encode(), "inner_corners"),
    "square": (_TOML.replace("25.0]", "1e308]").encode(), "square"),
    "nan": (_TOML.replace("25.0]", "nan]").encode(), "square"),
    "model": (b'[cameras]\nmodel = "fisheye"\n', "unknown lens model"),
    "metres": (b"[cameras]\nat_mm = 0.7", "a number of millimetres is expected"),
    "bord": (b"[bord]", "'bord' is no part; did you mean board"),
    "at": (_TOML.encode() + b'[cameras]\nat_mm = "far"\n', "at_mm"),
    "places": (b"[recordings]\nboards = 7\n", "boards"),
    "few": (_TOML.replace("boards_cut", "boards_few").encode(), "at least"),
    "length": (_TOML.encode() + b'[[length]]\npair = "9"\nfrom = [1, 1]\nto = [2, 2]\n', "there is no pair"),
    "frame": (_TOML.encode() + b'[[length]]\npair = "9"\nfrom = [1, 1]\nto = [2, 2]\nrectified = 1\n', "true or false"),
    "pixels": (_TOML.encode() + b'[[length]]\npair = "9"\nfrom = "here"\nto = [2, 2]\n', "from"),
}
_BOARD = "--board 9x6 --square-mm 25"
_RIG = "--calibration good/calibration.json"

#: Everything else, by command.
OTHERS = {
    "reproduce": [
        Bad("reproduce 99", "0 notebooks fit '99'"),
        Bad("reproduce 03 --output good/left.jpg", "good/left.jpg"),
        Bad("reproduce 03 --output /proc/nowhere", "cannot be written"),
        Bad("reproduce 0", "notebooks fit '0'"),
        Bad("reproduce ../../etc/passwd", "0 notebooks fit"),
        Bad("reproduce 03 --jobs 0", "--?jobs"),
        Bad("reproduce 03 --jobs -3", "--?jobs"),
        Bad("reproduce 03 --jobs many", "--jobs"),
    ],
    "explore": [
        Bad("explore good/left.jpg", "the picture of one camera: name the right camera's, too"),
        Bad("explore good/left.jpg good/right.jpg good/left.jpg", "two pictures"),
        Bad("explore --scan good/scan.bin", "belong to a pair"),
        Bad(f"explore {PAIR} --calibration rig_T_zero.json", "T is 0 mm"),
        Bad(f"explore {PAIR} --calibration rig_size_large.json", "size"),
        Bad(f"explore {PAIR} --calibration rig_notes_word.json", "calibration"),
        Bad(f"explore {PAIR} --scan noise.bin", "no XV-11 recording"),
        Bad("explore row.png row2.png", "row.png"),
        Bad("explore good/left.jpg other.png", "one size"),
        Bad("explore good/left.jpg missing.png", "missing.png: no such file"),
        Bad(f"explore {PAIR} --port 99999", "--port"),
        Bad(f"explore {PAIR} --port -1", "--port"),
        Bad(f"explore {PAIR} --port http", "--port"),
    ],
    "bake": [
        Bad("bake good/left.jpg", "good/left.jpg"),
        Bad("bake good/left.jpg/deeper", "cannot be written"),
        Bad("bake /proc/nowhere", "cannot be written"),
    ],
    "data": [
        Bad("data build --output good/left.jpg", "cannot be written"),
        Bad("data build --output /proc/nowhere", "cannot be written"),
        Bad("data build --output rig_empty", "rig.toml would be overwritten: name another place with --output, or"),
        Bad("data walk good/left.jpg", "good/left.jpg"),
        Bad("data walk /proc/nowhere", "cannot be written"),
        Bad("data walk good", "calibration.json would be overwritten"),
        Bad("data", "COMMAND"),
    ],
    "disparity": [
        Bad("disparity good/left.jpg good/left.jpg", "same picture"),
        Bad("disparity good/left.jpg other.png", "one size"),
        Bad("disparity row.png row2.png", "row.png"),
        Bad("disparity row.png row2.png --pipeline paper --max-disparity 16", "row.png"),
        Bad("disparity row.png row2.png --pipeline fast --max-disparity 32", "row.png"),
        Bad("disparity column.png column2.png", "column.png"),
        Bad("disparity column.png column2.png --pipeline paper --max-disparity 16", "column.png"),
        Bad("disparity column.png column2.png --pipeline fast --max-disparity 32", "column.png"),
        Bad("disparity pixel.png pixel2.png", "pixel.png"),
        Bad("disparity small.png small2.png", "small.png"),
        Bad("disparity grey.png black.png", "grey.png"),
        Bad("disparity claims_32000.png claims_32000.png", "1024 megapixels"),
        Bad("disparity claims_max.png claims_max.png", "megapixels"),
        Bad("disparity claims_zero.png claims_zero.png", "not a readable image"),
        Bad("disparity deep16.png deep16.png", "uint16"),
        Bad("disparity cut.jpg good/right.jpg", "cut short"),
        Bad("disparity cut.png good/right.jpg", "cut short"),
        Bad("disparity head_only.png good/right.jpg", "cut short"),
        Bad("disparity nothing.png good/right.jpg", "0 bytes"),
        Bad("disparity text.png good/right.jpg", "not a readable image"),
        Bad("disparity rubbish.png good/right.jpg", "not a readable image"),
        Bad("disparity svg.png good/right.jpg", "not a readable image"),
        Bad("disparity gif.gif good/right.jpg", "not a readable image"),
        Bad("disparity folder good/right.jpg", "is a folder"),
        Bad("disparity dangling.png good/right.jpg", "no such file"),
        Bad("disparity good/lfet.jpg good/right.jpg", "did you mean left.jpg"),
        Bad("disparity hollow.png good/right.jpg", "at most 268 MB"),
        Bad("disparity /dev/zero good/right.jpg", "is a device"),
        Bad("disparity silent.png good/right.jpg", "says nothing"),
        Bad(f"disparity {PAIR} --pipeline bset", "bset"),
        Bad(f"disparity {PAIR} --max-disparity 17", "multiple of 16"),
        Bad(f"disparity {PAIR} --max-disparity 0", "--max-disparity"),
        Bad(f"disparity {PAIR} --max-disparity -16", "--max-disparity"),
        Bad(f"disparity {PAIR} --max-disparity 640000", "--max-disparity"),
        Bad(f"disparity {PAIR} --max-disparity 99999999999999999984", "--max-disparity"),
        Bad(f"disparity {PAIR} --max-disparity 1e3", "--max-disparity"),
        Bad(f"disparity {PAIR} --output d.tif", r"\.npy"),
        Bad(f"disparity {PAIR} --output good/left.jpg/d.npy", "cannot be written"),
        Bad(f"disparity {PAIR} --output /proc/d.npy", "cannot be written"),
        Bad(f"disparity {PAIR} --output {'n' * 250}.npy", "too long"),
        Bad(f"disparity {PAIR} --calibration missing.json", "missing.json: no such file"),
        Bad(f"disparity {PAIR} --calibration rig_K_huge.json", "rig_K_huge.json"),
        Bad(f"disparity {PAIR} --calibration rig_size_large.json", "rig_size_large.json"),
        Bad(f"disparity {PAIR} --calibration rig_deep_list.json", "nested"),
        Bad(f"disparity {PAIR} --calibration rig_T_huge.json", "rig_T_huge.json"),
        Bad(f"disparity {PAIR} --calibration good/left.jpg", "good/left.jpg"),
        Bad("disparity noise_a.png noise_b.png --pipeline fast", "nothing can be measured|same"),
        Bad(f"disparity {PAIR} --filled", "needs --calibration FILE"),
        Bad(f"disparity {PAIR} --output folder", r"\.npy"),
        Bad(f"disparity other.png small.png {_RIG}", "one size"),
        Bad(f"disparity wide.png wide2.png {_RIG}", "wide.png"),
    ],
    "lrf": [
        *(
            Bad(f"lrf {command}{name}", says)
            for command in ("info ", "show ", "replay --link socket ")
            for name, says in {
                "missing.bin": "missing.bin",
                "empty.bin": "is empty",
                "zeros.bin": "no XV-11 recording",
                "noise.bin": "no XV-11 recording",
                "words.bin": "no XV-11 recording",
                "greeting.bin": "waits for its motor",
                "heads.bin": "no XV-11 recording",
                "old_heads.bin": "no XV-11 recording",
                "wrong_sums.bin": "no XV-11 recording",
                "folder.bin": "folder.bin",
                "loop.bin": "loop.bin",
                "sparse.bin": "at most 268 MB",
                "/dev/zero": "/dev/zero",
                "silent.bin": "says nothing",
                "good/left.jpg": "no XV-11 recording",
            }.items()
        ),
        Bad("lrf replay /dev/null", "/dev/null: is a device"),
        Bad("lrf show one_packet.bin", "no complete turn"),
        Bad("lrf show half_turn.bin", "no complete turn"),
        Bad("lrf show good/scan.bin --output silent.png", "nobody reads this pipe"),
        Bad("lrf show good/scan.bin --turns 0", "--turns"),
        Bad("lrf show good/scan.bin --turns -1", "--turns"),
        Bad("lrf show good/scan.bin --turns 1e9", "--turns"),
        Bad("lrf show good/scan.bin --output scan.svg", r"\.png"),
        Bad("lrf show good/scan.bin --output good/scan.bin/x.png", "cannot be written"),
        Bad("lrf show no_such_port", "no_such_port.*Ports found"),
        Bad("lrf show socket://127.0.0.1:1", "cannot reach"),
        Bad("lrf show socket://127.0.0.1:99999", "cannot reach"),
        Bad("lrf show socket://", "cannot reach"),
        Bad("lrf show nonsense://x", "nonsense"),
        Bad("lrf export missing.bin out.csv", "missing.bin: no such file or port"),
        Bad("lrf live http://127.0.0.1/scan", "no address of a laser .*name a serial port"),
        Bad("lrf export noise.bin out.ply", "no XV-11 recording"),
        Bad("lrf export one_packet.bin out.csv", "no complete turn"),
        Bad("lrf export silent.bin out.csv", "says nothing"),
        Bad("lrf export good/scan.bin out.txt", r"written as \.csv or \.ply"),
        Bad("lrf export good/scan.bin good/left.jpg/out.csv", "cannot be written"),
        Bad("lrf export good/scan.bin out.csv --pose 1,2,3", "--pose and --height-mm are for a .ply"),
        Bad("lrf export good/scan.bin out.ply --pose 1,2", "--pose is X,Y,YAW"),
        Bad("lrf export good/scan.bin out.ply --pose nan,0,0", "--pose is X,Y,YAW"),
        Bad("lrf export good/scan.bin out.ply --pose 0,nan,0", "--pose is X,Y,YAW"),
        Bad("lrf export good/scan.bin out.ply --pose 0,0,inf", "--pose is X,Y,YAW"),
        Bad("lrf export good/scan.bin out.ply --pose 1e300,0,0", "--pose is X,Y,YAW"),
        Bad("lrf export good/scan.bin out.ply --height-mm nan", "--height-mm"),
        Bad("lrf export good/scan.bin out.ply --height-mm 1e300", "--height-mm"),
        Bad("lrf export good/scan.bin out.csv --turns 0", "--turns: '0' is not a whole number from 1 to 10000"),
        Bad("lrf export good/scan.bin out.csv --turns 10001", "--turns: '10001' is not a whole number"),
        Bad("lrf export good/scan.bin no/such/\0.csv", "null"),
        Bad("lrf live /dev/null", "/dev/null"),
        Bad("lrf live socket://127.0.0.1:1 --port 99999", "--port"),
        Bad("lrf record /dev/ttyNOPE room.bin", "ttyNOPE"),
        Bad("lrf record /dev/null room.bin", "/dev/null"),
        Bad("lrf record good/scan.bin room.bin", "good/scan.bin is a file, not a port"),
        Bad("lrf record socket://127.0.0.1:1 good/scan.bin", "exists and is not overwritten"),
        Bad("lrf record socket://127.0.0.1:1 good/left.jpg/room.bin", "cannot be written"),
        Bad("lrf record socket://127.0.0.1:1 folder", "folder"),
        Bad("lrf record socket://127.0.0.1:1 room.bin --seconds -1", "--seconds"),
        Bad("lrf record socket://127.0.0.1:1 room.bin --seconds nan", "--seconds"),
        Bad("lrf emulate --distance-mm nan", "distance"),
        Bad("lrf emulate --distance-mm -700", "distance"),
        Bad("lrf emulate --distance-mm 1e300", "distance"),
        Bad("lrf emulate --seconds -1", "seconds"),
        Bad("lrf emulate --seconds nan", "seconds"),
        Bad("lrf emulate --seed -1", "seed"),
        Bad("lrf emulate --rig -1", "--rig: '-1' is not a whole number"),
        Bad("lrf emulate --rig seven", "--rig: 'seven' is not a whole number"),
        Bad("lrf emulate --bit-error-rate 2", "bit.error.rate"),
        Bad("lrf emulate --lost-byte-rate -1", "lost.byte.rate"),
        Bad("lrf emulate --stall-every-s 0 --stall-s 1", "stall"),
        Bad("lrf emulate --stall-s nan", "stall"),
        Bad("lrf emulate --stall-s 1", "--stall-every-s and --stall-s belong together"),
        Bad("lrf emulate --stall-every-s 1", "--stall-every-s and --stall-s belong together"),
        Bad("lrf emulate --scene box --distance-mm 900", "--distance-mm is of the cube, not of box"),
        Bad("lrf emulate --link usb", "--link"),
        Bad("lrf emulate --scene laser-board --at 11", "laser-board has the numbers 1 to 10"),
        Bad("lrf emulate --scene board", "--scene"),
        Bad("lrf live", "PORT"),
        Bad("lrf live good/scan.bin", "is a file: stereolib lrf replay plays it on a port"),
        Bad("lrf live /dev/ttyNOPE", "ttyNOPE.*Ports found"),
        Bad("lrf live socket://127.0.0.1:1", "cannot reach .*start the emulator or server first"),
        Bad("lrf live socket://127.0.0.1:1 --seconds 0", "--seconds must be more than 0"),
        Bad("lrf live socket://127.0.0.1:1 --seconds nan", "--seconds"),
        Bad("lrf live socket://127.0.0.1:1 --port http", "--port"),
        Bad("lrf export good/scan.bin", "OUT"),
        Bad("lrf export empty.bin scan.csv", "is empty"),
        Bad("lrf export greeting.bin scan.csv", "waits for its motor"),
        Bad("lrf export good/scan.bin /proc/scan.ply", "cannot be written"),
        Bad("lrf export good/scan.bin table_head.csv", "would be overwritten"),
        Bad("lrf export good/scan.bin scan.ply --pose 1,2,nan", "--pose is X,Y,YAW"),
    ],
    "new": [
        Bad("new good/left.jpg", "is a file"),
        Bad("new good/left.jpg/deeper", "is a file"),
        Bad("new /proc/nowhere", "cannot be written"),
        Bad("new rig_empty", "is there already"),
        Bad("new", "FOLDER"),
        Bad("new dangling.png/rig", "cannot be|is a file|No such file|dangling"),
    ],
    "report": [
        Bad("report missing", "is no folder"),
        Bad("report good/left.jpg", "good/left.jpg is a file: name the folder of your rig"),
        Bad("report folder", "has no rig.toml"),
        Bad("report rig_empty --output good/left.jpg", "is a file"),
        Bad("report rig_empty --chapter 12", "--chapter"),
        Bad("report rig_empty --chapter calibration", "no recordings yet"),
        Bad("report rig_empty --output good/left.jpg/deeper", "is a file"),
        *(Bad(f"report rig_{name}", says) for name, (_, says) in FOLDERS.items()),
    ],
    "capture": [
        Bad("capture 0 1 --output good/left.jpg", "is a file"),
        Bad("capture nofile.mp4 video.mp4 --output taken --no-preview", "nofile.mp4 cannot be opened: no such file"),
        Bad("capture 0 1 --output taken --pairs 0", "--pairs"),
        Bad("capture 0 1 --output taken --pairs many", "--pairs"),
        Bad("capture 0 1 --output taken --patience-s nan", "--patience-s"),
        Bad("capture 0 1 --output taken --every-s -1", "--every-s"),
        Bad("capture 0 1 --output taken --size big", "--size"),
        Bad("capture 0 1 --output taken --board 9x6", "--square-mm"),
        Bad("capture 0 1 --output taken --board 9x6 --square-mm 0", "positive"),
        Bad("capture 0 1 --output taken --automatic --focus 3", "--automatic contradicts"),
        Bad("capture 0 1 --output taken --max-skew-ms nan", "skew"),
        Bad("capture 0 1 --output taken --fps nan", "a second"),
        Bad("capture 0 1 --output taken --size 0x0", "0x0"),
        Bad("capture /dev/nocamera0 /dev/nocamera1 --output taken --no-preview", "nocamera0"),
        Bad("capture video.mp4 video2.mp4 --output taken --no-preview", "video.mp4"),
        Bad("capture rubbish.png text.png --output taken --no-preview", "rubbish.png"),
        Bad("capture nothing.png nothing.png --output taken --no-preview", "given for both cameras"),
        Bad("capture good/left.jpg ./good/left.jpg --output taken --no-preview", "are one camera: .*given for both"),
        Bad("capture cut.png text.png --output taken --no-preview", "text.png|cut.png"),
        Bad("capture good/left.jpg small.png --output taken --no-preview", "small.png|size"),
        Bad("capture none_%02d.png none2_%02d.png --output taken --no-preview", "no picture of this pattern"),
        Bad("capture folder good --output taken --no-preview", "it is a folder"),
        Bad("capture dangling.png text.png --output taken --no-preview", "dangling.png"),
        Bad("capture noise.bin words.bin --output taken --no-preview", "noise.bin"),
        Bad("capture http://127.0.0.1:1/a http://127.0.0.1:1/b --output taken --no-preview", "127.0.0.1:1/a"),
        Bad("capture 0 1 --output taken --ruler-mm 93", "--ruler-mm is about a board"),
        Bad("capture 0 1 --output taken --board 9x6 --square-mm 25 --ruler-mm 2e6", "not a number from 1 to 1000000"),
        Bad("capture 0 1 --output taken --code MJPEG", "four letters"),
        Bad("capture 0 1 --output taken --exposure inf", "finite"),
    ],
    "emulate-cameras": [
        Bad("emulate-cameras --no-such-option", "unrecognized|no-such-option"),
        Bad("emulate-cameras --places 0", "from 1 to 1000"),
        Bad("emulate-cameras --places 100000000", "from 1 to 1000"),
        Bad("emulate-cameras --scale nan", "scale"),
        Bad("emulate-cameras --late-ms -5", "late"),
        Bad("emulate-cameras --drop-rate nan", "drop"),
        Bad("emulate-cameras --freeze-after-s -1", "freeze"),
        Bad("emulate-cameras --cable-kb-s 0", "--cable-kb-s"),
        Bad("emulate-cameras --seed -1", "--seed"),
        Bad("emulate-cameras --rig -1", "--rig"),
        Bad("emulate-cameras --rig mine", "--rig"),
        Bad("emulate-cameras --scene moon", "--scene"),
        Bad("emulate-cameras --scene walk --at 6", "walk has the numbers 1 to 5, got 6"),
        Bad("emulate-cameras --scene cube --at 2", "there is one cube"),
        Bad("emulate-cameras --scene box --at 0", "--at"),
        Bad("emulate-cameras --at 2", "--at is of the other scenes"),
        Bad("emulate-cameras --distance-mm 900", "--distance-mm is of the cube, not of board"),
        Bad("emulate-cameras --scene walk --distance-mm 900", "--distance-mm is of the cube, not of walk"),
        Bad("emulate-cameras --scene box --places 3", "--places is of the scene board, not of box"),
        Bad("emulate-cameras --scene box --scale 9", "a scale of 0.1 to 4"),
        Bad("emulate-cameras --scene box --fps 0", "from 0.1 to 120"),
        Bad("emulate-cameras --scene cube --distance-mm nan", "--distance-mm"),
    ],
    "handout": [
        Bad("handout --out class.tar --no-wheels", r"\.zip"),
        Bad("handout --out good/left.jpg/class.zip --no-wheels", "cannot be written"),
        Bad("handout --out /proc/class.zip --no-wheels", "cannot be written"),
    ],
    "board": [
        Bad("board --board 9", "inner corners"),
        Bad("board --board 0x0", "board|corners"),
        Bad("board --board 999x999", "fit|corners|square"),
        Bad("board --square-mm 0", "positive"),
        Bad("board --square-mm nan", "positive"),
        Bad("board --square-mm 1e-30", "square"),
        Bad("board --square-mm 1e308", "square"),
        Bad("board --square-mm 500", "fit"),
        Bad("board --marker-mm 0", "marker"),
        Bad("board --marker-mm -1", "marker"),
        Bad("board --marker-mm nan", "marker"),
        Bad("board --marker-mm 1e-30", "marker"),
        Bad("board --marker-mm 99", "marker"),
        Bad("board --charuco --dictionary 4X4", "dictionary|4X4"),
        Bad("board --charuco --board 40x40 --dictionary 4X4_50", "4X4_50|marker"),
        Bad("board --paper a9", "paper|a9"),
        Bad("board --out board.png", r"\.pdf"),
        Bad("board --out good/left.jpg/board.pdf", "cannot be written"),
        Bad("board --out silent.pdf", "nobody reads"),
    ],
    "calibrate": [
        Bad(f"calibrate missing {_BOARD}", "missing"),
        Bad(f"calibrate missing1 missing2 {_BOARD}", "missing1"),
        Bad(f"calibrate folder {_BOARD}", "is empty"),
        Bad(f"calibrate nowhere*.png {_BOARD}", "no file has such a name"),
        Bad(f"calibrate boards_few boards_few {_BOARD}", "both cameras"),
        Bad(f"calibrate boards_notes {_BOARD}", "notes.txt"),
        Bad(f"calibrate boards_alone {_BOARD}", r"left02\.png \(right02\.png is missing\)"),
        Bad(f"calibrate boards_sizes {_BOARD}", "left pictures are 8x8, right ones 10x8"),
        Bad(f"calibrate boards_none {_BOARD}", "no board of 9x6 inner corners was found"),
        Bad(f"calibrate boards_sideless {_BOARD}", "tell no side"),
        Bad(f"calibrate boards_twice {_BOARD}", "told apart"),
        Bad(f"calibrate boards_few {_BOARD}", "too few pairs"),
        Bad(f"calibrate boards_cut {_BOARD}", "cut short"),
        Bad(f"calibrate boards_black {_BOARD}", "board"),
        Bad(f"calibrate boards_rows {_BOARD}", "board"),
        Bad(f"calibrate boards_left boards_black {_BOARD}", "told apart"),
        Bad(f"calibrate video.mp4 {_BOARD}", "video.mp4"),
        Bad(f"calibrate video2.mp4 {_BOARD}", "video2.mp4"),
        Bad(f"calibrate video.mp4 video2.mp4 {_BOARD}", "video"),
        Bad(f"calibrate video.mp4 {_BOARD} --every 0", "every"),
        *(
            Bad(f"calibrate boards_black --board 9x6 --square-mm {words}", says)
            for words, says in {
                "nan": "positive number of mm, got nan",
                "-25": "positive number of mm, got -25",
                "0.025": "given as 0.025, but millimetres are expected: for 0.025 m that is 25",
                "25x50": "height over its width must be near 1, got 2.0",
                "about": "an edge in mm, as 25, or width x height",
                "25x25.2 --marker-mm 20": "taken for square, got 25x25.2",
                "25 --marker-mm 30": "a marker must be smaller than its square",
            }.items()
        ),
        Bad("calibrate boards_black --board 9by6 --square-mm 25", "inner corners, as 9x6"),
        Bad("calibrate boards_black --board 9x6 --square-mm 1e-30", "square"),
        Bad("calibrate boards_black --board 9x6 --square-mm 1e308", "square"),
        Bad("calibrate boards_black --board 9x6 --square-mm 25x0", "positive"),
        Bad("calibrate boards_black --board 9x6 --square-mm 1e-200x1e200", "square"),
        Bad("calibrate boards_black --board 1x1 --square-mm 25", "board|corners"),
        Bad("calibrate boards_black --board 6x6 --square-mm 25", "looks the same after a quarter turn"),
        Bad(f"calibrate boards_black {_BOARD} --marker-mm inf", "marker"),
        Bad(f"calibrate boards_black {_BOARD} --marker-mm 1e-30", "marker"),
        Bad(f"calibrate boards_black {_BOARD} --legacy", "--legacy is about ChArUco boards: .*--marker-mm"),
        Bad(
            f"calibrate boards_black {_BOARD} --dictionary 4X4_50",
            "--dictionary is about ChArUco boards: give the edge of their markers.*--marker-mm",
        ),
        Bad(
            f"calibrate boards_black {_BOARD} --every 3",
            "--every is about a video, of which it takes frames; of pictures all are taken",
        ),
        Bad(
            f"calibrate boards_black {_BOARD} --model fisheye",
            "unknown lens model 'fisheye'; choose one of pinhole, brown2, brown3",
        ),
        Bad(f"calibrate boards_black {_BOARD} --ruler-mm 0.09", "--ruler-mm"),
        Bad(f"calibrate boards_black {_BOARD} --ruler-mm nan", "--ruler-mm"),
        Bad(f"calibrate boards_black {_BOARD} --ruler-mm 1e300", "--ruler-mm"),
        Bad(f"calibrate boards_black {_BOARD} --at-mm 1", "--at-mm"),
        Bad(f"calibrate boards_black {_BOARD} --at-mm 1e300", "--at-mm"),
        Bad(f"calibrate boards_black {_BOARD} --format matlab", "--format"),
        Bad(f"calibrate boards_black {_BOARD} --format kalibr", "cannot hold a brown3 lens: pass --model brown2"),
        Bad(f"calibrate boards_black {_BOARD} --output good/left.jpg", "folder"),
        Bad(f"calibrate boards_black {_BOARD} --output good", "would be overwritten"),
        Bad(f"calibrate boards_black {_BOARD} --output /proc/nowhere", "cannot be written"),
    ],
    "check": [
        Bad(f"check good/left.jpg good/left.jpg {_BOARD} {_RIG}", "both cameras"),
        Bad(f"check good/left.jpg {_BOARD} {_RIG}", "left.jpg"),
        Bad(f"check good/left.jpg good/right.jpg small.png {_BOARD} {_RIG}", "no partner"),
        Bad(f"check good/left.jpg good/right.jpg good/left.jpg small.png {_BOARD} {_RIG}", "given twice"),
        Bad(f"check {PAIR} {_BOARD} {_RIG}", "board"),
        Bad(f"check {PAIR} {_BOARD} --calibration rig_T_zero.json", "T is 0 mm"),
        Bad(f"check {PAIR} {_BOARD} --calibration rig_notes_list.json", "rig_notes_list.json"),
        Bad(f"check {PAIR} {_BOARD} --calibration rig_notes_number.json", "rig_notes_number.json"),
        *(Bad(f"check {PAIR} {_BOARD} --calibration rig_{name}.json", says) for name, (_, says) in RECORDS.items()),
        Bad(f"check {PAIR} {_BOARD} --calibration missing.json", "missing.json"),
        Bad(f"check {PAIR} {_BOARD} {_RIG} --picture out.jpg", r"\.png"),
        Bad(f"check {PAIR} {_BOARD} {_RIG} --picture good/left.jpg/out.png", "cannot be written"),
        Bad(f"check small.png small2.png {_BOARD} {_RIG}", "small.png|board|size"),
        Bad(f"check row.png row2.png {_BOARD} {_RIG}", "row.png|board|size"),
    ],
    "calibrate-laser": [
        Bad(f"calibrate-laser missing scans_empty {_RIG} {_BOARD}", "missing: no such file or folder"),
        Bad(f"calibrate-laser boards_left missing {_RIG} {_BOARD}", "missing is no folder"),
        Bad(f"calibrate-laser boards_left scans_none {_RIG} {_BOARD}", "0 scans"),
        Bad(f"calibrate-laser boards_left scans_few {_RIG} {_BOARD}", "1 scan"),
        Bad(f"calibrate-laser boards_left scans_empty {_RIG} {_BOARD}", "0.png|size|board"),
        Bad(f"calibrate-laser boards_left scans_empty {_RIG} {_BOARD} --margin-mm -1", "--margin-mm"),
        Bad(f"calibrate-laser boards_left scans_empty {_RIG} {_BOARD} --margin-mm nan", "--margin-mm"),
        Bad(f"calibrate-laser boards_left scans_empty --calibration rig_R_zero.json {_BOARD}", "R is not a rotation"),
        Bad(f"calibrate-laser boards_left scans_empty --calibration missing.json {_BOARD}", "missing.json"),
        Bad(f"calibrate-laser boards_left scans_empty {_RIG} --board 9x6 --square-mm 1e308", "square"),
    ],
    "measure": [
        *(
            Bad(f"measure {PAIR} {_RIG} --scan {name}", says)
            for name, says in {
                "missing.bin": "no such file",
                "empty.bin": "is empty",
                "zeros.bin": "no XV-11 recording",
                "noise.bin": "no XV-11 recording",
                "one_packet.bin": "one_packet.bin",
                "half_turn.bin": "half_turn.bin",
                "silent.bin": "says nothing",
                "sparse.bin": "at most 268 MB",
                "/dev/zero": "is a device",
                "table_empty.csv": "first line",
                "table_head.csv": "too few",
                "table_words.csv": "line 2: 'a' is no number",
                "table_other.csv": "first line",
                "table_inf.csv": "line 2: 'inf' is no number",
                "table_1e300.csv": "'1e300' is no number",
                "table_uneven.csv": "even steps",
                "table_short.csv": "too few",
                "table_wide.csv": "2 values|first line",
                "table_quote.csv": "table_quote.csv",
                "table_nul.csv": "table_nul.csv",
                "table_latin.csv": "UTF-8",
                "table_field.csv": "table_field.csv",
            }.items()
        ),
        Bad(f"measure good/left.jpg missing.png {_RIG}", "missing.png: no such file"),
        Bad(f"measure good/left.jpg good/left.jpg {_RIG}", "left.jpg are the same picture"),
        Bad(f"measure good/left.jpg black.png {_RIG}", "one grey value, 0: there is nothing to match; take it again"),
        Bad(f"measure {PAIR} {_RIG} --floor=-3,8", "above 0 mm"),
        Bad("measure row.png row2.png --calibration good/calibration.json", "row.png"),
        Bad("measure small.png small2.png --calibration good/calibration.json", "small"),
        Bad(
            "measure other.png good/right.jpg --calibration good/calibration.json",
            "other.png is 320x480.*: a stereo pair must have one size",
        ),
        Bad("measure claims_32000.png claims_32000.png --calibration good/calibration.json", "megapixels"),
        Bad(f"measure {PAIR} {_RIG} --output out.jpg", r"\.png"),
        Bad(f"measure {PAIR} {_RIG} --output good/left.jpg/out.png", "cannot be written"),
        Bad(f"measure {PAIR} {_RIG} --output silent.png", "nobody reads this pipe"),
        Bad(f"measure {PAIR} {_RIG} --floor=0.45,-20", "millimetres"),
        Bad(f"measure {PAIR} {_RIG} --floor=8.5,8.3", "millimetres"),
        Bad(f"measure {PAIR} {_RIG} --floor=nan,0", "--floor"),
        Bad(f"measure {PAIR} {_RIG} --floor=1e300,0", "--floor"),
        Bad(f"measure {PAIR} {_RIG} --floor=450,90", "--floor.*between -90 and 90"),
        Bad(f"measure {PAIR} {_RIG} --floor=450", "is not HEIGHT,PITCH"),
        Bad(f"measure {PAIR} {_RIG} --floor=450,-20,nan,1", "--floor"),
        Bad(f"measure {PAIR} {_RIG} --between 1,1 a,b", "--between"),
        Bad(f"measure {PAIR} {_RIG} --between 1,1 9999,1 --rectified", "9999,1 is outside the rectified left picture"),
        Bad(f"measure {PAIR} {_RIG} --rectified", "give both, or neither"),
        Bad(f"measure {PAIR} {_RIG} --between 1,1 9999,1", "9999"),
        Bad(f"measure {PAIR} {_RIG} --between nan,1 320,240", "nan"),
        Bad(f"measure {PAIR} {_RIG} --between inf,1 320,240", "inf"),
        Bad(f"measure {PAIR} {_RIG} --between 1e300,1 320,240", "1e"),
        Bad(f"measure {PAIR} {_RIG} --between 320,240 320,240", "same|apart|two"),
        Bad(f"measure {PAIR}", "--calibration"),
    ],
    "map": [
        Bad("map walk --output=", "nothing stands behind --output="),
        Bad("map missing", "missing is no folder"),
        Bad("map good/left.jpg", "is no folder"),
        Bad("map map_bare", "holds no station"),
        Bad("map map_rigless", "map_rigless has no calibration.json: say with --calibration where the rig's is"),
        Bad("map map_lonely", r"without a partner.*: 1_left\.jpg \(1_right\.jpg is missing\)"),
        Bad("map map_twins", "station 1 has two files for its scan, 1_scan.bin and 1_scan.csv"),
        Bad("map map_numbers", "two files for its scan, 01_scan.bin and 1_scan.bin"),
        Bad("map map_pictureless", "a picture"),
        Bad("map map_cut", "cut short"),
        Bad("map map_small", "8x8"),
        Bad("map map_scanless", "is empty"),
        Bad("map map_noise", "no XV-11 recording"),
        Bad("map map_column", "too few"),
        Bad("map map_radians", "as if in radians"),
        Bad("map map_semicolons", "commas between columns, points in numbers"),
        Bad("map map_metres", "1.9 at most, as if in metres"),
        Bad("map map_poses_head", "first line"),
        Bad("map map_poses_stranger", "line 2: there is no station '7', only 1"),
        Bad("map map_poses_twice", "twice"),
        Bad("map map_poses_word", "'here' is no number"),
        Bad("map map_poses_nan", "'nan' is no number"),
        Bad("map map_poses_inf", "'-inf' is no number"),
        Bad("map map_poses_huge", "1e.?300"),
        Bad("map map_poses_short", "4 values"),
        Bad("map map_poses_bytes", "UTF-8"),
        Bad("map map_poses_empty", "first line"),
        Bad("map map_poses_nan --poses missing.csv", "missing.csv"),
        Bad("map map_poses_nan --output good/left.jpg", "is a file"),
        Bad("map map_poses_nan --output /proc/nowhere", "cannot be written"),
        Bad("map map_noise --calibration rig_laser_inf.json", "finite"),
        Bad("map map_noise --calibration rig_T_huge.json", "rig_T_huge.json"),
        Bad("map map_noise --calibration rig_size_large.json", "rig_size_large.json"),
    ],
}


def _table() -> list[Bad]:
    measure = f"measure {PAIR} --scan good/scan.bin --calibration"
    rows = [Bad(f"{measure} rig_{name}.json", says) for name, (_, says) in (RIGS | TEXTS).items()]  # type: ignore[operator]
    rows += [
        Bad(f"{measure} {name}", says)
        for name, says in {
            "missing.json": "missing.json: no such file; `stereolib calibrate` makes a rig file",
            "sparse.json": "at most 4 MB|at most 4.19 MB",
            "loop.json": "loop.json",
            "folder": "is a folder",
            "silent.json": "says nothing",
            "/dev/zero": "is a device",
        }.items()
    ]
    return rows + [row for group in OTHERS.values() for row in group]


TABLE = _table()
