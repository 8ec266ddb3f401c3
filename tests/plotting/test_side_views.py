"""Drawings of one camera or one laser: what they draw has the lengths that they name."""

from __future__ import annotations

import numpy as np

from stereolib import paper, plotting
from stereolib.virtual import recordings


def test_depths_along_the_axis_are_those_of_the_disparities():
    rig, setup = recordings.rectified(), paper.paper_setup()
    view = paper.solve_pitch(rig, setup)
    _, axes = plotting.panels(1)
    plotting.plot_edge_depths({"pitched": view}, setup, axes)
    labels = [line.get_label() for line in axes[0].lines]
    for disparity_px in (view.disparity_foot_px, view.disparity_top_px):
        assert any(f"{rig.f_px * rig.baseline_mm / disparity_px / 10:.1f} cm" in label for label in labels)


def test_ray_of_a_low_camera_meets_the_floor_behind_it():
    _, axes = plotting.panels(2)
    plotting.plot_floor_rays(paper.paper_setup(), {"high": 60.0, "low": 8.5}, axes)
    places = [[line.get_xdata()[0] for line in ax.lines if line.get_marker() == "D"] for ax in axes]
    assert places[0][0] > 70 and places[1][0] < 0


def test_ray_goes_straight_past_depth_one_and_the_surface_to_the_floor():
    ax = plotting.plot_expected_ray(plotting.panels(1)[1][0])
    ray, hidden = (
        line.get_xydata() for line in ax.lines if line.get_color() == plotting.OURS and len(line.get_xdata()) == 2
    )
    (at_depth_one,) = (line.get_xydata()[0] for line in ax.lines if line.get_marker() == "o")
    np.testing.assert_allclose(hidden[0], ray[1])
    for point in (at_depth_one, ray[1]):
        np.testing.assert_allclose(np.interp(point[0], *np.array([ray[0], hidden[1]]).T), point[1])
    assert hidden[1][1] == 0
    assert {"$h$", "$X$", "$D_x$", "$-D_z$", "depth 1"} <= {text.get_text() for text in ax.texts}


def test_end_of_a_face_is_half_way_between_two_beams():
    setup = paper.paper_setup()
    _, axes = plotting.panels(2)
    plotting.plot_face_end(setup, axes)
    end = next(line.get_xydata()[0] for line in axes[1].lines if line.get_marker() == "D")
    assert abs(end[1] - end[0] - setup.distance_mm) < 1e-6  # on the face's line
    assert np.abs(end[0] - setup.side_mm / np.sqrt(2)) < 20


def test_camera_heights_and_triangle_are_drawn():
    heights = np.arange(10.0, 650.0, 10.0)
    _, axes = plotting.panels(2)
    widths = {"line": np.full((3, heights.size), 362.0), "point": np.full((3, heights.size), 300.0)}
    plotting.plot_camera_heights(heights, widths, axes[0], printed_px=362, ends_px=2, from_mm=300)
    assert "printed: 362 px" in [text.get_text() for text in axes[0].get_legend().get_texts()]
    words = {text.get_text() for text in plotting.plot_laser_triangle(axes[1]).texts}
    assert {"lamp", "lens", "chip", "$B$", "$f$", "$r$", "$s$"} <= words
