"""Faces and tops followed to their ends: against boxes of the virtual rig, to the stretch in which an end may lie."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.boxes import OWN, PRIORS, STILL, planes
from support.pictured import HIGH, of_pair, recorded, rendered, true_box

from stereolib.measurement import Face
from stereolib.measurement.agreement import Agreement, Past, Reach
from stereolib.measurement.box import Box, Own, Side
from stereolib.measurement.faces import find_face
from stereolib.measurement.follow import (
    _FIRST_PX,
    End,
    _carried_down,
    _top,
    follow_again,
    follow_face,
    follow_top,
    look_round,
)
from stereolib.measurement.pictured import see_box
from stereolib.measurement.upright_line import UprightLine, upright_line

SLIVER = (700.0, (260.0, 260.0, 220.0), -13.0)
FROM_ABOVE = (620.0, (220.0, 330.0, 130.0), -25.0)


def tangent(point):
    return point[1] / point[0]


def holds(end, true, f_px):
    """The true end lies within what is stated."""
    return abs(end.at - true) * f_px < max(end.inside_px, end.outside_px)


@pytest.mark.parametrize(("matched_px", "foot_mm"), [(60.0, 0.0), (40.0, 79.0), (np.nan, 79.0)])
def test_a_face_with_a_plain_part_goes_down_as_far_as_the_map_has_it(matched_px, foot_mm):
    """Where the map has what is behind, or nothing, it ends: it may hang. Near the floor no map can tell."""
    heights = np.arange(0.0, 200.0)
    alike = np.where(heights < 80, 0.0, 0.95)
    below = np.where(heights < 60, matched_px, np.nan)
    floor_px = 60.0 * (1 - heights / 250)
    behind = np.where(heights < 12, floor_px, below)  # so low the floor is as near as the face
    matched, one = np.where(heights < 80, behind, 60.0), np.ones(200)
    along = Agreement(alike, alike, one, one, 60.0 * one, matched, matched, 0 * one)
    down = along.part(slice(120, None, -1)).reach(40)
    assert _carried_down(along, heights, 120, down, camera_mm=250.0) == pytest.approx(foot_mm, abs=3)


def test_a_line_and_its_points():
    line = UprightLine(np.array([0.8, 0.6]), 500.0)
    points = line.at(np.array([-0.3, 0.0, 0.4]))
    assert points @ line.normal == pytest.approx(500) and points[:, 1] / points[:, 0] == pytest.approx([-0.3, 0, 0.4])
    assert np.isnan(line.at(-1.5)).all()  # behind the camera
    shown, hidden = line.round_corner(0.1, 1), line.round_corner(0.1, -1)
    assert (shown.normal @ line.normal, hidden.normal @ line.normal) == pytest.approx((0, 0))
    assert shown.at(0.1) == pytest.approx(line.at(0.1))
    assert (
        hidden.distance_mm == pytest.approx(-shown.distance_mm) and hidden.distance_mm < 0
    )  # it is turned away from the camera


@pytest.mark.parametrize("side", Side)
def test_the_line_of_a_face_is_that_of_its_plane(side):
    world = PRIORS.world(STILL)
    (seen,) = planes(world, OWN, sides=[side])
    face = Face(seen.centre_px, seen.coefficients, np.diag([1e-8, 1e-8, 1e-4]), (-0.1, 0.1), 900)
    for height in (0.0, 200.0):
        line, tilt, std = upright_line(world, face, height)
        assert line.normal == pytest.approx(Box(OWN).normal(side))
        assert line.distance_mm == pytest.approx(Box(OWN).distance(side)) and tilt == pytest.approx(0, abs=1e-9)
        assert 1e-4 < std < 0.1


def test_a_face_that_leans_back_is_told():
    world = PRIORS.world(STILL)
    lean = np.radians(5)
    normal = np.array([np.cos(lean), 0.0, np.sin(-lean)])
    plane = world.disparity_plane(normal, np.array(700.0))
    face = Face(np.zeros(2), plane, np.diag([1e-8, 1e-8, 1e-4]), (-0.1, 0.1), 900)
    low, tilt, _ = upright_line(world, face, 0.0)
    assert abs(tilt) == pytest.approx(lean)
    assert upright_line(world, face, 100.0)[0].distance_mm - low.distance_mm == pytest.approx(100 * np.tan(lean))


def test_ends_of_reaches():
    where = np.arange(100.0)
    end = End.of(Reach(40, 42, Past.OPEN, 40), where)
    assert end.at == pytest.approx(41.5, abs=1) and end.inside_px == end.outside_px and end.std_px == 2.5
    plain = End.of(Reach(40, 80, Past.OPEN, 40), where)
    assert plain.outside_px > 36 and plain.std_px > 10 and plain.at == end.at
    assert End.of(Reach(40, 46, Past.CUT, 40), where) == End(45.0, Past.CUT)
    assert End.of(Reach(40, 46, Past.CUT, 40), where, aside=True).may_be_cut  # the left picture may show what is beyond
    unsure = End.of(
        Reach(20, 50, Past.CUT, 20), where, aside=True
    )  # plain from there to the rim: it may end anywhere, or be cut
    assert unsure.past is Past.OPEN and unsure.may_be_cut and unsure.at + unsure.outside_px > 49
    second = End.of(Reach(40, 42, Past.OPEN, 40), where, second=True)
    assert second.at < 40 and second.std_px > end.std_px
    beside = End.of(Reach(40, 42, Past.OPEN, 32), where)
    assert beside.at == end.at and beside.inside_px == end.inside_px + 8  # eight lines may be an edge's trace
    assert end.overlaps(beside, 1.0) and not end.overlaps(End.of(Reach(60, 62, Past.OPEN, 60), where), 1.0)


def test_the_recorded_cube_s_faces():
    shown = recorded("series/fine_700")
    stretch, f = shown.stretch(), float(shown.world.focal)
    own = np.array([700.0, 0.0, np.pi / 4, 300.0, 300.0, 300.0, 0.0, 0.0])
    corner, right, left = Box(own).points(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]))
    assert abs(stretch.low_mm) < 12 and stretch.foot_mm < 0 and abs(stretch.high.at - 300) < 8
    assert abs(stretch.lean_rad) < 0.05
    on_right = stretch.line.normal[1] > 0
    outer, inner = (stretch.right, stretch.left) if on_right else (stretch.left, stretch.right)
    assert holds(outer, tangent(right if on_right else left), f) and holds(inner, tangent(corner), f)
    round_corner = look_round(shown.views, shown.world, stretch, 1 if on_right else -1)
    assert round_corner.t == pytest.approx(0, abs=4 / f)
    assert holds(round_corner.end, tangent(left if on_right else right), f) and round_corner.width_px > 100
    assert look_round(shown.views, shown.world, stretch, -1 if on_right else 1) is None


def test_a_sliver_round_the_corner_is_found():
    """Twenty pixels wide, and less in the right picture: no disparity map shows it as a face."""
    shown, own = rendered(*SLIVER), true_box(*SLIVER)
    stretch, f = shown.stretch(), float(shown.world.focal)
    corner, right = Box(own).points(np.array([[0.0, 0, 0], [1, 0, 0]]))
    found = look_round(shown.views, shown.world, stretch, -1)
    assert found.t == pytest.approx(tangent(corner), abs=4 / f) and holds(found.end, tangent(right), f)
    assert 10 < found.width_px < 30
    plain = replace(stretch, right=replace(stretch.right, outside_px=stretch.right.outside_px + 40))
    assert (
        look_round(shown.views, shown.world, plain, -1).plain_px == found.plain_px + 40
    )  # it may stand anywhere there
    assert look_round(shown.views, shown.world, stretch, 1) is None
    assert follow_top(shown.views, shown.world, own, Side.LEFT, 1.0) is None  # the camera stands below it


@pytest.mark.parametrize("share", [0.5, 0.6, 0.7, 0.8])
def test_where_a_face_goes_on_as_well_there_is_no_second_one(share):
    """Taken to end within it, and blurred: five to nine pixels of it had been a face round a corner."""
    sharp = rendered(1100.0, (250.0, 110.0, 110.0), 8.0).views
    shown = of_pair(*(cv2.GaussianBlur(picture, (0, 0), 4.0) for picture in (sharp.left, sharp.right)))
    stretch = shown.stretch()
    within = stretch.right.at + share * (stretch.left.at - stretch.right.at)
    early = replace(stretch, left=End(within, Past.OPEN, 2.5, 2.5, 2.5))
    assert look_round(shown.views, shown.world, early, 1) is None


@pytest.mark.parametrize("off_mm", [0.0, -6.0, 6.0, 15.0])
def test_tops_are_followed_backwards_from_above_also_where_their_height_is_wrong(off_mm):
    shown, own = rendered(*FROM_ABOVE, camera=HIGH), true_box(*FROM_ABOVE)
    for side, depth in ((Side.RIGHT, own[Own.LEFT]), (Side.LEFT, own[Own.RIGHT])):
        unknown = own.copy()
        unknown[side.other.extent] = 100.0
        unknown[Own.HEIGHT] += off_mm
        height_mm, end = follow_top(shown.views, shown.world, unknown, side, 3.0)
        assert end.past is Past.OPEN and end.at == pytest.approx(depth, abs=12)
        assert height_mm == pytest.approx(own[Own.HEIGHT], abs=1.0)


@pytest.mark.parametrize("std_mm", [0.0, 3.0, np.inf])
def test_a_top_whose_first_rows_show_nothing_stays_as_high_as_it_was(std_mm):
    shown, own = rendered(*FROM_ABOVE, camera=HIGH), true_box(*FROM_ABOVE)
    for side in Side:
        _, points = _top(shown.world, own, side, own[Own.HEIGHT], _FIRST_PX + 4)
        strip = np.concatenate([points[0, [0, -1]], points[-1, [-1, 0]]])
        levels = [[picture.copy() for picture in level] for level in shown.views.pair.levels]
        for level in levels:
            for right, picture in enumerate(level):
                zoom = len(picture) / len(shown.views.left)
                corners = np.rint(zoom * shown.world.pixels(strip, bool(right))).astype(np.int32)
                strip_of = cv2.fillConvexPoly(np.zeros(picture.shape[:2], np.uint8), corners, 1)
                picture[cv2.dilate(strip_of, np.ones((25, 25), np.uint8)) == 1] = 0
        plain = replace(shown.views, pair=replace(shown.views.pair, levels=tuple(map(tuple, levels))))
        found = follow_top(plain, shown.world, own, side, std_mm)
        assert found is None or found[0] == own[Own.HEIGHT]


def test_what_the_picture_cuts():
    shown = rendered(520.0, (260.0, 260.0, 220.0), 30.0, lateral=230.0)
    stretch = shown.stretch()
    assert stretch.left.may_be_cut and stretch.right.is_sure
    assert look_round(shown.views, shown.world, stretch, 1) is None


@pytest.mark.parametrize("before_mm", [60.0, 90.0])
def test_a_foot_that_a_board_hides_is_taken_to_reach_the_floor(before_mm):
    """What is seen of the face ends above the floor, but something nearer shows below: that is no box held up."""
    shown = rendered(800.0, (260.0, 260.0, 300.0), 25.0, before_mm=before_mm)
    region = max(shown.regions, key=lambda region: region.top_mm)
    stretch = follow_face(
        shown.views, shown.world, find_face(shown.priors.floor, region, shown.views.pair), region.top_mm
    )
    assert stretch.low_mm > 0.4 * before_mm and stretch.foot_mm == 0 and not stretch.is_cut_below
    assert see_box(shown.views, shown.priors, region).refused is None


def test_a_face_held_above_the_floor_ends_there():
    stretch = rendered(700.0, (260.0, 260.0, 220.0), 30.0, up_mm=60.0).stretch()
    assert stretch.foot_mm == pytest.approx(60, abs=3) and stretch.low_mm == pytest.approx(60, abs=5)


@pytest.mark.parametrize("side", Side)
def test_a_face_whose_place_is_known_is_followed_to_its_end(side):
    """Outwards from the corner, however wide it was taken to be."""
    case = (700.0, (260.0, 240.0, 220.0), 30.0)
    shown, own = rendered(*case), true_box(*case)
    taken = own.copy()
    taken[side.extent] = 100.0
    end = follow_again(shown.views, shown.world, taken, side)
    true = tangent(Box(own).edge(side.end)[0])
    assert end.past is Past.OPEN and holds(end, true, float(shown.world.focal)) and end.inside_px < 12
