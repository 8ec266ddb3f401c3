"""What can be turned on the bench: each knob with its values and a sentence of help; a state of all of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeAlias

from stereolib.matching import SMOOTHING_METHODS, SGBMParams
from stereolib.notebook.sliders import short

Value: TypeAlias = float | int | str | bool
VIRTUAL, OWN, MOTORCYCLE = "virtual rig", "own pair", "motorcycle (Middlebury)"
WINDOWS = ("all disparities", "around the laser's")
BEST = "best"
MATCHERS = ("sgbm", "paper", "fast", BEST)
_MATCHER_NAMES = ("OpenCV's SGBM", "the paper's: dilates", "fast: in half size", "best: takes a second")
_PATHS = {"sgbm": "sgbm: 5 paths", "hh": "hh: 8 paths", "3way": "3way: 3 paths", "hh4": "hh4: 4 paths"}
FILTERS = ("none", *SMOOTHING_METHODS)
_FILTER_NAMES = {
    "speckle": "speckle: small patches removed",
    "background": "background: holes from behind",
    "inpaint_telea": "inpaint: holes after Telea",
    "inpaint_navier_stokes": "inpaint: holes as a flow",
    "inpaint_biharmonic": "inpaint: holes smoothly bent",
    "left_right": "left-right check, then filled",
    "weighted_median": "median guided by the picture",
    "least_squares": "least squares guided by it",
}
DILATION, KERNELS = "dilation", ("rect", "ellipse", "cross")
_SUM_LIMIT, _LEAST_ROOM = 32767, 88  # as of `SGBMParams.room`
_DECIMALS = 6  # more than any step has
_HALF_STEPS = 16  # OpenCV's search windows are multiples


@dataclass(frozen=True)
class Knob:
    """One control.

    Parameters
    ----------
    group : str
        Where it stands on the page.
    label : str
        With its unit.
    help : str
        A sentence.
    low, high, step : float
        Of a slider.
    choices : tuple
        Of a menu; empty for a slider or a switch.
    names : tuple of str
        What the page calls the choices; empty: as they are.
    """

    group: str
    label: str
    help: str
    low: float = 0.0
    high: float = 0.0
    step: float = 0.0
    choices: tuple[Value, ...] = ()
    names: tuple[str, ...] = ()

    def shown(self, value: Value) -> str:
        """Write a value as the page does.

        Parameters
        ----------
        value : float, int, str or bool

        Returns
        -------
        str

        Examples
        --------
        >>> knobs()["mode"].shown("hh")
        'hh: 8 paths'
        """
        if isinstance(value, bool):
            return "on" if value else "off"
        return self.names[self.choices.index(value)] if self.names else short(value)


def _slider(first: Value, ends: tuple[float, float, float], group: str, label: str, help: str) -> Any:
    """A slider between the first two of `ends` in steps of the third."""
    return field(default=first, metadata={"knob": Knob(group, label, help, *ends)})


def _menu(
    choices: tuple[Value, ...], first: Value, group: str, label: str, help: str, names: tuple[str, ...] = ()
) -> Any:
    return field(default=first, metadata={"knob": Knob(group, label, help, choices=choices, names=names)})


def _switch(first: bool, group: str, label: str, help: str) -> Any:
    return field(default=first, metadata={"knob": Knob(group, label, help)})


@dataclass(frozen=True)
class State:
    """All knobs of the bench at one moment; the defaults are the paper's set-up, on the virtual rig."""

    source: str = field(default=VIRTUAL, metadata={})
    # Scene
    distance_mm: float = _slider(
        700, (450, 1500, 10), "Box", "distance (mm)", "From the camera to the box's near edge."
    )
    width_mm: float = _slider(300, (60, 500, 5), "Box", "length (mm)", "Of the box, along the side that faces right.")
    depth_mm: float = _slider(300, (60, 500, 5), "Box", "width (mm)", "Of the box, along its other side.")
    height_mm: float = _slider(
        300, (40, 450, 5), "Box", "height (mm)", "Of the box: what the paper's recipe wants to read."
    )
    yaw_deg: float = _slider(
        45, (0, 90, 1), "Box", "turn (degrees)", "At 45 one vertical edge is nearest, as in the paper."
    )
    lateral_mm: float = _slider(0, (-300, 300, 5), "Box", "to the left (mm)", "How far to the left the box stands.")
    contrast: float = _slider(
        0.45, (0, 0.6, 0.05), "Box", "texture contrast", "0 is a plain box, which no matcher can match."
    )
    grain_mm: float = _slider(6, (2, 40, 1), "Box", "texture grain (mm)", "Size of the spots on the box.")
    gloss: float = _slider(0, (0, 0.95, 0.05), "Box", "gloss (0 to 1)", "Glare and mirror images on box and floor.")
    light: float = _menu(
        (1.0, 0.5, 0.2, 0.1, 0.05, 0.025, 0.012),
        1.0,
        "Cameras",
        "light (times a room's)",
        "Of a well-lit room's; 0.012 is the paper's poor light.",
    )
    noise: float = _slider(1, (0.5, 6, 0.5), "Cameras", "noise (times a webcam's)", "Of the sensors, in both cameras.")
    exposure_ev: float = _slider(
        0,
        (-1, 1, 0.1),
        "Cameras",
        "right exposure (stops)",
        "How much brighter the right picture is: two webcams never agree.",
    )
    camera_height_mm: float = _slider(
        85,
        (50, 600, 5),
        "Cameras",
        "camera height (mm)",
        "Of the left lens above the floor; the paper prints 8.5 without a unit.",
    )
    pitch_deg: float = _slider(
        8.3,
        (-25, 15, 0.1),
        "Cameras",
        "camera pitch (degrees)",
        "Upwards; with 8.3 the cube's foot stands where the paper saw it.",
    )
    baseline_mm: float = _slider(
        93, (30, 200, 1), "Cameras", "baseline (mm)", "Between the cameras. Twice the baseline, twice the disparity."
    )
    focal_px: float = _slider(
        760,
        (500, 1200, 10),
        "Cameras",
        "focal length (px)",
        "After rectification. The longer, the larger and narrower the view.",
    )
    # Calibration
    roll_deg: float = _slider(
        0,
        (-1, 1, 0.05),
        "Calibration error",
        "roll (degrees)",
        "The right camera was turned about its axis after the calibration.",
    )
    row_px: float = _slider(
        0, (-3, 3, 0.25), "Calibration error", "row offset (px)", "Rows of the two pictures disagree by so much."
    )
    baseline_pct: float = _slider(
        0, (-5, 5, 0.5), "Calibration error", "baseline (%)", "The baseline is believed longer by so much."
    )
    # Matcher
    matcher: str = _menu(
        MATCHERS,
        MATCHERS[0],
        "Matcher",
        "matcher",
        "OpenCV's with the knobs below, or one of the library's pipelines: the paper's dilates its map, fast works in "
        "half size, the best takes a second.",
        names=_MATCHER_NAMES,
    )
    window: str = _menu(
        WINDOWS, WINDOWS[0], "Matcher", "search window", "Search everything, or 8 px around what the scan predicts."
    )
    num_disparities: int = _menu(
        tuple(range(16, 257, 16)),
        160,
        "Matcher",
        "disparities searched (px)",
        "Multiples of 16; so many columns at the left have no match.",
    )
    min_disparity: int = _slider(
        0, (-16, 96, 1), "Matcher", "from disparity (px)", "Where the search begins: nothing farther away is found."
    )
    block_size: int = _menu(
        tuple(range(1, 16, 2)), 5, "Matcher", "block size (px)", "Edge of the compared blocks; large ones blur edges."
    )
    p1: int = _slider(
        8,
        (1, 60, 1),
        "Matcher",
        "P1 (per pixel of the block)",
        "Price of a step by one disparity: slanted surfaces pay it.",
    )
    p2: int = _slider(
        32,
        (2, 150, 1),
        "Matcher",
        "P2 (per pixel of the block)",
        "Price of a jump: edges pay it. Always above P1; larger blocks leave less room.",
    )
    mode: str = _menu(
        tuple(_PATHS),
        "sgbm",
        "Matcher",
        "paths",
        "Directions through the picture along which costs are added up; the names are OpenCV's.",
        names=tuple(_PATHS.values()),
    )
    uniqueness_ratio: int = _slider(
        10, (0, 40, 1), "Matcher", "uniqueness (%)", "By how much the best match must beat the second."
    )
    disp12_max_diff: int = _slider(
        1, (1, 30, 1), "Matcher", "left-right check (px)", "How far the match back may land from where it began."
    )
    speckle_window_size: int = _slider(
        100, (0, 400, 10), "Matcher", "specks below (pixels)", "Smaller patches are removed; 0 keeps all."
    )
    speckle_range: int = _slider(
        2, (1, 16, 1), "Matcher", "specks differ by (px)", "A patch ends where the disparity jumps by more."
    )
    pre_filter_cap: int = _slider(63, (1, 63, 1), "Matcher", "gradient cap", "Stronger gradients count as this one.")
    # Filter
    filter: str = _menu(
        FILTERS,
        FILTERS[0],
        "Filter",
        "filter",
        "What becomes of the map: the paper dilates it; inpainting and background fill holes, the others smooth.",
        names=tuple(_FILTER_NAMES.get(name, name) for name in FILTERS),
    )
    kernel_shape: str = _menu(
        KERNELS, KERNELS[0], "Filter", "kernel's shape", "Of the dilation: a rectangle, an ellipse or a cross."
    )
    kernel_px: int = _menu(tuple(range(3, 32, 2)), 9, "Filter", "kernel (px)", "Edge of the filter's window.")
    # Method
    tolerance_px: float = _slider(
        10,
        (0, 80, 0.5),
        "Method",
        "recipe: threshold (px)",
        "So far below the map's maximum a disparity still counts. The paper prints none.",
    )
    constant_rows: int = _slider(
        53,
        (0, 200, 1),
        "Method",
        "recipe: rows cut off",
        "Below the object, at the picture's bottom; the paper has 53.",
    )
    # Laser
    laser: bool = _switch(True, "Laser", "laser on", "Without it the pictures measure alone.")
    turns: int = _slider(5, (1, 30, 1), "Laser", "turns averaged", "The median of so many turns.")
    laser_noise: float = _slider(1, (0, 6, 0.5), "Laser", "noise (times an XV-11's)", "Of each reading.")
    laser_yaw_deg: float = _slider(
        0, (-5, 5, 0.25), "Laser", "turned by (degrees)", "The laser was turned, and nobody told the program."
    )
    laser_ahead_mm: float = _slider(
        0, (-50, 50, 5), "Laser", "moved forward by (mm)", "The laser was moved, and nobody told the program."
    )
    #: Paths of an own pair: left, right, calibration, scan; the last two may be empty.
    own: tuple[str, ...] = field(default=(), metadata={})
    #: Computed in half size, for a preview.
    half: bool = field(default=False, metadata={})

    @property
    def colors_px(self) -> tuple[int, int]:
        """Where the colours of a map begin and end: no surface has less than 0 px."""
        least, most = self.min_disparity, self.min_disparity + self.num_disparities
        return (max(0, least) if most > 0 else least), most

    @property
    def sgbm(self) -> SGBMParams:
        """The matcher's settings; in half size with half the window."""
        area, scale = self.block_size**2, 2 if self.half else 1
        return SGBMParams(
            num_disparities=-(-self.num_disparities // scale // _HALF_STEPS) * _HALF_STEPS,
            block_size=self.block_size,
            min_disparity=self.min_disparity // scale,
            p1=self.p1 * area,
            p2=max(self.p1 + 1, min(self.p2, most_p2(self.block_size))) * area,
            disp12_max_diff=self.disp12_max_diff,
            uniqueness_ratio=self.uniqueness_ratio,
            speckle_window_size=self.speckle_window_size // scale**2,
            speckle_range=self.speckle_range,
            pre_filter_cap=self.pre_filter_cap,
            mode=self.mode,
        )


def most_p2(block_size: int) -> int:
    """Largest P2 per pixel of a block that OpenCV's 16 bits leave room for.

    Parameters
    ----------
    block_size : int, px

    Returns
    -------
    int
    """
    return min(150, _SUM_LIMIT // block_size**2 - _LEAST_ROOM)


def knobs() -> Mapping[str, Knob]:
    """All knobs by the name of their field, in the order of the page.

    Returns
    -------
    mapping of str to Knob
    """
    return {one.name: one.metadata["knob"] for one in fields(State) if one.metadata}


def on_step(name: str, value: Value) -> Value:
    """Put a slider's value onto the nearest of its steps: browsers are off by what binary fractions cannot hold.

    Parameters
    ----------
    name : str
        Of the knob.
    value : float, int, str or bool
        One that is no slider's comes back as it is.

    Returns
    -------
    float, int, str or bool

    Examples
    --------
    >>> on_step("pitch_deg", 8.299999999999997)
    8.3
    """
    knob = knobs()[name]
    if not knob.step or isinstance(value, str):
        return value
    return type(value)(round(knob.low + round((value - knob.low) / knob.step) * knob.step, _DECIMALS))


def to_text(state: State) -> str:
    """Write what differs from the paper's set-up.

    Parameters
    ----------
    state : State

    Returns
    -------
    str

    Examples
    --------
    >>> to_text(State(distance_mm=800, filter="dilation"))
    'distance_mm=800; filter=dilation'
    """
    first = State()
    changed = ((f.name, getattr(state, f.name)) for f in fields(State) if f.name not in ("half", "own"))
    return "; ".join(f"{name}={short(value)}" for name, value in changed if value != getattr(first, name))


def from_text(text: str) -> State:
    """Read a state that `to_text` wrote; what lies between two steps of a slider goes to the nearer one.

    Parameters
    ----------
    text : str

    Returns
    -------
    State

    Raises
    ------
    ValueError
        If a part is no ``name=value``, there is no such knob, or it has no such value.

    Examples
    --------
    >>> from_text("distance_mm=800; filter=dilation").distance_mm
    800
    """
    state = State()
    for part in filter(None, (part.strip() for part in text.split(";"))):
        name, equals, value = (word.strip() for word in part.partition("="))
        if not equals:
            raise ValueError(f'"{part}" is no "knob=value"; parts are separated by semicolons')
        if name == "source":
            state = replace(state, source=value)
        elif name in knobs():
            changed: dict[str, Any] = {name: _read(name, value)}
            state = replace(state, **changed)
        else:
            raise ValueError(f'there is no knob "{name}"; knobs are {", ".join(knobs())}')
    return state


def _read(name: str, text: str) -> Value:
    """Value of a knob, checked against what the page offers."""
    knob, first = knobs()[name], getattr(State(), name)
    if isinstance(first, bool):
        if text not in ("True", "False"):
            raise ValueError(f'{name} must be True or False, got "{text}"')
        return text == "True"
    if isinstance(first, str):
        if text not in knob.choices:
            raise ValueError(f'{name} must be one of {", ".join(map(str, knob.choices))}, got "{text}"')
        return text
    try:
        value = type(first)(text) if isinstance(first, int) and not knob.step % 1 else float(text)
    except ValueError:
        raise ValueError(f'{name} must be a number, got "{text}"') from None
    offered = value in knob.choices if knob.choices else knob.low <= value <= knob.high
    if not (offered and math.isfinite(value)):
        values = ", ".join(map(short, knob.choices)) if knob.choices else f"{knob.low:g} to {knob.high:g}"
        raise ValueError(f"{name} must be one of {values}" if knob.choices else f"{name} must be {values}, got {text}")
    return on_step(name, value)
