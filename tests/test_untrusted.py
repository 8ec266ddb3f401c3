"""Whatever bytes come: loaders read them or say in a ValueError what is wrong. For minutes: ``--fuzz-minutes 10``."""

from __future__ import annotations

import ast
import json
import random
import re
import time
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereolib import laser
from stereolib.base import datasets, read_json, read_yaml
from stereolib.calibration import CalibrationRecord
from stereolib.cli.voila import voila_command
from stereolib.mapping import list_stations, read_scan
from stereolib.measurement import Instrument, save_laser_pose
from stereolib.paper import paper_rig
from stereolib.rig import Camera, StereoRig, formats, image_size, read_image
from stereolib.virtual import emulator
from stereolib.virtual.measured_walk import walk_laser

LIBRARY = sorted((datasets.ROOT / "stereolib").rglob("*.py"))
_EXAMPLES = 40  # of each loader on every run
_SPECIAL = (b"NaN", b"-Infinity", b"1e309", b"9" * 400, b"null", b"[]", b"{}", b"-1", b"0", b'""', b"\xff", b"\0")
_TOKENS = re.compile(rb"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?|[A-Za-z_]+|[\[\]{}:,\"']")


def _record(path: Path) -> None:
    CalibrationRecord.load(path, StereoRig.load(path))


def _stations(path: Path) -> None:
    folder = path.parent / "stations"
    folder.mkdir(exist_ok=True)
    (folder / "1_scan.csv").touch()
    list_stations(folder, path)


#: What is spoilt -> its loader; the good file is made by `seeds`.
LOADERS: dict[str, Callable[[Path], object]] = {
    "calibration.json": Instrument.load,
    "record.json": _record,
    "rig.json": formats.load_rig,
    "opencv.yml": formats.load_opencv,
    "opencv.xml": formats.load_opencv,
    "camchain.yaml": formats.load_kalibr,
    "ros.yaml": lambda path: formats.load_ros(path, path.with_name("right.yaml")),
    "any.json": read_json,
    "any.yaml": read_yaml,
    "scan.bin": read_scan,
    "scan.csv": read_scan,
    "old.bin": laser.recording_info,
    "text.bin": laser.recording_info,
    "poses.csv": _stations,
    "picture.png": read_image,
    "picture.jpg": read_image,
    "header.png": image_size,
}


@pytest.fixture(scope="module")
def seeds(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """A good file of each kind."""
    folder = tmp_path_factory.mktemp("good")
    rig = paper_rig()
    plain = StereoRig(*(Camera(c.K, c.dist[:4], c.size) for c in (rig.left, rig.right)), rig.R, rig.T)
    notes = {"verdict": "good", "board": {"square_mm": 25.0}, "std": {"rectified": {"f_px": 0.1, "baseline_mm": 0.1}}}
    rig.save(folder / "calibration.json", calibration=notes)
    save_laser_pose(folder / "calibration.json", walk_laser())
    kept = {"covariance": np.eye(2 * (4 + rig.left.dist.size) + 6).tolist(), "sigma_px": 0.1, "scatter": 1.0}
    rig.save(folder / "record.json", calibration={"record": kept | {"outer_px": {"1.png": [1.0] * 8}}})
    rig.save(folder / "rig.json")
    formats.save_opencv(folder / "opencv.yml", rig)
    formats.save_opencv(folder / "opencv.xml", rig)
    formats.save_kalibr(folder / "camchain.yaml", plain)
    formats.save_ros(folder / "ros.yaml", folder / "right.yaml", rig)
    (folder / "any.json").write_text(json.dumps({"a": [1, {"b": None}], "c": "\u00b1"}))
    (folder / "any.yaml").write_text("a: &x [1, 2]\nb: *x\nc: {d: 'e', f: 1.5}\n")
    data = (datasets.ROOT / "data" / "virtual" / "lrf" / "room.bin").read_bytes()
    (folder / "scan.bin").write_bytes(data)
    (folder / "old.bin").write_bytes((bytes.fromhex("5aa500c08ad1") + bytes(range(240)) * 6) * 3)
    (folder / "text.bin").write_text("\n".join(f"{angle},{500 + angle},40,0" for angle in range(360)))
    (folder / "scan.csv").write_text("angle_deg,range_mm\n" + "".join(f"{k},{900 + k}\n" for k in range(360)))
    (folder / "poses.csv").write_text("station,x_mm,y_mm,yaw_deg\n1,0,0,0\n")
    picture = np.random.default_rng(0).integers(0, 256, (24, 40, 3), np.uint8)
    for name in ("picture.png", "picture.jpg", "header.png"):
        cv2.imwrite(str(folder / name), picture)
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def spoil(data: bytes, rng: random.Random) -> bytes:
    """Damage as cables, disks, editors and malice do it."""
    for _ in range(rng.choice((1, 1, 2, 3, 8))):
        kind, at = rng.randrange(7), rng.randrange(len(data) + 1)
        if kind == 0:
            data = data[:at]
        elif kind == 1:
            data = data[:at] + rng.randbytes(rng.randrange(1, 9)) + data[at + rng.randrange(9) :]
        elif kind == 2 and data:
            data = data[: at - 1] + bytes([data[at - 1] ^ (1 << rng.randrange(8))]) + data[at:]
        elif kind == 3:
            data = data[:at] + data[at : at + rng.randrange(200)] * rng.randrange(1, 40) + data[at:]
        elif kind == 4:
            data = data[:at] + rng.choice((b"[", b"{", b"<a>", b"- ", b"&a ", b"*a ")) * rng.randrange(200) + data[at:]
        elif tokens := [found.span() for found in _TOKENS.finditer(data[:200_000])]:  # a word or number for another
            first, last = rng.choice(tokens)
            other = rng.choice(tokens)
            new = rng.choice((*_SPECIAL, data[slice(*other)]))
            data = data[:first] + new + data[last:]
    return data


def attempt(name: str, data: bytes, folder: Path, seeds: dict[str, bytes]) -> None:
    """Load it: what comes out is a result or a ValueError of a line's length, and no warning of numpy's."""
    path = folder / name
    path.write_bytes(data)
    (folder / "right.yaml").write_bytes(seeds["right.yaml"])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            LOADERS[name](path)
    except ValueError as error:
        assert str(error) and len(str(error)) < 2000


@pytest.mark.parametrize("name", LOADERS)
def test_good_files_are_read(name: str, seeds: dict[str, bytes], tmp_path: Path) -> None:
    path = tmp_path / name
    for other, data in seeds.items():
        (tmp_path / other).write_bytes(data)
    LOADERS[name](path)


@pytest.mark.parametrize("name", LOADERS)
def test_spoilt_files_are_read_or_refused(
    name: str, seeds: dict[str, bytes], tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("spoilt")

    @given(st.randoms(use_true_random=False), st.booleans())
    @settings(max_examples=_EXAMPLES)
    def fuzz(rng: random.Random, noise: bool) -> None:
        data = rng.randbytes(rng.randrange(3000)) if noise and rng.random() < 0.1 else spoil(seeds[name], rng)
        attempt(name, data, folder, seeds)

    fuzz()


@pytest.mark.timeout(0)
def test_for_minutes(request: pytest.FixtureRequest, seeds: dict[str, bytes], tmp_path: Path) -> None:
    """All loaders in turn, with other damage each time; a finding names its seed and keeps its file."""
    minutes = float(request.config.getoption("--fuzz-minutes"))
    if not minutes:
        pytest.skip("for minutes with --fuzz-minutes 10")
    end, seed, tried = time.monotonic() + 60 * minutes, random.SystemRandom().randrange(10**9), 0
    while time.monotonic() < end:
        for name in LOADERS:
            rng = random.Random(f"{seed} {tried} {name}")
            try:
                attempt(name, spoil(seeds[name], rng), tmp_path, seeds)
            except BaseException as error:
                pytest.fail(f"{name} ({tmp_path / name}), seed {seed}, after {tried} rounds: {error!r}")
        tried += 1
    with request.config.pluginmanager.getplugin("capturemanager").global_and_fixture_disabled():
        print(f"\n{tried} rounds over {len(LOADERS)} loaders without a finding")


@cache
def all_calls() -> dict[str, list[tuple[Path, ast.Call]]]:
    """Calls anywhere in the library, by the name of the function or method."""
    found: dict[str, list[tuple[Path, ast.Call]]] = {}
    for path in LIBRARY:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call):
                found.setdefault(getattr(node.func, "attr", getattr(node.func, "id", "")), []).append((path, node))
    return found


def calls(name: str) -> list[tuple[Path, ast.Call]]:
    return all_calls().get(name, [])


def test_nothing_runs_what_a_file_says() -> None:
    for name in ("eval", "exec", "system", "popen", "unsafe_load", "full_load", "extractall", "unpack_archive"):
        assert not [str(path) for path, _ in calls(name)], name
    arrays = [(path, {word.arg: word.value for word in call.keywords}) for path, call in calls("load")
              if getattr(getattr(call.func, "value", None), "id", "") == "np"]  # fmt: skip
    assert arrays
    for path, words in arrays:
        assert "allow_pickle" in words and ast.literal_eval(words["allow_pickle"]) is False, path
    for path in LIBRARY:
        assert not re.search(
            r"^\s*(import|from) (pickle|shelve|marshal|dill)\b", path.read_text(encoding="utf-8"), re.M
        )
    for name in ("run", "call", "Popen", "check_output", "check_call"):
        for path, call in calls(name):
            assert not any(word.arg == "shell" for word in call.keywords), path


def test_pages_are_served_to_this_machine_alone_with_a_token() -> None:
    """Voila is told so in one place, whichever command starts it; no server is told of another address anywhere."""
    words = voila_command("live.ipynb", 8765)
    assert {"--token", "--Voila.ip=127.0.0.1"} <= set(words)
    started = [str(path) for path, call in calls("Popen") + calls("call") if "voila" in ast.unparse(call)]
    assert len(started) == len(calls("voila_command")) == 1 and len(calls("serving")) == 2, "explore, the live pages"
    for path in LIBRARY:
        assert not re.search(r"0\.0\.0\.0|INADDR_ANY|ip=\*|token=''", path.read_text(encoding="utf-8")), path


def test_emulators_listen_on_this_machine_alone() -> None:
    with emulator.serve([(0.0, b"x")], "socket") as served:
        assert served.port.startswith("socket://127.0.0.1:")


def test_numbers_that_overflow_are_refused_where_they_are_read() -> None:
    rig: Any = paper_rig()
    for change in ({"K": rig.left.K * 1e200}, {"dist": [1e200, 0, 0, 0]}, {"size": (10**400, 480)}):
        with pytest.raises(ValueError, match="must be"):
            Camera(**({"K": rig.left.K, "dist": rig.left.dist, "size": rig.left.size} | change))
