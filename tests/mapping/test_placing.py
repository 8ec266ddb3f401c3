"""Poses found without any guess: the walk's, rooms drawn at random, and rooms that look the same from two places."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support import walks

from stereolib import laser
from stereolib.base import turn_2d, wrap_rad
from stereolib.mapping import Station, place_stations
from stereolib.mapping.placing import _refined_together
from stereolib.virtual import Scene, VirtualLidar, box_on_floor, room, stage, walk

TRUE = {str(k): np.array(walk.POSES[f"room/{k}"]) for k in walks.SEEN}
STANDS = {"a": (0.0, 0.0, 0.0), "b": (300.0, 100.0, 2.0), "c": (100.0, -300.0, -0.7)}


def walked(*numbers):
    return [Station(np.zeros(3), (), walks.scan_mm(k), name=str(k)) for k in numbers]


def seen_from(pose, other):
    """A pose in the frame of another one."""
    return np.append((pose[:2] - other[:2]) @ turn_2d(other[2]), wrap_rad(pose[2] - other[2]))


def errors(placing, true):
    origin = placing.stations[0]
    found = {s.name: seen_from(s.pose, origin.pose) for s in placing.stations}
    off = {name: pose - seen_from(np.array(true[name]), np.array(true[origin.name])) for name, pose in found.items()}
    return {name: np.append(e[:2], np.degrees(wrap_rad(e[2]))) for name, e in off.items()}


def scanned(name, scene, pose, rng, **sensor):
    scan = laser.average(laser.turns(laser.decode(VirtualLidar(**sensor).scan(scene, pose, rng))))
    return Station(np.zeros(3), (), laser.points_mm(scan), name=name)


def in_a_room(boxes):
    rng, scene = np.random.default_rng(3), Scene((room(x_mm=(-900.0, 1900.0), y_mm=(-1200.0, 2000.0)), *boxes))
    return [scanned(name, scene, pose, rng) for name, pose in STANDS.items()]


@cache
def placed_walk():
    return place_stations(walked(1, 2, 3, 4, 5))


def test_the_walk_is_placed_by_its_scans_alone():
    """Stations 2 and 5 fit station 1 better the wrong way round; what 3 and 4 saw decides."""
    placing = placed_walk()
    assert [s.name for s in placing.stations] == ["1", "2", "3", "4", "5"]
    assert not placing.left_out and not placing.warnings and not placing.stations[0].pose.any()
    off = errors(placing, TRUE)
    assert max(np.abs(e[:2]).max() for e in off.values()) < 9 and max(abs(e[2]) for e in off.values()) < 0.25
    for station in placing.stations[1:]:
        e = off[station.name] * [1, 1, np.pi / 180]
        assert e @ np.linalg.solve(station.covariance, e) < 20


def test_yaws_that_were_found_lie_within_half_a_turn_of_zero():
    yaws = [station.pose[2] for station in placed_walk().stations]
    assert min(TRUE[name][2] for name in TRUE) < TRUE["1"][2], "some turn to the right: their yaw is negative"
    assert min(yaws) < 0 and np.abs(yaws).max() <= np.pi


def test_a_place_that_is_opposed_gives_way_to_one_that_is_not():
    """Station 2 stands at one end of the room, 1 and 3 at the other: most of its walls fits the wrong way round, where
    the boxes do not, and walls seen from behind are no rivals. The laser of another rig sees the same."""
    staged, rng = {k: stage("walk", int(k), rig=58) for k in "123"}, np.random.default_rng(58)
    other = [scanned(k, it.scene, it.laser_pose, rng, height_mm=it.laser_height_mm) for k, it in staged.items()]
    for stations, true in ((walked(*"123"), TRUE), (other, {k: it.laser_pose for k, it in staged.items()})):
        placing = place_stations(stations)
        assert not placing.left_out
        off = errors(placing, true)
        assert max(np.abs(e[:2]).max() for e in off.values()) < 15 and max(abs(e[2]) for e in off.values()) < 0.3


def test_too_little_in_common_is_left_out():
    """Where most agrees the partition rules it out; the next best place is false as well, and opposed by some readings:
    too few to rule that out, had it been the best."""
    things = (
        ((528.0, 388.0, 300.0), (-3423.0, 1315.0), 0.0),
        ((513.0, 390.0, 300.0), (-2042.0, -322.0), 0.0),
        ((350.0, 275.0, 300.0), (1643.0, 78.0), np.pi / 2),
        ((2120.0, 90.0, 400.0), (-323.0, -610.0), np.pi / 2),  # a partition, with a door to the next one
        ((439.0, 90.0, 400.0), (-323.0, 1450.0), np.pi / 2),
    )
    boxes = (box_on_floor(size, *place, yaw) for size, place, yaw in things)
    scene = Scene((room(x_mm=(-3728.5, 3728.5), y_mm=(-1670.0, 1670.0)), *boxes))
    rng, poses = np.random.default_rng(1), {"a": (-3162.0, 426.0, 0.0), "b": (120.0, -100.0, -1.4)}
    near = {"max_mm": 3000.0, "height_mm": 60.0}
    placing = place_stations([scanned(name, scene, pose, rng, **near) for name, pose in poses.items()])
    assert list(placing.left_out) == ["b"] and "add a station between, or give its pose" in placing.left_out["b"]


def test_where_a_thing_was_moved_no_false_place_is_taken():
    (hall, *boxes), rng = walk.walk_scene().boxes, np.random.default_rng(2)
    moved = Scene((hall, box_on_floor(boxes[0].size_mm, 300.0, 700.0, 0.4), *boxes[1:]))
    last = scanned("moved", moved, (1700.0, 200.0, 2.5), rng, height_mm=walk.LASER_HEIGHT_MM)
    placing = place_stations([*walked(*"25"), last])
    assert list(placing.left_out) == ["moved"]
    assert "Scan again if something was moved; else add a station between" in placing.left_out["moved"]


def test_who_does_not_hold_with_all_the_others_goes():
    one, three = (replace(s, pose=TRUE[s.name]) for s in walked("1", "3"))
    wall = replace(
        one, scan_mm=one.scan_mm[np.abs(one.to_map(one.scan_mm)[:, 0] - walk.ROOM_MM[0][0]) < 20], name="wall"
    )
    placed, apart = _refined_together([one, three, wall])
    assert [s.name for s in placed] == ["1", "3"] and "leave open for station wall" in apart["wall"]


def test_what_fits_in_two_places_is_left_out():
    """The same room without a box, with two that are each other's image, and with one."""
    image = [box_on_floor((300.0, 200.0, 300.0), *place, 0.4) for place in ((1300.0, 1300.0), (-300.0, -500.0))]
    for boxes in ([], image):
        placing = place_stations(in_a_room(boxes))
        assert [s.name for s in placing.stations] == ["a"] and set(placing.left_out) == {"b", "c"}
        assert all("fits in more than one place" in why and "give its pose" in why for why in placing.left_out.values())
    placing = place_stations(in_a_room(image[:1]))
    assert not placing.left_out
    assert max(np.abs(e[:2]).max() for e in errors(placing, STANDS).values()) < 5


def test_another_room_fits_nowhere():
    angles = np.radians(np.arange(360))
    other = (700 + 150 * np.cos(7 * angles))[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    placing = place_stations([*walked(1, 3), Station(np.zeros(3), (), other, name="elsewhere")])
    assert set(placing.left_out) == {"elsewhere"} and len(placing.stations) == 2


def test_given_poses_are_refined_and_wrong_ones_are_named():
    rng = np.random.default_rng(5)
    given = [replace(s, pose=TRUE[s.name] + rng.uniform(-1, 1, 3) * [50, 50, 0.05]) for s in walked(1, 3, 4)]
    off = errors(place_stations(given, TRUE), TRUE)
    assert max(np.abs(e[:2]).max() for e in off.values()) < 5
    turned = replace(given[1], pose=given[1].pose + np.array([0, 0, np.pi]))
    placing = place_stations([given[0], turned, given[2]], TRUE)
    (warning,) = placing.warnings
    assert warning.startswith("station 3 stays at the pose that was given for it")
    assert np.array_equal(placing.stations[1].pose, turned.pose)
    assert np.abs(errors(placing, TRUE)["4"][:2]).max() < 5


def test_stations_without_a_scan():
    blind = Station(np.array([500.0, 0, 0]), (), name="blind")
    placing = place_stations([*walked(1, 3), blind])
    assert placing.left_out == {"blind": "it has no scan to be placed by: give its pose"}
    known = [replace(s, pose=TRUE[s.name]) for s in walked(1)]
    assert place_stations([*known, blind], {"1", "blind"}).stations == (known[0], blind)
    placing = place_stations([blind, *walked(1)], {"blind"})  # nothing ties the scan to the picture
    assert placing.stations == (blind,) and "no station of a known pose has a scan" in placing.left_out["1"]
    alone = place_stations([blind]).stations[0]
    assert not alone.pose.any()
    with pytest.raises(ValueError, match="at least one station"):
        place_stations([])
    with pytest.raises(ValueError, match="2 stations are named 'blind': give each"):
        place_stations([*walked(1), blind, blind])


def test_stations_without_names_are_called_by_their_numbers():
    placing = place_stations([replace(s, name="") for s in walked(1, 3)])
    assert [s.name for s in placing.stations] == ["1", "2"]
