"""Knobs of the bench: every value that is offered comes back from its text, and nothing else is taken."""

from __future__ import annotations

from dataclasses import replace

import pytest

from stereolib.matching import compute_disparity, motorcycle_view
from stereolib.notebook.knobs import State, from_text, knobs, most_p2, on_step, to_text
from stereolib.notebook.stories import STORIES


def ends(name: str) -> list[object]:
    knob, first = knobs()[name], getattr(State(), name)
    if isinstance(first, bool):
        return [True, False]
    return list(knob.choices) or [knob.low, knob.high]


@pytest.mark.parametrize("name", knobs())
def test_text_holds_every_end_of_every_knob(name):
    for value in ends(name):
        state = replace(State(), **{name: value})
        assert from_text(to_text(state)) == state
    assert on_step(name, getattr(State(), name)) == getattr(State(), name)


def test_text_of_the_first_state_is_empty_and_of_all_turned_complete():
    assert to_text(State()) == "" and from_text("") == State()
    turned = replace(State(source="conditions/texture"), **{name: ends(name)[-1] for name in knobs()})
    assert from_text(to_text(turned)) == turned
    assert from_text(f" {to_text(turned).replace('; ', ' ;; ')} ;") == turned


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("distance_mm", '"distance_mm" is no "knob=value"'),
        ("distance=700", 'no knob "distance"'),
        ("half=True", 'no knob "half"'),
        ("distance_mm=far", 'must be a number, got "far"'),
        ("distance_mm=449", "distance_mm must be 450 to 1500, got 449"),
        ("contrast=nan", "contrast must be 0 to 0.6"),
        ("block_size=4", "must be one of 1, 3, 5"),
        ("filter=dilate", "filter must be one of none, dilation"),
        ("laser=yes", 'must be True or False, got "yes"'),
    ],
)
def test_refuses(text, reason):
    with pytest.raises(ValueError, match=reason):
        from_text(text)


def test_values_between_two_steps_go_to_the_nearer_one():
    assert from_text("distance_mm=706").distance_mm == 710
    assert on_step("pitch_deg", -25 + 333 * 0.1) == 8.3
    assert on_step("matcher", "best") == "best"


@pytest.mark.parametrize("story", STORIES, ids=lambda story: story.name)
def test_stories_stand_on_steps(story):
    """Else the slider would move them to one, and the story would be over."""
    for name in knobs():
        assert on_step(name, getattr(story.state, name)) == getattr(story.state, name), name


@pytest.mark.parametrize("block", knobs()["block_size"].choices)
def test_opencv_takes_the_dearest_p2_of_every_block(block):
    view = motorcycle_view()
    left, right = (image[200:260, 200:340].copy() for image in (view.left, view.right))
    most = most_p2(block)
    assert most > 2
    state = State(block_size=block, p1=most - 1, p2=most, num_disparities=16, mode="hh")
    assert state.sgbm.p1 < state.sgbm.p2
    compute_disparity(left, right, state.sgbm)
    assert most == 150 or (most + 1 + 88) * block**2 > 32767  # one more would not fit


def test_half_size_searches_half():
    state = State(num_disparities=96, min_disparity=20, speckle_window_size=100, half=True)
    assert (state.sgbm.num_disparities, state.sgbm.min_disparity, state.sgbm.speckle_window_size) == (48, 10, 25)
