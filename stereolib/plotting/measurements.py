"""Measured heights on their picture, and measurements with their intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from matplotlib.axes import Axes

from stereolib.base import Float64, Floats
from stereolib.laser import ErrorCurve
from stereolib.measurement import Box, HeightAttempt, Side, floor_tolerance_px
from stereolib.plotting.curves import plot_curves
from stereolib.plotting.pictures import plot_image
from stereolib.plotting.style import BGR_BLUE, BGR_ORANGE, COLORS, OURS, default_style
from stereolib.rig import to_grey


@default_style
def plot_height_attempt(attempt: HeightAttempt, ax: Axes, title: str = "") -> Axes:
    """Draw what the ground plane's method went by: floor (blue), object (orange), faces, near edge, and the top line.

    Parameters
    ----------
    attempt : HeightAttempt
    ax : matplotlib.axes.Axes
    title : str

    Returns
    -------
    matplotlib.axes.Axes
    """
    picture = cv2.cvtColor(to_grey(attempt.left), cv2.COLOR_GRAY2BGR).astype(float)
    if attempt.floor is not None:
        column, row = np.meshgrid(*(np.arange(n, dtype=float) for n in attempt.disparity_px.shape[::-1]))
        off_px = np.abs(attempt.disparity_px - attempt.floor.disparity(column, row))
        near = off_px < floor_tolerance_px(attempt.disparity_px)
        masks = [near, np.zeros_like(near)]
        if attempt.region is not None:
            masks[1][attempt.region.v.astype(int), attempt.region.u.astype(int)] = True
            masks[1] = cv2.dilate(masks[1].astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
            masks[0] &= ~masks[1]
        for mask, tint in zip(masks, (BGR_BLUE, BGR_ORANGE), strict=True):
            picture[mask] = 0.6 * picture[mask] + 0.4 * np.array(tint)
    plot_image(picture.astype(np.uint8), ax, title)
    if attempt.box is None or attempt.floor is None or attempt.refused:
        return ax
    box = Box(attempt.box.own)
    for k, side in enumerate(side for side in Side if side.top in attempt.box.past):
        far = [float(side is Side.RIGHT), float(side is Side.LEFT)]
        corners = np.array([[0.0, 0.0, 0.0], [*far, 0.0], [*far, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
        at = attempt.floor.pixels(box.points(corners))
        ax.plot(*at.T, color="white", lw=1)
        ax.plot(*at[2:4].T, color=OURS, lw=2.5, label=None if k else "top line")
    ax.plot(*attempt.edge_px.T, color=OURS, ls="--", lw=2.5, label="near edge")
    ax.plot(*attempt.edge_px.T, "o", color="white", mec=OURS, ms=4)
    text = f"{attempt.height_mm / 10:.2f} ± {0.196 * attempt.std_mm:.2f} cm (95 %)"
    ax.annotate(
        text,
        tuple(attempt.edge_px[1]),
        (0, 12),
        textcoords="offset points",
        ha="center",
        fontsize=10,
        bbox={"facecolor": "white", "alpha": 0.85, "lw": 0, "pad": 2},
    )
    ax.legend(loc="lower right", fontsize=8, framealpha=0.85, ncols=2, handlelength=1.5, columnspacing=1)
    width, height = attempt.floor.rectified.size
    ax.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    return ax


@default_style
def plot_error_curves(
    true_mm: Float64, curves: Mapping[str, ErrorCurve], axes: Any, *, limit_mm: float, least: int = 30
) -> None:
    """Draw a laser's bias, spread, relative error and lost beams over the distance, a grey for each target (Fig. 5).

    Parameters
    ----------
    true_mm : (N,) float
    curves : mapping of str to ErrorCurve
        A target's name to its errors, from bright to dark.
    axes : four matplotlib.axes.Axes
    limit_mm : float
        Where the dotted line stands.
    least : int
        Fewer readings say little about a mean and a spread, and are not drawn.
    """
    shown = {"bias (mm)": "bias_mm", "spread (mm)": "spread_mm", "mean error (% of distance)": "percent"}
    greys = np.linspace(0.7, 0.0, len(curves)).astype(str)
    for ax, (label, name) in zip(axes, [*shown.items(), ("beams lost (%)", "")], strict=True):
        lines = {}
        for (target, curve), grey in zip(curves.items(), greys, strict=True):
            known = curve.n >= least
            values = (true_mm[known], getattr(curve, name)[known]) if name else (true_mm, 100 * curve.dropout)
            lines[target] = (*values, grey)
        plot_curves(lines, ax, xlabel="distance (mm)", ylabel=label)
        ax.axvline(limit_mm, color="0.6", lw=1, ls=":")


@default_style
def plot_intervals(
    names: Sequence[str],
    values: Floats,
    halves: Floats,
    ax: Axes,
    *,
    xlabel: str,
    notes: Sequence[str] | None = None,
    **style: Any,
) -> Axes:
    """Draw values with intervals, a row for each name from the top.

    Parameters
    ----------
    names : sequence of str
    values : (N,) float
    halves : (N,) float
        Half widths of the intervals.
    ax : matplotlib.axes.Axes
    xlabel : str
        With the unit.
    notes : sequence of str, optional
        Stand where a value is NaN.
    **style
        Further keywords of `matplotlib.axes.Axes.errorbar`: color, label, fmt (the marker).

    Returns
    -------
    matplotlib.axes.Axes
    """
    rows, values = np.arange(len(names)), np.asarray(values, float)
    known = np.isfinite(values)
    look: dict[str, Any] = {"fmt": "o", "ms": 4, "lw": 1.2, "capsize": 2, "color": COLORS[0]} | style
    ax.errorbar(values[known], rows[known], xerr=np.asarray(halves, float)[known], **look)
    ax.axvline(0, color="0.4", lw=0.8)
    box = {"facecolor": "white", "lw": 0, "pad": 1}
    for row in rows[~known]:
        ax.text(0, row, notes[row] if notes else "", ha="center", va="center", fontsize=9, bbox=box)
    ax.set_yticks(rows, names, fontsize=9)
    ax.set(xlabel=xlabel, ylim=(len(names) - 0.4, -0.6))
    ax.grid(alpha=0.3)
    return ax
