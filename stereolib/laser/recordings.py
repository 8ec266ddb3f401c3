"""Recordings of the laser: raw bytes in a file, read, checked and described."""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np

from stereolib.base import read_bytes
from stereolib.laser.framing import PACKET_BYTES
from stereolib.laser.scans import check_firmware, turns
from stereolib.laser.text_streams import read_text_stream
from stereolib.laser.xv11 import PACKETS_PER_TURN, Readings, decode

_LEAST_SHARE = 0.05  # of a file's bytes in intact packets; by chance it is 1e-5, spoilt recordings keep far more


def read_recording(path: str | PathLike[str]) -> Readings:
    """Read a recording, or what a pipe delivers until it is closed.

    Parameters
    ----------
    path : path

    Returns
    -------
    Readings

    Raises
    ------
    ValueError
        If there is no such file, or it is empty, is no recording, most of it is damaged, or it mixes both firmwares.

    Examples
    --------
    >>> read_recording("no/such/room.bin")
    Traceback (most recent call last):
    ...
    ValueError: no/such/room.bin: no such file; there is no folder no/such
    """
    return decode_recording(read_bytes(path), str(path))


def decode_recording(data: bytes, source: str) -> Readings:
    """Decode the bytes of a recording, or the lines of one that came as text, and refuse what is none.

    Parameters
    ----------
    data : bytes
    source : str
        What the messages call it.

    Returns
    -------
    Readings

    Raises
    ------
    ValueError
        If there are no bytes, hardly any packet or less than half of them is intact, both firmwares are mixed, or the
        sensor only greets.

    Examples
    --------
    >>> decode_recording(bytes(1000), "zeros.bin")
    Traceback (most recent call last):
    ...
    ValueError: zeros.bin (1000 bytes) is no XV-11 recording: intact packets hold only 0 of its bytes. It is another \
file, or was recorded at a wrong baud rate (not 115200)
    """
    readings = _decoded(data, source)
    if damage := most_is_damaged(len(readings), readings.bad_checksum):
        raise ValueError(f"{source}: {damage}")
    return readings


def _decoded(data: bytes, source: str) -> Readings:
    """Decode a recording, however damaged, and refuse what is none."""
    if not data:
        raise ValueError(f"{source} is empty: check the sensor's power and wiring, that its motor turns; record again")
    readings = decode(data)
    if not len(readings):
        try:
            readings = read_text_stream(data) or readings
        except ValueError as error:
            raise ValueError(f"{source}: {error}") from None
        if len(readings):
            return readings
    within = len(data) - readings.skipped_bytes - PACKET_BYTES * readings.bad_checksum
    if within < _LEAST_SHARE * len(data):
        why = f"intact packets hold only {within} of its bytes"
        advice = "It is another file, or was recorded at a wrong baud rate (not 115200)"
        raise ValueError(f"{source} ({len(data)} bytes) is no XV-11 recording: {why}. {advice}")
    check_firmware(readings, source)
    return readings


def most_is_damaged(intact: int, bad_checksum: int, then: str = "record again") -> str:
    """Why a stream of so many packets is not to be used, with the remedy; "" where half of them are intact."""
    if bad_checksum <= intact:
        return ""
    return f"{bad_checksum} of {bad_checksum + intact} packets are damaged: see to cable, plug and port, and {then}"


def lost_packets(readings: Readings, before: int = -1) -> int:
    """Packets that are missing between those of some readings, and the one of index `before`, by their indices."""
    index = readings.index.astype(int)
    return int(((np.diff(index if before < 0 else np.append(before, index)) - 1) % PACKETS_PER_TURN).sum())


def lost_share(lost: int, arrived: int) -> float | None:
    """Share of the packets that were lost; None where none arrived."""
    return lost / (lost + arrived) if arrived else None


def recording_info(path: str | PathLike[str]) -> dict[str, Any]:
    """Tell what a recording holds, as plain numbers (ready for JSON).

    Parameters
    ----------
    path : path

    Returns
    -------
    dict
        ``firmware, packets, bad_checksums, skipped_bytes, index_jumps, turns`` (complete ones),
        ``partial_turns, rpm_min, rpm_median, rpm_max`` (None if unknown), ``invalid_share`` (0..1 of the readings that
        arrived), ``lost_share`` (0..1 of the packets, by the gaps between their indices), ``damage`` (why nothing will
        use the recording; empty where half of its packets are intact).

    Raises
    ------
    ValueError
        As `read_recording`, but for damage, which it tells.
    """
    readings = _decoded(read_bytes(path), str(path))
    complete = [scan.complete for scan in turns(readings)]
    rpm = readings.speed_rpm[np.isfinite(readings.speed_rpm)]
    speeds = np.percentile(rpm, (0, 50, 100)).tolist() if rpm.size else [None] * 3
    return {
        "firmware": "1446-byte turns" if readings.old_turns else "22-byte packets",
        "packets": len(readings),
        "bad_checksums": readings.bad_checksum,
        "skipped_bytes": readings.skipped_bytes,
        "index_jumps": readings.index_jumps,
        "turns": sum(complete),
        "partial_turns": len(complete) - sum(complete),
        **dict(zip(("rpm_min", "rpm_median", "rpm_max"), speeds, strict=True)),
        "invalid_share": float(np.isnan(readings.distance_mm).mean()) if len(readings) else None,
        "lost_share": lost_share(lost_packets(readings), len(readings)),
        "damage": most_is_damaged(len(readings), readings.bad_checksum),
    }
