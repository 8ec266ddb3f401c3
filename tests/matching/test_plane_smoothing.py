"""Planes of windows: noise goes, slants and steps stay, and the sums are those of least squares."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib.matching import EvenPair, smooth_by_planes

WALL = np.fromfunction(lambda y, x: 20 + 0.1 * x - 0.05 * y, (60, 80)).astype(np.float32)


def noisy(disparity, std_px=0.4):
    return disparity + np.random.default_rng(0).normal(0, std_px, disparity.shape).astype(np.float32)


def by_least_squares(disparity, size, rough_px, most_px, sure):
    """The docstring's equation, window after window; sure is the detail in units of its half."""
    planes, weights = np.zeros(disparity.shape), np.zeros(disparity.shape)
    for top, left in np.ndindex(*(n - size + 1 for n in disparity.shape)):
        window = np.s_[top : top + size, left : left + size]
        y, x = np.mgrid[window]
        design = np.column_stack([np.ones(size * size), x.ravel(), y.ravel()])
        plane = design @ np.linalg.lstsq(design, disparity[window].ravel(), rcond=None)[0]
        weight = (np.mean((disparity[window].ravel() - plane) ** 2) + rough_px**2) ** -3
        planes[window] += weight * plane.reshape(size, size)
        weights[window] += weight
    off = planes / weights - disparity
    return disparity + off / (1 + (off / (rough_px + (most_px - rough_px) / (1 + sure))) ** 2)


def test_the_sums_are_least_squares():
    disparity = noisy(np.where(np.arange(20) < 11, 3, 7) + np.linspace(0, 2, 15)[:, None])
    settings = {"size_px": 5, "rough_px": 0.3, "most_px": 1.5, "half_detail": 3.0}
    for sure in (np.zeros((15, 20), np.float32), np.linspace(0, 5, 300, dtype=np.float32).reshape(15, 20)):
        expected = by_least_squares(disparity, 5, 0.3, 1.5, sure)
        np.testing.assert_allclose(smooth_by_planes(disparity, 9 * sure, **settings), expected, atol=1e-3)
    none = smooth_by_planes(disparity, np.zeros((15, 20), np.float32))
    np.testing.assert_array_equal(smooth_by_planes(disparity), none)


def test_rough_maps_beside_flat_ones_stay_numbers():
    """The sums of box filters run on from column to column: what is small beside what went before would be lost."""
    wild = np.random.default_rng(1).uniform(0, 800, (120, 160)).astype(np.float32)
    wild[:, :60] = 3
    found = smooth_by_planes(wild)
    assert np.abs(found - wild).max() <= 0.5 + 1e-4


def test_relief_stays_where_the_picture_shows_it():
    """A surface that waves by half a pixel: planes take it for noise unless detail says that matches are sure."""
    waves = WALL + 0.5 * np.sin(np.arange(80, dtype=np.float32) / 2)
    moved = [np.abs(smooth_by_planes(waves, np.full_like(waves, d)) - waves).mean() for d in (0, 64, 2000)]
    assert moved[0] > 0.2 and moved[2] < 0.4 * moved[0] and moved[2] < moved[1] < moved[0]


def test_detail_is_counted_in_the_noise_and_noise_is_none():
    rng = np.random.default_rng(3)
    flat, stripes = np.full((60, 80), 100.0), 100 + 20 * np.sin(np.arange(80) / 2) * np.ones((60, 1))
    for noise in (1, 3):
        shown = [(one + rng.normal(0, noise, one.shape)).round().astype(np.uint8) for one in (flat, stripes)]
        none, much = (EvenPair(one, one, float(noise)).detail()[8:-8, 8:-8].mean() for one in shown)
        assert none < 0.15 and much * noise**2 == pytest.approx(200 * np.sin(0.5) ** 2, rel=0.1)


@pytest.mark.parametrize("far_px", [0, 700])
def test_a_plane_stays_up_to_the_rim(far_px):
    np.testing.assert_allclose(smooth_by_planes(WALL + far_px), WALL + far_px, atol=2e-3)


def test_noise_goes_beside_a_step_too():
    truth = WALL.copy()
    truth[:, 40:] += 8
    found = smooth_by_planes(noisy(truth))
    beside = np.s_[:, 37:43]
    for where, share in ((np.s_[:], 0.25), (beside, 0.45)):
        assert np.abs(found - truth)[where].mean() < share * np.abs(noisy(truth) - truth)[where].mean()
    assert np.abs(found - truth).max() < 2  # no pixel changes its side


@pytest.mark.parametrize("width", [1, 3])
def test_a_rod_stays(width):
    truth = WALL.copy()
    truth[:, 40 : 40 + width] += 12
    found = smooth_by_planes(truth)
    assert np.abs(found - truth)[:, 40 : 40 + width].max() < 0.15  # of 12 px


def test_nothing_moves_by_more_than_half_the_limit():
    rough = np.random.default_rng(0).uniform(0, 60, (50, 70)).astype(np.float32)
    assert np.abs(smooth_by_planes(rough, most_px=1.5) - rough).max() <= 0.75 + 1e-4


def test_no_cliff():
    """A disparity that moves a little moves what comes of it a little."""
    truth = noisy(WALL)
    truth[:, 40:] += 2
    other = truth.copy()
    other[30, 39:42] += 0.02
    assert np.abs(smooth_by_planes(other) - smooth_by_planes(truth)).max() < 0.04


@pytest.mark.parametrize("shape", [(1, 1), (1, 30), (30, 1), (2, 2), (5, 200)])
def test_small_maps(shape):
    disparity = np.full(shape, 7, np.float32)
    np.testing.assert_allclose(smooth_by_planes(disparity), disparity, atol=1e-4)


def test_windows_of_one_pixel_change_nothing():
    np.testing.assert_allclose(smooth_by_planes(noisy(WALL), size_px=1), noisy(WALL), atol=1e-4)


@pytest.mark.parametrize(
    ("disparity", "setting", "said"),
    [
        (np.full((9, 9), np.nan), {}, "fill its holes"),
        (np.zeros(9), {}, "shape"),
        (WALL, {"size_px": 4}, "odd"),
        (WALL, {"rough_px": 0.0}, "rough_px"),
        (WALL, {"most_px": np.nan}, "most_px"),
        (WALL, {"half_detail": 0.0}, "half_detail > 0"),
        (WALL, {"rough_px": 1.0, "most_px": 0.5}, "rough_px <= most_px"),
        (WALL, {"rough_px": np.inf, "most_px": np.inf}, "rough_px <= most_px"),
        (WALL, {"detail": WALL[:2]}, "detail has shape"),
        (WALL, {"detail": np.where(WALL > 25, np.nan, 1)}, "detail is 0 or more"),
        (WALL, {"detail": -WALL}, "detail is 0 or more"),
    ],
)
def test_what_is_refused(disparity, setting, said):
    with pytest.raises(ValueError, match=said):
        smooth_by_planes(disparity, **setting)
