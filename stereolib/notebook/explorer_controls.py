"""The controls of the bench: one for each knob, only what is possible offered, and the fields for an own pair."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any

import ipywidgets as widgets

from stereolib.base import work_folder
from stereolib.notebook import chain, offered
from stereolib.notebook.knobs import Knob, State, knobs, most_p2
from stereolib.notebook.stories import Story

#: Files of an own pair, in this order.
UPLOADS = ("left", "right", "calibration", "scan")
_SCENE = frozenset(chain.OF_SCENE)
_RECORDED = (
    '<p>Nothing here can be turned in what was recorded: choose "virtual rig" above, and its box and cameras have '
    "sliders here.</p>"
)
_IDLE = "<p>Nothing here changes what is shown now.</p>"


class Controls:
    """All knobs as controls, in groups that unfold.

    Parameters
    ----------
    state : State
        At the start.
    turn : callable
        Called with the name of a knob that was turned, as keyword, and its new value.
    others : mapping of str to list
        Groups without a knob, which stand below: what is in each.

    Attributes
    ----------
    groups : dict of str to ipywidgets.Accordion
    """

    def __init__(self, state: State, turn: Callable[..., None], others: Mapping[str, list[Any]]) -> None:
        self._controls = {name: _control(knob, getattr(state, name)) for name, knob in knobs().items()}
        for name, control in self._controls.items():
            control.observe(lambda change, name=name: turn(**{name: change["new"]}), names="value")
        self._notes = {
            group: widgets.HTML(_RECORDED if group in ("Box", "Cameras") else _IDLE)
            for group in dict.fromkeys(knob.group for knob in knobs().values())
        }
        self.groups = self._grouped(others)

    def _grouped(self, others: Mapping[str, list[Any]]) -> dict[str, widgets.Accordion]:
        """What is turned, a group that unfolds for each."""
        groups: dict[str, list[Any]] = {}
        for name, knob in knobs().items():
            groups.setdefault(knob.group, []).append(self._controls[name])
        for group, note in self._notes.items():
            groups[group].append(note)
        groups |= others
        return {
            name: widgets.Accordion([widgets.VBox(group)], titles=[name], selected_index=0 if name == "Box" else None)
            for name, group in groups.items()
        }

    def offer(self, state: State) -> State:
        """Offer no value that is not possible: P2 above P1 and within 16 bits, and no knob that turns nothing.

        Parameters
        ----------
        state : State

        Returns
        -------
        State
            The same, with P1 and P2 among the possible ones.
        """
        p2, most = self._controls["p2"], most_p2(state.block_size)
        state = replace(state, p1=min(state.p1, most - 1), p2=min(max(state.p2, state.p1 + 1), most))
        self._controls["p1"].max = min(int(knobs()["p1"].high), most - 1)
        p2.min, p2.max = 1, most  # first wide, as the slider refuses a minimum above its maximum
        p2.min = state.p1 + 1
        without_effect = offered.idle(state)
        for name, control in self._controls.items():
            control.disabled = name in without_effect
            control.layout.display = "none" if name in without_effect else None  # its value would be none that counts
        for group, note in self._notes.items():
            needed = {name for name, knob in knobs().items() if knob.group == group}
            needed = needed & _SCENE or needed  # a recording has an exposure, and no camera that can be moved
            note.layout.display = None if needed <= without_effect else "none"
        return state

    def show(self, state: State) -> None:
        """Set all controls to a state.

        Parameters
        ----------
        state : State
            Possible, as `offer` returns it.
        """
        for name, control in self._controls.items():
            control.value = getattr(state, name)

    def mark(self, story: Story) -> None:
        """Mark the knobs that a story sets and proposes, and unfold their groups alone.

        Parameters
        ----------
        story : Story
        """
        for names, mark in ((story.next_knobs, "next"), (story.set_knobs, "set")):
            for name in names:
                self._controls[name].add_class(f"stereolib-{mark}")
        if involved := {knobs()[name].group for name in (*story.set_knobs, *story.next_knobs)}:
            for group, tab in self.groups.items():
                tab.selected_index = 0 if group in involved else None

    def unmark(self) -> None:
        """Take away the marks of a story."""
        for control in self._controls.values():
            control.remove_class("stereolib-set").remove_class("stereolib-next")


class Upload:
    """Four fields for files; what they hold is checked like the commands check it.

    Parameters
    ----------
    take : callable
        Called with the paths of a pair that can be used, in the order of `UPLOADS`; empty where no file was given.

    Attributes
    ----------
    box : ipywidgets.VBox
        To be shown.
    """

    def __init__(self, take: Callable[[tuple[str, ...]], None]) -> None:
        kept = ExitStack()
        self._take, self._folder, self._uses = take, kept.enter_context(work_folder()), 0
        weakref.finalize(self, kept.close)
        about = {"left": ".jpg,.jpeg,.png", "right": ".jpg,.jpeg,.png", "calibration": ".json", "scan": ".bin,.csv"}
        self._fields = {name: widgets.FileUpload(accept=kinds, description=name) for name, kinds in about.items()}
        self._names = {name: widgets.HTML().add_class("stereolib-file") for name in about}
        for name, field in self._fields.items():
            field.observe(lambda _, name=name: self._name(name), names="value")
            self._name(name)
        self._said = widgets.HTML("left and right are needed; calibration.json gives lengths, a scan the laser")
        button = widgets.Button(description="use this pair", tooltip="Checks the files and shows the pair.")
        button.on_click(lambda _: self._use())
        clear = widgets.Button(description="clear files", tooltip="Takes all four files out of these fields.")
        clear.on_click(lambda _: self._clear())
        self._said.add_class("stereolib-upload")
        shown = [part for name in about for part in (self._fields[name], self._names[name])]
        self.box = widgets.VBox([*shown, widgets.HBox([button, clear]), self._said])

    def _name(self, name: str) -> None:
        uploaded = self._fields[name].value
        self._names[name].value = escape(uploaded[0]["name"]) if uploaded else "no file"

    def _clear(self) -> None:
        for field in self._fields.values():
            field.value = ()

    def _use(self) -> None:
        self._uses += 1
        paths = {name: self._kept(name) for name in UPLOADS}
        try:
            if not (paths["left"] and paths["right"]):
                raise ValueError("a left and a right picture are needed")
            own = tuple(paths[name] for name in UPLOADS)
            offered.check_own(own)
        except (ValueError, OSError) as error:
            told = str(error)
            for path in filter(None, paths.values()):
                told = told.replace(path, Path(path).name)  # the visitor knows no other
            self._said.value = sentence(f"Not used: {told}", "b00020")
            return
        self._said.value = ""
        self._take(own)

    def _kept(self, name: str) -> str:
        uploaded = self._fields[name].value
        if not uploaded:
            return ""
        path = self._folder / f"{self._uses}_{name}" / Path(uploaded[0]["name"]).name
        path.parent.mkdir()  # a new one: what was read from a path is remembered
        path.write_bytes(bytes(uploaded[0]["content"]))
        return str(path)


def _control(knob: Knob, first: Any) -> Any:
    look = described(knob.label, knob.help) | {
        "style": {"description_width": "160px"},
        "layout": widgets.Layout(width="98%"),
    }
    if isinstance(first, bool):
        return widgets.Checkbox(value=first, **look)
    if knob.choices:
        return widgets.Dropdown(options=[(knob.shown(one), one) for one in knob.choices], value=first, **look)
    limits = {"min": knob.low, "max": knob.high, "step": knob.step}
    if isinstance(first, int) and float(knob.step).is_integer():
        return widgets.IntSlider(value=first, **limits, **look)
    decimals = max(0, len(f"{knob.step:g}".partition(".")[2]))
    return widgets.FloatSlider(value=first, readout_format=f".{decimals}f", **limits, **look)


def described(label: str, help: str) -> dict[str, Any]:
    """Return a label whose help is seen on hover, of every kind of control: of some, ipywidgets shows no tooltip.

    Parameters
    ----------
    label, help : str

    Returns
    -------
    dict of str to object
        Arguments of the control.
    """
    return {
        "description": f'<span title="{escape(help)}">{escape(label)}</span>',
        "description_allow_html": True,
        "tooltip": help,
    }


def sentence(text: str, color: str = "222") -> str:
    """Return a text as a paragraph of the page.

    Parameters
    ----------
    text : str
        Escaped here.
    color : str
        Hexadecimal RGB.

    Returns
    -------
    str
        HTML.
    """
    return f'<p style="color:#{color}">{escape(text)}</p>'
