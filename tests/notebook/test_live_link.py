"""From a command to its page and back: what is shown arrives, what is pressed comes home, strangers stay out."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from multiprocessing import AuthenticationError
from multiprocessing.connection import Client

import numpy as np
import pytest

from stereolib.notebook.live_link import LINK, LiveLink, LiveView, follow, read_link

BUTTONS = {"take": "takes", "end": "ends"}


@pytest.fixture
def link() -> Iterator[LiveLink]:
    made = LiveLink("live", BUTTONS)
    yield made
    made.close()


def test_views_arrive_whole_and_buttons_come_back(link: LiveLink) -> None:
    pictures = np.random.default_rng(0).integers(0, 255, (2, 4, 6, 3)).astype(np.uint8)
    link.show(LiveView(tuple(pictures), ("a", "b"), "<p>±</p>"))
    pressed = ["take", "no such button"]
    views = follow(json.loads(link.environment[LINK]), pressed)
    first = next(views)
    assert (first.captions, first.html, first.is_last) == (("a", "b"), "<p>±</p>", False)
    np.testing.assert_array_equal(first.images, pictures)
    assert link.pressed() == ["take"] and link.pressed() == [] and pressed == []
    link.show(LiveView((pictures[1, :, ::2],)))  # a part of a picture, not one piece of memory
    np.testing.assert_array_equal(next(views).images[0], pictures[1, :, ::2])


def test_a_slow_page_sees_the_newest_and_nothing_queues(link: LiveLink) -> None:
    views = follow(json.loads(link.environment[LINK]), [])
    link.show(LiveView(html="0"))
    assert next(views).html == "0"
    for k in range(1, 50):
        link.show(LiveView(html=f"{k}"))
    assert next(views).html == "49"


def test_who_says_nothing_keeps_no_page_waiting(link: LiveLink) -> None:
    """And `close` does not wait for him to fetch the last view."""
    told = json.loads(link.environment[LINK])
    with socket.create_connection(("127.0.0.1", told["port"])):
        link.show(LiveView(html="here"))
        seen: list[LiveView] = []
        page = threading.Thread(target=lambda: seen.extend(follow(told, [])), daemon=True)
        page.start()
        until_s = time.monotonic() + 10
        while not seen and time.monotonic() < until_s:
            page.join(0.01)
        assert [view.html for view in seen] == ["here"]
        begun_s = time.monotonic()
        link.close()
        page.join(10)
        assert seen[-1].is_last and time.monotonic() - begun_s < 2.5


def test_the_last_view_is_fetched_before_the_end() -> None:
    link, seen = LiveLink("live", BUTTONS), []
    told = json.loads(link.environment[LINK])
    link.show(LiveView(html="verdict"))
    page = threading.Thread(target=lambda: seen.extend(follow(told, [])))
    page.start()
    while not seen:
        page.join(0.01)
    link.close()
    page.join(10)
    assert not page.is_alive()
    assert (seen[-1].html, seen[-1].is_last) == ("verdict", True)
    with suppress(OSError):  # refused, or let in once and told nothing
        assert not list(follow(told, []))


def test_the_last_view_is_fetched_by_every_page_before_the_end() -> None:
    """The kernel of a page that was closed in the browser follows on, and is quicker than the one that is looked at."""
    link, seen = LiveLink("live", BUTTONS), dict[float, list[LiveView]]()
    told = json.loads(link.environment[LINK])
    link.show(LiveView(html="verdict"))

    def look(slow_s: float) -> None:
        for view in follow(told, []):
            time.sleep(slow_s)  # it paints
            seen.setdefault(slow_s, []).append(view)

    pages = [threading.Thread(target=look, args=(slow_s,)) for slow_s in (0.0, 0.6)]
    for page in pages:
        page.start()
    while len(seen) < len(pages):
        time.sleep(0.01)
    link.close()
    assert all(views[-1].is_last for views in seen.values())
    for page in pages:
        page.join(10)
        assert not page.is_alive()


def test_who_has_not_the_key_is_turned_away(link: LiveLink) -> None:
    told = json.loads(link.environment[LINK])
    link.show(LiveView(html="secret"))
    with pytest.raises((AuthenticationError, EOFError, OSError)):
        next(follow(told | {"key": "00"}, []))
    assert next(follow(told, [])).html == "secret", "and those who have it are still let in"


@pytest.mark.parametrize("words", [b"no json", b"[]", b'{"pressed": 3}', b"{}"])
def test_what_is_no_question_ends_that_page_alone(link: LiveLink, words: bytes) -> None:
    told = json.loads(link.environment[LINK])
    link.show(LiveView(html="here"))
    with Client(("127.0.0.1", told["port"]), authkey=bytes.fromhex(told["key"])) as stranger:
        stranger.send_bytes(words)
        with pytest.raises(EOFError):
            stranger.recv_bytes()
    assert next(follow(told, [])).html == "here"


def test_a_page_that_no_command_started_finds_no_link(monkeypatch: pytest.MonkeyPatch, link: LiveLink) -> None:
    monkeypatch.delenv(LINK, raising=False)
    assert read_link() is None
    monkeypatch.setenv(LINK, link.environment[LINK])
    found = read_link()
    assert found is not None and (found["title"], found["buttons"]) == ("live", BUTTONS)
