"""What becomes of a figure and a table: a file, a picture in a notebook, an image for a slider."""

from __future__ import annotations

import base64
import functools
import io
import textwrap
import tomllib
from collections.abc import Sequence
from importlib import resources
from typing import Any, TypeVar

import cv2
import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import AutoMinorLocator, FuncFormatter, MultipleLocator

from stereolib.base import UInt8, figures_dir, write_atomic
from stereolib.plotting.style import COLORS, DPI, REFUSED, default_style

_Table = TypeVar("_Table")
_PLAIN_PX, _RIGHT_PX, _AXIS_PX, _LINE_PX = 640, 54, 42, 18  # of a photograph with axes, px; texts grow with it
_TEXT_PX, _MOST_SURE = 13, 0.95  # of its texts; letters differ in width, so that so much of a line is filled
_COLOURS, _COMMON = 256, 140  # of a figure, and those of them that are taken by how often they occur


class Picture:
    """A finished picture, which shows itself in a notebook.

    Parameters
    ----------
    data : bytes
        A PNG file.
    alt : str
        What there is to see, for those who do not.
    """

    def __init__(self, data: bytes, alt: str = "") -> None:
        self.data, self.alt = data, alt

    def _repr_mimebundle_(self, **_: Any) -> tuple[dict[str, str], dict[str, Any]]:
        shown = {"image/png": base64.b64encode(self.data).decode(), "text/plain": "<picture>"}
        return shown, {"image/png": {"alt": self.alt}} if self.alt else {}


@default_style
def save_figure(name: str, figure: Figure, *, svg: bool = False) -> Picture:
    """Write a figure as ``figures/<name>.png`` and show it, with its text from ``alt_texts.toml``.

    The PNG carries 256 colours, no date and no version, so that the same data make the same bytes. Its ``Description``
    says what there is to see.

    Parameters
    ----------
    name : str
    figure : matplotlib.figure.Figure
    svg : bool
        Write an SVG as well, for line art.

    Returns
    -------
    Picture
    """
    picture = show_figure(name, figure)
    write_atomic(figures_dir() / f"{name}.png", picture.data)
    if svg:
        drawing = io.BytesIO()
        with matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}):
            figure.savefig(drawing, format="svg", metadata={"Date": None, "Creator": None})
        write_atomic(figures_dir() / f"{name}.svg", drawing.getvalue())
    return picture


@default_style
def show_figure(name: str | None, figure: Figure) -> Picture:
    """Show a figure as `save_figure` does, and keep no file of it.

    Parameters
    ----------
    name : str or None
        Its entry in ``alt_texts.toml``; a figure without one has no text.
    figure : matplotlib.figure.Figure

    Returns
    -------
    Picture
    """
    from PIL import Image, PngImagePlugin

    figure.draw_without_rendering()  # where pictures keep their shape, a layout settles with the second drawing
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=DPI, facecolor="white")
    stream.seek(0)
    picture = _with_256_colours(Image.open(stream).convert("RGB"))
    stream, about, alt = io.BytesIO(), PngImagePlugin.PngInfo(), _alt_texts().get(name or "", "")
    if alt:
        about.add_itxt("Description", alt)
    picture.save(stream, format="png", optimize=True, pnginfo=about)
    return Picture(stream.getvalue(), alt)


@default_style
def picture_with_pixels(image: UInt8, lines: Sequence[tuple[str, str]]) -> bytes:
    """Encode a photograph with axes of its pixels, and lines of text below it.

    The photograph stands unscaled in the upper left, so that whatever program shows the file tells its pixels; the axes
    are to the right of it and below.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
        Grey or blue-green-red.
    lines : sequence of (text, colour)
        In matplotlib's colours; long ones are broken.

    Returns
    -------
    bytes
        A PNG file.
    """
    high, wide = image.shape[:2]
    times = max(1.0, wide / _PLAIN_PX)  # so that texts can be read in a smaller view
    right, axis, line = (round(times * px) for px in (_RIGHT_PX, _AXIS_PX, _LINE_PX))
    lines = _broken(lines, 72 / DPI * times * _TEXT_PX, wide + right - 12 * times)
    full_wide, full_high = wide + right, high + axis + line * len(lines)
    figure = Figure(figsize=(full_wide / DPI, full_high / DPI), dpi=DPI)
    canvas = FigureCanvasAgg(figure)
    ax = figure.add_axes((0, 1 - high / full_high, wide / full_wide, high / full_high))
    ax.imshow(image[..., ::-1] if image.ndim == 3 else image, cmap="gray", vmin=0, vmax=255, aspect="auto")
    ax.spines[:].set_visible(False)
    ax.yaxis.tick_right()
    ax.yaxis.set_label_position("right")
    size = 72 / DPI * times  # points in a pixel
    step = next(px for power in range(1, 9) for px in (10**power, 2 * 10**power, 5 * 10**power) if wide <= 8 * px)
    for along in (ax.xaxis, ax.yaxis):
        along.set(major_locator=MultipleLocator(step), minor_locator=AutoMinorLocator(10))
        along.set_major_formatter(FuncFormatter(lambda px, _: f"{px:g}" if px else ""))  # 0 would be cut in halves
        along.set_tick_params(which="both", width=size, pad=2 * size, labelsize=10 * size)
        along.set_tick_params(which="major", length=7 * size)
        along.set_tick_params(which="minor", length=4 * size)
    ax.set_xlabel("column (px)", fontsize=11 * size, labelpad=size)
    ax.set_ylabel("row (px)", fontsize=11 * size, labelpad=size)
    for k, (words, color) in enumerate(lines):
        y = 1 - (high + axis + line * k) / full_high
        figure.text(6 * times / full_wide, y, words, color=color, fontsize=_TEXT_PX * size, va="top")
    canvas.draw()
    drawn: UInt8 = cv2.cvtColor(np.asarray(canvas.buffer_rgba()), cv2.COLOR_RGBA2BGR)
    drawn[:high, :wide] = image if image.ndim == 3 else image[..., None]
    return bytes(cv2.imencode(".png", drawn)[1])


def _broken(lines: Sequence[tuple[str, str]], points: float, most_px: float) -> list[tuple[str, str]]:
    """Lines of text, each in as many as fit into a width; what follows a break is indented."""
    figure = Figure(dpi=DPI)
    renderer, found = FigureCanvasAgg(figure).get_renderer(), list[tuple[str, str]]()
    for words, color in lines:
        wide = figure.text(0, 0, words, fontsize=points).get_window_extent(renderer).width
        letters = int(_MOST_SURE * len(words) * most_px / max(wide, most_px))
        parts = textwrap.wrap(words, letters, subsequent_indent="  ") if wide > most_px else [words]
        found += [(part, color) for part in parts]
    return found


@functools.cache
def _alt_texts() -> dict[str, str]:
    with resources.files("stereolib.plotting").joinpath("alt_texts.toml").open("rb") as file:
        return tomllib.load(file)


def _with_256_colours(picture: Any) -> Any:
    """Quantise a picture: colours that mean something, common ones, and those that are farthest from all of these.

    The last keep the ends of a colour bar beside a photograph. Each pixel gets the nearest of them, found here and not
    by Pillow, whose table of them is too coarse for white.
    """
    from PIL import Image
    from scipy.spatial import cKDTree

    meant = [[int(color[k : k + 2], 16) for k in (1, 3, 5)] for color in ("#ffffff", *COLORS, REFUSED)]
    common = np.reshape(picture.quantize(_COMMON).getpalette(), (-1, 3))[:_COMMON]
    palette = np.vstack([meant, common]).astype(np.uint8)
    red, green, blue = np.moveaxis(np.asarray(picture, np.uint32), -1, 0)
    codes, place = np.unique(red << 16 | green << 8 | blue, return_inverse=True)  # as numbers: rows sort slowly
    seen = (codes[:, None] >> np.array([16, 8, 0]) & 255).astype(np.uint8)
    off = cKDTree(palette).query(seen)[0]
    while len(palette) < _COLOURS and off.max() > 0:
        palette = np.vstack([palette, seen[off.argmax()]])
        off = np.minimum(off, np.linalg.norm(seen - palette[-1].astype(float), axis=1))
    nearest = cKDTree(palette).query(seen)[1].astype(np.uint8)
    quantised = Image.fromarray(nearest[place.ravel()].reshape(picture.height, picture.width), "P")
    quantised.putpalette(palette.ravel().tolist())
    return quantised


def save_table(name: str, table: _Table) -> _Table:
    """Write a table as ``figures/tables/<name>.csv``.

    Parameters
    ----------
    name : str
    table : pandas.DataFrame

    Returns
    -------
    pandas.DataFrame
        The same one.
    """
    frame: Any = table
    write_atomic(figures_dir() / "tables" / f"{name}.csv", frame.to_csv(index=False, lineterminator="\n"))
    return table


@default_style
def figure_to_image(figure: Figure) -> UInt8:
    """Draw a figure as an image for a slider.

    Parameters
    ----------
    figure : matplotlib.figure.Figure

    Returns
    -------
    (H, W, 3) uint8, blue-green-red

    Examples
    --------
    >>> from stereolib.plotting import panels
    >>> figure_to_image(panels(1, width_in=2, aspect=0.5)[0]).shape
    (150, 300, 3)
    """
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    image: UInt8 = cv2.cvtColor(np.asarray(canvas.buffer_rgba()), cv2.COLOR_RGBA2BGR)
    return image
