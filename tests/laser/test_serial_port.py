"""Ports, recordings, replay and the emulator, through real pseudo-terminals, sockets and processes."""

import errno
import hashlib
import json
import os
import signal
import subprocess
import sys
import time
import warnings
from contextlib import closing, suppress
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from support.old_firmware import encode_turns

from stereolib import laser
from stereolib.laser import serial_port
from stereolib.virtual import emulator

LINKS = ["pty", "socket"] if hasattr(os, "openpty") else ["socket"]
needs_pty = pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo-terminals here")


def turning(turns, speed_rpm=300.0):
    """Bytes of some turns; the beam at b degrees of turn t measures 1000 + 360 t + b mm."""
    n = 90 * turns
    distance = 1000.0 + np.arange(4 * n).reshape(n, 4) % 14400
    return laser.encode(laser.Readings.build(np.arange(n) % 90, distance, 100, speed_rpm=speed_rpm))


@pytest.mark.parametrize("link", LINKS)
def test_scans_come_through_a_port_at_the_true_rate(link):
    with emulator.serve(emulator.replay(turning(8)), link) as served:
        start = time.monotonic()
        scans = list(islice(laser.open_lidar(served.port), 5))
        took = time.monotonic() - start
    first = int(scans[0].ranges_mm[0] - 1000) // 360
    for k, scan in enumerate(scans):
        assert scan.complete
        np.testing.assert_array_equal(scan.ranges_mm, 1000 + 360 * (first + k) + np.arange(360))
    assert took > 0.9  # five turns at 300 rpm take a second
    assert np.diff([s.stamp_s for s in scans]).mean() == pytest.approx(0.2, abs=0.06)


@pytest.mark.parametrize("link", LINKS)
def test_what_stops_the_player_is_passed_on(link):
    def schedule():
        yield from islice(emulator.replay(turning(1)), 45)
        raise ValueError("the scene is gone")

    gone = pytest.raises(ValueError, match="the scene is gone")
    with gone, emulator.serve(schedule(), link) as served, suppress(laser.LidarError):  # so is its port
        for _ in serial_port.read_chunks(served.port):
            pass


def test_schedule_of_a_recording():
    data = b"boot" + turning(2) + turning(1, speed_rpm=200.0) + b"text"
    schedule = list(emulator.replay(data))
    assert b"".join(chunk for _, chunk in schedule) == data
    due = np.array([d for d, _ in schedule[1:]])
    np.testing.assert_allclose(np.diff(due)[:179], 60 / 300 / 90)
    np.testing.assert_allclose(np.diff(due)[180:269], 60 / 200 / 90)
    noise = bytes(5000)
    assert list(emulator.replay(noise)) == [(0.0, noise)]


def test_faults_leave_every_intact_packet_and_count_the_rest():
    rng = np.random.default_rng(0)
    schedule = list(emulator.replay(turning(50)))
    faults = emulator.Faults(bit_error_rate=1e-3, lost_byte_rate=1e-3)
    spoilt = list(emulator.with_faults(iter(schedule), faults, rng))
    intact = sum(a == b for a, b in zip(schedule, spoilt, strict=True))
    r = laser.decode(b"".join(chunk for _, chunk in spoilt))
    # 176 bits and 22 bytes a packet: exp(-0.198) stay whole
    assert intact == pytest.approx(4500 * np.exp(-0.198), rel=0.05)
    assert intact <= r.good <= intact + 1
    flips = emulator.Faults(bit_error_rate=0.25)
    (_, only_flips), *_ = emulator.with_faults(iter([(0.0, bytes(10**5))]), flips, rng)
    assert np.unpackbits(np.frombuffer(only_flips, np.uint8)).mean() == pytest.approx(0.25, abs=0.01)


def test_stalls_spin_down_and_disconnect():
    schedule = list(emulator.replay(turning(20)))
    rng = np.random.default_rng(0)

    def faulty(**kwargs):
        return list(emulator.with_faults(iter(schedule), emulator.Faults(**kwargs), rng))

    cut = faulty(disconnect_after_s=1.0)
    assert len(cut) == 450 and cut == schedule[:450]
    stalled = np.array([due for due, _ in faulty(stall_every_s=1.0, stall_s=0.25)])
    assert np.diff(stalled).max() == pytest.approx(0.25, abs=0.005)
    assert len(stalled) == pytest.approx(0.75 * 1800, abs=5)
    slow = faulty(spin_down_after_s=1.0)
    rpm = laser.decode(b"".join(chunk for _, chunk in slow)).speed_rpm
    assert (rpm[:450] == 300).all() and (np.diff(rpm[450:]) < 0).all()
    assert 180 <= rpm[-1] < 182  # silent below
    assert np.diff([due for due, _ in slow])[len(rpm) - 2] > 1.5 * 60 / 300 / 90
    with pytest.raises(ValueError, match="bit_error_rate must be 0 to 1, got 2"):
        emulator.Faults(bit_error_rate=2)
    with pytest.raises(ValueError, match="stall_s must be 0 or more"):
        emulator.Faults(stall_s=-1)


@pytest.mark.parametrize("link", LINKS)
def test_unplugged(link):
    with (
        emulator.serve(emulator.replay(turning(3)), link) as served,
        pytest.raises(laser.LidarError, match=r"went away .*unplugged.*plug it in"),
    ):
        list(laser.open_lidar(served.port))


@pytest.mark.parametrize("link", LINKS)
def test_silence(link):
    silence = ((due, b"") for due in np.arange(0, 10, 0.1))
    with (
        emulator.serve(silence, link) as served,
        pytest.raises(laser.LidarError, match=r"sent nothing for 0\.3 s.*power.*300 rpm"),
    ):
        next(laser.open_lidar(served.port, timeout_s=0.3))


def test_wrong_baud_or_device():
    noise = np.random.default_rng(0).bytes(20000)
    schedule = ((k / 100, noise[200 * k : 200 * k + 200]) for k in range(100))
    with (
        emulator.serve(schedule) as served,
        pytest.raises(laser.LidarError, match=r"no XV-11 packet.*115200 baud"),
    ):
        next(laser.open_lidar(served.port))


def test_two_firmwares_on_one_port():
    old = encode_turns(laser.decode(turning(1)))
    schedule = emulator.replay(turning(1) + old + turning(2))
    with (
        emulator.serve(schedule) as served,
        pytest.raises(laser.LidarError, match="two firmwares"),
    ):
        list(laser.open_lidar(served.port))


def test_motor_out_of_range_is_warned_of_once():
    with emulator.serve(emulator.replay(turning(5, speed_rpm=380.0))) as served:
        scans = laser.open_lidar(served.port)
        with pytest.warns(RuntimeWarning, match=r"380 rpm.*180 to 349") as caught:
            list(islice(scans, 3))
    assert len(caught) == 1


def test_partial_turns_on_demand():
    packets = [chunk for _, chunk in emulator.replay(turning(6))]
    del packets[200:210]
    schedule = [(k * 0.002, chunk) for k, chunk in enumerate(packets)]
    with emulator.serve(schedule) as served:
        scans = list(islice(laser.open_lidar(served.port, partial=True), 4))
    assert sorted({s.complete for s in scans}) == [False, True]


def test_missing_port_lists_those_found(monkeypatch):
    from types import SimpleNamespace

    from serial.tools import list_ports

    port = SimpleNamespace(device="/dev/ttyACM3", description="XV-11 controller")
    monkeypatch.setattr(list_ports, "comports", lambda: [port])
    with pytest.raises(laser.LidarError, match=r"Ports found: /dev/ttyACM3 \(XV-11"):
        next(laser.read_chunks("/dev/no_such_port"))
    monkeypatch.setattr(list_ports, "comports", lambda: [])
    with pytest.raises(laser.LidarError, match="none; plug the USB adapter in"):
        next(laser.read_chunks("/dev/no_such_port"))
    with pytest.raises(laser.LidarError, match="start the emulator"):
        next(laser.read_chunks("socket://127.0.0.1:1"))


def test_forbidden_port_names_the_group(monkeypatch):
    import serial

    def refuse(*_, **__):
        raise serial.SerialException(errno.EACCES, "could not open port /dev/ttyUSB0")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(laser.LidarError, match="group dialout"):
        next(laser.read_chunks("/dev/ttyUSB0"))


@needs_pty
def test_busy_port():
    with (
        emulator.serve(emulator.replay(turning(20)), "pty") as served,
        closing(laser.read_chunks(served.port)) as first,
        pytest.raises(laser.LidarError, match="busy: close the other program"),
    ):
        assert next(first)
        next(laser.read_chunks(served.port))


@pytest.mark.parametrize("link", LINKS)
def test_recording_holds_the_bytes_and_the_sidecar_its_story(tmp_path, link):
    data, path, seen = turning(8), tmp_path / "a.bin", []
    with emulator.serve(emulator.replay(data), link) as served:
        about = laser.record_port(served.port, path, progress=seen.append)
    assert path.read_bytes() == data
    notes = json.loads(Path(f"{path}.json").read_text())
    assert notes == about
    assert notes["sha256"] == hashlib.sha256(data).hexdigest() and notes["bytes"] == len(data)
    assert notes["port"] == served.port and "went away" in notes["ended"] and notes["failed"]
    assert abs(time.time() - np.datetime64(notes["start"][:-6], "ms").astype(int) / 1000) < 60
    assert len(seen) >= 2
    assert seen[-1]["rpm"] == 300 and seen[-1]["valid_share"] == 1 and seen[-1]["turns"] >= 4
    assert laser.recording_info(path)["turns"] == 8
    assert [s.complete for s in laser.take_scans(path, 3)] == [True] * 3


def test_a_recording_that_fails_here_is_told_as_failed(tmp_path, monkeypatch):
    def full(_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(serial_port, "read_chunks", lambda _: (b"\xfa" * 22 for _ in range(3)))
    monkeypatch.setattr(serial_port, "_REPORT_S", 0.0)
    with pytest.raises(OSError, match="No space left on device"):
        laser.record_port("port", tmp_path / "a.bin", progress=full)
    notes = json.loads((tmp_path / "a.bin.json").read_text())
    assert (notes["failed"], notes["bytes"]) == (True, 22) and not notes["ended"].startswith("after")


def test_recordings_are_never_overwritten_unasked(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(b"precious")
    with pytest.raises(FileExistsError, match=r"not overwritten.*--force"):
        laser.record_port("/dev/no_such_port", path)
    with pytest.raises(laser.LidarError):  # even with force: nothing came, nothing is lost
        laser.record_port("/dev/no_such_port", path, force=True)
    assert path.read_bytes() == b"precious"
    with emulator.serve(emulator.replay(turning(5))) as served:
        about = laser.record_port(served.port, path, force=True, seconds=0.3)
    assert about["ended"] == "after 0.3 s" and not about["failed"] and path.read_bytes() == turning(5)[: about["bytes"]]
    assert about["bytes"] >= 22  # a packet at least
    other = tmp_path / "b.bin"
    Path(f"{other}.json").write_text("{}")
    with pytest.raises(FileExistsError, match=r"b\.bin\.json exists"):
        laser.record_port("/dev/no_such_port", other)


@needs_pty
def test_sigkill_loses_nothing_that_the_port_delivered(tmp_path):
    """Killed while the port is slow: the eight turns before are in the file, though nothing closed it."""
    path, data, before = tmp_path / "killed.bin", turning(10), len(turning(8))
    packets = list(emulator.replay(data))
    slow = [(2.0 + k / 2, packet) for k, (_, packet) in enumerate(packets[720:])]  # goes on for a minute and a half
    code = "import sys; from stereolib.laser import record_port; record_port(sys.argv[1], sys.argv[2])"
    with emulator.serve(packets[:720] + slow, "pty") as served:
        recorder = subprocess.Popen([sys.executable, "-c", code, served.port, str(path)])
        while not path.exists() or path.stat().st_size < before:
            assert recorder.poll() is None
            time.sleep(0.01)
        recorder.send_signal(signal.SIGKILL)
        recorder.wait()
        kept = path.read_bytes()
    assert data.startswith(kept) and before <= len(kept) < len(data)
    assert len(laser.decode(kept)) >= 720
    notes = json.loads(Path(f"{path}.json").read_text())
    assert notes["port"] == served.port and notes["sha256"] is None


def test_emulator_shows_the_virtual_rig():
    from stereolib import virtual
    from stereolib.virtual import VirtualLidar

    world, pose = virtual.cube_scene(700.0), (0.0, 0.0, 0.0)
    schedule = list(emulator.emulate(world, pose, rng=np.random.default_rng(0), seconds=5.9))
    due = np.array([d for d, _ in schedule])
    assert due[-1] < 5.9 and np.diff(due).max() < 0.003 and np.diff(due).min() > 0.002
    scans = [s for s in laser.turns(laser.decode(b"".join(c for _, c in schedule), "raise"))]
    assert [s.complete for s in scans[:29]] == [True] * 29
    truth = VirtualLidar().truth_mm(world, pose)
    assert np.nanmedian(np.abs(laser.average(scans).ranges_mm - truth)) < 3


def test_take_needs_a_whole_turn(tmp_path):
    path = tmp_path / "short.bin"
    path.write_bytes(turning(1)[:-22])
    with pytest.raises(ValueError, match="no complete turn, only parts"):
        laser.take_scans(path)


@pytest.mark.parametrize("count", [0, -1])
def test_take_needs_a_count(count, tmp_path):
    path = tmp_path / "long.bin"
    path.write_bytes(turning(3))
    for source in (path, "socket://127.0.0.1:9"):
        with pytest.raises(ValueError, match=f"count must be 1 turn or more, got {count}"):
            laser.take_scans(source, count)


def lossy(turns, lost_every):
    """A schedule of turns in which every so many-th packet is missing."""
    packets = list(emulator.replay(turning(turns)))
    return [entry for k, entry in enumerate(packets) if k % lost_every]


def test_a_lossy_line_gives_what_came(monkeypatch):
    monkeypatch.setattr(serial_port, "_START_S", 1.0)
    with emulator.serve(lossy(20, 50)) as served:  # in each turn another packet or two
        scans = laser.take_scans(served.port, 1)
    assert len(scans) >= 3 and not any(scan.complete for scan in scans)
    assert (laser.average(scans, complete_only=False).count > 0).mean() > 0.95


def test_a_line_of_which_most_is_damaged_is_refused_as_its_recording_is():
    """Of three packets in five the checksum is wrong: after five turns it is given up, with the remedy."""
    damaged = bytearray(turning(8))
    for packet in range(len(damaged) // 22):
        damaged[22 * packet + 10] ^= packet % 5 < 3
    with emulator.serve(emulator.replay(turning(8))) as served:
        assert len(laser.take_scans(served.port, 2)) == 2
    packets = [bytes(damaged[at : at + 22]) for at in range(0, len(damaged), 22)]
    schedule = [(0.001 * k, packet) for k, packet in enumerate(packets)]
    with (
        emulator.serve(schedule) as served,
        pytest.raises(laser.LidarError, match=r"packets are damaged: .* try again"),
    ):
        laser.take_scans(served.port, 2)


def test_a_line_too_slow_for_a_turn_ends(monkeypatch):
    monkeypatch.setattr(serial_port, "_START_S", 0.5)
    monkeypatch.setattr(serial_port, "_LONGEST_TURN_S", 0.1)
    drops = [(0.1 * k, bytes(1)) for k in range(100)]
    with emulator.serve(drops) as served, pytest.raises(laser.LidarError, match=r"no complete turn in 0\.7 s"):
        laser.take_scans(served.port, 2)


def test_links():
    with pytest.raises(ValueError, match='"auto", "pty" or "socket"'), emulator.serve([], "usb"):
        pass
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with emulator.serve([(0.0, b"x")]) as served:  # never opened by anyone: closes all the same
            assert not served.wait(0.05)
