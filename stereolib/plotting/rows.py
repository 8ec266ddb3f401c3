"""Does a point lie on the same row of both pictures? Rows, partners and magnified crops of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from matplotlib.axes import Axes

from stereolib.base import Floats, UInt8
from stereolib.plotting.pictures import plot_image
from stereolib.plotting.style import COLORS, TRUTH, default_style, image_axes
from stereolib.rig import to_grey

_CROP_PX = (61, 37)  # columns and rows of a magnified crop
_RING: dict[str, Any] = {"ls": "none", "marker": "o", "mfc": "none", "mec": COLORS[1]}


@default_style
def plot_rows(left: UInt8, right: UInt8, ax: Axes, rows: Sequence[float], title: str = "") -> Axes:
    """Draw a pair side by side with lines along rows: after rectification the same point lies on the same line.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
    ax : matplotlib.axes.Axes
    rows : sequence of float
        Where the lines are, px.
    title : str

    Returns
    -------
    matplotlib.axes.Axes
    """
    plot_image(np.hstack([left, right]), ax, title)
    for row in rows:
        ax.axhline(row, color=COLORS[5], lw=0.8)
    ax.axvline(left.shape[1] - 0.5, color="white", lw=2)
    ax.set_xlabel("column of left, then of right image (px)")
    return ax


@default_style
def plot_row_test(
    left: UInt8, right: UInt8, at_left_px: Floats, at_right_px: Floats, axes: Sequence[Axes], title: str = ""
) -> None:
    """Draw a pair with lines through points of the left image, and below it `plot_row_crops`.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
    at_left_px, at_right_px : (N, 2) float, px
        The same points in both.
    axes : two matplotlib.axes.Axes
    title : str
    """
    at_left, at_right = np.asarray(at_left_px, float), np.asarray(at_right_px, float)
    plot_rows(left, right, axes[0], at_left[:, 1].tolist(), title)
    at = np.vstack([at_left, at_right + np.array([left.shape[1], 0])])
    axes[0].plot(*at.T, ms=6, mew=1.2, **_RING)
    plot_row_crops(left, right, at_left, at_right, axes[1])


@default_style
def plot_row_crops(
    left: UInt8, right: UInt8, at_left_px: Floats, at_right_px: Floats, ax: Axes, title: str = ""
) -> Axes:
    """Draw points of a pair magnified: both crops of a point show the same rows, the left point's in the middle.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
    at_left_px, at_right_px : (N, 2) float, px
        The same points in both.
    ax : matplotlib.axes.Axes
    title : str

    Returns
    -------
    matplotlib.axes.Axes
    """
    at_left, at_right = np.asarray(at_left_px, float), np.asarray(at_right_px, float)
    wide, high = _CROP_PX
    gap = np.full((high, 5, *left.shape[2:]), 255, np.uint8)
    strips = [gap]
    for a, b in zip(at_left, at_right, strict=True):
        crops = [
            cv2.getRectSubPix(image, _CROP_PX, (float(x), float(a[1]))) for image, x in ((left, a[0]), (right, b[0]))
        ]
        strips += [crops[0], gap[:, :2], crops[1], gap]
    plot_image(np.hstack(strips[1:-1]), ax, title)
    middle, step = (high - 1) / 2, 2 * wide + 7
    low = at_right[:, 1] - at_left[:, 1]
    for k, rows in enumerate(low):
        x = k * step + (wide - 1) / 2
        ax.plot([k * step, k * step + 2 * wide + 1], [middle, middle], color=COLORS[5], lw=1.2)
        ax.plot([x, x + wide + 2], [middle, middle + rows], ms=14, mew=1.8, **_RING)
    words = [f"{abs(rows):.1f} rows {'lower' if rows > 0 else 'higher'}" for rows in low]
    labels = [f"left | right: {'same row' if word[:3] == '0.0' else word}" for word in words]
    ax.set(xlabel="", ylabel="", yticks=[], xticks=[k * step + wide for k in range(len(low))], xticklabels=labels)
    ax.tick_params(length=0, labelsize=9)
    ax.spines[:].set_visible(False)
    return ax


@default_style
def plot_partners(image: UInt8, points_px: Floats, lines_px: Sequence[Floats], ax: Axes, title: str = "") -> Axes:
    """Draw points on an image, or the lines on which their partners may lie, each in a colour of its own.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) uint8
    points_px : (N, 2) float, px
    lines_px : sequence of N (M, 2) float, px
        Drawn in place of the points, and the points' own rows dashed; empty draws the points. The first point of each
        line that the image shows is a dot, its last one a ring; numbers tell how many rows each lies below its row.
    ax : matplotlib.axes.Axes
    title : str

    Returns
    -------
    matplotlib.axes.Axes
    """
    plot_image(255 - (255 - to_grey(image)) // 5 * 3, ax, title)
    colors = [COLORS[k % len(COLORS)] for k in range(len(points_px))]
    for point, line, color in zip(points_px, lines_px, colors, strict=False):
        x, y = np.asarray(line, float).T
        ax.plot(x, y, color=color, lw=1.6)
        ax.plot([np.nanmin(x), np.nanmax(x)], [point[1]] * 2, "--", color=TRUTH, lw=0.9)
        inside = (x >= 0) & (x < image.shape[1]) & (y >= 0) & (y < image.shape[0])
        ends = np.flatnonzero(inside)
        for at, filled in zip((*ends[:1], *ends[-1:]), (color, "white"), strict=False):
            ax.plot(x[at], y[at], "o", ms=7, color=filled, mec=color, mew=1.6, zorder=3)
            side = ("right", -6) if at == ends[-1] else ("left", 6)
            words = f"{round(float(y[at] - point[1]), 1) + 0.0:+.1f}".replace("+0.0", "0.0")
            ax.annotate(words, (x[at], y[at]), (side[1], 4), textcoords="offset points", ha=side[0], fontsize=8)
    for point, color in zip([] if len(lines_px) else points_px, colors, strict=False):
        ax.plot(*point, "o", ms=8, color=color, mec="white", mew=0.8)
    return image_axes((image.shape[1], image.shape[0]), ax, title)
