"""Edges beyond an end or a height that a box is taken to have: a line printed on a face ends none."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.pictured import HIGH, masks, of_pair, rendered, true_box

from stereolib.measurement.box import Box, Edge, Own, Side
from stereolib.measurement.edges_beyond import (
    is_matched_otherwise,
    is_other_beyond,
    matched_beyond,
    other_inside_mm,
    shown_beyond,
    upper_edge_beyond,
    uprights_below,
    uprights_beyond,
)
from stereolib.measurement.outline import edge_direction

CASES = {
    "near": ((700.0, (260.0, 260.0, 220.0), 30.0), {}),
    "far": ((1100.0, (300.0, 200.0, 250.0), 40.0), {}),
}
ENDS = (Edge.RIGHT_END, Edge.LEFT_END)


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("share", [0.5, 0.75])
def test_an_end_too_near_is_told_with_the_true_one(case, side, share):
    box, how = CASES[case]
    shown, own = rendered(*box, **how), true_box(*box)
    short = own.copy()
    short[side.extent] *= share
    extent, odds = upper_edge_beyond(shown.views.pair.pictures, shown.world, short, side)
    assert extent == pytest.approx(own[side.extent], rel=0.06) and odds > (6 if share < 0.6 else 4)


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("case", CASES)
def test_nothing_goes_on_beyond_a_true_end(case, side):
    box, how = CASES[case]
    shown, own = rendered(*box, **how), true_box(*box)
    _, odds = upper_edge_beyond(shown.views.pair.pictures, shown.world, own, side)
    assert odds < 2


@pytest.mark.parametrize(("case", "share"), [("near", 0.5), ("near", 0.75), ("far", 0.8)])
def test_a_height_too_low_is_told_with_the_true_one(case, share):
    box, how = CASES[case]
    shown, own = rendered(*box, **how), true_box(*box)
    low = own.copy()
    low[Own.HEIGHT] *= share
    height, odds = uprights_beyond(shown.views.pair.pictures, shown.world, low, ENDS)
    assert height == pytest.approx(own[Own.HEIGHT], rel=0.04) and odds > 6


@pytest.mark.parametrize("case", CASES)
def test_nothing_goes_on_above_a_true_height(case):
    box, how = CASES[case]
    shown, own = rendered(*box, **how), true_box(*box)
    _, odds = uprights_beyond(shown.views.pair.pictures, shown.world, own, ENDS)
    assert odds < 2


@pytest.mark.parametrize("up_mm", [0.0, 30.0, 60.0])
@pytest.mark.parametrize(
    "box", [(700.0, (260.0, 260.0, 220.0), 30.0), (900.0, (200.0, 300.0, 200.0), -30.0)], ids=["right", "left"]
)
def test_uprights_end_no_lower_than_the_box_does(box, up_mm):
    """Followed down to a third of its height, or to 1 mm above its foot, whatever its shadow on the floor shows."""
    shown, own = rendered(*box, up_mm=up_mm), true_box(*box)
    own[Own.HEIGHT] += up_mm
    height, odds = uprights_below(shown.views.pair.pictures, shown.world, own, ENDS, own[Own.HEIGHT] / 3)
    assert up_mm - 3 < height < up_mm + 20 and odds > 5 and (up_mm or height < 6)
    if up_mm:
        height, odds = uprights_below(shown.views.pair.pictures, shown.world, own, ENDS, up_mm + 1)
        assert up_mm - 3 < height and odds < 1


def test_what_stands_behind_in_line_with_an_edge_of_one_picture_does_not_raise_it():
    """A dark post far behind, above the right end in the left picture: in the right one it is elsewhere."""
    box, how = CASES["far"]
    shown, own = rendered(*box, **how), true_box(*box)
    pictures = shown.views.left.copy(), shown.views.right.copy()
    column, top = shown.world.pixels(Box(own).edge(Edge.RIGHT_END)[1:])[0]
    for picture, shift in zip(pictures, (0, 15), strict=True):
        picture[int(top) - 60 : int(top) - 2, round(column) - shift :] = 20
    _, odds = uprights_beyond(pictures, shown.world, own, [Edge.RIGHT_END])
    assert odds < 2
    _, alone = uprights_beyond((pictures[0], None), shown.world, own, [Edge.RIGHT_END])
    assert alone > 6


def test_an_edge_seen_from_above_tells_nothing():
    """Its shadow on the floor is parallel to it, and may lie in its line."""
    box = (700.0, (240.0, 300.0, 200.0), 35.0)
    shown, own = rendered(*box, camera=HIGH), true_box(*box)
    own[Own.LEFT] *= 0.5
    assert upper_edge_beyond(shown.views.pair.pictures, shown.world, own, Side.LEFT) is None


def test_what_tells_nothing():
    box = (700.0, (260.0, 260.0, 220.0), 30.0)
    shown, own = rendered(*box), true_box(*box)
    rng, pictures = np.random.default_rng(0), shown.views.pair.pictures
    noise = tuple(rng.uniform(0, 1, picture.shape).astype(np.float32) for picture in pictures)
    assert upper_edge_beyond(noise, shown.world, own, Side.RIGHT) is None
    assert (
        uprights_beyond(noise, shown.world, own, ENDS) is None
        and uprights_beyond(pictures, shown.world, own, []) is None
    )
    assert uprights_below(noise, shown.world, own, ENDS, 100.0) is None
    assert uprights_below(pictures, shown.world, own, [], 100.0) is None
    narrow, high, behind = own.copy(), own.copy(), own.copy()
    narrow[Own.RIGHT], high[Own.HEIGHT], behind[Own.X] = 3.0, 5000.0, -2000.0
    for odd in (narrow, high, behind):
        assert upper_edge_beyond(pictures, shown.world, odd, Side.RIGHT) is None
    for odd in (high, behind):
        assert uprights_beyond(pictures, shown.world, odd, ENDS) is None
    assert uprights_below(pictures, shown.world, behind, ENDS, 100.0) is None
    assert uprights_below(pictures, shown.world, own, ENDS, own[Own.HEIGHT] - 1) is None  # hardly anything is known


def outer_edges(side):
    return side.top, side.end, Edge.CORNER


def without_a_quarter(own, side, edge):
    """A box with an edge so far inside its face, and how far that is, mm."""
    missing = 0.25 * own[Own.HEIGHT if edge is side.top else side.extent]
    return own + (missing if edge is Edge.CORNER else -missing) * edge_direction(edge, own, side), missing


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("case", [*CASES, "high"])
def test_what_was_matched_of_a_face_ends_where_it_does(case, side):
    box, how = CASES[case] if case in CASES else (CASES["near"][0], {"camera": HIGH})
    shown, own = rendered(*box, **how), true_box(*box)
    found = matched_beyond(shown.regions[0], shown.world, own, side, outer_edges(side))
    assert set(found) == set(outer_edges(side)) and max(beyond_px for beyond_px, _ in found.values()) < 2.0


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("case", CASES)
def test_a_line_on_a_face_beyond_which_it_was_matched_is_no_edge(case, side):
    """A quarter of the face is missing: what was matched tells it, but for what SGBM spills over the outline."""
    box, how = CASES[case]
    shown, own = rendered(*box, **how), true_box(*box)
    for edge in outer_edges(side):
        inside, missing = without_a_quarter(own, side, edge)
        beyond_px, more_mm = matched_beyond(shown.regions[0], shown.world, inside, side, [edge])[edge]
        assert beyond_px > 8 and more_mm == pytest.approx(missing, abs=25)


def test_a_face_too_narrow_to_tell_anything_goes_on_nowhere():
    box, how = CASES["near"]
    shown, own = rendered(*box, **how), true_box(*box)
    own[Own.RIGHT] = 1.0
    assert matched_beyond(shown.regions[0], shown.world, own, Side.RIGHT, [Edge.RIGHT_END]) == {}


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("case", CASES)
def test_both_pictures_show_a_face_beyond_a_line_on_it_and_not_beyond_its_outline(case, side):
    box, how = CASES[case]
    shown, own = rendered(*box, **how), true_box(*box)
    for edge in outer_edges(side):
        inside, missing = without_a_quarter(own, side, edge)
        assert shown_beyond(shown.views, shown.world, inside, side, edge, missing) >= 7
        assert shown_beyond(shown.views, shown.world, own, side, edge, missing) < 4


@pytest.mark.parametrize("side", Side)
def test_above_a_face_that_is_seen_from_above_lies_the_top(side):
    """Its disparities are not so different that the face could not go on there: which of both fits better tells."""
    box = (900.0, (220.0, 330.0, 130.0), -25.0)
    shown, own = rendered(*box, camera=(np.radians(-40), 950.0)), true_box(*box)
    assert shown_beyond(shown.views, shown.world, own, side, side.top, 40.0) < 0
    low = own.copy()
    low[Own.HEIGHT] -= 45.0
    assert shown_beyond(shown.views, shown.world, low, side, side.top, 40.0) > 0


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("case", CASES)
def test_a_face_does_not_go_on_where_something_else_was_matched(case, side):
    """Its upper edge may be in line with a print on what stands before it."""
    box, how = CASES[case]
    shown, own = rendered(*box, **how), true_box(*box)
    inside, extent = own.copy(), float(own[side.extent])
    inside[side.extent] *= 0.75
    assert not is_matched_otherwise(shown.views, shown.world, inside, side, extent)
    for off_px, otherwise in ((12.0, True), (np.nan, False)):
        views = replace(shown.views, disparity_px=shown.views.disparity_px + np.float32(off_px))
        assert is_matched_otherwise(views, shown.world, inside, side, extent) is otherwise
    assert not is_matched_otherwise(shown.views, shown.world, own, side, extent + 1.0)  # no more than SGBM spills


def painted(shown, own, inside, color):
    """The pictures with one colour on the box, or on all that is seen beside it down to near its foot."""
    pictures = [picture.copy() for picture in shown.views.pair.pictures]
    for picture, box in zip(pictures, masks(shown, own), strict=True):
        beside = ~box & (np.arange(len(box))[:, None] < np.flatnonzero(box.any(axis=1))[0] + 100)
        picture[box if inside else beside] = color
    return of_pair(*pictures).views


@pytest.mark.parametrize("side", Side)
def test_plain_lines_beyond_an_outline_count_for_nothing(side):
    """SGBM takes what is plain beside a surface for that surface, and both pictures show it alike."""
    box, how = CASES["near"]
    shown, own = rendered(*box, **how), true_box(*box)
    views = painted(shown, own, False, 180)
    for edge in outer_edges(side):
        assert shown_beyond(views, shown.world, own, side, edge, 40.0) < 4


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("case", CASES)
def test_another_colour_lies_beyond_an_outline_and_the_same_one_beyond_a_line(case, side):
    box, how = CASES[case]
    shown, own = rendered(*box, **how), true_box(*box)
    views = painted(shown, own, True, (90, 120, 150))
    for edge in (side.top, side.end):
        line = own - 0.3 * own[Own.HEIGHT if edge is side.top else side.extent] * edge_direction(edge, own, side)
        assert is_other_beyond(views, shown.world, own, side, edge)
        assert not is_other_beyond(views, shown.world, line, side, edge)


def test_beyond_the_pictures_rim_no_colour_is_known():
    box, how = CASES["near"]
    shown, own = rendered(*box, **how), true_box(*box)
    own[Own.HEIGHT] = 800.0
    assert not is_other_beyond(shown.views, shown.world, own, Side.RIGHT, Edge.TOP_RIGHT)


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("case", CASES)
def test_a_face_that_is_taken_to_reach_over_what_stands_beside_it_may_end_where_its_colours_do(case, side):
    box, how = CASES[case]
    shown, own = rendered(*box, **how), true_box(*box)
    views = painted(shown, own, True, (90, 120, 150))
    assert other_inside_mm(views, shown.world, own, side) == 0.0
    for share in (1.1, 1.3):
        wide = own.copy()
        wide[side.extent] *= share
        too_much = (share - 1) * own[side.extent]
        assert other_inside_mm(views, shown.world, wide, side) == pytest.approx(too_much, abs=6.0)
    narrow = own.copy()
    narrow[side.extent] *= 0.8
    assert other_inside_mm(views, shown.world, narrow, side) == 0.0


def striped(views, world, own, side, first, last, height):
    """The pictures with a stripe on a face, from one share of its width to another, up to a share of its height."""
    band = np.zeros((4, 3))
    band[:, 0 if side is Side.RIGHT else 1], band[:, 2] = (first, last, last, first), (0.0, 0.0, height, height)
    pictures = [views.left.copy(), views.right.copy()]
    for picture, right in zip(pictures, (False, True), strict=True):
        cv2.fillConvexPoly(picture, np.rint(world.pixels(Box(own).points(band), right)).astype(np.int32), (30, 30, 30))
    return replace(views, left=pictures[0], right=pictures[1])


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize(("width", "height", "told"), [(0.2, 1.0, True), (0.02, 1.0, False), (0.2, 0.6, False)])
def test_a_gap_in_a_face_is_told_with_all_beyond_it(side, width, height, told):
    """Two things side by side, taken for one: the wall between them has another colour, from foot to top."""
    box, how = CASES["near"]
    shown, own = rendered(*box, **how), true_box(*box)
    views = striped(painted(shown, own, True, (90, 120, 150)), shown.world, own, side, 0.6, 0.6 + width, height)
    found = other_inside_mm(views, shown.world, own, side)
    assert found == (pytest.approx(0.4 * own[side.extent], abs=10.0) if told else 0.0)
