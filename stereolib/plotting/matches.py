"""What a matcher weighs, and what comes of it: costs over the disparity, maps below the pictures they came from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from stereolib.base import Bools, Floats, Ints, UInt8
from stereolib.plotting.gallery import Exhibit, plot_gallery
from stereolib.plotting.pictures import plot_image
from stereolib.plotting.quantities import key_ends, plot_disparity
from stereolib.plotting.style import GREY_NONE, OURS, TRUTH, default_style, panels

_BGR_MARKED, _BGR_MENDED = (200, 0, 230), (60, 200, 0)
_SIDES = {"left": "#56B4E9", "right": "#CC79A7"}  # colours that mean nothing else
_WIDTH_IN, _FONT_PT = 6.0, 8  # more than 7 pt where it is printed 16 cm wide
_PALE = ListedColormap(colormaps["Greys"](np.linspace(0, 0.6, 256)))  # white is cheap; lines stand out on the rest


@default_style
def plot_pixel_cost(costs: Floats | Ints, true_px: float, ax: Axes, title: str = "", *, ylabel: str = "cost") -> Axes:
    """Draw what each disparity would cost a pixel, the cheapest one and the true one.

    Parameters
    ----------
    costs : (D,) array
        Cost of the disparities 0, 1, 2, ...
    true_px : float, px
    ax : matplotlib.axes.Axes
    title : str
    ylabel : str
        What the cost is counted in.

    Returns
    -------
    matplotlib.axes.Axes
    """
    cheapest = int(np.argmin(costs))
    ax.axvline(true_px, color=TRUTH, ls="--", lw=1.2, label="true disparity")
    ax.plot(np.arange(len(costs)), costs, color="0.45", lw=1.2)
    ax.plot(cheapest, costs[cheapest], "o", color=OURS, ms=7, label="cheapest")
    ax.grid(alpha=0.3)
    high = np.max(costs)
    ax.set(title=title, xlabel="disparity d (px)", ylabel=ylabel, ylim=(-0.05 * high, 1.35 * high))
    ax.legend(fontsize=_FONT_PT, loc="upper right")
    return ax


@default_style
def plot_row_cost(costs: Floats | Ints, true_px: Floats, ax: Axes, title: str = "", *, label: str = "cost") -> Any:
    """Draw the costs of a whole row of a picture: cheap is white, with the cheapest disparity and the true one.

    Parameters
    ----------
    costs : (W, D) array
        Of every column, for the disparities 0, 1, 2, ...; the first D columns, which have no partner for some, are
        left out.
    true_px : (W,) float, px
    ax : matplotlib.axes.Axes
    title : str
    label : str
        What the cost is counted in.

    Returns
    -------
    matplotlib.image.AxesImage
    """
    width, count = costs.shape
    seen, columns = costs[count:], np.arange(count, width)
    dearest = float(np.percentile(seen, 90))
    frame = (count - 0.5, width - 0.5, -0.5, count - 0.5)
    look: dict[str, Any] = {"cmap": _PALE, "vmin": seen.min(), "vmax": dearest, "interpolation": "nearest"}
    shown = ax.imshow(seen.T, origin="lower", aspect="auto", extent=frame, **look)
    ax.plot(columns, true_px[count:], color="white", lw=5, label="_under the truth")
    ax.plot(columns, seen.argmin(axis=1), ".", color=OURS, ms=4, label="cheapest")
    ax.plot(columns, true_px[count:], color=TRUTH, lw=1.2, label="true")
    ax.set(title=title, xlabel="column (px)", ylabel="disparity d (px)", xlim=frame[:2], ylim=frame[2:])
    ax.legend(fontsize=_FONT_PT, loc="upper right", framealpha=0.9, markerscale=2)
    if ax.figure is not None:
        ax.figure.colorbar(shown, ax=ax, label=label, pad=0.01, extend=key_ends(seen, shown))
    return shown


@default_style
def plot_cost_cells(costs: Ints, true_px: Ints, ax: Axes, title: str = "") -> Axes:
    """Draw the costs of a short row as cells with their numbers: a ring is each pixel's cheapest, a square the truth.

    Parameters
    ----------
    costs : (W, D) int
        Of every pixel, for the disparities 0, 1, 2, ...
    true_px : (W,) int, px
    ax : matplotlib.axes.Axes
    title : str

    Returns
    -------
    matplotlib.axes.Axes
    """
    pixels = np.arange(len(costs))
    ax.imshow(costs.T, origin="lower", cmap=_PALE, interpolation="nearest")
    for (pixel, disparity), cost in np.ndenumerate(costs):
        ax.text(pixel, disparity, f"{cost:g}", ha="center", va="center", fontsize=10)
    ax.plot(pixels, true_px, "s", ms=25, mfc="none", mec=TRUTH, mew=1.2, label="true")
    ax.plot(pixels, costs.argmin(axis=1), "o", ms=19, mfc="none", mec=OURS, mew=2.2, label="cheapest")
    ax.set(title=title, xlabel="pixel of the row", ylabel="disparity d (px)", xticks=pixels + 0.0)
    ax.set(xticklabels=pixels + 1, yticks=np.arange(costs.shape[1]))
    return ax


@default_style
def plot_row_pair(
    left: UInt8, right: UInt8, row: int, columns_px: tuple[float, float], title: str = "", *, first_row: int = 0
) -> Figure:
    """Draw two strips with a ringed speck in each, and the grey values of the row in which both lie.

    Parameters
    ----------
    left, right : (H, W) uint8
    row : int
        Of the strips.
    columns_px : (left, right), px
        Where the speck is.
    title : str
        What the strips are.
    first_row : int
        Of the pictures, with which the strips begin.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure: Figure
    figure, axes = panels(1, 4, width_in=_WIDTH_IN, aspect=0.19)
    for ax, below, name, strip, column in zip(axes, axes[2:], _SIDES, (left, right), columns_px, strict=False):
        plot_image(strip, ax, f"{name} picture, {title}").set(xlabel="", ylabel="row (px)")
        height, width = strip.shape
        frame = (-0.5, width - 0.5, first_row + height - 0.5, first_row - 0.5)
        ax.images[0].set_extent(frame)
        ax.set(xlim=frame[:2], ylim=frame[2:])
        ax.axhline(first_row + row, color=_SIDES[name], lw=1)
        ax.plot(column, first_row + row, "o", ms=18, mfc="none", mec=_SIDES[name], mew=3)
        below.plot(strip[row], color=_SIDES[name], lw=1.4, label=name)
        below.set(ylabel=f"grey, {name}", xlim=(0, left.shape[1] - 1), ylim=(30, 215))
        for each in columns_px:
            below.axvline(each, color=TRUTH, lw=0.8, ls=":")
        below.grid(alpha=0.3)
    ends = dict(zip(("xytext", "xy"), ((column, 50) for column in columns_px), strict=True))
    axes[3].annotate("", **ends, arrowprops={"arrowstyle": "->", "color": TRUTH, "lw": 2, "shrinkA": 0, "shrinkB": 0})
    axes[3].text(columns_px[0] + 6, 50, "d", color=TRUTH, fontsize=12, va="center")
    axes[3].set_xlabel("column (px)")
    return figure


@default_style
def plot_strips(strips: Mapping[str, Floats], *, first: int, high: float) -> Figure:
    """Draw strips of disparity below each other, with one key of the colours.

    Parameters
    ----------
    strips : mapping of str to (H, W) float, px
    first : int
        Column where the drawing begins.
    high : float, px
        Where the colours end.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure: Figure
    figure, axes = panels(1, len(strips), width_in=_WIDTH_IN, aspect=0.18, sharex=True)
    for ax, (name, strip) in zip(axes, strips.items(), strict=True):
        shown = plot_disparity(strip, ax, name, high=high, bar=False)
        ax.set(xlabel="", ylabel="", yticks=[], xlim=(first, strip.shape[1] - 1))
    axes[-1].set_xlabel("column (px)")
    grey = GREY_NONE if any(np.isnan(strip[:, first:]).any() for strip in strips.values()) else ""
    figure.colorbar(shown, ax=list(axes), label=f"disparity (px){grey}", pad=0.01)
    return figure


def mark_pixels(image: UInt8, where: Bools, mended: Bools | None = None) -> UInt8:
    """Colour some pixels of a picture, in a colour that photographs seldom have.

    Parameters
    ----------
    image : (H, W, 3) uint8, blue-green-red
    where : (H, W) bool
    mended : (H, W) bool, optional
        Pixels that get green instead.

    Returns
    -------
    (H, W, 3) uint8, blue-green-red

    Examples
    --------
    >>> mark_pixels(np.zeros((1, 2, 3), np.uint8), np.array([[True, False]])).tolist()
    [[[200, 0, 230], [0, 0, 0]]]
    """
    marked = image.copy()
    marked[where] = _BGR_MARKED
    if mended is not None:
        marked[mended] = _BGR_MENDED
    return marked


def plot_matched(
    pictures: Mapping[str, UInt8],
    maps: Mapping[str, Floats],
    notes: Mapping[str, str] | None = None,
    *,
    high: float,
    title: str = "virtual rig",
    columns: int | None = None,
) -> Figure:
    """Draw pictures in a row, the maps matched from them below, and one key of the colours for all maps.

    Parameters
    ----------
    pictures : mapping of str to (H, W) or (H, W, 3) uint8
        Left pictures by the name above each.
    maps : mapping of str to (H, W) float, px
        Under the same names.
    notes : mapping of str to str, optional
        What stands below a map.
    high : float, px
        Where the colours end.
    title : str
        Above all.
    columns : int, optional
        Pairs beside each other, by default all; those that follow begin a new block.

    Returns
    -------
    matplotlib.figure.Figure
    """
    told = notes or {}
    exhibits = [Exhibit(name, (pictures[name], found), told.get(name, "")) for name, found in maps.items()]
    rows = {"picture": "photo", "map": "disparity"}  # short: strips are low
    return plot_gallery(exhibits, rows, columns=columns or len(maps), disparity_px=(0.0, high), title=title)
