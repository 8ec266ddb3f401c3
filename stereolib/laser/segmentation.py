"""Things in a scan: cut where the range jumps, and told from walls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stereolib.laser.error_model import SigmaFit
from stereolib.laser.scans import AveragedScan, LaserScan, points_mm

Array = np.ndarray
#: Noise of a single reading of one XV-11, ``a + b r^2``; `stereolib.lrf_error.fit_sigma` gives that of another.
XV11_SIGMA = SigmaFit("quadratic", 1.3, 1.2e-6, np.nan, np.nan, np.nan)
_BEYOND = 8  # readings past an end that are kept
_QUANTUM_MM = 1 / np.sqrt(12)


@dataclass(frozen=True, eq=False)
class Segment:
    """Neighbouring beams on one thing.

    Attributes
    ----------
    kind : str
        ``"object"``, ``"wall"`` (hidden at both ends by nearer things, or larger than an object), or ``"small"`` (too
        few beams).
    beams : (N,) int
        Their numbers in the scan, counter-clockwise.
    points_mm : (N, 2) float64
    sigma_mm : (N,) float64
        Standard deviation of each reading along its beam.
    gaps_rad : ((low, high), (low, high))
        Between these angles it ends on the right, and on the left.
    beyond_mm : (right, left), each (M, 2) float64
        The next readings past either end, outwards: what lies beside or behind.
    hidden : (right, left) bool
        Something nearer stands at that end: the thing may go on behind it.
    """

    kind: str
    beams: Array
    points_mm: Array
    sigma_mm: Array
    gaps_rad: tuple[tuple[float, float], tuple[float, float]]
    beyond_mm: tuple[Array, Array]
    hidden: tuple[bool, bool]

    @property
    def extent_mm(self) -> float:
        """Distance of its first point from its last, mm."""
        return float(np.linalg.norm(self.points_mm[-1] - self.points_mm[0]))

    @property
    def distance_mm(self) -> float:
        """Distance of its nearest point from the sensor, mm."""
        return float(np.linalg.norm(self.points_mm, axis=1).min())


def segments(
    scan: LaserScan,
    *,
    sigma: Callable[[Array], Array] = XV11_SIGMA,
    max_mm: float = 3000.0,
    max_extent_mm: float = 1000.0,
    grazing_rad: float = np.deg2rad(8.0),
    least_beams: int = 4,
    geometry_correction: bool = False,
) -> list[Segment]:
    """Cut a scan where its range jumps, and tell objects from walls.

    Parameters
    ----------
    scan : LaserScan
        A turn, or the average of several.
    sigma : callable
        Standard deviation (mm) of a single reading at ranges in mm.
    max_mm : float
        What is farther is not looked at, only taken to lie behind (the paper trusts 3 m).
    max_extent_mm : float
        What is larger is a wall.
    grazing_rad : float
        Flattest angle at which a face is still followed from beam to beam.
    least_beams : int
        What fewer beams meet is ``"small"``.
    geometry_correction : bool
        See `stereolib.lrf.points_mm`.

    Raises
    ------
    ValueError
        If the scan has fewer than `least_beams` readings.

    Notes
    -----
    Beams ``step`` apart at ranges r1 < r2 lie on one surface where their points are nearer than
    ``r1 sin(step) / sin(grazing - step) + 3 (s1 + s2)`` (Borges and Aldon, J. Intell. Robot. Syst. 40, 2004).
    A reading lost within a surface does not cut it.
    """
    r = scan.ranges_mm
    seen = np.flatnonzero(np.isfinite(r))
    if len(seen) < least_beams:
        raise ValueError(f"the scan has {len(seen)} readings: nothing to find. Check the sensor and its range")
    deviation = _sigma_mm(scan, sigma)
    p = points_mm(scan, geometry_correction, keep_invalid=True)
    beams = len(r)
    full = abs(beams * scan.angle_increment_rad - 2 * np.pi) < 0.5 * scan.angle_increment_rad
    after = np.roll(seen, -1)
    steps = (after - seen) % beams * scan.angle_increment_rad
    nearer = np.minimum(r[seen], r[after])
    room = np.maximum(grazing_rad - steps, np.radians(2.0))
    allowed = nearer * np.sin(np.minimum(steps, 0.2)) / np.sin(room) + 3 * (deviation[seen] + deviation[after])
    cut = (np.linalg.norm(p[after] - p[seen], axis=1) > allowed) | (steps > 4.5 * scan.angle_increment_rad)
    if not full:
        cut[-1] = True
    if not cut.any():
        cut[int(np.argmax(np.linalg.norm(p[after] - p[seen], axis=1)))] = True
    last = np.flatnonzero(cut)
    found = []
    for begin, end in zip(np.roll(last, 1), last, strict=True):
        count = int((end - begin - 1) % len(seen)) + 1
        members = seen[(begin + 1 + np.arange(count)) % len(seen)]
        if np.min(r[members]) > max_mm:
            continue
        first, final = members[0], members[-1]
        neighbours = seen[begin], after[end]
        gaps, hidden = [], []
        for own, other, sign in ((first, neighbours[0], -1), (final, neighbours[1], 1)):
            open_end = not full and ((sign < 0 and own == seen[0]) or (sign > 0 and own == seen[-1]))
            turn = (sign * (other - own)) % beams * scan.angle_increment_rad
            mine = scan.angle_min_rad + own * scan.angle_increment_rad
            gaps.append(tuple(sorted((mine, mine + sign * (scan.angle_increment_rad if open_end else turn)))))
            hidden.append(bool(open_end or r[other] < r[own]))
        extent = np.linalg.norm(np.ptp(p[members], axis=0))
        kind = "wall" if extent > max_extent_mm or all(hidden) else "object"
        kind = "small" if count < least_beams and kind == "object" else kind
        outwards = np.arange(1, min(_BEYOND, len(seen) - count) + 1)
        beyond = p[seen[(begin + 1 - outwards) % len(seen)]], p[seen[(end + outwards) % len(seen)]]
        found.append(
            Segment(kind, members, p[members], deviation[members], (gaps[0], gaps[1]), beyond, (hidden[0], hidden[1]))
        )
    return found


def _sigma_mm(scan: LaserScan, sigma: Callable[[Array], Array]) -> Array:
    """Standard deviation of the scan's readings: less by averaging, never below what the quantum leaves."""
    single = np.hypot(sigma(np.nan_to_num(scan.ranges_mm)), _QUANTUM_MM)
    if not isinstance(scan, AveragedScan):
        return single
    # The median of n normal readings scatters by sqrt(pi / 2 n).
    averaged = single * np.sqrt(np.where(scan.count > 2, np.pi / 2, 1.0) / np.maximum(scan.count, 1))
    return np.hypot(averaged, _QUANTUM_MM / np.sqrt(np.maximum(scan.count, 1)))
