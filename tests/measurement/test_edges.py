"""Upright edges: to a fraction of a pixel where the truth has them."""

from __future__ import annotations

import numpy as np
import pytest
from support.ground import RECT, recorded, rng

from stereolib.measurement import AlignedPair, fit_floor
from stereolib.measurement.edges import vertical_edge
from stereolib.rig import to_light


def test_outer_edges_to_a_fraction_of_a_pixel():
    """The cube's side corners, looked for from 5 px outside: the picture finds them to 0.3 px."""
    left, right, disparity = recorded("conditions/level")
    floor = fit_floor(disparity, RECT, rng=rng(), pair=AlignedPair.of(left, right))
    half = 300 / np.sqrt(2)
    for side in (-1, 1):
        true = np.arctan2(side * half, 700 + half)
        beside = true + side * 5 / RECT.f_px
        place = np.hypot(half, 700 + half) * np.array([np.cos(beside), np.sin(beside)])
        edge = vertical_edge((to_light(left), to_light(right)), floor, place, (30.0, 270.0), prior_px=(5.0, 0.0))
        # The rectified camera looks along the world's x: bearings agree.
        assert (edge.position - true) * RECT.f_px == pytest.approx(0, abs=0.35)
        assert abs(edge.position - true) < 3 * edge.std < 3 / RECT.f_px
    light = (to_light(left), to_light(right))
    assert vertical_edge(light, floor, np.array([700.0, 900.0]), (30.0, 270.0), prior_px=(5.0, 0.0)) is None
