"""``stereolib emulate-cameras``: what it says can be opened, and what it refuses."""

from __future__ import annotations

import re
from itertools import islice

import pytest

from stereolib.cli import commands, emulate_cameras
from stereolib.rig import LiveRig
from stereolib.virtual import emulator


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
        words = "--board 9x6 --square-mm 25 --ruler-mm 93 --output rig"
        assert re.search(rf"stereolib capture http://\S+ http://\S+ {words}", told)
        raise KeyboardInterrupt

    monkeypatch.setattr(emulate_cameras.time, "sleep", look)
    assert commands.main(["emulate-cameras", "--places", "1", "--scale", "0.25", "--seed", "3"]) == 130
    assert [pair.left.shape for pair in seen] == [(120, 160, 3)] * 2


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--places", "0"], "1 to 1000 places"),
        (["--fps", "0"], "pictures a second"),
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
