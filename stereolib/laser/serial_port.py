"""The laser on a serial port: scans as they come, and recordings of the raw bytes.

Every failure is a `LidarError` whose text says what to do. Port names may be devices or pyserial
addresses such as ``socket://127.0.0.1:7000``.
"""

from __future__ import annotations

import errno
import hashlib
import json
import time
import warnings
from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from stereolib.base import check_target, write_atomic
from stereolib.laser.framing import PACKET_BYTES
from stereolib.laser.recordings import lost_packets, lost_share, most_is_damaged, read_recording
from stereolib.laser.scans import LaserScan, turns
from stereolib.laser.text_streams import read_text_stream
from stereolib.laser.xv11 import BAUD, PACKETS_PER_TURN, RPM_LIMITS, Decoder, Readings, decode, join_readings

_SILENCE_S = 2.0  # a turning sensor sends every 2 ms; adapters hold bytes back for some 20
_POLL_S = 0.05  # how often a port is emptied and a recording written
_CHUNK_BYTES = 4096  # what a port delivers in 0.36 s: more than it holds at a poll
_REPORT_S = 0.5  # between two reports of a recording's progress
_START_S, _LONGEST_TURN_S = 10.0, 1.0  # to wait for the first turn, and for each: a sensor needs 0.2 s
_LEAST_PARTS = 3  # turns that lack packets, which together may make a whole one
_JUDGED_PACKETS = 450  # five turns: then a line of which most is damaged is given up
_GIVE_UP_BYTES = 8000  # without one packet in so many bytes (0.8 s) it is no XV-11


class LidarError(OSError):
    """The port cannot be opened, or gives nothing of use; the text names the fix."""


def open_lidar(
    port: str, timeout_s: float = _SILENCE_S, partial: bool = False, end_s: float = np.inf
) -> Generator[LaserScan, None, None]:
    """Read scans from a sensor, one a turn; ``stamp_s`` counts from the opening of the port.

    Parameters
    ----------
    port : str
        Device name or pyserial address.
    timeout_s : float
        Longest silence, s.
    partial : bool
        Give turns with lost packets, too.
    end_s : float
        When to end, s; default: never.

    Yields
    ------
    LaserScan

    Raises
    ------
    LidarError
        If the port is missing, busy, forbidden, silent or unplugged, or sends no XV-11 packets, or most are damaged.

    Warns
    -----
    RuntimeWarning
        Whenever the motor leaves 180..349 rpm.
    """
    decoder, pending, inside, heard = Decoder(), decode(b""), True, b""
    start_s, (low, high) = time.monotonic(), RPM_LIMITS
    with closing(read_chunks(port, timeout_s)) as chunks:
        for chunk in chunks:
            pending = join_readings([pending[:], decoder.feed(chunk)])
            if time.monotonic() - start_s > end_s:
                return
            heard = (heard + chunk)[-_CHUNK_BYTES:]
            check_packets(port, decoder.totals, heard)
            _check_damage(port, decoder.totals)
            ends = np.flatnonzero(np.diff(pending.index.astype(int)) <= 0) + 1
            if not len(ends):
                continue
            turned, pending = pending[: ends[-1]], pending[ends[-1] :]
            for scan in turns(turned):
                was_inside, inside = inside, not (scan.speed_rpm < low or scan.speed_rpm > high)  # NaN is inside
                if was_inside and not inside:
                    advice = "change the motor's supply so that it makes about 300"
                    speed = f"the motor turns at {scan.speed_rpm:.0f} rpm; the sensor needs {low:.0f} to {high:.0f}"
                    warnings.warn(f"{speed}: {advice}", RuntimeWarning, stacklevel=2)
                if scan.complete or partial:
                    yield replace(scan, stamp_s=time.monotonic() - start_s - scan.scan_time_s)


def take_scans(source: str | PathLike[str], count: int = 5) -> list[LaserScan]:
    """Take the first complete turns of a recording (if there is such a file) or of a port.

    Parameters
    ----------
    source : path or str
        A file, a pipe, a device name or a pyserial address.
    count : int
        Turns wanted; a recording or a replay that ends before gives fewer, and so does a line too slow or too lossy
        to bring them in ten seconds and one more for each.

    Returns
    -------
    list of LaserScan
        At least one. From a line that brings no complete turn in that time: those with lost packets, three at least.

    Raises
    ------
    ValueError
        If the count is less than 1, the recording holds no complete turn, or as `read_recording`.
    LidarError
        As `open_lidar`, if not even one turn came, or no three with lost packets.
    """
    if count < 1:
        raise ValueError(f"count must be 1 turn or more, got {count}")
    path = Path(source)
    if path.is_file() or path.is_fifo():
        if scans := [scan for scan in turns(read_recording(path)) if scan.complete][:count]:
            return scans
        raise ValueError(f"{source} holds no complete turn, only parts; record for at least one second")
    scans, parts, end_s = list[LaserScan](), list[LaserScan](), _START_S + _LONGEST_TURN_S * count
    with closing(open_lidar(str(source), partial=True, end_s=end_s)) as live:
        try:
            for scan in live:
                (scans if scan.complete else parts).append(scan)
                if len(scans) == count:
                    break
        except LidarError:  # the end of a replay, or unplugged: what came before is good
            if not scans:
                raise
    if not scans and len(parts) < _LEAST_PARTS:
        why = "the line is too slow, or loses too many bytes"
        advice = "try a shorter cable or a direct connection; `stereolib lrf record` keeps whatever comes"
        raise LidarError(f"{source} brought no complete turn in {end_s:g} s: {why}. {advice}")
    return scans or parts


def read_chunks(port: str, timeout_s: float = _SILENCE_S) -> Generator[bytes, None, None]:
    """Open a port for this process alone, and hand on its raw bytes at least every 50 ms.

    Parameters
    ----------
    port : str
        Device name or pyserial address.
    timeout_s : float
        Longest silence, s.

    Yields
    ------
    bytes

    Raises
    ------
    LidarError
        As `open_lidar`, but for what the bytes mean.
    """
    import serial

    own = {} if "://" in port else {"exclusive": True}  # a second reader would steal bytes
    try:
        device = serial.serial_for_url(port, BAUD, timeout=_POLL_S, **own)
    except (serial.SerialException, OSError, ValueError) as error:
        raise LidarError(_why_not_open(port, error)) from error
    with device:
        last_s, heard = time.monotonic(), b""
        while True:
            try:
                chunk = device.read(_CHUNK_BYTES)
            except (serial.SerialException, OSError, TypeError) as error:  # TypeError: closed under it
                why = "the adapter was unplugged or the other end closed. What came before is kept"
                raise LidarError(f"{port} went away ({error}): {why}; plug it in and start again") from error
            if chunk:
                last_s, heard = time.monotonic(), (heard + chunk)[-_CHUNK_BYTES:]
                yield chunk
            elif time.monotonic() - last_s > timeout_s:
                wiring = "see that the sensor has power, that its TX goes to the adapter's RX"
                motor = "that its motor turns at about 300 rpm (it is silent below 180)"
                said = _said(heard) or f"{wiring}, and {motor}"
                raise LidarError(f"{port} sent nothing{' more' * bool(heard)} for {timeout_s:g} s: {said}")


def _why_not_open(port: str, error: Exception) -> str:
    number, text = getattr(error, "errno", None), str(error)
    if number in (errno.EACCES, errno.EPERM) or "PermissionError" in text:
        advice = "join the group dialout (sudo usermod -a -G dialout $USER) and log in again"
        return f"no permission to open {port}: {advice}; on Windows, close the program that holds the port"
    if number in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in text:
        return f"{port} is busy: close the other program that reads it (fuser {port} names it)"
    if "://" in port and "not known" in text:  # of addresses, pyserial opens those of lasers alone
        kinds = "a serial port (/dev/ttyUSB0, COM3) or socket://127.0.0.1:4000, where a program passes its bytes on"
        return f"{port} is no address of a laser ({port.partition(':')[0]} is none of its kinds): name {kinds}"
    if "://" in port:
        return f"cannot reach {port} ({text}): start the emulator or server first, check the number"
    if number == errno.ENOENT:
        missing = "no such file or port: check its name and folder" if Path(port).suffix else "no such port: plug it in"
        return f"{port}: {missing}. Ports found: {_ports_found()}"
    if Path(port).is_file():
        return f"{port} is a file, not a port: lrf show, info, replay and export read recordings"
    return f"{port} cannot be opened ({text}). Ports found: {_ports_found()}"


def _ports_found() -> str:
    """Serial ports of this machine, for a message."""
    from serial.tools import list_ports

    ports = [f"{port.device} ({port.description})" for port in list_ports.comports()]
    return ", ".join(ports) or "none; plug the USB adapter in and see that its driver is loaded"


def _said(heard: bytes) -> str:
    """What letters on a port mean, and the remedy; "" where there are none."""
    try:
        readings = read_text_stream(heard)
    except ValueError as error:
        return str(error)
    return "" if readings is None else "the board prints distances as text: switch it to raw bytes (ShowRaw, HideDist)"


def check_packets(port: str, totals: dict[str, int], heard: bytes) -> None:
    """Raise `LidarError` where what a port sends is no scan of one XV-11: totals of its `Decoder`, its last bytes."""
    if totals["good"] and totals["old_turns"]:
        raise LidarError(f"{port} mixes packets of two firmwares: connect one sensor at a time")
    wrong = totals["skipped_bytes"] + PACKET_BYTES * totals["bad_checksum"]
    if wrong > _GIVE_UP_BYTES and not totals["good"] + totals["old_turns"]:
        why = _said(heard) or f"another device, or a wrong baud rate (the sensor needs {BAUD} baud, 8N1, 3.3 V)"
        raise LidarError(f"{port} sends bytes but no XV-11 packet in {wrong} of them: {why}. {_ports_found()}")


def _check_damage(port: str, totals: dict[str, int]) -> None:
    intact, damaged = totals["good"] + PACKETS_PER_TURN * totals["old_turns"], totals["bad_checksum"]
    damage = most_is_damaged(intact, damaged, "try again")
    if damage and intact + damaged >= _JUDGED_PACKETS:
        raise LidarError(f"{port}: {damage}")


def record_port(
    port: str,
    path: str | PathLike[str],
    *,
    force: bool = False,
    seconds: float = np.inf,
    progress: Callable[[dict[str, Any]], None] | None = None,
) -> dict[str, Any]:
    """Write the raw bytes of a port to a file as they come, until Ctrl-C, a failure or the time.

    Each chunk is handed to the system at once: killed at any moment, the file lacks at most the
    last 100 ms. The sidecar ``FILE.json`` tells start time and port from the beginning, and how it
    ended, whether the sensor failed, the share of packets that was lost or damaged on the line, the number of bytes and
    their sha256 at the close.

    Parameters
    ----------
    port : str
        Device name or pyserial address.
    path : path
        File to write; only made once bytes arrive.
    force : bool
        Overwrite a recording that is there.
    seconds : float
        Stop after this time, s.
    progress : callable, optional
        Called twice a second with ``seconds, bytes, turns, rpm, valid_share, lost_share`` (of the time since
        the last call; None before the first packet).

    Returns
    -------
    dict
        What the sidecar says; its ``lost_share`` is None where no packet came.

    Raises
    ------
    FileExistsError
        If the file or its sidecar is there, and not `force`.
    ValueError
        If the file cannot be written.
    LidarError
        If nothing at all could be recorded. A later failure of the port ends the recording, and ``ended``
        tells it.
    OSError
        If writing fails on the way, as on a full disk. What came before is kept.
    """
    path, notes = Path(path), Path(f"{path}.json")
    for there in (path, notes):
        if there.exists() and not force:
            advice = "choose another name, or pass force (--force) to replace it"
            raise FileExistsError(f"{there} exists and is not overwritten: {advice}")
        check_target(there)
    with closing(read_chunks(port)) as chunks:
        chunk = next(chunks)
        digest, live = hashlib.sha256(), _Live(progress)
        about: dict[str, Any] = {"start": datetime.now(UTC).isoformat(), "port": port, "baud": BAUD}
        about |= dict.fromkeys(("bytes", "sha256", "ended", "failed", "lost_share"))
        with open(path, "wb" if force else "xb", buffering=0) as file:  # grows as the bytes come: no write_atomic
            write_atomic(notes, json.dumps(about, indent=2) + "\n")
            about |= {"ended": "by an error in writing or showing it", "failed": True}
            try:
                while True:
                    file.write(chunk)
                    digest.update(chunk)
                    if live.update(chunk) >= seconds:
                        break
                    chunk = next(chunks)
                about |= {"ended": f"after {seconds:g} s", "failed": False}
            except KeyboardInterrupt:
                about |= {"ended": "stopped by the user", "failed": False}
            except LidarError as error:
                about["ended"] = str(error)
            finally:
                about |= {
                    "bytes": live.bytes,
                    "sha256": digest.hexdigest(),
                    "lost_share": lost_share(live.lost, live.packets),
                }
                write_atomic(notes, json.dumps(about, indent=2) + "\n")
    return about


class _Live:
    """Counts what a recording gets, and reports it twice a second."""

    def __init__(self, progress: Callable[[dict[str, Any]], None] | None) -> None:
        self.progress, self.decoder, self.recent, self.last_index = progress, Decoder(), list[Readings](), -1
        self.bytes, self.packets, self.lost, self.start_s = 0, 0, 0, time.monotonic()
        self.reported_s, self.lost_before = self.start_s, 0

    def update(self, chunk: bytes) -> float:
        """Count a chunk; returns the time since the first one, s."""
        now_s, new = time.monotonic(), self.decoder.feed(chunk)
        self.bytes += len(chunk)
        self.packets += len(new)
        self.lost += lost_packets(new, self.last_index)
        self.last_index = int(new.index[-1]) if len(new) else self.last_index
        if self.progress is not None:
            self.recent.append(new)
            if now_s - self.reported_s >= _REPORT_S:
                self.progress({"seconds": now_s - self.start_s, "bytes": self.bytes} | self._report())
                self.recent, self.reported_s, self.lost_before = [], now_s, self.lost
        return now_s - self.start_s

    def _report(self) -> dict[str, Any]:
        new = join_readings(self.recent)
        rpm = float(np.median(new.speed_rpm)) if len(new) else None
        valid_share = float(np.isfinite(new.distance_mm).mean()) if len(new) else None
        lost, turned = lost_share(self.lost - self.lost_before, len(new)), self.packets // PACKETS_PER_TURN
        return {"turns": turned, "rpm": rpm, "valid_share": valid_share, "lost_share": lost}
