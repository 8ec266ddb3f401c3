"""A pair and a scan to objects: recordings of known truth, and everything that can be wrong with the input."""

from __future__ import annotations

import re

import cv2
import numpy as np
import pytest
from support.instruments import INSTRUMENT, RECT, SENSOR
from support.measured import measured, the_cube

from stereolib import laser
from stereolib.measurement import draw_objects, floor_from_pose, measure_objects
from stereolib.rig import rigid
from stereolib.virtual import cube_scene, recordings


@pytest.mark.parametrize("name", ["conditions/texture", "series/medium_600", "series/fine_800", "series/coarse_700"])
def test_the_recorded_cube_within_its_deviations(name):
    thing = the_cube(measured(name, name))
    assert thing.shape == "box" and np.abs(thing.size_mm - 300).max() < 3
    assert (np.abs(thing.size_mm - 300) < 3 * thing.std_mm).all() and thing.std_mm.max() < 3
    volume, std = thing.volume_l
    assert abs(volume - 27) < 3 * std < 1
    distance = {"conditions/texture": 700}.get(name) or int(name.split("_")[1])
    np.testing.assert_allclose(thing.position_mm, [distance + 150 * np.sqrt(2), 0], atol=3)
    assert np.degrees(thing.yaw_rad) % 90 == pytest.approx(45, abs=0.5)


def test_without_a_scan_the_pair_alone_measures():
    thing = the_cube(measured(scan=None))
    np.testing.assert_allclose(thing.size_mm, 300, atol=3)
    assert thing.sources["lines"] == "image" and not thing.reasons


def test_a_scan_without_an_object_is_said():
    found = measured(scan="empty")
    assert "the scan shows no object within 3 m" in found.warnings[0]
    np.testing.assert_allclose(the_cube(found).size_mm, 300, atol=3)


def test_a_scan_of_another_moment_is_said_with_both_distances():
    found = measured(scan="series/medium_1000")
    assert re.search(r"at 100\d mm and the pair at 70\d mm: were they taken at the same time", " ".join(found.warnings))
    np.testing.assert_allclose(the_cube(found).size_mm, 300, atol=3)
    near = measured("series/medium_700", "series/medium_800")
    assert any("disagree about the distance" in text for text in near.warnings)


def blank(scan):
    grey = np.full((480, 640, 3), 128, np.uint8)
    return measure_objects(grey, grey, scan, INSTRUMENT, rng=np.random.default_rng(0))


def test_no_floor_leaves_what_the_scan_tells():
    found = blank(recordings.scan("conditions/texture"))
    assert found.floor is None and found.warnings[0].startswith("no floor") and "scan's alone" in found.warnings[0]
    thing = the_cube(found)
    assert np.isnan(thing.size_mm[2]) and thing.reasons["height"].startswith("no floor")
    assert (np.abs(thing.size_mm - 300)[:2] < 3 * thing.std_mm[:2]).all() and thing.sources["left end"] == "scan"
    np.testing.assert_array_equal(draw_objects(found), found.left)


def test_no_floor_and_no_scan_is_refused():
    with pytest.raises(ValueError, match="no floor"):
        blank(None)


def test_glare_is_refused_not_guessed():
    thing = the_cube(measured("conditions/glare", "conditions/glare"))
    assert np.isnan(thing.size_mm).all() and "irregular" in thing.reasons["length"]


def test_a_plain_cube_is_not_measured_in_height():
    thing = the_cube(measured("conditions/plain", "conditions/plain"))
    assert np.isnan(thing.size_mm[2]) and thing.reasons["height"]


def test_a_known_floor_is_taken():
    floor = floor_from_pose(RECT, recordings.setup())
    found = measured(floor=floor)
    assert found.floor is floor
    np.testing.assert_allclose(the_cube(found).size_mm, 300, atol=3)
    lower = recordings.setup() @ rigid(np.eye(3), [0.0, 0.0, -12.0])  # it is believed: heights grow with it
    found = measured(floor=floor_from_pose(RECT, lower))
    np.testing.assert_allclose(the_cube(found).size_mm[2], 312, atol=3)


def test_what_lies_beside_the_picture_is_told_from_the_scan():
    data = SENSOR.scan(cube_scene(700.0, lateral_mm=900.0), recordings.LASER_POSE, np.random.default_rng(3), turns=5)
    scan = laser.average(laser.turns(laser.decode(data)))
    found = measure_objects(*recordings.load_pair("conditions/texture"), scan, INSTRUMENT, rng=np.random.default_rng(0))
    aside = max(found.objects, key=lambda thing: thing.position_mm[1])
    assert "outside the picture" in aside.reasons["height"]


def test_pictures_of_another_size_are_refused():
    small = [cv2.resize(image, (320, 240)) for image in recordings.load_pair("conditions/texture")]
    with pytest.raises(ValueError, match=r"320x240.*640x480"):
        measure_objects(*small, None, INSTRUMENT, rng=np.random.default_rng(0))


def test_a_laser_nobody_calibrated_is_assumed_below_the_camera():
    found = measured(lidar=None)
    assert "straight below the left camera" in found.warnings[0]
    np.testing.assert_allclose(the_cube(found).size_mm, 300, atol=3)
