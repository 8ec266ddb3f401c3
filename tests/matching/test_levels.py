"""Brightness that differs between both pictures part by part is taken off; what was not matched stays as it is."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from stereolib.matching import find_rows, score
from stereolib.matching.levels import noise_grey, shaded
from stereolib.matching.pipelines import stereo_pipeline
from stereolib.virtual import recordings

SHIFT_PX = 8


def pair_of(shape, seed=3):
    """Left and right picture of a wall 8 px apart; grey levels far from both ends."""
    rng = np.random.default_rng(seed)
    wall = rng.uniform(60, 190, (shape[0], shape[1] + SHIFT_PX, *shape[2:])).astype(np.float32)
    wall = cv2.GaussianBlur(wall, (0, 0), 1.2).round().astype(np.uint8)
    return wall[:, :-SHIFT_PX].copy(), wall[:, SHIFT_PX:].copy()


def lit(image, by):
    """The picture with a light of its own, which changes softly along the row; another one for each channel."""
    along = by * np.sin(np.linspace(-2, 2, image.shape[1]))[None, :, None]
    signs = np.array([1.0, -0.5, 0.7])[: image.shape[2] if image.ndim == 3 else 1]
    return np.clip(image + (along * signs).reshape(1, image.shape[1], *image.shape[2:]).round(), 0, 255).astype(
        np.uint8
    )


@pytest.mark.parametrize("shape", [(160, 240), (161, 243), (160, 240, 3), (161, 241, 3)])
def test_a_difference_that_changes_from_part_to_part_is_taken_off(shape):
    left, right = pair_of(shape)
    other = lit(left, 16)
    rough_px = find_rows(other, right)[1]
    assert np.isfinite(rough_px).mean() > 0.8
    found = shaded(other, right, rough_px)
    assert found.shape == left.shape and found.dtype == np.uint8
    before, after = (np.abs(cv2.blur(i.astype(np.float32) - left, (9, 9)))[20:-20, 30:-20] for i in (other, found))
    assert after.mean() < 0.45 * before.mean() and after.max() < before.max()
    # the texture is the same: only what is as wide as a window has changed
    fine = [i.astype(np.float32) - cv2.blur(i.astype(np.float32), (9, 9)) for i in (left, found)]
    assert np.abs(fine[0] - fine[1]).max() < 3


def test_what_is_alike_stays_nearly_so():
    left, right = pair_of((160, 240, 3))
    off = shaded(left, right, find_rows(left, right)[1]).astype(float) - left
    assert np.abs(off).mean() < 0.6 and np.abs(off).max() <= 4


def test_what_was_not_matched_stays():
    left, right = pair_of((160, 240))
    other = lit(left, 16)
    rough_px = find_rows(other, right)[1].copy()
    np.testing.assert_array_equal(shaded(other, right, np.full_like(rough_px, np.nan)), other)
    rough_px[:, 50:] = np.nan
    found = shaded(other, right, rough_px)
    np.testing.assert_array_equal(found[:, 136:], other[:, 136:])  # beyond half a window from the last match
    assert np.abs(found[:, 30:80].astype(float) - other[:, 30:80]).mean() > 3
    rough_px[:] = 500  # left of the right picture: nothing is seen there
    np.testing.assert_array_equal(shaded(other, right, rough_px), other)


def test_a_wrong_match_moves_no_part_far():
    dark, bright = np.full((160, 240), 40, np.uint8), np.full((160, 240), 220, np.uint8)
    moved = shaded(dark, bright, np.full((80, 120), 4, np.float32)).astype(int) - dark
    assert 10 < moved.max() <= 20 / 1.3 + 1


def test_a_soft_light_on_one_picture_costs_best_little(monkeypatch):
    """A light that one camera alone sees, up to a seventh of the grey: far more is lost where it is left in."""
    truth = recordings.load_truth("conditions/texture").disparity_px
    left, right = recordings.rectified().rectify(*recordings.load_pair("conditions/texture"))
    soft = np.random.default_rng(2).uniform(-0.15, 0.15, (4, 6)).astype(np.float32)
    glossy = right * (1 + cv2.resize(soft, right.shape[1::-1], interpolation=cv2.INTER_CUBIC))[..., None]
    glossy = glossy.round().clip(0, 255).astype(np.uint8)
    bad = [score(stereo_pipeline("best", 176)(left, side).disparity_px, truth).bad2_pct for side in (right, glossy)]
    monkeypatch.setattr("stereolib.matching.even_pair.shaded", lambda left, right, rough_px: left)
    bare = score(stereo_pipeline("best", 176)(left, glossy).disparity_px, truth).bad2_pct
    assert bad[1] - bad[0] < 0.5 * (bare - bad[0])


@pytest.mark.parametrize("noise", [1.0, 3.0, 8.0])
@pytest.mark.parametrize("channels", [1, 3])
def test_noise_is_told_apart_from_fine_texture(noise, channels):
    """Texture down to the pixel is in both pictures, noise is not; shading and matches that are missing are neither."""
    rng = np.random.default_rng(3)
    texture = np.repeat(rng.uniform(60, 190, (240, 330, 1)), channels, axis=2)
    shading = np.linspace(0, 10, 320)[:, None]
    sides = [
        (texture[:, k : k + 320] + k * shading / 10 + rng.normal(0, noise, (240, 320, channels))).round()
        for k in (0, 10)
    ]
    rough_px = np.full((120, 160), 5, np.float32)
    rough_px[30:40] = np.nan
    found = noise_grey(*(side.clip(0, 255).astype(np.uint8).squeeze() for side in sides), rough_px)
    truth = np.sqrt((noise**2 + 1 / 12) / channels)  # mean of the channels; rounded
    assert 0.75 * max(truth, 0.5) < found < 1.1 * max(truth, 0.5)  # the quietest tenth: a little below


def test_noise_where_nothing_tells_it():
    flat = np.full((200, 200, 3), 100, np.uint8)
    assert noise_grey(flat, flat, np.full((100, 100), np.nan, np.float32)) == 1.0
    assert noise_grey(flat, flat, np.full((100, 100), 5, np.float32)) == 0.5  # what rounding leaves
    tiny = flat[:12, :12]
    assert noise_grey(tiny, tiny, np.zeros((6, 6), np.float32)) == 1.0
