"""Sliders of notebook 06: both readings of a height, in words."""

from __future__ import annotations

import pytest

from stereolib import notebook


@pytest.mark.slow
def test_sliders_say_both_readings():
    picture, text = notebook.draw_heights(700, 45, 0, 300.0)
    assert picture.shape == (480, 1280, 3)
    assert text.startswith("true height 30.0 cm; the paper's recipe reads 3")
    assert float(text.partition("the ground plane ")[2].split()[0]) == pytest.approx(30, abs=0.1)
    picture, text = notebook.draw_recipe("pitched", 53, 7.25, 1)
    assert picture.shape == (480, 640, 3) and "the recipe reads 37.8 cm, the top pixel's ray 30.2 cm" in text
    assert "the recipe reads 0.1 cm" in notebook.draw_recipe("pitched", 53, 0.0, 1)[1]
