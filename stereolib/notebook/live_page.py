"""Live pictures with a line above and buttons below: in a notebook, and as the page of a command."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from html import escape
from pathlib import Path

import ipywidgets as widgets

from stereolib.notebook.live_link import LiveView, follow, read_link
from stereolib.notebook.live_picture import LivePicture

_STYLE = Path(__file__).with_name("live_page.css")
_ENDED = "<p class='stereolib-ended'>This has ended; what it said last stands here.</p>"


class LivePage:
    """The page; an instance shows itself in a notebook and in Voila.

    Parameters
    ----------
    title : str
    buttons : dict
        What a button is called -> what it does.
    press : callable
        Called with the name of a button that was pressed.
    """

    def __init__(self, title: str, buttons: dict[str, str], press: Callable[[str], object]) -> None:
        self._pictures, self._said = LivePicture("What the sensors see now."), widgets.HTML()
        self._ended = widgets.HTML()
        pressed = []
        for name, help_text in buttons.items():
            button = widgets.Button(description=name, tooltip=help_text)
            button.on_click(lambda _, name=name: press(name))
            pressed.append(button)
        self._row = widgets.HBox(pressed)
        title_html = widgets.HTML(f"<style>{_STYLE.read_text(encoding='utf-8')}</style><h2>{escape(title)}</h2>")
        self._said.add_class("stereolib-said")
        self.page = widgets.VBox([title_html, self._ended, self._said, self._row, self._pictures])
        self.page.add_class("stereolib-live")

    def _ipython_display_(self) -> None:
        from IPython.display import display

        display(self.page)  # type: ignore[no-untyped-call]

    def show(self, view: LiveView) -> None:
        """Replace what is shown, and wait until it is painted, at most a second.

        Parameters
        ----------
        view : LiveView
        """
        self._said.value = view.html
        self._pictures.show(view.images, view.captions, quality="preview")
        if view.is_last:
            self._ended.value = _ENDED
            for button in self._row.children:
                button.disabled = True
        self._pictures.wait()


def open_live_page() -> LivePage | None:
    """Show what the command that started this page shows.

    Returns
    -------
    LivePage or None
        None where no command did: then a sentence says what to do.
    """
    if (link := read_link()) is None:
        print("This page belongs to stereolib capture or stereolib lrf live: start one of them in a terminal.")
        return None
    pressed: list[str] = []
    page = LivePage(link["title"], link["buttons"], pressed.append)

    def run() -> None:
        last = LiveView()
        with suppress(OSError):
            for last in follow(link, pressed):
                page.show(last)
        if not last.is_last:  # the command has gone
            page.show(replace(last, is_last=True))

    threading.Thread(target=run, daemon=True, name="live page").start()
    return page
