"""The laser as it turns: each turn with what was lost of it, and how fast they come."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from stereolib.laser.scans import LaserScan, turns
from stereolib.laser.serial_port import check_packets, read_chunks
from stereolib.laser.xv11 import PACKETS_PER_TURN, Decoder, decode, join_readings

_RECENT = 10  # turns over which their rate is told
_HEARD_BYTES = 4096


@dataclass(frozen=True, eq=False)
class LiveTurn:
    """One turn, and how the line does.

    Attributes
    ----------
    scan : LaserScan
    turns : int
        So far, this one included.
    rate_hz : float
        Turns a second, over the last ten; NaN for the first.
    packets_lost : int
        Of all turns so far, 90 packets each.
    bad_checksums, skipped_bytes : int
        Damage on the line so far.
    """

    scan: LaserScan
    turns: int
    rate_hz: float
    packets_lost: int
    bad_checksums: int
    skipped_bytes: int

    @property
    def lost_share(self) -> float:
        """Share of the packets that were lost, 0..1."""
        return self.packets_lost / (PACKETS_PER_TURN * self.turns)


def watch_turns(port: str) -> Generator[LiveTurn, None, None]:
    """Read turns from a sensor, whole or not, for ever; the first one, which began before, is left out.

    Parameters
    ----------
    port : str
        Device name or pyserial address.

    Yields
    ------
    LiveTurn

    Raises
    ------
    LidarError
        As `open_lidar`.
    """
    decoder, pending, heard = Decoder(), decode(b""), b""
    count, lost, is_first, ended_s = 0, 0, True, deque[float](maxlen=_RECENT + 1)
    with closing(read_chunks(port)) as chunks:
        for chunk in chunks:
            pending, heard = join_readings([pending[:], decoder.feed(chunk)]), (heard + chunk)[-_HEARD_BYTES:]
            check_packets(port, decoder.totals, heard)
            while len(ends := np.flatnonzero(np.diff(pending.index.astype(int)) <= 0) + 1):
                turned, pending = pending[: ends[0]], pending[ends[0] :]
                ended_s.append(time.monotonic())
                if is_first:
                    is_first = False
                    continue
                count, lost = count + 1, lost + PACKETS_PER_TURN - len(turned)
                took_s = ended_s[-1] - ended_s[0]
                rate_hz = (len(ended_s) - 1) / took_s if took_s > 0 else np.nan
                totals = decoder.totals
                (scan,) = turns(turned)
                yield LiveTurn(scan, count, rate_hz, lost, totals["bad_checksum"], totals["skipped_bytes"])
