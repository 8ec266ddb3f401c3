"""What stands on the floor: against the virtual rig's truth."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from support.ground import GRID, RECT

from stereolib.measurement import ObjectRegion, find_objects, floor_from_pose
from stereolib.measurement.regions import OBJECTS_WITHIN_MM
from stereolib.paper import rig_pose
from stereolib.virtual import Scene, box_on_floor, cube_scene, recordings, render_truth, room


def test_objects_are_separated_and_sorted():
    boxes = (
        box_on_floor((200.0, 200.0, 250.0), 1100.0, 200.0, 0.4),
        box_on_floor((200.0, 200.0, 150.0), 800.0, -150.0, 0.4),
    )
    pose = recordings.setup("level")
    seen, floor = render_truth(Scene((room(), *boxes)), RECT, pose), floor_from_pose(RECT, pose)
    found = find_objects(seen.disparity_px, floor)
    on_floor = floor.height_mm(*(axis.ravel() for axis in GRID), seen.disparity_px.ravel()).reshape(480, 640) < 22
    assert len(found) == 2  # not the walls, not the floor
    for region, box, height in zip(found, (2, 1), (150, 250), strict=True):
        assert (seen.box[region.v.astype(int), region.u.astype(int)] == box).all()
        assert region.height_mm.max() == pytest.approx(height, abs=3)
        covered = np.zeros(seen.box.shape, np.uint8)
        covered[region.v.astype(int), region.u.astype(int)] = 1
        covered = cv2.dilate(covered, np.ones((3, 3), np.uint8)) > 0  # every third pixel is looked at
        assert covered[(seen.box == box) & ~on_floor].mean() > 0.9
        mine = np.argwhere(seen.box == box)
        assert np.abs(np.array(region.bounds) - [*mine.min(0)[::-1], *mine.max(0)[::-1]])[[0, 1, 2]].max() <= 6
    assert [r.position_mm[1] > 0 for r in found] == [False, True]


def test_specks_are_no_object():
    pose = recordings.setup("level")
    seen = render_truth(cube_scene(), RECT, pose)
    disparity, floor = seen.disparity_px.copy(), floor_from_pose(RECT, pose)
    disparity[(seen.box == 1) & (np.random.default_rng(4).random((480, 640)) > 0.02)] = np.nan
    assert find_objects(disparity, floor) == []


@pytest.mark.parametrize(("between", "count"), [(np.nan, 1), (25.0, 2)])
def test_a_torn_face_is_one_object(between, count):
    """Of a plain face only what is printed is matched; what shows through between two parts tells them apart."""
    pose = recordings.setup("level")
    seen, floor = render_truth(cube_scene(), RECT, pose), floor_from_pose(RECT, pose)
    disparity, (rows, columns) = seen.disparity_px.copy(), np.nonzero(seen.box == 1)
    middle = slice(round(np.quantile(rows, 0.4)), round(np.quantile(rows, 0.6)))
    disparity[middle, columns.min() - 3 : columns.max() + 4] = between
    whole = find_objects(seen.disparity_px, floor)[0]
    found = find_objects(disparity, floor)
    assert len(found) == count
    if count == 1:
        assert found[0].bounds == whole.bounds and len(found[0].u) > 0.6 * len(whole.u)


def test_what_stands_higher_and_farther_is_another_object():
    """Over a low box, and nothing was matched in between."""
    boxes = (
        box_on_floor((300.0, 100.0, 80.0), 700.0, 0.0, 0.0),
        box_on_floor((300.0, 100.0, 320.0), 1000.0, 0.0, 0.0),
    )
    pose = recordings.setup("level")
    seen, floor = render_truth(Scene((room(), *boxes)), RECT, pose), floor_from_pose(RECT, pose)
    disparity = seen.disparity_px.copy()
    foot = np.nonzero(seen.box == 2)[0].max()
    disparity[foot - 12 : foot + 6] = np.nan
    assert len(find_objects(disparity, floor)) == 2


@pytest.mark.parametrize(("rows", "count"), [(6, 2), (24, 1)])
def test_a_streak_of_wrong_matches_joins_nothing(rows, count):
    """Between two boxes that are as far away."""
    boxes = (
        box_on_floor((150.0, 100.0, 250.0), 1000.0, 130.0, 0.0),
        box_on_floor((150.0, 100.0, 250.0), 1000.0, -130.0, 0.0),
    )
    pose = recordings.setup("level")
    seen, floor = render_truth(Scene((room(), *boxes)), RECT, pose), floor_from_pose(RECT, pose)
    disparity, (v, u) = seen.disparity_px.copy(), np.nonzero(seen.box > 0)
    apart, top, middle = find_objects(disparity, floor), v.min() + 60, round((u.min() + u.max()) / 2)
    disparity[top : top + rows, middle - 84 : middle + 84] = np.median(disparity[v, u])
    found = find_objects(disparity, floor)
    assert len(apart) == 2 and len(found) == count
    for one, alone in zip(found, apart, strict=count == 2):
        assert count == 1 or len(one.u) == pytest.approx(len(alone.u), abs=40)


def test_a_valley_between_two_boxes_tells_them_apart():
    """Before a wall that shows nothing, the map joins what stands side by side."""
    boxes = [box_on_floor((150.0, 150.0, 200.0), 1000.0, lateral, np.pi / 4) for lateral in (130.0, -130.0)]
    pose = recordings.setup("level")
    seen, floor = render_truth(Scene((room(), *boxes)), RECT, pose), floor_from_pose(RECT, pose)
    disparity = seen.disparity_px.copy()
    for row in np.flatnonzero((seen.box == 1).any(axis=1) & (seen.box == 2).any(axis=1)):
        ends = [np.flatnonzero(seen.box[row] == 1).max(), np.flatnonzero(seen.box[row] == 2).min()]
        gap = np.arange(ends[0] + 1, ends[1])
        disparity[row, gap] = np.interp(gap, ends, disparity[row, ends])
    found = find_objects(disparity, floor)
    assert len(found) == 2 and np.isfinite(disparity[300, 200:440]).all()
    for region, alone in zip(found, find_objects(seen.disparity_px, floor), strict=True):
        boxes_there = seen.box[region.v.astype(int), region.u.astype(int)]
        assert min((boxes_there == 1).sum(), (boxes_there == 2).sum()) == 0  # nothing of the other one
        assert len(alone.u) <= len(region.u) < 1.5 * len(alone.u)  # and a part of the gap


@pytest.mark.parametrize("yaw", [0.0, 0.3, np.pi / 4])
def test_one_box_has_no_valley(yaw):
    """However it is turned, and also where single columns of it were matched wrongly."""
    pose = recordings.setup("level")
    seen, floor = render_truth(cube_scene(yaw_rad=yaw), RECT, pose), floor_from_pose(RECT, pose)
    disparity, columns = seen.disparity_px.copy(), np.flatnonzero((seen.box == 1).any(axis=0))
    wrong = columns[len(columns) // 2 : len(columns) // 2 + 6]
    disparity[:, wrong] = np.where(seen.box[:, wrong] == 1, 0.985 * disparity[:, wrong], disparity[:, wrong])
    assert len(find_objects(disparity, floor)) == 1


def test_integer_disparities_are_refused():
    with pytest.raises(ValueError, match="float pixels"):
        find_objects(np.ones((480, 640), np.int16), floor_from_pose(RECT, recordings.setup("level")))


@pytest.mark.parametrize("pitch_deg", [-15.0, 0.0])
def test_how_far_is_counted_along_the_floor(pitch_deg):
    """Of a camera that looks down: an upright wall is equally far at its foot and at its top."""
    floor = floor_from_pose(RECT, rig_pose(RECT, np.radians(pitch_deg), 400.0))
    u, v = np.meshgrid(np.arange(640.0), np.arange(480.0))
    ahead = floor.along[0] @ np.stack([u.ravel(), v.ravel(), np.ones(u.size)])

    def found(away_mm: float) -> list[ObjectRegion]:
        wall = (RECT.f_px * RECT.baseline_mm * ahead / away_mm).reshape(480, 640)  # everywhere so far
        disparity = np.where((np.abs(u - 320) < 80) & (wall > floor.disparity(u, v)), wall, floor.disparity(u, v))
        disparity[:10] = floor.disparity(u, v)[:10]
        return find_objects(np.where(disparity > 0, disparity, np.nan), floor)

    (near,) = found(OBJECTS_WITHIN_MM - 20)
    assert near.position_mm[0] == pytest.approx(OBJECTS_WITHIN_MM - 20, abs=5) and len(near.u) > 1000
    assert found(OBJECTS_WITHIN_MM + 20) == []
