"""The paper's constant scale and the parametric one: to which depth each belongs."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest

from stereolib import paper
from stereolib.paper import published


def test_the_printed_constant():
    width_px, width_cm = published()["scale.width_px"].value, published()["scale.width_cm"].value
    assert paper.cm_per_px(width_cm, width_px) == pytest.approx(0.1160, abs=5e-5)
    assert paper.cm_per_px(30 * sqrt(2), width_px) == pytest.approx(0.1172, abs=5e-5)


def test_the_constant_belongs_to_another_depth_than_the_near_edge():
    """facts: 84.7 cm at f = 730 px, where the near edge at 0.70 m has 0.096 cm/px."""
    assert paper.depth_of_scale_mm(0.116, 730) == pytest.approx(847, abs=0.5)
    assert paper.cm_per_px_at(700, 730) == pytest.approx(0.096, abs=5e-4)
    assert paper.cm_per_px_at(847, 730) == pytest.approx(0.116, abs=5e-5)


def test_parametric_relation_keeps_invalid_ones():
    np.testing.assert_allclose(paper.cm_per_px_at(np.array([1000, np.nan]), 500), [0.2, np.nan])


def test_fit_finds_the_focal_length_and_weighs_by_depth():
    depth = np.array([400.0, 700.0, 1500.0])
    assert paper.fit_focal_length_px(depth, depth / 7637) == pytest.approx(763.7)
    noisy = depth / 10 / np.array([760.0, 750.0, 764.0])
    best = min(np.arange(740, 780, 0.01), key=lambda f: sum((noisy - depth / (10 * f)) ** 2))  # by trying
    # the inverse is what is fitted, so the sum of squares has its least value there
    assert paper.fit_focal_length_px(depth, noisy) == pytest.approx(best, abs=0.01)


@pytest.mark.parametrize(
    ("depth", "scales"), [([700], [0.1, 0.2]), ([], []), ([700, np.nan], [0.1, 0.1]), ([700, 800], [0.1, 0])]
)
def test_fit_refuses(depth, scales):
    with pytest.raises(ValueError):
        paper.fit_focal_length_px(np.array(depth), np.array(scales))


@pytest.mark.parametrize("values", [(42, 0), (-42, 362), (float("nan"), 362)])
def test_constant_refuses(values):
    with pytest.raises(ValueError, match="positive"):
        paper.cm_per_px(*values)


@pytest.mark.parametrize(("length_cm", "width_px"), [(0.0, 362.0), (42.0, 0.0), (-42.0, 362.0)])
def test_a_scale_needs_a_length_and_a_width(length_cm, width_px):
    with pytest.raises(ValueError, match="length and width must be positive"):
        paper.cm_per_px(length_cm, width_px)
