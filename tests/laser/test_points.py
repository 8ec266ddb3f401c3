"""Points in the laser's plane, with and without the offset of its emitter."""

import numpy as np

from stereolib import laser


def scan(ranges_mm, **kwargs):
    ranges = np.asarray(ranges_mm, float)
    return laser.LaserScan(ranges, np.full(len(ranges), 100.0), **kwargs)


def test_points():
    ranges = np.full(360, np.nan)
    ranges[[0, 90, 180]] = 1000, 2000, 500
    np.testing.assert_allclose(laser.points_mm(scan(ranges)), [[1000, 0], [0, 2000], [-500, 0]], atol=1e-9)
    assert laser.points_mm(scan(ranges), keep_invalid=True).shape == (360, 2)
    side = 25 * np.array([np.cos(np.deg2rad(-82)), np.sin(np.deg2rad(-82))])
    np.testing.assert_allclose(laser.points_mm(scan(ranges), geometry_correction=True)[0], [1000 + side[0], side[1]])
