"""The bench: one page on which the whole measurement is turned, from the scene to the result line."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any, TypeAlias

import cv2
import ipywidgets as widgets

from stereolib.notebook import chain, python_code
from stereolib.notebook.explorer_panels import (
    CAPTIONS,
    draw_costs,
    draw_panels,
    find,
    length_text,
    result_line,
    scale_of,
)
from stereolib.notebook.knobs import OWN, Knob, State, from_text, knobs, most_p2, on_step, to_text
from stereolib.notebook.latest import Latest
from stereolib.notebook.live_picture import LivePicture
from stereolib.notebook.stories import STORIES, Story

_UPLOADS = ("left", "right", "calibration", "scan")
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
        self.state = State(source=OWN, own=own) if own else State()
        self._pixels: tuple[tuple[int, int], ...] = ()  # the last two that were clicked
        self._is_setting = False
        self._pictures = LivePicture("The pair, its disparity, its error, and the scene from above.", self._click)
        self._costs = LivePicture("What each disparity costs the clicked pixel.")
        self._result, self._said, self._clicked = widgets.HTML(), widgets.HTML(), widgets.HTML(_CLICK_HELP)
        self._code = widgets.Textarea(rows=14, layout=_WIDE)
        self._words = widgets.Text(layout=_WIDE, continuous_update=False).add_class("stereolib-words")
        self._files = widgets.HTML()
        self._controls = {name: _control(knob, getattr(self.state, name)) for name, knob in knobs().items()}
        self._source = widgets.Dropdown(
            options=chain.sources(self.state), value=self.state.source, description="look at",
            tooltip="The virtual rig, whose scene the knobs build; a recording; or your own pair.",
        )  # fmt: skip
        for name, control in self._controls.items():
            control.observe(lambda change, name=name: self._turn(**{name: change["new"]}), names="value")
        self._source.observe(lambda change: self._look_at(change["new"]), names="value")
        self._words.observe(lambda change: self._restore(change["new"]), names="value")
        self._worker: Latest[State] = Latest(self._preview, self._full)
        self._pointer: Latest[_Pointed] = Latest(self._say_found, self._show_costs)
        self.page = self._laid_out()
        self._set(self.state)

    def _ipython_display_(self) -> None:
        from IPython.display import display

        display(self.page)  # type: ignore[no-untyped-call]

    def _laid_out(self) -> widgets.Box:
        groups: dict[str, list[Any]] = {}
        for name, knob in knobs().items():
            groups.setdefault(knob.group, []).append(self._controls[name])
        groups["Own pair"] = [_Upload(self._take).box]
        groups["Keep"] = self._keeping()
        tabs = widgets.Accordion([widgets.VBox(group) for group in groups.values()], titles=list(groups))
        tabs.selected_index = 0
        stories = [self._story_button(story) for story in STORIES]
        for part, name in ((self._result, "results"), (self._pictures, "scene"), (self._clicked, "found"),
                           (self._costs, "costs"), (self._said, "said")):  # fmt: skip
            part.add_class(f"stereolib-{name}")
        seen = widgets.VBox([self._result, self._pictures, self._clicked, self._costs])
        row = widgets.Box([tabs.add_class("stereolib-knobs"), seen.add_class("stereolib-seen")])
        first = widgets.Box([self._source, *stories]).add_class("stereolib-row").add_class("stereolib-stories")
        title = widgets.HTML(f"<style>{_STYLE.read_text(encoding='utf-8')}</style>{_TITLE}")
        page = widgets.VBox([title, first, self._said, row.add_class("stereolib-row")])
        return page.add_class("stereolib-bench")

    def _story_button(self, story: Story) -> widgets.Button:
        button = widgets.Button(description=story.name, tooltip="Sets the knobs and says what to look at.")
        button.layout.width = "auto"
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
            self._said.value = ""
            self._set(state)

    def _look_at(self, source: str) -> None:
        if not self._is_setting and source != self.state.source:
            self._said.value = ""
            self._set(replace(self.state, source=source))

    def _tell(self, story: Story) -> None:
        self._set(replace(story.state, own=self.state.own))
        self._said.value = _sentence(story.tell(story.state))

    def _restore(self, text: str) -> None:
        if self._is_setting:
            return
        try:
            state = replace(from_text(text), own=self.state.own)
            if state.source not in chain.sources(state):
                raise ValueError(f'there is nothing called "{state.source}" to look at')
        except ValueError as error:
            self._said.value = _sentence(f"Not restored: {error}", "b00020")
            return
        self._said.value = ""
        self._set(state)

    def _take(self, own: tuple[str, ...]) -> None:
        self._set(replace(self.state, own=own, source=OWN))
        self._said.value = _sentence("Your pair. Turn the matcher's knobs until the map is right.")

    def _set(self, state: State) -> None:
        """Make a state that of all knobs, offer what is possible in it, and show it."""
        self._pixels = self._pixels if state.source == self.state.source and state.own == self.state.own else ()
        self._is_setting = True
        try:
            self.state = self._offer(state)
            for name, control in self._controls.items():
                control.value = getattr(self.state, name)
            self._source.options = chain.sources(self.state)
            self._source.value = self.state.source
            self._words.value = to_text(self.state)
        finally:
            self._is_setting = False
        self._worker.ask(self.state)

    def _offer(self, state: State) -> State:
        """Offer no value that is not possible: P2 above P1 and within 16 bits, and no knob that turns nothing."""
        p2, most = self._controls["p2"], most_p2(state.block_size)
        state = replace(state, p1=min(state.p1, most - 1), p2=min(max(state.p2, state.p1 + 1), most))
        self._controls["p1"].max = min(int(knobs()["p1"].high), most - 1)
        p2.min, p2.max = 1, most  # first wide, as the slider refuses a minimum above its maximum
        p2.min = state.p1 + 1
        without_effect = chain.idle(state)
        for name, control in self._controls.items():
            control.disabled = name in without_effect
        return state

    # What is shown: in the worker's thread.

    def _preview(self, state: State) -> None:
        small = replace(self.state, half=True)
        self._shown(small, lambda: False)
        self._pictures.wait()

    def _full(self, state: State, is_old: Callable[[], bool]) -> None:
        self._shown(state, is_old)
        if not is_old():
            self._code.value = python_code.of(state)
            self._point(state)

    def _shown(self, state: State, is_old: Callable[[], bool]) -> None:
        try:
            if not (state.half or chain.is_made(state, is_old)):
                return
            images, line = draw_panels(state), result_line(state)
        except (ValueError, OSError, cv2.error) as error:
            self._result.value = _sentence(f"Not possible: {error}", "b00020")
            return
        if not is_old():
            self._pictures.show(images, CAPTIONS, quality="preview" if state.half else "full", about=to_text(state))
            self._result.value = line

    # What was clicked: looked up in a thread of its own, and again when a knob was turned.

    def _click(self, picture: int, column: int, row: int, is_new: bool) -> None:
        if picture not in _MAP_PICTURES:
            return
        scale, (height, width) = scale_of(self.state), chain.pair(self.state)[0].shape[:2]
        pixel = round(column / scale), round(row / scale)
        if 0 <= pixel[0] < width and 0 <= pixel[1] < height:
            self._pixels = (*(self._pixels[-1:] if is_new else self._pixels[:-1]), pixel)
            self._point(self.state)

    def _point(self, state: State) -> None:
        if self._pixels:
            self._pointer.ask((state, self._pixels))
        else:
            self._pictures.cross, self._clicked.value = [], _CLICK_HELP
            self._costs.show([])

    def _say_found(self, pointed: _Pointed) -> None:
        state, pixels = pointed
        found = [find(state, pixel) for pixel in pixels]
        length = length_text(found[0], found[1], chain.rectified_rig(state)) if len(found) == 2 else ""
        self._clicked.value = _sentence(". ".join(filter(None, (found[-1].text, length))))

    def _show_costs(self, pointed: _Pointed, is_old: Callable[[], bool]) -> None:
        state, pixels = pointed
        costs = draw_costs(state, find(state, pixels[-1]))
        if is_old():
            return
        self._costs.show([] if isinstance(costs, str) else costs)
        if isinstance(costs, str):
            self._clicked.value += _sentence(f"No cost curve: {costs}")

    def _prepare(self) -> None:
        self._files.value = " ".join(python_code.download_links(self.state))


class _Upload:
    """Four fields for files; what they hold is checked like the commands check it."""

    def __init__(self, take: Callable[[tuple[str, ...]], None]) -> None:
        self._take, self._folder, self._uses = take, tempfile.TemporaryDirectory(prefix="stereolib-"), 0
        about = {"left": ".jpg,.jpeg,.png", "right": ".jpg,.jpeg,.png", "calibration": ".json", "scan": ".bin,.csv"}
        self._fields = {name: widgets.FileUpload(accept=kinds, description=name) for name, kinds in about.items()}
        self._said = widgets.HTML("left and right are needed; calibration.json gives lengths, a scan the laser")
        button = widgets.Button(description="use this pair", tooltip="Checks the files and shows the pair.")
        button.on_click(lambda _: self._use())
        self._said.add_class("stereolib-upload")
        self.box = widgets.VBox([*self._fields.values(), button, self._said])

    def _use(self) -> None:
        self._uses += 1
        paths = {name: self._kept(name) for name in _UPLOADS}
        try:
            if not (paths["left"] and paths["right"]):
                raise ValueError("a left and a right picture are needed")
            own = tuple(paths[name] for name in _UPLOADS)
            chain.check_own(own)
        except (ValueError, OSError) as error:
            told = str(error)
            for path in filter(None, paths.values()):
                told = told.replace(path, Path(path).name)  # the visitor knows no other
            self._said.value = _sentence(f"Not used: {told}", "b00020")
            return
        self._said.value = ""
        self._take(own)

    def _kept(self, name: str) -> str:
        uploaded = self._fields[name].value
        if not uploaded:
            return ""
        path = Path(self._folder.name) / f"{self._uses}_{name}" / Path(uploaded[0]["name"]).name
        path.parent.mkdir()  # a new one: what was read from a path is remembered
        path.write_bytes(bytes(uploaded[0]["content"]))
        return str(path)


def open_bench() -> Bench:
    """Make the bench for the files that ``stereolib explore`` was given, if it was.

    Returns
    -------
    Bench
    """
    return Bench(tuple(json.loads(os.environ.get(chain.OWN_FILES, "[]"))))


def _control(knob: Knob, first: Any) -> Any:
    look = {
        "description": knob.label,
        "tooltip": knob.help,
        "style": {"description_width": "160px"},
        "layout": widgets.Layout(width="98%"),
    }
    if isinstance(first, bool):
        return widgets.Checkbox(value=first, **look)
    if knob.choices:
        return widgets.Dropdown(options=knob.choices, value=first, **look)
    limits = {"min": knob.low, "max": knob.high, "step": knob.step}
    if isinstance(first, int) and float(knob.step).is_integer():
        return widgets.IntSlider(value=first, **limits, **look)
    decimals = max(0, len(f"{knob.step:g}".partition(".")[2]))
    return widgets.FloatSlider(value=first, readout_format=f".{decimals}f", **limits, **look)


def _sentence(text: str, color: str = "222") -> str:
    return f'<p style="color:#{color}">{escape(text)}</p>'


_WIDE = widgets.Layout(width="98%")
_TITLE = "<h2>stereolib: the whole measurement under your fingers</h2>"
_CLICK_HELP = _sentence(
    "Click into a picture, or move in it with the arrow keys: disparity, depth, height, and what each disparity costs "
    "there. Two clicks measure a length."
)
