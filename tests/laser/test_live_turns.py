"""The laser as it turns: every turn once, what is lost counted, what a port sends instead refused."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib.laser import LidarError, LiveTurn, decode, encode, turns, watch_turns
from stereolib.virtual import emulator, recordings


def watched(data: bytes) -> list[LiveTurn]:
    """All turns of a recording that is played once."""
    seen = []
    with emulator.serve(emulator.replay(data), "socket") as served, pytest.raises(LidarError, match="went away"):
        for turn in watch_turns(served.port):
            seen.append(turn)
    return seen


def test_the_turns_are_those_of_the_recording() -> None:
    data = recordings.load_laser("lrf/room")
    seen, known = watched(data), turns(decode(data))
    assert [turn.turns for turn in seen] == list(range(1, len(seen) + 1))
    for turn, scan in zip(seen, known[1:-1], strict=True):  # the last one could go on
        np.testing.assert_array_equal(turn.scan.ranges_mm, scan.ranges_mm)
        assert turn.scan.speed_rpm == scan.speed_rpm
    assert seen[-1].packets_lost == 0 == seen[-1].lost_share
    assert np.isnan(seen[0].rate_hz) or seen[0].rate_hz > 0


def test_lost_and_damaged_packets_are_counted() -> None:
    readings = decode(recordings.load_laser("lrf/room"))
    turn = np.cumsum(np.append(0, np.diff(readings.index.astype(int)) < 0))
    first, others = (turn == 0).sum(), np.flatnonzero((turn == 1) & (readings.index % 9 == 4))
    packets = [encode(readings[k : k + 1]) for k in range(len(readings))]
    for k in others[:3]:
        packets[k] = b""
    damaged = first + 60
    packets[damaged] = packets[damaged][:-1] + bytes([packets[damaged][-1] ^ 1])
    seen = watched(b"".join(packets))
    assert (seen[0].packets_lost, seen[-1].packets_lost, seen[-1].bad_checksums) == (4, 4, 1)
    assert seen[0].lost_share == pytest.approx(4 / 90)
    assert not seen[0].scan.complete and seen[1].scan.complete


def test_a_port_that_is_no_laser_is_refused() -> None:
    noise = np.random.default_rng(0).integers(0, 256, 12_000).astype(np.uint8).tobytes()
    chunks = ((0.0, noise[k : k + 500]) for k in range(0, len(noise), 500))
    with emulator.serve(chunks, "socket") as served, pytest.raises(LidarError, match="no XV-11 packet"):
        next(watch_turns(served.port))
