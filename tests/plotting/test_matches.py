"""What a matcher weighs is drawn at its place: winners, truth, maps below their pictures."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib import plotting


@pytest.fixture
def ax():
    return plotting.panels(1)[1][0]


def test_cheapest_and_true_disparity_are_marked(ax):
    plotting.plot_pixel_cost(np.array([5, 3, 9, 1, 7]), 2.5, ax)
    true, _, cheapest = ax.lines
    assert true.get_xdata() == [2.5, 2.5]
    assert (cheapest.get_xdata(), cheapest.get_ydata()) == ([3], [1])


def test_row_s_costs_begin_where_all_disparities_have_a_partner(ax):
    costs = np.ones((10, 4))
    costs[np.arange(10), np.arange(10) % 4] = 0
    shown = plotting.plot_row_cost(costs, np.full(10, 2.0), ax)
    assert shown.get_array().shape == (4, 6)
    assert ax.lines[2].get_color() == plotting.TRUTH and set(ax.lines[2].get_ydata()) == {2.0}
    np.testing.assert_array_equal(ax.lines[1].get_xdata(), np.arange(4, 10))
    np.testing.assert_array_equal(ax.lines[1].get_ydata(), np.arange(4, 10) % 4)


def test_row_pair_has_the_row_of_both(ax):
    left, right = (np.full((6, 20), grey, np.uint8) for grey in (100, 150))
    figure = plotting.plot_row_pair(left, right, 2, (12, 9.5))
    rings = [axis.lines[1].get_xdata() for axis in figure.axes[:2]]
    assert rings == [[12], [9.5]]
    assert [set(axis.lines[0].get_ydata()) for axis in figure.axes[2:]] == [{100}, {150}]


def test_strips_and_maps_share_one_key_of_colours():
    disparity = np.full((20, 30), 60.0)
    picture = np.zeros((20, 30, 3), np.uint8)
    strips = plotting.plot_strips({"a": disparity, "b": disparity}, first=4, high=128)
    assert len(strips.axes) == 3 and strips.axes[0].get_xlim() == (4, 29)
    names = ("one", "two")
    both = plotting.plot_matched(
        dict.fromkeys(names, picture), dict.fromkeys(names, disparity), {"two": "bad"}, high=99
    )
    assert len(both.axes) == 5
    assert [axis.get_title() for axis in both.axes[:4:2]] == list(names)
    assert [axis.get_xlabel() for axis in both.axes[1:4:2]] == ["", "bad"]
    assert {axis.images[0].get_clim() for axis in both.axes[1:4:2]} == {(0, 99)}
    assert both.axes[4].get_xlabel() == "disparity (px)" and [text.get_text() for text in both.texts] == ["virtual rig"]


def test_photographs_keep_their_colours():
    red = np.full((20, 30, 3), (0, 0, 255), np.uint8)
    figure = plotting.plot_matched({"one": red}, {"one": np.ones((20, 30))}, high=2, columns=1)
    assert figure.axes[0].images[0].get_array()[0, 0].tolist() == [255, 0, 0]


def test_cells_of_costs_ring_the_cheapest_and_the_true(ax):
    plotting.plot_cost_cells(np.array([[1, 0, 2], [5, 4, 3]]), np.array([1, 1]), ax)
    true, cheapest = ax.lines
    assert true.get_ydata().tolist() == [1, 1] and cheapest.get_ydata().tolist() == [1, 2]
    assert [text.get_text() for text in ax.texts] == list("102543")


def test_marking_leaves_the_picture_alone():
    picture = np.zeros((4, 5, 3), np.uint8)
    corner = np.zeros((4, 5), bool)
    corner[3, 0] = True
    assert plotting.mark_pixels(picture, ~corner, corner)[3, 0].tolist() == [60, 200, 0]
    marked = plotting.mark_pixels(picture, np.eye(4, 5, dtype=bool))
    assert not picture.any() and (marked.any(axis=2) == np.eye(4, 5, dtype=bool)).all()


def test_a_curve_may_bring_its_colour(ax):
    plotting.plot_curves({"a": ([0, 1], [0, 1], "black"), "b": ([0, 1], [1, 0])}, ax, xlabel="x", ylabel="y")
    assert [line.get_color() for line in ax.lines] == ["black", plotting.COLORS[1]]
