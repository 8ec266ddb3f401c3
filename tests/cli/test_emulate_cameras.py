"""``stereolib emulate-cameras``: what it says can be opened, and what it refuses."""

from __future__ import annotations

import re
from itertools import islice

import pytest

from stereolib.cli import commands, emulate_cameras
from stereolib.rig import LiveRig
from stereolib.virtual import camera_emulator, emulator


def test_the_addresses_that_it_says_are_two_cameras(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    seen = []

    def look(_: float) -> None:
        """In place of waiting: open what was said, then press Ctrl-C."""
        told = capsys.readouterr().out
        rig = LiveRig(*re.findall(r"^(?:left|right) +(http://127\.0\.0\.1:\d+/\S+)$", told, re.MULTILINE))
        seen.extend(islice(rig.pairs(), 2))
        rig.close()
        words = "--board 9x6 --square-mm 25 --ruler-mm 93 --output rig0/boards"
        assert re.search(rf"stereolib capture http://\S+ http://\S+ {words}", told)
        raise KeyboardInterrupt

    monkeypatch.setattr(emulate_cameras.time, "sleep", look)
    assert commands.main(["emulate-cameras", "--places", "1", "--scale", "0.25", "--seed", "3"]) == 130
    assert [pair.left.shape for pair in seen] == [(120, 160, 3)] * 2


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--scale", "9"], "a scale of 0.1 to 4"),
        (["--seed", "-1"], "--seed must be 0 or more"),
        (["--late-ms", "-5"], "late_s must be 0 or more"),
        (["--drop-rate", "2"], "drop_rate must be 0 to 1"),
        (["--freeze-after-s", "nan"], "freeze_after_s must be 0 or more"),
        (["--cable-kb-s", "0"], "--cable-kb-s must be more than 0"),
    ],
)
def test_bad_input_is_one_line(words: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert commands.main(["emulate-cameras", *words]) == 2
    told = capsys.readouterr().err
    assert text in told and told.count("\n") == 1


def test_the_lines_to_try_fit_the_place(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def end(_: float) -> None:
        raise KeyboardInterrupt

    def tried(command: str, *words: str) -> str:
        assert commands.main([*command.split(), "--rig", "7", *words]) in (0, 130)
        (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("try ")]
        return re.sub(r"\S+://\S+", "AT", line)

    monkeypatch.setattr(emulate_cameras.time, "sleep", end)
    monkeypatch.setattr(emulator.Served, "wait", lambda *_: True)
    small, socket = ("--scale", "0.1"), ("--link", "socket")
    walk, another_box = ("--scene", "walk", "--at", "3"), ("--scene", "box", "--at", "3")
    before = "try in another terminal, after the places 1 to 2: stereolib"
    assert (
        tried("emulate-cameras", *walk, *small) == f"{before} capture AT AT --output rig7/walk --pairs 3 --no-preview"
    )
    assert tried("lrf emulate", *walk, *socket) == f"{before} lrf record AT rig7/walk/scans/03.bin --seconds 3"
    alone = "try in another terminal: stereolib"
    assert tried("emulate-cameras", *another_box, *small) == f"{alone} capture AT AT --output rig7/box_3 --no-preview"
    assert tried("lrf emulate", *another_box, *socket) == f"{alone} lrf record AT rig7/box_3/scans/01.bin --seconds 3"


def test_what_is_drawn_is_said_before_it_is_drawn(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def draw(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(camera_emulator, "show_boards", draw)
    assert commands.main(["emulate-cameras", "--scale", "1"]) == 130
    assert capsys.readouterr().err.startswith("drawing a board in 24 places, 640x480: about 30 s")


def test_the_laser_of_a_rig_is_told_the_same_truth(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def end(_: float) -> None:
        raise KeyboardInterrupt

    def told(*words: str) -> list[str]:
        code = commands.main([*words, "--truth"])
        assert code in (0, 130)
        return [line for line in capsys.readouterr().out.splitlines() if line.startswith("true ")]

    monkeypatch.setattr(emulate_cameras.time, "sleep", end)
    monkeypatch.setattr(emulator.Served, "wait", lambda *_: True)
    scene = ("--rig", "7", "--scene", "box", "--at", "3")
    cameras = told("emulate-cameras", *scene, "--scale", "0.25")
    laser = told("lrf", "emulate", *scene, "--link", "socket")
    assert [line.partition(":")[0] for line in cameras] == [
        "true focal lengths", "true distance of the lenses", "true place of the laser", "true sizes",
    ]  # fmt: skip
    assert laser == cameras[1:]
    assert told("lrf", "emulate", "--rig", "8", *scene[2:], "--link", "socket")[:2] != laser[:2]
    assert told("lrf", "emulate", *scene[:-1], "4", "--link", "socket")[2:] != laser[2:]
