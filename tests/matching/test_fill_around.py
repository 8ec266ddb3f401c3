"""Holes take the surface around them that has their colour, unless the right camera would have seen it."""

import numpy as np
import pytest

from stereolib.matching import continue_background, fill_around, fill_from_around

ROWS, COLUMNS = np.mgrid[0:80, 0:160].astype(np.float32)
UNKNOWN = np.full(ROWS.shape, np.nan, np.float32)  # a right view that tells nothing
NEAR = COLUMNS < 60  # a near thing that ends at column 14 of the upper rows, which the right picture sees from 40 on
SEEN = np.where(ROWS < 50, np.where(COLUMNS < 40, np.nan, np.where(NEAR, 40, 10)), 10).astype(np.float32)


def shown(is_bright, levels=(180, 60), *, seed=2, sigma=4, channels=0):
    """What a camera shows of a part and of what is around it."""
    picture = np.where(is_bright, *levels) + np.random.default_rng(seed).normal(0, sigma, is_bright.shape)
    picture = picture.round().clip(0, 255).astype(np.uint8)
    return np.repeat(picture[..., None], channels, axis=2) if channels else picture


def thing(ends_at):
    return (ROWS < 50) & (ends_at <= COLUMNS) & NEAR


def right_view(disparity_px):
    """What the right camera has of a left view: of several things at a place the nearest one."""
    right = np.full_like(disparity_px, np.nan)
    for y, x in np.ndindex(disparity_px.shape):
        at = round(x - float(disparity_px[y, x]))
        if at >= 0:
            right[y, at] = np.fmax(right[y, at], disparity_px[y, x])
    return right


def is_at(found, level_px):
    return bool((np.abs(found - level_px) < 0.01).all())


def around(seen, left, right_px=UNKNOWN, guess_px=UNKNOWN, **settings):
    return fill_from_around(seen, guess_px, right_px, left, **settings)


@pytest.mark.parametrize("channels", [0, 3])
def test_at_the_border_a_near_thing_ends_where_its_colour_does(channels):
    filled = continue_background(SEEN)
    assert (np.abs(filled[:50, :40] - 40) < 1).all()  # its plane alone goes on to the border
    found = around(SEEN, shown(thing(14), channels=channels))
    assert is_at(found[2:48, :13], 10) and is_at(found[2:48, 15:40], 40)
    known = np.isfinite(SEEN)
    np.testing.assert_array_equal(found[known], SEEN[known])


@pytest.mark.parametrize("left", [shown(thing(0)), shown(thing(14), (66, 60)), shown(thing(14), (100, 100))])
def test_colours_that_tell_nothing_change_nothing(left):
    assert is_at(around(SEEN, left), continue_background(SEEN))


def test_a_hole_that_nothing_hides_goes_to_the_surface_of_its_colour_though_that_is_nearer():
    face = (COLUMNS >= 50) & (COLUMNS < 110)  # of a near thing
    hole = (COLUMNS >= 80) & (COLUMNS < 130) & (ROWS > 10) & (ROWS < 70)  # over its right end
    seen = np.where(hole, np.float32(np.nan), np.where(face, 40, 10)).astype(np.float32)
    assert (continue_background(seen)[40, 85:105] == 10).all()
    found = around(seen, shown(face))
    assert is_at(found[12:69, 80:109], 40) and is_at(found[12:69, 111:], 10)


def test_what_would_hide_what_the_right_camera_has_seen_is_not_taken_whatever_its_colour():
    face = (COLUMNS >= 100) & (COLUMNS < 140)
    truth = np.where(face, 40, 10).astype(np.float32)
    hole = (COLUMNS >= 70) & (COLUMNS < 100)  # which the face hides from the right camera
    seen, like_it = np.where(hole, np.float32(np.nan), truth), shown(hole | face)
    assert is_at(around(seen, like_it)[:, 75:95], 40)  # colour alone
    assert is_at(around(seen, like_it, right_view(truth)), truth)
    elsewhere = np.where(np.isnan(right_view(truth)), np.float32(np.nan), np.float32(3))  # that the left one has not
    assert is_at(around(seen, like_it, elsewhere)[:, 75:95], 40)


def test_a_wall_that_no_row_of_the_hole_shows_goes_on_as_a_plane():
    """A slanted far wall between two things, seen above them alone."""
    wall, gap = 10 + 0.1 * (COLUMNS - 80) + 0.05 * ROWS, (COLUMNS >= 50) & (COLUMNS < 110)
    hole = gap & (ROWS >= 40)
    seen = np.where(hole, np.float32(np.nan), np.where(gap, wall, 40)).astype(np.float32)
    found = around(seen, shown(gap))
    assert np.abs(found - wall)[hole].max() < 0.8
    assert np.abs(continue_background(seen) - wall)[hole].max() > 20


@pytest.mark.parametrize(("edge", "stays"), [(True, True), (False, False)])
def test_a_guess_stays_where_the_picture_ends_where_it_does(edge, stays):
    """A small island of matches that nothing trusts: a thin thing, or nonsense upon an even surface."""
    seen, guess, island = np.full(ROWS.shape, 40, np.float32), UNKNOWN.copy(), np.zeros(ROWS.shape, bool)
    seen[20:60, 60:110], island[36:42, 80:86] = np.nan, True
    guess[island] = 10
    found = around(seen, shown(island if edge else ROWS < 0), guess_px=guess)
    assert (found[island] == (10 if stays else 40)).mean() > 0.85 and is_at(found[~island], 40)


def test_against_a_guess_no_colour_speaks():
    """A wire of the colour of the ground below it, which its row does not show."""
    seen, guess = np.where(ROWS < 50, 40, 10).astype(np.float32), UNKNOWN.copy()
    seen[10:45, 40:120] = np.nan
    guess[14:44, 78:82] = 60
    wire = np.isfinite(guess)
    found = around(seen, shown(wire | (ROWS >= 50)), guess_px=guess)
    assert (found[wire] == 60).mean() > 0.9


@pytest.mark.parametrize("columns", [slice(0, 12), slice(148, 160), slice(40, 60)])
def test_disparities_of_any_sign_are_held_against_the_right_view(columns):
    rng = np.random.default_rng(4)
    seen, right, guess = rng.normal(0, 30, (3, *ROWS.shape)).astype(np.float32)
    guess[rng.random(ROWS.shape) < 0.5] = np.nan
    seen[:, columns] = np.nan
    found = around(seen, shown(thing(14)), right, guess)
    assert np.isfinite(found).all()
    known = np.isfinite(seen)
    np.testing.assert_array_equal(found[known], seen[known])


def test_no_plane_of_a_ray_is_nearer_than_the_nearest_match():
    slanted = np.where(COLUMNS < 60, 5 + 0.1 * COLUMNS, np.nan).astype(np.float32)
    rims = np.array([[40 * 160 + 59, 40 * 160 + 30], [-1, 40 * 160 + 30]])  # of two holes and two rays
    found = fill_around._at_holes(slanted, np.array([40, 40]), np.array([150, 50]), rims)
    assert found[0] == pytest.approx([10.9, 10.9], abs=1e-4) and found[1, 1] == pytest.approx(10, abs=0.1)


def test_neighbours_choose_together():
    """In noise as strong as the contrast single pixels would choose at random, and hardly one does."""
    left = shown(thing(14), (84, 60), sigma=8)
    found = around(SEEN, left)[2:48, :40]
    right = np.where(np.arange(40) < 14, np.abs(found - 10) < 1, np.abs(found - 40) < 1)
    assert right.mean() > 0.97


def test_a_little_more_contrast_changes_little():
    left = [shown(thing(14), (level, 60)) for level in range(64, 110, 2)]
    is_far = np.array([around(SEEN, one)[2:48, :14] < 20 for one in left]).mean(axis=(1, 2))
    assert is_far[0] < 0.02 and is_far[-1] > 0.98 and np.diff(is_far).min() > -0.02


@pytest.mark.parametrize("shape", [(1, 1), (1, 30), (30, 1), (5, 7)])
def test_maps_of_any_size(shape):
    nothing, left = np.full(shape, np.nan, np.float32), np.zeros(shape, np.uint8)
    assert np.isnan(fill_from_around(nothing, nothing, nothing, left)).all()
    one = nothing.copy()
    one[-1, -1] = 4
    assert (fill_from_around(one, nothing, nothing, left) == 4).all()
    whole = np.random.default_rng(1).random(shape).astype(np.float32)
    np.testing.assert_array_equal(fill_from_around(whole, nothing, nothing, left), whole)


def test_parts_of_other_shapes_and_settings_that_mean_nothing_are_refused():
    with pytest.raises(ValueError, match=r"maps have shapes .*\(80, 160\).* the picture \(80, 159\)"):
        around(SEEN, np.zeros((80, 159), np.uint8))
    for wrong in ({"unlike": 0.0}, {"other": -1.0}, {"unlike": np.nan}, {"other": np.inf}):
        with pytest.raises(ValueError, match="need finite unlike > 0 and other > 0"):
            around(SEEN, shown(thing(14)), **wrong)
