"""What is drawn is what was given."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib import plotting


@pytest.fixture
def ax():
    return plotting.panels(1)[1][0]


def test_a_curves_last_bit_is_not_drawn(ax):
    x = np.linspace(0, 1, 50)
    plotting.plot_curves({"a": (x, x**2), "b": (x, np.nextafter(x**2, 2))}, ax, xlabel="x", ylabel="y")
    one, other = (line.get_ydata() for line in ax.lines)
    assert one.dtype == np.float32
    np.testing.assert_array_equal(one, other)


def test_curves_differ_without_colour_too(ax):
    plotting.plot_curves(
        {c: ([1, 2], [1, k]) for k, c in enumerate("abcd")}, ax, xlabel="Z (mm)", ylabel="d (px)", title="t"
    )
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_title()) == ("Z (mm)", "d (px)", "t")
    assert len({line.get_linestyle() for line in ax.lines}) == 4
    assert len({line.get_color() for line in ax.lines}) == 4
    assert [text.get_text() for text in ax.get_legend().get_texts()] == list("abcd")
    np.testing.assert_array_equal(ax.lines[3].get_ydata(), [1, 3])
