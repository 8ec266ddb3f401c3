"""A gallery hangs every picture in its place, in the colours of one bar, at its true aspect."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib import plotting
from stereolib.matching import score
from stereolib.plotting import Exhibit

FLAT = np.full((30, 40), 80.0)
ROWS = {"map": "disparity", "error": "error"}


def gallery(count, **keywords):
    exhibits = [Exhibit(f"number {k}", [FLAT + k, np.full_like(FLAT, k)], f"told {k}") for k in range(count)]
    return plotting.plot_gallery(exhibits, ROWS, **keywords)


def test_panels_share_two_bars_and_their_ends():
    figure = gallery(5, columns=3, disparity_px=(60, 100), limit_px=2)
    panels, bars = figure.axes[:10], figure.axes[10:]
    assert [bar.get_xlabel() for bar in bars] == ["disparity (px)", "error (px): red is too near"]
    assert [axis.images[0].get_clim() for axis in panels] == [(60, 100), (-2, 2)] * 5
    assert [axis.get_title() for axis in panels[::2]] == [f"number {k}" for k in range(5)]
    assert [axis.get_xlabel() for axis in panels[1::2]] == [f"told {k}" for k in range(5)]


def test_nothing_overlaps_and_pixels_are_square():
    figure = gallery(5, columns=3)
    figure.canvas.draw()
    boxes = [axis.get_window_extent() for axis in figure.axes]
    assert all(box.width / box.height == pytest.approx(40 / 30, rel=0.01) for box in boxes[:10])
    for k, one in enumerate(boxes):
        assert not any(one.overlaps(other) for other in boxes[k + 1 :])
    texts = [text.get_window_extent() for axis in figure.axes for text in (axis.title, axis.xaxis.label)]
    assert all(box.y0 >= 0 and box.y1 <= figure.bbox.height for box in texts if box.width > 1)


def test_red_is_too_near_and_holes_are_grey():
    figure = plotting.plot_gallery([Exhibit("", [np.array([[4.0, -4.0, np.nan]])])], {"": "error"}, columns=1)
    red, blue, hole = figure.axes[0].images[0].to_rgba(np.ma.masked_invalid([4.0, -4.0, np.nan]))
    assert red[0] > red[2] + 0.2 and blue[2] > blue[0] + 0.2 and hole[:3] == pytest.approx([0xD9 / 255] * 3)


def test_each_exhibit_has_a_picture_for_each_row():
    with pytest.raises(ValueError, match="zip"):
        plotting.plot_gallery([Exhibit("one", [FLAT])], ROWS)


def test_repairs_are_scored_where_they_are_shown():
    truth, where = FLAT.copy(), np.zeros(FLAT.shape, bool)
    where[5:25, 5:35] = True
    off = truth + np.where(np.arange(40) < 12, 3.0, 0.0)
    off[20:, :] = np.nan
    figure = plotting.plot_repairs({"left_right": off}, truth, where, (slice(2, 28), slice(0, 40)))
    assert figure.axes[2].get_title() == "left\nright"
    assert figure.axes[3].get_xlabel() == f"bad-2 {score(off, truth, where).bad2_pct:.0f} %"
    shown = figure.axes[3].images[0].get_array()
    assert shown.shape == (26, 40) and shown.mask[0].all() and shown[4, 6] == 3.0


def test_repairs_stand_without_the_truth_where_that_is_asked_for():
    truth, where = FLAT.copy(), np.ones(FLAT.shape, bool)
    part = slice(2, 28), slice(0, 40)
    figure = plotting.plot_repairs({"median": truth + 1, "closing": truth}, truth, where, part, with_truth=False)
    assert [axis.get_title() for axis in figure.axes if axis.get_title()] == ["median", "closing"]


def test_cells_have_their_numbers_written_in_them():
    ax = plotting.panels(1)[1][0]
    plotting.plot_cells(np.array([[1.0, np.nan], [2.5, 9.0]]), ax, "small")
    assert [text.get_text() for text in ax.texts] == ["1", "2.5", "9"]


def test_shares_fill_their_bars():
    ax = plotting.panels(1)[1][0]
    plotting.plot_shares({"a": {"x": 30, "y": 70}, "b": {"x": 100, "y": 0}}, ax, {"x": "red", "y": "blue"}, xlabel="%")
    assert [(bar.get_x(), bar.get_width()) for bar in ax.patches] == [(0, 30), (0, 100), (30, 70), (100, 0)]
    assert ax.get_xlim() == (0, 100) and ax.yaxis_inverted()


def test_shares_may_have_their_numbers_and_what_they_are_of():
    ax = plotting.panels(1)[1][0]
    shares = {"a": {"x": 30.4, "y": 69.6}, "b": {"x": 98, "y": 2}}
    plotting.plot_shares(shares, ax, {"x": "black", "y": "white"}, xlabel="%", ends={"a": "50 px", "b": "7 px"})
    assert [text.get_text() for text in ax.texts] == ["30", "98", "70", "", "50 px", "7 px"]
