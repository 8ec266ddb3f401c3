"""The recorded walk through everything: pairs and scans to objects, objects to one map, against the truth."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib.mapping import Station, disturb_poses, merge_stations, refine_poses, size_table
from stereolib.notebook import draw_map_view, draw_matching, draw_pose
from stereolib.rig import rigid
from stereolib.virtual import measure_walk, recordings, walk, walk_laser


@pytest.fixture(scope="module")
def stations():
    return tuple(Station.of(each, walk.POSES[name]) for name, each in measure_walk().items())


def check(found, places_mm):
    """Each box once and none left out, sizes within 1.5 % and four deviations, the sums within 1 %."""
    assert found.warnings == ()
    boxes = [walk.nearest_box(thing.position_mm) for thing in found.measured]
    true = np.array([box.size_mm for box in boxes])
    assert sorted(map(tuple, true)) == sorted(tuple(box.size_mm) for box in walk.objects())
    sizes, std = (np.array([getattr(thing, name) for thing in found.measured]) for name in ("size_mm", "std_mm"))
    assert np.abs(sizes / true - 1).max() < 0.015 and np.median(np.abs(sizes / true - 1)) < 0.003
    assert np.abs((sizes - true) / std).max() < 4 and np.mean(np.abs(sizes - true) < 1.96 * std) > 0.8
    for thing, box in zip(found.measured, boxes, strict=True):
        assert thing.position_mm == pytest.approx(box.T_world_box[:2, 3], abs=places_mm)
    litres, area = true.prod(axis=1).sum() / 1e6, sum(2 * (a + b) * h + a * b for a, b, h in true) / 1e6
    assert found.volume_l[0] == pytest.approx(litres, rel=0.01) and found.surface_m2[0] == pytest.approx(area, rel=0.01)
    assert abs(found.volume_l[0] - litres) < 3 * found.volume_l[1] < 0.01 * litres
    assert len(found.walls) == 4 and all(wall.ends == ("corner", "corner") for wall in found.walls)
    assert max(abs(walk.wall_error_mm(wall.ends_mm)) for wall in found.walls) < 8


def test_laser_of_the_walk_is_calibrated_where_it_stands():
    pose = walk_laser()
    true = recordings.setup() @ rigid(np.eye(3), [0.0, 0.0, walk.LASER_HEIGHT_MM])
    error = np.linalg.inv(true) @ pose.T_left_lidar
    assert (np.abs(error[:3, 3]) < 3 * pose.std_mm).all()
    assert np.degrees(np.abs(error[:2, :2] - np.eye(2)).max()) < 0.3


def test_walk_with_known_poses(stations):
    found = merge_stations(stations, rng=np.random.default_rng(0))
    check(found, places_mm=2.0)


def test_a_thing_is_called_as_in_the_map_wherever_it_is_seen(stations):
    found = merge_stations(stations, rng=np.random.default_rng(0))
    seen = [(name, found.names_of(k), station) for k, station in enumerate(stations, 1) for name in found.names]
    for name, names, station in seen:
        true = walk.nearest_box(found.measured[found.names.index(name)].position_mm).size_mm
        things = [thing for known, thing in zip(names, station.objects, strict=True) if known == name]
        sizes = np.array([thing.size_mm for thing in things]).reshape(-1, 3)
        assert (
            len(things) <= 1 and not (np.abs(sizes[:, 2] - true[2]) > 2).any()
        )  # a height that was measured is its own
    assert all("B" in found.names_of(k) for k in (1, 2, 3, 4, 5))


def test_walk_with_poses_from_its_scans(stations):
    wrong = disturb_poses(stations, np.random.default_rng(1), 50.0, np.radians(3.0))
    match = refine_poses(wrong)
    found = merge_stations(match.stations, rng=np.random.default_rng(0))
    check(found, places_mm=8.0)
    for thing in found.measured:  # what is not known of the poses is in the places
        off = thing.position_mm - walk.nearest_box(thing.position_mm).T_world_box[:2, 3]
        assert off @ np.linalg.solve(thing.position_covariance, off) < 14
    at_wrong = merge_stations(wrong, rng=np.random.default_rng(0))
    assert len(at_wrong.warnings) > 3 and "left out" in " ".join(at_wrong.warnings)


def test_table_says_what_is_not_known(stations):
    things = stations[3].objects
    table = size_table(things, [str(k) for k in range(len(things))])
    unknown = np.array([np.isnan(thing.size_mm) for thing in things])
    np.testing.assert_array_equal(table[["length_mm", "width_mm", "height_mm"]].to_numpy() == "?", unknown)
    k = int(np.flatnonzero(~unknown.any(axis=1))[0])
    length, std = (float(part) for part in table["length_mm"][k].split(" ± "))
    assert (length, std) == (round(things[k].size_mm[0], 1), round(things[k].std_mm[0], 1))


def test_sliders_of_the_map():
    boxes, text = draw_map_view(35, 35, "boxes")
    points, _ = draw_map_view(35, 35, "points")
    assert boxes.shape == points.shape == (600, 900, 3) and (boxes != points).any()
    assert text.startswith("5 objects, 66.") and "4 walls" in text
    _, text = draw_matching(50, 3.0, 0)
    assert text.startswith("put together: readings") and "worst pose is off by" in text


def test_the_slider_says_when_the_walk_was_not_put_together():
    """The scans lie on each other to some millimetres, and a station stands a metre off."""
    _, text = draw_matching(290, 35.0, 11)
    assert text.startswith("NOT put together: station ") and "in a wrong place" in text
    after_mm = float(text.partition("before and ")[2].split()[0])
    assert after_mm < 6 and float(text.partition("the worst off by ")[2].split()[0]) > 1000


def test_the_slider_of_one_pose_finds_the_true_one():
    x, y, yaw = walk.POSES["room/5"]
    off_mm = [
        float(draw_pose(round(x) + dx, round(y), float(np.degrees(yaw)))[1].partition("within ")[2].split()[0])
        for dx in (0, 50)
    ]
    assert off_mm[0] < 10 < off_mm[1]
