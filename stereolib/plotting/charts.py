"""Figures. The only module that imports matplotlib; every function draws onto axes it is given and returns them."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse, Polygon, Rectangle  # noqa: F401 (those next door draw with them)
from matplotlib.ticker import MaxNLocator

from stereolib.base import figures_dir, write_atomic
from stereolib.rig import to_grey

Array = np.ndarray
DPI = 100
#: Colours that differ in print too (Okabe and Ito 2008), the first for what is ours, the second for the paper's.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
_STYLES = ("-", "--", "-.", ":")


class Picture:
    """A finished picture: shows itself in a notebook."""

    def __init__(self, data: bytes, mime: str = "image/png") -> None:
        self.data, self.mime = data, mime

    def _repr_mimebundle_(self, **_: Any) -> dict[str, str]:
        return {self.mime: base64.b64encode(self.data).decode(), "text/plain": "<picture>"}


def panels(columns: int, rows: int = 1, *, width_in: float = 10.0, aspect: float = 0.75, **subplots: Any) -> Any:
    """A figure of equal panels, `aspect` being height over width of one. Returns (figure, array of axes)."""
    figure = Figure(figsize=(width_in, width_in / columns * aspect * rows), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False, **subplots).ravel()


def save_figure(name: str | None, figure: Figure, *, svg: bool = False) -> Picture:
    """Write a figure as ``figures/<name>.png`` (and SVG for line art) and show it; None only shows it.

    The PNG carries 256 colours, no date and no version, so that the same data make the same bytes.
    """
    from PIL import Image

    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=DPI, facecolor="white")
    stream.seek(0)
    picture = Image.open(stream).convert("RGB").quantize(256, dither=Image.Dither.FLOYDSTEINBERG)
    stream = io.BytesIO()
    picture.save(stream, format="png", optimize=True)
    if name:
        write_atomic(figures_dir() / f"{name}.png", stream.getvalue())
        if svg:
            import matplotlib

            drawing = io.BytesIO()
            with matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}):
                figure.savefig(drawing, format="svg", metadata={"Date": None, "Creator": None})
            write_atomic(figures_dir() / f"{name}.svg", drawing.getvalue())
    return Picture(stream.getvalue())


def save_table(name: str, table: Any) -> Any:
    """Write a DataFrame as ``figures/tables/<name>.csv`` and return it."""
    write_atomic(figures_dir() / "tables" / f"{name}.csv", table.to_csv(index=False, lineterminator="\n"))
    return table


def plot_image(image: Array, ax: Axes, title: str = "") -> Axes:
    """A photograph, grey or blue-green-red, with pixel axes."""
    shown = image[..., ::-1] if image.ndim == 3 else image
    ax.imshow(shown, cmap="gray", vmin=0, vmax=255, interpolation="antialiased")
    ax.set(title=title, xlabel="column (px)", ylabel="row (px)")
    return ax


def plot_rows(left: Array, right: Array, ax: Axes, rows: Sequence[float], title: str = "") -> Axes:
    """A pair side by side with lines along rows: after rectification the same point lies on the same line."""
    plot_image(np.hstack([left, right]), ax, title)
    for row in rows:
        ax.axhline(row, color="#56B4E9", lw=0.8)
    ax.axvline(left.shape[1] - 0.5, color="white", lw=2)
    ax.set_xlabel("column of left, then of right image (px)")
    return ax


def plot_corners(image: Array | None, corners_px: Array, columns: int, ax: Axes, title: str = "") -> Axes:
    """Corners found on a board, joined in their order, the first one ringed; without an image onto what is there."""
    if image is not None:
        plot_image(image, ax, title)
    x, y = np.asarray(corners_px, float).T
    ax.plot(x, y, color=COLORS[4], lw=0.8)
    ax.scatter(x, y, s=9, c=np.arange(len(corners_px)) // columns, cmap="viridis", zorder=3)
    ax.scatter(x[:1], y[:1], s=90, facecolors="none", edgecolors=COLORS[1], lw=2, zorder=4)
    return ax


def plot_disparity(
    disparity_px: Array, ax: Axes, title: str = "", *, low: float = 0, high: float | None = None, bar: bool = True
) -> Any:
    """A disparity map; what was not matched is light grey."""
    colors = colormaps["viridis"].with_extremes(bad="#d9d9d9")
    shown = ax.imshow(np.ma.masked_invalid(disparity_px), cmap=colors, vmin=low, vmax=high, interpolation="nearest")
    ax.set(title=title, xlabel="column (px)", ylabel="row (px)")
    if bar and ax.figure is not None:
        ax.figure.colorbar(shown, ax=ax, label="disparity (px)", shrink=0.85)
    return shown


def plot_errors(error_px: Array, ax: Axes, title: str = "", *, limit: float = 4) -> Axes:
    """Signed disparity errors, blue too far, red too near; not matched is light grey."""
    colors = colormaps["RdBu_r"].with_extremes(bad="#d9d9d9")
    shown = ax.imshow(np.ma.masked_invalid(error_px), cmap=colors, vmin=-limit, vmax=limit, interpolation="nearest")
    ax.set(title=title, xlabel="column (px)", ylabel="row (px)")
    if ax.figure is not None:
        ax.figure.colorbar(shown, ax=ax, label="error (px)", shrink=0.85)
    return ax


def plot_curves(
    curves: Mapping[str, tuple[Any, Any]],
    ax: Axes,
    *,
    xlabel: str,
    ylabel: str,
    title: str = "",
    marker: str = "o",
    joined: bool = True,
    **axes: Any,
) -> Axes:
    """Named curves of (x, y), each with its own colour and line style, or dots; units belong into the labels."""
    for k, (name, (x, y)) in enumerate(curves.items()):
        style: dict[str, Any] = {"color": COLORS[k % len(COLORS)], "ls": _STYLES[k % len(_STYLES)] if joined else ""}
        ax.plot(x, y, marker=marker, ms=4, lw=1.4, label=name, **style)
    ax.grid(alpha=0.3)
    ax.set(xlabel=xlabel, ylabel=ylabel, title=title, **axes)
    if len(curves) > 1:
        ax.legend(frameon=False, fontsize=9)
    return ax


def plot_triangulation(f_px: float, baseline_mm: float, depth_mm: float, ax: Axes) -> Axes:
    """The geometry of disparity (Fig. 2), seen from above, image planes drawn before the lenses and enlarged."""
    plane = 0.22 * depth_mm  # where the image planes are drawn; true ones lie at a few millimetres
    point = np.array([0.35 * baseline_mm, depth_mm])
    half = 0.46 * baseline_mm
    for name, x, color in (("left", 0.0, COLORS[0]), ("right", baseline_mm, COLORS[1])):
        ax.plot([x - half, x + half], [plane, plane], color=color, lw=3, solid_capstyle="butt")
        ax.plot(x, plane, "|", color="black", ms=12)  # the principal point
        ax.plot([x, point[0]], [0, point[1]], color=color, lw=1)
        ax.plot([x, x], [0, depth_mm * 1.02], color="0.7", lw=0.8, ls=":")
        ax.plot(x, 0, "o", color=color)
        ax.annotate(f"{name} camera", (x, 0), (0, -14), textcoords="offset points", ha="center", color=color)
        crossing = x + (point[0] - x) * plane / depth_mm
        ax.plot([x, crossing], [plane, plane], color="black", lw=3)
        sign, side = ("x_l", -1) if name == "left" else ("x_r", 1)
        ax.annotate(f"${sign}$ = {f_px * (point[0] - x) / depth_mm:+.1f} px", ((x + crossing) / 2, plane),
                    (side * 42, 10), textcoords="offset points", ha="center")  # fmt: skip
    ax.plot(*point, "s", color="black")
    ax.annotate(f"P, Z = {depth_mm:.0f} mm", tuple(point), (8, 4), textcoords="offset points")
    ax.annotate("", (0, -0.13 * depth_mm), (baseline_mm, -0.13 * depth_mm), arrowprops={"arrowstyle": "<->"})
    ax.annotate(f"B = {baseline_mm:.1f} mm", (baseline_mm / 2, -0.17 * depth_mm), ha="center", va="top")
    ax.set(xlim=(-110, baseline_mm + 110), ylim=(-0.26 * depth_mm, 1.1 * depth_mm), xlabel="x (mm)", ylabel="z (mm)")
    ax.set_title(f"$d = x_l - x_r = fB/Z$ = {f_px * baseline_mm / depth_mm:.1f} px")
    return ax


def plot_scan(points_mm: Array, ax: Axes, title: str = "", *, label: str | None = None, color: str = COLORS[0]) -> Axes:
    """Laser readings from above, (N, 2) mm; forward is up, as the robot looks."""
    ax.scatter(-points_mm[:, 1], points_mm[:, 0], s=5, color=color, label=label, lw=0)
    ax.plot(0, 0, "^", color="black", ms=8)
    ax.set(title=title, xlabel="to the right (mm)", ylabel="forward (mm)", aspect="equal")
    ax.grid(alpha=0.3)
    return ax


def plot_scan_polar(angles_rad: Array, ranges_mm: Array, ax: Axes, title: str = "", *, color: str = COLORS[0]) -> Axes:
    """Laser readings in the sensor's own polar frame (axes with ``projection="polar"``); dropouts on the rim."""
    polar: Any = ax
    polar.set_theta_zero_location("N")
    polar.scatter(angles_rad, ranges_mm, s=5, color=color, lw=0)
    lost, rim = ~np.isfinite(ranges_mm), 1.05 * np.nanmax(ranges_mm)
    polar.scatter(angles_rad[lost], np.full(lost.sum(), rim), s=14, marker="x", color=COLORS[1], lw=0.8)
    polar.set_title(title)
    polar.tick_params(labelsize=8)
    return ax


def plot_mask(image: Array, mask: Array, ax: Axes, title: str = "", *, ring: tuple[float, float] | None = None) -> Axes:
    """Fig. 7: marked pixels on the picture; `ring` (column, row) points out one of them."""
    shown = cv2.cvtColor(to_grey(image), cv2.COLOR_GRAY2BGR)
    shown[mask] = (0, 94, 213)
    plot_image(shown, ax, title)
    if ring:
        ax.scatter([ring[0]], [ring[1]], s=130, facecolors="none", edgecolors=COLORS[5], lw=2)
    return ax


def plot_height(image: Array, mask: Array, top_row: int, foot_row: int, column: int, ax: Axes, title: str = "") -> Axes:
    """Fig. 8: the pixels of maximum disparity on the picture, and the rows between which height is counted."""
    plot_mask(image, mask, ax, title)
    right = image.shape[1]
    for row, name in ((top_row, "first row with the maximum"), (foot_row, "foot, by the constant")):
        ax.axhline(row, color=COLORS[5], lw=1)
        ax.text(right - 6, row - 5, f"{name}: {row}", color="white", ha="right", fontsize=8,
                bbox={"facecolor": "black", "alpha": 0.55, "lw": 0, "pad": 1.5})  # fmt: skip
    ax.annotate(
        "", (column, top_row), (column, foot_row), arrowprops={"arrowstyle": "<->", "color": "white", "lw": 1.4}
    )
    return ax


def plot_box(image: Array, box: Any, ax: Axes, title: str = "", *, edges: Array | None = None) -> Axes:
    """Fig. 9: a picture, Canny's edges over it, and their bounding rectangle."""
    shown = image.copy()
    if edges is not None:
        shown[cv2.dilate(edges, np.ones((2, 2), np.uint8)) > 0] = (233, 180, 86)
    plot_image(shown, ax, title)
    corner = (box.left - 0.5, box.top - 0.5)
    ax.add_patch(Rectangle(corner, box.width, box.height, fill=False, ec=COLORS[1], lw=2))
    ax.annotate(f"{box.width} px", (box.left + box.width / 2, box.top), (0, 5), textcoords="offset points",
                ha="center", color=COLORS[1], weight="bold")  # fmt: skip
    return ax


def plot_points(points_px: Array, size: tuple[int, int], ax: Axes, title: str = "", *, parts: int = 3) -> Axes:
    """Where in an image of `size` points lie, (N, 2) px, over a grid of `parts` x `parts`; rows run down."""
    width, height = size
    x, y = np.reshape(points_px, (-1, 2)).T
    ax.scatter(x, y, s=3, color=COLORS[0], alpha=0.5, lw=0)
    for k in range(1, parts):
        ax.axvline(k * width / parts - 0.5, color="0.6", lw=0.8)
        ax.axhline(k * height / parts - 0.5, color="0.6", lw=0.8)
    return _image_axes(size, ax, title)


def plot_arrows(
    at_px: Array, arrows_px: Array, size: tuple[int, int], ax: Axes, title: str = "", *, cells: int = 12
) -> Axes:
    """Small errors on an image as magnified arrows: each one grey, their means over `cells` columns in colour.

    Arrows of chance point everywhere and their means vanish; what a lens model misses stays.
    """
    at, arrows = np.reshape(at_px, (-1, 2)).astype(float), np.reshape(arrows_px, (-1, 2))
    finite = np.isfinite(arrows).all(axis=1)
    at, arrows = at[finite], arrows[finite]
    cell = size[0] / cells
    key = max(float(np.sqrt(np.mean(arrows**2))), 1e-9) if len(arrows) else 1.0
    unit = float(f"{key:.0e}")  # one digit
    how: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.6 * key / cell}
    ax.quiver(*at.T, *arrows.T, color="0.8", width=0.0012, **how)
    _, which = np.unique(np.floor(at / cell).astype(int), axis=0, return_inverse=True)
    count = np.bincount(which.ravel())
    enough = count >= 5
    means = [np.bincount(which.ravel(), v)[enough] / count[enough] for v in (*at.T, *arrows.T)]
    drawn = ax.quiver(*means, color=COLORS[1], width=0.004, **how)
    ax.quiverkey(drawn, 0.86, 1.03, unit, f"{unit:g} px", labelpos="E", coordinates="axes")
    return _image_axes(size, ax, title)


def plot_dots(x: Array, y: Array, ax: Axes, *, color: Array, label: str, title: str = "", **axes: Any) -> Axes:
    """Dots at (x, y), a third quantity as their colour; `axes` are their labels and limits, with units."""
    dots = ax.scatter(x, y, c=color, s=28, cmap="viridis", edgecolors="0.3", lw=0.4)
    if ax.figure is not None:
        ax.figure.colorbar(dots, ax=ax, label=label, shrink=0.85)
    ax.grid(alpha=0.3)
    ax.set(title=title, **axes)
    return ax


def plot_map(
    values: Array,
    columns_px: Array,
    rows_px: Array,
    size: tuple[int, int],
    ax: Axes,
    title: str,
    *,
    label: str,
    lines: bool = True,
    high: float | None = None,
    unseen: Array | None = None,
) -> Axes:
    """A quantity over the image, (h, w) on a grid of pixels, with labelled contour `lines`; NaN is light grey.

    Colours end at `high` or at the largest twentieth, which would leave the rest without contrast. What is `unseen`,
    bool on any grid over the image, is hatched.
    """
    shown = np.ma.masked_invalid(values)
    ax.set_facecolor("#d9d9d9")
    if shown.count():
        low, most = np.percentile(shown.compressed(), [0, 95])
        high = float(most) if high is None or not np.isfinite(high) else high
        mesh = ax.pcolormesh(columns_px, rows_px, shown, cmap="viridis", shading="nearest", vmin=low, vmax=high)
        if ax.figure is not None:
            ax.figure.colorbar(mesh, ax=ax, label=label, shrink=0.85, extend="max")
        if lines and high > low and min(shown.shape) > 1:
            levels = MaxNLocator(4).tick_values(low, high)[1:-1]  # round numbers
            drawn = ax.contour(columns_px, rows_px, shown, levels=levels, colors="white", linewidths=0.8)
            for text in ax.clabel(drawn, fontsize=8, fmt="%g", colors="black"):
                text.set_bbox({"facecolor": "white", "alpha": 0.75, "lw": 0, "pad": 0.6})
    if unseen is not None and unseen.any():
        edges = (np.linspace(0, n - 1, k) for n, k in zip(size, unseen.shape[::-1], strict=True))
        area = ax.contourf(*edges, unseen.astype(float), levels=[0.5, 1.5], colors="none", hatches=["///"])
        area.set(edgecolor="#808080", linewidth=0)
    return _image_axes(size, ax, title)


def _image_axes(size: tuple[int, int], ax: Axes, title: str) -> Axes:
    width, height = size
    ax.set(title=title, xlabel="column (px)", ylabel="row (px)", aspect="equal")
    ax.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    return ax


def colored(disparity_px: Array, low: float, high: float) -> Array:
    """A disparity map as a picture for a slider: (H, W, 3) uint8 blue-green-red, NaN light grey."""
    scaled = np.nan_to_num((disparity_px - low) / (high - low) * 255).clip(0, 255).astype(np.uint8)
    picture = cv2.applyColorMap(scaled, cv2.COLORMAP_VIRIDIS)
    picture[np.isnan(disparity_px)] = 217
    return picture


def plot_bars(counts: Mapping[str, int], ax: Axes, *, xlabel: str, title: str = "") -> Axes:
    """Horizontal bars, one a name, the number at its end."""
    bars = ax.barh(list(counts), list(counts.values()), color=COLORS[0])
    ax.bar_label(bars, padding=3)
    ax.invert_yaxis()
    ax.set(xlabel=xlabel, title=title)
    ax.margins(x=0.1)
    return ax


def picture_of(figure: Figure) -> Array:
    """A figure as an image for a slider: (H, W, 3) uint8 blue-green-red."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return cv2.cvtColor(np.asarray(canvas.buffer_rgba()), cv2.COLOR_RGBA2BGR)
