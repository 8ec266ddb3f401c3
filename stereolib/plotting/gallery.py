"""Many small pictures of one kind beside each other, under one bar of colours, and arrays small enough to be read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from stereolib.base import Bools, Floats, UInt8
from stereolib.matching import score
from stereolib.plotting.style import DPI, GREY_NONE, NOTHING_GREY, default_style

_WIDTH_IN, _POINTS = 7.5, 8.5  # printed 16 cm wide, the text is of 7 points
_WITH_PHOTOS_IN = 6.5  # photographs take many bytes
_LEFT_IN, _GAP_IN, _LINE_IN, _BARS_IN = 0.24, 0.04, 0.165, 0.62  # left margin, between panels, a line, the bars
#: What a row of a gallery shows: the name of its bar, its colours.
KINDS = {"disparity": ("disparity (px)", "viridis"), "error": ("error (px): red is too near", "RdBu_r")}
PHOTO = "photo"  # a row of pictures as cameras see them, without a bar


@dataclass(frozen=True, eq=False)
class Exhibit:
    """One column of a gallery: pictures of one thing, one below the other.

    Parameters
    ----------
    name : str
        Stands above; two lines at most.
    pictures : sequence of (H, W) float, px, or of (H, W) or (H, W, 3) uint8
        As many as the gallery has rows; NaN is drawn light grey. Photographs are blue-green-red.
    told : str
        Stands beneath.
    outline : (H, W) bool, optional
        Pixels around which a line is drawn in every picture.
    """

    name: str
    pictures: Sequence[Floats | UInt8]
    told: str = ""
    outline: Bools | None = None


@default_style
def plot_gallery(
    exhibits: Sequence[Exhibit],
    rows: Mapping[str, str],
    *,
    columns: int = 7,
    disparity_px: tuple[float, float] = (0.0, 128.0),
    limit_px: float = 4.0,
    title: str = "",
) -> Figure:
    """Draw maps and their errors in equal panels, with one bar for all disparities and one for all errors.

    Parameters
    ----------
    exhibits : sequence of Exhibit
        Pictures of one size.
    rows : mapping of str to {"disparity", "error", "photo"}
        What the rows are called, from top to bottom, and what they show.
    columns : int
        Exhibits beside each other; those that follow begin a new block of rows.
    disparity_px : (low, high), px
        Ends of the colours of disparities.
    limit_px : float, px
        Where the colours of errors end, on both sides.
    title : str
        Above all.

    Returns
    -------
    matplotlib.figure.Figure
        Lengths in it are pixels, told by a scale in the first panel.

    Raises
    ------
    ValueError
        If an exhibit has not one picture for each row.

    Examples
    --------
    >>> flat = np.full((20, 30), 80.0)
    >>> figure = plot_gallery([Exhibit("flat", [flat, flat - 80])], {"map": "disparity", "error": "error"}, columns=3)
    >>> len(figure.axes)  # two panels, two bars
    4
    """
    height, width = np.shape(exhibits[0].pictures[0])[:2]
    width_in = _WITH_PHOTOS_IN if PHOTO in rows.values() else _WIDTH_IN
    panel_in = (width_in - _LEFT_IN) / columns - _GAP_IN
    tall_in = panel_in * height / width
    lines = ([text.count("\n") + bool(text) for text in texts] for texts in _texts(exhibits))
    above, beneath = (_LINE_IN * max(counts) + 0.05 for counts in lines)
    block_in = above + len(rows) * (tall_in + _GAP_IN) + beneath
    head_in = 1.5 * _LINE_IN * bool(title)
    figure = Figure(figsize=(width_in, head_in + block_in * -(-len(exhibits) // columns) + _BARS_IN), dpi=DPI)
    FigureCanvasAgg(figure)
    whole_in, ends = figure.get_figheight(), {"disparity": disparity_px, "error": (-limit_px, limit_px)}
    shown: dict[str, Any] = {}
    for k, exhibit in enumerate(exhibits):
        block, column = divmod(k, columns)
        axes = []
        for row, ((name, kind), picture) in enumerate(zip(rows.items(), exhibit.pictures, strict=True)):
            left_in = _LEFT_IN + column * (panel_in + _GAP_IN)
            low_in = whole_in - head_in - block * block_in - above - row * (tall_in + _GAP_IN) - tall_in
            place = left_in / width_in, low_in / whole_in, panel_in / width_in, tall_in / whole_in
            axes.append(figure.add_axes(place))
            shown[kind] = _hang(picture, axes[-1], kind, ends.get(kind, (0.0, 255.0)))
            if exhibit.outline is not None:
                axes[-1].contour(exhibit.outline, levels=[0.5], colors="black", linewidths=0.7)
            if column == 0:
                axes[-1].set_ylabel(name, fontsize=_POINTS, labelpad=3)
        axes[0].set_title(exhibit.name, fontsize=_POINTS, pad=3, linespacing=1.15)
        axes[-1].set_xlabel(exhibit.told, fontsize=_POINTS, labelpad=3, linespacing=1.15)
    if title:
        figure.text(0.5, 1 - 0.4 * head_in / whole_in, title, fontsize=_POINTS + 1, ha="center", va="center")
    if shown.pop(PHOTO, None) is None:
        _scale(figure.axes[0], width)
    for k, (kind, image) in enumerate(shown.items()):
        place = 0.06 + 0.48 * k, (_BARS_IN - 0.2) / whole_in, 0.38 if len(shown) > 1 else 0.88, 0.09 / whole_in
        bar = figure.colorbar(image, cax=figure.add_axes(place), orientation="horizontal", extend="both")
        grey = GREY_NONE if kind == "disparity" and _has_holes(exhibits, rows) else ""
        bar.set_label(KINDS[kind][0] + grey, fontsize=_POINTS, labelpad=1)
        bar.ax.tick_params(labelsize=_POINTS, pad=2)
    return figure


def plot_repairs(
    maps_px: Mapping[str, Floats],
    truth_px: Floats,
    where: Bools,
    part: tuple[slice, slice],
    *,
    columns: int = 7,
    with_truth: bool = True,
) -> Figure:
    """Draw the true map and what several methods made of it, each with its error and its bad-2 beneath.

    Parameters
    ----------
    maps_px : mapping of str to (H, W) float, px
        By the method's name, of which the first ``_`` begins a new line.
    truth_px : (H, W) float, px
    where : (H, W) bool
        Pixels whose error is shown and counted, as `stereolib.matching.score` does.
    part : (slice, slice)
        Rows and columns that are shown.
    columns : int
        Methods beside each other.
    with_truth : bool
        Begin with the truth.

    Returns
    -------
    matplotlib.figure.Figure
    """
    exhibits = []
    for name, disparity in {"truth": truth_px, **maps_px}.items():
        told = f"bad-2 {score(disparity, truth_px, where).bad2_pct:.0f} %" if name in maps_px else ""
        pictures = disparity[part], np.where(where, disparity - truth_px, np.nan)[part]
        exhibits.append(Exhibit(name.replace("_", "\n", 1).replace("_", " "), pictures, told))
    exhibits = exhibits if with_truth else exhibits[1:]
    return plot_gallery(exhibits, {"map": "disparity", "error": "error"}, columns=columns, disparity_px=(20, 110))


@default_style
def plot_cells(values: Floats, ax: Axes, title: str = "", *, high: float | None = None) -> Axes:
    """Draw a small array as coloured cells with its numbers written in them; NaN is an empty grey cell.

    Parameters
    ----------
    values : (H, W) float
    ax : matplotlib.axes.Axes
    title : str
    high : float, optional
        Where the colours end; by default at the largest value.

    Returns
    -------
    matplotlib.axes.Axes
    """
    most = float(np.nanmax(values)) if high is None else high
    colors = colormaps["viridis"].with_extremes(bad=NOTHING_GREY)
    ax.imshow(np.ma.masked_invalid(values), cmap=colors, vmin=0, vmax=most, interpolation="nearest")
    for (row, column), value in np.ndenumerate(values):
        if np.isfinite(value):
            ink = "black" if value > 0.55 * most else "white"
            ax.text(column, row, f"{value:g}", ha="center", va="center", color=ink, fontsize=_POINTS)
    ax.set(xticks=[], yticks=[])  # where a major tick stands, no minor one has a line
    ax.set_xticks(np.arange(values.shape[1] + 1) - 0.5, minor=True)
    ax.set_yticks(np.arange(values.shape[0] + 1) - 0.5, minor=True)
    ax.grid(which="minor", color="white", lw=0.8)
    ax.tick_params(which="both", length=0, labelbottom=False, labelleft=False)
    ax.set_title(title, fontsize=_POINTS + 1)
    return ax


def _texts(exhibits: Sequence[Exhibit]) -> tuple[list[str], list[str]]:
    """What stands above the exhibits and beneath them."""
    return [one.name for one in exhibits], [one.told for one in exhibits]


def _has_holes(exhibits: Sequence[Exhibit], rows: Mapping[str, str]) -> bool:
    """Whether any map has pixels without a disparity."""
    maps = (p for one in exhibits for p, kind in zip(one.pictures, rows.values(), strict=True) if kind == "disparity")
    return any(bool(np.isnan(each).any()) for each in maps)


def _hang(picture: Floats | UInt8, axis: Axes, kind: str, ends: tuple[float, float]) -> Any:
    axis.set(xticks=[], yticks=[])
    for spine in axis.spines.values():
        spine.set(linewidth=0.4, color="0.6")
    if kind == PHOTO:
        photo = picture[..., ::-1] if picture.ndim == 3 else picture
        return axis.imshow(photo, cmap="gray", vmin=0, vmax=255, interpolation="antialiased", aspect="auto")
    colors = colormaps[KINDS[kind][1]].with_extremes(bad=NOTHING_GREY)
    low, high = ends
    return axis.imshow(
        np.ma.masked_invalid(picture), cmap=colors, vmin=low, vmax=high, interpolation="nearest", aspect="auto"
    )


def _scale(axis: Axes, width: int) -> None:
    """A length of 10, 50 or 100 px in the lower left corner."""
    length = max((step for step in (10, 50, 100) if step < 0.5 * width), default=5)
    foot, margin = axis.get_ylim()[0], 0.06 * width
    axis.plot([margin, margin + length], [foot - margin] * 2, color="black", lw=1.6)
    behind = {"facecolor": "white", "alpha": 0.7, "pad": 0.8, "lw": 0}
    axis.text(margin + length / 2, foot - 1.6 * margin, f"{length} px", fontsize=_POINTS - 1, ha="center", bbox=behind)
