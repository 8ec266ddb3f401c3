"""Pixels beside steps go to the surface of their colour, and to no other."""

import cv2
import numpy as np
import pytest

from stereolib.matching import EvenPair, SGMResult, choose_surface, fill_matched
from stereolib.matching.deviation import Kind, std_px

ROWS, COLUMNS = np.mgrid[:60, :80]
THING = (np.abs(ROWS - 30) < 18) & (np.abs(COLUMNS - 40) < 16)
TRUE = np.where(THING, 30, 10 + 0.05 * COLUMNS).astype(np.float32)
EVERYWHERE = np.ones(TRUE.shape, bool)


def picture(levels=(180, 60), channels=3, noise=4.0, gain=1.0):
    shown = np.where(THING, *levels) * gain + np.random.default_rng(2).normal(0, noise, THING.shape)
    shown = shown.round().clip(0, 255).astype(np.uint8)
    return np.repeat(shown[..., None], channels, axis=2) if channels else shown


def shifted(by_px):
    """The truth with the thing's left side wrong by some pixels; below 0 it is too wide."""
    side = (np.abs(ROWS - 30) < 18) & (24 + min(by_px, 0) < COLUMNS) & (25 + max(by_px, 0) > COLUMNS)
    return np.where(side, 10 + 0.05 * COLUMNS if by_px > 0 else 30, TRUE).astype(np.float32)


def wrong(disparity):
    return int((np.abs(disparity - TRUE) > 1).sum())


@pytest.mark.parametrize("channels", [0, 3])
@pytest.mark.parametrize("gain", [0.4, 1.0])
@pytest.mark.parametrize(("by_px", "kept"), [(-3, True), (-2, True), (-3, False), (2, False), (3, False)])
def test_a_thing_too_wide_or_too_narrow_gets_its_own_outline(by_px, kept, gain, channels):
    """Too narrow it is only where its rim was not matched."""
    was = shifted(by_px)
    found = choose_surface(was, (np.abs(was - TRUE) < 1) | kept, picture(channels=channels, gain=gain))
    assert wrong(was) >= 35 * abs(by_px) and wrong(found.disparity_px) <= 0.1 * wrong(was)
    assert (found.moved == (found.disparity_px != was)).all()


def test_what_was_matched_behind_stays_there():
    """Matching makes near things too wide, never too narrow: what looks like one is a part of the wall."""
    was = shifted(3)
    assert not choose_surface(was, EVERYWHERE, picture()).moved.any()


@pytest.mark.parametrize("slope", [0.25, 0.31, 0.8, 2.0])
def test_a_steep_surface_is_one(slope):
    """A floor that rises by so many pixels a row, with holes, has no near and no far surface to choose from."""
    floor = np.tile(np.arange(60, dtype=np.float32)[:, None] * np.float32(slope) + 10, (1, 80))
    rng = np.random.default_rng(4)
    holes = cv2.dilate((rng.random(floor.shape) < 0.005).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    tiles = (80 + 60 * (np.add.outer(np.arange(60) // 9, np.arange(80) // 9) % 2)).astype(np.uint8)
    assert not choose_surface(floor, ~holes, tiles).moved.any()


def test_a_true_outline_stays():
    found = choose_surface(TRUE, EVERYWHERE, picture())
    assert wrong(found.disparity_px) <= 2


@pytest.mark.parametrize("levels", [(100, 100), (104, 100)])
def test_colours_that_tell_nothing_change_hardly_anything(levels):
    was = shifted(-3)
    assert choose_surface(was, EVERYWHERE, picture(levels)).moved.sum() <= 0.05 * wrong(was)


def test_surfaces_that_nearly_touch_are_one():
    was = np.where(shifted(-3) > 20, 12.5, 10).astype(np.float32)
    assert not choose_surface(was, EVERYWHERE, picture()).moved.any()


def test_a_hole_is_given_to_the_surface_that_it_shows():
    """The part of the wall beside the thing was not matched, and the filling took the thing's disparity."""
    hole = (np.abs(ROWS - 30) < 18) & (COLUMNS > 16) & (COLUMNS < 25)
    was = np.where(hole, 30, TRUE).astype(np.float32)
    found = choose_surface(was, ~hole, picture())
    assert wrong(found.disparity_px) <= 0.1 * wrong(was)


def test_a_surface_too_small_for_a_vote_has_its_own_disparity():
    """What fills its rim was taken from in front; none of the places that vote lies on what is left of it."""
    patch = (np.abs(ROWS - 30) < 5) & (np.abs(COLUMNS - 40) < 7)
    true = np.where(patch, 10, 30).astype(np.float32)
    hole = patch & (COLUMNS < 37)
    shown = np.where(patch, 200, 50).astype(np.uint8)
    found = choose_surface(np.where(hole, 30, true).astype(np.float32), ~hole, shown)
    assert found.moved.any() and (found.disparity_px[found.moved] == 10).all()


def test_what_was_not_matched_does_not_vote():
    assert not choose_surface(shifted(-3), ~EVERYWHERE, picture()).moved.any()


def test_a_little_more_noise_changes_little():
    was = shifted(-3)
    shown = [picture((130, 100), noise=n) for n in np.arange(2, 16, 0.5)]
    moved = [int(choose_surface(was, EVERYWHERE, one).moved.sum()) for one in shown]
    assert moved[0] > 1.3 * moved[-1], moved
    assert np.abs(np.diff(moved)).max() <= 0.15 * moved[0], moved


@pytest.mark.parametrize("shape", [(1, 1), (1, 30), (30, 1), (5, 7)])
def test_maps_of_any_size(shape):
    level = np.full(shape, 4, np.float32)
    found = choose_surface(level, level > 0, np.zeros(shape, np.uint8))
    assert (found.disparity_px == level).all() and not found.moved.any()


def test_a_match_that_was_given_to_the_other_surface_is_called_a_guess():
    was = shifted(-3)
    right = np.full_like(was, np.nan)  # as the right camera sees it: both views agree about the too wide thing
    for y, x in np.ndindex(was.shape):
        at = round(x - float(was[y, x]))
        if at >= 0:
            right[y, at] = np.fmax(right[y, at], was[y, x])
    found = fill_matched(SGMResult(was, right, np.full_like(was, 100)), EvenPair(picture(), picture(), 1.0))
    too_wide = (was == 30) & ~THING
    assert (found.kind[too_wide] >= Kind.GAP).mean() > 0.9


def test_parts_of_other_shapes_are_refused():
    level = np.full((5, 7), 4, np.float32)
    with pytest.raises(ValueError, match=r"the picture has shape \(6, 7\), what was kept \(5, 7\), .* map \(5, 7\)"):
        choose_surface(level, level > 0, np.zeros((6, 7), np.uint8))
    for wrong, kept in ((level.astype(np.int32), level > 0), (level, np.ones((5, 7), np.uint8))):
        with pytest.raises(ValueError, match=f"the disparity map is {wrong.dtype}, what was kept {kept.dtype}: give"):
            choose_surface(wrong, kept, np.zeros((5, 7), np.uint8))
    with pytest.raises(ValueError, match=r"needs 11 signs a pixel, got shape \(5, 7, 10\)"):
        std_px(np.zeros((5, 7), np.int8), np.zeros((5, 7, 10), np.float32))
