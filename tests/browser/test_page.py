"""The page as a whole: nothing from elsewhere, clicks that tell the truth, the keyboard, two widths, a dead kernel."""

from __future__ import annotations

import re

import numpy as np
import pytest
from support.browser import Page

from stereolib.notebook import chain, python_code
from stereolib.notebook.explorer_panels import scale_of
from stereolib.notebook.knobs import State, from_text, knobs
from stereolib.notebook.stories import STORIES

from .conftest import Opened

WIDTHS = ((1280, 1000), (390, 844))
CLIPPED = """[...document.querySelectorAll('.stereolib-bench *')].filter(
  e => e.clientWidth > 0 && e.scrollWidth > e.clientWidth + 1
    && !e.closest('textarea, input, .slider-container, .stereolib-pictures') // the last is swiped
).map(e => `${e.className}: ${e.textContent.slice(0, 40)}`)"""


def box_pixels(state: State) -> list[tuple[int, int]]:
    """Pixels well inside both faces of the box that the map knows, column and row."""
    known, map_px = chain.known(state), chain.filtered(state)
    assert known is not None
    rows, columns = np.nonzero(known.region & np.isfinite(map_px))
    inside = (columns > 190) & (columns < 460) & (rows > 190) & (rows < 400)
    picked = np.flatnonzero(inside)[:: inside.sum() // 7]
    return [(int(columns[k]), int(rows[k])) for k in picked]


def clicked(bench: Page, picture: int, column: float, row: float) -> str:
    """What the page says of a place once it knows it: the sentence has changed, and is the last one asked for."""
    before = bench.text("found")
    bench.click(picture, column, row)
    bench.page.wait_for_function(
        "before => ![before, ''].includes(document.querySelector('.stereolib-found').innerText)", arg=before
    )
    return bench.text("found")


def test_it_opens_without_an_error_and_asks_nobody_else(bench: Page) -> None:
    assert bench.problems == [] and bench.asked == []
    assert len(bench.pictures()) == 4 and "30.0 x 30.0 x 30.0 cm" in bench.text("results")
    assert bench.words() == ""


def test_clicks_tell_depths_whose_intervals_hold_the_truth(bench: Page) -> None:
    bench.restore("")
    state = State()
    known, rectified = chain.known(state), chain.rectified_rig(state)
    assert known is not None and rectified is not None
    pixels = box_pixels(state)
    for wanted in pixels:
        found = clicked(bench, 0, *(round(at * scale_of(state)) for at in wanted))
        told = re.match(r"column (\d+), row (\d+): .*depth (\d+) ± (\d+) mm", found)
        assert told is not None, found
        column, row, depth_mm, interval_mm = map(int, told.groups())
        assert max(abs(column - wanted[0]), abs(row - wanted[1])) <= 2  # a screen's pixel is more than one of these
        true_mm = rectified.f_px * rectified.baseline_mm / known.disparity_px[row, column]
        assert abs(depth_mm - true_mm) <= interval_mm + 1, (column, row)  # both are told in whole mm
    assert len(pixels) >= 7
    assert re.search(r"[\d.]+ ± [\d.]+ mm between the last two clicks", bench.text("found"))
    bench.page.locator(".stereolib-costs canvas").nth(1).wait_for()


def test_costs_of_a_click_are_in_sight_below_the_pictures_that_were_clicked(bench: Page) -> None:
    bench.restore("")
    bench.page.evaluate("scrollTo(0, 0)")
    clicked(bench, 1, 300, 250)
    curve, pictures = bench.page.locator(".stereolib-costs canvas").first, bench.page.locator(".stereolib-scene canvas")
    curve.wait_for()
    box = curve.bounding_box()
    assert box is not None and box["y"] + 0.8 * box["height"] < 1000
    boxes = [pictures.nth(k).bounding_box() for k in range(4)]
    assert boxes[0]["y"] < box["y"] < boxes[2]["y"]
    assert max(abs(one["height"] - boxes[0]["height"]) for one in boxes) <= 1  # all of one size


def test_a_click_beside_the_map_or_reset_leaves_nothing_of_the_last_one(bench: Page) -> None:
    bench.restore("")
    clicked(bench, 1, 300, 250)
    clicked(bench, 1, 620, 250)  # in the colours' numbers
    assert (
        "Nothing can be looked up there" in bench.text("found") and "disparity" not in bench.text("found").split(":")[0]
    )
    clicked(bench, 0, 10, 200)  # a column without partners
    bench.page.locator(".stereolib-found", has_text="No cost curve").wait_for()
    canvas = bench.page.locator(".stereolib-scene canvas").first
    for _ in range(3):
        canvas.press("ArrowRight")
        bench.page.wait_for_timeout(300)
    bench.page.locator(".stereolib-found", has_text="No cost curve").wait_for()
    assert bench.text("found").count("No cost curve") == 1
    bench.page.get_by_role("button", name="Reset", exact=True).click()
    bench.page.locator(".stereolib-found", has_text="Click into a picture").wait_for()
    assert (
        "No cost curve" not in bench.text("found") and not bench.page.locator(".stereolib-costs canvas:visible").count()
    )


def test_both_of_two_clicks_are_marked(bench: Page) -> None:
    bench.restore("")
    left = "document.querySelector('.stereolib-scene canvas').getContext('2d')"
    near = f"[...{left}.getImageData(188, 188, 24, 24).data]"
    plain = bench.page.evaluate(near)
    clicked(bench, 0, 200, 200)
    clicked(bench, 0, 400, 200)
    marked = bench.page.evaluate(near)
    assert np.abs(np.array(marked, float) - plain).max() > 100  # a ring around the first


def test_every_knob_has_its_help_on_hover(bench: Page) -> None:
    titles = bench.page.evaluate("[...document.querySelectorAll('.stereolib-knobs [title]')].map(e => e.title)")
    assert {knob.help for knob in knobs().values()} <= set(titles)


def test_turning_a_knob_looks_the_same_pixel_up_again(bench: Page) -> None:
    bench.restore("")
    before = clicked(bench, 1, 300, 250)
    bench.restore("baseline_mm=120")
    bench.page.wait_for_function(
        "before => document.querySelector('.stereolib-found').innerText !== before", arg=before
    )
    first, second = (float(re.findall(r"disparity ([\d.]+)", text)[0]) for text in (before, bench.text("found")))
    assert second / first == pytest.approx(120 / 93.1, rel=0.01)  # the left camera stays where it was
    bench.restore("source=conditions/texture")
    bench.page.locator(".stereolib-found", has_text="Click into a picture").wait_for()


def test_the_keyboard_alone_is_enough(bench: Page) -> None:
    bench.restore("")
    bench.open_group("Box")
    page = bench.page
    page.locator("body").click(position={"x": 2, "y": 2})

    def tab_to(what: str) -> None:
        for _ in range(60):
            page.keyboard.press("Tab")
            if page.evaluate(f"document.activeElement.matches('{what}')"):
                return
        raise AssertionError(f"Tab does not reach {what}")

    tab_to(".noUi-handle")
    moment = page.evaluate("performance.now()")
    page.keyboard.press("ArrowRight")
    bench.painted_after(moment, "full")
    assert bench.page.locator(".stereolib-words input").input_value() == "distance_mm=710"
    tab_to(".stereolib-scene canvas")
    page.keyboard.press("ArrowDown")
    page.locator(".stereolib-found", has_text="column 320, row 242").wait_for()
    page.keyboard.press("Enter")
    page.keyboard.press("Shift+ArrowRight")
    page.locator(
        ".stereolib-found", has_text=re.compile("^column 343, row 242.* between the last two clicks")
    ).wait_for()


def test_last_of_many_keys_is_what_is_shown(bench: Page) -> None:
    bench.restore("")
    handle = bench.slider("recipe: threshold (px)")
    for _ in range(60):
        handle.press("ArrowRight")
    bench.wait_for("tolerance_px=40")
    assert from_text(bench.words()).tolerance_px == 40


@pytest.mark.parametrize(("width", "height"), WIDTHS)
def test_nothing_is_clipped_or_wider_than_the_window(opened: Opened, width: int, height: int) -> None:
    bench = opened(width, height)
    bench.page.locator(".stereolib-legend details").evaluate("details => { details.open = true; }")
    for group in ("Matcher", "Cameras", "Own pair", "Keep"):
        bench.open_group(group)
        bench.page.wait_for_timeout(300)
        assert bench.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert bench.page.evaluate(CLIPPED) == []
    for story in STORIES:
        box = bench.page.get_by_role("button", name=story.name, exact=True).bounding_box()
        assert box is not None and box["x"] >= 0 and box["x"] + box["width"] <= width
    button = bench.page.get_by_role("button", name="prepare files")
    button.scroll_into_view_if_needed()
    if width < 800:  # the pictures stay where the knobs can be turned, the left one nearly as wide as the page
        canvas = bench.page.locator(".stereolib-scene canvas").first.bounding_box()
        assert canvas is not None and 0 <= canvas["y"] < height / 3 and canvas["width"] > 0.8 * width
        assert canvas["y"] + canvas["height"] < 0.4 * height


def test_code_is_whole_and_copied(bench: Page) -> None:
    bench.restore("source=conditions/texture; filter=median")
    bench.page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    code = python_code.of(from_text("source=conditions/texture; filter=median"))
    bench.page.locator(".stereolib-code pre", has_text="median").wait_for()
    bench.page.locator(".stereolib-code button").click()
    bench.page.get_by_text("copied", exact=True).wait_for()
    assert bench.page.evaluate("navigator.clipboard.readText()") == code


def test_files_to_take_away(bench: Page) -> None:
    bench.restore("")
    bench.open_group("Keep")
    bench.page.get_by_role("button", name="prepare files").click()
    links = bench.page.locator("a[download]")
    links.first.wait_for()
    assert links.evaluate_all("links => links.map(link => link.download)") == [
        "left.png", "disparity.png", "disparity.npy", "points.ply",
    ]  # fmt: skip


def test_a_dead_kernel_is_told_and_a_reload_begins_again(opened: Opened, bench: Page) -> None:
    others = {process.pid for process in bench.kernels()}
    page = opened(1280, 1000)
    (kernel,) = (process for process in page.kernels() if process.pid not in others)
    kernel.kill()
    page.page.locator(".stereolib-bench.jupyter-widgets-disconnected").wait_for()
    said = "getComputedStyle(document.querySelector('.stereolib-bench'), '::before').content"
    assert "Reload the page" in page.page.evaluate(said)
    page.page.reload()
    page.wait_until_painted()
    assert len(page.pictures()) == 4
