"""Drawings of two views: lengths are to scale, and what they name is what they draw."""

from __future__ import annotations

import re

import nbformat
import numpy as np
import pytest

from stereolib import paper, plotting
from stereolib.base import ROOT
from stereolib.plotting import course_map
from stereolib.virtual import recordings


def ends(ax):
    return {(round(x, 6), round(y, 6)) for line in ax.lines for x, y in zip(*line.get_data(), strict=True)}


def test_lines_of_sight_pass_the_thumb_and_end_on_the_wall():
    _, (ax,) = plotting.panels(1)
    plotting.plot_thumb(60.0, (600.0, 300.0), 1200.0, ax)
    # Through (0, 30) and (300, 0) the wall is met at -90, through (600, 0) at -30.
    assert {(1200.0, -90.0), (1200.0, 90.0), (1200.0, -30.0), (1200.0, 30.0)} <= ends(ax)
    assert ax.get_aspect() == 1.0


def test_similar_triangles_have_one_ratio():
    _, axes = plotting.panels(2)
    plotting.plot_similar_triangles(100.0, 90.0, (60.0, 400.0), axes)
    large, small = (np.ptp(patch.get_xy(), axis=0) for patch in axes[1].patches)
    np.testing.assert_allclose(large, (90.0, 400.0))
    np.testing.assert_allclose(small, large * 100 / 400)
    assert all(ax.get_aspect() == 1.0 for ax in axes)


def test_pair_and_line_name_their_places():
    picture = np.zeros((48, 64, 3), np.uint8)
    _, axes = plotting.panels(2)
    plotting.plot_pair((picture, picture), ([(30, 10)], []), axes)
    assert [text.get_text() for text in axes[0].texts] == ["column 30\nrow 10"] and not axes[1].texts
    plotting.plot_line_of_sight(np.array([[1.0, 2.0], [3.0, 4.0], [2.0, 3.0]]), [500], axes[1])
    assert [text.get_text() for text in axes[1].texts] == ["0.5 m"]
    assert {(1.0, 2.0), (3.0, 4.0), (2.0, 3.0)} <= ends(axes[1])


def test_map_of_the_course_has_every_chapter_that_its_table_names():
    _, (ax,) = plotting.panels(1)
    drawn = {text.get_text()[:2] for text in plotting.plot_course(ax).texts}
    cells = nbformat.read(ROOT / "notebooks" / "00_two_pictures.ipynb", as_version=4).cells
    named = set(re.findall(r"^\| \[?(\d\d) ", "\n".join(cell.source for cell in cells), re.MULTILINE))
    assert named | {"00"} == {name for name in drawn if name.isdigit()}
    assert {name for arrow in course_map._ARROWS for name in arrow.split()} == set(course_map._BOXES)


def test_traces_on_both_panes_differ_by_the_disparity():
    _, axes = plotting.panels(2)
    plotting.plot_similar_triangles(100.0, 90.0, (60.0, 400.0), axes)
    left, right = (np.ptp(line.get_xdata()) for line in axes[1].lines if line.get_linewidth() == 5)
    assert left + right == 100.0 * 90.0 / 400.0  # the right trace runs to the left
    assert {"$x_l$", "$x_r$"} <= {text.get_text() for text in axes[1].texts}


def test_turned_axes_cross_where_the_notebook_says():
    _, (ax,) = plotting.panels(1)
    plotting.plot_toe_in(93.0, 8.0, np.array([[900.0, 200.0], [700.0, 0.0], [900.0, -200.0]]), ax)
    (x0, y0), (x1, y1) = (line.get_data() for line in ax.lines if line.get_linewidth() == 1.6)
    crossing = 93.0 / 2 / np.tan(np.radians(4.0))
    np.testing.assert_allclose([np.interp(crossing, x0, y0), np.interp(crossing, x1, y1)], -93.0 / 2)
    assert (np.ptp(ax.patches[0].get_xy(), axis=0) / 2).tolist() == [200.0, 200.0]


def test_camera_and_cube_are_drawn_to_scale():
    setup = paper.paper_setup()
    view = paper.solve_pitch(recordings.rectified(), setup)
    above, aside = plotting.panels(1, 2)[1]
    plotting.plot_camera_and_cube(view, setup, 0.3, (above, aside))
    assert above.get_title() == "from above, as for a level camera"
    half_cm = setup.side_mm / np.sqrt(200)
    np.testing.assert_allclose(above.lines[0].get_xydata()[1], [70 + half_cm, -half_cm])  # a side corner
    ray = [line.get_xydata() for line in aside.lines][-2]
    np.testing.assert_allclose(ray, [[0, 8.5], [70, 0]])  # from the camera to the cube's foot
    assert {text.get_text() for text in aside.texts} >= {r"$\theta$", r"$h_\mathrm{cam}$", "$D$"}


def test_two_turns_end_with_both_panes_in_one_line():
    _, axes = plotting.panels(3)
    plotting.plot_two_turns(axes)
    panes = [[line.get_xydata() for line in ax.lines if line.get_linewidth() == 4] for ax in axes]
    slopes = [[np.subtract(*pane)[1] / np.subtract(*pane)[0] for pane in pair] for pair in panes]
    assert slopes[0][0] != pytest.approx(slopes[0][1])
    assert slopes[1][0] == pytest.approx(slopes[1][1]) and abs(slopes[1][0]) > 0.1
    np.testing.assert_allclose(np.array(panes[2])[..., 1], panes[2][0][0, 1])
