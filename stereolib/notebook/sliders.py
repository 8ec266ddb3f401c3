"""Sliders for notebooks: a function of a few numbers, its picture, and a line of text."""

from __future__ import annotations

import base64
from collections.abc import Callable
from html import escape
from typing import Any, TypeAlias

import cv2

from stereolib.base import UInt8

#: Takes the controls by name; returns a picture, (H, W, 3) uint8 blue-green-red, and a line of text.
Drawing: TypeAlias = Callable[..., tuple[UInt8, str]]


class Explorer:
    """Sliders over a picture, made by `explore`; readers of a static page see the picture of the first values.

    Parameters
    ----------
    draw : callable
    controls : dict of str to ipywidgets control
    """

    def __init__(self, draw: Drawing, controls: dict[str, Any]) -> None:
        from ipywidgets import HTML, HBox, Image, VBox

        self._draw, self._controls = draw, controls
        self._picture, self._text = Image(format="jpeg"), HTML()
        for control in controls.values():
            control.observe(lambda _: self._update(), names="value")
        self._update()
        self._box = VBox([HBox([VBox(list(controls.values()))]), self._text, self._picture])

    def _update(self) -> None:
        try:
            image, text = self._draw(**{name: control.value for name, control in self._controls.items()})
        except ValueError as error:  # a setting that the library refuses: say why, keep the last picture
            self.text = f"not possible: {error}"
            self._text.value = f"<b>not possible:</b> {escape(str(error))}"
            return
        self.text = text
        self._picture.value = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 80])[1].tobytes()
        self._text.value = text

    def _repr_mimebundle_(self, **keywords: Any) -> dict[str, Any]:
        bundle = self._box._repr_mimebundle_(**keywords) or {}
        data = bundle[0] if isinstance(bundle, tuple) else bundle
        return {
            **data,
            "image/jpeg": base64.b64encode(self._picture.value).decode(),
            "text/plain": self.text,
        }


def explore(draw: Drawing, **controls: tuple[float, float, float, float] | list[Any]) -> Explorer:
    """Make sliders for a function.

    Parameters
    ----------
    draw : callable
        Takes the controls by name; returns (picture (H, W, 3) uint8 blue-green-red, text).
    **controls
        ``name=(first, lowest, highest, step)`` makes a slider, ``name=["a", "b"]`` a choice. Underscores in names
        are shown as blanks.

    Returns
    -------
    Explorer

    Raises
    ------
    ValueError
        If a control is neither.
    """
    from ipywidgets import Dropdown, FloatSlider, IntSlider

    made: dict[str, Any] = {}
    for name, how in controls.items():
        look = {"description": name.replace("_", " "), "style": {"description_width": "140px"}}
        if isinstance(how, list) and how:
            made[name] = Dropdown(options=how, value=how[0], **look)
        elif isinstance(how, tuple) and len(how) == 4:
            first, low, high, step = how
            whole = all(isinstance(number, int) for number in how)
            slider = IntSlider if whole else FloatSlider
            look["layout"] = {"width": "480px"}
            made[name] = slider(value=first, min=low, max=high, step=step, continuous_update=False, **look)
        else:
            raise ValueError(
                f"control {name!r} must be (first, lowest, highest, step) or a list of choices, got {how!r}"
            )
    return Explorer(draw, made)
