"""What a calibration found: where the boards were, what the lenses do, and how the two views hang together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from stereolib.base import Float64, Floats, UInt8
from stereolib.plotting.pictures import plot_image
from stereolib.plotting.style import COLORS, OURS, TRUTH, default_style, image_axes
from stereolib.rig import Camera, StereoRig

_PANE_MM, _WIDE_MM, _HIGH_MM = 110.0, 48.0, 36.0  # a pane of glass before each camera, and half its sides


@default_style
def plot_boards_in_space(outlines_mm: Floats, centres_mm: Floats, ax: Any, *, shown: int = 0) -> Any:
    """Draw boards in space, and the cameras before which they were held, to scale.

    Parameters
    ----------
    outlines_mm : (N, 4, 3) float, mm
        The corners of each board, in the left camera's frame.
    centres_mm : (2, 3) float, mm
        The two cameras.
    ax : matplotlib.axes.Axes
        Of ``panels(..., subplot_kw={"projection": "3d"})``.
    shown : int
        The board that is drawn with a thick line.

    Returns
    -------
    matplotlib.axes.Axes
    """
    for k, outline in enumerate(np.asarray(outlines_mm, float)):
        color, width = (COLORS[3], 3.0) if k == shown else (COLORS[0], 0.8)
        ax.plot(*_upright(np.vstack([outline, outline[:1]])), color=color, lw=width, zorder=2 + (k == shown))
    for centre, name in zip(np.asarray(centres_mm, float), ("left camera", "right camera"), strict=True):
        ax.plot(*_upright(centre), "o", color=TRUTH, ms=6)
        side = -1.0 if name == "left camera" else 1.0
        beside = _upright(np.add(centre, [25.0 * side, 0.0, 0.0]))[:, 0]
        ax.text(*beside, name, ha="right" if side < 0 else "left")
    ax.locator_params(nbins=4)
    ax.set(xlabel="right (mm)", ylabel="forward (mm)", zlabel="up (mm)")
    _to_scale(ax, zoom=1.35)
    return ax


@default_style
def plot_epipolar_plane(rig: StereoRig, point_mm: tuple[float, float, float], ax: Any) -> Any:
    """Draw two cameras, a point and the plane through all three, with the line that it cuts out of the right pane.

    Parameters
    ----------
    rig : StereoRig
    point_mm : (x, y, z)
        In the left camera's frame, mm.
    ax : matplotlib.axes.Axes
        Of ``panels(..., subplot_kw={"projection": "3d"})``.

    Returns
    -------
    matplotlib.axes.Axes
    """
    point, left = np.asarray(point_mm, float), np.zeros(3)
    right = -rig.R.T @ rig.T
    pane = np.array([[-_WIDE_MM, -_HIGH_MM], [_WIDE_MM, -_HIGH_MM], [_WIDE_MM, _HIGH_MM], [-_WIDE_MM, _HIGH_MM]])
    pane = np.column_stack([pane, np.full(4, _PANE_MM)])
    for corners, color in ((pane, COLORS[5]), (pane @ rig.R + right, COLORS[3])):
        ax.plot(*_upright(np.vstack([corners, corners[:1]])), color=color, lw=1.4)
    ax.plot_trisurf(*_upright(np.array([left, right, point])), color="0.6", alpha=0.35, lw=0)
    for begin, end, name in ((left, point, "$x$"), (right, point, "$x'$"), (left, right, "$T$")):
        ax.plot(*_upright(np.array([begin, end])), color=TRUTH, lw=1.2)
        ax.text(*_upright(begin + 0.5 * (end - begin) if name != "$T$" else (begin + end) / 2)[:, 0], name, fontsize=13)
    seen = np.array([_on_pane(rig, depth * point) for depth in np.linspace(0.4, 20, 100)])
    seen = seen[np.abs(seen[:, 0]) <= _WIDE_MM]
    ax.plot(*_upright((seen @ rig.R) + right), color=OURS, lw=2.6)
    for own in (point * _PANE_MM / point[2], _on_pane(rig, point) @ rig.R + right):
        ax.plot(*_upright(own), "o", color=OURS, ms=5)
    for place, name in ((left, "left camera"), (right, "right camera"), (point, "point")):
        ax.plot(*_upright(place), "o", color=TRUTH, ms=6)
        ax.text(*_upright(np.add(place, [0.0, 22.0, 0.0]))[:, 0], name, fontsize=9, ha="center", va="top")
    ax.set_axis_off()
    _to_scale(ax, zoom=1.45)
    return ax


@default_style
def plot_lens_arrows(camera: Camera, ax: Axes, title: str = "", *, longer: float = 5.0) -> Axes:
    """Draw where a lens moves the points of a pinhole's picture.

    Parameters
    ----------
    camera : Camera
    ax : matplotlib.axes.Axes
    title : str
    longer : float
        The arrows are drawn so many times as long as the shift is.

    Returns
    -------
    matplotlib.axes.Axes
    """
    columns, rows = (np.linspace(0, n - 1, k) for n, k in zip(camera.size, (17, 13), strict=True))
    pixels = np.stack(np.meshgrid(columns, rows), -1).reshape(-1, 2)
    ideal = camera.rays(pixels) @ camera.K[:2].T
    shift = longer * (pixels - ideal)
    known = np.isfinite(shift).all(axis=1)
    how: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.005, "headwidth": 3.5}
    ax.quiver(*ideal[known].T, *shift[known].T, color=OURS, **how)
    ax.plot(*camera.K[:2, 2], "+", color=TRUTH, ms=10)
    return image_axes(camera.size, ax, title)


@default_style
def plot_epipolar_lines(pictures: tuple[UInt8, UInt8], points_px: Sequence[Floats], lines: Floats, axes: Any) -> None:
    """Draw points in the left picture, and their partners and epipolar lines in the right one.

    Parameters
    ----------
    pictures : left and right, (H, W) or (H, W, 3) uint8
        Without distortion.
    points_px : two (N, 2) arrays, px
        In the left and in the right picture.
    lines : (N, 3) float
        ``a, b, c`` of ``a x + b y + c = 0`` in the right picture.
    axes : two matplotlib.axes.Axes
    """
    colors = COLORS[3], COLORS[5], COLORS[4]
    for ax, name, picture, points in zip(axes, ("left", "right"), pictures, points_px, strict=True):
        plot_image(picture, ax, f"{name} picture")
        for k, point in enumerate(points):
            ax.plot(*point, "o", ms=7, color=colors[k % 3], mec="black")
    across = np.array([0.0, pictures[1].shape[1] - 1.0])
    for k, (a, b, c) in enumerate(np.asarray(lines, float)):
        axes[1].plot(across, -(a * across + c) / b, color=colors[k % 3], lw=1.6, zorder=1)
    axes[1].set_xlim(-0.5, across[1] + 0.5)


def _on_pane(rig: StereoRig, point: Floats) -> Float64:
    """Where a point of the left camera's frame is seen on the right camera's pane, in the right camera's frame."""
    seen = rig.R @ point + rig.T
    return np.asarray(seen * _PANE_MM / seen[2])


def _upright(points: Floats) -> Float64:
    """Camera coordinates as drawn: right, forward, up."""
    x, y, z = np.atleast_2d(points).T
    return np.array([x, z, -y])


def _to_scale(ax: Any, *, zoom: float) -> None:
    """One scale for all three axes."""
    ax.set_box_aspect([np.ptp(limits) for limits in (ax.get_xlim(), ax.get_ylim(), ax.get_zlim())], zoom=zoom)
    for drawn in (*ax.lines, *ax.collections):  # the axes' own frame is a square in the middle of the figure
        drawn.set(clip_on=False, in_layout=False)
