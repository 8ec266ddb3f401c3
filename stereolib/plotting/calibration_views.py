"""What a calibration found: where the boards were, what the lenses do, and how the two views hang together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from mpl_toolkits.mplot3d import proj3d

from stereolib.base import Float64, Floats, UInt8
from stereolib.calibration import HoldOut
from stereolib.plotting.curves import plot_curves
from stereolib.plotting.pictures import plot_image
from stereolib.plotting.style import COLORS, OURS, REFUSED, TRUTH, default_style, image_axes
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
    for begin, end in ((left, point), (right, point), (left, right)):
        ax.plot(*_upright(np.array([begin, end])), color=TRUTH, lw=1.2)
    seen = np.array([_on_pane(rig, depth * point) for depth in np.linspace(0.4, 20, 100)])
    seen = seen[np.abs(seen[:, 0]) <= _WIDE_MM]
    ax.plot(*_upright((seen @ rig.R) + right), color=OURS, lw=2.6)
    on_left, on_right = point * _PANE_MM / point[2], _on_pane(rig, point) @ rig.R + right
    for place, color, size in (
        (on_left, OURS, 5),
        (on_right, OURS, 5),
        *((at, TRUTH, 6) for at in (left, right, point)),
    ):
        ax.plot(*_upright(place), "o", color=color, ms=size)
    ax.set_axis_off()
    _to_scale(ax, zoom=1.9)
    for place, name, offset in (
        (left, "left camera", (-9, 0)),
        (right, "right camera", (0, -16)),
        (point, "point $P$", (10, 0)),
        (0.6 * point, "$q_l$", (-11, 8)),
        (right + 0.6 * (point - right), "$q_r$", (11, -9)),
        (right / 2, "$T$", (-9, -9)),
        (on_left, "$p_l$", (-9, 9)),
        (on_right, "$p_r$", (-3, -14)),
        (seen[np.argmax(seen[:, 0])] @ rig.R + right, "epipolar line", (38, -4)),
    ):
        _label(ax, place, name, offset)
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
    known, (width, height) = np.isfinite(shift).all(axis=1), camera.size
    how: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.005, "headwidth": 3.5}
    ax.quiver(*ideal[known].T, *shift[known].T, color=OURS, **how)
    ax.plot(*camera.K[:2, 2], "+", color=TRUTH, ms=10)
    image_axes(camera.size, ax, title)
    ax.add_patch(Rectangle((-0.5, -0.5), width, height, fill=False, ec=REFUSED, lw=1.2))
    beyond = max(36.0, float(np.nanmax(np.abs(ideal - pixels))) + 4)  # some arrows begin outside the picture
    ax.set(xlim=(-beyond, width + beyond), ylim=(height + beyond, -beyond))
    return ax


@default_style
def plot_camera_matrix(camera: Camera, direction: tuple[float, float], ax: Axes) -> Axes:
    """Draw how the camera matrix turns a direction into a pixel: its four numbers as lengths in the picture.

    Parameters
    ----------
    camera : Camera
        Its lens is left out.
    direction : (X / Z, Y / Z)
        To the right and down.
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
    """
    cx, cy = camera.K[:2, 2]
    u, v = camera.K[:2, :2] @ np.asarray(direction, float) + camera.K[:2, 2]
    for begin, end, name, color in (
        ((0.0, cy), (cx, cy), "$c_x$", TRUTH),
        ((cx, 0.0), (cx, cy), "$c_y$", TRUTH),
        ((cx, cy), (u, cy), "$f_x\\,x'$", OURS),
        ((u, cy), (u, v), "$f_y\\,y'$", OURS),
    ):
        ax.annotate(
            "", end, begin, arrowprops={"arrowstyle": "-|>", "color": color, "lw": 1.4, "shrinkA": 0, "shrinkB": 0}
        )
        level = begin[1] == end[1]
        place: dict[str, Any] = {"ha": "center", "va": "bottom"} if level else {"ha": "left", "va": "center"}
        middle = (begin[0] + end[0]) / 2, (begin[1] + end[1]) / 2
        ax.annotate(
            name, middle, (0, 3) if level else (4, 0), textcoords="offset points", color=color, fontsize=12, **place
        )
    ax.plot([cx], [cy], "+", color=TRUTH, ms=12, mew=2)
    ax.annotate("principal point", (cx, cy), (-7, -9), textcoords="offset points", ha="right", va="center")
    ax.plot([u], [v], "o", color=OURS, ms=6)
    ax.annotate("pixel $(u, v)$", (u, v), (7, -3), textcoords="offset points", va="center", color=OURS)
    return image_axes(camera.size, ax, "")


@default_style
def plot_hold_out(results: Sequence[HoldOut], ax: Axes, title: str = "") -> Axes:
    """Draw how well lens models fit the pairs that they were fitted to, and those left out.

    Parameters
    ----------
    results : sequence of HoldOut
        From `hold_out_errors`.
    ax : matplotlib.axes.Axes
    title : str

    Returns
    -------
    matplotlib.axes.Axes
    """
    names = [result.model for result in results]
    curves = {
        "pairs fitted": (names, [result.train_rms_px for result in results], OURS),
        "pairs left out": (names, [result.hold_out_rms_px for result in results], TRUTH),
    }
    plot_curves(curves, ax, xlabel="lens model", ylabel="reprojection error (px, rms)", title=title)
    ax.tick_params(axis="x", rotation=60)
    return ax


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


def _label(ax: Any, place: Floats, name: str, offset: tuple[float, float]) -> None:
    """A name beside a point in space, so many points of print away."""
    x, y, z = _upright(place)[:, 0]
    at = proj3d.proj_transform(x, y, z, ax.get_proj())[:2]
    size = 13 if name.startswith("$") else 9.5
    across = "center" if abs(offset[0]) < 5 or name.startswith("$") else ("left" if offset[0] > 0 else "right")
    ax.annotate(
        name, at, offset, textcoords="offset points", fontsize=size, ha=across, va="center", annotation_clip=False
    )


def _to_scale(ax: Any, *, zoom: float) -> None:
    """One scale for all three axes."""
    ax.set_box_aspect([np.ptp(limits) for limits in (ax.get_xlim(), ax.get_ylim(), ax.get_zlim())], zoom=zoom)
    for drawn in (*ax.lines, *ax.collections):  # the axes' own frame is a square in the middle of the figure
        drawn.set(clip_on=False, in_layout=False)
