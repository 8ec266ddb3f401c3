"""Pictures show what was given, in its colours and at its place."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from support.axes import rendered

from stereolib import plotting


@pytest.fixture
def ax():
    return plotting.panels(1)[1][0]


def test_photograph_has_its_colours_in_order(ax):
    image = np.zeros((30, 40, 3), np.uint8)
    image[:, :20, 0] = 255  # blue on the left, in blue-green-red
    plotting.plot_image(image, ax)
    picture = rendered(ax)
    middle = picture.shape[0] // 2
    assert picture[middle, 40].tolist() == [0, 0, 255]
    assert picture[middle, -40].tolist() == [0, 0, 0]


def test_grey_is_not_stretched(ax):
    plotting.plot_image(np.full((30, 40), 100, np.uint8), ax)
    assert rendered(ax)[60, 60].tolist() == [100, 100, 100]


@pytest.mark.parametrize("place", [(5, 55), (75, 5)])
def test_a_glass_shows_few_pixels_and_hides_none_of_them(ax, place):
    mask = np.zeros((60, 80), bool)
    mask[place[1], place[0]] = True
    plotting.plot_mask(np.full((60, 80), 90, np.uint8), mask, ax, zoom=place)
    (glass,) = ax.child_axes
    low, high = sorted(glass.get_xlim())
    assert low < place[0] < high and high - low == 12
    ax.figure.canvas.draw()
    assert not glass.get_window_extent().contains(*ax.transData.transform(place))


def test_height_and_box_show_their_numbers(ax):
    image = np.full((60, 80, 3), 90, np.uint8)
    mask = np.zeros((60, 80), bool)
    mask[10:40, 30:33] = True
    before = image.copy()
    plotting.plot_height(image, SimpleNamespace(mask=mask, top_row=10, foot_row=40, column=31), ax)
    texts = [text.get_text() for text in ax.texts]
    assert any(t.endswith(": 10") for t in texts) and any(t.endswith(": 40") for t in texts)
    assert [line.get_ydata()[0] for line in ax.lines] == [10, 40]
    marked = (ax.images[0].get_array() != 90).any(axis=2)
    np.testing.assert_array_equal(marked, mask)
    other = plotting.panels(1)[1][0]
    edges = np.zeros((60, 80), np.uint8)
    edges[20, 20:40] = 255
    plotting.plot_box(image, SimpleNamespace(left=20, top=15, width=36, height=20), other, edges=edges)
    assert [t.get_text() for t in other.texts] == ["36 px"]
    marked = (other.images[0].get_array() != 90).any(axis=2)
    assert marked[20, 20:40].all() and 20 <= marked.sum() <= 4 * 21  # the edge, up to four pixels wide
    assert other.patches[0].get_bbox().bounds == (19.5, 14.5, 36, 20)
    np.testing.assert_array_equal(image, before)


def test_crops_show_both_points_at_the_left_one_s_row():
    images = [np.zeros((100, 200), np.uint8) for _ in range(2)]
    at = np.array([[[60.0, 50.0], [120, 60]], [[40.0, 46.0], [100, 60]]])  # the first is 4 rows higher on the right
    for (column, row), image in zip(at[:, 0].astype(int), images, strict=True):
        image[row, column] = 255
    _, axes = plotting.panels(1, 2)
    plotting.plot_row_test(*images, *at, axes, "pair")
    crops = axes[1].images[0].get_array()
    bright = np.argwhere(crops == 255)
    rings = np.array([line.get_xydata() for line in axes[1].lines if line.get_marker() == "o"])
    for ring in rings[0]:
        assert np.any(np.all(bright == ring[::-1].round().astype(int), axis=1))
    labels = [text.get_text() for text in axes[1].get_xticklabels()]
    assert labels == ["left | right: 4.0 rows higher", "left | right: same row"]
    assert [line.get_ydata()[0] for line in axes[0].lines[:2]] == [50, 60]


def test_epipolar_lines_stand_where_they_are_and_rows_are_dashed(ax):
    image, points = np.zeros((40, 60), np.uint8), np.array([[10.0, 12.0]])
    line = np.array([[5.0, 20.0], [30.0, 25.0]])
    plotting.plot_partners(image, points, [line], ax)
    drawn, dashed, near, far = (one.get_xydata() for one in ax.lines)
    np.testing.assert_array_equal(np.vstack([near, far]), line)
    np.testing.assert_array_equal(drawn, line)
    np.testing.assert_array_equal(dashed, [[5, 12], [30, 12]])
    assert [text.get_text() for text in ax.texts] == ["+8.0", "+13.0"]
    other = plotting.panels(1)[1][0]
    plotting.plot_partners(image, points, [], other)
    np.testing.assert_array_equal(other.lines[0].get_xydata(), points)


def test_what_is_not_counted_is_faded(ax):
    counted = np.zeros((30, 40), bool)
    counted[:, :20] = True
    plotting.plot_mask(np.full((30, 40), 100, np.uint8), np.zeros((30, 40), bool), ax, counted=counted)
    shown = ax.images[0].get_array()
    assert shown[5, 5, 0] == 100 and shown[5, 30, 0] == 224


def test_rows_and_corners(ax):
    plotting.plot_rows(np.zeros((40, 60), np.uint8), np.zeros((40, 60), np.uint8), ax, rows=[10, 20.5])
    assert ax.images[0].get_array().shape == (40, 120)
    assert [line.get_ydata()[0] for line in ax.lines[:2]] == [10, 20.5]
    other = plotting.panels(1)[1][0]
    corners = np.array([[10.0, 10], [20, 10], [30, 10], [10, 20], [20, 20], [30, 20]])
    plotting.plot_corners(np.zeros((40, 60), np.uint8), corners, 3, other)
    np.testing.assert_array_equal(other.lines[0].get_xydata(), corners)
    np.testing.assert_array_equal(other.collections[1].get_offsets(), corners[:1])  # the first one ringed


def test_points_and_dots_are_where_they_were_given(ax):
    at = np.array([[[1.0, 2.0], [30.0, 40.0]], [[5.0, 6.0], [7.0, np.nan]]])
    plotting.plot_points(at, (100, 60), ax, "points")
    np.testing.assert_array_equal(np.asarray(ax.collections[0].get_offsets()), at.reshape(-1, 2))
    other = plotting.panels(1)[1][0]
    plotting.plot_dots(np.arange(3), np.arange(3) ** 2, other, color=np.array([4, 5, 6]), label="mm", xlabel="x (deg)")
    assert other.collections[0].get_array().tolist() == [4, 5, 6] and other.get_xlabel() == "x (deg)"
