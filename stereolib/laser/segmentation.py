"""Objects and walls in a scan: cut where the range jumps, then told apart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from stereolib.base import Bools, Float64, Ints
from stereolib.laser.error_model import QUANTISATION_MM, SigmaFit
from stereolib.laser.points import Rays, points_mm, rays
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
    rays : Rays
        Where each beam starts and where it goes, in the laser's plane.
    points_mm : (N, 2) float64
        What they meet, in the laser's plane, mm.
    sigma_mm : (N,) float64
        Standard deviation of each reading along its beam, mm.
    outwards : (right, left), each Rays
        At either end the last beam that meets the surface, then the next ones past it; `bounds` has the first two.
    beyond_mm : (right, left), each (M, 2) float64
        What the beams past either end met, outwards: what lies beside or behind.
    hidden : (right, left) bool
        Something nearer stands at that end: the surface may go on behind it.
    """

    kind: str
    beams: Ints
    rays: Rays
    points_mm: Float64
    sigma_mm: Float64
    outwards: tuple[Rays, Rays]
    beyond_mm: tuple[Float64, Float64]
    hidden: tuple[bool, bool]

    @property
    def bounds(self) -> tuple[Rays, Rays]:
        """The two beams between which the surface ends, on the right and on the left: the last on it, the next off it.

        For a line ``n . p = c`` they meet ``bounds[side].meet(n, c)``, between which its end lies.
        """
        return self.outwards[0][:2], self.outwards[1][:2]

    @property
    def extent_mm(self) -> float:
        """Distance of its first point from its last, mm."""
        return float(np.linalg.norm(self.points_mm[-1] - self.points_mm[0]))

    @property
    def distance_mm(self) -> float:
        """Distance of its nearest point from the sensor's axis, mm."""
        return float(np.linalg.norm(self.points_mm, axis=1).min())

    def without_last(self, end: int) -> Segment:
        """Leave out its last beam at one end, which met something beside or behind the rest.

        Parameters
        ----------
        end : int
            0: right, 1: left.

        Returns
        -------
        Segment
        """
        kept, left_out = (slice(1, None), 0) if end == 0 else (slice(None, -1), -1)
        rays, beams, before = self.rays[kept], self.rays, self.outwards[end]
        last = [1, 0] if end == 0 else [-2, -1]
        outwards, beyond, hidden = list(self.outwards), list(self.beyond_mm), list(self.hidden)
        outwards[end] = Rays(
            np.concatenate([beams.origins_mm[last], before.origins_mm[1:]]),
            np.concatenate([beams.directions[last], before.directions[1:]]),
        )
        beyond[end] = np.concatenate([self.points_mm[left_out][None], beyond[end]])
        hidden[end] = False
        return replace(
            self,
            beams=self.beams[kept],
            rays=rays,
            points_mm=self.points_mm[kept],
            sigma_mm=self.sigma_mm[kept],
            outwards=(outwards[0], outwards[1]),
            beyond_mm=(beyond[0], beyond[1]),
            hidden=(hidden[0], hidden[1]),
        )


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
        met = f"{len(valid)} of the scan's {len(r)} beams met something, {least_beams} are needed"
        raise ValueError(f"{met}: see that the sensor turns, that its window is clean, and something is within range")
    deviation, p = _sigma_mm(scan, sigma), points_mm(scan, keep_invalid=True)
    last = np.flatnonzero(_cuts(scan, valid, deviation))
    parts = []
    for begin, end in zip(np.roll(last, 1), last, strict=True):
        count = int((end - begin - 1) % len(valid)) + 1
        members = valid[(begin + 1 + np.arange(count)) % len(valid)]
        if np.min(r[members]) > max_mm:
            continue
        others = len(valid) - count
        right, left = (_end(scan, valid, at, sign, others) for at, sign in ((int(begin) + 1, -1), (int(end), 1)))
        hidden = right[2], left[2]
        extent = np.linalg.norm(np.ptp(p[members], axis=0))
        kind = "small" if count < least_beams else "object"
        kind = "wall" if extent > _LARGEST_OBJECT_MM or all(hidden) else kind
        outwards, beyond = (rays(scan, right[0]), rays(scan, left[0])), (p[right[1]], p[left[1]])
        own = rays(scan, members), p[members], deviation[members]
        parts.append(Segment(kind, members, *own, outwards, beyond, hidden))
    return parts


def _cuts(scan: LaserScan, valid: Ints, deviation: Float64) -> Bools:
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
    if not _is_closed(scan):
        cut[-1] = True
    if not cut.any():
        cut[int(np.argmax(jumps))] = True
    return cut


def _is_closed(scan: LaserScan) -> bool:
    """Whether the last beam is the first one's neighbour."""
    step = scan.angle_increment_rad
    return abs(len(scan.ranges_mm) * step - 2 * np.pi) < 0.5 * step


def _end(scan: LaserScan, valid: Ints, at: int, sign: int, others: int) -> tuple[Ints, Ints, bool]:
    """Where a surface ends on the left (1) or right (-1) of its reading `at`; `others` are readings of other surfaces.

    The numbers of its last beam and the next ones outwards, of those that met another surface, and if it is hidden.
    """
    positions = at % len(valid) + sign * np.arange(1 + _BEYOND)
    if not _is_closed(scan):
        positions = positions[(positions >= 0) & (positions < len(valid))]
    numbers = valid[positions % len(valid)]
    if len(numbers) == 1:  # the scan ends here, one step on
        return np.append(numbers, numbers + sign), numbers[1:], True
    beyond = numbers[1:][:others]
    hidden = scan.ranges_mm[numbers[1]] < scan.ranges_mm[numbers[0]]
    return numbers[: 1 + max(len(beyond), 1)], beyond, bool(hidden)


def _sigma_mm(scan: LaserScan, sigma: Sigma) -> Float64:
    """Standard deviation of the scan's readings: less by averaging, never below what rounding to millimetres leaves."""
    single: Float64 = np.hypot(sigma(np.nan_to_num(scan.ranges_mm)), QUANTISATION_MM)
    if not isinstance(scan, AveragedScan):
        return single
    # The median of n normal readings scatters by sqrt(pi / 2 n).
    averaged = single * np.sqrt(np.where(scan.count > 2, np.pi / 2, 1.0) / np.maximum(scan.count, 1))
    return np.asarray(np.hypot(averaged, QUANTISATION_MM / np.sqrt(np.maximum(scan.count, 1))))
