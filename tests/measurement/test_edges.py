"""Edges among parallel lines: to a fraction of a pixel on drawn pictures, with deviations that rivals widen."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from stereolib.measurement.edges import SHARP_PX, STEP_PX, ParallelLines, Powers, locate_edge
from stereolib.measurement.light import grey_step
from stereolib.measurement.outline import _CLEAR, _POWERS
from stereolib.rig import to_light

OFF = STEP_PX * np.arange(-60, 61)
SHIFT_PX = 40.0


def drawn(*edges, seed=0, noise=0.01, lean=0.0):
    """Light of a picture that changes at columns (place, by how much), leaning to the right downwards, with texture."""
    v, u = np.mgrid[:120.0, :240.0]
    light = np.full(u.shape, 0.4)
    for place, by in edges:
        light += by / (1 + np.exp(-(u - place - lean * (v - 60) / 100) / 0.5))
    light += cv2.GaussianBlur(np.random.default_rng(seed).normal(0, 1, u.shape), (0, 0), 1.0) * noise
    return light.astype(np.float32)


def lines(middle=120.0, top=10.0, bottom=110.0):
    """Upright ones about a column of the left picture; the right one shows them 40 px to the left."""
    ends = np.empty((len(OFF), 2, 2))
    ends[:, :, 0], ends[:, 0, 1], ends[:, 1, 1] = middle + OFF[:, None], top, bottom
    return ParallelLines(ends, np.full((len(OFF), 2), SHIFT_PX), OFF)


def both(*edges, **how):
    shifted = [(place - SHIFT_PX, by) for place, by in edges]
    return drawn(*edges, **how), drawn(*shifted, **(how | {"seed": 1}))


FLAT = np.ones(len(OFF))


def located(light, among, belief, powers=_POWERS):
    return locate_edge(light, among, belief, powers)


@pytest.mark.parametrize("place", [*np.arange(118.0, 119.05, 0.1), 120.0, 121.3, 127.77])
def test_an_edge_is_found_to_a_fraction_of_a_pixel(place):
    """Wherever between two pixels it lies, though all of an upright edge lies there alike."""
    peak = located(both((place, 0.3)), lines(), FLAT)
    assert peak.position_px == pytest.approx(place - 120, abs=0.08)
    assert abs(peak.position_px - (place - 120)) / 2 < peak.std_px < 0.06 and peak.std_px > 0.03 and peak.contrast > 10


@pytest.mark.parametrize("dark", [-0.3, 0.3], ids=["dark at the right", "dark at the left"])
def test_an_edge_is_right_whether_light_was_blurred_or_grey_levels(dark):
    """A lens blurs light, a camera its picture: 3 px of either move the edge, and the deviation knows by how much."""
    sigma, sharp = 3 / 2.355, both((120.0, dark), noise=0.003)
    lens = [cv2.GaussianBlur(light, (0, 0), sigma) for light in sharp]
    camera = [cv2.GaussianBlur(light ** (1 / 2.2), (0, 0), sigma) ** 2.2 for light in sharp]
    off = {}
    for name, pair in {"lens": lens, "camera": camera}.items():
        peak = located((pair[0], pair[1]), lines(), FLAT)
        off[name] = peak.position_px
        assert abs(peak.position_px) < 2 * peak.std_px < 0.4
    assert abs(off["lens"] - off["camera"]) > 0.02


def test_the_stated_deviation_holds_on_faint_edges():
    z = []
    for seed in range(30):
        pair = drawn((120.4, 0.03), seed=2 * seed), drawn((80.4, 0.03), seed=2 * seed + 1)
        peak = located(pair, lines(), np.exp(-0.5 * (OFF / 4) ** 2))
        z.append((peak.position_px - 0.4) / peak.std_px)
    assert np.sqrt(np.mean(np.square(z))) < 1.5 and np.abs(z).max() < 4


def test_what_steps_by_less_than_a_grey_level_is_no_edge():
    """JPEG takes the noise away that would hide it, and leaves such steps on plain cardboard."""
    faint, clear = (located(both((120.0, by * grey_step(0.4)), noise=1e-4), lines(), FLAT) for by in (0.6, 6.0))
    assert faint.contrast < _CLEAR and -faint.log_odds.min() < 5 and clear.contrast > 3 and -clear.log_odds.min() > 10


def test_what_stands_out_at_the_rim_of_what_was_looked_at_may_lie_beyond():
    inside = located(both((120.0, 0.3)), lines(), FLAT)
    beyond = located(both((120.0 + OFF[-1], 0.3)), lines(), FLAT)
    assert beyond.is_outermost and not inside.is_outermost


def test_a_rival_widens_the_deviation():
    alone = located(both((120.0, 0.3)), lines(), FLAT)
    beside = located(both((120.0, 0.3), (125.0, -0.29)), lines(), FLAT)
    faint = located(both((120.0, 0.3), (125.0, -0.1)), lines(), FLAT)
    assert beside.rivals_px > 2 and beside.std_px > 2 and abs(beside.position_px) < 0.2
    assert alone.std_px == pytest.approx(faint.std_px, abs=0.1) and faint.rivals_px < 0.2


def test_of_two_alike_the_one_where_texture_ends_is_the_edge():
    """A line of the texture's, and the object's end beyond it, a little fainter: behind it all is plain."""
    plain, textured = (both((116.0, 0.3), (124.0, 0.29)) for _ in range(2))
    rng = np.random.default_rng(3)
    for picture, end in zip(textured, (124, 84), strict=True):
        picture[:, :end] *= 1 + 0.1 * rng.standard_normal((picture.shape[0], end, *(1,) * (picture.ndim - 2)))
    assert located(plain, lines(), FLAT).position_px == pytest.approx(-4, abs=0.5)
    assert located(textured, lines(), FLAT).position_px == pytest.approx(4, abs=0.5)


def test_a_blurred_edge_is_less_well_known():
    sharp = both((120.3, 0.3))
    soft = tuple(cv2.GaussianBlur(picture, (0, 0), 2.0) for picture in sharp)
    assert located(soft, lines(), FLAT).std_px > 1.5 * located(sharp, lines(), FLAT).std_px


def test_one_picture_may_be_left_out():
    left, right = both((120.0, 0.3))
    for pair in ((left, None), (None, right)):
        assert located(pair, lines(), FLAT).position_px == pytest.approx(0, abs=0.15)


def test_what_is_believed_chooses_between_two():
    pair = both((114.0, 0.3), (126.0, -0.3))
    for expected in (-6.0, 6.0):
        peak = located(pair, lines(), np.exp(-0.5 * ((OFF - expected) / 2) ** 2))
        assert peak.position_px == pytest.approx(expected, abs=0.15) and peak.rivals_px < 0.5


def test_the_less_strength_counts_the_more_does_what_is_believed():
    pair, belief = both((114.0, 0.3), (126.0, -0.2)), np.exp(-0.5 * ((OFF - 6.0) / 5) ** 2)
    for strength, at in ((12.0, -6.0), (4.0, 6.0)):
        peak = located(pair, lines(), belief, Powers(strength, step=0.0))
        assert peak.position_px == pytest.approx(at, abs=0.15)


def test_what_one_picture_shows_is_no_edge():
    left, right = both((120.0, 0.3))
    shadow = drawn((120.0, 0.3), (130.0, -0.3))
    peak = located((shadow, right), lines(), FLAT)
    assert peak.position_px == pytest.approx(0, abs=0.15)
    assert located((left, drawn(seed=5)), lines(), FLAT).contrast < 0.5 * peak.contrast


def test_an_edge_that_leans_is_not_sharp():
    """It crosses lines that are upright, and is on each of them for a part of it only."""
    assert located(both((120.0, 0.3)), lines(), FLAT).std_px < SHARP_PX
    leaning = located(both((120.0, 0.3), lean=10.0), lines(), FLAT)
    assert leaning is None or leaning.std_px > SHARP_PX


def test_outside_of_the_pictures_there_is_none():
    assert located(both((120.0, 0.3)), lines(middle=400.0), FLAT) is None
    left, right = both((20.0, 0.3))  # the right picture does not show it
    assert located((left, right), lines(middle=20.0), FLAT).position_px == pytest.approx(0, abs=0.15)


@pytest.mark.parametrize("colours", [1, 3])
def test_the_light_of_a_picture_is_that_of_the_part_that_is_looked_at(colours):
    pictures = [(255 * picture.clip(0, 1) ** (1 / 2.2)).astype(np.uint8) for picture in both((121.3, 0.3))]
    pictures = [np.squeeze(np.stack([picture] * colours, axis=-1)) for picture in pictures]
    seen = located((pictures[0], pictures[1]), lines(), FLAT)
    light = located((to_light(pictures[0]), to_light(pictures[1])), lines(), FLAT)
    assert seen.position_px == pytest.approx(light.position_px, abs=1e-3) and abs(seen.position_px - 1.3) < 0.15
