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

So every packet that is intact in the stream is found. Few damaged ones are, too: no single wrong bit passes, but the
checksum is a sum, in which two bits of equal weight that flip in opposite directions cancel (of packets with two wrong
bits 2.4 % pass). Where each bit flips by itself, 0.84 % of the damaged packets pass at a chance of 1 % a bit, 0.2 % at
0.1 %. ``22 (good + bad) + 1446 turns + skipped`` is the number of bytes, but for the few that a packet found by chance
shares with a real one.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stereolib.base import Bools, Float64, UInt8, as_rows, set_frozen
from stereolib.laser.framing import PACKET_BYTES, TURN_BYTES, Framer, Words, checksums, words_at

PACKETS_PER_TURN, READINGS_PER_PACKET = 90, 4
BEAMS = PACKETS_PER_TURN * READINGS_PER_PACKET
BAUD = 115200  # 8N1: ten bits a byte
NOMINAL_RPM = 300.0  # five turns a second
RPM_LIMITS = (180.0, 349.0)  # outside, the firmware is silent or leaves packets out
RANGE_STEP_MM = 1.0  # the packet holds whole millimetres
MAX_DISTANCE_MM, MAX_RPM = 0x3FFF, 0xFFFF / 64
ERROR_NO_SIGNAL = 0x35  # the commonest code of the older firmware; used when none is given
Errors: TypeAlias = Literal["skip", "raise"]


@dataclass(frozen=True, eq=False)
class Readings:
    """Decoded packets as a struct of arrays, read-only copies, and what was met on the way.

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

    index: UInt8
    speed_rpm: Float64
    distance_mm: Float64
    strength: Words
    error_code: UInt8
    warning: Bools
    offset: NDArray[np.int64]
    good: int = 0
    bad_checksum: int = 0
    skipped_bytes: int = 0
    index_jumps: int = 0
    old_turns: int = 0

    def __post_init__(self) -> None:
        for name in _ARRAYS:
            own = np.array(getattr(self, name))
            own.setflags(write=False)
            set_frozen(self, **{name: own})

    def __len__(self) -> int:
        return len(self.index)

    def __getitem__(self, rows: slice | int) -> Readings:
        """Some of the packets, or one; the counters, which belong to the whole stream, become 0."""
        kept = np.atleast_1d(np.arange(len(self))[rows])
        return Readings(**{name: getattr(self, name)[kept] for name in _ARRAYS})

    @classmethod
    def build(
        cls,
        index: ArrayLike,
        distance_mm: ArrayLike,
        strength: ArrayLike = 0,
        *,
        speed_rpm: ArrayLike = NOMINAL_RPM,
        error_code: ArrayLike = ERROR_NO_SIGNAL,
        warning: ArrayLike = False,
    ) -> Readings:
        """Make readings by hand, every field broadcast to the shape of the distances.

        Parameters
        ----------
        index : (n,) array_like of int
            Packet index, 0..89.
        distance_mm : (n, 4) array_like, mm
            NaN is an invalid reading.
        strength : (n, 4) array_like of int, counts
        speed_rpm : (n,) array_like, rpm
        error_code : (n, 4) array_like of int
            Used where the distance is invalid.
        warning : (n, 4) array_like of bool

        Returns
        -------
        Readings

        Raises
        ------
        ValueError
            If a value does not fit into a packet, or the distances are not rows of four, each with its index.

        Examples
        --------
        >>> Readings.build(0, [[500, 501, np.nan, 503]]).error_code
        array([[ 0,  0, 53,  0]], dtype=uint8)
        """
        distance = as_rows(distance_mm, READINGS_PER_PACKET, "distance_mm")
        n, shape = len(distance), distance.shape
        if np.ndim(index) and np.size(index) != n:
            raise ValueError(f"each packet needs its index, got {np.size(index)} for {n} rows of four distances")
        code = np.where(np.isnan(distance), np.broadcast_to(error_code, shape), 0)
        _check_range("index", index, PACKETS_PER_TURN - 1, whole=True)
        _check_range("distance_mm", distance, MAX_DISTANCE_MM)
        _check_range("speed_rpm", speed_rpm, MAX_RPM)
        _check_range("strength", strength, 0xFFFF, whole=True)
        _check_range("error_code", code, 0xFF, whole=True)
        return cls(
            index=np.broadcast_to(index, n).astype(np.uint8),
            speed_rpm=np.broadcast_to(speed_rpm, n).astype(np.float64),
            distance_mm=distance,
            strength=np.broadcast_to(strength, shape).astype(np.uint16),
            error_code=code.astype(np.uint8),
            warning=np.broadcast_to(warning, shape).astype(bool),
            offset=np.arange(n, dtype=np.int64) * PACKET_BYTES,
            good=n,
        )


_ARRAYS = tuple(f.name for f in fields(Readings))[:7]
_COUNTERS = tuple(f.name for f in fields(Readings))[7:]


def decode(data: bytes, errors: Errors = "skip") -> Readings:
    """Decode the bytes of a whole stream; the module's text states the rules.

    Parameters
    ----------
    data : bytes
        Raw serial bytes; may start and end in the middle of a packet.
    errors : {"skip", "raise"}
        Step over damage and count it, or raise at the first byte in no intact packet.

    Returns
    -------
    Readings

    Raises
    ------
    PacketError
        With ``errors="raise"``; a ValueError that carries the offset and the bytes.
    ValueError
        If the data are no bytes.

    Examples
    --------
    >>> readings = decode(bytes.fromhex("fab1e349e400e105e2003406e0002506df008406f66b"))
    >>> readings.index, readings.distance_mm
    (array([17], dtype=uint8), array([[228., 226., 224., 223.]]))
    """
    return Decoder(errors)._run(_as_bytes(data), final=True)


class Decoder:
    """Decode a live stream: `feed` chunks of any size, then `close`.

    Each call returns the readings settled by then, with counters for that call alone; `totals` adds
    them up. Within a row of good packets each comes out as soon as its last byte is in.

    Parameters
    ----------
    errors : {"skip", "raise"}
        As for `decode`.

    Examples
    --------
    >>> decoder, packet = Decoder(), encode(Readings.build(7, [[500, 501, 502, 503]]))
    >>> [len(decoder.feed(part)) for part in (packet[:10], packet[10:])], len(decoder.close())
    ([0, 0], 1)
    """

    def __init__(self, errors: Errors = "skip") -> None:
        if errors not in ("skip", "raise"):
            raise ValueError(f'errors must be "skip" or "raise", got {errors!r}')
        self._framer = Framer(strict=errors == "raise")
        self._last_index = -1
        self.totals = dict.fromkeys(_COUNTERS, 0)

    def feed(self, chunk: bytes) -> Readings:
        """Take some bytes.

        Parameters
        ----------
        chunk : bytes

        Returns
        -------
        Readings
            What these bytes settled.

        Raises
        ------
        ValueError
            If the chunk is no bytes; `PacketError` with ``errors="raise"``.
        """
        return self._run(_as_bytes(chunk), final=False)

    def close(self) -> Readings:
        """End the stream.

        Returns
        -------
        Readings
            What was held back.
        """
        return self._run(b"", final=True)

    def _run(self, chunk: bytes, final: bool) -> Readings:
        packets, turns, bad, skipped = self._framer.take(chunk, final)
        out = _EMPTY
        if len(packets) or turns or bad or skipped:
            out = _readings(self._framer, packets, turns, self._last_index)
            out = replace(out, bad_checksum=bad, skipped_bytes=skipped)
        self._framer.forget()
        if len(out):
            self._last_index = int(out.index[-1])
        for name in _COUNTERS:
            self.totals[name] += getattr(out, name)
        return out


def _readings(framer: Framer, packets: NDArray[np.int64], turns: list[int], last_index: int) -> Readings:
    """Readings of the packets and turns at these positions in the framer's bytes, in their order."""
    data = np.frombuffer(framer.raw, np.uint8)
    words = words_at(data, packets)
    bodies = [data[turn + 6 : turn + TURN_BYTES].view("<u2").reshape(PACKETS_PER_TURN, 8) for turn in turns]
    body = np.concatenate([words[:, 2:10], *bodies])
    low, every = body[:, 0::2], np.arange(PACKETS_PER_TURN)
    invalid = low >= 0x8000
    arrays: dict[str, Any] = {
        "index": np.concatenate([(words[:, 0] >> 8) - 0xA0, *(every for _ in turns)]).astype(np.uint8),
        "speed_rpm": np.concatenate([words[:, 1] / 64, np.full(PACKETS_PER_TURN * len(turns), np.nan)]),
        "distance_mm": np.where(invalid, np.nan, low & MAX_DISTANCE_MM),
        "strength": body[:, 1::2].copy(),
        "error_code": np.where(invalid, low, 0).astype(np.uint8),
        "warning": low & 0x4000 != 0,
        "offset": np.concatenate([packets, *(turn + 6 + 16 * every for turn in turns)]) + framer.base,
    }
    if turns:
        order = np.argsort(arrays["offset"], kind="stable")
        arrays = {name: array[order] for name, array in arrays.items()}
    index = arrays["index"].astype(int)
    before = np.append(last_index, index[:-1])[: len(index)]
    jumps = np.count_nonzero((before >= 0) & ((before + 1) % PACKETS_PER_TURN != index))
    return Readings(**arrays, good=len(packets), index_jumps=int(jumps), old_turns=len(turns))


def join_readings(parts: Iterable[Readings]) -> Readings:
    """Join successive readings, for example of one decoder.

    Parameters
    ----------
    parts : iterable of Readings

    Returns
    -------
    Readings
        Their counters are added up.

    Examples
    --------
    >>> readings = Readings.build([0, 1, 2], np.full((3, 4), 500))
    >>> join_readings([readings[:1], readings[2:]]).index
    array([0, 2], dtype=uint8)
    """
    parts = [_EMPTY, *parts]
    arrays: dict[str, Any] = {name: np.concatenate([getattr(p, name) for p in parts]) for name in _ARRAYS}
    return Readings(**arrays, **{name: sum(getattr(p, name) for p in parts) for name in _COUNTERS})


def encode(readings: Readings) -> bytes:
    """Write the packets that the sensor would send for these readings; `decode` gives the same readings back.

    But for the speed of older firmware: a packet holds no NaN, so that it comes back as 0.

    Parameters
    ----------
    readings : Readings
        From `decode` or `Readings.build`; distances are rounded to whole mm.

    Returns
    -------
    bytes

    Examples
    --------
    >>> len(encode(Readings.build(np.arange(90), np.full((90, 4), 500))))
    1980
    """
    invalid = np.isnan(readings.distance_mm)
    distance = np.nan_to_num(np.rint(readings.distance_mm)).astype(np.uint16)
    low = np.where(invalid, 0x8000 | readings.error_code.astype(np.uint16), distance)
    low |= readings.warning.astype(np.uint16) << 14
    words = np.empty((len(readings), 11), "<u2")
    words[:, 0] = 0xFA | (readings.index.astype(np.uint16) + 0xA0) << 8
    words[:, 1] = np.rint(np.nan_to_num(readings.speed_rpm) * 64)
    words[:, 2:10:2], words[:, 3:10:2] = low, readings.strength
    words[:, 10] = checksums(words)
    return words.tobytes()


def _as_bytes(data: object) -> bytes:
    """The bytes of bytes, a bytearray, a memoryview or an array; an int would be taken for so many zeros."""
    try:
        return memoryview(data).tobytes()  # type: ignore[arg-type]
    except TypeError:
        remedy = "read the recording with Path(...).read_bytes()"
        raise ValueError(f"a stream is decoded from bytes, got {type(data).__name__}: {remedy}") from None


def _check_range(name: str, values: ArrayLike, high: float, *, whole: bool = False) -> None:
    values = np.asarray(values)
    wrong = values[(values < 0) | (values > high) | (whole & (values != np.floor(values)))]
    if wrong.size:
        sent = f"a packet holds {'whole numbers from ' if whole else ''}0 to {high:g}"
        remedy = "Give NaN for a distance that the sensor cannot measure"
        raise ValueError(f"{name} {wrong.flat[0]:g} cannot be sent: {sent}. {remedy}")


_EMPTY = Readings.build([], np.empty((0, READINGS_PER_PACKET)))
