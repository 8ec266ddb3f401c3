"""The laser: decoding speed against a plain loop, what damage does to a stream, and the cost of reading live."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import numpy as np
from common import asked, ratio, save

from stereolib import laser
from stereolib.base import datasets
from stereolib.virtual import VirtualLidar, cube_scene, emulator, recordings

LIVE = """
import sys, time
from itertools import islice
from stereolib.laser import open_lidar
scans = open_lidar(sys.argv[1])
next(scans)
busy, wall = time.process_time(), time.monotonic()
list(islice(scans, 40))
print((time.process_time() - busy) / (time.monotonic() - wall))
"""


def plain_loop(data: bytes) -> list[tuple[int, float, list[float]]]:
    """A decoder as one writes it first: packet by packet, byte by byte."""
    found, at = [], 0
    while at + 22 <= len(data):
        packet = data[at : at + 22]
        words = [packet[k] | packet[k + 1] << 8 for k in range(0, 22, 2)]
        sum_ = 0
        for word in words[:10]:
            sum_ = (sum_ << 1) + word
        if packet[0] == 0xFA and 0xA0 <= packet[1] <= 0xF9 and ((sum_ & 0x7FFF) + (sum_ >> 15)) & 0x7FFF == words[10]:
            ranges = [float("nan") if w & 0x8000 else float(w & 0x3FFF) for w in words[2:10:2]]
            found.append((packet[1] - 0xA0, words[1] / 64, ranges))
            at += 22
        else:
            at += 1
    return found


def decoding() -> dict[str, float]:
    """The real recording when it is to be had, else the virtual room, repeated to its length."""
    try:
        data = datasets.real_recording("xv11/hand_in_box.txt").read_bytes()
    except datasets.NotAvailable:
        data = recordings.load_laser("lrf/room") * 25
    assert len(plain_loop(data)) == laser.decode(data).good
    result = ratio(lambda: laser.decode(data), lambda: plain_loop(data), rounds=7)
    return {
        "mb_per_s": round(len(data) / result["ours_ms"] / 1000, 1),
        "times_a_plain_loop": round(1 / result["ratio"], 1),
    }


def damage(rng: np.random.Generator, packets: int = 400_000) -> dict[str, float]:
    """Flip, drop and insert bytes in one packet of ten; count what is lost of the rest and what is invented."""
    shape = (packets, 4)
    readings = laser.Readings.build(
        np.arange(packets) % 90, rng.integers(100, 6000, shape), rng.integers(1, 2000, shape)
    )
    clean = laser.encode(readings)
    whole = [clean[k : k + 22] for k in range(0, len(clean), 22)]
    pieces, intact, at = [], [], 0
    for packet, hit in zip(whole, rng.random(packets) < 0.1, strict=True):
        piece = bytearray(packet)
        if hit:
            place, kind = int(rng.integers(22)), int(rng.integers(3))
            if kind == 0:
                piece[place] ^= 1 << int(rng.integers(8))
            elif kind == 1:
                del piece[place]
            else:
                piece.insert(place, int(rng.integers(256)))
        # An insertion before the first or after the last byte leaves the packet whole, so compare and not trust `hit`.
        shift = bytes(piece).find(packet)
        if shift >= 0:
            intact.append(at + shift)
        pieces.append(bytes(piece))
        at += len(piece)
    found = set(laser.decode(b"".join(pieces)).offset.tolist())
    spoilt = packets - len(intact)
    invented = len(found - set(intact))
    return {
        "packets": packets,
        "intact_packets": len(intact),
        "intact_lost": len(set(intact) - found),
        "invented_per_spoilt": round(invented / spoilt, 7),
        "checksum_chance": (2**-15),
    }


def live_share() -> float:
    """CPU time over wall time of a process that reads an emulated sensor at 300 turns a minute for 40 turns."""
    schedule = emulator.emulate(cube_scene(), rng=np.random.default_rng(0), seconds=30)
    with emulator.serve(schedule) as served:
        done = subprocess.run([sys.executable, "-c", LIVE, served.port], check=True, capture_output=True, text=True)
    return float(done.stdout)


def sweep_error_mm() -> float:
    """Median absolute error of the recorded sweep's median of five turns, on the beams that meet the cube."""
    truth_mm = VirtualLidar().truth_mm(cube_scene(), recordings.LASER_POSE)
    scan = laser.average(laser.turns(laser.decode(recordings.load_laser("lrf/room"))))
    return float(np.nanmedian(np.abs(scan.ranges_mm - truth_mm)[truth_mm < 950]))


def junk(rng: np.random.Generator) -> tuple[int, float]:
    """Ten million random bytes in skip mode: never an exception, packets only by chance; their number, and s."""
    start = time.perf_counter()
    found = laser.decode(rng.bytes(10_000_000))
    return found.good, round(time.perf_counter() - start, 3)


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    wanted, rooms = asked(__doc__), ("base", "laser", "virtual")
    if "accuracy" in wanted:
        rng = np.random.default_rng(1)
        found = damage(rng) | {"junk_packets": junk(rng)[0], "sweep_error_mm": round(sweep_error_mm(), 2)}
        save("lrf", found, rooms)
    if "time" in wanted:
        live = {"junk_s": junk(np.random.default_rng(1))[1], "live_cpu_pct": round(100 * live_share(), 2)}
        save("lrf_time", decoding() | live, rooms)
