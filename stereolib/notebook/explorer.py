"""The bench: one page on which the whole measurement is turned, from the scene to the result line."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any, TypeAlias

import cv2
import ipywidgets as widgets

from stereolib.notebook import chain, offered, python_code
from stereolib.notebook.code_block import CodeBlock
from stereolib.notebook.explorer_clicks import draw_costs, find, length_text
from stereolib.notebook.explorer_controls import UPLOADS, Controls, Upload, described, sentence
from stereolib.notebook.explorer_panels import CAPTIONS, draw_panels, scale_of
from stereolib.notebook.explorer_results import legend, result_line
from stereolib.notebook.knobs import OWN, VIRTUAL, State, from_text, knobs, on_step, to_text
from stereolib.notebook.latest import Latest
from stereolib.notebook.live_picture import LivePicture
from stereolib.notebook.stories import STORIES, Story

_STYLE = Path(__file__).with_name("explorer.css")
_Pointed: TypeAlias = tuple[State, tuple[tuple[int, int], ...]]
_MAP_PICTURES = (0, 1, 2)  # pictures whose pixels are the pair's


class Bench:
    """The page; an instance shows itself in a notebook and in Voila.

    Parameters
    ----------
    own : (left, right, calibration, scan), optional
        Paths of an own pair; the last two may be empty.

    Attributes
    ----------
    state : State
        Of all knobs.
    """

    def __init__(self, own: tuple[str, ...] = ()) -> None:
        self.state = self._first = _first_state(own)
        self._story: Story | None = None
        self._told = ""
        self._pixels: tuple[tuple[int, int], ...] = ()  # the last two that were clicked
        self._cross: list[int] = []  # where the last one was, as the page has it
        self._is_setting = False
        self._pictures = LivePicture("The pair, its disparity, its error, and the scene from above.", self._click)
        self._costs = LivePicture("What each disparity costs the clicked pixel.")
        self._result, self._said, self._clicked = widgets.HTML(), widgets.HTML(), widgets.HTML(_CLICK_HELP)
        self._code = CodeBlock()
        self._words = widgets.Text(layout=_WIDE, continuous_update=False).add_class("stereolib-words")
        self._files = widgets.HTML()
        self._source = widgets.Dropdown(
            options=offered.sources(self.state), value=self.state.source,
            **described("look at", "The virtual rig, whose scene the knobs build; a recording; or your own pair."),
        )  # fmt: skip
        others = {"Own pair": [Upload(self._take).box], "Keep": self._keeping()}
        self._controls = Controls(self.state, self._turn, others)
        self._source.observe(lambda change: self._look_at(change["new"]), names="value")
        self._words.observe(lambda change: self._restore(change["new"]), names="value")
        self._worker: Latest[State] = Latest(self._preview, self._full)
        self._pointer: Latest[_Pointed] = Latest(self._say_found, self._show_costs)
        self._teller: Latest[Story] = Latest(lambda _: None, self._tell_whole)
        self.page = self._laid_out()
        self._set(self.state)

    def _ipython_display_(self) -> None:
        from IPython.display import display

        display(self.page)  # type: ignore[no-untyped-call]

    def _laid_out(self) -> widgets.Box:
        tabs = widgets.VBox(list(self._controls.groups.values()))
        reset = widgets.Button(description="Reset", tooltip="All knobs as at the start.")
        reset.on_click(lambda _: self._reset())
        for part, name in ((self._result, "results"), (self._pictures, "scene"), (self._clicked, "found"),
                           (self._costs, "costs"), (self._said, "said"), (self._code, "code")):  # fmt: skip
            part.add_class(f"stereolib-{name}")
        drawn = widgets.HTML(legend()).add_class("stereolib-legend")
        seen = widgets.VBox([self._result, self._pictures, self._clicked, self._costs, drawn])
        row = widgets.Box([tabs.add_class("stereolib-knobs"), seen.add_class("stereolib-seen")])
        first = widgets.Box([self._source, reset, *map(self._story_button, STORIES)])
        first.add_class("stereolib-row").add_class("stereolib-stories")
        title = widgets.HTML(f"<style>{_STYLE.read_text(encoding='utf-8')}</style>{_TITLE}")
        page = widgets.VBox([title, first, self._said, row.add_class("stereolib-row")])
        return page.add_class("stereolib-bench")

    def _story_button(self, story: Story) -> widgets.Button:
        button = widgets.Button(description=story.name, tooltip="Sets the knobs and says what to look at.")
        button.on_click(lambda _: self._tell(story))
        return button

    def _keeping(self) -> list[Any]:
        save = widgets.Button(description="prepare files", tooltip="The pictures, the disparity and a point cloud.")
        save.on_click(lambda _: self._prepare())
        return [
            widgets.HTML("the state; paste one here to restore it"),
            self._words,
            widgets.HTML("the same in Python"),
            self._code,
            save,
            self._files,
        ]

    # What turns: each sets the state and asks for its pictures.

    def _turn(self, **values: Any) -> None:
        if self._is_setting:
            return
        stepped: dict[str, Any] = {name: on_step(name, value) for name, value in values.items()}
        state = replace(self.state, **stepped)
        if state != self.state:
            self._set(state)

    def _look_at(self, source: str) -> None:
        if self._is_setting or source == self.state.source:
            return
        story = self._story.state if self._story else self.state
        left = {name: value for name in knobs() if (value := getattr(self.state, name)) != getattr(story, name)}
        changed: dict[str, Any] = left if self._story else {name: getattr(self.state, name) for name in knobs()}
        self._end()  # what the story set goes with it, what was turned since stays
        self._set(State(source=source, own=self.state.own, **changed))

    def _reset(self) -> None:
        self._end()
        self._pixels = ()
        self._set(replace(self._first, own=self.state.own))

    def _tell(self, story: Story) -> None:
        """Set a story's knobs and show them; its sentences come when they are computed."""
        self._end()
        self._story, self._told = story, "…"
        self._controls.mark(story)
        self._set(replace(story.state, own=self.state.own))
        self._teller.ask(story)

    def _tell_whole(self, story: Story, is_old: Callable[[], bool]) -> None:
        told = story.sentence
        if not is_old() and self._story is story:
            self._told = told
            self._show_story()

    def _show_story(self) -> None:
        """The story's sentences; greyed where the knobs are no longer its own, nor those that it proposes."""
        story = self._story
        if story is None:
            return
        is_past = to_text(self.state) not in [to_text(state) for state in (story.state, *story.then)]
        turned = [
            f"{knobs()[name].label}: {knobs()[name].shown(getattr(story.state, name))}" for name in story.set_knobs
        ]
        marks = "".join(f", <mark>{escape(text)}</mark>" for text in turned)
        since = " <em>Settings changed since.</em>" if is_past else ""
        self._said.value = (
            f'<p class="stereolib-{"past" if is_past else "story"}"><b>{escape(story.name)}</b> '
            f"({escape(story.state.source)}{marks}). {escape(self._told)}{since}</p>"
        )

    def _end(self) -> None:
        """End a story and what was said."""
        self._story, self._said.value = None, ""
        self._controls.unmark()

    def _restore(self, text: str) -> None:
        if self._is_setting:
            return
        try:
            state = replace(from_text(text), own=self.state.own)
            if state.source not in offered.sources(state):
                raise ValueError(f'there is nothing called "{state.source}" to look at')
        except ValueError as error:
            self._said.value = sentence(f"Not restored: {error}", "b00020")
            return
        self._end()
        self._set(state)

    def _take(self, own: tuple[str, ...]) -> None:
        self._end()
        self._set(replace(self.state, own=own, source=OWN))
        named = [f"{name} {Path(path).name}" if path else f"no {name}" for name, path in zip(UPLOADS, own, strict=True)]
        self._said.value = sentence(
            f"Your pair: {', '.join(named)}. If it is seen that something is wrong with it, that stands below the "
            "readings; else turn the matcher's knobs until the map is right."
        )

    def _set(self, state: State) -> None:
        """Make a state that of all knobs, offer what is possible in it, and show it."""
        self._pixels = self._pixels if state.source == self.state.source and state.own == self.state.own else ()
        self._is_setting = True
        try:
            self.state = self._controls.offer(state)
            self._controls.show(self.state)
            self._source.options = offered.sources(self.state)
            self._source.value = self.state.source
            self._words.value = to_text(self.state)
        finally:
            self._is_setting = False
        self._show_story()
        self._worker.ask(self.state)

    # What is shown: in the worker's thread.

    def _preview(self, state: State) -> None:
        small = replace(self.state, half=True)
        self._shown(small, lambda: False)
        self._pictures.wait()

    def _full(self, state: State, is_old: Callable[[], bool]) -> None:
        self._shown(state, is_old)
        if not is_old():
            self._code.code = python_code.of(state)
            self._point(state)

    def _shown(self, state: State, is_old: Callable[[], bool]) -> None:
        try:
            if not (state.half or chain.is_made(state, is_old)):
                return
            images, line = draw_panels(state), result_line(state)
        except (ValueError, OSError, cv2.error) as error:
            self._result.value = sentence(f"Not possible: {error}", "b00020")
            return
        if not is_old():
            self._pictures.show(images, CAPTIONS, quality="preview" if state.half else "full", about=to_text(state))
            self._result.value = line

    # What was clicked: looked up in a thread of its own, and again when a knob was turned.

    def _click(self, picture: int, column: int, row: int, is_new: bool) -> None:
        if picture not in _MAP_PICTURES:
            self._forget(_NOT_THERE)
            return
        scale, (height, width) = scale_of(self.state), chain.pair(self.state)[0].shape[:2]
        pixel = round(column / scale), round(row / scale)
        if not (0 <= pixel[0] < width and 0 <= pixel[1] < height):
            self._forget(_NOT_THERE)
            return
        if is_new:
            self._pictures.before = self._cross if self._pixels else []
        self._cross = [picture, column, row]
        self._pixels = (*(self._pixels[-1:] if is_new else self._pixels[:-1]), pixel)
        self._point(self.state)

    def _point(self, state: State) -> None:
        if self._pixels:
            self._pointer.ask((state, self._pixels))
        else:
            self._forget(_CLICK_HELP)

    def _forget(self, told: str) -> None:
        """Take away what was clicked, and say something in its place."""
        self._pixels = ()
        self._pictures.cross, self._pictures.before, self._clicked.value = [], [], told
        self._costs.show([])

    def _say_found(self, pointed: _Pointed) -> None:
        told = self._found_text(pointed)
        if pointed[1] == self._pixels:
            self._clicked.value = told

    @staticmethod
    def _found_text(pointed: _Pointed) -> str:
        state, pixels = pointed
        try:
            found = [find(state, pixel) for pixel in pixels]
            length = length_text(found[0], found[1], chain.rectified_rig(state)) if len(found) == 2 else ""
        except (ValueError, OSError, cv2.error) as error:
            return sentence(f"Not possible: {error}", "b00020")
        return sentence(". ".join(filter(None, (found[-1].text, length))))

    def _show_costs(self, pointed: _Pointed, is_old: Callable[[], bool]) -> None:
        state, pixels = pointed
        try:
            costs = draw_costs(state, find(state, pixels[-1]))
        except (ValueError, OSError, cv2.error) as error:
            costs = str(error)
        if is_old() or pixels != self._pixels:
            return
        self._costs.show([] if isinstance(costs, str) else costs)
        if isinstance(costs, str):
            self._clicked.value = self._found_text(pointed) + sentence(f"No cost curve: {costs}")

    def _prepare(self) -> None:
        self._files.value = " ".join(python_code.download_links(self.state))


def open_bench() -> Bench:
    """Make the bench for the files that ``stereolib explore`` was given, if it was.

    Returns
    -------
    Bench
    """
    return Bench(tuple(json.loads(os.environ.get(offered.OWN_FILES, "[]"))))


def _first_state(own: tuple[str, ...]) -> State:
    return State(source=OWN if own else VIRTUAL, own=own)


_WIDE = widgets.Layout(width="98%")
_TITLE = (
    "<h2>stereolib: the whole measurement under your fingers</h2><p>Two cameras look at a box on the floor. A matcher, "
    "OpenCV's SGBM (semi-global block matching), looks for each pixel of the left picture in the same row of the right "
    "one; how far it moved is its disparity: the nearer, the larger. From disparities come heights, by the paper's "
    'recipe and by ours. Begin with a story: "Fig. 4: texture", then "Why 37.7 cm?".</p>'
)
_NOT_THERE = (
    "<p>Nothing can be looked up there: click into the left picture, its disparity or its error, not beside them.</p>"
)
_CLICK_HELP = sentence(
    "Click into a picture, or move in it with the arrow keys: disparity, depth, height, and what each disparity costs "
    "there. Two clicks measure a length."
)
