"""The drawing's numbers are the formula's."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib import plotting


@pytest.fixture
def ax():
    return plotting.panels(1)[1][0]


def test_triangulation_prints_the_formula(ax):
    plotting.plot_triangulation(763.7, 93.1, 700.0, ax)
    assert f"{763.7 * 93.1 / 700:.1f} px" in ax.get_title()
    texts = " ".join(text.get_text() for text in ax.texts)
    left, right = (763.7 * (0.35 * 93.1 - x) / 700 for x in (0, 93.1))
    assert f"{left:+.1f} px" in texts and f"{right:+.1f} px".replace("-", "\N{MINUS SIGN}") in texts


def test_triangulation_is_true_to_scale(ax):
    plotting.plot_triangulation(763.7, 93.1, 700.0, ax)
    assert ax.get_aspect() == 1
    rays = [line.get_xydata() for line in ax.lines if np.ptp(line.get_xdata()) == 700 and np.ptp(line.get_ydata())]
    assert [ray.tolist() for ray in rays] == [[[0, x], [700, pytest.approx(0.35 * 93.1)]] for x in (0, 93.1)]
