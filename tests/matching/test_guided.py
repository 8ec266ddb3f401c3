"""The laser's search window: expectations against the analytic truth, maps against plain matching."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stereolib.laser import LaserScan
from stereolib.matching import SGBMParams, compute_disparity, compute_disparity_guided, expected_disparity, score
from stereolib.rig import pose_left_world
from stereolib.virtual import Scene, VirtualLidar, cube_scene, recordings, render_truth, room


def exact_scan(scene: Scene) -> LaserScan:
    ranges = VirtualLidar().truth_mm(scene, recordings.LASER_POSE)
    return LaserScan(ranges, np.full(360, 100.0))


def test_an_empty_room_is_expected_as_it_is():
    """Nothing stands free in it: floor and walls follow from the scan, whatever the camera's tilt."""
    scene = Scene((room(),))
    for pose in (recordings.setup(), recordings.setup("level")):
        found = expected_disparity(exact_scan(scene), recordings.rectified(), pose)
        true = render_truth(scene, recordings.rectified(), pose).disparity_px
        np.testing.assert_allclose(found.near_px, true, atol=0.6)
        assert np.abs(found.near_px - true).mean() < 0.05
        between = true.reshape(120, 4, 160, 4).mean(axis=(1, 3))
        np.testing.assert_allclose(found.room_px, between, atol=1.0)
        assert found.free is None


@pytest.mark.parametrize("distance", [500, 1000])
def test_the_cube_is_expected_and_what_stands_behind_it(distance):
    scene = cube_scene(float(distance))
    found = expected_disparity(exact_scan(scene), recordings.rectified(), recordings.setup())
    true = render_truth(scene, recordings.rectified(), recordings.setup())
    empty = render_truth(Scene((room(),)), recordings.rectified(), recordings.setup())
    cube = true.box == 1
    error = (found.near_px - true.disparity_px)[cube]
    assert np.abs(error).max() < 5 and abs(np.median(error)) < 0.3  # beams stand 9 to 17 mm apart on it
    np.testing.assert_allclose(found.room_px, empty.disparity_px.reshape(120, 4, 160, 4).mean(axis=(1, 3)), atol=1.5)
    top, bottom, left, right = found.free
    rows, columns = np.nonzero(cube)
    assert columns.min() - 20 < left <= columns.min() + 2 and columns.max() + 20 > right >= columns.max() - 2
    assert top == 0 and rows.max() + 10 > bottom >= rows.max() - 3  # thought endless upwards


@pytest.mark.parametrize("kind", recordings.TEXTURES_MM)
@pytest.mark.parametrize("distance", [500, 700, 1000])
def test_at_least_as_good_on_the_cube_and_fewer_false_matches(kind, distance):
    view, scan = recordings.view(f"series/{kind}_{distance}"), recordings.scan(f"series/{kind}_{distance}")
    expected = expected_disparity(scan, recordings.rectified(), recordings.setup())
    plain = compute_disparity(view.left, view.right, SGBMParams(128))
    guided = compute_disparity_guided(view.left, view.right, expected)
    assert guided.dtype == np.float32
    cube = [score(d, view.truth_px, view.regions["cube"]).bad2_pct for d in (plain, guided)]
    assert cube[1] <= cube[0]
    false = [(np.abs(d - view.truth_px)[view.visible] > 2).mean() for d in (plain, guided)]
    assert false[1] < 0.75 * false[0]


def test_without_free_things_one_match_serves():
    scene = Scene((room(),))
    view = recordings.view("series/medium_700")
    expected = expected_disparity(exact_scan(scene), recordings.rectified(), recordings.setup())
    found = compute_disparity_guided(view.left, view.right, expected, SGBMParams())
    floor = view.visible & ~view.regions["cube"]
    assert score(found, view.truth_px, floor).bad2_pct < 5


def test_what_the_laser_cannot_see_is_refused():
    blind = LaserScan(np.full(360, np.nan), np.zeros(360))
    rectified, pose = recordings.rectified(), recordings.setup()
    with pytest.raises(ValueError, match="only 0 of 360 beams met something in the cameras' view"):
        expected_disparity(blind, rectified, pose)
    with pytest.raises(ValueError, match="must stand above"):
        expected_disparity(recordings.scan("conditions/texture"), rectified, pose_left_world(0.0, -50.0))
    expected = expected_disparity(recordings.scan("conditions/texture"), rectified, pose)
    view = recordings.view("conditions/texture")
    with pytest.raises(ValueError, match="multiple of 8, got 12"):
        compute_disparity_guided(view.left, view.right, expected, margin_px=12)
    with pytest.raises(ValueError, match=r"expectation is for \(480, 640\), the images are \(400, 640\)"):
        compute_disparity_guided(view.left[:400], view.right[:400], expected)


def test_lost_beams_are_bridged():
    scan = recordings.scan("conditions/texture")
    holes = scan.ranges_mm.copy()
    holes[::3] = np.nan
    view = recordings.view("conditions/texture")
    expected = expected_disparity(replace(scan, ranges_mm=holes), recordings.rectified(), recordings.setup())
    found = compute_disparity_guided(view.left, view.right, expected)
    assert score(found, view.truth_px, view.regions["cube"]).bad2_pct < 1
