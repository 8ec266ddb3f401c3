"""Sliders: what they draw, what a static page shows of them, and what they say to refused settings."""

from __future__ import annotations

import base64

import cv2
import numpy as np
import pytest

from stereolib.matching import SGBMParams
from stereolib.notebook import explore


def draw(block_size, colour="grey"):
    SGBMParams(block_size=block_size)
    return np.full((20, 30, 3), 10 * block_size, np.uint8), f"blocks of {block_size}, {colour}"


def shown(bundle):
    return cv2.imdecode(np.frombuffer(base64.b64decode(bundle["image/jpeg"]), np.uint8), cv2.IMREAD_COLOR)


def test_static_page_shows_the_first_values():
    bundle = explore(draw, block_size=(5, 1, 21, 1))._repr_mimebundle_()
    assert "application/vnd.jupyter.widget-view+json" in bundle
    assert bundle["text/plain"] == "blocks of 5, grey"
    assert shown(bundle).shape == (20, 30, 3)
    np.testing.assert_allclose(shown(bundle), 50, atol=3)


def test_moving_a_slider_draws_again():
    explorer = explore(draw, block_size=(5, 1, 21, 1), colour=["grey", "blue"])
    explorer._controls["block_size"].value = 9
    explorer._controls["colour"].value = "blue"
    assert explorer._text.value == "blocks of 9, blue"
    np.testing.assert_allclose(shown(explorer._repr_mimebundle_()), 90, atol=3)


def test_refused_setting_says_why_and_keeps_the_picture():
    explorer = explore(draw, block_size=(5, 1, 21, 1))
    before = explorer._repr_mimebundle_()["image/jpeg"]
    explorer._controls["block_size"].value = 8
    assert "not possible" in explorer._text.value
    assert "block_size must be odd and at least 1, got 8; near are 7, 9" in explorer._text.value
    assert explorer._repr_mimebundle_()["image/jpeg"] == before
    explorer._controls["block_size"].value = 7
    assert explorer._text.value == "blocks of 7, grey"


def test_refused_first_setting_is_shown_too():
    def refuse(size):
        raise ValueError("must satisfy 0 <p1 <p2")

    explorer = explore(refuse, size=(2, 1, 5, 1))
    assert explorer._text.value == "<b>not possible:</b> must satisfy 0 &lt;p1 &lt;p2"
    assert explorer._repr_mimebundle_()["text/plain"] == "not possible: must satisfy 0 <p1 <p2"


def test_other_errors_are_not_hidden():
    with pytest.raises(ZeroDivisionError):
        explore(lambda size: 1 / 0, size=(2, 1, 5, 1))


def test_controls_take_their_kind_from_the_numbers():
    def blank(**_):
        return np.zeros((4, 4, 3), np.uint8), ""

    controls = explore(blank, whole=(5, 1, 9, 2), part_of=(0.5, 0.0, 1.0, 0.1), one=["a", "b"])._controls
    assert [type(c).__name__ for c in controls.values()] == ["IntSlider", "FloatSlider", "Dropdown"]
    assert (controls["whole"].min, controls["whole"].max, controls["whole"].step) == (1, 9, 2)
    assert controls["part_of"].description == "part of"
    assert controls["one"].options == ("a", "b")


@pytest.mark.parametrize("how", [5, (1, 2, 3), [], "abc"])
def test_refuses_controls(how):
    with pytest.raises(ValueError, match=r"'size' must be \(first, lowest, highest, step\) or a list of"):
        explore(draw, size=how)
