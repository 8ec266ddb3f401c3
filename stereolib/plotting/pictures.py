"""Photographs, disparity maps and other quantities over an image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from stereolib.base import Bools, Floats, Ints, UInt8
from stereolib.paper import HeightResult
from stereolib.plotting.style import BGR_SKY, BGR_VERMILLION, COLORS, NOTHING_GREY, default_style, image_axes
from stereolib.rig import to_grey

_GLASS_PX = (12, 12)  # columns and rows that `plot_mask` magnifies


@default_style
def plot_image(image: UInt8, ax: Axes, title: str = "") -> Axes:
    """Draw a photograph with pixel axes.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
        Grey or blue-green-red.
    ax : matplotlib.axes.Axes
    title : str

    Returns
    -------
    matplotlib.axes.Axes
    """
    shown = image[..., ::-1] if image.ndim == 3 else image
    ax.imshow(shown, cmap="gray", vmin=0, vmax=255, interpolation="antialiased")
    ax.set(title=title, xlabel="column (px)", ylabel="row (px)")
    return ax


@default_style
def plot_corners(image: UInt8 | None, corners_px: Floats, columns: int, ax: Axes, title: str = "") -> Axes:
    """Draw the corners of a board, joined in their order, the first one ringed.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8, or None
        None draws onto what is there.
    corners_px : (N, 2) float, px
    columns : int
        Corners in a row of the board.
    ax : matplotlib.axes.Axes
    title : str

    Returns
    -------
    matplotlib.axes.Axes
    """
    if image is not None:
        plot_image(image, ax, title)
    x, y = np.asarray(corners_px, float).T
    ax.plot(x, y, color=COLORS[4], lw=0.8)
    ax.scatter(x, y, s=9, c=np.arange(len(corners_px)) // columns, cmap="viridis", zorder=3)
    ax.scatter(x[:1], y[:1], s=90, facecolors="none", edgecolors=COLORS[1], lw=2, zorder=4)
    return ax


@default_style
def plot_crop(
    image: UInt8, found_px: Floats, predicted_px: Floats, ax: Axes, title: str = "", *, side_px: int = 40
) -> Axes:
    """Draw the surroundings of a point enlarged: where it was found, and where it was predicted.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
    found_px, predicted_px : (2,) float, px
    ax : matplotlib.axes.Axes
    title : str
    side_px : int
        Of the square that is shown, round the point that was found.

    Returns
    -------
    matplotlib.axes.Axes
    """
    plot_image(image, ax, title)
    ax.images[0].set_interpolation("nearest")
    ax.title.set_fontsize(10)
    for (x, y), color, marker, name in (
        (predicted_px, COLORS[0], "x", "predicted"),
        (found_px, COLORS[1], "+", "found"),
    ):
        ax.plot([x], [y], marker, color=color, ms=16, mew=2, ls="none", label=name)
    (x, y), half = np.round(found_px), side_px / 2
    ax.set(xlim=(x - half, x + half), ylim=(y + half, y - half))
    return ax


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
        ax.figure.colorbar(shown, ax=ax, label=label, shrink=0.85)
    return shown


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
        ax.figure.colorbar(shown, ax=ax, label="error (px)", shrink=0.85)
    return ax


@default_style
def plot_mask(
    image: UInt8,
    mask: Bools,
    ax: Axes,
    title: str = "",
    *,
    zoom: tuple[float, float] | None = None,
    counted: Bools | None = None,
) -> Axes:
    """Draw marked pixels on a picture (Fig. 7), and those around one place through a magnifying glass.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
    mask : (H, W) bool
    ax : matplotlib.axes.Axes
    title : str
    zoom : (column, row), optional
        The middle of what the glass shows, 12 x 12 px of it.
    counted : (H, W) bool, optional
        The picture is faded elsewhere.

    Returns
    -------
    matplotlib.axes.Axes
    """
    shown = cv2.cvtColor(to_grey(image), cv2.COLOR_GRAY2BGR)
    if counted is not None:
        shown[~counted] = 255 - (255 - shown[~counted]) // 5
    shown[mask] = BGR_VERMILLION
    plot_image(shown, ax, title)
    if zoom:
        share = zoom[0] / shown.shape[1]  # the glass is above, on the place's own side if it does not hide it there
        left = 0.77 if share < 0.26 or 0.5 < share < 0.74 else 0.02
        glass = ax.inset_axes((left, 0.69, 0.21, 0.28))
        glass.imshow(shown[..., ::-1], interpolation="nearest", aspect="auto")
        wide, high = _GLASS_PX
        glass.set(xlim=(zoom[0] - wide / 2, zoom[0] + wide / 2), ylim=(zoom[1] + high / 2, zoom[1] - high / 2))
        glass.set(xticks=[], yticks=[])
        glass.spines[:].set(color="black", lw=1.5)
        ax.indicate_inset_zoom(glass, edgecolor="black", alpha=1.0, lw=1.5)
    return ax


@default_style
def plot_height(image: UInt8, height: HeightResult, ax: Axes, title: str = "") -> Axes:
    """Draw the pixels of maximum disparity on a picture, and the rows between which height is counted (Fig. 8).

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
    height : HeightResult
        From `height_by_maximum`.
    ax : matplotlib.axes.Axes
    title : str

    Returns
    -------
    matplotlib.axes.Axes
    """
    plot_mask(image, height.mask, ax, title)
    for row, name in ((height.top_row, "first\nmarked\nrow"), (height.foot_row, "foot")):
        ax.axhline(row, color=COLORS[5], lw=1)
        ax.text(1.02, row, f"{name}: {row}", transform=ax.get_yaxis_transform(), va="center", fontsize=9)
    ax.annotate(
        "",
        (height.column, height.top_row),
        (height.column, height.foot_row),
        arrowprops={"arrowstyle": "<->", "color": "white", "lw": 1.4},
    )
    return ax


@default_style
def plot_box(image: UInt8, box: Any, ax: Axes, title: str = "", *, edges: UInt8 | None = None) -> Axes:
    """Draw a picture, Canny's edges over it, and their bounding rectangle (Fig. 9).

    Parameters
    ----------
    image : (H, W, 3) uint8
    box : BoundingBox
        Has left, top, width and height, px.
    ax : matplotlib.axes.Axes
    title : str
    edges : (H, W) uint8, optional
        Not 0 on an edge.

    Returns
    -------
    matplotlib.axes.Axes
    """
    shown = image.copy()
    if edges is not None:
        shown[cv2.dilate(edges, np.ones((3, 3), np.uint8)) > 0] = BGR_SKY
    plot_image(shown, ax, title)
    corner = (box.left - 0.5, box.top - 0.5)
    ax.add_patch(Rectangle(corner, box.width, box.height, fill=False, ec=COLORS[1], lw=2))
    ax.annotate(
        f"{box.width} px",
        (box.left + box.width / 2, box.top),
        (0, 5),
        textcoords="offset points",
        ha="center",
        color=COLORS[1],
        weight="bold",
    )
    return ax


@default_style
def plot_points(points_px: Floats, size: tuple[int, int], ax: Axes, title: str = "", *, parts: int = 3) -> Axes:
    """Draw where in an image points lie, over a grid; rows run down.

    Parameters
    ----------
    points_px : (..., 2) float, px
    size : (width, height), px
    ax : matplotlib.axes.Axes
    title : str
    parts : int
        Cells of the grid along each side.

    Returns
    -------
    matplotlib.axes.Axes
    """
    width, height = size
    x, y = np.reshape(points_px, (-1, 2)).T
    ax.scatter(x, y, s=3, color=COLORS[0], alpha=0.5, lw=0)
    for k in range(1, parts):
        ax.axvline(k * width / parts - 0.5, color="0.6", lw=0.8)
        ax.axhline(k * height / parts - 0.5, color="0.6", lw=0.8)
    return image_axes(size, ax, title)


@default_style
def plot_arrows(
    at_px: Floats, arrows_px: Floats, size: tuple[int, int], ax: Axes, title: str = "", *, cells: int = 12
) -> Axes:
    """Draw small errors on an image as magnified arrows: each one grey, their means over cells in colour.

    Arrows of chance point everywhere and their means vanish; what a lens model misses stays.

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
    ax.quiver(*at.T, *arrows.T, color="0.8", width=0.0012, **how)
    _, which = np.unique(np.floor(at / cell).astype(int), axis=0, return_inverse=True)
    count = np.bincount(which.ravel())
    enough = count >= 5
    means = [np.bincount(which.ravel(), v)[enough] / count[enough] for v in (*at.T, *arrows.T)]
    drawn = ax.quiver(*means, color=COLORS[1], width=0.004, **how)
    ax.quiverkey(drawn, 0.86, 1.03, unit, f"{unit:g} px", labelpos="E", coordinates="axes")
    return image_axes(size, ax, title)


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
    quantity: ImageQuantity, ax: Axes, title: str = "", *, lines: bool = True, high: float | None = None
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

    Returns
    -------
    matplotlib.axes.Axes
    """
    shown = np.ma.masked_invalid(quantity.values)
    ax.set_facecolor(NOTHING_GREY)
    if shown.count():
        low, most = np.percentile(shown.compressed(), [0, 95])
        high = float(most) if high is None or not np.isfinite(high) else high
        mesh = ax.pcolormesh(
            quantity.columns_px, quantity.rows_px, shown, cmap="viridis", shading="nearest", vmin=low, vmax=high
        )
        if ax.figure is not None:
            ax.figure.colorbar(mesh, ax=ax, label=quantity.label, shrink=0.85, extend="max")
        if lines and high > low and min(shown.shape) > 1:
            levels = MaxNLocator(4).tick_values(low, high)[1:-1]  # round numbers
            drawn = ax.contour(
                quantity.columns_px, quantity.rows_px, shown, levels=levels, colors="white", linewidths=0.8
            )
            for text in ax.clabel(drawn, fontsize=8, fmt="%g", colors="black"):
                text.set_bbox({"facecolor": "white", "alpha": 0.75, "lw": 0, "pad": 0.6})
    unseen = quantity.unseen
    if unseen is not None and unseen.any():
        edges = (np.linspace(0, n - 1, k) for n, k in zip(quantity.size, unseen.shape[::-1], strict=True))
        area = ax.contourf(*edges, unseen.astype(float), levels=[0.5, 1.5], colors="none", hatches=["///"])
        area.set(edgecolor="#808080", linewidth=0)
        nothing = np.ma.masked_where(~np.ma.getmaskarray(shown), np.zeros(shown.shape))
        grey = ListedColormap([NOTHING_GREY])  # no hatches where there is no value
        ax.pcolormesh(quantity.columns_px, quantity.rows_px, nothing, cmap=grey, shading="nearest", zorder=1.5)
    return image_axes(quantity.size, ax, title)


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
