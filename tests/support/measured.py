"""Recordings measured once, and the cube among what was found in them."""

from __future__ import annotations

from functools import cache

import numpy as np

from stereolib import laser
from stereolib.measurement import Instrument, measure_objects
from stereolib.virtual import recordings
from support.instruments import LIDAR, RECT


def empty_scan() -> laser.LaserScan:
    return laser.LaserScan(np.full(360, 4500.0), np.full(360, 100.0))


@cache
def measured(name="conditions/texture", scan="conditions/texture", floor=None, lidar=LIDAR):
    readings = scan and (empty_scan() if scan == "empty" else recordings.scan(scan))
    pair = recordings.load_pair(name)
    return measure_objects(*pair, readings, Instrument(RECT, lidar), floor=floor)


def the_cube(found):
    return min(found.objects, key=lambda thing: abs(np.hypot(*thing.position_mm) - 912))
