"""Scans of the laser range finder: turns assembled from packets, their average, and what moves between them.

The fields of `LaserScan` are those of ROS ``sensor_msgs/LaserScan``, in millimetres and radians:
angles run counter-clockwise, 0 looks forward along +x.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal, TypeVar

import numpy as np

from stereolib.base import Bools, Float64, Ints, counted, set_frozen
from stereolib.laser.xv11 import BEAMS, NOMINAL_RPM, PACKETS_PER_TURN, READINGS_PER_PACKET, Readings

RANGE_MIN_MM, RANGE_MAX_MM = 60.0, 6000.0
TRUSTED_MM = 3000.0  # the paper's limit: what is farther is not used
#: Where the light leaves an XV-11: so far from its axis, in this direction, counter-clockwise from the beam.
EMITTER_OFFSET_MM, EMITTER_ANGLE_RAD = 25.0, float(np.deg2rad(-82.0))
_PAST_TURN = 0.5  # of an increment, that the last beam may lie past the first: printed increments are rounded
_MOVED_MM = 25.0  # off the median of its beam a reading met what moves: above its noise within the trusted range


@dataclass(frozen=True, eq=False)
class LaserScan:
    """One turn of the laser; arrays are read-only.

    A scan whose angles run clockwise, with a negative increment, is turned round: its last beam becomes the first.

    Attributes
    ----------
    ranges_mm, intensities : (360,) float64
        Distance, mm, and signal strength, counts, beam by beam; NaN where nothing was measured. What no laser
        measures, 0, negative or infinite, becomes NaN.
    stamp_s : float
        Start of the turn from the start of the stream, s, as the motor speed tells it.
    scan_time_s, time_increment_s : float
        Duration of a turn and of a beam, s, at the turn's median speed.
    speed_rpm : float
        Median motor speed, rpm (NaN if the firmware does not tell).
    complete : bool
        All 90 packets of the turn arrived.
    angle_min_rad, angle_increment_rad, angle_max_rad : float
        Angle of the first beam, between two beams, and of the last beam, rad.
    range_min_mm, range_max_mm : float
        Ranges that the sensor measures, or that were let through, mm.
    emitter_offset_mm, emitter_angle_rad : float
        How far from the sensor's axis its light starts, mm, and in which direction, counter-clockwise from the beam,
        rad. An XV-11's unless given; 0 for a sensor whose beams start at its axis.

    Raises
    ------
    ValueError
        If an array is not of one dimension, or they differ in length; or if the increment is 0 or not finite, or takes
        the beams round more than once.
    """

    ranges_mm: Float64
    intensities: Float64
    stamp_s: float = 0.0
    scan_time_s: float = 60.0 / NOMINAL_RPM
    speed_rpm: float = NOMINAL_RPM
    complete: bool = True
    angle_min_rad: float = 0.0
    angle_increment_rad: float = 2 * np.pi / BEAMS
    range_min_mm: float = RANGE_MIN_MM
    range_max_mm: float = RANGE_MAX_MM
    emitter_offset_mm: float = EMITTER_OFFSET_MM
    emitter_angle_rad: float = EMITTER_ANGLE_RAD

    def __post_init__(self) -> None:
        ranges = np.asarray(self.ranges_mm, np.float64)
        set_frozen(self, ranges_mm=np.where(np.isfinite(ranges) & (ranges > 0), ranges, np.nan))
        set_frozen(self, intensities=np.asarray(self.intensities, np.float64))
        copies = {name: value.copy() for name, value in vars(self).items() if isinstance(value, np.ndarray)}
        if ranges.ndim != 1 or any(copy.shape != ranges.shape for copy in copies.values()):
            shapes = ", ".join(f"{name} {copy.shape}" for name, copy in copies.items())
            raise ValueError(f"a scan has one number a beam in each of its arrays, (n,), got {shapes}")
        _check_increment(self.angle_increment_rad, len(ranges))
        if self.angle_increment_rad < 0:
            copies = {name: copy[::-1].copy() for name, copy in copies.items()}
            set_frozen(self, angle_min_rad=self.angle_max_rad, angle_increment_rad=-self.angle_increment_rad)
        for copy in copies.values():
            copy.setflags(write=False)
        set_frozen(self, **copies)

    @property
    def angles_rad(self) -> Float64:
        """Angle of every beam, (360,) rad."""
        return self.angle_min_rad + np.arange(len(self.ranges_mm), dtype=np.float64) * self.angle_increment_rad

    @property
    def angle_max_rad(self) -> float:
        """Angle of the last beam, rad."""
        return self.angle_min_rad + (len(self.ranges_mm) - 1) * self.angle_increment_rad

    @property
    def time_increment_s(self) -> float:
        """Time between two beams, s."""
        return self.scan_time_s / len(self.ranges_mm)


@dataclass(frozen=True, eq=False, kw_only=True)
class AveragedScan(LaserScan):
    """Several turns combined into one; see `average`.

    Attributes
    ----------
    spread_mm : (360,) float64
        Sample standard deviation over the turns, mm; NaN below two readings.
    still_spread_mm : (360,) float64
        The same without what moved: of the readings within 25 mm of their beam's median.
    count : (360,) int
        Turns that have a reading there.
    dropout : (360,) float64
        Share of the turns without one, 0..1.
    n_turns : int
        Turns combined.
    """

    spread_mm: Float64
    still_spread_mm: Float64
    count: Ints
    dropout: Float64
    n_turns: int


_Scan = TypeVar("_Scan", bound=LaserScan)


def _check_increment(increment_rad: float, beams: int) -> None:
    if not np.isfinite(increment_rad) or increment_rad == 0:
        raise ValueError(f"the angle between two beams must be a number of rad other than 0, got {increment_rad:g}")
    if max(beams - 1 - _PAST_TURN, 1) * abs(increment_rad) > 2 * np.pi:
        why = f"{counted(beams, 'beam')} at steps of {abs(increment_rad):g} rad are more than a turn"
        raise ValueError(f"{why}: is angle_increment_rad in degrees, or another sensor's?")


def check_firmware(readings: Readings, source: str = "the stream") -> None:
    """Refuse readings of both firmwares: no single sensor sends both.

    Parameters
    ----------
    readings : Readings
    source : str
        What the message calls it.

    Raises
    ------
    ValueError
        If there are packets of 22 bytes and turns of 1446 bytes.
    """
    if readings.good and readings.old_turns:
        counted = f"{readings.good} packets of 22 bytes and {readings.old_turns} turns of 1446 bytes"
        advice = "It joins the recordings of two sensors: split it and decode each part by itself"
        raise ValueError(f"{source} mixes two firmwares: {counted}. {advice}")


def turns(readings: Readings, *, emitter_offset_mm: float = EMITTER_OFFSET_MM) -> list[LaserScan]:
    """Assemble packets into turns.

    Parameters
    ----------
    readings : Readings
    emitter_offset_mm : float
        How far beside the sensor's axis its beams start, mm: an XV-11's unless given, which no packet tells.

    Returns
    -------
    list of LaserScan

    Raises
    ------
    ValueError
        If the readings come from both firmwares.

    Notes
    -----
    A turn ends where the packet index does not grow. Packets lost within a turn leave NaN beams and
    ``complete=False``, as do a first and a last turn that were cut.

    Times follow from index and motor speed; through a spin-down, where most packets are missing,
    they are only a guess.

    Examples
    --------
    >>> readings = Readings.build(np.arange(180) % 90, np.full((180, 4), 1500))
    >>> [(scan.complete, scan.stamp_s.__round__(3)) for scan in turns(readings)]
    [(True, 0.0), (True, 0.2)]
    """
    check_firmware(readings)
    index = readings.index.astype(int)
    starts = np.flatnonzero(np.diff(index, prepend=PACKETS_PER_TURN) <= 0)
    rpm = np.where(readings.speed_rpm > 0, readings.speed_rpm, NOMINAL_RPM)
    steps = np.diff(index, prepend=index[:1]) % PACKETS_PER_TURN
    stamps_s = np.cumsum(60.0 / rpm * steps / PACKETS_PER_TURN)
    strength = np.where(np.isnan(readings.distance_mm), np.nan, readings.strength)
    measured, scans = np.stack([readings.distance_mm, strength]), list[LaserScan]()
    for start, end in pairwise([*starts, len(index)]):
        beams = np.full((2, PACKETS_PER_TURN, READINGS_PER_PACKET), np.nan)
        beams[:, index[start:end]] = measured[:, start:end]
        scan_time_s, speed_rpm = (
            60.0 / float(np.median(rpm[start:end])),
            float(np.median(readings.speed_rpm[start:end])),
        )
        (ranges, intensities), stamp_s = beams.reshape(2, -1), float(stamps_s[start])
        complete = bool(end - start == PACKETS_PER_TURN)
        turn = LaserScan(ranges, intensities, stamp_s, scan_time_s, speed_rpm, complete)
        scans.append(replace(turn, emitter_offset_mm=emitter_offset_mm))
    return scans


def average(
    scans: Sequence[LaserScan], method: Literal["median", "mean"] = "median", *, complete_only: bool = True
) -> AveragedScan:
    """Combine several turns, beam by beam, leaving out missing readings.

    Parameters
    ----------
    scans : sequence of LaserScan
        The realizations (the paper takes five).
    method : {"median", "mean"}
    complete_only : bool
        Leave out partial turns.

    Returns
    -------
    AveragedScan
        Its intensities are means of those measured, whatever the method.

    Raises
    ------
    ValueError
        If no turn is left, the turns are not of the same beams, or for an unknown method.

    Examples
    --------
    >>> scans = [LaserScan(np.full(360, float(mm)), np.ones(360)) for mm in (500, 503, 530)]
    >>> average(scans).ranges_mm[0], average(scans, "mean").ranges_mm[0]
    (np.float64(503.0), np.float64(511.0))
    """
    used = [scan for scan in scans if scan.complete or not complete_only]
    if scans and not used:
        advice = "record longer (a turn takes 0.2 s), or, in Python, use the partial ones: complete_only=False"
        raise ValueError(f"of {counted(len(scans), 'turn')} none is complete; {advice}")
    ranges = np.sort(_stack_mm(used), axis=0)  # NaN last
    count = np.isfinite(ranges).sum(axis=0)
    cuts = {"median": np.maximum(count - 1, 0) // 2, "mean": 0 * count}
    if method not in cuts:
        raise ValueError(f"method must be one of {', '.join(cuts)}; got {method!r}")
    rank = np.arange(len(ranges))[:, None]
    middles = {name: _mean(ranges, (rank >= cut) & (rank < count - cut)) for name, cut in cuts.items()}
    still = np.where(np.abs(ranges - middles["median"]) <= _MOVED_MM, ranges, np.nan)
    strength = np.stack([scan.intensities for scan in used])
    fields: dict[str, Any] = vars(used[0]) | {
        "ranges_mm": middles[method],
        "intensities": _mean(strength, np.isfinite(strength)),
        "speed_rpm": float(np.median([scan.speed_rpm for scan in used])),
        "complete": all(scan.complete for scan in used),
        "spread_mm": _spread(ranges),
        "still_spread_mm": _spread(still),
        "count": count,
        "dropout": 1 - count / len(used),
        "n_turns": len(used),
    }
    return AveragedScan(**fields)


def _stack_mm(scans: Sequence[LaserScan]) -> Float64:
    """Ranges of several scans of the same beams, (turns, 360) mm."""
    if not len(scans):
        raise ValueError("no turns given: record for at least one second, so that whole turns (5 a second) are in it")
    for name in ("angle_min_rad", "angle_increment_rad", "emitter_offset_mm", "emitter_angle_rad"):
        if len(values := {getattr(scan, name) for scan in scans}) > 1:
            got = " and ".join(f"{value:g}" for value in sorted(values)[:2])
            raise ValueError(f"the turns are of different beams, {name} {got}: take those of one sensor as it stood")
    if len(beams := {len(scan.ranges_mm) for scan in scans}) > 1:
        got = " and ".join(str(count) for count in sorted(beams)[:2])
        raise ValueError(f"the turns have {got} beams: take those of one sensor")
    return np.stack([scan.ranges_mm for scan in scans])


def _mean(values: Float64, kept: Bools) -> Float64:
    n = kept.sum(axis=0)
    total = np.where(kept, values, 0).sum(axis=0)
    return np.where(n > 0, total / np.maximum(n, 1), np.nan)


def _spread(values: Float64) -> Float64:
    kept = np.isfinite(values)
    n = kept.sum(axis=0)
    squares = np.where(kept, (values - _mean(values, kept)) ** 2, 0).sum(axis=0)
    return np.where(n > 1, np.sqrt(squares / np.maximum(n - 1, 1)), np.nan)


def gate(scan: _Scan, max_mm: float = TRUSTED_MM) -> _Scan:
    """Make ranges beyond a limit NaN.

    Parameters
    ----------
    scan : LaserScan
        One turn or an average.
    max_mm : float
        Largest range that is kept, mm.

    Returns
    -------
    LaserScan
        Of the same kind as `scan`.

    Raises
    ------
    ValueError
        If the limit is not positive.

    Examples
    --------
    >>> gate(LaserScan(np.array([2999.0, 3001.0]), np.ones(2))).ranges_mm
    array([2999.,   nan])
    """
    if not max_mm > 0:
        raise ValueError(f"the gate needs max_mm > 0, in mm; got {max_mm:g}")
    ranges = np.where(scan.ranges_mm <= max_mm, scan.ranges_mm, np.nan)
    return replace(scan, ranges_mm=ranges, range_max_mm=max_mm)


def moving_readings(scans: Sequence[LaserScan]) -> Bools:
    """Find the readings that are nearer than the still background.

    The background is the median of the turns: right as long as what moves hides no beam for half of
    the time.

    Parameters
    ----------
    scans : sequence of LaserScan

    Returns
    -------
    (turns, 360) bool

    Raises
    ------
    ValueError
        If there is no turn, or they are not of the same beams.

    Examples
    --------
    >>> ranges = np.full((3, 360), 1000.0)
    >>> ranges[1, 7] = 800
    >>> np.argwhere(moving_readings([LaserScan(row, np.ones(360)) for row in ranges]))
    array([[1, 7]])
    """
    return _stack_mm(scans) < average(scans, complete_only=False).ranges_mm - _MOVED_MM
