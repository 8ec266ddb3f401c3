"""Figures of the floor and of what stands on it, and of measurements with their intervals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from stereolib.measurement import HeightAttempt, floor_tolerance_px
from stereolib.plotting.charts import COLORS, Array, Axes, plot_image
from stereolib.rig import to_grey

_TINTS = ((178, 114, 0), (0, 159, 230))  # blue-green-red: the floor, the object


def plot_found(attempt: HeightAttempt, ax: Axes, title: str = "") -> Axes:
    """What the ground plane's method saw: floor (blue), object (orange), faces, near edge, and the top line."""
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
        for mask, tint in zip(masks, _TINTS, strict=True):
            picture[mask] = 0.6 * picture[mask] + 0.4 * np.array(tint)
    plot_image(picture.astype(np.uint8), ax, title)
    if attempt.measured is None or attempt.floor is None:
        return ax
    found = attempt.measured
    for face in found.faces:
        ground = face.points_mm(np.array(face.bearing))
        upright = [[*ground[k], z] for k, z in ((0, 0), (1, 0), (1, found.height_mm), (0, found.height_mm), (0, 0))]
        at = attempt.floor.pixels(np.array(upright))
        ax.plot(*at.T, color="white", lw=1)
        ax.plot(*at[2:4].T, color=COLORS[1], lw=2.5, label="top line" if face is found.faces[0] else None)
    edge = np.stack([found.foot_px, found.top_px])
    ax.plot(*edge.T, color=COLORS[6], lw=2.5, label="near edge")
    ax.plot(*edge.T, "o", color="white", mec=COLORS[6], ms=4)
    text = f"{found.height_mm / 10:.2f} ± {0.196 * found.height_std_mm:.2f} cm"
    ax.annotate(text, tuple(found.top_px), (0, 12), textcoords="offset points", ha="center", fontsize=9,
                bbox={"facecolor": "white", "alpha": 0.85, "lw": 0, "pad": 2})  # fmt: skip
    ax.legend(loc="upper right", fontsize=8, framealpha=0.85)
    width, height = attempt.floor.rectified.size
    ax.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    return ax


def plot_intervals(
    names: Sequence[str],
    values: Array,
    halves: Array,
    ax: Axes,
    *,
    xlabel: str,
    title: str = "",
    notes: Sequence[str] | None = None,
    label: str | None = None,
    color: str = COLORS[0],
    marker: str = "o",
) -> Axes:
    """Values with intervals of half-width `halves`, a row for each name from the top; a note where a value is NaN."""
    rows, values = np.arange(len(names)), np.asarray(values, float)
    known = np.isfinite(values)
    style: dict[str, Any] = {"fmt": marker, "ms": 4, "lw": 1.2, "capsize": 2, "color": color, "label": label}
    ax.errorbar(values[known], rows[known], xerr=np.asarray(halves, float)[known], **style)
    ax.axvline(0, color="0.4", lw=0.8)
    for row in rows[~known]:
        ax.text(0, row, notes[row] if notes else "", ha="center", va="center", fontsize=8,
                bbox={"facecolor": "white", "lw": 0, "pad": 1})  # fmt: skip
    ax.set_yticks(rows, names, fontsize=8)
    ax.set(xlabel=xlabel, title=title, ylim=(len(names) - 0.4, -0.6))
    ax.grid(alpha=0.3)
    return ax
