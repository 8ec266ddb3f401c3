"""Which outline is which object: a laser that moved, or that nobody knows, pieces, and scans of another moment."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from stereolib.base import turn_2d
from stereolib.measurement import LaserOnFloor
from stereolib.measurement.pairing import Place, pair_up

HERE = LaserOnFloor(np.eye(2), np.zeros(2), np.diag([1.0, 1.0, 1e-6, 1e-8]))


def outline(distance, bearing_deg, width=200.0):
    """Readings on an upright face across the line of sight."""
    a = np.radians(bearing_deg)
    along = np.linspace(-0.5, 0.5, 12)[:, None] * width
    return distance * np.array([np.cos(a), np.sin(a)]) + along * [-np.sin(a), np.cos(a)]


def paired(pictured, scanned, laser=HERE, boxes=None):
    footprints = [SimpleNamespace(segment=SimpleNamespace(points_mm=points)) for points in scanned]
    return pair_up([Place.of(points) for points in pictured], footprints, laser, boxes=boxes)


def test_place_of_points():
    place = Place.of(np.array([[500.0, 500.0], [400.0, 0.0], [500.0, -500.0]]))
    assert (place.right_rad, place.left_rad) == pytest.approx((-np.pi / 4, np.pi / 4))
    assert (place.near_mm, place.far_mm) == pytest.approx((400, 500 * 2**0.5))
    assert place.overlap(place) == 1 and place.overlap(Place(1.0, 1.2, 400, 500)) < 0


def test_what_stands_straight_behind_is_not_all_around():
    behind, ahead = outline(700, 180), outline(740, 0)
    assert Place.of(behind).span_rad == pytest.approx(Place.of(outline(700, 170)).span_rad)
    assert Place.of(behind).overlap(Place.of(ahead)) < 0
    pairs = paired([outline(700, 0)], [ahead, behind])
    assert (pairs.both, pairs.scanned) == (((0, 0),), (1,))
    assert paired([outline(700, 0)], [behind]).both == ()


def test_objects_find_their_outlines():
    seen = [outline(700, -15), outline(900, 10), outline(1200, 30)]
    found = paired(seen, [seen[2], seen[0], seen[1]])
    assert set(found.both) == {(0, 1), (1, 2), (2, 0)} and not (found.pictured or found.scanned or found.warnings)


@pytest.mark.parametrize("move", [(40.0, -40.0, 0.0), (0.0, 0.0, 5.0), (-30.0, 20.0, -4.0)])
def test_a_laser_that_has_moved_still_shows_the_same_objects(move):
    x, y, yaw = move
    seen = [outline(700, -15), outline(900, 10)]
    scanned = [(points - [x, y]) @ turn_2d(np.radians(yaw)) for points in seen]
    assert set(paired(seen, scanned).both) == {(0, 0), (1, 1)}


def test_one_of_two_neighbours_takes_the_outline():
    seen = [outline(800, -8), outline(830, 8)]
    found = paired(seen, [outline(830, 8)])
    assert found.both == ((1, 0),) and found.pictured == (0,)


def test_what_only_one_shows_stands_alone():
    found = paired([outline(700, -20)], [outline(700, 20), outline(700, -20), outline(600, 100)])
    assert found.both == ((0, 1),) and set(found.scanned) == {0, 2} and found.pictured == ()


def test_two_distances_in_one_direction_are_not_combined():
    found = paired([outline(700, 0)], [outline(1100, 0)])
    assert found.both == () and found.pictured == (0,) and found.scanned == (0,)
    (text,) = found.warnings
    assert "at 1100 mm and the pair at 700 mm" in text and "same time" in text


def test_of_what_is_no_box_in_the_pictures_no_other_moment_is_said():
    found = paired([outline(700, 0)], [outline(1100, 0)], boxes=[False])
    assert found.pictured == (0,) and found.scanned == (0,) and found.warnings == ()


def test_a_piece_of_an_outline_is_no_second_object():
    whole = outline(700, 0, width=400)
    found = paired([outline(700, -6, width=230), outline(705, 12, width=80)], [whole])
    assert found.both == ((0, 0),) and found.pictured == () and found.pieces == ((1, 0),)


@pytest.mark.parametrize(
    ("boxes", "pieces"), [((False, True), ()), ((False, False), ((1, 0),)), ((True, True), ((1, 0),))]
)
def test_a_box_is_a_piece_of_nothing_but_a_box(boxes, pieces):
    seen = [outline(700, -6, width=230), outline(705, 12, width=80)]
    found = paired(seen, [outline(700, 0, width=400)], boxes=boxes)
    assert found.both == ((0, 0),) and found.pieces == pieces and found.pictured == (() if pieces else (1,))


def test_nothing_pairs_with_nothing():
    assert paired([], []).both == () and paired([], [outline(700, 0)]).scanned == (0,)


def test_what_stands_behind_or_before_a_paired_object_is_no_other_moment():
    """The scan sees the nearer one, or over a low one; another outline in that direction is still said."""
    near, far = outline(1000, 0), outline(1600, 0, width=500)
    for seen in ([near], [far]):
        found = paired([near, far], seen)
        assert len(found.both) == 1 and found.warnings == ()
    found = paired([near, outline(1600, 25)], [near, outline(1000, 25)])
    assert found.both == ((0, 0),) and "at 1000 mm and the pair at 1600 mm" in found.warnings[0]
