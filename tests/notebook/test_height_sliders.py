"""Sliders of notebook 06: both readings of a height, in words."""

from __future__ import annotations

import re

import pytest

from stereolib import notebook


@pytest.mark.slow
def test_sliders_say_both_readings():
    picture, text = notebook.draw_heights(700, 45, 0, 300.0)
    assert picture.shape == (480, 1280, 3)
    assert text.startswith("true height 30.0 cm; the paper's recipe reads 3")
    assert float(text.partition("the ground plane ")[2].split()[0]) == pytest.approx(30, abs=0.1)
    picture, text = notebook.draw_recipe(8.25, 7.25, 53, 1)
    assert picture.shape == (480, 640, 3)
    assert text.startswith("camera 8.5 cm up; up the edge its disparity falls by 6.2 px; ")
    reads = [float(text.partition(f"{who} ")[2].split()[0]) for who in ("the recipe reads", "own depth")]
    assert reads == pytest.approx([37.8, 30.0], abs=0.3)
    assert "its disparity rises by " in notebook.draw_recipe(-20.0, 7.25, 53, 1)[1]  # its top is nearer
    strict = notebook.draw_recipe(8.25, 0.0, 53, 1)[1]
    assert float(strict.partition("the recipe reads ")[2].split()[0]) < 1


def test_a_scale_is_that_of_the_corners_between_which_the_width_is_counted():
    """Edge-on they stand half a diagonal behind the near edge; a face stands at the near distance as a whole."""
    edge_on, face = (notebook.draw_width(700, yaw_deg, 8.25)[1] for yaw_deg in (45, 0))
    assert (
        "0.117 cm at the two outermost corners and 0.089 cm at the nearest one. Between the two are 42.4 cm" in edge_on
    )
    assert "0.089 cm at the two outermost corners and 0.089 cm at the nearest one. Between the two are 30.0 cm" in face
    for text in (edge_on, face):
        found, expected = (int(n) for n in re.match(r"(\d+) px wide, by geometry (\d+) px", text).groups())
        assert abs(found - expected) <= 2
