"""Pictures in the browser that a kernel replaces many times a second, and that tell where they were clicked."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import anywidget
import cv2
import traitlets

from stereolib.base import UInt8

#: Takes the picture's number, the column and row (px), and whether they were clicked, not reached by arrow keys.
Clicked: TypeAlias = Callable[[int, int, int, bool], None]
_HERE = Path(__file__).parent
_PATIENCE_S = 1.0  # for a page that has gone; the next picture is sent all the same


class LivePicture(anywidget.AnyWidget):
    """One picture or several, side by side where there is room.

    Parameters
    ----------
    alt : str
        What there is to see, for those who do not.
    clicked : callable, optional
        Called with the picture's number, column and row, and whether it was a click: arrow keys move the last one.

    Attributes
    ----------
    cross : list of int
        Where the page draws a cross: the picture's number, column and row; empty for none.
    before : list of int
        Where it draws a ring, of a click before; likewise.
    """

    _esm = _HERE / "live_picture.js"
    _css = _HERE / "live_picture.css"
    frames = traitlets.List(traitlets.Bytes()).tag(sync=True)
    captions = traitlets.List(traitlets.Unicode()).tag(sync=True)
    alt = traitlets.Unicode().tag(sync=True)
    quality = traitlets.Unicode().tag(sync=True)
    about = traitlets.Unicode().tag(sync=True)
    number = traitlets.Int(0).tag(sync=True)
    cross = traitlets.List(traitlets.Int()).tag(sync=True)
    before = traitlets.List(traitlets.Int()).tag(sync=True)
    painted = traitlets.Int(0).tag(sync=True)

    def __init__(self, alt: str = "", clicked: Clicked | None = None) -> None:
        super().__init__(alt=alt)
        self._clicked, self._seen = clicked, threading.Event()
        self.observe(lambda _: self._seen.set(), names="painted")
        self.on_msg(self._told)

    def show(
        self, images: Sequence[UInt8], captions: Sequence[str] = (), *, quality: str = "full", about: str = ""
    ) -> None:
        """Replace the pictures.

        Parameters
        ----------
        images : sequence of (H, W) or (H, W, 3) uint8, blue-green-red
        captions : sequence of str
        quality : "preview" | "full"
        about : str
            What is shown, for programs that watch the page.
        """
        jpeg = [cv2.IMWRITE_JPEG_QUALITY, 88 if quality == "full" else 75]
        frames = [cv2.imencode(".jpg", image, jpeg)[1].tobytes() for image in images]
        self._seen.clear()
        with self.hold_sync():
            self.frames, self.captions, self.quality, self.about = frames, list(captions), quality, about
            self.number += 1

    def refuse(self, reason: str) -> None:
        """Say why there is no picture of what was asked for; the one that is there stays, dimmed.

        Parameters
        ----------
        reason : str
        """
        with self.hold_sync():
            self.captions, self.quality = [reason], "refused"
            self.number += 1

    def wait(self) -> None:
        """Wait until the page has painted what was sent last, at most a second."""
        if self.comm is not None and self.painted < self.number:
            self._seen.wait(_PATIENCE_S)

    def _told(self, _: Any, content: dict[str, Any], __: Any) -> None:
        if content.get("kind") in ("click", "move") and self._clicked is not None:
            self._clicked(int(content["picture"]), int(content["x"]), int(content["y"]), content["kind"] == "click")
