"""From a command that holds cameras or a port to the page that shows it: pictures one way, pressed buttons the other.

The command listens on this machine alone and lets in who knows the key; the page asks for the next pictures when it
has painted the last ones, so that nothing queues. Messages are JSON and raw pixels, nothing that is executed.
"""

from __future__ import annotations

import json
import os
import secrets
import threading
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing import AuthenticationError
from multiprocessing.connection import Client, Connection, Listener, answer_challenge, deliver_challenge
from typing import Any

import numpy as np

from stereolib.base import UInt8

#: The environment variable in which the page finds where to ask.
LINK = "STEREOLIB_LIVE_LINK"
_HOST = "127.0.0.1"
_POLL_S = 0.5  # a page is answered after so long, though nothing is new
_MOST_BYTES = 2**27  # of a message
_LEFT_S = 3.0  # for pages to fetch what was shown last


@dataclass(frozen=True, eq=False)
class LiveView:
    """What a page shows.

    Attributes
    ----------
    images : tuple of (H, W, 3) uint8, blue-green-red
    captions : tuple of str
    html : str
        What stands above them.
    is_last : bool
        Nothing comes after it.
    """

    images: tuple[UInt8, ...] = ()
    captions: tuple[str, ...] = ()
    html: str = ""
    is_last: bool = False


class LiveLink:
    """The command's end.

    Parameters
    ----------
    title : str
        Of the page.
    buttons : dict
        What a button is called -> what it does.
    """

    def __init__(self, title: str, buttons: dict[str, str]) -> None:
        self._key = secrets.token_bytes(24)
        self._listener = Listener((_HOST, 0))
        self._about = {"title": title, "buttons": buttons}
        self._changed, self._number, self._is_closed = threading.Condition(), 0, False
        self._view, self._pressed, self._fetched = LiveView(), list[str](), dict[Any, int]()  # by page
        threading.Thread(target=self._accept, daemon=True, name="live link").start()

    @property
    def environment(self) -> dict[str, str]:
        """What the page's process finds in its environment."""
        port = self._listener.address[1]
        return {LINK: json.dumps({"port": port, "key": self._key.hex(), **self._about})}

    def show(self, view: LiveView) -> None:
        """Replace what all pages show.

        Parameters
        ----------
        view : LiveView
        """
        with self._changed:
            self._view, self._number = view, self._number + 1
            self._changed.notify_all()

    def pressed(self) -> list[str]:
        """Tell which buttons were pressed since the last call.

        Returns
        -------
        list of str
        """
        with self._changed:
            names, self._pressed = self._pressed, []
            return names

    def close(self) -> None:
        """Show the last view as the last, let pages paint it, then take no more."""
        self.show(replace(self._view, is_last=True))
        with self._changed:
            self._changed.wait_for(lambda: min(self._fetched.values(), default=self._number) >= self._number, _LEFT_S)
            self._is_closed = True
            self._changed.notify_all()
        with suppress(OSError):
            self._listener.close()

    def _accept(self) -> None:
        while not self._is_closed:
            try:
                page = self._listener.accept()
            except OSError:  # `close`
                continue
            threading.Thread(target=self._serve, args=(page,), daemon=True, name="live page").start()

    def _serve(self, page: Connection[Any, Any]) -> None:
        sent = 0
        try:
            deliver_challenge(page, self._key)  # not in `_accept`: a stranger who says nothing keeps nobody waiting
            answer_challenge(page, self._key)
            with self._changed:
                self._fetched[page] = sent
            while not self._is_closed:
                asked = json.loads(page.recv_bytes(_MOST_BYTES))
                with self._changed:
                    self._fetched[page] = sent
                    self._pressed += [name for name in asked["pressed"] if name in self._about["buttons"]]
                    self._changed.notify_all()
                    self._changed.wait_for(lambda: self._number > sent or self._is_closed, _POLL_S)  # noqa: B023
                    view, is_new, sent = self._view, self._number > sent, self._number
                _send(page, view, is_new)
        except (AuthenticationError, EOFError, OSError, ValueError, KeyError, TypeError):  # closed, or none of ours
            pass
        finally:
            page.close()
            with self._changed:
                self._fetched.pop(page, None)
                self._changed.notify_all()


def follow(link: dict[str, Any], pressed: list[str]) -> Iterator[LiveView]:
    """The page's end: give what the command shows, one view after the other, until it ends.

    Parameters
    ----------
    link : dict
        As `read_link` gives it.
    pressed : list of str
        Buttons; they are sent and taken out.

    Yields
    ------
    LiveView

    Raises
    ------
    OSError
        If nothing listens there (any more).
    """
    with Client((_HOST, link["port"]), authkey=bytes.fromhex(link["key"])) as command:
        while True:
            names = pressed[:]
            del pressed[: len(names)]  # not one that came meanwhile
            try:
                command.send_bytes(json.dumps({"pressed": names}).encode())
                head = json.loads(command.recv_bytes(_MOST_BYTES))
                images = tuple(
                    np.frombuffer(command.recv_bytes(_MOST_BYTES), np.uint8).reshape(shape) for shape in head["shapes"]
                )
            except (EOFError, ConnectionError):  # closed, perhaps while this was asked
                return
            if head["is_new"]:
                yield LiveView(images, tuple(head["captions"]), head["html"], head["is_last"])


def read_link() -> dict[str, Any] | None:
    """Find what `LiveLink.environment` told this process.

    Returns
    -------
    dict or None
        ``port``, ``key``, ``title`` and ``buttons``; None where no command started this page.
    """
    return json.loads(os.environ[LINK]) if LINK in os.environ else None


def _send(page: Connection[Any, Any], view: LiveView, is_new: bool) -> None:
    images: Sequence[UInt8] = [np.ascontiguousarray(image) for image in view.images] if is_new else []
    head = {"is_new": is_new, "shapes": [image.shape for image in images]}
    head |= {"captions": view.captions, "html": view.html, "is_last": view.is_last}
    page.send_bytes(json.dumps(head).encode())
    for image in images:
        page.send_bytes(image.tobytes())
