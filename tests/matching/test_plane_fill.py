"""Holes go on with the plane of the surface behind them, and with no other."""

import numpy as np
import pytest

from stereolib.matching.filling import fill_background
from stereolib.matching.plane_fill import continue_background, fill_by_color

ROWS, COLUMNS = np.mgrid[0:80, 0:160].astype(np.float32)
WALL = 20 + 0.08 * COLUMNS - 0.05 * ROWS
BOX = (COLUMNS >= 90) & (COLUMNS < 130) & (ROWS >= 20)


def worst(filled, truth, hole):
    return np.abs(filled - truth)[hole].max()


def noisy(disparity, seed=0, sigma_px=0.2):
    return (disparity + np.random.default_rng(seed).normal(0, sigma_px, disparity.shape)).astype(np.float32)


@pytest.mark.parametrize("hole", [COLUMNS < 40, COLUMNS >= 130], ids=["left", "right"])
def test_a_slanted_wall_goes_on_to_the_border(hole):
    seen = np.where(hole, np.nan, noisy(WALL))
    assert worst(continue_background(seen), WALL, hole) < 1
    assert worst(fill_background(seen), WALL, hole) > 2


def test_what_a_box_hides_is_the_wall_behind_it_and_not_the_box():
    shadow = (COLUMNS >= 50) & (COLUMNS < 90) & (ROWS >= 20)
    seen = np.where(shadow, np.nan, noisy(np.where(BOX, 60, WALL)))
    assert worst(continue_background(seen), WALL, shadow) < 1
    assert worst(fill_background(seen), WALL, shadow) > 2


def test_another_surface_in_the_window_tilts_nothing():
    """A level wall ends, a few rows above a slanted nearer thing, at a hole: it goes on level."""
    thing = (ROWS >= 34) & (COLUMNS < 100)
    level = np.full_like(WALL, 20.0)
    hole = (COLUMNS >= 60) & (ROWS < 34)
    seen = np.where(hole, np.nan, noisy(np.where(thing, 40 + 0.3 * COLUMNS, level)))
    assert worst(continue_background(seen), level, hole) < 1.5


@pytest.mark.parametrize("steep", [0.1, 0.4, 0.8])
@pytest.mark.parametrize("hole", [COLUMNS < 90, (COLUMNS >= 50) & (COLUMNS < 90)], ids=["border", "inside"])
def test_all_rows_of_a_noisy_floor_go_on_alike(hole, steep):
    """Each row alone would go its own way; and the rows beside it are no other surfaces, however steep it is."""
    floor = 40 - 0.03 * COLUMNS + steep * ROWS
    inner = hole & (ROWS >= 10) & (ROWS < 70)
    off = np.array([continue_background(np.where(hole, np.nan, noisy(floor, k, 0.5))) - floor for k in range(4)])
    assert np.sqrt(np.mean(off[:, inner] ** 2)) < 0.4


def test_between_two_sides_nothing_is_nearer_than_both_and_nothing_lies_behind_infinity():
    steep = np.where(COLUMNS < 60, 5 + 0.3 * COLUMNS, 30.0)
    between = (COLUMNS >= 60) & (COLUMNS < 150)
    filled = continue_background(np.where(between, np.nan, steep))
    assert filled[between].max() <= 30 + 1e-3
    assert continue_background(np.where(COLUMNS < 60, np.nan, 0.2 * (COLUMNS - 60))).min() == 0


def test_short_holes_are_level_and_what_is_known_stays():
    seen = noisy(WALL)
    seen[:, 50:53] = np.nan
    filled = continue_background(seen)
    np.testing.assert_array_equal(filled, fill_background(seen))
    np.testing.assert_array_equal(filled[:, :50], seen[:, :50])


def test_a_little_more_noise_changes_little():
    hole = COLUMNS < 40
    filled = [continue_background(np.where(hole, np.nan, noisy(WALL, sigma_px=s))) for s in np.arange(0.1, 1, 0.1)]
    assert max(np.abs(np.diff(filled, axis=0))[:, hole].mean(axis=1)) < 0.2


@pytest.mark.parametrize("shape", [(1, 1), (1, 30), (30, 1), (5, 7)])
def test_maps_of_any_size(shape):
    nothing = np.full(shape, np.nan)
    assert np.isnan(continue_background(nothing)).all()
    nothing[-1, -1] = 4
    assert (continue_background(nothing) == 4).all()


NEAR = COLUMNS < 60  # a near thing that ends at column 14 of the upper rows, which the right picture sees from 40 on
SEEN = np.where(ROWS < 50, np.where(COLUMNS < 40, np.nan, np.where(NEAR, 40, 10)), 10).astype(np.float32)


def picture(ends_at, levels, channels=3):
    """What a camera shows of it: the thing has one grey, what is behind it another."""
    thing = (ROWS < 50) & (ends_at <= COLUMNS) & NEAR
    shown = np.where(thing, *levels) + np.random.default_rng(2).normal(0, 4, thing.shape)
    shown = shown.round().clip(0, 255).astype(np.uint8)
    return np.repeat(shown[..., None], channels, axis=2) if channels else shown


@pytest.mark.parametrize("channels", [0, 3])
def test_at_the_border_a_near_thing_ends_where_its_colour_does(channels):
    filled = continue_background(SEEN)
    assert (np.abs(filled[:50, :40] - 40) < 1).all()  # its plane alone goes on to the border
    found = fill_by_color(filled, SEEN, picture(14, (180, 60), channels))
    assert (found[20:45, :10] == 10).all() and (np.abs(found[5:45, 20:40] - 40) < 1).all()
    np.testing.assert_array_equal(found[:, 40:], filled[:, 40:])
    np.testing.assert_array_equal(found[50:], filled[50:])


@pytest.mark.parametrize("shown", [picture(0, (180, 60)), picture(14, (66, 60)), picture(14, (100, 100))])
def test_at_the_border_colours_that_tell_nothing_change_nothing(shown):
    filled = continue_background(SEEN)
    np.testing.assert_array_equal(fill_by_color(filled, SEEN, shown), filled)


def test_at_the_border_nothing_nearer_is_taken():
    far = np.where(np.isnan(SEEN) | (SEEN == 40), SEEN / 8, 20).astype(np.float32)
    filled = continue_background(far)
    np.testing.assert_array_equal(fill_by_color(filled, far, picture(14, (180, 60))), filled)


FACE = (COLUMNS >= 50) & (COLUMNS < 110)  # of a near thing; in its middle nothing was matched
INNER = np.where(FACE, 40, 10).astype(np.float32)
GREY = np.where(FACE, 180, 60) + np.random.default_rng(3).normal(0, 4, FACE.shape)
GREY = GREY.round().astype(np.uint8)


def test_a_hole_that_nothing_hides_goes_to_the_surface_of_its_colour_though_that_is_nearer():
    hole = (COLUMNS >= 80) & (COLUMNS < 130) & (ROWS > 10) & (ROWS < 70)  # over the right end of the face
    seen = np.where(hole, np.float32(np.nan), INNER)
    filled = continue_background(seen)
    assert (filled[40, 85:105] == 10).all()
    found = fill_by_color(filled, seen, GREY)
    assert (found[20:60, 82:105] == 40).all() and (found[20:60, 114:] == 10).all()


def test_where_a_near_surface_hides_the_far_one_its_colour_changes_nothing():
    hole = (COLUMNS >= 25) & (COLUMNS < 50) & (ROWS > 10)  # left of the face, no wider than what it hides
    seen = np.where(hole, np.float32(np.nan), INNER)
    like_it = np.where(COLUMNS >= 25, 180, 60).astype(np.uint8)
    filled = continue_background(seen)
    np.testing.assert_array_equal(fill_by_color(filled, seen, like_it), filled)


def test_a_hole_takes_what_stands_above_it_where_its_row_shows_nothing_of_that_colour():
    """A far wall between two things, of which in some rows nothing was matched."""
    wall = (COLUMNS >= 50) & (COLUMNS < 110)
    hole = wall & (ROWS >= 40)
    seen = np.where(hole, np.float32(np.nan), np.where(wall, 10, 40)).astype(np.float32)
    filled = continue_background(seen)
    assert (filled[60, 60:100] == 40).all()
    assert (fill_by_color(filled, seen, GREY)[45:, 55:105] == 10).all()


@pytest.mark.parametrize("seen", [WALL, np.full_like(WALL, np.nan)], ids=["no hole", "nothing"])
def test_without_a_hole_or_a_match_the_border_stays(seen):
    np.testing.assert_array_equal(fill_by_color(seen, seen, picture(14, (180, 60))), seen)
