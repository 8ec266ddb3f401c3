"""One Chromium for all tests, one server for those of the bench's page, one page for each file of them."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator
from typing import Any, TypeAlias

import pytest
from support.browser import NO_CHROMIUM, Page, chrome, chromium, server

Opened: TypeAlias = Callable[[int, int], Page]


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Chromium; without it all is skipped, or fails where CI is set."""
    if chromium() is None:
        (pytest.fail if os.environ.get("CI") else pytest.skip)(NO_CHROMIUM)
    with chrome() as started:
        yield started


@pytest.fixture(scope="session")
def bench_server(browser: Any) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The server."""
    with server() as served:
        yield served


@pytest.fixture(scope="module")
def opened(browser: Any, bench_server: tuple[subprocess.Popen[str], str]) -> Iterator[Opened]:
    """Opens the bench in a window of some width and height, px."""
    pages = []

    def open_page(width: int, height: int) -> Page:
        pages.append(browser.new_page(viewport={"width": width, "height": height}))
        return Page(pages[-1], *bench_server)

    yield open_page
    for page in pages:
        page.close()


@pytest.fixture(scope="module")
def bench(opened: Opened) -> Page:
    return opened(1280, 1000)
