"""Quantities over an image: disparity, depth and others in colours, small errors as arrows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.patches import Rectangle
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullLocator

from stereolib.base import Bools, Float64, Floats, Ints, UInt8
from stereolib.plotting.style import COLORS, GREY_NONE, NOTHING_GREY, default_style, image_axes

_LONGEST_CELLS = 2  # of the arrow of one error
_APART = 0.12  # of the image's width, between the labels of lines
_EVEN_STEPS = 3.0  # colours whose ends are nearer than this ratio are cut at even steps, others at 1, 2, 5, 10 ...
_TICKS_APART = 1.15  # at least, of the smallest value and the first round one
_LOG_RANGE = 1000.0  # logarithmic colours end there, in units of the smallest value


@default_style
def plot_disparity(
    disparity_px: Floats, ax: Axes, title: str = "", *, low: float = 0, high: float | None = None, bar: bool = True
) -> Any:
    """Draw a disparity map; what was not matched is light grey.

    Parameters
    ----------
    disparity_px : (H, W) float, px
    ax : matplotlib.axes.Axes
    title : str
    low, high : float
        Ends of the colours, px; None ends them at the largest disparity.
    bar : bool
        Draw the key of the colours.

    Returns
    -------
    matplotlib.image.AxesImage
    """
    return _plot_map(disparity_px, ax, title, (low, high), "viridis", "disparity (px)" if bar else "")


@default_style
def plot_depth(depth_mm: Floats, ax: Axes, title: str = "", *, low: float = 0, high: float | None = None) -> Any:
    """Draw a depth map with the key of its colours, near ones bright; where there is no depth it is light grey.

    Parameters
    ----------
    depth_mm : (H, W) float, mm
    ax : matplotlib.axes.Axes
    title : str
    low, high : float
        Ends of the colours, mm; None ends them at the largest depth.

    Returns
    -------
    matplotlib.image.AxesImage
    """
    return _plot_map(depth_mm, ax, title, (low, high), "viridis_r", "depth (mm)")


def _plot_map(values: Floats, ax: Axes, title: str, limits: tuple[float, float | None], colors: str, label: str) -> Any:
    cmap = colormaps[colors].with_extremes(bad=NOTHING_GREY)
    low, high = limits
    shown = ax.imshow(np.ma.masked_invalid(values), cmap=cmap, vmin=low, vmax=high, interpolation="nearest")
    ax.set(title=title, xlabel="column (px)", ylabel="row (px)")
    if label and ax.figure is not None:
        _bar(shown, values, ax, label)
    return shown


def key_ends(known: Floats | Ints, shown: Any) -> str:
    """Which ends of a map's key are pointed, as `extend` of a colour bar: those beyond which values lie."""
    low, high = shown.get_clim()
    beyond = bool((known < low).any()), bool((known > high).any())
    return {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}[beyond]


def _bar(shown: Any, values: Floats, ax: Axes, label: str) -> None:
    """The key of a map's colours, as tall as the map, pointed where values lie beyond its end."""
    known = np.asarray(values)[np.isfinite(values)]
    grey = GREY_NONE if known.size < np.size(values) else ""
    place = ax.inset_axes((1.04, 0.0, 0.05, 1.0))
    assert ax.figure is not None
    ax.figure.colorbar(shown, cax=place, label=label + grey, extend=key_ends(known, shown))


@default_style
def plot_errors(error_px: Floats, ax: Axes, title: str = "", *, limit: float = 4) -> Axes:
    """Draw signed disparity errors, blue too far, red too near; not matched is light grey.

    Parameters
    ----------
    error_px : (H, W) float, px
    ax : matplotlib.axes.Axes
    title : str
    limit : float
        Where the colours end, px.

    Returns
    -------
    matplotlib.axes.Axes
    """
    colors = colormaps["RdBu_r"].with_extremes(bad=NOTHING_GREY)
    shown = ax.imshow(np.ma.masked_invalid(error_px), cmap=colors, vmin=-limit, vmax=limit, interpolation="nearest")
    ax.set(title=title, xlabel="column (px)", ylabel="row (px)")
    if ax.figure is not None:
        _bar(shown, error_px, ax, "error (px)")
    return ax


@default_style
def plot_arrows(
    at_px: Floats, arrows_px: Floats, size: tuple[int, int], ax: Axes, title: str = "", *, cells: int = 12
) -> Axes:
    """Draw small errors on an image as magnified arrows: each one grey, their means over cells in colour.

    Arrows of chance point everywhere and their means vanish; what a lens model misses stays. A grey arrow is drawn no
    longer than two cells, and room is left for those that point out of the image.

    Parameters
    ----------
    at_px : (..., 2) float, px
        Where the errors are.
    arrows_px : (..., 2) float, px
        The errors; NaN are left out.
    size : (width, height), px
    ax : matplotlib.axes.Axes
    title : str
    cells : int
        Columns of cells over which the means are taken.

    Returns
    -------
    matplotlib.axes.Axes
    """
    at, arrows = np.reshape(at_px, (-1, 2)).astype(float), np.reshape(arrows_px, (-1, 2))
    finite = np.isfinite(arrows).all(axis=1)
    at, arrows = at[finite], arrows[finite]
    cell = size[0] / cells
    key = max(float(np.sqrt(np.mean(arrows**2))), 1e-9) if len(arrows) else 1.0
    unit = float(f"{key:.0e}")  # one digit
    how: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.6 * key / cell}
    most = _LONGEST_CELLS * 1.6 * key
    shown = arrows * np.minimum(1, most / np.maximum(np.hypot(*arrows.T), 1e-9))[:, None]
    ax.quiver(*at.T, *shown.T, color="0.8", width=0.0012, **how)
    _, which = np.unique(np.floor(at / cell).astype(int), axis=0, return_inverse=True)
    count = np.bincount(which.ravel())
    enough = count >= 5
    means = [np.bincount(which.ravel(), v)[enough] / count[enough] for v in (*at.T, *arrows.T)]
    drawn = ax.quiver(*means, color=COLORS[1], width=0.004, **how)
    ax.quiverkey(drawn, 0.86, 1.03, unit, f"{unit:g} px", labelpos="E", coordinates="axes")
    image_axes(size, ax, title)
    ends = np.concatenate([at + shown / how["scale"], np.array([[0, 0], size])])
    (left, top), (right, bottom) = ends.min(axis=0), ends.max(axis=0)
    ax.add_patch(Rectangle((-0.5, -0.5), *size, fill=False, ec="0.4", lw=0.8))
    ax.set(xlim=(min(left, -0.5), max(right, size[0] - 0.5)), ylim=(max(bottom, size[1] - 0.5), min(top, -0.5)))
    return ax


@dataclass(frozen=True, eq=False)
class ImageQuantity:
    """A quantity over an image, on a grid of pixels.

    Parameters
    ----------
    values : (h, w) float or int
        NaN is drawn light grey.
    columns_px, rows_px : (w,), (h,) float or int, px
        Where the values are.
    size : (width, height), px
        Of the image.
    label : str
        The quantity's unit, or name and unit.
    unseen : bool, on any grid over the image, optional
        What is hatched.
    """

    values: Floats | Ints
    columns_px: Floats | Ints
    rows_px: Floats | Ints
    size: tuple[int, int]
    label: str
    unseen: Bools | None = None


@default_style
def plot_quantity(
    quantity: ImageQuantity,
    ax: Axes,
    title: str = "",
    *,
    lines: bool = True,
    high: float | None = None,
    log: bool = False,
) -> Axes:
    """Draw a quantity over an image in colours.

    Parameters
    ----------
    quantity : ImageQuantity
    ax : matplotlib.axes.Axes
    title : str
    lines : bool
        Draw labelled contour lines as well.
    high : float, optional
        Where the colours end; by default at the largest twentieth, which would leave the rest without contrast.
    log : bool
        Logarithmic colours from the smallest value to the largest one, both positive, so that a rim of large values
        and the even middle are both told apart; `high` then has no meaning.

    Returns
    -------
    matplotlib.axes.Axes
    """
    shown = np.ma.masked_invalid(quantity.values)
    ax.set_facecolor(NOTHING_GREY)
    if shown.count():
        low, most = np.percentile(shown.compressed(), [0, 95])
        high = float(most) if high is None or not np.isfinite(high) else high
        levels = np.asarray(MaxNLocator(4).tick_values(low, high))[1:-1]  # round numbers
        how: dict[str, Any] = {"vmin": low, "vmax": high}
        if log and low > 0:
            high = min(float(shown.max()), _LOG_RANGE * low)
            levels, how = _round_levels(low, high), {"norm": LogNorm(low, high)}
        mesh = ax.pcolormesh(quantity.columns_px, quantity.rows_px, shown, cmap="viridis", shading="nearest", **how)
        if ax.figure is not None:
            ends_early = "max" if not log or shown.max() > high else "neither"
            bar = ax.figure.colorbar(mesh, ax=ax, label=quantity.label, shrink=0.85, extend=ends_early)
            if "norm" in how:
                ticks = [low, *levels[levels > _TICKS_APART * low]]
                bar.ax.yaxis.set(major_locator=FixedLocator(ticks), minor_locator=NullLocator())
                bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.2g}"))
        if lines and high > low and min(shown.shape) > 1:
            drawn = ax.contour(
                quantity.columns_px, quantity.rows_px, shown, levels=levels, colors="white", linewidths=0.8
            )
            _label_lines(drawn, ax, _APART * quantity.size[0])
    unseen = quantity.unseen
    if unseen is not None and unseen.any():
        hatch(unseen, quantity.size, ax)
        nothing = np.ma.masked_where(~np.ma.getmaskarray(shown), np.zeros(shown.shape))
        grey = ListedColormap([NOTHING_GREY])  # no hatches where there is no value
        ax.pcolormesh(quantity.columns_px, quantity.rows_px, nothing, cmap=grey, shading="nearest", zorder=1.5)
    return image_axes(quantity.size, ax, title)


def _round_levels(low: float, high: float) -> Float64:
    """Round numbers between the ends of logarithmic colours."""
    if high < _EVEN_STEPS * low:
        levels = np.asarray(MaxNLocator(4).tick_values(low, high))
    else:
        powers = np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
        levels = (10.0 ** powers[:, None] * np.array([1.0, 2.0, 5.0])).ravel()
    return levels[(levels > low) & (levels < high)]


def _label_lines(drawn: Any, ax: Axes, apart_px: float) -> None:
    """Write their values onto contour lines, and leave out those that would lie over another one."""
    written: list[tuple[float, float]] = []
    for text in ax.clabel(drawn, fontsize=8, fmt="%g", colors="black"):
        x, y = text.get_position()
        if any(np.hypot(x - u, y - v) < apart_px for u, v in written):
            text.remove()
            continue
        written.append((x, y))
        text.set_bbox({"facecolor": "white", "alpha": 0.75, "lw": 0, "pad": 0.6})


def hatch(where: Bools, size: tuple[int, int], ax: Axes) -> None:
    """Hatch a part of a drawn image.

    Parameters
    ----------
    where : (R, C) bool
        Any part of it; R and C need not be the image's.
    size : (int, int)
        Width and height of the image, px.
    ax : matplotlib.axes.Axes
    """
    edges = (np.linspace(0, n - 1, k) for n, k in zip(size, where.shape[::-1], strict=True))
    area = ax.contourf(*edges, where.astype(float), levels=[0.5, 1.5], colors="none", hatches=["///"])
    area.set(edgecolor="#808080", linewidth=0)


def color_disparity(disparity_px: Floats, low: float, high: float) -> UInt8:
    """Turn a disparity map into a picture; what was not matched is light grey.

    Parameters
    ----------
    disparity_px : (H, W) float, px
    low, high : float
        Ends of the colours, px.

    Returns
    -------
    (H, W, 3) uint8, blue-green-red

    Examples
    --------
    >>> color_disparity(np.array([[0, 64, np.nan]]), 0, 128)[0, 2].tolist()
    [217, 217, 217]
    """
    scaled = np.nan_to_num((disparity_px - low) / (high - low) * 255).clip(0, 255).astype(np.uint8)
    picture: UInt8 = cv2.applyColorMap(scaled, cv2.COLORMAP_VIRIDIS)
    picture[np.isnan(disparity_px)] = 217
    return picture


def color_error(error_px: Floats, most: float) -> UInt8:
    """Turn errors of a disparity map into a picture: red is too near, blue too far, light grey unknown.

    Parameters
    ----------
    error_px : (H, W) float, px
    most : float
        Where the colours end on both sides, px.

    Returns
    -------
    (H, W, 3) uint8, blue-green-red

    Examples
    --------
    >>> color_error(np.array([[4.0, -4.0, np.nan]]), 4.0)[0].tolist()
    [[31, 0, 103], [97, 48, 5], [217, 217, 217]]
    """
    levels = np.nan_to_num((error_px + most) / (2 * most) * 255).clip(0, 255).astype(np.uint8)
    rgb = colormaps["RdBu_r"](np.arange(256))[:, :3]
    picture: UInt8 = np.rint(255 * rgb[:, ::-1]).astype(np.uint8)[levels]
    picture[np.isnan(error_px)] = 217
    return picture
