"""The upper edge of a face, beyond an end that it is taken to have: a line printed on it ends no face."""

from __future__ import annotations

import numpy as np
import pytest
from support.pictured import HIGH, rendered, true_box

from stereolib.measurement.box import Own, Side
from stereolib.measurement.upper_edge import upper_edge_beyond

CASES = {
    "near": ((700.0, (260.0, 260.0, 220.0), 30.0), {}),
    "far": ((1100.0, (300.0, 200.0, 250.0), 40.0), {}),
}


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("share", [0.5, 0.75])
def test_an_end_too_near_is_told_with_the_true_one(case, side, share):
    box, how = CASES[case]
    shown, own = rendered(*box, **how), true_box(*box)
    short = own.copy()
    short[side.extent] *= share
    extent, odds = upper_edge_beyond(shown.views.pair.pictures, shown.world, short, side)
    assert extent == pytest.approx(own[side.extent], rel=0.06) and odds > (6 if share < 0.6 else 4)


@pytest.mark.parametrize("side", Side)
@pytest.mark.parametrize("case", CASES)
def test_nothing_goes_on_beyond_a_true_end(case, side):
    box, how = CASES[case]
    shown, own = rendered(*box, **how), true_box(*box)
    _, odds = upper_edge_beyond(shown.views.pair.pictures, shown.world, own, side)
    assert odds < 2


def test_an_edge_seen_from_above_tells_nothing():
    """Its shadow on the floor is parallel to it, and may lie in its line."""
    box = (700.0, (240.0, 300.0, 200.0), 35.0)
    shown, own = rendered(*box, camera=HIGH), true_box(*box)
    own[Own.LEFT] *= 0.5
    assert upper_edge_beyond(shown.views.pair.pictures, shown.world, own, Side.LEFT) is None


def test_what_tells_nothing():
    box = (700.0, (260.0, 260.0, 220.0), 30.0)
    shown, own = rendered(*box), true_box(*box)
    rng, pictures = np.random.default_rng(0), shown.views.pair.pictures
    noise = tuple(rng.uniform(0, 1, picture.shape).astype(np.float32) for picture in pictures)
    assert upper_edge_beyond(noise, shown.world, own, Side.RIGHT) is None
    narrow, high, behind = own.copy(), own.copy(), own.copy()
    narrow[Own.RIGHT], high[Own.HEIGHT], behind[Own.X] = 3.0, 5000.0, -2000.0
    for odd in (narrow, high, behind):
        assert upper_edge_beyond(pictures, shown.world, odd, Side.RIGHT) is None
