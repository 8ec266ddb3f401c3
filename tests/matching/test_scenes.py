"""What a scene asks of a matcher, where the answer is known by construction."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from stereolib.matching import scenes

NAN = np.nan


RNG = np.random.default_rng(34)


def test_near_edge_follows_the_nearest_column():
    truth, on_object = np.full((6, 30), NAN), np.zeros((6, 30), bool)
    on_object[2:5, 4:26] = True
    for v in range(2, 5):
        truth[v, 4:26] = 60 - np.abs(np.arange(4, 26) - (14 + v))
    edge = scenes.near_edge_mask(truth, on_object, half_width_px=2)
    for v in range(6):
        expected = [14 + v + d for d in (-2, -1, 0, 1, 2)] if 2 <= v < 5 else []
        assert np.flatnonzero(edge[v]).tolist() == expected


def test_near_edge_is_where_the_disparity_is_known():
    truth = np.array([[5.0, NAN, 9.0, 7.0, 6.0]])
    edge = scenes.near_edge_mask(truth, np.ones((1, 5), bool), half_width_px=0)
    assert edge.tolist() == [[False, False, True, False, False]]


def test_smallest_window_reaches_just_over_the_disparity():
    rng = np.random.default_rng(0)
    wide = cv2.GaussianBlur(rng.integers(0, 256, (60, 260), dtype=np.uint8), (0, 0), 0.8)
    left, right = wide[:, :220].copy(), wide[:, 40:].copy()
    truth, where = np.full((60, 220), 40.0), np.zeros((60, 220), bool)
    where[:, 90:] = True
    assert scenes.smallest_window(left, right, truth, where, widest=96) == 48
    with pytest.raises(ValueError, match="even 32 disparities leave more than 5 % bad pixels"):
        scenes.smallest_window(left, right, truth, where, widest=32)


@pytest.mark.parametrize("sigma", [1.5, 3.0, 6.0])
def test_correlation_length_of_blurred_noise(sigma):
    """Noise blurred by s has the correlation exp(-x^2 / 4 s^2): it falls to 1/e at 2 s."""
    rng = np.random.default_rng(1)
    noise = cv2.GaussianBlur(rng.normal(size=(400, 400)), (0, 0), sigma)
    image = np.clip(128 + 40 * noise / noise.std(), 0, 255).astype(np.uint8)
    where = np.zeros(image.shape, bool)
    where[50:350, 60:330] = True
    assert scenes.correlation_length_px(image, where) == pytest.approx(2 * sigma, rel=0.1)
    image[~where] = 255  # what lies outside does not count
    assert scenes.correlation_length_px(image, where) == pytest.approx(2 * sigma, rel=0.1)


def test_correlation_length_refuses():
    with pytest.raises(ValueError, match="no texture to measure"):
        scenes.correlation_length_px(np.full((9, 9), 7, np.uint8), np.ones((9, 9), bool))
    with pytest.raises(ValueError, match="no texture to measure"):
        scenes.correlation_length_px(np.eye(9).astype(np.uint8), np.zeros((9, 9), bool))
    across = np.repeat(RNG.integers(0, 60, (60, 1)), 200, axis=1) + RNG.integers(0, 3, (60, 200))
    with pytest.raises(ValueError, match="larger than 100 px"):
        scenes.correlation_length_px(across.astype(np.uint8), np.ones((60, 200), bool))


def test_the_near_edge_is_where_the_disparity_peaks() -> None:
    column = np.arange(50)
    truth = np.tile(100.0 - np.abs(column - 22), (6, 1))
    mask = np.tile((column > 5) & (column < 40), (6, 1))
    found = scenes.near_edge_mask(truth, mask, half_width_px=2)
    assert np.flatnonzero(found.all(axis=0)).tolist() == [20, 21, 22, 23, 24]
    assert not scenes.near_edge_mask(truth, mask & (np.arange(6) < 3)[:, None])[3:].any()


@pytest.mark.parametrize(("disparity", "window"), [(10, 16), (30, 32), (40, 48)])
def test_the_smallest_window_is_the_next_16_above_the_disparity(disparity: int, window: int) -> None:
    left = RNG.integers(0, 256, (60, 200), np.uint8)
    right = np.roll(left, -disparity, axis=1)
    truth, where = np.full(left.shape, float(disparity)), np.zeros(left.shape, bool)
    where[10:50, 60:180] = True
    assert scenes.smallest_window(left, right, truth, where) == window
    with pytest.raises(ValueError, match="not the window"):
        scenes.smallest_window(left, right, truth + 7, where, widest=64)


def test_the_correlation_length_of_a_cosine_is_known() -> None:
    period, column = 40.0, np.arange(1600)
    image = np.tile(np.rint(128 + 100 * np.cos(2 * np.pi * column / period)), (8, 1)).astype(np.uint8)
    expected = period / (2 * np.pi) * np.arccos(np.exp(-1))
    assert scenes.correlation_length_px(image, np.ones(image.shape, bool)) == pytest.approx(expected, abs=0.05)
    with pytest.raises(ValueError, match="texture"):
        scenes.correlation_length_px(np.full_like(image, 9), np.ones(image.shape, bool))
