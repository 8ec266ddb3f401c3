"""Quantities over an image have their colours and arrows where their values are, and light grey where there is none."""

from __future__ import annotations

import numpy as np
import pytest
from support.axes import rendered

from stereolib import plotting


@pytest.fixture
def ax():
    return plotting.panels(1)[1][0]


def test_unmatched_pixels_are_light_grey(ax):
    disparity = np.full((30, 40), 50.0)
    disparity[:, 20:] = np.nan
    plotting.plot_disparity(disparity, ax, high=100, bar=False)
    picture = rendered(ax)
    assert picture[60, -40].tolist() == [0xD9] * 3
    assert np.ptp(picture[60, 40].astype(int)) > 20


def test_map_as_a_picture():
    picture = plotting.color_disparity(np.array([[0.0, 50, 100, 200, -5, np.nan]]), 0, 100)
    assert picture.shape == (1, 6, 3) and picture.dtype == np.uint8
    assert picture[0, 5].tolist() == [217] * 3
    np.testing.assert_array_equal(picture[0, 3], picture[0, 2])
    np.testing.assert_array_equal(picture[0, 4], picture[0, 0])
    brightness = picture[0, :3].astype(float) @ [0.114, 0.587, 0.299]
    assert brightness[0] + 30 < brightness[1] < brightness[2] - 30  # grows also in grey print


def test_map_shows_the_values_over_the_image_and_keeps_gaps(ax):
    values = np.add.outer(np.arange(4.0), np.arange(5.0))
    values[0, 0] = np.nan
    quantity = plotting.ImageQuantity(values, np.linspace(0, 99, 5), np.linspace(0, 59, 4), (100, 60), "mm")
    plotting.plot_quantity(quantity, ax, "map")
    mesh = ax.collections[0]
    np.testing.assert_array_equal(np.ma.filled(mesh.get_array(), np.nan).reshape(4, 5), values)
    assert ax.get_xlim() == (-0.5, 99.5) and ax.get_ylim() == (59.5, -0.5)  # rows run down
    assert mesh.get_clim() == tuple(np.nanpercentile(values, [0, 95]))


def test_map_hatches_what_was_not_seen_and_ends_its_colours_where_told(ax):
    values = np.add.outer(np.arange(4.0), np.arange(5.0))
    unseen = np.zeros((6, 10), bool)
    unseen[:, :3] = True
    where = np.linspace(0, 99, 5), np.linspace(0, 59, 4)
    plotting.plot_quantity(plotting.ImageQuantity(values, *where, (100, 60), "mm", unseen), ax, "map", high=4.0)
    mesh, _, hatched, _ = ax.collections
    assert mesh.get_clim() == (0, 4)
    assert {float(text.get_text()) for text in ax.texts} <= {1.0, 2.0, 3.0}  # round numbers within the colours
    (outline,) = [path for path in hatched.get_paths() if len(path)]
    assert 20 < outline.vertices[:, 0].max() < 35 and hatched.hatches == ["///"]


def test_logarithmic_colours_reach_from_the_middle_to_the_rim_and_no_label_lies_over_another(ax):
    column, row = np.meshgrid(np.linspace(0, 639, 32), np.linspace(0, 479, 24))
    values = 0.2 * np.exp((np.hypot(column - 320, row - 240) / 180) ** 4)
    values[0, 0] = np.nan
    quantity = plotting.ImageQuantity(values, column[0], row[:, 0], (640, 480), "mm")
    plotting.plot_quantity(quantity, ax, "map", log=True)
    low, high = ax.collections[0].get_clim()
    assert low == np.nanmin(values) and high == pytest.approx(1000 * low)  # the corners are beyond
    told = [float(text.get_text()) for text in ax.texts]
    assert set(told) <= {0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0} and len(set(told)) > 1
    plotting.figure_to_image(ax.figure)
    boxes = [text.get_window_extent() for text in ax.texts]
    assert not any(one.overlaps(other) for k, one in enumerate(boxes) for other in boxes[:k])


@pytest.mark.parametrize("log", [False, True])
@pytest.mark.parametrize("values", [np.full((3, 3), np.nan), np.zeros((3, 3)), np.full((3, 3), 0.25)])
def test_map_of_nothing_and_of_a_constant(ax, values, log):
    quantity = plotting.ImageQuantity(values, np.arange(3), np.arange(3), (3, 3), "px")
    plotting.plot_quantity(quantity, ax, "map", log=log)
    plotting.figure_to_image(ax.figure)
    assert ax.get_title() == "map" and ax.get_xlim() == (-0.5, 2.5) and not ax.texts
    viridis = [33, 145, 140]  # its middle: the colours end where they begin
    inside = rendered(ax)[10:-10, 10:-10].reshape(-1, 3)
    assert (inside == inside[0]).all()
    np.testing.assert_allclose(inside[0], [0xD9] * 3 if np.isnan(values).all() else viridis, atol=5)


def test_arrows_are_drawn_where_they_are_and_their_means_stay(ax):
    rng = np.random.default_rng(1)
    at = rng.uniform([0, 0], [600, 400], (2000, 2))
    errors = rng.normal([0.1, 0], 0.05, at.shape)  # a lens that misses 0.1 px to the right
    errors[7] = np.nan
    plotting.plot_arrows(at, errors, (600, 400), ax)
    each, means = ax.collections
    assert len(each.U) == 1999 and len(means.U) == 12 * 8
    np.testing.assert_allclose(np.mean(means.U), 0.1, atol=0.005)
    np.testing.assert_allclose(np.mean(means.V), 0.0, atol=0.005)
    ends = np.column_stack([each.X + each.U / each.scale, each.Y + each.V / each.scale])
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    assert ends[:, 0].max() > 620 and (ends >= [left, top]).all() and (ends <= [right, bottom]).all()
    plotting.plot_arrows(at[:1], np.full((1, 2), np.nan), (600, 400), ax)  # nothing to draw is no error
    plotting.figure_to_image(ax.figure)
