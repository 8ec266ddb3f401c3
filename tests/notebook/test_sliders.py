"""Sliders: what they draw, what a static page shows of them, and what they say to refused settings."""

from __future__ import annotations

import base64
import threading
from functools import partial

import cv2
import numpy as np
import pytest

from stereolib.matching import SGBMParams
from stereolib.notebook import draw_paths, draw_sgbm, explore
from stereolib.notebook.sliders import label, parameter_help


def draw(block_size, colour="grey"):
    """Draw.

    Parameters
    ----------
    block_size : int
        Edge of a block;
        it is odd.
    colour : str

    Returns
    -------
    picture, text
    """
    SGBMParams(block_size=block_size)
    return np.full((20, 30, 3), 10 * block_size, np.uint8), f"blocks of {block_size}, {colour}"


def blank(**_):
    return np.zeros((4, 4, 3), np.uint8), ""


def decoded(jpeg):
    return cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)


def shown(explorer):
    """What the page has: picture, caption and state."""
    picture = explorer._picture
    return decoded(picture.frames[0]), picture.captions[0], picture.quality


def set_to(explorer, **values):
    for name, value in values.items():
        explorer._controls[name].value = value
    assert explorer.settle(20)


def test_static_page_shows_the_first_values():
    bundle = explore(draw, block_size=(5, 1, 21, 1))._repr_mimebundle_()
    assert "application/vnd.jupyter.widget-view+json" in bundle
    assert bundle["text/plain"] == "blocks of 5, grey"
    assert bundle["image/jpeg"] == explore(draw, block_size=(5, 1, 21, 1))._repr_mimebundle_()["image/jpeg"]
    picture = decoded(base64.b64decode(bundle["image/jpeg"]))
    assert picture.shape == (20, 30, 3)
    np.testing.assert_allclose(picture, 50, atol=3)


def test_nothing_runs_before_a_slider_moves():
    before = threading.active_count()
    explorer = explore(draw, block_size=(5, 1, 21, 1))
    assert threading.active_count() == before and explorer.settle(0)


def test_moving_a_slider_draws_again():
    explorer = explore(draw, block_size=(5, 1, 21, 1), colour=["grey", "blue"])
    set_to(explorer, block_size=9, colour="blue")
    picture, said, quality = shown(explorer)
    assert (said, quality) == ("blocks of 9, blue", "full")
    np.testing.assert_allclose(picture, 90, atol=3)


def test_the_finger_never_waits_and_the_newest_value_wins():
    drawn, go_on = [], threading.Event()

    def slow(size):
        drawn.append(size)
        assert size == 0 or go_on.wait(20)
        return np.zeros((4, 4, 3), np.uint8), f"size {size}"

    explorer = explore(slow, size=(0, 0, 99, 1))
    for size in range(1, 100):
        explorer._controls["size"].value = size
    assert len(drawn) <= 2 and explorer._picture.quality == "waiting"  # here while the first of them is drawn
    assert explorer._picture.captions == ["size 0"]
    go_on.set()
    assert explorer.settle(20)
    assert drawn[-1] == 99 and len(drawn) <= 3
    assert shown(explorer)[1:] == ("size 99", "full")


def test_refused_setting_says_why_and_marks_the_picture():
    explorer = explore(draw, block_size=(5, 1, 21, 1))
    set_to(explorer, block_size=8)
    picture, said, quality = shown(explorer)
    assert said.startswith("not possible: block_size must be odd and at least 1, got 8; near are 7, 9")
    assert said.endswith("The picture is still that of block size 5.") and quality == "refused"
    np.testing.assert_allclose(picture, 50, atol=3)
    set_to(explorer, block_size=7)
    assert shown(explorer)[1:] == ("blocks of 7, grey", "full")


def test_refused_first_setting_is_shown_too():
    def refuse(size):
        raise ValueError("must satisfy 0 <P1 <P2")

    explorer = explore(refuse, size=(2, 1, 5, 1))
    assert explorer._picture.captions == ["not possible: must satisfy 0 <P1 <P2"] and not explorer._picture.frames
    bundle = explorer._repr_mimebundle_()
    assert bundle["text/plain"] == "not possible: must satisfy 0 <P1 <P2" and "image/jpeg" not in bundle


def test_other_errors_are_not_hidden(capfd):
    with pytest.raises(ZeroDivisionError):
        explore(lambda size: 1 / 0, size=(2, 1, 5, 1))

    def fail_at_3(size):
        1 / (size - 3)
        return blank()

    explorer = explore(fail_at_3, size=(2, 1, 5, 1))
    set_to(explorer, size=3)
    assert shown(explorer)[1].startswith("failed, ZeroDivisionError: ") and shown(explorer)[2] == "refused"
    assert "ZeroDivisionError" in capfd.readouterr().err


def test_controls_take_their_kind_from_the_numbers():
    sliders = {"whole": (5, 1, 9, 2), "written_0": (3.0, 0.0, 40.0, 1.0), "part_of": (0.5, 0.0, 1.0, 0.25)}
    choices = {"certain": [16, 32, 48], "odd": (5, range(1, 16, 2)), "one": ["a", "b"]}
    explorer = explore(blank, **sliders, p1=(-0.0048, -0.0248, 0.0152, 0.001), **choices)
    controls = explorer._controls
    kinds = "IntSlider IntSlider FloatSlider FloatSlider SelectionSlider SelectionSlider Dropdown"
    assert [type(c).__name__ for c in controls.values()] == kinds.split()
    assert (controls["whole"].min, controls["whole"].max, controls["whole"].step) == (1, 9, 2)
    assert (controls["part_of"].readout_format, controls["p1"].readout_format) == (".2f", ".4f")
    assert [text for text, _ in controls["odd"].options] == [str(size) for size in range(1, 16, 2)]
    assert controls["one"].options == ("a", "b")
    assert all(getattr(control, "continuous_update", True) for control in controls.values())
    assert list(explorer.values.values()) == [5, 3, 0.5, -0.0048, 16, 5, "a"]


def test_names_keep_their_case_and_show_their_units():
    assert [label(name) for name in ("P1", "p1", "part_of", "yaw_deg", "baseline_error_pct", "px")] == [
        "P1", "p1", "part of", "yaw (degrees)", "baseline error (%)", "px",
    ]  # fmt: skip


def test_help_is_the_docstrings_or_ones_own():
    assert parameter_help(partial(draw, colour="red")) == {"block_size": "Edge of a block; it is odd."}
    assert parameter_help(draw_sgbm).keys() >= {"condition", "num_disparities", "block_size", "P1", "P2"}
    assert parameter_help(draw_paths)["row"] == parameter_help(draw_paths)["column"] == "The pixel, in the strip."
    controls = explore(draw, help={"colour": "Of the paper."}, block_size=(5, 1, 9, 2), colour=["red"])._controls
    assert [control.tooltip for control in controls.values()] == ["Edge of a block; it is odd.", "Of the paper."]
    with pytest.raises(ValueError, match="help for size, but the controls are block_size"):
        explore(draw, help={"size": "?"}, block_size=(5, 1, 9, 2))


@pytest.mark.parametrize("how", [5, (1, 2, 3), [], "abc", (4, [1, 2]), (True, 0, 2, 1)])
def test_refuses_controls(how):
    with pytest.raises(ValueError, match=r"'size' must be \(first, lowest, highest, step\) or a list of"):
        explore(draw, size=how)
