"""Each story's button lands on what its sentences say."""

from __future__ import annotations

import re

import pytest
from support.browser import Page

from stereolib.notebook.knobs import to_text
from stereolib.notebook.stories import STORIES, Story


@pytest.mark.parametrize("story", STORIES, ids=lambda story: story.name)
def test_story_says_what_the_result_line_shows(bench: Page, story: Story) -> None:
    bench.page.get_by_role("button", name=story.name, exact=True).click()
    bench.wait_for(to_text(story.state))
    bench.page.wait_for_function("!document.querySelector('.stereolib-results').innerText.includes('…')")
    said, results = bench.text("said"), bench.text("results")
    assert bench.words() == to_text(story.state)
    for reading in re.findall(r"reads ([\d.]+) cm(?! for|;|\.$| more)", said.partition("A pixel less")[0]):
        assert re.search(rf"\b{re.escape(reading)}\d? (cm|±)", results), (said, results)
    share = re.search(r"(\d+) % of (?:the box's|its) pixels are wrong", said)
    if share:
        (bad,) = re.findall(r"bad 2: ([\d.]+) %", results)
        assert abs(float(bad) - float(share[1])) <= 0.55
    matched = re.search(r"disparity for (\d+) % of its pixels", said)
    if matched:
        assert abs(float(re.findall(r"matched: ([\d.]+) %", results)[0]) - float(matched[1])) <= 0.55
    for told in re.findall(r"turned by [\d.]+ ± [\d.]+ degrees", said):
        assert told in results
    assert re.search(r"\d", said) and "nan" not in said and "nothing was found" not in said


def test_turning_a_knob_ends_the_story(bench: Page) -> None:
    story = STORIES[0]
    bench.page.get_by_role("button", name=story.name, exact=True).click()
    bench.wait_for(to_text(story.state))
    assert bench.text("said")
    bench.slider("uniqueness (%)").press("ArrowRight")
    bench.page.wait_for_function("!document.querySelector('.stereolib-said').innerText")
