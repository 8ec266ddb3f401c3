"""Each story's button lands on what its sentences say, shows the knobs that it turned, and leaves nothing behind."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from support.browser import Page

from stereolib.notebook.knobs import State, from_text, knobs, to_text
from stereolib.notebook.stories import STORIES, Story

STORY = {story.name: story for story in STORIES}


def begin(bench: Page, story: Story) -> None:
    bench.page.get_by_role("button", name=story.name, exact=True).click()
    bench.wait_for(to_text(story.state))
    bench.page.wait_for_function("!document.querySelector('.stereolib-said').innerText.includes('…')")


def results(bench: Page) -> str:
    bench.page.wait_for_function("!document.querySelector('.stereolib-results').innerText.includes('…')")
    return bench.text("results")


@pytest.mark.parametrize("story", STORIES, ids=lambda story: story.name)
def test_story_marks_its_knobs_and_says_what_the_result_line_shows(bench: Page, story: Story) -> None:
    begin(bench, story)
    said, shown = bench.text("said"), [results(bench)]
    assert bench.page.locator(".stereolib-knobs .stereolib-set").count() == len(story.set_knobs)
    for name in story.set_knobs:
        assert f"{knobs()[name].label}: {knobs()[name].shown(getattr(story.state, name))}" in said
    for name in (*story.set_knobs, *story.next_knobs):  # in sight
        bench.page.locator(".stereolib-knobs .widget-inline-hbox", has_text=knobs()[name].label).first.wait_for()
    assert bench.words() == to_text(story.state)
    for then in story.then:
        bench.restore(to_text(then))
        shown.append(results(bench))
    sentence = said.partition(").")[2] if story.set_knobs else said  # behind the values of its knobs
    told = re.findall(r"[-+]?\d+\.\d+(?! px would be right)", sentence)
    assert told
    for number in told:
        assert any(re.search(rf"(?<![\d.]){re.escape(number)}\d?(?!\d)", text) for text in shown), (number, shown)
    for moved in re.findall(r"turned by [\d.]+ ± [\d.]+ degrees", said):
        assert moved in shown[0]
    assert "nan" not in said and "nothing was found" not in said


def test_a_story_stays_and_pales_until_its_knobs_come_back(bench: Page) -> None:
    story = STORY["What dilation destroys"]
    begin(bench, story)
    whole = bench.text("said")
    kernel = bench.row(knobs()["kernel_px"].label).locator("select")
    kernel.select_option("9")
    past = bench.page.locator(".stereolib-past", has_text="Settings changed since")
    past.wait_for()
    assert story.sentence[:60] in past.inner_text()
    kernel.select_option("15")
    bench.page.locator(".stereolib-story").wait_for()
    assert bench.text("said") == whole
    bench.row(knobs()["filter"].label).locator("select").select_option("none")  # where the story sends
    bench.wait_for(to_text(story.then[0]))
    assert "Settings changed" not in bench.text("said")


def test_another_source_takes_what_the_story_set_away_and_keeps_what_was_turned(bench: Page) -> None:
    story = STORY["What dilation destroys"]
    begin(bench, story)
    bench.slider(knobs()["uniqueness_ratio"].label).press("ArrowRight")
    bench.wait_for(to_text(replace(story.state, uniqueness_ratio=State().uniqueness_ratio + 1)))
    bench.page.locator(".stereolib-stories select").select_option("conditions/plain")
    bench.page.wait_for_function("!document.querySelector('.stereolib-said').innerText")
    left = State(source="conditions/plain", uniqueness_ratio=State().uniqueness_ratio + 1)
    bench.wait_for(to_text(left))
    assert from_text(bench.words()) == left and not bench.page.locator(".stereolib-set").count()
