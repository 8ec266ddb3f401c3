"""Lines and ends of one object from both sensors: without pictures, and without anything."""

from __future__ import annotations

import numpy as np
from support.boxes import FLOOR, HERE, the_footprint

from stereolib.measurement.fusion import Evidence, fuse
from stereolib.measurement.measured_object import from_faces


def test_without_pictures_the_ends_come_from_the_scan():
    fused = fuse((np.zeros((480, 640), np.float32),) * 2, FLOOR, Evidence(the_footprint(2)), laser=HERE)
    assert fused.sources == {"lines": "scan", "right end": "scan", "left end": "scan"}
    thing = from_faces(fused, (np.nan, np.nan), {}, 0.0, worst_std=0.1)
    assert (np.abs(thing.size_mm - [300, 200, 0])[:2] < 2 * thing.std_mm[:2]).all() and np.isnan(thing.size_mm[2])
    assert from_faces(fused, (np.nan, np.nan), {}, 0.0).reasons["length"].startswith("too uncertain: 189 ± 10 mm")


def test_nothing_straight_fuses_to_nothing():
    assert fuse((np.zeros((480, 640), np.float32),) * 2, FLOOR, Evidence()) is None
