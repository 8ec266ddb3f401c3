"""The laser's commands, as a user types them."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from stereolib import laser, plotting
from stereolib.base import data_path
from stereolib.cli import commands, lrf
from stereolib.laser import serial_port
from stereolib.virtual import emulator, recordings

ROOM = str(data_path("virtual/lrf/room.bin"))


def test_info_tells_what_the_room_recording_holds(capsys: pytest.CaptureFixture[str]) -> None:
    assert commands.main(["lrf", "info", ROOM, "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["packets"], facts["bad_checksums"], facts["skipped_bytes"], facts["turns"]) == (450, 0, 0, 5)
    readings = laser.decode(recordings.load_laser("lrf/room"))
    rpm = np.sort(readings.speed_rpm)
    assert rpm[0] > 295 and rpm[-1] < 305
    assert (facts["rpm_min"], facts["rpm_median"], facts["rpm_max"]) == (rpm[0], rpm[224:226].mean(), rpm[-1])
    assert facts["invalid_share"] == pytest.approx(np.isnan(readings.distance_mm).mean())


def test_info_tells_every_fact_in_words_with_its_unit(capsys: pytest.CaptureFixture[str]) -> None:
    assert commands.main(["lrf", "info", ROOM, "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert commands.main(["lrf", "info", ROOM]) == 0
    told = dict(re.split(r"\s{2,}", line) for line in capsys.readouterr().out.splitlines())
    assert not facts.pop("damage") and len(told) == len(facts) and not any("_" in what for what in told)
    assert told["packets"] == "450" and told["whole turns"] == "5"
    assert told["median, turns a minute"] == f"{facts['rpm_median']:.4g}"
    assert told["readings without a distance"] == f"{100 * facts['invalid_share']:.1f} %"


def test_a_recording_that_nothing_can_use_is_told_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sent, short = recordings.load_laser("lrf/room"), tmp_path / "short.bin"
    short.write_bytes(sent[: 22 * 60])
    assert commands.main(["lrf", "info", str(short)]) == commands.main(["lrf", "info", str(short), "--json"]) == 1
    assert f"{short} holds no whole turn, and nothing can use it: a turn takes" in capsys.readouterr().err
    short.write_bytes(sent[: 22 * 100])
    assert commands.main(["lrf", "info", str(short)]) == 0 and not capsys.readouterr().err
    spoilt = bytearray(sent)
    spoilt[10 : 22 * 250 : 22] = bytes(byte ^ 1 for byte in spoilt[10 : 22 * 250 : 22])
    short.write_bytes(spoilt)
    assert commands.main(["lrf", "info", str(short)]) == 1
    told = capsys.readouterr()
    assert re.search(r"packets with a wrong checksum +250\n", told.out)  # the whole table, though most is damaged
    assert f"{short}: 250 of 450 packets are damaged: see to cable" in told.err


def test_record_says_that_the_line_loses_packets(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sound = list(emulator.replay(3 * recordings.load_laser("lrf/room")))
    lossy = [entry for k, entry in enumerate(sound) if k % 10]
    for schedule, share in ((sound, 0.0), (lossy, 0.1)):
        target = tmp_path / f"{share}.bin"
        with emulator.serve(schedule, "socket") as served:
            words = ["lrf", "record", served.port, str(target), "--seconds", "0.9"]
            assert commands.main(words) == 0
        notes, told = json.loads(Path(f"{target}.json").read_text()), capsys.readouterr().err
        assert notes["lost_share"] == pytest.approx(share, abs=0.02)
        assert all(abs(float(pct) - 100 * share) < 4 for pct in re.findall(r"valid, (\d+)% lost", told))
        assert "% lost" in told
        assert bool(re.search(r"warning: \d+% of the packets were lost or damaged", told)) == bool(share)


def test_record_says_that_no_packet_came(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A board's text, too, which `lrf info` reads: nothing is said of the cable."""
    text = [(0.01 * k, b"a board that prints text\r\n") for k in range(300)]
    with emulator.serve(text, "socket") as served:
        assert commands.main(["lrf", "record", served.port, str(tmp_path / "text.bin"), "--seconds", "0.3"]) == 0
    assert "warning: no XV-11 packet is in it: stereolib lrf info " in capsys.readouterr().err
    assert json.loads((tmp_path / "text.bin.json").read_text())["lost_share"] is None


def test_turns_with_gaps_are_combined_and_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serial_port, "_START_S", 1.0)
    monkeypatch.setattr(serial_port, "_LONGEST_TURN_S", 0.1)
    lossy = [entry for k, entry in enumerate(emulator.replay(4 * recordings.load_laser("lrf/room"))) if k % 50]
    for words in (["show"], ["export"]):
        target = tmp_path / ("room.png" if words == ["show"] else "room.csv")
        named = ["--output", str(target)] if words == ["show"] else [str(target)]
        with emulator.serve(lossy, "socket") as served:
            assert commands.main(["lrf", *words, served.port, *named]) == 0
        assert "warning: no turn came whole, " in capsys.readouterr().err and target.is_file()


@pytest.mark.parametrize(
    ("source", "stem", "name"),
    [
        ("/dev/pts/0", "pts_0", "pts/0"),
        ("/dev/ttyUSB0", "ttyUSB0", "ttyUSB0"),
        ("socket://127.0.0.1:4000", "127.0.0.1_4000", "127.0.0.1:4000"),
        ("socket://", "socket_", "socket://"),
        (ROOM, Path(ROOM).stem, Path(ROOM).name),
    ],
)
def test_a_picture_is_named_after_its_file_or_port(source: str, stem: str, name: str) -> None:
    assert lrf._called(source) == (stem, name)


def test_record_writes_what_was_sent_and_never_overwrites(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sent = recordings.load_laser("lrf/room")
    target = tmp_path / "room.bin"
    with emulator.serve(emulator.replay(sent), "socket") as served:
        assert commands.main(["lrf", "record", served.port, str(target)]) == 2
    assert target.read_bytes() == sent
    assert json.loads((tmp_path / "room.bin.json").read_text())["bytes"] == len(sent)
    told = capsys.readouterr().err
    assert "went away" in told and f"kept in {target}: {len(sent)} bytes" in told
    assert commands.main(["lrf", "record", "socket://127.0.0.1:1", str(target)]) == 2
    assert "--force" in capsys.readouterr().err
    assert target.read_bytes() == sent


def test_show_draws_the_readings_and_keeps_a_picture_that_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    figures: list[Any] = []
    save = plotting.show_figure
    monkeypatch.setattr(plotting, "show_figure", lambda name, figure: figures.append(figure) or save(name, figure))
    picture = tmp_path / "room.png"
    assert commands.main(["lrf", "show", ROOM, "--turns", "3", "--output", str(picture)]) == 0
    turns = [turn.ranges_mm for turn in laser.turns(laser.decode(recordings.load_laser("lrf/room")))[:3]]
    beams = np.ma.masked_invalid(turns)
    met, median = np.flatnonzero(beams.count(axis=0)), np.ma.median(beams, axis=0).filled(np.nan)
    assert f"{len(met)} of 360 beams" in capsys.readouterr().out
    (ax,) = figures[0].axes
    where = np.column_stack([np.radians(met), median[met]])
    # where in the file each reading belongs, by the axes' own scale: there it is green, and nowhere else
    drawn = cv2.imread(str(picture)).astype(int)
    across, up = figures[0].transFigure.inverted().transform(ax.transData.transform(where)).T
    at = np.column_stack([(1 - up) * drawn.shape[0], across * drawn.shape[1]])
    green = np.argwhere(np.abs(drawn - [0x73, 0x9E, 0x00]).max(axis=2) < 60)
    apart = np.hypot(*(at[:, None] - green).transpose(2, 0, 1))
    assert (apart.min(axis=1) < 2).mean() > 0.97 and apart.min(axis=0).max() < 5  # labels hide a few
    # the axes' scale is a sensor's: beam 0 points up, angles run counter-clockwise, twice as far is twice as far out
    places = ax.transData.transform([[0, 0], [0, 1000], [0, 2000], [np.pi / 2, 1000]])
    forward, further, left = places[1:] - places[0]
    assert forward[1] > 10 and forward[0] == pytest.approx(0, abs=1e-6)
    np.testing.assert_allclose([further, left], [2 * forward, [-forward[1], 0]], atol=1e-6)
    before = picture.read_bytes()
    assert commands.main(["lrf", "show", ROOM, "--output", str(picture)]) == 2
    assert "would be overwritten" in capsys.readouterr().err
    assert picture.read_bytes() == before


def test_folders_of_a_recording_are_made_and_left_only_with_it(tmp_path: Path) -> None:
    assert commands.main(["lrf", "record", "socket://127.0.0.1:1", str(tmp_path / "walk" / "scans" / "01.bin")]) == 2
    assert not list(tmp_path.iterdir())
    with emulator.serve(emulator.replay(recordings.load_laser("lrf/room")), "socket") as served:
        words = ["lrf", "record", served.port, str(tmp_path / "walk" / "scans" / "01.bin"), "--seconds", "0.3"]
        assert commands.main(words) == 0
    assert len(list((tmp_path / "walk" / "scans").iterdir())) == 2


def test_a_folder_is_told_as_one(tmp_path, capsys):
    assert commands.main(["lrf", "show", str(tmp_path)]) == 2
    assert f"{tmp_path}: is a folder; name a file in it" in capsys.readouterr().err
