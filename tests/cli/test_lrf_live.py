"""``stereolib lrf live`` and ``lrf export``: what they say, draw and write, read back."""

from __future__ import annotations

import re
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from stereolib import laser
from stereolib.base import data_path
from stereolib.cli import commands
from stereolib.mapping import read_scan
from stereolib.notebook import laser_view
from stereolib.virtual import emulator, recordings

ROOM = str(data_path("virtual/lrf/room.bin"))


def scan() -> laser.AveragedScan:
    return laser.average(laser.take_scans(ROOM, 5))


def test_a_table_reads_back_as_the_same_scan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = tmp_path / "room.csv"
    assert commands.main(["lrf", "export", ROOM, str(table)]) == 0
    back, known = read_scan(table), scan()
    np.testing.assert_allclose(back.ranges_mm, known.ranges_mm, atol=0.01)
    np.testing.assert_allclose(laser.points_mm(back), laser.points_mm(known), atol=0.02)
    assert f"{int((known.count > 0).sum())} of 360 beams" in capsys.readouterr().out
    assert table.read_text().startswith("angle_deg,range_mm\n0,")


def test_points_stand_where_the_sensor_stood(tmp_path: Path) -> None:
    cloud = tmp_path / "room.ply"
    words = ["lrf", "export", ROOM, str(cloud), "--pose", "1200,-300,90", "--height-mm", "85"]
    assert commands.main(words) == 0
    points = laser.points_mm(scan())
    turned = np.column_stack([-points[:, 1] + 1200, points[:, 0] - 300, np.full(len(points), 85.0)])
    np.testing.assert_allclose(trimesh.load(cloud).vertices, turned / 1000, atol=2e-6)
    before = cloud.read_bytes()
    assert commands.main(words) == 2 and cloud.read_bytes() == before
    assert commands.main([*words[:4], "--force"]) == 0 and cloud.read_bytes() != before


def test_live_says_speed_rate_and_loss(capsys: pytest.CaptureFixture[str]) -> None:
    schedule = emulator.emulate(recordings.pairs()["conditions/plain"][1], rng=np.random.default_rng(0))
    with emulator.serve(schedule, "socket") as served:
        assert commands.main(["lrf", "live", served.port, "--no-preview", "--seconds", "1.5"]) == 0
    told = capsys.readouterr()
    assert "turns a second, 0 packets lost (0.0%), 0 damaged" in told.out
    assert re.match(r"(29|30)\d rpm, ", told.out)
    assert "rpm" in told.err


def turn_of(ranges_mm: np.ndarray, rpm: float = 300.0) -> laser.LiveTurn:
    return laser.LiveTurn(laser.LaserScan(ranges_mm, np.ones(360), speed_rpm=rpm), 4, 5.0, 9, 1, 0)


def test_what_is_drawn_stands_where_it_was_measured() -> None:
    ranges = np.full(360, np.nan)
    ranges[[0, 90]] = 1500.0
    ranges[200] = 1990.0
    (chart,) = laser_view.draw_turns([turn_of(ranges)]).images
    green = (np.abs(chart.astype(int) - laser_view._GREEN).max(axis=2) < 50).astype(np.uint8)
    count, _, _, centres = cv2.connectedComponentsWithStats(green)
    assert count == 4
    scale = (320 - 10) / 2000  # 2 m reach the rim
    where = 320 - laser.points_mm(turn_of(ranges).scan)[:, ::-1] * scale
    apart = np.linalg.norm(where[:, None] - centres[1:], axis=2)
    assert apart.min(axis=1).max() < 1.0 and sorted(apart.argmin(axis=1)) == [0, 1, 2]


def test_older_turns_are_pale_and_a_wrong_speed_is_said() -> None:
    old, new = (np.full(360, mm) for mm in (900.0, 600.0))
    (chart,) = (view := laser_view.draw_turns([turn_of(old), turn_of(new, 150.0)])).images
    for mm, color in ((900, laser_view._OLD), (600, laser_view._GREEN)):
        at = 320 - np.rint(laser.points_mm(turn_of(np.full(360, float(mm))).scan) * 310 / 1000).astype(int)
        np.testing.assert_allclose(np.median(chart[at[:, 0], at[:, 1]], axis=0), color, atol=10)
    assert "150 rpm" in view.html and "makes about 300" in view.html and "9 packets lost (2.5%)" in view.html
    assert "makes about 300" not in laser_view.draw_turns([turn_of(new)]).html


def test_turns_come_for_as_long_as_they_are_asked_for() -> None:
    schedule = emulator.emulate(recordings.pairs()["conditions/plain"][1], rng=np.random.default_rng(0))
    with emulator.serve(schedule, "socket") as served:
        seen = list(islice(laser.watch_turns(served.port), 12))
    assert [turn.turns for turn in seen] == list(range(1, 13))
    assert np.isfinite(seen[-1].rate_hz) and seen[-1].scan.complete
