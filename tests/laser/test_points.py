"""Points in the laser's plane, with and without the offset of its emitter."""

from dataclasses import replace

import numpy as np

from stereolib import laser


def scan(ranges_mm, **kwargs):
    ranges = np.asarray(ranges_mm, float)
    return laser.LaserScan(ranges, np.full(len(ranges), 100.0), **kwargs)


def test_points():
    ranges = np.full(360, np.nan)
    ranges[[0, 90, 180]] = 1000, 2000, 500
    plain = scan(ranges, emitter_offset_mm=0.0)
    np.testing.assert_allclose(laser.points_mm(plain), [[1000, 0], [0, 2000], [-500, 0]], atol=1e-9)
    assert laser.points_mm(plain, keep_invalid=True).shape == (360, 2)
    ahead, aside = 25 * np.cos(np.deg2rad(82)), 25 * np.sin(np.deg2rad(82))  # of the beam, to its right
    expected = [[1000 + ahead, -aside], [aside, 2000 + ahead], [-500 - ahead, aside]]
    np.testing.assert_allclose(laser.points_mm(scan(ranges)), expected, atol=1e-9)


def test_the_emitter_stays_with_what_is_made_of_a_scan():
    plain = scan(np.full(360, 1000.0), emitter_offset_mm=0.0)
    readings = laser.Readings.build(np.arange(90), np.full((90, 4), 1000))
    for made in (laser.gate(plain), laser.average([plain]), laser.turns(readings, emitter_offset_mm=0.0)[0]):
        np.testing.assert_allclose(np.linalg.norm(laser.points_mm(made), axis=1), 1000)
    (turn,) = laser.turns(readings)
    assert (turn.emitter_offset_mm, turn.emitter_angle_rad) == (25.0, np.deg2rad(-82))


def test_rays_meet_lines_where_the_points_lie():
    """Points made of ranges to a line lie on it, and the beams meet it there, wherever they start."""
    normal, offset = np.array([0.8, 0.6]), 700.0
    for offset_mm in (0.0, 25.0, 60.0):
        sensor = scan(np.full(360, 1.0), emitter_offset_mm=offset_mm)
        beams = laser.rays(sensor, np.arange(0, 80))
        met = beams.meet(normal, offset)
        np.testing.assert_allclose(met @ normal, offset)
        ranges = np.full(360, np.nan)
        ranges[:80] = np.linalg.norm(met - beams.origins_mm, axis=1)
        np.testing.assert_allclose(laser.points_mm(replace(sensor, ranges_mm=ranges)), met)
    assert len(laser.rays(sensor)) == 360
    past, within = (laser.rays(sensor, np.array(numbers)) for numbers in ([-1, 360], [359, 0]))
    np.testing.assert_allclose(past.origins_mm, within.origins_mm, atol=1e-9)
