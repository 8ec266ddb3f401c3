"""What sensors and their boards say in letters."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib import laser
from stereolib.laser.text_streams import read_text_stream
from stereolib.virtual import cube_scene, emulator

GREETING = b""":)
Piccolo Laser Distance Scanner
Copyright (c) 2009-2011 Neato Robotics, Inc.
All Rights Reserved

Loader\tV2.5.15295
CPU\tF2802x/c001
Serial\tXXX00000AA-0000000
LastCal\t[5371726C]
Runtime\tV2.6.15295
#Spin...3 ESCs or BREAK to abort
"""


@pytest.fixture(scope="module")
def recorded() -> bytes:
    """Two seconds of the virtual laser."""
    return b"".join(chunk for _, chunk in emulator.emulate(cube_scene(), rng=np.random.default_rng(1), seconds=2.0))


@pytest.fixture(scope="module")
def whole(recorded: bytes) -> list[laser.LaserScan]:
    return [scan for scan in laser.turns(laser.decode(recorded)) if scan.complete]


def as_neato(scan: laser.LaserScan) -> str:
    lines = ["GetLDSScan", "AngleInDegrees,DistInMM,Intensity,ErrorCodeHEX"]
    for k, (mm, strength) in enumerate(zip(scan.ranges_mm, scan.intensities, strict=True)):
        lines.append(f"{k},0,0,8035" if np.isnan(mm) else f"{k},{mm:.0f},{strength:.0f},0")
    return "\r\n".join([*lines, f"ROTATION_SPEED,{scan.speed_rpm / 60:.3f}", "\x1a"])


def as_board(scan: laser.LaserScan, old: bool) -> str:
    readings = [(k, mm) for k, mm in enumerate(scan.ranges_mm) if np.isfinite(mm)]
    return "\r\n".join(f"{k}: {mm:.0f} (87)" if old else f"{k},{mm:.0f}" for k, mm in readings)


def test_hex_digits_are_the_bytes(recorded: bytes) -> None:
    for text in (recorded.hex(" "), recorded.hex(), ", ".join(f"0x{byte:02X}" for byte in recorded)):
        found = laser.decode_recording(text.encode(), "dump.txt")
        np.testing.assert_array_equal(found.distance_mm, laser.decode(recorded).distance_mm)


def test_a_robots_answer(whole: list[laser.LaserScan]) -> None:
    text = "\n".join(map(as_neato, whole[:3])).encode()
    found = laser.turns(laser.decode_recording(text, "lds.csv"))
    assert len(found) == 3 and all(scan.complete for scan in found)
    for scan, original in zip(found, whole, strict=False):
        np.testing.assert_allclose(scan.ranges_mm, original.ranges_mm, atol=0.5)
        np.testing.assert_array_equal(np.nan_to_num(scan.intensities), np.nan_to_num(original.intensities))
        assert scan.speed_rpm == pytest.approx(np.median([one.speed_rpm for one in whole[:3]]), abs=0.1)


@pytest.mark.parametrize("old", [False, True])
def test_a_boards_lines(whole: list[laser.LaserScan], old: bool) -> None:
    text = "\n".join(as_board(scan, old) for scan in whole[:4]).encode()
    found = laser.turns(laser.decode_recording(text, "dist.txt"))
    assert len(found) == 4 and all(scan.complete for scan in found[1:3])
    for scan, original in zip(found[1:3], whole[1:3], strict=True):
        np.testing.assert_allclose(scan.ranges_mm, original.ranges_mm, atol=0.5)
    assert np.isnan(found[1].ranges_mm).sum() == np.isnan(whole[1].ranges_mm).sum() > 0


def test_text_that_begins_and_ends_within_a_turn(whole: list[laser.LaserScan]) -> None:
    lines = "\n".join(as_board(scan, old=False) for scan in whole[:3]).splitlines()
    found = laser.turns(laser.decode_recording("\n".join(lines[100:-100]).encode(), "dist.txt"))
    assert [scan.complete for scan in found] == [False, True, False]


def test_a_greeting_says_that_the_motor_stands_still() -> None:
    with pytest.raises(ValueError, match=r"hello.bin: the sensor greets and waits for its motor: .* about 300 turns"):
        laser.decode_recording(GREETING * 3, "hello.bin")


def test_a_greeting_before_the_packets_is_passed_over(recorded: bytes) -> None:
    found = laser.decode_recording(GREETING + recorded, "room.bin")
    assert len(found) == len(laser.decode(recorded)) and found.skipped_bytes >= len(GREETING)


@pytest.mark.parametrize("text", ["", "hello", "1,2\n3,4\n", "a,b,c\n" * 500, "fa a0 00", "999,20\n" * 50])
def test_other_text_is_no_scan(text: str) -> None:
    assert read_text_stream(text.encode()) is None


def test_bytes_are_no_text(recorded: bytes) -> None:
    assert read_text_stream(recorded) is None


def test_a_port_that_greets() -> None:
    waits = [(0.0, GREETING), (30.0, b"#")]
    said = r"sent nothing more for .* greets and waits for its motor"
    with emulator.serve(waits, "socket") as served, pytest.raises(laser.LidarError, match=said):
        next(laser.open_lidar(served.port, timeout_s=0.5))


def test_a_port_that_prints(whole: list[laser.LaserScan]) -> None:
    lines = "\n".join(as_board(scan, old=False) for scan in whole[:8]).encode()
    pieces = [(0.01 * k, lines[500 * k :][:500]) for k in range(len(lines) // 500)]
    said = "prints distances as text: switch it to raw bytes"
    with emulator.serve(pieces, "socket") as served, pytest.raises(laser.LidarError, match=said):
        next(laser.open_lidar(served.port, timeout_s=2.0))
