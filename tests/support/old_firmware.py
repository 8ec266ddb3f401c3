"""Bytes of the XV-11's older firmware, whole turns of 1446 bytes: the library reads them, only tests write them."""

from __future__ import annotations

from stereolib import laser

HEAD = bytes.fromhex("5aa500c0")


def encode_turns(readings: laser.Readings, speed_byte: int = 0x9E) -> bytes:
    """Write readings as the older firmware does.

    Parameters
    ----------
    readings : Readings
        Whole turns: rows with index 0..89 in order, any number of times.
    speed_byte : int
        The byte after the head; what it means is not known.

    Returns
    -------
    bytes
    """
    packets = laser.encode(readings)
    bodies = [packets[at + 4 : at + 20] for at in range(0, len(packets), 22)]
    assert readings.index.tolist() == [k % laser.PACKETS_PER_TURN for k in range(len(bodies))]
    head = HEAD + bytes([speed_byte, 0xD1])
    turns = [bodies[k : k + laser.PACKETS_PER_TURN] for k in range(0, len(bodies), laser.PACKETS_PER_TURN)]
    return b"".join(head + b"".join(turn) for turn in turns)
