"""Objects and walls in a scan: cut where the range jumps, then told apart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from stereolib.base import Bools, Float64, Ints
from stereolib.laser.error_model import QUANTISATION_MM, SigmaFit
from stereolib.laser.points import points_mm
from stereolib.laser.scans import TRUSTED_MM, AveragedScan, LaserScan

#: Noise of a single reading, ``a + b r^2``: the virtual laser's, above a real XV-11's (notebook 05).
XV11_SIGMA = SigmaFit("quadratic", a_mm=1.3, b=1.2e-6, rms_mm=np.nan, rms_percent=np.nan, aic=np.nan)
Sigma: TypeAlias = Callable[[Float64], Float64]
LEAST_BEAMS = 4  # what fewer beams meet may be anything
_BEYOND = 8  # readings past an end that are kept
_LARGEST_OBJECT_MM = 1000.0  # what is larger is a wall
_GRAZING_RAD = np.deg2rad(8.0)  # flattest angle at which a face is still followed from beam to beam
_LEAST_ANGLE_RAD = np.radians(2.0)  # of a face behind lost readings, however many
_LONGEST_STEP_RAD = 0.2  # beyond it the chord says nothing of the surface
_LOST_BEAMS = 4.5  # steps without a reading that a surface may have
_DEVIATIONS = 3  # a jump within so many standard deviations is noise


@dataclass(frozen=True, eq=False)
class Segment:
    """Neighbouring beams that meet one object or wall.

    Attributes
    ----------
    kind : str
        ``"object"``, ``"wall"`` (hidden at both ends by something nearer, or larger than an object), or ``"small"``
        (too few beams).
    beams : (N,) int
        Their numbers in the scan, counter-clockwise.
    points_mm : (N, 2) float64
        What they meet, in the laser's plane, mm.
    sigma_mm : (N,) float64
        Standard deviation of each reading along its beam, mm.
    gaps_rad : ((low, high), (low, high))
        Between these angles the surface ends on the right, and on the left.
    beyond_mm : (right, left), each (M, 2) float64
        The next readings past either end, outwards: what lies beside or behind.
    hidden : (right, left) bool
        Something nearer stands at that end: the surface may go on behind it.
    """

    kind: str
    beams: Ints
    points_mm: Float64
    sigma_mm: Float64
    gaps_rad: tuple[tuple[float, float], tuple[float, float]]
    beyond_mm: tuple[Float64, Float64]
    hidden: tuple[bool, bool]

    @property
    def extent_mm(self) -> float:
        """Distance of its first point from its last, mm."""
        return float(np.linalg.norm(self.points_mm[-1] - self.points_mm[0]))

    @property
    def distance_mm(self) -> float:
        """Distance of its nearest point from the sensor, mm."""
        return float(np.linalg.norm(self.points_mm, axis=1).min())


def find_segments(
    scan: LaserScan, *, sigma: Sigma = XV11_SIGMA, max_mm: float = TRUSTED_MM, least_beams: int = LEAST_BEAMS
) -> list[Segment]:
    """Cut a scan where its range jumps, and tell objects from walls.

    Parameters
    ----------
    scan : LaserScan
        A turn, or the average of several.
    sigma : callable
        Standard deviation (mm) of a single reading at ranges in mm.
    max_mm : float
        What is farther makes no segment, and is only taken to lie behind one.
    least_beams : int
        What fewer beams meet is ``"small"``.

    Returns
    -------
    list of Segment
        Counter-clockwise.

    Raises
    ------
    ValueError
        If the scan has fewer than `least_beams` readings.

    Notes
    -----
    Beams ``step`` apart at ranges r1 < r2 lie on one surface where their points are nearer than
    ``r1 sin(step) / sin(grazing - step) + 3 (s1 + s2)``. A reading lost within a surface does not cut it.

    References
    ----------
    Borges and Aldon, "Line extraction in 2D range images for mobile robotics", J. Intell. Robot. Syst. 40, 2004.

    Examples
    --------
    >>> ranges = np.full(360, 2000.0)
    >>> ranges[80:100] = 700
    >>> [(part.kind, len(part.beams)) for part in find_segments(LaserScan(ranges, np.ones(360)))]
    [('wall', 340), ('object', 20)]
    """
    r = scan.ranges_mm
    valid = np.flatnonzero(np.isfinite(r))
    if len(valid) < least_beams:
        raise ValueError(f"the scan has {len(valid)} readings: nothing to find. Check the sensor and its range")
    deviation = _sigma_mm(scan, sigma)
    p = points_mm(scan, keep_invalid=True)
    closed = abs(len(r) * scan.angle_increment_rad - 2 * np.pi) < 0.5 * scan.angle_increment_rad
    last = np.flatnonzero(_cuts(scan, valid, deviation, closed))
    parts = []
    for begin, end in zip(np.roll(last, 1), last, strict=True):
        count = int((end - begin - 1) % len(valid)) + 1
        members = valid[(begin + 1 + np.arange(count)) % len(valid)]
        if np.min(r[members]) > max_mm:
            continue
        right, left = (_end(scan, valid, at, sign, closed) for at, sign in ((int(begin) + 1, -1), (int(end), 1)))
        hidden = right[1], left[1]
        extent = np.linalg.norm(np.ptp(p[members], axis=0))
        kind = "small" if count < least_beams else "object"
        kind = "wall" if extent > _LARGEST_OBJECT_MM or all(hidden) else kind
        outwards = np.arange(1, min(_BEYOND, len(valid) - count) + 1)
        beyond = p[valid[(begin + 1 - outwards) % len(valid)]], p[valid[(end + outwards) % len(valid)]]
        parts.append(Segment(kind, members, p[members], deviation[members], (right[0], left[0]), beyond, hidden))
    return parts


def _cuts(scan: LaserScan, valid: Ints, deviation: Float64, closed: bool) -> Bools:
    """Whether a surface ends between each valid reading and the next one; at least one does."""
    r, p = scan.ranges_mm, points_mm(scan, keep_invalid=True)
    after = np.roll(valid, -1)
    steps = (after - valid) % len(r) * scan.angle_increment_rad
    nearer = np.minimum(r[valid], r[after])
    slope = np.sin(np.maximum(_GRAZING_RAD - steps, _LEAST_ANGLE_RAD))
    noise = _DEVIATIONS * (deviation[valid] + deviation[after])
    allowed = nearer * np.sin(np.minimum(steps, _LONGEST_STEP_RAD)) / slope + noise
    jumps = np.linalg.norm(p[after] - p[valid], axis=1)
    cut: Bools = (jumps > allowed) | (steps > _LOST_BEAMS * scan.angle_increment_rad)
    if not closed:
        cut[-1] = True
    if not cut.any():
        cut[int(np.argmax(jumps))] = True
    return cut


def _end(scan: LaserScan, valid: Ints, at: int, sign: int, closed: bool) -> tuple[tuple[float, float], bool]:
    """Angles between which a surface ends on the left (1) or right (-1) of its reading `at`, and if it is hidden."""
    own, other = valid[at % len(valid)], valid[(at + sign) % len(valid)]
    step = scan.angle_increment_rad
    is_last = not closed and own == valid[-1 if sign > 0 else 0]
    turn = step if is_last else (sign * (other - own)) % len(scan.ranges_mm) * step
    angle = scan.angle_min_rad + own * step
    low, high = sorted((float(angle), float(angle + sign * turn)))
    return (low, high), bool(is_last or scan.ranges_mm[other] < scan.ranges_mm[own])


def _sigma_mm(scan: LaserScan, sigma: Sigma) -> Float64:
    """Standard deviation of the scan's readings: less by averaging, never below what rounding to millimetres leaves."""
    single: Float64 = np.hypot(sigma(np.nan_to_num(scan.ranges_mm)), QUANTISATION_MM)
    if not isinstance(scan, AveragedScan):
        return single
    # The median of n normal readings scatters by sqrt(pi / 2 n).
    averaged = single * np.sqrt(np.where(scan.count > 2, np.pi / 2, 1.0) / np.maximum(scan.count, 1))
    return np.asarray(np.hypot(averaged, QUANTISATION_MM / np.sqrt(np.maximum(scan.count, 1))))
