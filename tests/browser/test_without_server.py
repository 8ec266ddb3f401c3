"""What moves without Python, in a real browser: the baked pages, and the widget's picture with its values given."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

from stereolib import notebook
from stereolib.notebook.baked import PAGES, bake

FOLDER = Path(notebook.__file__).parent
PAGE_OF_A_MODEL = """async ([source, style]) => {
  document.head.append(Object.assign(document.createElement("style"), { textContent: style }));
  document.body.className = "stereolib-explorer";
  const canvas = Object.assign(document.createElement("canvas"), { width: 30, height: 20 });
  const jpeg = await new Promise((done) => canvas.toBlob(done, "image/jpeg"));
  const frame = new Uint8Array(await jpeg.arrayBuffer()), told = {};
  const values = { frames: [frame], captions: ["size 5"], quality: "full", alt: "", about: "", number: 1, painted: 0,
                   cross: [] };
  window.change = (news) => { Object.assign(values, news); Object.keys(news).forEach((key) => told[key]?.()); };
  const model = {
    get: (name) => values[name], set: (name, value) => { values[name] = value; },
    save_changes() {}, send() {}, off() {},
    on: (name, call) => { told[name.replace("change:", "")] = call; },
  };
  const url = URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
  (await import(url)).default.render({ model, el: document.body });
}"""


def test_moving_a_slider_changes_the_picture(browser: Any, tmp_path: Path) -> None:
    page, (file, _) = PAGES[0], bake(tmp_path, PAGES[:1])
    data = json.loads(re.search(r"^const baked = (.*);$", file.read_text(encoding="utf-8"), re.MULTILINE)[1])
    shown = browser.new_page(viewport={"width": 390, "height": 844})
    problems: list[str] = []
    shown.on("console", lambda message: problems.append(message.text))
    shown.on("pageerror", lambda error: problems.append(str(error)))
    shown.goto(file.as_uri())
    image, slider = shown.locator("img"), shown.locator("input").first
    before = image.get_attribute("src")
    slider.press("ArrowRight")
    at = page.first + len(page.knobs["distance_mm"][1])
    assert image.get_attribute("src") == data["pictures"][at] != before
    assert image.get_attribute("alt") == shown.locator(".said").inner_text() == data["texts"][at]
    assert slider.get_attribute("aria-valuetext") == shown.locator("output").first.inner_text() == "150"
    assert shown.evaluate("document.querySelector('img').decode()") is None
    assert shown.evaluate("document.documentElement.scrollWidth") <= 390
    assert not problems
    still = browser.new_context(java_script_enabled=False).new_page()
    still.goto(file.as_uri())
    assert still.locator("img").get_attribute("src") == before and not still.locator("input").first.is_visible()


def test_no_page_is_pushed_sideways_on_a_telephone(browser: Any, tmp_path: Path) -> None:
    still = [
        replace(page, knobs={name: (first, (first,)) for name, (first, _) in page.knobs.items()}) for page in PAGES
    ]
    shown = browser.new_page(viewport={"width": 390, "height": 844})
    for file in bake(tmp_path, still):
        shown.goto(file.as_uri())
        assert shown.evaluate("document.documentElement.scrollWidth <= innerWidth"), file.name
        wide = "e => e.clientWidth && e.scrollWidth > e.clientWidth + 1 && !e.matches('input')"
        assert not shown.evaluate(f"[...document.querySelectorAll('*')].some({wide})"), file.name


def test_a_picture_that_is_not_of_the_values_shown_is_dimmed(browser: Any) -> None:
    page = browser.new_page()
    page.evaluate(PAGE_OF_A_MODEL, [(FOLDER / f"live_picture.{kind}").read_text() for kind in ("js", "css")])
    opacity = "Number(getComputedStyle(document.querySelector('canvas')).opacity)"
    page.wait_for_function(f"document.querySelector('canvas') && {opacity} === 1")
    page.evaluate("change({ quality: 'waiting' })")
    page.wait_for_function(f"{opacity} === 0.5")
    page.evaluate("change({ quality: 'preview', captions: ['size 7'], number: 2 })")
    page.wait_for_function(f"{opacity} === 1 && document.querySelector('figcaption').textContent === 'size 7'")
    page.evaluate("change({ quality: 'refused', captions: ['not possible'], number: 3 })")
    page.wait_for_function(f"{opacity} === 0.3")
    assert page.locator("figcaption").inner_text() == "not possible"
    assert page.locator("canvas").get_attribute("aria-label") == "not possible"
