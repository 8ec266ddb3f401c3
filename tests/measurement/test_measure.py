"""A pair and a scan to objects: recordings of known truth, and everything that can be wrong with the input."""

from __future__ import annotations

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.disturbed import exposed
from support.instruments import INSTRUMENT, LIDAR, RECT, SENSOR
from support.measured import measured, the_cube
from support.pictured import rendered

from stereolib import laser
from stereolib.measurement import (
    Instrument,
    Reason,
    Source,
    SystematicUncertainty,
    disagreement,
    draw_objects,
    floor_from_pose,
    measure_objects,
)
from stereolib.measurement.measure import measure_standing
from stereolib.measurement.reasons import ScanFit
from stereolib.measurement.standing import see_standing
from stereolib.measurement.things import scanned_parts
from stereolib.paper import rig_pose
from stereolib.rig import rigid
from stereolib.virtual import cube_scene, recordings


def scan_of(name="conditions/texture"):
    return recordings.scan(name)


def turned(yaw_deg, sideways_mm=0.0, seed=3):
    """A scan of the recorded cube by a laser that was moved."""
    pose = np.add(recordings.LASER_POSE, (0.0, sideways_mm, np.radians(yaw_deg)))
    data = SENSOR.scan(cube_scene(700.0), tuple(pose), np.random.default_rng(seed), turns=5)
    return laser.average(laser.turns(laser.decode(data)))


def texture(scan, **how):
    return measure_objects(*recordings.load_pair("conditions/texture"), scan, INSTRUMENT, **how)


@pytest.mark.parametrize("name", ["conditions/texture", "series/medium_600", "series/fine_800", "series/coarse_700"])
def test_the_recorded_cube_within_its_deviations(name):
    found = measured(name, name)
    thing = the_cube(found)
    assert thing.shape == "box" and np.abs(thing.size_mm - 300).max() < 2 and found.warnings == ()
    assert (np.abs(thing.size_mm - 300) < 3 * thing.std_mm).all() and thing.std_mm.max() < 3
    volume, std = thing.volume_l
    assert abs(volume - 27) < 3 * std < 1
    distance = {"conditions/texture": 700}.get(name) or int(name.split("_")[1])
    np.testing.assert_allclose(thing.position_mm, [distance + 150 * np.sqrt(2), 0], atol=2)
    assert np.degrees(thing.yaw_rad) % 90 == pytest.approx(45, abs=0.5)
    assert thing.sources["lines"] is Source.BOTH and thing.sources["height"] is Source.IMAGE
    assert thing.reasons == {}


def test_what_the_scan_shows_besides_the_cube_stands_behind_it():
    footprints, others_mm, none = scanned_parts(scan_of(), 1.0)
    assert len(footprints) == 1 and none == ""
    assert len(others_mm) > 100 and np.linalg.norm(others_mm, axis=1).min() > np.linalg.norm(footprints[0].centre_mm)


def test_without_a_scan_the_pair_alone_measures():
    found = measured(scan=None)
    thing = the_cube(found)
    np.testing.assert_allclose(thing.size_mm, 300, atol=2)
    assert thing.sources["lines"] is Source.IMAGE and not thing.reasons
    assert found.scan_mm.shape == (0, 2)


def test_what_the_calibration_leaves_open_of_the_scale_is_in_the_sizes():
    """A baseline known to 1 %: no picture tells more of the sizes; the height's is that of the camera's, too."""
    pair, share = recordings.load_pair("conditions/texture"), 0.01
    unsure = SystematicUncertainty(baseline_mm=share * RECT.baseline_mm)
    sure, vague = (
        the_cube(measure_objects(*pair, None, Instrument(RECT, uncertainty=known)))
        for known in (SystematicUncertainty(), unsure)
    )
    added = np.sqrt(vague.std_mm**2 - sure.std_mm**2)
    assert added == pytest.approx(share * sure.size_mm, rel=0.15)


def test_a_scan_adds_to_what_is_known():
    """But for the chance that the cameras have turned, which a scan alone can tell of: that counts only with it."""
    alone, both = the_cube(measured(scan=None)), the_cube(measured())
    assert (both.std_mm <= alone.std_mm * [1.01, 1.01, 1.1]).all()


def test_a_scan_without_an_object_is_said():
    found = measured(scan="empty")
    assert "the scan shows no object within 3 m" in found.warnings[0]
    np.testing.assert_allclose(the_cube(found).size_mm, 300, atol=2)
    assert not the_cube(found).reasons


@pytest.mark.parametrize("readings", [np.zeros(360), np.full(360, np.nan), np.r_[700.0, 700.0, np.zeros(358)]])
def test_a_scan_that_tells_nothing_leaves_the_pair(readings):
    """The sensor did not turn, or its window is covered."""
    found = texture(laser.LaserScan(np.where(readings > 0, readings, np.nan), np.ones(360)))
    assert re.match(r"the scan tells nothing.*pair alone: [02] of the scan's 360 beams.*see that", found.warnings[0])
    assert re.search(r"turned sideways since its calibration.* by 1\.0 %", found.warnings[1])
    assert len(found.warnings) == 2
    np.testing.assert_allclose(the_cube(found).size_mm, 300, atol=2)


@pytest.mark.parametrize("noise", [5.0, 10.0])
def test_a_scan_noisier_than_any_laser_takes_no_size_away(noise):
    """The faces are lost in its noise; the pair has them."""
    worse = replace(SENSOR, sigma_mm=SENSOR.sigma_mm * noise, sigma_per_mm=SENSOR.sigma_per_mm * noise)
    data = worse.scan(cube_scene(700.0), recordings.LASER_POSE, np.random.default_rng(4), turns=5)
    thing, alone = the_cube(texture(laser.average(laser.turns(laser.decode(data))))), the_cube(measured(scan=None))
    np.testing.assert_allclose(thing.size_mm, alone.size_mm)
    np.testing.assert_allclose(thing.std_mm, alone.std_mm)
    assert thing.shape == "box" and thing.sources["lines"] is Source.IMAGE
    assert thing.reasons["object"].reason is Reason.SCAN_IRREGULAR


def test_a_scan_of_another_moment_is_said_and_dropped():
    found, alone = measured(scan="series/medium_1000"), the_cube(measured(scan=None))
    assert re.search(
        r"at 10\d\d mm and the pair at 70\d mm: were they taken at the same time", " ".join(found.warnings)
    )
    np.testing.assert_allclose(min(found.objects, key=lambda thing: thing.position_mm[0]).size_mm, alone.size_mm)


def test_a_scan_of_the_cube_a_little_farther_changes_no_size():
    """The cube was moved by 100 mm between pair and scan: as if the laser stood elsewhere, or it is dropped."""
    found, alone = measured("series/medium_700", "series/medium_800"), the_cube(measured("series/medium_700", None))
    assert any("laser has moved" in text or "disagree" in text for text in found.warnings)
    off = the_cube(found).size_mm - alone.size_mm
    assert (np.abs(off) < 2 * alone.std_mm).all()


def test_a_scan_of_a_smaller_cube_in_its_place_is_said_and_dropped():
    """Its faces lie on the same lines; that they end sooner tells that it is another."""
    smaller = cube_scene(700.0, size_mm=(200.0, 200.0, 300.0))
    data = SENSOR.scan(smaller, recordings.LASER_POSE, np.random.default_rng(3), turns=5)
    found, alone = texture(laser.average(laser.turns(laser.decode(data)))), the_cube(texture(None))
    assert found.warnings[-1] == disagreement(the_cube(found)) and "run calibrate-laser" in found.warnings[-1]
    assert the_cube(found).sources["lines"] is Source.IMAGE
    np.testing.assert_allclose(the_cube(found).size_mm, alone.size_mm, atol=1e-3)


@pytest.mark.parametrize(("yaw", "sideways"), [(2.0, 0.0), (-5.0, 0.0), (0.0, 30.0)])
def test_a_laser_that_has_moved_is_said_and_changes_no_size(yaw, sideways):
    found = texture(turned(yaw, sideways))
    (text,) = found.warnings
    assert text.startswith("the laser has moved since its calibration") and "calibrate it again" in text
    thing = the_cube(found)
    assert (np.abs(thing.size_mm - 300) < 3 * thing.std_mm).all() and np.abs(thing.size_mm - 300).max() < 2
    assert np.degrees(found.laser.yaw_rad) == pytest.approx(yaw, abs=1.0)


def test_sizes_change_without_a_jump_while_the_laser_is_turned():
    things = [the_cube(texture(turned(yaw))) for yaw in (0.0, 0.5, 1.0, 1.5)]
    sizes, std = np.array([thing.size_mm for thing in things]), np.array([thing.std_mm for thing in things])
    assert (np.abs(np.diff(sizes, axis=0)) < std[1:]).all()


def blank(scan, level=128):
    grey = np.full((480, 640, 3), level, np.uint8)
    return measure_objects(grey, grey, scan, INSTRUMENT)


@pytest.mark.parametrize("level", [0, 128])
def test_no_floor_leaves_what_the_scan_tells(level):
    found = blank(scan_of(), level)
    assert found.floor is None and found.warnings[0].startswith("no floor") and "scan's alone" in found.warnings[0]
    thing = the_cube(found)
    assert np.isnan(thing.size_mm[2]) and thing.reasons["height"].reason is Reason.NO_FLOOR
    assert (np.abs(thing.size_mm - 300)[:2] < 3 * thing.std_mm[:2]).all()
    assert thing.sources == {"lines": Source.SCAN}
    np.testing.assert_array_equal(draw_objects(found), found.left)


@pytest.mark.parametrize("level", [0, 128, 255])
def test_no_floor_and_no_scan_is_refused(level):
    with pytest.raises(ValueError, match="no floor"):
        blank(None, level)


def test_dark_pictures_are_measured_or_the_reason_is_told():
    left, right = recordings.load_pair("conditions/texture")
    dim = measure_objects(*(exposed(picture, 0.1) for picture in (left, right)), scan_of(), INSTRUMENT)
    thing = the_cube(dim)
    told = np.isfinite(thing.size_mm)
    assert (np.abs(thing.size_mm - 300) < 4 * thing.std_mm)[told].all() and told[:2].all()
    assert told[2] or thing.reasons["height"].reason is Reason.NO_EDGE


@pytest.mark.parametrize("name", ["conditions/plain", "conditions/poor_light"])
def test_what_is_not_told_has_a_reason_and_nothing_wrong_is_told(name):
    for thing in measured(name, name).objects:
        told = np.isfinite(thing.size_mm)
        assert (np.abs(thing.size_mm - 300)[told] < 4 * thing.std_mm[told]).all()
        assert told[2] or "height" in thing.reasons or "object" in thing.reasons


def test_a_known_floor_is_taken():
    floor = floor_from_pose(RECT, recordings.setup())
    found = measured(floor=floor)
    assert found.floor is floor
    np.testing.assert_allclose(the_cube(found).size_mm, 300, atol=2)
    lower = recordings.setup() @ rigid(np.eye(3), [0.0, 0.0, -6.0])  # it is believed as far as the pictures let it
    cube = the_cube(measured(floor=floor_from_pose(RECT, lower)))
    assert 301 < cube.size_mm[2] < 308 and cube.size_mm[2] - 300 < 2 * cube.std_mm[2]


def test_what_lies_beside_the_picture_is_told_from_the_scan():
    data = SENSOR.scan(cube_scene(700.0, lateral_mm=900.0), recordings.LASER_POSE, np.random.default_rng(3), turns=5)
    found = texture(laser.average(laser.turns(laser.decode(data))))
    aside = max(found.objects, key=lambda thing: thing.position_mm[1])
    assert aside.reasons["height"].reason is Reason.NOT_IN_PICTURE
    cube = min(found.objects, key=lambda thing: thing.position_mm[1])
    assert cube.reasons["object"].reason is Reason.OTHERWISE_IN_SCAN and np.abs(cube.size_mm - 300).max() < 2


@pytest.mark.parametrize("scan", [True, False])
def test_of_a_box_held_in_the_air_no_size_is_told(scan):
    """Nor those that the scan would give: it is cut somewhere, and moves."""
    shown = rendered(700.0, (260.0, 260.0, 220.0), 30.0, up_mm=60.0)
    scene = cube_scene(700.0, size_mm=(260.0, 260.0, 220.0), yaw_rad=np.radians(30))  # cut by the laser's plane alike
    data = SENSOR.scan(scene, recordings.LASER_POSE, np.random.default_rng(3), turns=5)
    readings = laser.average(laser.turns(laser.decode(data))) if scan else None
    (thing,) = measure_standing(see_standing(shown.views, INSTRUMENT), readings).objects
    assert np.isnan(thing.size_mm).all() and thing.reasons["object"].reason is Reason.IN_THE_AIR
    assert thing.sources == {} and thing.reasons["length"].reason is Reason.NO_FACE  # whatever outline the scan has
    assert "59 mm above the floor" in str(thing.reasons["object"])


def test_pictures_of_another_size_are_refused():
    small = [cv2.resize(image, (320, 240)) for image in recordings.load_pair("conditions/texture")]
    with pytest.raises(ValueError, match=r"320x240.*640x480"):
        measure_objects(*small, None, INSTRUMENT)


def test_a_laser_nobody_calibrated_is_found_by_the_scene():
    found = measured(lidar=None)
    assert "straight below the left camera" in found.warnings[0]
    place = r"the objects place the laser \d+ ± \d+ mm (ahead|behind), \d+ ± \d+ mm to the (left|right), turned by "
    assert re.match(place + r"(?!-0\.0 )-?\d\.\d ± \d\.\d degrees", found.warnings[1])
    thing = the_cube(found)
    assert (np.abs(thing.size_mm - 300) < 3 * thing.std_mm).all() and thing.std_mm.max() < 3
    assert np.abs(found.laser.t).max() < 15 and abs(np.degrees(found.laser.yaw_rad)) < 1.5


@pytest.mark.parametrize("degrees", [20, 90, 180])
def test_a_scan_that_looks_elsewhere_is_left_out_of_a_laser_nobody_calibrated(degrees):
    pair, scan, unknown = recordings.load_pair("room/3"), scan_of("room/3"), Instrument(RECT)
    alone = measure_objects(*pair, None, unknown)
    found = measure_objects(*pair, replace(scan, ranges_mm=np.roll(scan.ranges_mm, degrees)), unknown)
    assert ("(stereolib check tells)? What it alone shows is left out" in " ".join(found.said)) and found.doubts
    assert found.scan_fit is ScanFit.OPPOSES and len(found.objects) == len(alone.objects)
    assert "0 where the cameras look" not in " ".join(measure_objects(*pair, scan, unknown).said)


def test_a_laser_calibrated_as_reading_too_far_tells_the_same():
    """The calibration knows the scale: no size changes, and nothing is said to have moved."""
    right = texture(scan_of())
    far = replace(scan_of(), ranges_mm=scan_of().ranges_mm * 1.03)
    known = replace(INSTRUMENT, lidar=replace(LIDAR, scale=1 - 1 / 1.03))
    found = measure_objects(*recordings.load_pair("conditions/texture"), far, known)
    np.testing.assert_allclose(the_cube(found).size_mm, the_cube(right).size_mm, atol=1e-3)
    np.testing.assert_allclose(found.scan_mm, right.scan_mm, atol=1e-3)
    assert [text.split(":")[0] for text in found.warnings] == [
        "the laser reads 2.9 % longer than the boards have it, more than such a laser errs",
        *(text.split(":")[0] for text in right.warnings),
    ]


@pytest.mark.parametrize("longer", [0.92, 1.08])
def test_a_scale_that_no_laser_has_is_told_of_one_that_nobody_calibrated(longer):
    """Squares told wrong make the cameras' scale so: which of both is right, nothing here tells."""
    pair, scan, unknown = recordings.load_pair("room/3"), scan_of("room/3"), Instrument(RECT)
    found = measure_objects(*pair, replace(scan, ranges_mm=longer * scan.ranges_mm), unknown)
    [text] = [text for text in found.warnings if "more than such a laser errs" in text]
    share = re.match(r"the laser reads (\d+\.\d) % (longer|shorter) than the pictures have it", text)
    assert share and float(share[1]) == pytest.approx(8, abs=0.8) and (share[2] == "longer") == (longer > 1)
    right = measure_objects(*pair, scan, unknown)
    assert not any("such a laser errs" in text for text in right.warnings)
    np.testing.assert_allclose(*(thing.objects[1].size_mm for thing in (found, right)), atol=0.5)


def test_a_scan_does_not_turn_the_cameras_farther_than_they_turn():
    """A calibrated laser that reads all 6 % too far: 3.2 px of all disparities would explain it."""
    pair, scan = recordings.load_pair("room/3"), scan_of("room/3")
    known = Instrument(RECT, LIDAR, SystematicUncertainty(f_px=0.5, baseline_mm=0.1, offset_px=0.2))
    found = measure_objects(*pair, replace(scan, ranges_mm=1.06 * scan.ranges_mm), known)
    alone = measure_objects(*pair, None, known)
    for thing, same in zip(found.objects[:2], alone.objects[:2], strict=True):
        np.testing.assert_allclose(thing.size_mm, same.size_mm, atol=1e-6)
        assert thing.disagrees
    assert found.scan_fit is ScanFit.OPPOSES and "cameras' scale is off" in found.warnings[-1]


def test_pictures_of_two_places_are_doubted():
    (left, _), (_, right) = recordings.load_pair("room/3"), recordings.load_pair("room/2")
    found = measure_objects(left, right, scan_of("room/3"), INSTRUMENT)
    assert any(re.match(r"only \d+ % of the pixels are found in both pictures", text) for text in found.warnings)


def test_a_pose_that_nobody_may_believe_hardly_matters():
    """Deviations of a kilometre: the laser is placed by the scene."""
    loose = replace(LIDAR, covariance=np.diag([1.0] * 3 + [1e12] * 3 + [1e4]))
    found = measure_objects(*recordings.load_pair("conditions/texture"), scan_of(), Instrument(RECT, loose))
    np.testing.assert_allclose(the_cube(found).size_mm, 300, atol=2)


def test_a_calibration_in_centimetres_is_told():
    tenth = replace(RECT, P2=RECT.P2 * np.array([[1, 1, 1, 0.1], [1, 1, 1, 1], [1, 1, 1, 1]]))
    pair = recordings.load_pair("conditions/texture")
    found = measure_objects(*pair, None, Instrument(tenth))
    assert any("9.3 mm apart" in text and "again with millimetres" in text for text in found.warnings)
    assert not any("mm apart" in text for text in measure_objects(*pair, None, Instrument(RECT)).warnings)


@pytest.mark.parametrize(("higher_mm", "told"), [(0.0, False), (5.0, True), (-5.0, True)])
def test_a_given_floor_that_is_not_the_one_seen_is_told_and_no_height_is_sure(higher_mm, told):
    pair = recordings.load_pair("conditions/texture")
    seen = measure_objects(*pair, None, INSTRUMENT).floor
    pose = rig_pose(RECT, pitch_rad=seen.pitch_rad, camera_height_mm=seen.camera_height_mm + higher_mm)
    found = measure_objects(*pair, None, INSTRUMENT, floor=floor_from_pose(RECT, pose))
    assert any("the given floor contradicts the pictures" in text for text in found.doubts) == told
    height_mm, std_mm = found.objects[0].size_mm[2], found.objects[0].std_mm[2]
    assert abs(height_mm - 300) < 2 * std_mm and (std_mm > 4) == told


def test_what_is_no_scan_or_no_instrument_is_refused_at_once():
    pair = recordings.load_pair("conditions/texture")
    with pytest.raises(TypeError, match="a LaserScan or None, and an Instrument; got Instrument and AveragedScan"):
        measure_objects(*pair, INSTRUMENT, scan_of())
    with pytest.raises(TypeError, match="takes a RectifiedRig"):
        Instrument(RECT.rig)
