"""Scans of the laser range finder: turns from packets, their average, points in the plane, walls.

The fields of `LaserScan` are those of ROS ``sensor_msgs/LaserScan``, in millimetres and radians:
angles run counter-clockwise, 0 looks forward along +x.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from stereolib.laser import xv11

# The error model and the wall fits next door are reached through here too.
# fmt: off
from stereolib.laser.error_model import (
    BiasCorrection,
    ErrorAgainstN,
    ErrorCurve,
    SigmaFit,
    bias_correction_test,
    compare_sigma_laws,
    error_against_n,
    error_curve,
    fit_sigma,
    learn_bias,
)
from stereolib.laser.walls import Wall, fit_line, fit_walls

__all__ = [
    "AveragedScan", "BiasCorrection", "ErrorAgainstN", "ErrorCurve", "LaserScan", "SigmaFit",
    "Wall", "average", "bias_correction_test", "check_firmware", "compare_sigma_laws",
    "error_against_n", "error_curve", "fit_line", "fit_sigma", "fit_walls", "gate", "info",
    "learn_bias", "load", "moving", "points_mm", "stack_mm", "turns",
]
# fmt: on

BEAMS = xv11.PACKETS_PER_TURN * xv11.READINGS_PER_PACKET
RANGE_MIN_MM, RANGE_MAX_MM = 60.0, 6000.0
EMITTER_OFFSET_MM, EMITTER_ANGLE_RAD = 25.0, np.deg2rad(82.0)
_NOMINAL_RPM = 300.0


@dataclass(frozen=True, eq=False)
class LaserScan:
    """One turn of the laser; arrays are read-only.

    Attributes
    ----------
    ranges_mm, intensities : (360,) float64
        Distance, mm, and signal strength, counts, beam by beam; NaN where nothing was measured.
    stamp_s : float
        Start of the turn from the start of the stream, s, as the motor speed tells it.
    scan_time_s, time_increment_s : float
        Duration of a turn and of a beam, s, at the turn's median speed.
    speed_rpm : float
        Median motor speed, rpm (NaN if the firmware does not tell).
    complete : bool
        All 90 packets of the turn arrived.
    """

    ranges_mm: NDArray[np.float64]
    intensities: NDArray[np.float64]
    stamp_s: float = 0.0
    scan_time_s: float = 60.0 / _NOMINAL_RPM
    speed_rpm: float = _NOMINAL_RPM
    complete: bool = True
    angle_min_rad: float = 0.0
    angle_increment_rad: float = 2 * np.pi / BEAMS
    range_min_mm: float = RANGE_MIN_MM
    range_max_mm: float = RANGE_MAX_MM

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray):
                kept = value.copy()
                kept.setflags(write=False)
                object.__setattr__(self, name, kept)

    @property
    def angle_max_rad(self) -> float:
        """Angle of the last beam, rad."""
        return self.angle_min_rad + (len(self.ranges_mm) - 1) * self.angle_increment_rad

    @property
    def angles_rad(self) -> NDArray[np.float64]:
        """Angle of every beam, (360,) rad."""
        beams = np.arange(len(self.ranges_mm), dtype=np.float64)
        return self.angle_min_rad + beams * self.angle_increment_rad

    @property
    def time_increment_s(self) -> float:
        """Time between two beams, s."""
        return self.scan_time_s / len(self.ranges_mm)


@dataclass(frozen=True, eq=False)
class AveragedScan(LaserScan):
    """Several turns combined into one; see `average`.

    Attributes
    ----------
    spread_mm : (360,) float64
        Sample standard deviation over the turns, mm; NaN below two readings.
    count : (360,) int
        Turns that have a reading there.
    dropout : (360,) float64
        Share of the turns without one, 0..1.
    n_turns : int
        Turns combined.
    """

    spread_mm: NDArray[np.float64] = None  # type: ignore[assignment]
    count: NDArray[np.int64] = None  # type: ignore[assignment]
    dropout: NDArray[np.float64] = None  # type: ignore[assignment]
    n_turns: int = 0


Scan = TypeVar("Scan", bound=LaserScan)
Method = Literal["median", "mean", "trimmed"]


def load(path: str | os.PathLike[str]) -> xv11.Readings:
    """Readings of a recording on disk.

    Raises
    ------
    ValueError
        If the file is empty, is no recording, or mixes both firmwares.
    """
    if not Path(path).exists() or Path(path).is_dir():
        raise ValueError(f"{path}: no such recording; `stereolib lrf record PORT FILE` makes one")
    data = Path(path).read_bytes()
    if not data:
        raise ValueError(
            f"{path} is empty: check the sensor's power and wiring and that its motor turns, then record again"
        )
    readings = xv11.decode(data)
    within = len(data) - readings.skipped_bytes - xv11.PACKET_BYTES * readings.bad_checksum
    if within < 0.05 * len(data):
        raise ValueError(
            f"{path} ({len(data)} bytes) is no XV-11 recording: intact packets hold only {within} "
            "of its bytes. It is another file, or was recorded at a wrong baud rate (not 115200)"
        )
    check_firmware(readings, str(path))
    return readings


def check_firmware(readings: xv11.Readings, source: str = "the stream") -> None:
    """Raise ValueError if readings of both firmwares are mixed: no single sensor sends both."""
    if readings.good and readings.old_turns:
        raise ValueError(
            f"{source} mixes two firmwares: {readings.good} packets of 22 bytes and "
            f"{readings.old_turns} turns of 1446 bytes. It joins the recordings of two sensors: "
            "split it and decode each part by itself"
        )


def turns(readings: xv11.Readings) -> list[LaserScan]:
    """Assemble packets into turns.

    A turn ends where the packet index does not grow. Packets lost within a turn leave NaN beams and
    ``complete=False``, as do a first and a last turn that were cut.

    Times follow from index and motor speed; through a spin-down, where most packets are missing,
    they are only a guess.
    """
    check_firmware(readings)
    if not len(readings):
        return []
    index = readings.index.astype(int)
    starts = np.flatnonzero(np.diff(index, prepend=xv11.PACKETS_PER_TURN) <= 0)
    rpm = np.where(readings.speed_rpm > 0, readings.speed_rpm, _NOMINAL_RPM)
    steps = np.diff(index, prepend=index[:1]) % xv11.PACKETS_PER_TURN
    stamps_s = np.cumsum(60.0 / rpm * steps / xv11.PACKETS_PER_TURN)
    strength = np.where(np.isnan(readings.distance_mm), np.nan, readings.strength)
    scans = []
    for start, end in zip(starts, np.append(starts[1:], len(index)), strict=True):
        beams = np.full((2, xv11.PACKETS_PER_TURN, xv11.READINGS_PER_PACKET), np.nan)
        beams[0, index[start:end]] = readings.distance_mm[start:end]
        beams[1, index[start:end]] = strength[start:end]
        median_rpm = float(np.median(rpm[start:end]))
        scans.append(
            LaserScan(
                beams[0].ravel(),
                beams[1].ravel(),
                stamp_s=float(stamps_s[start]),
                scan_time_s=60.0 / median_rpm,
                speed_rpm=float(np.median(readings.speed_rpm[start:end])),
                complete=bool(end - start == xv11.PACKETS_PER_TURN),
            )
        )
    return scans


def info(source: str | os.PathLike[str] | xv11.Readings) -> dict[str, Any]:
    """What a recording holds, as plain numbers (ready for JSON).

    Returns
    -------
    dict
        ``packets, bad_checksums, skipped_bytes, index_jumps, turns`` (complete ones),
        ``partial_turns, rpm_min, rpm_median, rpm_max`` (None if unknown), ``invalid_share`` (0..1),
        ``firmware``.
    """
    r = source if isinstance(source, xv11.Readings) else load(source)
    scans = turns(r)
    rpm = r.speed_rpm[np.isfinite(r.speed_rpm)]
    complete = sum(s.complete for s in scans)
    low, middle, high = np.percentile(rpm, (0, 50, 100)).tolist() if rpm.size else (None,) * 3
    return {
        "firmware": "1446-byte turns" if r.old_turns else "22-byte packets",
        "packets": len(r), "bad_checksums": r.bad_checksum, "skipped_bytes": r.skipped_bytes,
        "index_jumps": r.index_jumps, "turns": complete, "partial_turns": len(scans) - complete,
        "rpm_min": low, "rpm_median": middle, "rpm_max": high,
        "invalid_share": float(np.isnan(r.distance_mm).mean()) if len(r) else None,
    }  # fmt: skip


def stack_mm(scans: Sequence[LaserScan]) -> NDArray[np.float64]:
    """Ranges of several scans, (turns, 360) mm."""
    if not len(scans):
        raise ValueError("no turns given: record for at least one second, so that whole turns (5 a second) are in it")
    return np.stack([s.ranges_mm for s in scans])


def average(
    scans: Sequence[LaserScan],
    method: Method = "median",
    trim: float = 0.2,
    complete_only: bool = True,
) -> AveragedScan:
    """Combine several turns, beam by beam, leaving out missing readings.

    Parameters
    ----------
    scans : sequence of LaserScan
        The realizations (the paper takes five).
    method : {"median", "mean", "trimmed"}
        ``"trimmed"`` is the mean without the share `trim` of the readings on either side (rounded down).
    trim : float
        Share cut on each side, 0 <= trim < 0.5.
    complete_only : bool
        Leave out partial turns.

    Raises
    ------
    ValueError
        If no turn is left, or for an unknown method or trim.
    """
    if not 0 <= trim < 0.5:
        raise ValueError(f"trim is the share cut on each side, 0 <= trim < 0.5; got {trim}")
    used = [s for s in scans if s.complete or not complete_only]
    if scans and not used:
        raise ValueError(
            f"none of the {len(scans)} turns is complete; record longer (a turn takes "
            "0.2 s), or pass complete_only=False to use the partial ones"
        )
    ranges = np.sort(stack_mm(used), axis=0)  # NaN last
    count = np.isfinite(ranges).sum(axis=0)
    cuts = {
        "median": np.maximum(count - 1, 0) // 2,
        "mean": 0 * count,
        "trimmed": np.floor(trim * count).astype(int),
    }
    if method not in cuts:
        raise ValueError(f"method must be one of {', '.join(cuts)}; got {method!r}")
    rank = np.arange(len(ranges))[:, None]
    kept = (rank >= cuts[method]) & (rank < count - cuts[method])
    strength = np.stack([s.intensities for s in used])
    fields: dict[str, Any] = vars(used[0]) | {
        "ranges_mm": _mean(ranges, kept),
        "intensities": _mean(strength, np.isfinite(strength)),
        "speed_rpm": float(np.median([s.speed_rpm for s in used])),
        "complete": all(s.complete for s in used),
    }
    return AveragedScan(
        **fields, spread_mm=_spread(ranges), count=count, dropout=1 - count / len(used), n_turns=len(used)
    )


def _mean(values: NDArray[np.float64], kept: NDArray[np.bool_]) -> NDArray[np.float64]:
    n = kept.sum(axis=0)
    total = np.where(kept, values, 0).sum(axis=0)
    return np.where(n > 0, total / np.maximum(n, 1), np.nan)


def _spread(values: NDArray[np.float64]) -> NDArray[np.float64]:
    kept = np.isfinite(values)
    n = kept.sum(axis=0)
    squares = np.where(kept, (values - _mean(values, kept)) ** 2, 0).sum(axis=0)
    return np.where(n > 1, np.sqrt(squares / np.maximum(n - 1, 1)), np.nan)


def gate(scan: Scan, max_mm: float = 3000.0, min_mm: float = 0.0) -> Scan:
    """The same scan with ranges outside ``min_mm..max_mm`` made NaN (the paper trusts < 3 m)."""
    if not 0 <= min_mm < max_mm:
        raise ValueError(f"the gate needs 0 <= min_mm < max_mm, got {min_mm:g} and {max_mm:g}")
    inside = (scan.ranges_mm >= min_mm) & (scan.ranges_mm <= max_mm)
    return replace(scan, ranges_mm=np.where(inside, scan.ranges_mm, np.nan), range_max_mm=max_mm)


def points_mm(scan: LaserScan, geometry_correction: bool = False, keep_invalid: bool = False) -> NDArray[np.float64]:
    """Points of a scan in the laser's plane, (N, 2) mm, x forward and y left.

    Parameters
    ----------
    scan : LaserScan
        One turn or an average.
    geometry_correction : bool
        Measure from where the beam leaves the sensor, not from its axis.
    keep_invalid : bool
        Keep beams without a reading as NaN rows, so that N = 360.

    Notes
    -----
    The light leaves 25 mm beside the axis of rotation, 82 degrees from the beam::

        p = r (cos a, sin a) + 25 (cos(a - 82 deg), sin(a - 82 deg))

    The numbers are those of the Revo LDS that became the XV-11. The sign is the XV-11's: the other
    one bends the walls of the real recording more than no correction does.

    References
    ----------
    Konolige et al., "A low-cost laser distance sensor", ICRA 2008; US patent 8,996,172;
    bmegli/ev3dev-mapping, issue 4, for the sign.
    """
    a, r = scan.angles_rad, scan.ranges_mm
    points = np.stack([r * np.cos(a), r * np.sin(a)], axis=-1)
    if geometry_correction:
        b = a - EMITTER_ANGLE_RAD
        points += EMITTER_OFFSET_MM * np.stack([np.cos(b), np.sin(b)], axis=-1)
    return points if keep_invalid else points[np.isfinite(r)]


def moving(scans: Sequence[LaserScan], threshold_mm: float = 25.0, still: LaserScan | None = None) -> NDArray[np.bool_]:
    """Readings nearer than the still background by more than a threshold, (turns, 360) bool.

    The background is `still`, by default the median of the turns: right as long as what moves
    hides no beam for half of the time.
    """
    background = average(scans, complete_only=False) if still is None else still
    return stack_mm(scans) < background.ranges_mm - threshold_mm
