"""The site of ``make site`` in Chromium, served from memory below a sub-path: every page, wide and narrow."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import pytest

from stereolib.base import ROOT

SITE = ROOT / "build" / "site"
HOME = "http://site.test/some/where/"  # pages of a repository are published below its name
NAMES = sorted(path.relative_to(SITE).as_posix() for path in SITE.rglob("*.html")) or ["index.html"]
OWN_LOOKS = ("figures/", "sliders/")  # pages of their own, dark on white


class Window:
    """A page that is given files of the site alone, and takes note of all else that it asks for or complains of."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.complaints = list[str]()
        page.on("console", lambda said: said.type in {"error", "warning"} and self.complaints.append(said.text))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.route("**/*", self._give)

    def _give(self, route: Any) -> None:
        address = route.request.url.partition("#")[0].partition("?")[0]
        file = SITE / address.removeprefix(HOME)
        if address.startswith(HOME) and file.is_file():
            route.fulfill(path=file)
        else:
            self.complaints.append(f"asked for {address}")
            route.abort()

    def open(self, name: str) -> None:
        self.complaints.clear()
        self.show(1280, "light")
        self.page.goto(HOME + name)

    def show(self, width: int, scheme: str) -> None:
        """Give the window a width, px, and its reader's taste."""
        self.page.set_viewport_size({"width": width, "height": 900})
        self.page.emulate_media(color_scheme=scheme)

    def wider_than_the_window(self) -> list[str]:
        """What makes the page scroll sideways, by its tag and class."""
        return list(
            self.page.evaluate("""() => {
                const root = document.documentElement, width = root.clientWidth;
                if (root.scrollWidth <= width) return [];
                return [...document.querySelectorAll("body *")].filter(e => e.getBoundingClientRect().right > width + 1)
                    .map(e => `${e.tagName}.${e.className}`.slice(0, 80)).slice(0, 8).concat([root.scrollWidth]);
            }""")
        )


@pytest.fixture(scope="module")
def window(browser: Any) -> Iterator[Window]:
    if not (SITE / "index.html").exists():
        (pytest.fail if os.environ.get("CI") else pytest.skip)("there is no site in build/site; run make site first")
    page = browser.new_page()
    yield Window(page)
    page.close()


@pytest.mark.parametrize("name", NAMES)
def test_page_asks_for_nothing_complains_of_nothing_and_fits(window: Window, name: str) -> None:
    window.open(name)
    assert not window.complaints and not window.wider_than_the_window()
    broken = "[...document.images].filter(e => e.complete && !e.naturalWidth).map(e => e.src)"
    assert not window.page.evaluate(broken)
    window.show(390, "dark")
    assert not window.complaints and not window.wider_than_the_window()
    styles = "(style => [style.color, style.backgroundColor])(getComputedStyle(document.body))"
    colours = window.page.evaluate(styles)
    text, ground = (sum(map(int, colour[4:-1].split(", ")[:3])) for colour in colours)
    assert abs(text - ground) > 3 * 128
    if not name.startswith(OWN_LOOKS):
        assert ground < 3 * 64 < text


def test_a_word_is_found(window: Window) -> None:
    window.open("index.html")
    window.page.get_by_placeholder("Search").fill("census")
    window.page.keyboard.press("Enter")
    window.page.locator('#search-results li a[href*="glossary.html"]').first.wait_for()
    assert not window.complaints


def test_a_picture_of_the_gallery_leads_to_the_cell_that_draws_it(window: Window) -> None:
    window.open("gallery.html")
    assert window.page.locator(".gallery figure").count() >= len(list((ROOT / "figures").glob("*.png")))
    link = window.page.locator('a[href$="#fig08"]')
    link.click()
    assert window.page.url == f"{HOME}notebooks/06_height.html#fig08"
    below = window.page.locator("#fig08").locator("xpath=following::img[1]")
    assert "fig08" not in below.get_attribute("src") and below.evaluate("image => image.alt.length > 20")
    seen = "document.querySelector('#fig08').getBoundingClientRect().top < innerHeight / 2"
    window.page.wait_for_function(seen)  # the page scrolls there


def test_sliders_of_a_chapter_move(window: Window) -> None:
    window.open("notebooks/03_sgbm_parameters.html")
    window.page.get_by_role("link", name="Sliders of this chapter").first.click()
    picture, said = window.page.locator("img"), window.page.locator(".said")
    before = picture.get_attribute("src"), said.inner_text()
    window.page.locator("input").first.press("End")
    assert (picture.get_attribute("src"), said.inner_text()) != before
    assert not window.complaints


def test_equations_are_laid_out_without_a_script(window: Window) -> None:
    window.open("notebooks/00_two_pictures.html")
    fraction = window.page.locator("math").first
    assert fraction.evaluate("e => e instanceof MathMLElement && e.getBoundingClientRect().width > 5")
