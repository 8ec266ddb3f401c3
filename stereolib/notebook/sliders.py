"""Sliders for notebooks: a function of a few numbers, its picture, and a line of text."""

from __future__ import annotations

import base64
import inspect
import re
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

import cv2

from stereolib.base import UInt8
from stereolib.notebook.latest import Latest

if TYPE_CHECKING:
    from stereolib.notebook.live_picture import LivePicture

#: Takes the controls by name; returns a picture, (H, W, 3) uint8 blue-green-red, and a line of text.
Drawing: TypeAlias = Callable[..., tuple[UInt8, str]]
Values: TypeAlias = dict[str, Any]
_JPEG_QUALITY = 80
_UNITS = {"mm": "mm", "px": "px", "deg": "degrees", "pct": "%"}
_PARAMETER = re.compile(r"^(\w[\w, ]*?) : [^\n]*\n((?:(?: {4}.*)\n?)*)", re.MULTILINE)
_KINDS = "(first, lowest, highest, step) or a list of choices, or (first, list of choices)"


class Explorer:
    """Sliders over a picture, made by `explore`; readers of a static page see the picture of the first values.

    The picture follows the slider while it moves: each move asks for its values and returns at once, and a thread draws
    the newest of them.

    Parameters
    ----------
    draw : callable
    controls : dict of str to ipywidgets control
    picture : LivePicture
        Where it is shown.

    Attributes
    ----------
    text : str
        What is said about the picture.
    """

    def __init__(self, draw: Drawing, controls: dict[str, Any], picture: LivePicture) -> None:
        from ipywidgets import VBox

        self._draw, self._controls, self._picture = draw, controls, picture
        self._drawn: tuple[UInt8, str, Values] | None = None
        self.text, self._sending = "", threading.Lock()
        self._worker: Latest[Values] = Latest(self._follow, self._rest)
        self._show(self.values)
        for control in controls.values():
            control.observe(lambda _: self._turned(), names="value")
        self._box = VBox([*controls.values(), picture])

    @property
    def values(self) -> Values:
        """What the controls say now, by name."""
        return {name: _rounded(control) for name, control in self._controls.items()}

    def settle(self, timeout_s: float = 60.0) -> bool:
        """Wait until the picture of the newest values is shown, or its refusal.

        Parameters
        ----------
        timeout_s : float

        Returns
        -------
        bool
            Whether it is.
        """
        return self._worker.settle(timeout_s)

    def _turned(self) -> None:
        with self._sending:
            self._picture.quality = "waiting"
        self._worker.ask(self.values)

    def _follow(self, values: Values) -> None:
        self._show(values)
        if self._picture.painted:
            self._picture.wait()

    def _rest(self, values: Values, _: Callable[[], bool]) -> None:
        if self._drawn is not None and self._drawn[2] == values:
            with self._sending:
                self._picture.show([self._drawn[0]], [self.text], about=_told(values))

    def _show(self, values: Values) -> None:
        try:
            image, text = self._draw(**values)
        except ValueError as error:
            self._refuse(f"not possible: {error}", values)
        except Exception as error:
            self._refuse(f"failed, {type(error).__name__}: {error}", values)
            raise
        else:
            self._drawn, self.text = (image, text, values), text
            quality = "preview" if values == self.values else "waiting"
            with self._sending:
                self._picture.show([image], [text], quality=quality, about=_told(values))

    def _refuse(self, reason: str, values: Values) -> None:
        self.text = reason
        drawn = self._drawn[2] if self._drawn else {}
        other = {name: value for name, value in drawn.items() if value != values[name]}
        still = f". The picture is still that of {_told(other)}." if other else ""
        with self._sending:
            self._picture.refuse(reason + still)

    def _repr_mimebundle_(self, **keywords: Any) -> dict[str, Any]:
        bundle = self._box._repr_mimebundle_(**keywords) or {}
        data = bundle[0] if isinstance(bundle, tuple) else bundle
        still = {"text/plain": self.text}
        if self._drawn:
            jpeg = cv2.imencode(".jpg", self._drawn[0], [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1]
            still["image/jpeg"] = base64.b64encode(jpeg.tobytes()).decode()
        return {**data, **still}


def explore(
    draw: Drawing,
    *,
    help: Mapping[str, str] | None = None,
    **controls: tuple[Any, ...] | Sequence[Any],
) -> Explorer:
    """Make sliders for a function.

    Parameters
    ----------
    draw : callable
        Takes the controls by name; returns (picture (H, W, 3) uint8 blue-green-red, text). Where it raises ValueError,
        the text stands in place of the picture's, which is dimmed.
    help : mapping of str to str, optional
        A sentence for each control, shown when the mouse rests on it; default: what the docstring of `draw` says.
    **controls
        ``name=(first, lowest, highest, step)`` makes a slider, ``name=[1, 2, 5]`` one over these values alone,
        ``name=["a", "b"]`` a menu. ``name=(first, values)`` begins at another than the first. In names underscores are
        shown as blanks and units in brackets: ``distance_mm`` as "distance (mm)".

    Returns
    -------
    Explorer

    Raises
    ------
    ValueError
        If a control is none of these, or `help` is about none of them.
    """
    from stereolib.notebook.live_picture import LivePicture

    if unknown := set(help or {}) - set(controls):
        raise ValueError(f"help for {', '.join(sorted(unknown))}, but the controls are {', '.join(controls)}")
    sentences = parameter_help(draw) | dict(help or {})
    made = {name: _control(name, how, sentences.get(name, "")) for name, how in controls.items()}
    picture = LivePicture()
    picture.add_class("stereolib-explorer")
    return Explorer(draw, made, picture)


def parameter_help(draw: Drawing) -> dict[str, str]:
    """Read from a function's docstring what each parameter is.

    Parameters
    ----------
    draw : callable
        A function, or a partial one.

    Returns
    -------
    dict of str to str
        A sentence for each parameter that has one.

    Examples
    --------
    >>> parameter_help(explore)["draw"][:30]
    'Takes the controls by name; re'
    """
    while isinstance(draw, partial):
        draw = draw.func
    text = (inspect.getdoc(draw) or "").partition("\nParameters\n")[2].partition("\nReturns\n")[0]
    found: dict[str, str] = {}
    for names, said in _PARAMETER.findall(text):
        if sentence := " ".join(said.replace("`", "").split()):
            found |= dict.fromkeys(re.split(", *", names), sentence)
    return found


def label(name: str) -> str:
    """Words for a parameter's name.

    Parameters
    ----------
    name : str

    Returns
    -------
    str

    Examples
    --------
    >>> [label(name) for name in ("distance_mm", "block_size", "P1")]
    ['distance (mm)', 'block size', 'P1']
    """
    words, _, unit = name.rpartition("_")
    shown = f"{words} ({_UNITS[unit]})" if words and unit in _UNITS else name
    return shown.replace("_", " ")


def short(value: Any) -> str:
    """Write a value without needless zeros.

    Parameters
    ----------
    value : float or str

    Returns
    -------
    str

    Examples
    --------
    >>> [short(value) for value in (3.0, 0.25, -0.0048, "dilation")]
    ['3', '0.25', '-0.0048', 'dilation']
    """
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _told(values: Values) -> str:
    return ", ".join(f"{label(name)} {short(value)}" for name, value in values.items())


def _control(name: str, how: Any, sentence: str) -> Any:
    from ipywidgets import Dropdown, FloatSlider, IntSlider, SelectionSlider

    look: dict[str, Any] = {"description": label(name), "tooltip": sentence, "style": {"description_width": "160px"}}
    slider = look | {"layout": {"width": "min(520px, 98%)"}}
    if isinstance(how, tuple) and len(how) == 4 and all(map(_is_number, how)):
        first, low, high, step = how
        limits = {"value": first, "min": low, "max": high, "step": step}
        if all(float(number).is_integer() for number in how):
            return IntSlider(**{key: int(number) for key, number in limits.items()}, **slider)
        return FloatSlider(**limits, readout_format=f".{max(map(_decimals, how))}f", **slider)
    pair = isinstance(how, tuple) and len(how) == 2
    choices = how[1] if pair else how
    if not isinstance(choices, list | range) or not choices or (pair and how[0] not in choices):
        raise ValueError(f"control {name!r} must be {_KINDS}, got {how!r}")
    first = how[0] if pair else choices[0]
    if all(map(_is_number, choices)):
        return SelectionSlider(options=[(short(value), value) for value in choices], value=first, **slider)
    return Dropdown(options=list(choices), value=first, **look)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _decimals(number: float) -> int:
    return len(f"{number:.6f}".rstrip("0").partition(".")[2])


def _rounded(control: Any) -> Any:
    """A control's value, without what is left over where steps are added up."""
    return round(control.value, 6) if isinstance(control.value, float) else control.value
