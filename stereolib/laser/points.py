"""Points in the laser's plane, from a scan's ranges and the place where the light leaves the sensor."""

from __future__ import annotations

import numpy as np

from stereolib.base import Float64, direction
from stereolib.laser.scans import LaserScan

#: Where the light leaves the sensor: so far from its axis, and so far clockwise of the beam.
EMITTER_OFFSET_MM, EMITTER_ANGLE_RAD = 25.0, float(np.deg2rad(82.0))


def points_mm(scan: LaserScan, geometry_correction: bool = False, keep_invalid: bool = False) -> Float64:
    """Turn a scan into points in the laser's plane, x forward and y left.

    Parameters
    ----------
    scan : LaserScan
        One turn or an average.
    geometry_correction : bool
        Measure from where the beam leaves the sensor, not from its axis.
    keep_invalid : bool
        Keep beams without a reading as NaN rows, so that N = 360.

    Returns
    -------
    (N, 2) float64, mm

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

    Examples
    --------
    >>> ranges = np.full(360, np.nan)
    >>> ranges[90] = 2000
    >>> points_mm(LaserScan(ranges, np.ones(360))).round(6)
    array([[   0., 2000.]])
    """
    points = scan.ranges_mm[:, None] * direction(scan.angles_rad)
    if geometry_correction:
        points += EMITTER_OFFSET_MM * direction(scan.angles_rad - EMITTER_ANGLE_RAD)
    return points if keep_invalid else points[np.isfinite(scan.ranges_mm)]
