"""Figures of heights: what is drawn is what was measured."""

from __future__ import annotations

import numpy as np
import pytest
from support.attempts import attempted

from stereolib import laser, plotting
from stereolib.rig import to_grey
from stereolib.virtual import recordings


def test_found_is_drawn_where_it_was_measured():
    tried = attempted("conditions/level")
    ax = plotting.plot_height_attempt(tried, plotting.panels(1)[1][0], "cube")
    lines = {line.get_label(): line.get_xydata() for line in ax.lines}
    assert lines["near edge"] == pytest.approx(tried.edge_px)
    (x0, y0), (x1, y1) = lines["top line"]
    at = (tried.edge_px[1][0] - x0) / (x1 - x0)
    assert y0 + at * (y1 - y0) == pytest.approx(tried.edge_px[1][1], abs=1.5)
    assert ax.texts[0].get_text() == f"{tried.height_mm / 10:.2f} ± {0.196 * tried.std_mm:.2f} cm (95 %)"
    red, _, blue = np.moveaxis(ax.images[0].get_array().astype(int), -1, 0)
    cube, others = (recordings.load_truth("conditions/level").box == box for box in (1, 0))
    assert (red > blue)[cube].mean() > 0.9 and (red > blue)[others].mean() < 0.02
    floor = others & np.isfinite(tried.disparity_px)
    floor[:400] = False  # the lowest rows show nothing else
    assert (blue > red)[floor].mean() > 0.95 and (blue > red)[cube].mean() < 0.03


def test_a_refused_attempt_is_its_picture_without_lines():
    tried = attempted("conditions/glare")
    ax = plotting.plot_height_attempt(tried, plotting.panels(1)[1][0], "poor light")
    assert not ax.lines and not ax.texts and ax.get_title() == "poor light"
    (shown,) = ax.images
    np.testing.assert_array_equal(shown.get_array(), np.stack([to_grey(tried.left)] * 3, axis=-1))


def test_intervals_and_notes_stand_in_their_rows():
    ax = plotting.panels(1)[1][0]
    plotting.plot_intervals(
        ["a", "b", "c"], [0.5, np.nan, -0.2], [0.1, np.nan, 0.3], ax, xlabel="error (mm)", notes=["", "refused", ""]
    )
    (container,) = ax.containers
    assert container.lines[0].get_xydata().tolist() == [[0.5, 0], [-0.2, 2]]
    bars = [segment[:, 0].tolist() for segment in container.lines[2][0].get_segments()]
    assert bars == [pytest.approx([0.4, 0.6]), pytest.approx([-0.5, 0.1])]
    assert [(t.get_position(), t.get_text()) for t in ax.texts] == [((0, 1), "refused")]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["a", "b", "c"]
    low, high = ax.get_ylim()
    assert low > high  # the first name is on top


def test_a_laser_s_errors_are_drawn_where_there_are_readings_enough():
    near, far = np.array([1000.0, 2000.0]), np.array([5.0, 9.0])
    curve = laser.ErrorCurve(near, np.array([40, 3]), far, far, far, np.array([0.0, 0.9]))
    axes = plotting.panels(2, 2)[1]
    plotting.plot_error_curves(near, {"white": curve, "dark": curve}, axes, limit_mm=3000.0)
    white, dark, limit = axes[0].lines
    assert (white.get_color(), dark.get_color()) == ("0.7", "0.0") and limit.get_xdata()[0] == 3000
    np.testing.assert_allclose(white.get_xydata(), [[1000, 5]])
    np.testing.assert_allclose(axes[3].lines[0].get_xydata(), [[1000, 0], [2000, 90]])
