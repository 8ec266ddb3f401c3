"""The live pages in a real browser: served by their commands, painted, pressed, ended."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from support.shows import BOARD, small_show

from stereolib.base import ROOT
from stereolib.virtual import emulator, recordings
from stereolib.virtual.camera_emulator import serve_cameras


@contextmanager
def command(*words: object) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run a command until it says its page's address."""
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH", ""))))
    child = subprocess.Popen(
        [sys.executable, "-m", "stereolib", *map(str, words), "--no-browser"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ | {"PYTHONPATH": path},
    )  # fmt: skip
    assert child.stderr is not None and child.stdout is not None
    said, rest = [], threading.Thread(target=child.stderr.read, daemon=True)  # else a full pipe stops it
    try:
        for line in child.stderr:
            said.append(line)
            if found := re.search(r"preview: (http://127\.0\.0\.1:\d+/\?token=\w+)", line):
                rest.start()
                yield child, found[1]
                break
        else:
            raise RuntimeError("no page:\n" + "".join(said))
    finally:
        if child.poll() is None:
            child.terminate()
        child.wait(90)
        if rest.ident is not None:
            rest.join(30)
        child.stderr.close()
        child.stdout.close()


@contextmanager
def opened(browser: Any, address: str) -> Iterator[tuple[Any, list[str]]]:
    """A page, and whatever it complained of or asked of other machines."""
    page, problems = browser.new_page(viewport={"width": 1280, "height": 900}), []
    page.on("console", lambda m: problems.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda error: problems.append(str(error)))
    own = r"(https?|wss?)://(127\.0\.0\.1|localhost)[:/]|data:|blob:"
    page.on("request", lambda r: None if re.match(own, r.url) else problems.append(r.url))
    page.goto(address)
    page.wait_for_selector(".stereolib-live .stereolib-pictures[data-painted]", timeout=90_000)
    yield page, problems
    page.close()


def besides_the_end(problems: list[str]) -> list[str]:
    """Problems but those of a page whose command has ended and taken the server with it."""
    return [text for text in problems if "ERR_CONNECTION_REFUSED" not in text]


def painted(page: Any) -> int:
    return int(page.locator(".stereolib-live .stereolib-pictures").get_attribute("data-painted"))


def test_a_capture_is_watched_ended_by_its_button_and_its_verdict_read(browser: Any, tmp_path: Path) -> None:
    words = (*BOARD, "--pairs", 7, "--patience-s", 600, "--max-skew-ms", 150, "--output", tmp_path / "rig")
    with serve_cameras(small_show()) as cameras, command("capture", *cameras, *words) as (child, address):
        with opened(browser, address) as (page, problems):
            page.wait_for_function(
                "/[7-9] of 7 pairs/.test(document.querySelector('.stereolib-said').innerText)", timeout=60_000
            )
            assert page.locator(".stereolib-live canvas").count() == 3
            assert page.title() == "stereolib: what cameras or laser see now" and "<title>spin" not in page.content()
            before = painted(page)
            page.wait_for_function(
                f"document.querySelector('.stereolib-live .stereolib-pictures').dataset.painted > {before + 3}"
            )
            width = page.locator(".stereolib-live canvas").first.evaluate("c => c.width")
            assert width == 560
            page.get_by_role("button", name="enough").click()
            page.wait_for_selector(".stereolib-ended", timeout=90_000)
            text = page.locator(".stereolib-said").inner_text()
            assert re.search(r"^good ", text, re.MULTILINE) and "calibration.json" in text
            assert not besides_the_end(problems)
        assert child.wait(90) == 0
        assert child.stdout is not None and text.strip() in child.stdout.read()


def test_a_page_that_is_loaded_again_goes_on_with_the_same_capture(browser: Any, tmp_path: Path) -> None:
    with (
        serve_cameras(small_show()) as cameras,
        command("capture", *cameras, "--pairs", 2, "--output", tmp_path) as (
            child,
            address,
        ),
    ):
        with opened(browser, address) as (page, _):
            assert "0 of 2 pairs taken" in page.locator(".stereolib-said").inner_text()
            page.get_by_role("button", name="take this pair").click()
            page.wait_for_function("document.querySelector('.stereolib-said').innerText.includes('1 of 2 pairs')")
        with opened(browser, address) as (page, _):
            assert "1 of 2 pairs taken" in page.locator(".stereolib-said").inner_text()
            page.get_by_role("button", name="take this pair").click()
            page.wait_for_selector(".stereolib-ended", timeout=90_000)
        assert child.wait(90) == 0
    assert sorted(path.name for path in (tmp_path / "left").iterdir()) == ["01.png", "02.png"]


def test_the_laser_turns_in_the_browser_until_its_button_is_pressed(browser: Any, tmp_path: Path) -> None:
    scene = recordings.pairs()["conditions/plain"][1]
    schedule = emulator.with_faults(
        emulator.emulate(scene, rng=np.random.default_rng(0)),
        emulator.Faults(lost_byte_rate=0.001), np.random.default_rng(1),
    )  # fmt: skip
    with emulator.serve(schedule, "socket") as served, command("lrf", "live", served.port) as (child, address):
        with opened(browser, address) as (page, problems):
            before = painted(page)
            page.wait_for_function(
                f"document.querySelector('.stereolib-live .stereolib-pictures').dataset.painted > {before + 5}"
            )
            said = page.locator(".stereolib-said").inner_text()
            assert re.search(r"(29|30)\d rpm, [\d.]+ turns a second, [1-9]\d* packets lost", said)
            page.screenshot(path=str(tmp_path / "laser.png"))
            page.get_by_role("button", name="end").click()
            page.wait_for_selector(".stereolib-ended", timeout=90_000)
            assert not besides_the_end(problems)
        assert child.wait(90) == 0
