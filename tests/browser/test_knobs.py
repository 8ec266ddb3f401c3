"""Every knob of the page, moved as a visitor moves it, changes what is seen."""

from __future__ import annotations

import pytest
from support.browser import Page

from stereolib.notebook import offered
from stereolib.notebook.knobs import MOTORCYCLE, State, from_text, knobs

#: States in which a knob has something to change, where the first one has not.
WHERE = {
    "disp12_max_diff": "uniqueness_ratio=0; speckle_window_size=0",
    "speckle_window_size": "contrast=0.1; uniqueness_ratio=0; speckle_window_size=0",
    "speckle_range": "contrast=0.1; uniqueness_ratio=0",
    "kernel_px": "filter=dilation",
    "kernel_shape": "filter=dilation",
    "tolerance_px": "tolerance_px=5",
}
#: What is chosen from a menu, where its last entry is slow.
CHOSEN = {"matcher": "fast", "filter": "median", "light": 0.1}


@pytest.mark.parametrize("name", knobs())
def test_knob_changes_a_picture(bench: Page, name: str) -> None:
    knob, before = knobs()[name], WHERE.get(name, "")
    bench.restore(before)
    shown, first = bench.pictures(), getattr(from_text(before), name)
    row = bench.row(knob.label)
    moment = bench.page.evaluate("performance.now()")
    if isinstance(first, bool):
        row.locator("input").click()
    elif knob.choices:
        row.locator("select").select_option(knob.shown(CHOSEN.get(name, knob.choices[-1])))
    else:
        bench.slider(knob.label).press("PageUp" if first < knob.high else "PageDown")
    bench.painted_after(moment, "full")
    assert bench.words() != before
    assert getattr(from_text(bench.words()), name) != first
    assert bench.pictures() != shown
    assert not bench.problems


@pytest.mark.parametrize("text", ["source=conditions/texture", f"source={MOTORCYCLE}", "source=room/1; matcher=fast"])
def test_knobs_without_effect_cannot_be_turned(bench: Page, text: str) -> None:
    bench.restore(text)
    without_effect = offered.idle(from_text(text))
    assert "distance_mm" in without_effect and "kernel_px" in without_effect
    for name, knob in knobs().items():
        field = bench.row(knob.label).locator("select, input, .noUi-target").first
        disabled = field.evaluate("field => field.disabled || field.hasAttribute('disabled')")
        assert disabled == (name in without_effect), name
    bench.open_group("Box")
    assert not bench.row(knobs()["distance_mm"].label).is_visible()  # its value would be none of the recording's
    assert bench.page.get_by_text("Nothing here can be turned in what was recorded").first.is_visible()


def test_reset_sets_all_knobs_back(bench: Page) -> None:
    bench.restore("distance_mm=800; filter=median; laser=False")
    bench.page.get_by_role("button", name="Reset", exact=True).click()
    bench.wait_for("")
    assert bench.row(knobs()["laser"].label).locator("input").is_checked()
    bench.open_group("Box")
    assert bench.row(knobs()["distance_mm"].label).is_visible()


def test_p2_offers_nothing_below_p1_and_nothing_beyond_16_bits(bench: Page) -> None:
    bench.restore("block_size=15; p1=40; p2=41")
    handle = bench.slider(knobs()["p2"].label)
    low, high = (float(handle.get_attribute(name)) for name in ("aria-valuemin", "aria-valuemax"))
    assert low == 41 and from_text(bench.words()).p1 == 40
    for p2 in (low, high):
        cost = State(block_size=15, p1=40, p2=int(p2)).sgbm
        assert cost.p1 < cost.p2 == p2 * 15**2


def test_state_is_refused_with_its_reason(bench: Page) -> None:
    bench.restore("distance_mm=800")
    field = bench.page.locator(".stereolib-words input")
    for text, reason in (("distance=800", 'there is no knob "distance"'), ("source=mars", 'nothing called "mars"')):
        field.fill(text)
        field.press("Enter")
        bench.page.locator(".stereolib-said", has_text=reason).wait_for()
    bench.restore("distance_mm=850")
    assert bench.text("said") == ""
