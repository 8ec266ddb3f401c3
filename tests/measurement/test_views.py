"""A pair made ready: exposures, rows and search window, against recordings that are disturbed by a known amount."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from support.disturbed import exposed, rows_moved
from support.ground import RECT

from stereolib.measurement import Views, fit_floor, floor_from_pose
from stereolib.virtual import recordings

TRUE = floor_from_pose(RECT, recordings.setup("pitched"))


def rectified(name="conditions/texture"):
    return RECT.rectify(*recordings.load_pair(name))


@pytest.mark.parametrize(("gain", "gamma"), [(0.5, 1.0), (0.7, 1.0), (1.15, 1.0), (1.0, 1.5), (1.0, 0.67)])
def test_exposures_that_differ_change_no_disparity(gain, gamma):
    left, right = rectified()
    plain, other = Views.of_rectified(left, right), Views.of_rectified(left, exposed(right, gain, gamma))
    both = np.isfinite(plain.disparity_px) & np.isfinite(other.disparity_px)
    assert both.sum() > 0.95 * np.isfinite(plain.disparity_px).sum()
    assert np.mean(np.abs(plain.disparity_px - other.disparity_px)[both] < 0.5) > 0.93
    floor = fit_floor(other.disparity_px, RECT, pair=other.pair)
    off = floor.plane - TRUE.plane
    assert off @ np.linalg.solve(floor.covariance, off) < 16.3  # of 3 degrees of freedom: one in a thousand


@pytest.mark.parametrize(
    ("offset", "roll"), [(0.0, 0.0), (0.5, 0.0), (-1.0, 0.0), (3.0, 0.0), (-3.0, 0.0), (1.0, 0.0087), (2.0, -0.0087)]
)
def test_rows_are_measured_and_corrected(offset, roll):
    left, right = rectified("series/medium_800")
    views = Views.of_rectified(left, rows_moved(right, offset, roll))
    assert views.rows.offset_px == pytest.approx(offset, abs=0.05)
    assert views.rows.roll_rad == pytest.approx(roll, abs=0.08 / 320)
    plain = Views.of_rectified(left, right)
    inner = np.s_[12:-12, 12:-12]
    assert np.abs(views.right[inner].astype(float) - plain.right[inner]).mean() < 3.0
    assert np.isfinite(views.disparity_px).mean() > np.isfinite(plain.disparity_px).mean() - 0.03
    assert bool(views.rows.warnings) == (abs(offset) >= 0.5)


@pytest.mark.parametrize(("offset", "said"), [(5.0, "rows of right are 5.0 px too low"), (-6.0, "too high")])
def test_rows_of_another_rig_are_refused(offset, said):
    left, right = rectified("series/medium_800")
    with pytest.raises(ValueError, match=f"{said}: .*Is the calibration of these cameras.*mirrored, or upside down"):
        Views.of_rectified(left, rows_moved(right, offset, 0.0))


def test_the_rows_deviation_is_that_of_their_errors():
    """Over scenes and offsets; 1 would be perfect."""
    names, z = ("conditions/texture", "conditions/level", "series/fine_800", "series/coarse_900"), []
    for k, name in enumerate(names):
        left, right = rectified(name)
        for offset in (0.0, 0.3125 + 0.125 * k, -1.25 - 0.125 * k):
            rows = Views.of_rectified(left, rows_moved(right, offset, 0.0)).rows
            z.append((rows.offset_px - offset) / rows.std_px)
    assert 0.4 < np.sqrt(np.mean(np.square(z))) < 1.6


def test_what_is_near_widens_the_search():
    """A wall 0.3 m away has 230 px of disparity: more than half the size's usual window holds."""
    texture = cv2.GaussianBlur(np.random.default_rng(0).normal(0, 1, (480, 940)), (0, 0), 2.0)
    grey = np.clip(128 + 40 * texture / texture.std(), 0, 255).astype(np.uint8)
    views = Views.of_rectified(grey[:, :640].copy(), grey[:, 230:870].copy())
    seen = views.disparity_px[:, 300:]
    assert np.nanmedian(seen) == pytest.approx(230, abs=0.3) and np.isfinite(seen).mean() > 0.9


def test_pictures_of_nothing_match_nothing():
    for level in (0, 90, 255):
        blank = np.full((480, 640, 3), level, np.uint8)
        views = Views.of_rectified(blank, blank)
        assert not np.isfinite(views.disparity_px).any() or np.nanmax(views.disparity_px) == 0
        assert views.rows.offset_px == 0 and views.rows.std_px >= 3 and not views.rows.warnings
    with pytest.raises(ValueError, match="one size"):
        Views.of_rectified(np.zeros((48, 64), np.uint8), np.zeros((48, 63), np.uint8))


def test_the_slopes_noise_is_that_of_one_picture():
    """Normal noise adds to it as independent things do; without a match there is none."""
    left, right = rectified("series/medium_800")
    rng = np.random.default_rng(31)
    found = [Views.of_rectified(left, right).slope_noise]
    for sigma in (4.0, 8.0):
        noisy = [np.clip(p + rng.normal(0, sigma, p.shape), 0, 255).astype(np.uint8) for p in (left, right)]
        found.append(Views.of_rectified(*noisy).slope_noise)
    added = np.sqrt(np.diff(np.square(found)))  # of 4, and of sqrt(8^2 - 4^2)
    assert found[0] < found[1] < found[2] and added[1] / added[0] == pytest.approx(np.sqrt(3), rel=0.35)
    plain = np.full_like(left, 128)
    assert Views.of_rectified(plain, plain).slope_noise == 0
