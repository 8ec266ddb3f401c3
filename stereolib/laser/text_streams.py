"""What a sensor or its board says in letters: scans as text are read, greetings named with what is missing.

Sources: Neato's *Programmer's Manual*, command ``GetLDSScan`` (``AngleInDegrees,DistInMM,Intensity,ErrorCodeHEX``, then
``ROTATION_SPEED`` in turns a second); the commands ``ShowDist`` and ``ShowAll`` of getSurreal's XV Lidar Controller
(``angle,distance``, in older versions ``angle: distance (strength)``); the Piccolo's own greeting at power-on.
"""

from __future__ import annotations

import re

import numpy as np

from stereolib.laser.xv11 import (
    BEAMS,
    MAX_DISTANCE_MM,
    NOMINAL_RPM,
    PACKETS_PER_TURN,
    READINGS_PER_PACKET,
    Readings,
    decode,
)

_LETTERS = 0.95  # share of bytes that are printable, from which on a stream is text
_LEAST_LINES = 30  # of a scan; a stray pair of numbers is none
_HEX = re.compile(rb"(?:0x)?[0-9a-fA-F]{2}(?:[\s,;:]*(?:0x)?[0-9a-fA-F]{2})*[\s,;:]*")
_READING = re.compile(
    r"^\s*(?P<angle>\d{1,3})\s*(?:,|:)\s*(?P<mm>\d{1,5})\s*"
    r"(?:,\s*(?P<strength>\d{1,5})\s*,\s*(?P<code>[0-9a-fA-F]{1,4})|\((?P<quality>\d{1,5})\))?\s*$"
)
_SPEED = re.compile(r"^\s*ROTATION_SPEED[^,]*,\s*(?P<hz>\d+(?:\.\d+)?)", re.IGNORECASE)
_GREETING = re.compile(r"Piccolo Laser|#\s*Spin|Neato Robotics|LastCal", re.IGNORECASE)
_MOTOR = (
    "the sensor greets and waits for its motor: drive it at about 300 turns a minute (some 3 V at its two wires, or "
    "PWM), and feed the sensor itself with the voltage that its version wants, 5 V for most"
)


def read_text_stream(data: bytes) -> Readings | None:
    """Read a scan that came as text.

    Parameters
    ----------
    data : bytes

    Returns
    -------
    Readings or None
        None where the bytes are not text. Hex digits are taken for the bytes that they stand for. A reading of 0 mm or
        with an error code is invalid; text without a speed gets the nominal one, 300 rpm.

    Raises
    ------
    ValueError
        If it is the greeting of a sensor whose motor does not turn, or text without a scan.

    Examples
    --------
    >>> lines = [f"{angle},{500 + angle},40,0" for angle in range(360)]
    >>> found = read_text_stream("\\n".join([*lines, "ROTATION_SPEED,5.10"]).encode())
    >>> len(found), found.distance_mm[1].tolist(), float(found.speed_rpm[0])
    (90, [504.0, 505.0, 506.0, 507.0], 306.0)
    >>> read_text_stream(b"Piccolo Laser Distance Scanner\\n#Spin...press ESC")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    ValueError: the sensor greets and waits for its motor: drive it at about 300 turns a minute...
    """
    if not _is_text(data):
        return None
    if (packed := data.strip()) and _HEX.fullmatch(packed):
        readings = decode(bytes.fromhex(re.sub(r"0x|[\s,;:]", "", packed.decode("ascii"))))
        return readings if len(readings) else None
    text = data.decode("ascii", errors="replace")
    turns = _turns(text)
    if sum(map(len, turns)) >= _LEAST_LINES:
        return _readings(turns, text)
    if _GREETING.search(text):
        raise ValueError(_MOTOR)
    return None


def _is_text(data: bytes) -> bool:
    raw = np.frombuffer(data, np.uint8)
    printable = ((raw >= 32) & (raw < 127)) | (raw == 9) | (raw == 10) | (raw == 13)
    return bool(len(raw)) and bool(printable.mean() >= _LETTERS)


def _turns(text: str) -> list[dict[int, tuple[float, int]]]:
    """Readings by angle, turn by turn: distance, mm, and strength."""
    turns: list[dict[int, tuple[float, int]]] = [{}]
    last = -1
    for line in text.splitlines():
        found = _READING.match(line)
        if not found or (angle := int(found["angle"])) >= BEAMS:
            continue
        if angle <= last:
            turns.append({})
        last, mm = angle, float(found["mm"])
        invalid = int(found["code"] or "0", 16) != 0 or not 0 < mm <= MAX_DISTANCE_MM
        turns[-1][angle] = np.nan if invalid else mm, int(found["strength"] or found["quality"] or 0)
    return [turn for turn in turns if turn]


def _readings(turns: list[dict[int, tuple[float, int]]], text: str) -> Readings:
    """Packets of these turns: whole ones, but for those before the first angle and behind the last one."""
    distance = np.full((len(turns), BEAMS), np.nan)
    strength = np.zeros((len(turns), BEAMS), np.int64)
    for k, turn in enumerate(turns):
        angles = list(turn)
        distance[k, angles], strength[k, angles] = zip(*turn.values(), strict=True)
    shape = -1, READINGS_PER_PACKET
    first, last = min(turns[0]) // READINGS_PER_PACKET, max(turns[-1]) // READINGS_PER_PACKET
    if len(turns) == 1:  # ShowDist leaves out what is invalid: one turn is taken for whole
        first, last = 0, PACKETS_PER_TURN - 1
    whole = slice(first, len(turns) * PACKETS_PER_TURN - (PACKETS_PER_TURN - 1 - last))
    told = [float(found["hz"]) * 60 for line in text.splitlines() if (found := _SPEED.match(line))]
    return Readings.build(
        np.tile(np.arange(PACKETS_PER_TURN), len(turns))[whole],
        distance.reshape(shape)[whole],
        np.minimum(strength, 0xFFFF).reshape(shape)[whole],
        speed_rpm=float(np.median(told)) if told else NOMINAL_RPM,
    )
