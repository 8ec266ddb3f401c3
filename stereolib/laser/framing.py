"""Find the XV-11's packets in a stream of bytes, by the rules that `stereolib.laser.xv11` states."""

from __future__ import annotations

import re
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from stereolib.base import Bools, UInt8

Positions: TypeAlias = NDArray[np.int64]
Words: TypeAlias = NDArray[np.uint16]

PACKET_BYTES, TURN_BYTES = 22, 1446
_TURN_HEAD = re.compile(rb"\x5a\xa5\x00\xc0(?=.\xd1)", re.DOTALL)
_CONTEXT = 2 * PACKET_BYTES - 2  # bytes on either side that settle whether a head is bad


class PacketError(ValueError):
    """A byte that belongs to no intact packet, met with ``errors="raise"``.

    Attributes
    ----------
    offset : int
        Position of that byte in the stream, from 0.
    data : bytes
        At most 22 bytes from there on.
    """

    def __init__(self, message: str, offset: int, data: bytes) -> None:
        super().__init__(f"{message} at byte {offset}: {data.hex(' ')}")
        self.offset, self.data = offset, data


def checksums(words: Words) -> NDArray[np.int32]:
    """Compute the checksums of many packets at once.

    Parameters
    ----------
    words : (n, >= 10) uint16
        The packets' words; the first ten are summed up.

    Returns
    -------
    (n,) int32

    Notes
    -----
    ``c = 2 c + w`` over the ten words, then the upper bits are added to the lower 15.

    Examples
    --------
    >>> packet = bytes.fromhex("fab1e349e400e105e2003406e0002506df008406f66b")
    >>> [hex(c) for c in checksums(np.frombuffer(packet, "<u2")[None])]
    ['0x6bf6']
    """
    c = words[:, :10] @ (1 << np.arange(9, -1, -1, dtype=np.int32))  # at most 65535 * 1023: fits
    return ((c & 0x7FFF) + (c >> 15)) & 0x7FFF


class Framer:
    """Find packets and turns in a stream that comes in pieces.

    What counts is decided from the bytes around it alone (`_CONTEXT` before and after), so that
    it does not matter where the stream is cut. All positions are in the stream, from 0, but for
    those inside `_frames`, which are in the bytes at hand.

    Parameters
    ----------
    strict : bool
        Raise `PacketError` at the first byte that belongs to no intact packet.
    """

    def __init__(self, strict: bool) -> None:
        self._strict = strict
        self.raw = b""  # bytes not yet decided, and the context before them
        self.base = 0  # position of raw[0]
        self._decided = 0  # everything that starts before this is decided
        self._covered = 0  # end of the last frame or bad packet, or what was skipped last

    def take(self, chunk: bytes, final: bool) -> tuple[Positions, list[int], int, int]:
        """Add bytes to the stream and decide what can be decided.

        Parameters
        ----------
        chunk : bytes
        final : bool
            The stream ends here: decide everything.

        Returns
        -------
        packets : (n,) int64
            Positions of the packets now decided, in ``raw``, which stays as it is until `forget`.
        turns : list of int
            The same for turns of the older firmware.
        bad, skipped : int
            Packets with a wrong checksum, and bytes in no packet.
        """
        self.raw = self.raw + chunk if self.raw else chunk
        low = self._decided - self.base
        if len(self.raw) - low < PACKET_BYTES and not final:
            return np.empty(0, np.int64), [], 0, 0
        packets, turns, wrong, high = self._frames(low, final)
        bad, skipped = self._rest(packets, turns, wrong[(wrong >= low) & (wrong < high)], high)
        self._decided = self.base + high
        return packets[(packets >= low) & (packets < high)], turns, bad, skipped

    def forget(self) -> None:
        """Drop the bytes that are no longer needed."""
        start = max(self._decided - self.base - _CONTEXT, 0)
        self.raw, self.base = self.raw[start:], self.base + start

    def _frames(self, low: int, final: bool) -> tuple[Positions, list[int], Positions, int]:
        """Packets and turns that count, heads with a wrong checksum, and how far that is decided."""
        n = len(self.raw)
        good, wrong = _candidates(np.frombuffer(self.raw, np.uint8))
        heads = [match.start() for match in _TURN_HEAD.finditer(self.raw, low)]
        high, turns = n if final else max(n - _CONTEXT, low), list[int]()
        for k, head in enumerate(heads):
            end, previous_end = head + TURN_BYTES, turns[-1] + TURN_BYTES if turns else low
            if not final and (head >= high or end + PACKET_BYTES > n):
                high = max(min(high, head - PACKET_BYTES + 1), previous_end)
                break
            cut_short = end > n or (k + 1 < len(heads) and heads[k + 1] < end)
            if not cut_short and not _overlap(np.array([head]), TURN_BYTES, good)[0]:
                turns.append(head)
                high = max(high, end)
        return good, turns, wrong, high if final else self._follow(good, high)

    @staticmethod
    def _follow(good: Positions, high: int) -> int:
        """Go on along a row of packets: nothing that comes later can take it back."""
        k = int(np.searchsorted(good, high)) - 1
        while 0 <= k < len(good) - 1 and good[k + 1] == good[k] + PACKET_BYTES:
            k += 1
            high = int(good[k]) + 1
        return high

    def _rest(self, packets: Positions, turns: list[int], wrong: Positions, high: int) -> tuple[int, int]:
        """Count the bad packets and the bytes skipped up to `high`; raise at the first if strict."""
        begin = self._covered - self.base
        taken = _overlap(wrong, PACKET_BYTES, packets)
        taken |= _overlap(wrong, PACKET_BYTES, np.array(turns, np.int64), TURN_BYTES)
        bad = list[int]()
        for head in wrong[~taken & (wrong >= begin)].tolist():
            if not bad or head >= bad[-1] + PACKET_BYTES:
                bad.append(head)
        low = self._decided - self.base
        new = packets[(packets >= low) & (packets < high)]
        starts = np.concatenate([new, np.array(turns + bad, np.int64)])
        lengths = np.repeat([PACKET_BYTES, TURN_BYTES, PACKET_BYTES], [len(new), len(turns), len(bad)])
        order = np.argsort(starts, kind="stable")
        ends = np.maximum.accumulate(np.concatenate([[begin], (starts + lengths)[order]]))
        gaps = np.maximum(np.append(starts[order], high) - ends, 0)
        self._covered = self.base + max(int(ends[-1]), high)
        if self._strict and (bad or gaps.any()):
            first_gap = int(ends[np.flatnonzero(gaps)[0]]) if gaps.any() else high
            at = min([first_gap, *bad[:1]])
            why = "not part of any packet" if at == first_gap else "the checksum of a packet is wrong"
            raise PacketError(why, self.base + at, self.raw[at : at + PACKET_BYTES])
        return len(bad), int(gaps.sum())


def _overlap(starts: Positions, length: int, others: Positions, other_length: int = PACKET_BYTES) -> Bools:
    """Which of these stretches overlap one of the others (sorted, of another start)."""
    return np.searchsorted(others, starts + length) > np.searchsorted(others, starts - other_length, side="right")


def _candidates(data: UInt8) -> tuple[Positions, Positions]:
    """Positions of packet heads: those with a good checksum, and those with a wrong one."""
    fa = np.flatnonzero(data[: max(len(data) - PACKET_BYTES + 1, 0)] == 0xFA)
    index = data[fa + 1]
    heads = fa[(index >= 0xA0) & (index <= 0xF9)]
    good = checksums(words := words_at(data, heads)) == words[:, 10]
    return heads[good], heads[~good]


def words_at(data: UInt8, at: Positions) -> Words:
    """Cut packets out of a stream and read their words.

    Parameters
    ----------
    data : (m,) uint8
    at : (n,) int64
        Where the packets start.

    Returns
    -------
    (n, 11) uint16
    """
    if not len(at):
        return np.empty((0, 11), np.uint16)
    rows: UInt8 = np.lib.stride_tricks.sliding_window_view(data, PACKET_BYTES)[at]
    return rows.view("<u2")
