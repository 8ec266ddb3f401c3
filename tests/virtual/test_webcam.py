"""The webcam's faults have the statistics they promise."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from stereolib.virtual import Webcam

CLEAN = Webcam(psf_sigma_px=0.01, vignetting=0.0)


def flat(level, shape=(120, 160)):
    return np.full((*shape, 3), level, np.float32)


def linear(image):
    return (image / 255.0) ** 2.2


def test_noise_variance_grows_with_the_signal_in_a_straight_line():
    """In electrons: the variance is the signal plus the square of the read noise."""
    webcam = Webcam(psf_sigma_px=0.01, vignetting=0.0, full_well_e=900.0, read_noise_e=9.0)
    levels = np.repeat(np.linspace(0.1, 0.75, 8), 60)  # bars side by side under one exposure
    light = np.broadcast_to(levels[None, :, None], (400, 480, 3)).astype(np.float32)
    image = webcam.expose(light, np.random.default_rng(0))
    gain = 0.42 / levels.mean()
    electrons = linear(image).reshape(400, 8, 60, 3)[:, :, 5:-5] * 900 / gain
    mean, variance = electrons.mean(axis=(0, 2, 3)), electrons.var(axis=(0, 2, 3))
    assert image.max() < 255  # nothing is clipped
    np.testing.assert_allclose(mean, np.unique(levels) * 900, rtol=0.01)
    slope, offset = np.polyfit(mean, variance, 1)
    assert slope == pytest.approx(1, abs=0.05)
    assert offset == pytest.approx(81, abs=15)
    np.testing.assert_allclose(variance, mean + 81, rtol=0.05)


def predicted_std(webcam, level):
    """Of linear light after the gain: shot noise, read noise, and the rounding to whole grey levels."""
    gain = min(0.42 / level, webcam.max_gain)
    mean = gain * level
    electrons = gain / webcam.full_well_e * np.sqrt(level * webcam.full_well_e + webcam.read_noise_e**2)
    return np.hypot(electrons, 2.2 / 255 * mean ** (1 - 1 / 2.2) / np.sqrt(12))


@pytest.mark.parametrize("full_well_e", [600.0, 6000.0, 60000.0])
def test_fewer_electrons_more_noise(full_well_e):
    webcam = Webcam(vignetting=0.0, full_well_e=full_well_e)
    image = linear(webcam.expose(flat(0.4), np.random.default_rng(0)))
    assert image.mean() == pytest.approx(0.42, abs=1e-3)
    assert image.std() == pytest.approx(predicted_std(webcam, 0.4), rel=0.03)


@pytest.mark.parametrize("level", [0.1, 0.42, 1.5])
def test_exposure_brings_the_mean_to_the_same_grey(level):
    image = CLEAN.expose(flat(level), np.random.default_rng(0))
    assert linear(image).mean() == pytest.approx(0.42, abs=0.01)


def test_exposure_has_its_limits():
    dark = CLEAN.expose(flat(0.01), np.random.default_rng(0))
    # six times brighter, and the negative half of its noise is cut off at black
    assert 0.06 <= linear(dark).mean() < 0.065
    less = Webcam(psf_sigma_px=0.01, vignetting=0.0, max_gain=2.0).expose(flat(0.1), np.random.default_rng(0))
    assert linear(less).mean() == pytest.approx(0.2, abs=0.01)
    bright, glaring = (CLEAN.expose(flat(level), np.random.default_rng(0)) for level in (3.0, 30.0))
    assert linear(bright).mean() == pytest.approx(0.5, abs=0.01)  # six times darker
    assert (glaring == 255).all()


def test_poor_light_is_noisier_after_the_gain():
    good, poor = (linear(CLEAN.expose(flat(level), np.random.default_rng(0))).std() for level in (0.42, 0.07))
    assert good == pytest.approx(predicted_std(CLEAN, 0.42), rel=0.03)
    assert poor == pytest.approx(predicted_std(CLEAN, 0.07), rel=0.03) and poor > 2 * good


def test_corners_are_darker():
    webcam = Webcam(psf_sigma_px=0.01, vignetting=0.3, full_well_e=1e9, read_noise_e=0)
    image = linear(webcam.expose(flat(0.3, (121, 161)), np.random.default_rng(0)))
    assert image[0, 0] / image[60, 80] == pytest.approx(0.7, abs=0.01)
    assert image[60, 0] / image[60, 80] == pytest.approx(1 - 0.3 * 80**2 / (80**2 + 60**2), abs=0.012)


def test_edge_is_as_soft_as_the_point_spread():
    light = flat(0.1, (40, 80))
    light[:, 40:] = 0.7
    webcam = Webcam(psf_sigma_px=1.5, vignetting=0.0, full_well_e=1e9, read_noise_e=0)
    row = linear(webcam.expose(light, np.random.default_rng(0)))[20, :, 0]
    step = np.diff((row - row[5]) / (row[75] - row[5]))
    x = np.arange(len(step))
    middle = (step * x).sum()
    assert middle == pytest.approx(39, abs=0.05)
    assert np.sqrt((step * (x - middle) ** 2).sum()) == pytest.approx(1.5, abs=0.12)


def test_same_seed_same_picture():
    light = flat(0.4)
    one, two, other = (Webcam(vignetting=0.0).shoot(light, np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, two)
    noise = linear(one) - linear(other)  # JPEG takes half of it away, most of the colour's
    assert abs(noise.mean()) < 1e-3 and abs(np.corrcoef(linear(one).ravel(), linear(other).ravel())[0, 1]) < 0.05
    assert 0.35 < noise.std() / (np.sqrt(2) * predicted_std(Webcam(), 0.4)) < 0.65
    assert Webcam().encode(one) == Webcam().encode(two)


def test_jpeg_is_what_programs_receive():
    light = cv2.GaussianBlur(np.random.default_rng(0).random((60, 80, 3), np.float32), (0, 0), 3)
    webcam = Webcam(jpeg_quality=90)
    sent, received = (f(light, np.random.default_rng(3)) for f in (webcam.expose, webcam.shoot))
    assert webcam.encode(sent)[:3] == b"\xff\xd8\xff"
    difference = np.abs(sent.astype(int) - received)
    assert 0 < difference.mean() < 6
    assert len(Webcam(jpeg_quality=30).encode(sent)) < len(webcam.encode(sent))
