"""Holes go on with the plane of the surface behind them, and with no other."""

import numpy as np
import pytest

from stereolib.matching.filling import fill_background
from stereolib.matching.plane_fill import continue_background, planes_at

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


@pytest.mark.parametrize("dx", [np.arange(-24, 25, 8)[None], np.array([[0, 10, 20]] * 3)], ids=["shared", "own"])
def test_planes_are_those_of_the_map(dx):
    """With holes, another surface beside, and at the map's corner."""
    seen = np.where(BOX, 60, WALL).astype(np.float32)
    seen[::7] = np.nan
    rows, columns = np.array([1, 40, 78]), np.array([1, 65, 20])
    a, b, c = planes_at(seen, rows, columns, dx, np.arange(-24, 25, 8)).T
    np.testing.assert_allclose(a, seen[rows, columns], atol=0.2)
    np.testing.assert_allclose(b, 0.08, atol=0.02)  # the prior pulls where places are few
    np.testing.assert_allclose(c, -0.05, atol=0.01)
