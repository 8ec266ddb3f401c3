"""Disparity maps: checked, their pixels' rays, and spoilt by outliers."""

from __future__ import annotations

import numpy as np
import pytest
from support.ground import RECT

from stereolib.measurement import add_outliers, check_disparity_map, pixel_rays


def test_specks_are_counted_and_the_map_is_left_alone():
    clean = np.full((480, 640), 50.0)
    specked = add_outliers(clean, 100, np.random.default_rng(0), highest_px=128)
    changed = specked != clean
    assert 95 <= changed.sum() <= 100 and (clean == 50).all()
    assert specked[changed].min() >= 1 and specked[changed].max() <= 128
    even = np.linspace(0, 1, changed.sum())  # values and places are spread evenly
    for drawn, low, high in zip((specked[changed], *np.nonzero(changed)), (1, 0, 0), (128, 479, 639), strict=True):
        assert np.abs(np.sort((drawn - low) / (high - low)) - even).max() < 0.16


def test_a_map_of_the_rig_is_taken_as_it_is():
    disparity = np.full((480, 640), 50.0, np.float32)
    assert check_disparity_map(disparity, RECT) is disparity
    with pytest.raises(ValueError, match=r"shape \(480, 320\).*640x480"):
        check_disparity_map(disparity[:, :320], RECT)


def test_rays_project_to_their_pixels():
    u, v = np.array([0.0, 639.0, 100.0]), np.array([479.0, 0.0, 200.0])
    rays = pixel_rays(u, v, RECT)
    assert pixel_rays(RECT.P1[:1, 2], RECT.P1[1:2, 2], RECT).tolist() == [[0, 0, 1]]
    assert (rays @ RECT.P1[:, :3].T)[:, :2] == pytest.approx(np.stack([u, v], axis=1))
