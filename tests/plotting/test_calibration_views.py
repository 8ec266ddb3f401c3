"""Drawings of a calibration: to one scale in space, lines in their plane, arrows as long as the lens shifts."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib import plotting
from stereolib.calibration import HoldOut
from stereolib.paper import paper_rig
from stereolib.plotting.calibration_views import _on_pane
from stereolib.rig import Camera


@pytest.fixture
def space():
    return plotting.panels(1, subplot_kw={"projection": "3d"})[1][0]


def test_boards_stand_upright_before_the_cameras(space):
    outline = np.array([[[0.0, 10.0, 500.0], [100.0, 10.0, 500.0], [100.0, 80.0, 500.0], [0.0, 80.0, 500.0]]])
    plotting.plot_boards_in_space(outline, [[0, 0, 0], [93, 0, 0]], space)
    x, forward, up = space.lines[0].get_data_3d()
    assert list(x) == [0, 100, 100, 0, 0] and set(forward) == {500.0} and list(up) == [-10, -10, -80, -80, -10]
    assert [text.get_text() for text in space.texts] == ["left camera", "right camera"]


def test_line_on_the_right_pane_lies_in_the_plane_of_both_cameras_and_the_point(space):
    rig, point = paper_rig(), np.array([20.0, -60.0, 330.0])
    plotting.plot_epipolar_plane(rig, tuple(point), space)
    (line,) = (line for line in space.lines if line.get_linewidth() == 2.6)
    x, forward, up = line.get_data_3d()
    centre = -rig.R.T @ rig.T
    normal = np.cross(point, centre) / np.linalg.norm(np.cross(point, centre))
    np.testing.assert_allclose(np.column_stack([x, -np.array(up), forward]) @ normal, 0, atol=1e-9)
    seen = _on_pane(rig, point)
    assert abs(seen / seen[2] @ rig.E @ (point / point[2])) < 1e-9


def test_arrows_lead_from_the_pinhole_to_the_lens():
    _, (ax,) = plotting.panels(1)
    camera = Camera([[700, 0, 320], [0, 700, 240], [0, 0, 1]], [-0.2, 0.0, 0.0, 0.0], (640, 480))
    plotting.plot_lens_arrows(camera, ax, longer=2)
    (arrows,) = ax.collections
    begin, shift = arrows.get_offsets(), np.column_stack([arrows.U, arrows.V])
    rays = np.column_stack([(begin - camera.K[:2, 2]) / 700, np.ones(len(begin))])
    np.testing.assert_allclose(camera.project(rays) - begin, shift / 2, atol=1e-6)


def test_lines_pass_the_partners():
    rig, picture = paper_rig(), np.zeros((480, 640), np.uint8)
    points = np.array([[50.0, -40.0, 700.0], [0.0, 60.0, 900.0]])
    pixels = [points @ rig.left.K.T, (points @ rig.R.T + rig.T) @ rig.right.K.T]
    left, right = (each[:, :2] / each[:, 2:] for each in pixels)
    _, axes = plotting.panels(2)
    plotting.plot_epipolar_lines((picture, picture), (left, right), np.column_stack([left, [1, 1]]) @ rig.F.T, axes)
    drawn = [line for line in axes[1].lines if len(line.get_xdata()) == 2]
    for line, (column, row) in zip(drawn, right, strict=True):
        assert np.interp(column, *line.get_data()) == pytest.approx(row, abs=1e-6)


def test_camera_matrix_leads_from_the_corner_to_the_pixel():
    _, (ax,) = plotting.panels(1)
    camera = Camera([[700, 0, 320], [0, 710, 240], [0, 0, 1]], [], (640, 480))
    plotting.plot_camera_matrix(camera, (0.1, 0.2), ax)
    cross, dot = (line.get_xydata()[0].tolist() for line in ax.lines)
    assert cross == [320.0, 240.0] and dot == pytest.approx(camera.project(np.array([[0.1, 0.2, 1.0]]))[0])


def test_fitted_and_left_out_are_told_apart():
    _, (ax,) = plotting.panels(1)
    plotting.plot_hold_out([HoldOut("pinhole", 0, 0.1, 0.2), HoldOut("brown3", 5, 0.05, 0.06)], ax)
    drawn = {line.get_label(): np.round(line.get_ydata().astype(float), 3).tolist() for line in ax.lines}
    assert drawn == {"pairs fitted": [0.1, 0.05], "pairs left out": [0.2, 0.06]}
