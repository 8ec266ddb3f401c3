"""The Neato XV-11 laser protocol, without any I/O: bytes in, readings out, and back.

Two framings are understood. Firmware 2.4 and later sends 22-byte packets, 90 a turn::

    FA | index A0..F9 | rpm * 64 | 4 x [distance and flags | strength] | checksum

Older firmware sends whole turns of 1446 bytes without any checksum: ``5A A5 00 C0 xx D1``
followed by 360 of the same 4-byte readings. All words are u16, little-endian. Of a reading's first
word bits 0-13 are the distance in mm, bit 14 warns of a weak signal and bit 15 says that the
distance is invalid; then the low byte is an error code.

`decode` takes a whole recording, `Decoder` a live stream in chunks of any size. Both run the same
code and give the same readings:

1. a packet with a good checksum counts, wherever it stands;
2. a 1446-byte turn counts if neither a second header nor such a packet overlaps it (the bytes of
   a real turn cannot look like a packet's head);
3. a packet head with a wrong checksum is a bad packet, unless what counts overlaps it;
4. all other bytes are skipped.

So every packet that is intact in the stream is found. One in about 2^15 damaged ones is, too: the
checksum cannot do better. ``22 (good + bad) + 1446 turns + skipped`` is the number of bytes, but for
the few that such a chance packet shares with a real one.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stereolib.laser._framing import (
    BLOCK,
    PACKET_BYTES,
    TURN_BYTES,
    TURN_HEAD,
    Framer,
    PacketError,
    checksums,
    words_at,
)

__all__ = ["Decoder", "PacketError", "Readings", "checksum", "concatenate", "decode", "encode"]

PACKETS_PER_TURN, READINGS_PER_PACKET = 90, 4
MAX_DISTANCE_MM, MAX_RPM = 0x3FFF, 0xFFFF / 64
ERROR_NO_SIGNAL = 0x35  # the commonest code of the older firmware; used when none is given
Errors = Literal["skip", "raise"]


@dataclass(frozen=True, eq=False)
class Readings:
    """Decoded packets as a struct of read-only arrays, and what was met on the way.

    Attributes
    ----------
    index : (n,) uint8
        Packet index 0..89; its four readings look along ``4 index + 0..3`` degrees.
    speed_rpm : (n,) float64
        Motor speed, rpm; NaN for the older firmware, whose speed byte has no known scale.
    distance_mm : (n, 4) float64
        Distance, mm; NaN where the sensor flags it invalid.
    strength : (n, 4) uint16
        Signal strength, counts.
    error_code : (n, 4) uint8
        Error code where the distance is invalid, else 0.
    warning : (n, 4) bool
        The signal is weaker than the sensor expects at that distance.
    offset : (n,) int64
        Position of the packet in the stream, bytes.
    good, bad_checksum, skipped_bytes, index_jumps, old_turns : int
        Good packets; packets with a wrong checksum; bytes in no packet; packets that do not carry
        on from the index before; 1446-byte turns (each adds 90 rows, not counted in `good`).
    """

    index: NDArray[np.uint8]
    speed_rpm: NDArray[np.float64]
    distance_mm: NDArray[np.float64]
    strength: NDArray[np.uint16]
    error_code: NDArray[np.uint8]
    warning: NDArray[np.bool_]
    offset: NDArray[np.int64]
    good: int = 0
    bad_checksum: int = 0
    skipped_bytes: int = 0
    index_jumps: int = 0
    old_turns: int = 0

    def __post_init__(self) -> None:
        for name in _ARRAYS:
            getattr(self, name).setflags(write=False)

    def __len__(self) -> int:
        return len(self.index)

    def __getitem__(self, rows: slice) -> Readings:
        """Some of the packets; the counters, which belong to the whole stream, become 0."""
        return Readings(*(getattr(self, name)[rows] for name in _ARRAYS))

    @classmethod
    def build(
        cls,
        index: ArrayLike,
        distance_mm: ArrayLike,
        strength: ArrayLike = 0,
        *,
        speed_rpm: ArrayLike = 300.0,
        error_code: ArrayLike = ERROR_NO_SIGNAL,
        warning: ArrayLike = False,
    ) -> Readings:
        """Readings made by hand, broadcast to the shape of `distance_mm` (n, 4); NaN is invalid."""
        distance = np.array(distance_mm, np.float64).reshape(-1, READINGS_PER_PACKET)
        n, shape = len(distance), distance.shape
        code = np.where(np.isnan(distance), np.broadcast_to(error_code, shape), 0)
        _check_range("index", index, PACKETS_PER_TURN - 1)
        _check_range("distance_mm", distance, MAX_DISTANCE_MM)
        _check_range("speed_rpm", speed_rpm, MAX_RPM)
        _check_range("strength", strength, 0xFFFF)
        _check_range("error_code", code, 0xFF)
        return cls(
            np.broadcast_to(index, n).astype(np.uint8),
            np.broadcast_to(speed_rpm, n).astype(np.float64),
            distance,
            np.broadcast_to(strength, shape).astype(np.uint16),
            code.astype(np.uint8),
            np.broadcast_to(warning, shape).astype(bool),
            np.arange(n, dtype=np.int64) * PACKET_BYTES,
            good=n,
        )


_ARRAYS = tuple(f.name for f in fields(Readings))[:7]
_COUNTERS = tuple(f.name for f in fields(Readings))[7:]


def checksum(body: bytes) -> int:
    """Checksum of a packet's first 20 bytes: ``c = 2 c + w`` over its ten words, folded to 15 bits.

    >>> hex(checksum(bytes.fromhex("fab1e349e400e105e2003406e0002506df008406")))
    '0x6bf6'
    """
    if len(body) != PACKET_BYTES - 2:
        raise ValueError(f"the checksum is over 20 bytes, got {len(body)}; pass packet[:20]")
    return int(checksums(np.frombuffer(body, "<u2")[None])[0])


def decode(data: bytes, errors: Errors = "skip") -> Readings:
    """Decode a whole recording; see the module's text for the rules.

    Parameters
    ----------
    data : bytes
        Raw serial bytes; may start and end in the middle of a packet.
    errors : {"skip", "raise"}
        Step over damage and count it, or raise at the first byte in no intact packet.

    Raises
    ------
    PacketError
        With ``errors="raise"``; a ValueError that carries the offset and the bytes.
    """
    return Decoder(errors)._run(bytes(data), final=True)


class Decoder:
    """Incremental decoder: `feed` chunks of any size, then `close`.

    Each call returns the readings settled by then, with counters for that call alone; `totals` adds
    them up. Within a row of good packets each comes out as soon as its last byte is in.
    """

    def __init__(self, errors: Errors = "skip") -> None:
        if errors not in ("skip", "raise"):
            raise ValueError(f'errors must be "skip" or "raise", got {errors!r}')
        self._framer = Framer(strict=errors == "raise")
        self._last_index = -1
        self.totals = dict.fromkeys(_COUNTERS, 0)

    def feed(self, chunk: bytes) -> Readings:
        """Readings settled by these bytes."""
        return self._run(bytes(chunk), final=False)

    def close(self) -> Readings:
        """Readings of what was held back; the stream ends here."""
        return self._run(b"", final=True)

    def _run(self, chunk: bytes, final: bool) -> Readings:
        packets, turns, bad, skipped = self._framer.take(chunk, final)
        out = _EMPTY
        if len(packets) or turns or bad or skipped:
            out = _readings(self._framer, packets, turns, self._last_index, bad, skipped)
        self._framer.forget()
        if len(out):
            self._last_index = int(out.index[-1])
        for name in _COUNTERS:
            self.totals[name] += getattr(out, name)
        return out


def _readings(
    framer: Framer,
    packets: NDArray[np.int64],
    turns: list[int],
    last_index: int,
    bad: int,
    skipped: int,
) -> Readings:
    data, n = np.frombuffer(framer.raw, np.uint8), len(packets)
    shape = (n + PACKETS_PER_TURN * len(turns), READINGS_PER_PACKET)
    offset = np.empty(shape[0], np.int64)
    index, speed_rpm = np.empty(shape[0], np.uint8), np.empty(shape[0])
    low, strength = np.empty(shape, np.uint16), np.empty(shape, np.uint16)
    distance_mm, code, warning = np.empty(shape), np.empty(shape, np.uint8), np.empty(shape, bool)

    offset[:n] = packets
    for part in range(0, n, BLOCK):
        rows = slice(part, min(part + BLOCK, n))
        words = words_at(data, packets[rows])
        index[rows] = (words[:, 0] >> 8) - 0xA0
        np.divide(words[:, 1], 64, out=speed_rpm[rows])
        low[rows], strength[rows] = words[:, 2:10:2], words[:, 3:10:2]
    for k, turn in enumerate(turns):
        rows = slice(n + k * PACKETS_PER_TURN, n + (k + 1) * PACKETS_PER_TURN)
        words = data[turn + 6 : turn + TURN_BYTES].view("<u2").reshape(PACKETS_PER_TURN, 8)
        offset[rows] = turn + 6 + 16 * np.arange(PACKETS_PER_TURN)
        index[rows], speed_rpm[rows] = np.arange(PACKETS_PER_TURN), np.nan
        low[rows], strength[rows] = words[:, 0::2], words[:, 1::2]
    for part in range(0, shape[0], BLOCK):
        rows = slice(part, part + BLOCK)
        word, invalid = low[rows], low[rows] >= 0x8000
        np.bitwise_and(word, MAX_DISTANCE_MM, out=distance_mm[rows], casting="unsafe")
        distance_mm[rows][invalid] = np.nan
        code[rows] = np.where(invalid, word & 0xFF, 0)
        np.not_equal(word & 0x4000, 0, out=warning[rows])

    arrays = (index, speed_rpm, distance_mm, strength, code, warning, offset + framer.base)
    if turns:
        order = np.argsort(offset, kind="stable")
        arrays = tuple(a[order] for a in arrays)  # type: ignore[assignment]
    before = np.append(last_index, arrays[0][:-1].astype(int)) if shape[0] else np.empty(0, int)
    jumps = np.count_nonzero((before >= 0) & ((before + 1) % PACKETS_PER_TURN != arrays[0]))
    return Readings(*arrays, n, bad, skipped, int(jumps), len(turns))


def concatenate(parts: Iterable[Readings]) -> Readings:
    """Join successive readings (of one decoder, say); counters are added up."""
    parts = list(parts)
    full = [p for p in parts if len(p)] or [_EMPTY]
    values = {name: sum(getattr(p, name) for p in parts) for name in _COUNTERS}
    for name in _ARRAYS:
        arrays = [getattr(p, name) for p in full]
        values[name] = np.concatenate(arrays) if len(arrays) > 1 else arrays[0]
    return Readings(**values)


def encode(readings: Readings, firmware: Literal["packets", "turns"] = "packets", speed_byte: int = 0x9E) -> bytes:
    """Bytes the sensor would send for these readings; `decode` gives the same readings back.

    Parameters
    ----------
    readings : Readings
        From `decode` or `Readings.build`; distances are rounded to whole mm.
    firmware : {"packets", "turns"}
        22-byte packets, or the older 1446-byte turns (then n must be a multiple of 90, in order).
    speed_byte : int
        The byte ``xx`` of an older turn.
    """
    invalid = np.isnan(readings.distance_mm)
    low = np.where(
        invalid,
        0x8000 | readings.error_code.astype(np.uint16),
        np.nan_to_num(np.rint(readings.distance_mm)).astype(np.uint16),
    )
    low |= readings.warning.astype(np.uint16) << 14
    words = np.empty((len(readings), 11), "<u2")
    words[:, 0] = 0xFA | (readings.index.astype(np.uint16) + 0xA0) << 8
    words[:, 1] = np.rint(np.nan_to_num(readings.speed_rpm) * 64)
    words[:, 2:10:2], words[:, 3:10:2] = low, readings.strength
    words[:, 10] = checksums(words)
    if firmware == "packets":
        return words.tobytes()
    if firmware != "turns":
        raise ValueError(f'firmware must be "packets" or "turns", got {firmware!r}')
    if len(readings) % PACKETS_PER_TURN or (readings.index != _order(len(readings))).any():
        raise ValueError(
            "the older firmware sends whole turns: give rows with index 0..89, in "
            f"order, any number of times; got {len(readings)} rows"
        )
    head = TURN_HEAD + bytes([speed_byte, 0xD1])
    bodies = words[:, 2:10].reshape(-1, 8 * PACKETS_PER_TURN)
    return b"".join(head + body.tobytes() for body in bodies)


def _order(n: int) -> NDArray[np.int64]:
    return np.arange(n) % PACKETS_PER_TURN


def _check_range(name: str, values: ArrayLike, high: float) -> None:
    values = np.asarray(values)
    wrong = values[(values < 0) | (values > high)]
    if wrong.size:
        raise ValueError(
            f"{name} {wrong.flat[0]:g} cannot be sent: a packet holds 0 to {high:g}. "
            "Give NaN for a distance that the sensor cannot measure"
        )


_EMPTY = Readings(
    np.empty(0, np.uint8),
    np.empty(0),
    np.empty((0, 4)),
    np.empty((0, 4), np.uint16),
    np.empty((0, 4), np.uint8),
    np.empty((0, 4), bool),
    np.empty(0, np.int64),
)
