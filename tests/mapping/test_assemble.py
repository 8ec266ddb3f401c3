"""Merging: the walk's boxes from its stations' sightings, made from the truth with noise of known covariance."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from support import walks

from stereolib.mapping import Station, merge_stations
from stereolib.mapping.sightings import Sighting, merge_sightings
from stereolib.mapping.walls import find_walls
from stereolib.measurement import MeasuredObject, Reason
from stereolib.virtual import walk

ORDER = (3, 0, 1, 4, 2)  # the walk's boxes by their distance from the map's origin


def merged(stations, **how):
    return merge_stations(stations, rng=np.random.default_rng(0), **how)


def bare(pose, *things, **fields):
    return Station(np.array(pose, float), things, **fields)


def seen_from(pose, size, centre, yaw, rng, kind=walks.box, **how):
    return kind(np.array(size, float), *walks.into(np.array(pose, float), centre, yaw), rng, **how)


def test_five_boxes_come_out_of_five_stations():
    found = merged(walks.walked(np.random.default_rng(1)))
    assert found.names == ("A", "B", "C", "D", "E") and found.warnings == ()
    assert [sorted(each.stations) for each in found.objects] == [[1, 3], [3, 5], [3, 5], [2, 4], [2, 4]]
    for thing, k in zip(found.measured, ORDER, strict=True):
        size, centre, yaw = walks.truth(k)
        assert thing.shape == "box"
        assert np.abs(thing.size_mm - size).max() < 4 * walks.STD_MM
        assert thing.position_mm == pytest.approx(centre, abs=4 * walks.STD_MM)
        assert abs((thing.yaw_rad - yaw + np.pi / 2) % np.pi - np.pi / 2) < 4 * walks.STD_RAD


@pytest.mark.parametrize("is_told", [True, False])
def test_an_error_that_all_stations_share_is_not_averaged_away(is_told):
    """A focal length that is wrong makes the sizes of all stations wrong alike; told apart, or taken for chance."""
    sizes, volumes = [], []
    true_l = sum(np.prod(walks.truth(k)[0]) for k in ORDER) / 1e6
    for seed in range(60):
        rng = np.random.default_rng([3, seed])
        errors = rng.normal(size=2)

        def off(thing, errors=errors):
            common = np.zeros((3, 6))
            common[:, 0], common[2, 1] = 0.01 * np.nan_to_num(thing.size_mm), 2.0  # 1 % of all, 2 mm of heights
            size, covariance = thing.size_mm + common[:, :2] @ errors, thing.covariance + common @ common.T
            return replace(thing, size_mm=size, covariance=covariance, common_mm=common * is_told)

        stations = [walks.station(k, rng, scan_mm=np.zeros((0, 2))) for k in walks.SEEN]
        found = merged([replace(each, objects=tuple(map(off, each.objects))) for each in stations])
        for thing, k in zip(found.measured, ORDER, strict=True):
            sizes.append((thing.size_mm - walks.truth(k)[0]) / thing.std_mm)
        volumes.append((found.volume_l[0] - true_l) / found.volume_l[1])
    spread = np.sqrt(np.mean(np.square(sizes))), np.sqrt(np.mean(np.square(volumes)))
    if is_told:
        assert spread == pytest.approx((1.0, 1.0), abs=0.2)
    else:
        assert spread[0] > 1.15 and spread[1] > 1.6


@pytest.mark.slow
def test_stated_deviations_are_those_of_the_errors():
    """Over 150 noisy walks: sizes, places and the volume's sum, in units of their own standard deviations."""
    sizes, places, volumes, surfaces = [], [], [], []
    true_l = sum(np.prod(walks.truth(k)[0]) for k in ORDER) / 1e6
    areas = [2 * (s[0] + s[1]) * s[2] + s[0] * s[1] for s in (walks.truth(k)[0] for k in ORDER)]
    no_scan = np.zeros((0, 2))
    for seed in range(150):
        rng = np.random.default_rng([2, seed])
        found = merged([walks.station(k, rng, scan_mm=no_scan) for k in walks.SEEN])
        for thing, k in zip(found.measured, ORDER, strict=True):
            size, centre, _ = walks.truth(k)
            sizes.append((thing.size_mm - size) / thing.std_mm)
            off = thing.position_mm - centre
            places.append(off @ np.linalg.solve(thing.position_covariance, off))
        volumes.append((found.volume_l[0] - true_l) / found.volume_l[1])
        surfaces.append((found.surface_m2[0] - sum(areas) / 1e6) / found.surface_m2[1])
    assert 0.93 < np.mean(np.abs(sizes) < 1.96) < 0.99 and 0.85 < np.std(sizes) < 1.05
    assert 0.93 < np.mean(np.array(places) < 5.99) < 0.995
    for scores in (volumes, surfaces):
        assert np.mean(np.abs(scores) < 1.96) > 0.9 and np.std(scores) > 0.75


def test_two_boxes_merge_as_the_slow_twin_does():
    """Inverse-covariance weighting, written out for one box seen twice at the same yaw."""
    rng = np.random.default_rng(3)
    one, two = (walks.box(np.array([300.0, 200, 150]), np.array([900.0, 40]), 0.3, rng) for _ in range(2))
    two = replace(two, covariance=np.diag([25.0, 9.0, 1.0]), position_covariance=np.diag([1.0, 16.0]))
    (found,) = merged([bare((0, 0, 0), one), bare((0, 0, 0), two)]).measured
    wa, wb = np.linalg.inv(one.covariance), np.linalg.inv(two.covariance)
    mean = np.linalg.solve(wa + wb, wa @ one.size_mm + wb @ two.size_mm)
    np.testing.assert_allclose(found.size_mm, mean, atol=1e-6)
    pa, pb = np.linalg.inv(one.position_covariance), np.linalg.inv(two.position_covariance)
    mean = np.linalg.solve(pa + pb, pa @ one.position_mm + pb @ two.position_mm)
    np.testing.assert_allclose(found.position_mm, mean, atol=1e-6)
    scale = found.covariance[0, 0] * np.linalg.inv(np.linalg.inv(wa + wb))[0, 0]
    np.testing.assert_allclose(found.covariance, max(scale, 1) * np.linalg.inv(wa + wb), rtol=1e-6)


@pytest.mark.parametrize(("second", "name"), [((900, -1100, np.pi / 2), "beside"), ((2000, 0, np.pi), "opposite")])
def test_a_face_from_another_side_brings_the_hidden_depth(second, name):
    """From in front only the width shows; from beside the depth does, from behind it is the distance of two faces."""
    rng = np.random.default_rng(4)
    size, centre = (240.0, 300.0, 180.0), (900.0, 0.0)  # 240 deep, 300 wide
    stations = [bare(pose, seen_from(pose, size, centre, 0.0, rng, walks.face)) for pose in ((0, 0, 0), second)]
    alone = merged(stations[:1])
    assert alone.measured[0].shape == "face" and np.isnan(alone.measured[0].size_mm[0])
    assert alone.names_of(1) == ["A"]
    assert alone.warnings == (f"A: its length is unknown, {Reason.DEPTH_HIDDEN.value}",)
    with pytest.raises(ValueError, match="no object of which all three sizes are known"):
        _ = alone.volume_l
    both = merged(stations)
    (thing,) = both.measured
    assert thing.shape == "box" and both.warnings == ()
    assert thing.size_mm == pytest.approx([300, 240, 180], abs=8)
    assert thing.position_mm == pytest.approx(centre, abs=5)
    assert abs(both.volume_l[0] - 12.96) < 3 * both.volume_l[1] < 1.0


def test_a_depth_between_faces_of_stations_that_stand_anywhere_is_not_told():
    """Each face is known to 2 mm, but the second station's place to 60 only: so is what lies between them."""
    rng, size, centre = np.random.default_rng(4), (240.0, 300.0, 180.0), (900.0, 0.0)
    front, back = (seen_from(p, size, centre, 0.0, rng, walks.face) for p in ((0, 0, 0), (2000, 0, np.pi)))
    for std_mm, told in ((1.0, True), (60.0, False)):
        second = bare((2000, 0, np.pi), back, covariance=np.diag([std_mm**2, std_mm**2, 1e-8]))
        (thing,) = merged([bare((0, 0, 0), front), second]).measured
        assert np.isfinite(thing.size_mm).tolist() == [True, told, True]
        assert told or thing.reasons["width"].reason is Reason.TOO_UNCERTAIN


def test_a_face_without_ends_takes_no_depth_away():
    """Two opposite faces tell the depth; a third one, whose ends are hidden, tells nothing of it."""
    rng = np.random.default_rng(4)
    size, centre = (240.0, 300.0, 180.0), (900.0, 0.0)
    poses = ((0, 0, 0), (2000, 0, np.pi), (900, -1100, np.pi / 2))
    front, back, beside = (seen_from(pose, size, centre, 0.0, rng, walks.face) for pose in poses)
    unknown = np.full((3, 3), np.nan)
    unknown[2, 2] = walks.STD_MM**2
    endless = replace(beside, size_mm=np.array([np.nan, np.nan, beside.size_mm[2]]), covariance=unknown)
    for order in ((0, 1, 2), (2, 0, 1)):
        stations = [bare(poses[k], (front, back, endless)[k]) for k in order]
        (thing,) = merged(stations).measured
        assert thing.shape == "box" and thing.size_mm == pytest.approx([300, 240, 180], abs=8)


def test_a_face_seen_twice_from_one_side_stays_a_face():
    rng = np.random.default_rng(5)
    poses = ((0, 0, 0), (100, 150, -0.15))
    seen = [bare(p, seen_from(p, (240, 300, 180), (900, 0), 0.0, rng, walks.face)) for p in poses]
    (thing,) = merged(seen).measured
    assert thing.shape == "face" and np.isnan(thing.size_mm[0])
    assert thing.size_mm[1:] == pytest.approx([300, 180], abs=5)
    assert thing.std_mm[1] == pytest.approx(walks.STD_MM / np.sqrt(2), rel=0.4)
    assert thing.position_mm == pytest.approx([780, 0], abs=5)


def test_neighbours_stay_apart():
    rng = np.random.default_rng(6)
    poses = ((0, 0, 0), (1000, -1000, np.pi / 2))
    boxes = (((200, 150, 100), (900, 0), 0.4), ((180, 150, 220), (1000, 230), 0.2))
    stations = [bare(pose, *(seen_from(pose, *each, rng) for each in boxes)) for pose in poses]
    found = merged(stations)
    assert [each.stations for each in found.objects] == [(1, 2), (1, 2)] or len(found.objects) == 2
    assert found.measured[0].size_mm == pytest.approx([200, 150, 100], abs=8)
    # Two things of one station are never one.
    assert len(merged([bare((0, 0, 0), *(seen_from((0, 0, 0), *boxes[0], rng) for _ in range(2)))]).objects) == 2


def test_disagreement_is_reported_and_not_averaged():
    rng = np.random.default_rng(7)
    poses = ((0, 0, 0), (900, -900, np.pi / 2), (1800, 0, np.pi))
    size, centre = np.array([300.0, 200, 150]), (900, 0)
    things = [seen_from(pose, size, centre, 0.2, rng) for pose in poses]
    wrong = replace(things[1], size_mm=things[1].size_mm + np.array([0.0, 0, 60]))
    found = merged([bare(p, t) for p, t in zip(poses, (things[0], wrong, things[2]), strict=True)])
    (each,) = found.objects
    assert each.stations == (1, 3)
    assert each.fused.size_mm[2] == pytest.approx(150, abs=6)
    (warning,) = found.warnings
    assert re.fullmatch(
        r"A: station 2 sees its height as 2[01]\d mm, the others as 1[45]\d: 2\d\.\d standard .* apart, left out",
        warning,
    )
    # Of two, the surer one is kept and the other named.
    surer = replace(things[0], position_covariance=np.eye(2))
    (each,) = merged([bare(p, t) for p, t in zip(poses, (surer, wrong), strict=False)]).objects
    assert each.stations == (1,) and "station 2" in each.conflicts[0]


def test_pose_covariance_widens_what_hangs_on_it():
    """A yaw known to 1 degree moves an object 1 m away by 17 mm, and leaves its size alone."""
    rng = np.random.default_rng(8)
    thing = walks.box(np.array([300.0, 200, 150]), np.array([1000.0, 0]), 0.3, rng)
    unsure = bare((0, 0, 0), thing, covariance=np.diag([25.0, 9.0, np.radians(1.0) ** 2]))
    (found,) = merged([unsure]).measured
    expected = [
        np.hypot(walks.STD_MM, 5),
        np.sqrt(walks.STD_MM**2 + 9 + np.radians(1.0) ** 2 * thing.position_mm[0] ** 2),
    ]
    assert np.sqrt(np.diag(found.position_covariance)) == pytest.approx(expected, rel=0.02)
    np.testing.assert_allclose(found.covariance, thing.covariance)


def test_round_and_irregular_things_are_not_made_boxes():
    size, S = np.array([200.0, 200, 150]), np.array([[4.0, 4, 0], [4, 4, 0], [0, 0, 4]])
    ring = np.array([[np.cos(a), np.sin(a)] for a in np.linspace(0, 2 * np.pi, 24, endpoint=False)])
    poses = ((0, 0, 0), (900, -900, np.pi / 2))

    def tin(pose, diameter):
        centre, _ = walks.into(np.array(pose, float), (900.0, 0.0), 0.0)
        each = size * [diameter / 200, diameter / 200, 1]
        return MeasuredObject("circle", each, S, centre, np.eye(2) * 4, np.nan, np.nan, centre + diameter / 2 * ring)

    found = merged([bare(p, tin(p, d)) for p, d in zip(poses, (200.0, 204.0), strict=True)])
    (thing,) = found.measured
    assert thing.shape == "circle" and thing.size_mm == pytest.approx([202, 202, 150])
    assert found.volume_l[0] == pytest.approx(np.pi / 4 * 2.02**2 * 1.5)
    assert found.volume_l[1] == pytest.approx(
        np.hypot(np.pi / 2 * 2.02 * 1.5 * 0.02 / np.sqrt(2), np.pi / 4 * 2.02**2 * 0.02 / np.sqrt(2)), rel=1e-3
    )
    blob = replace(tin(poses[1], 200.0), shape="irregular", size_mm=np.array([np.nan, np.nan, 156.0]),
                   covariance=np.diag([np.nan, np.nan, 4.0]), position_covariance=np.full((2, 2), np.nan))  # fmt: skip
    (thing,) = merged([bare(poses[0], tin(poses[0], 200.0)), bare(poses[1], blob)]).measured
    assert thing.shape == "circle" and thing.size_mm == pytest.approx([200, 200, 153])
    box = seen_from(poses[1], (150, 140, 150), (900, 0), 0.1, np.random.default_rng(9))
    (each,) = merged([bare(poses[0], tin(poses[0], 200.0)), bare(poses[1], box)]).objects
    assert each.conflicts == ("station 1 sees a circle, the others a box",) or "sees a box" in each.conflicts[0]


def test_an_irregular_outline_tells_a_face_its_height_alone():
    rng, poses = np.random.default_rng(4), ((0, 0, 0), (900, -1100, np.pi / 2))
    front, beside = (seen_from(pose, (240.0, 300.0, 180.0), (900.0, 0.0), 0.0, rng, walks.face) for pose in poses)
    blob = replace(beside, shape="irregular", size_mm=np.array([np.nan, np.nan, beside.size_mm[2]]),
                   covariance=np.diag([np.nan, np.nan, 4.0]), yaw_rad=np.nan, yaw_std_rad=np.nan)  # fmt: skip
    for sightings in (order := [Sighting.of(k, each, np.array(pose, float), np.zeros((3, 3)))
                                for k, (each, pose) in enumerate(zip((front, blob), poses, strict=True), 1)],
                      order[::-1]):  # fmt: skip
        found = merge_sightings(sightings).fused
        assert found.shape == "face" and found.size_mm[1] == pytest.approx(front.size_mm[1])
        assert found.size_mm[2] == pytest.approx((front.size_mm[2] + beside.size_mm[2]) / 2)


def test_walls_of_the_room():
    """Four walls, meeting in the corners, each within its stated deviation and 4 mm (the laser's bias at 2 m)."""
    found = merged(walks.walked(np.random.default_rng(10)))
    (x0, x1), (y0, y1) = walk.ROOM_MM
    assert len(found.walls) == 4
    for wall in found.walls:
        axis = int(np.abs(wall.normal).argmax())
        true = min((x0, x1) if axis == 0 else (y0, y1), key=lambda at: abs(at - wall.ends_mm[0, axis]))
        assert abs(wall.normal[axis] * wall.offset_mm - true) < 4
        assert abs(wall.normal[axis] * wall.offset_mm - true) < 4 * wall.offset_std_mm
        assert wall.ends == ("corner", "corner")
        assert wall.length_mm == pytest.approx((y1 - y0) if axis == 0 else (x1 - x0), abs=8)
        assert (np.array([650.0, 130.0]) @ wall.normal) > wall.offset_mm  # looks into the room
    corners = {tuple(np.round(end, -1)) for wall in found.walls for end in wall.ends_mm}
    assert corners == {(x, y) for x in (x0, x1) for y in (y0, y1)}


def test_objects_are_no_walls_and_short_stretches_neither():
    stations = [walks.station(k, np.random.default_rng(11)) for k in (1, 4)]
    rng = np.random.default_rng(0)
    assert len(find_walls(stations, rng=rng, least_mm=300.0)) > 4  # faces, unless they are known to be objects
    things = merged(walks.walked(np.random.default_rng(12))).measured
    assert len(find_walls(stations, things, rng=np.random.default_rng(0), least_mm=300.0)) == 4


def test_empty_maps_are_said_and_partial_ones_kept():
    with pytest.raises(ValueError, match="at least one station"):
        merged([])
    with pytest.raises(
        ValueError, match=r"the map is empty: 2 stations measured no object, and 0 readings .* make no wall"
    ):
        merged([bare((0, 0, 0)), bare((1, 1, 0))])
    walls_only = merged([walks.station(1, np.random.default_rng(0), only=())])
    assert len(walls_only.walls) >= 3 and walls_only.objects == ()
    assert walls_only.warnings == ("no object: 1 station measured none",)
    with pytest.raises(ValueError, match="nothing to add up"):
        _ = walls_only.surface_m2
    with pytest.raises(ValueError, match=r"scan is \(N, 2\)"):
        bare((0, 0, 0), scan_mm=np.zeros((3, 3)))


def test_sighting_moves_as_a_rigid_body_does():
    """Place, yaw and outline of a station's object in the map, against the slow way round: corners from the truth."""
    pose = np.array([400.0, -250.0, 2.2])
    size, centre, yaw = np.array([300.0, 200, 150]), np.array([900.0, 100]), 0.3
    thing = walks.box(size, *walks.into(pose, centre, yaw), np.random.default_rng(0), std=1e-6)
    seen = Sighting.of(1, thing, pose, np.zeros((3, 3))).measured
    np.testing.assert_allclose(seen.position_mm, centre, atol=1e-9)
    true = walks.corners(size, centre, yaw)
    distance = np.linalg.norm(seen.outline_mm[:, None] - true, axis=2).min(axis=1)
    assert distance.max() < 4 * walks.STD_RAD * 200
    assert merge_sightings([Sighting.of(1, thing, pose, np.zeros((3, 3)))]).stations == (1,)
