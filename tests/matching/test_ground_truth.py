"""Views are checked, and the photograph's hidden pixels are hidden."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.views import small_view

from stereolib.matching import (
    motorcycle_view,
    seen_by_both,
)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"truth_px": np.full((100, 220), np.nan)}, "known somewhere; 0 pixels are infinite, 22000 NaN"),
        ({"truth_px": np.full((100, 220), np.inf)}, "22000 pixels are infinite"),
        ({"truth_px": np.ones((99, 220))}, r"images are \(100, 220\), the truth is \(99, 220\)"),
        ({"visible": np.ones((100, 219), bool)}, r"'visible' must be a mask \(100, 220\) of bool, got \(100, 219\)"),
        ({"regions": {"patch": np.ones((100, 220))}}, "'patch' must be a mask .* of float64"),
        ({"regions": {"patch": np.zeros((100, 220), bool)}}, "'patch' holds no pixel whose truth is known"),
        ({"about": {"where": 3}}, "where cannot be told in `about`"),
    ],
)
def test_views_are_checked(change, text):
    with pytest.raises(ValueError, match=text):
        small_view(**change)


@pytest.mark.parametrize("dtype", [np.uint16, np.float32, np.float64])
def test_images_of_another_kind_are_refused(dtype):
    view = small_view()
    with pytest.raises(ValueError, match=f"plane, left: images must be uint8 arrays, got {np.dtype(dtype)}"):
        replace(view, left=view.left.astype(dtype), right=view.right.astype(dtype))


def test_the_motorcycles_hidden_pixels_are_hidden():
    view = motorcycle_view()
    known = np.isfinite(view.truth_px)
    assert 0.05 < (known & ~view.visible).sum() / known.sum() < 0.25
    rows, columns = np.nonzero(view.visible)
    target = np.rint(columns - view.truth_px[rows, columns]).astype(int)
    assert target.min() >= 0
    hidden = np.argwhere(known & ~view.visible)
    inside = 0
    for row, column in hidden[::97]:  # each is covered by something nearer, or outside the right image
        there = round(column - view.truth_px[row, column])
        others = np.rint(np.arange(known.shape[1]) - view.truth_px[row]) == there
        assert there < 0 or view.truth_px[row][others].max() >= view.truth_px[row, column] + 1 - 1e-6
        inside += there >= 0
    assert inside > 50


def test_a_pixel_that_would_lie_beyond_the_right_picture_is_not_seen_there():
    np.testing.assert_array_equal(seen_by_both(np.array([[-3.0, 1.0]])), [[False, True]])
