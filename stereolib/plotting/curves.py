"""Curves, dots and bars."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb

from stereolib.base import Floats
from stereolib.plotting.style import COLORS, LINE_STYLES, default_style

_ROOM_PCT = 4.0  # of a bar's length, which a number takes


@default_style
def plot_curves(
    curves: Mapping[str, tuple[Any, ...]],
    ax: Axes,
    *,
    xlabel: str,
    ylabel: str,
    marker: str = "o",
    joined: bool = True,
    **axes: Any,
) -> Axes:
    """Draw named curves, each with its own colour and line style, or dots.

    Parameters
    ----------
    curves : mapping of str to (x, y) or (x, y, color)
        Numbers are drawn in single precision: matplotlib leaves out points where a path hardly bends, and would leave
        out others where another processor's kernels change the last bit of a double.
    ax : matplotlib.axes.Axes
    xlabel, ylabel : str
        With units.
    marker : str
    joined : bool
        Draw lines between the markers.
    **axes
        Title and limits of the axes; ``legend`` is where the names stand, as matplotlib calls it. Of long curves it
        should be said: to look for the best place takes time.

    Returns
    -------
    matplotlib.axes.Axes
    """
    for k, (name, (x, y, *color)) in enumerate(curves.items()):
        style: dict[str, Any] = {
            "color": color[0] if color else COLORS[k % len(COLORS)],
            "ls": LINE_STYLES[k % len(LINE_STYLES)] if joined else "",
        }
        ax.plot(_single(x), _single(y), marker=marker, ms=4, lw=1.4, label=name, **style)
    ax.grid(alpha=0.3)
    place = axes.pop("legend", "best")
    ax.set(xlabel=xlabel, ylabel=ylabel, **axes)
    if len(curves) > 1:
        ax.legend(frameon=False, fontsize=9, loc=place)
    return ax


@default_style
def plot_dots(x: Floats, y: Floats, ax: Axes, *, color: Floats, label: str, title: str = "", **axes: Any) -> Axes:
    """Draw dots, a third quantity as their colour.

    Parameters
    ----------
    x, y : (N,) float
    ax : matplotlib.axes.Axes
    color : (N,) float
        The third quantity.
    label : str
        Its name and unit.
    title : str
    **axes
        Labels with units, and limits.

    Returns
    -------
    matplotlib.axes.Axes
    """
    dots = ax.scatter(x, y, c=color, s=28, cmap="viridis", edgecolors="0.3", lw=0.4)
    if ax.figure is not None:
        ax.figure.colorbar(dots, ax=ax, label=label, shrink=0.85)
    ax.grid(alpha=0.3)
    ax.set(title=title, **axes)
    return ax


@default_style
def plot_bars(counts: Mapping[str, int], ax: Axes, *, xlabel: str, title: str = "") -> Axes:
    """Draw horizontal bars, one a name, the number at its end.

    Parameters
    ----------
    counts : mapping of str to int
    ax : matplotlib.axes.Axes
    xlabel : str
    title : str

    Returns
    -------
    matplotlib.axes.Axes
    """
    bars = ax.barh(list(counts), list(counts.values()), color=COLORS[0])
    ax.bar_label(bars, padding=3)
    ax.invert_yaxis()
    ax.set(xlabel=xlabel, title=title)
    ax.margins(x=0.1)
    return ax


@default_style
def plot_shares(
    shares: Mapping[str, Mapping[str, float]],
    ax: Axes,
    colors: Mapping[str, str],
    *,
    xlabel: str,
    ends: Mapping[str, str] | None = None,
) -> Axes:
    """Draw what wholes are made of: a horizontal bar for each, its parts one after the other.

    Parameters
    ----------
    shares : mapping of str to mapping of str to float
        A bar's name to its parts, from left to right; bars from top to bottom.
    ax : matplotlib.axes.Axes
    colors : mapping of str to str
        A part's name to its colour, in the legend's order.
    xlabel : str
    ends : mapping of str to str, optional
        What stands at the end of a bar, for example of how many these are the shares. With it every part that has
        room for it has its number written in it.

    Returns
    -------
    matplotlib.axes.Axes
    """
    begins = np.zeros(len(shares))
    for part, color in colors.items():
        widths = np.array([one[part] for one in shares.values()])
        bars = ax.barh(list(shares), widths, left=begins, color=color, label=part, edgecolor="white", lw=0.5)
        if ends is not None:
            written = [f"{width:.0f}" if width >= _ROOM_PCT else "" for width in widths]
            ink = "black" if sum(to_rgb(color)) > 1.8 else "white"
            ax.bar_label(bars, written, label_type="center", color=ink, fontsize=8)
        begins = begins + widths
    for k, name in enumerate(shares if ends else ()):
        frames: Any = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
        ax.annotate((ends or {})[name], xy=(1, k), xytext=(4, 0), va="center", fontsize=9, **frames)
    ax.invert_yaxis()
    ax.set(xlabel=xlabel, xlim=(0, float(begins.max())))
    ax.legend(frameon=False, fontsize=9, ncols=len(colors), loc="lower center", bbox_to_anchor=(0.45, 1.0))
    return ax


def _single(values: Any) -> npt.NDArray[Any]:
    array = np.asarray(values)
    return array.astype(np.float32) if array.dtype.kind == "f" else array
