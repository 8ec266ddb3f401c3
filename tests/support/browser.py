"""The bench in a real browser: Voila on this machine, Chromium driven by Playwright."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import psutil

from stereolib.base import ROOT
from stereolib.notebook.knobs import knobs

NO_CHROMIUM = "no Chromium: install it (Debian: apt-get install chromium), or name one in the variable CHROMIUM"
_PATIENCE_MS = 90_000  # a machine may be slow, and busy beside
_NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
_WATCH = """() => {
  window.painted = []; window.keyed = 0;
  addEventListener("keydown", () => { window.keyed = performance.now(); }, true);
  const grid = document.querySelector(".stereolib-scene .stereolib-pictures");
  new MutationObserver(() => window.painted.push(
    { at: performance.now(), quality: grid.dataset.quality, about: grid.dataset.about }
  )).observe(grid, { attributes: true, attributeFilter: ["data-painted"] });
}"""


def chromium() -> str | None:
    """Where Chromium is, if it is."""
    return os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, _NAMES)), None)


class Page:
    """The bench's page, opened and painted once.

    ``problems`` are what the console called an error, ``asked`` the addresses off this machine.
    """

    def __init__(self, page: Any, server: subprocess.Popen[str], address: str) -> None:
        self.page, self.problems, self.asked = page, [], []
        self._server = server
        page.set_default_timeout(_PATIENCE_MS)
        page.on("console", lambda m: self.problems.append(m.text) if m.type == "error" else None)
        page.on("pageerror", lambda error: self.problems.append(str(error)))
        page.on("request", lambda r: self._note(r.url))
        page.goto(address)
        self.wait_until_painted()

    def wait_until_painted(self) -> None:
        """Wait for the first full picture, and watch those that come."""
        self.page.wait_for_selector(".stereolib-scene .stereolib-pictures[data-quality=full]")
        self.page.evaluate(_WATCH)

    def _note(self, url: str) -> None:
        if not re.match(r"(https?|wss?)://(127\.0\.0\.1|localhost)[:/]|data:|blob:", url):
            self.asked.append(url)

    def open_group(self, name: str) -> None:
        """Unfold a group of knobs."""
        header = self.page.locator(
            ".jupyter-widget-Collapse-header", has_text=re.compile(rf"^\s*{re.escape(name)}\s*$")
        )
        if not self.page.locator(".jupyter-widget-Collapse-open", has=header).count():
            header.first.click()

    def row(self, label: str) -> Any:
        """A knob with its label, in sight."""
        self.open_group(next(knob.group for knob in knobs().values() if knob.label == label))
        return self.page.locator(".stereolib-knobs .widget-inline-hbox", has=self.page.get_by_text(label, exact=True))

    def slider(self, label: str) -> Any:
        """The handle of a knob, in sight and with the keyboard's focus."""
        handle = self.row(label).locator(".noUi-handle").first
        handle.focus()
        return handle

    def restore(self, text: str) -> None:
        """Write a state into its field, and wait for its pictures."""
        self.open_group("Keep")
        field = self.page.locator(".stereolib-words input")
        field.fill(text)
        field.press("Enter")
        self.wait_for(text)

    def wait_for(self, text: str) -> None:
        """Wait for the full pictures of a state, as `to_text` writes it."""
        grid = "document.querySelector('.stereolib-scene .stereolib-pictures').dataset"
        self.page.wait_for_function(f"text => {grid}.about === text && {grid}.quality === 'full'", arg=text)

    def words(self) -> str:
        """The state, as the page writes it."""
        self.open_group("Keep")
        return str(self.page.locator(".stereolib-words input").input_value())

    def pictures(self) -> list[str]:
        """The four pictures as they are painted."""
        canvases = "document.querySelectorAll('.stereolib-scene canvas')"
        return list(self.page.evaluate(f"[...{canvases}].map(canvas => canvas.toDataURL())"))

    def text(self, part: str) -> str:
        """What a part of the page says: results, said, found or upload."""
        return str(self.page.locator(f".stereolib-{part}").inner_text())

    def click(self, picture: int, column: float, row: float) -> None:
        """Click at a shown picture's column and row, px of its own."""
        canvas = self.page.locator(".stereolib-scene canvas").nth(picture)
        canvas.scroll_into_view_if_needed()
        box, width = canvas.bounding_box(), canvas.evaluate("canvas => canvas.width")
        scale = box["width"] / width
        canvas.click(position={"x": (column + 0.5) * scale, "y": (row + 0.5) * scale})

    def kernels(self) -> list[psutil.Process]:
        """The kernels behind all pages of this server."""
        family = psutil.Process(self._server.pid).children(recursive=True)
        return [process for process in family if "ipykernel" in _command(process)]

    def press(self, handle: Any, key: str) -> float:
        """Press a key on a handle; when the page felt it, ms."""
        handle.press(key)
        return float(self.page.evaluate("window.keyed"))

    def painted_after(self, at_ms: float, quality: str) -> float:
        """When the first picture of this quality was painted after a moment, ms."""
        found = f"(window.painted.find(p => p.at > {at_ms} && p.quality == '{quality}') || {{}}).at"
        return float(self.page.wait_for_function(found).json_value())

    def shown_after(self, at_ms: float, label: str) -> float:
        """When the value that a slider has now was first on the page, ms; at once if it was before `at_ms`."""
        name = next(name for name, knob in knobs().items() if knob.label == label)
        handle = self.slider(label)
        self.page.wait_for_function(f"window.painted.some(p => p.at > {at_ms} && p.quality == 'full')")
        value = float(handle.get_attribute("aria-valuenow"))
        painted = self.page.evaluate("window.painted")
        for one in painted:
            told = dict(part.split("=") for part in one["about"].split("; ") if part)
            if one["at"] > at_ms and abs(float(told.get(name, "nan")) - value) < 1e-6:
                return float(one["at"])
        return float(next(one["at"] for one in painted if one["at"] > at_ms))

    def kernel_memory_mb(self) -> float:
        """Memory of the kernel behind the page."""
        return sum(process.memory_info().rss for process in self.kernels()) / 2**20


def _command(process: psutil.Process) -> str:
    """The command line of a process, empty once it has ended."""
    try:
        return " ".join(process.cmdline())
    except psutil.NoSuchProcess:
        return ""


@contextmanager
def server(*words: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run ``stereolib explore`` until it says its address."""
    command = [sys.executable, "-m", "stereolib", "explore", "--no-browser", *words]
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH", ""))))
    child = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=os.environ | {"PYTHONPATH": path}
    )
    assert child.stdout is not None
    rest = threading.Thread(target=child.stdout.read, daemon=True)  # else a full pipe stops the server
    try:
        said = []
        for line in child.stdout:
            said.append(line)
            if found := re.search(r"http://127\.0\.0\.1:\d+/\?token=\w+", line):
                rest.start()
                yield child, found.group()
                break
        else:
            raise RuntimeError("the page was not served:\n" + "".join(said))
    finally:
        family = (
            [child.pid, *(p.pid for p in psutil.Process(child.pid).children(recursive=True))]
            if child.poll() is None
            else []
        )
        for pid in reversed(family):
            with suppress(psutil.Error):
                psutil.Process(pid).terminate()
        child.wait(20)
        if rest.ident is not None:
            rest.join(20)
        child.stdout.close()


@contextmanager
def chrome() -> Iterator[Any]:
    """Chromium, driven by Playwright."""
    from playwright.sync_api import sync_playwright

    if (program := chromium()) is None:
        raise RuntimeError(NO_CHROMIUM)
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield browser
        browser.close()


@contextmanager
def bench_page(*words: str, size: tuple[int, int] = (1280, 1000)) -> Iterator[Page]:
    """The bench in Chromium."""
    with server(*words) as (child, address), chrome() as browser:
        yield Page(browser.new_page(viewport={"width": size[0], "height": size[1]}), child, address)


def screenshot(page: Page, path: Path) -> None:
    """Keep what the page shows."""
    time.sleep(0.2)
    page.page.screenshot(path=str(path), full_page=True)
