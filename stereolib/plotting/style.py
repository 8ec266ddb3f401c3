"""How figures look: colours, sizes, and matplotlib's own defaults whatever the user's matplotlibrc says."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import matplotlib.style
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

DPI = 150
#: Colours that differ in print too (Okabe and Ito 2008), the first for what is ours, the second for the paper's.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
#: What a colour means in every figure: what is true, what the paper's recipe says, what we say, what the laser says, a
#: rival, and what is refused or unknown. They differ for the colour-blind and, in this order, in brightness too.
TRUTH, PAPER, OURS, LASER, RIVAL, REFUSED = "#000000", "#D55E00", "#0072B2", "#009E73", "#E69F00", "#8c8c8c"
LINE_STYLES = ("-", "--", "-.", ":")
BGR_BLUE, BGR_VERMILLION, BGR_ORANGE, BGR_SKY = (178, 114, 0), (0, 94, 213), (0, 159, 230), (233, 180, 86)
NOTHING_GREY = "#d9d9d9"  # where a map holds no value
GREY_NONE = "; grey: none"  # said beside the key of the colours where that occurs
_PAD_IN = 0.08  # round each panel: a label touches neither its neighbour nor the border
_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


def default_style(draw: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Make a function draw with matplotlib's defaults; the user's settings are as before when it returns.

    Parameters
    ----------
    draw : callable

    Returns
    -------
    callable
    """

    @functools.wraps(draw)
    def drawn(*arguments: _Arguments.args, **keywords: _Arguments.kwargs) -> _Result:
        with matplotlib.style.context("default"):
            return draw(*arguments, **keywords)

    return drawn


def as_written(name: str) -> str:
    """Make a file's or a station's name fit for a figure, in which dollars begin a formula.

    Parameters
    ----------
    name : str

    Returns
    -------
    str

    Examples
    --------
    >>> print(as_written("price_$5_$6.bin"))
    price_\\$5_\\$6.bin
    """
    return name.encode("utf-8", "backslashreplace").decode("utf-8").replace("$", r"\$")


@default_style
def panels(columns: int, rows: int = 1, *, width_in: float = 10.0, aspect: float = 0.75, **subplots: Any) -> Any:
    """Make a figure of equal panels.

    Parameters
    ----------
    columns, rows : int
    width_in : float
        Width of the figure, inches.
    aspect : float
        Height over width of one panel.
    **subplots
        Further keywords of `matplotlib.figure.Figure.subplots`.

    Returns
    -------
    figure : matplotlib.figure.Figure
    axes : (rows * columns,) array of matplotlib.axes.Axes

    Examples
    --------
    >>> figure, axes = panels(2, width_in=8, aspect=0.5)
    >>> len(axes), figure.get_size_inches().tolist()
    (2, [8.0, 2.0])
    """
    figure = Figure(figsize=(width_in, width_in / columns * aspect * rows), dpi=DPI)
    figure.set_layout_engine("constrained", w_pad=_PAD_IN, h_pad=_PAD_IN)
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False, **subplots).ravel()


def image_axes(size: tuple[int, int], ax: Axes, title: str) -> Axes:
    """Give axes the frame of an image, in pixels.

    Parameters
    ----------
    size : (width, height), px
    ax : matplotlib.axes.Axes
    title : str

    Returns
    -------
    matplotlib.axes.Axes
    """
    width, height = size
    ax.set(title=title, xlabel="column (px)", ylabel="row (px)", aspect="equal")
    ax.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    return ax
