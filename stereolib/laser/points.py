"""From ranges to the laser's plane: where each beam starts, where it goes, and what it meets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stereolib.base import Float64, Ints, direction
from stereolib.laser.scans import LaserScan

_LEAST_COSINE = 0.02  # between a beam and a normal: flatter beams meet the line too far away to tell


@dataclass(frozen=True, eq=False)
class Rays:
    """Beams in the laser's plane, x forward and y left.

    Attributes
    ----------
    origins_mm : (N, 2) float64
        Where the light leaves the sensor.
    directions : (N, 2) float64
        Unit vectors.
    """

    origins_mm: Float64
    directions: Float64

    def __len__(self) -> int:
        return len(self.origins_mm)

    def __getitem__(self, some: Any) -> Rays:
        """Some of the beams: a slice, a mask or numbers."""
        return Rays(self.origins_mm[some], self.directions[some])

    def at(self, ranges_mm: Float64) -> Float64:
        """Go so far along each beam.

        Parameters
        ----------
        ranges_mm : (N,) float64

        Returns
        -------
        (N, 2) float64, mm
        """
        return np.asarray(self.origins_mm + ranges_mm[:, None] * self.directions)

    def placed(self, R: Float64, t: Float64) -> Rays:
        """Put the beams into another frame, ``p' = R p + t``.

        Parameters
        ----------
        R : (2, 2) float64
        t : (2,) float64, mm

        Returns
        -------
        Rays
        """
        return Rays(self.origins_mm @ R.T + t, self.directions @ R.T)

    def meet(self, normal: Float64, offset_mm: float) -> Float64:
        """Find where the beams meet the line ``normal @ p = offset_mm``.

        Parameters
        ----------
        normal : (2,) float64
            Unit normal, away from the sensor.
        offset_mm : float

        Returns
        -------
        (N, 2) float64, mm

        Notes
        -----
        ``p = o + b (c - n . o) / (n . b)``; beams that only graze the line (``n . b < 0.02``), or run away from it,
        meet it very far away.

        Examples
        --------
        >>> beams = rays(LaserScan(np.full(360, 700.0), np.ones(360), emitter_offset_mm=0.0))
        >>> beams[[0, 45]].meet(np.array([1.0, 0.0]), 500.0).round(6)
        array([[500.,   0.],
               [500., 500.]])
        """
        distance = offset_mm - self.origins_mm @ normal
        return self.at(distance / np.maximum(self.directions @ normal, _LEAST_COSINE))


def rays(scan: LaserScan, beams: Ints | None = None) -> Rays:
    """Tell where beams of a scan start and where they go.

    Parameters
    ----------
    scan : LaserScan
    beams : (N,) int, optional
        Their numbers, which may lie past the scan's ends; by default every one, with or without a reading.

    Returns
    -------
    Rays

    Notes
    -----
    The light of an XV-11 leaves it 25 mm beside the axis of rotation, 82 degrees clockwise from the beam::

        o = 25 (cos(a - 82 deg), sin(a - 82 deg))        b = (cos a, sin a)

    The numbers are those of the Revo LDS that became the XV-11. The sign is the XV-11's: the other one bends the walls
    of the real recording more than no correction does.

    References
    ----------
    Konolige et al., "A low-cost laser distance sensor", ICRA 2008; US patent 8,996,172; bmegli/ev3dev-mapping, issue
    4, for the sign.

    Examples
    --------
    >>> rays(LaserScan(np.full(360, 700.0), np.ones(360))).origins_mm[0].round(1)
    array([  3.5, -24.8])
    """
    numbers = np.arange(len(scan.ranges_mm)) if beams is None else beams
    angles = np.asarray(scan.angle_min_rad + numbers * scan.angle_increment_rad, np.float64)
    return Rays(scan.emitter_offset_mm * direction(angles + scan.emitter_angle_rad), direction(angles))


def points_mm(scan: LaserScan, *, keep_invalid: bool = False) -> Float64:
    """Turn a scan into points in the laser's plane, x forward and y left.

    Parameters
    ----------
    scan : LaserScan
        One turn or an average; it carries where its sensor's light starts (see `rays`).
    keep_invalid : bool
        Keep beams without a reading as NaN rows, so that N = 360.

    Returns
    -------
    (N, 2) float64, mm

    Examples
    --------
    >>> ranges = np.full(360, np.nan)
    >>> ranges[90] = 2000
    >>> points_mm(LaserScan(ranges, np.ones(360))).round(1)
    array([[  24.8, 2003.5]])
    >>> points_mm(LaserScan(ranges, np.ones(360), emitter_offset_mm=0.0)).round(1)
    array([[   0., 2000.]])
    """
    points = rays(scan).at(scan.ranges_mm)
    return points if keep_invalid else points[np.isfinite(scan.ranges_mm)]
