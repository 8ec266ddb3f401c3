"""Photographs, and marks on them: corners, pixels, heights, boxes, points."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from stereolib.base import Bools, Floats, UInt8
from stereolib.paper import HeightResult
from stereolib.plotting.style import BGR_SKY, BGR_VERMILLION, COLORS, default_style, image_axes
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
    box : PixelBox
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
