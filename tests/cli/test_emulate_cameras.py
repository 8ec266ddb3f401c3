"""``stereolib emulate-cameras``: what it says can be opened, and what it refuses."""

from __future__ import annotations

import re
from itertools import islice

import pytest

from stereolib.cli import commands, emulate_cameras
from stereolib.rig import LiveRig


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
        assert re.search(r"stereolib capture http://\S+ http://\S+ --board 9x6 --square-mm 25 --output rig", told)
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
