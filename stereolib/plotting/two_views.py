"""Two views of one thing, for readers who have never met stereo: drawings to scale, and pairs with marks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from stereolib.base import Floats, UInt8
from stereolib.paper import CubeSetup, CubeView
from stereolib.plotting.pictures import plot_image
from stereolib.plotting.style import COLORS, OURS, REFUSED, TRUTH, default_style

LEFT, RIGHT = COLORS[5], COLORS[3]  # the two eyes, wherever they are told apart


@default_style
def plot_thumb(eyes_mm: float, thumbs_mm: tuple[float, float], wall_mm: float, ax: Axes) -> Axes:
    """Draw two eyes, a thumb at some distances and where both see it on a wall, from above and to scale.

    Parameters
    ----------
    eyes_mm : float
        From eye to eye.
    thumbs_mm : two floats
        Distances of the thumb, the farther one first.
    wall_mm : float
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
    """
    eyes = (("left eye", eyes_mm / 2, LEFT), ("right eye", -eyes_mm / 2, RIGHT))
    for thumb, style, up in zip(thumbs_mm, ("-", "--"), (1, -1), strict=True):
        ends = [side * (1 - wall_mm / thumb) for _, side, _ in eyes]
        for (_, side, color), end in zip(eyes, ends, strict=True):
            ax.plot([0, wall_mm], [side, end], color=color, ls=style, lw=1.6)
        ax.plot(thumb, 0, "o", color=TRUTH, ms=8, zorder=4)
        thin = {"arrowstyle": "-", "lw": 0.8}
        ax.annotate(
            f"thumb at {thumb:.0f} mm",
            (thumb, 0),
            (thumb, up * 1.2 * eyes_mm),
            ha="center",
            va="center",
            arrowprops=thin,
        )
    for name, side, color in eyes:
        ax.plot(0, side, "o", color=color, ms=9)
        ax.annotate(name, (0, side), (-9, 0), textcoords="offset points", ha="right", va="center")
    ax.axvline(wall_mm, color="0.5", lw=4)
    ax.annotate("wall", (wall_mm, 0), (7, 0), textcoords="offset points", va="center")
    highest = eyes_mm / 2 * (wall_mm / min(thumbs_mm) - 1)
    ax.set(xlabel="distance from the eyes (mm)", ylabel="sideways (mm)", aspect="equal")
    ax.set(xlim=(-0.2 * wall_mm, 1.09 * wall_mm), ylim=(-1.15 * highest, 1.35 * highest))
    return ax


@default_style
def plot_similar_triangles(pane_mm: float, baseline_mm: float, point_mm: tuple[float, float], axes: Any) -> None:
    """Draw one pinhole and its two similar triangles, then two pinholes and theirs, from above and to scale.

    Parameters
    ----------
    pane_mm : float
        From a pinhole to the pane of glass on which its picture stands.
    baseline_mm : float
        From pinhole to pinhole.
    point_mm : (x, z)
        The point that both see, from the left pinhole.
    axes : two matplotlib.axes.Axes
    """
    x, z = point_mm
    one, two = axes
    _pinhole(one, 0.0, pane_mm, point_mm, LEFT)
    one.fill([0, x, 0], [0, z, z], color=LEFT, alpha=0.15, lw=0)
    one.fill([0, x * pane_mm / z, 0], [0, pane_mm, pane_mm], color=LEFT, alpha=0.5, lw=0)
    _measure(one, (-14, 0), (-14, pane_mm), "f")
    _measure(one, (-44, 0), (-44, z), "Z")
    _measure(one, (0, z + 12), (x, z + 12), "X")
    _measure(one, (0, pane_mm + 9), (x * pane_mm / z, pane_mm + 9), "x")
    one.set_title("one pinhole: $x/f = X/Z$")
    _pinhole(two, 0.0, pane_mm, point_mm, LEFT)
    _pinhole(two, baseline_mm, pane_mm, point_mm, RIGHT)
    shifted = baseline_mm + x * pane_mm / z, x + baseline_mm
    two.plot([baseline_mm, shifted[1]], [0, z], color=LEFT, lw=1.4, ls="--")
    crossing = baseline_mm + (x - baseline_mm) * pane_mm / z
    two.fill([baseline_mm, x, shifted[1]], [0, z, z], color="0.5", alpha=0.15, lw=0)
    two.fill([baseline_mm, crossing, shifted[0]], [0, pane_mm, pane_mm], color="0.5", alpha=0.5, lw=0)
    _measure(two, (0, -22), (baseline_mm, -22), "B")
    _measure(two, (x, z + 12), (shifted[1], z + 12), "B")
    _measure(two, (crossing, pane_mm + 9), (shifted[0], pane_mm + 9), "d")
    for name, begin, end in (("x_l", 0.0, x * pane_mm / z), ("x_r", baseline_mm, crossing)):
        two.plot([begin, end], [pane_mm, pane_mm], color=TRUTH, lw=5, solid_capstyle="butt", zorder=4)
        middle, beside = ((begin + end) / 2, pane_mm), (min(begin, end) - 24, 0.7 * pane_mm)
        leader = {"arrowstyle": "-", "color": "0.4", "lw": 0.8}
        two.annotate(f"${name}$", middle, beside, ha="center", va="center", fontsize=12, arrowprops=leader)
    _measure(two, (shifted[0] + 22, 0), (shifted[0] + 22, pane_mm), "f")
    _measure(two, (shifted[1] + 14, 0), (shifted[1] + 14, z), "Z")
    small = {"arrowstyle": "-", "color": "0.4", "lw": 0.8}
    two.annotate("$B$ by $Z$", (x + baseline_mm / 2, 0.8 * z), ha="center", va="center", fontsize=12)
    two.annotate("$d$ by $f$", (baseline_mm + 2, 45), (46, 22), ha="center", va="center", fontsize=12, arrowprops=small)
    two.set_title("two pinholes: $d/f = B/Z$")
    for ax in axes:
        ax.set(xlim=(-85, x + baseline_mm + 55), ylim=(-48, z + 45), aspect="equal")
        ax.set(xlabel="to the right (mm)", ylabel="forward (mm)")


@default_style
def plot_toe_in(baseline_mm: float, angle_deg: float, foot_mm: Floats, ax: Axes) -> Axes:
    """Draw two cameras that are turned towards each other before a box, from above and to scale.

    Parameters
    ----------
    baseline_mm : float
    angle_deg : float
        Between the directions in which they look.
    foot_mm : (3, 2+) float, mm
        Left, near and right corner of the box: forward and left from the left camera.
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
    """
    left, near, right = np.asarray(foot_mm, float)[:, :2]
    box, reach = np.array([left, near, right, left + right - near]), float(near[0]) * 1.25
    ax.fill(*box.T, color="#c9a26b", lw=0)
    ax.annotate("cube", ((reach + box[3, 0]) / 2, near[1]), ha="center", va="center")
    slope = np.tan(np.radians(angle_deg / 2))
    for name, side, turn, color in (("left", 0.0, -slope, LEFT), ("right", -baseline_mm, slope, RIGHT)):
        ax.plot([0, reach], [side, side], color=REFUSED, lw=0.9, ls=":")
        ax.plot([0, reach], [side, side + turn * reach], color=color, lw=1.6)
        ax.plot(0, side, "o", color=color, ms=8)
        up = 10 if name == "left" else -10
        ax.annotate(f"{name} camera", (0, side), (0, up), textcoords="offset points", ha="center", va="center")
    ax.set(xlabel="forward (mm)", ylabel="to the left (mm)", aspect="equal")
    ax.set(xlim=(-110, box[:, 0].max() + 25), ylim=(box[:, 1].min() - 25, box[:, 1].max() + 25))
    return ax


@default_style
def plot_two_turns(axes: Sequence[Axes], *, outward_deg: tuple[float, float] = (-6.0, 20.0)) -> None:
    """Sketch the two steps of rectification from above: as it stands, after half-way turns, and lined up.

    Parameters
    ----------
    axes : three matplotlib.axes.Axes
    outward_deg : (left, right)
        By what the two cameras are turned to the left at the beginning, degrees; drawn large on purpose.
    """
    middle = sum(outward_deg) / 2
    stages = (("as it stands", outward_deg), ("1. meet half-way", (middle, middle)), ("2. line up", (0.0, 0.0)))
    for ax, (title, turns) in zip(axes, stages, strict=True):
        ax.plot([-0.9, 1.9], [0, 0], color=REFUSED, lw=0.9, ls=":")
        ax.annotate("baseline", (0.5, -0.12), ha="center", va="center", fontsize=9, color="0.35")
        for at, turn, color in ((0.0, turns[0], LEFT), (1.0, turns[1], RIGHT)):
            ahead = np.array([-np.sin(np.radians(turn)), np.cos(np.radians(turn))])
            across, foot = np.array([ahead[1], -ahead[0]]), np.array([at, 0.0])
            pane = foot + 0.55 * ahead
            ax.plot(*np.transpose([pane - 0.85 * across, pane + 0.85 * across]), color=color, lw=0.9, ls="--")
            ax.plot(*np.transpose([pane - 0.36 * across, pane + 0.36 * across]), color=color, lw=4)
            arrow = {"arrowstyle": "-|>", "color": color, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
            tip = foot + 1.15 * ahead
            ax.annotate("", (tip[0], tip[1]), (at, 0.0), arrowprops=arrow)
            ax.plot(*foot, "o", color=color, ms=8)
        ax.set(xlim=(-1.0, 2.0), ylim=(-0.25, 1.3), aspect="equal", title=title, xticks=[], yticks=[])


def _pinhole(ax: Axes, at: float, pane_mm: float, point_mm: tuple[float, float], color: str) -> None:
    """A pinhole, its pane of glass, its axis and its ray to a point."""
    x, z = point_mm
    ax.plot([at, at], [0, z], color="0.6", lw=0.8, ls=":")
    ax.plot([at - 38, at + 38], [pane_mm, pane_mm], color=color, lw=2.5)
    ax.plot([at, x], [0, z], color=color, lw=1.6)
    ax.plot(at, 0, "o", color=color, ms=8)
    ax.plot(x, z, "s", color=TRUTH, ms=7, zorder=4)


def _measure(ax: Axes, begin: tuple[float, float], end: tuple[float, float], name: str) -> None:
    """A length between two arrow heads, with its name."""
    ax.annotate("", begin, end, arrowprops={"arrowstyle": "<->", "lw": 1.0, "shrinkA": 0, "shrinkB": 0})
    middle = (begin[0] + end[0]) / 2, (begin[1] + end[1]) / 2
    upright = begin[0] == end[0]
    place: dict[str, Any] = {"ha": "right", "va": "center"} if upright else {"ha": "center", "va": "bottom"}
    offset = (-3, 0) if upright else (0, 2)
    ax.annotate(f"${name}$", middle, offset, textcoords="offset points", fontsize=12, **place)


@default_style
def plot_camera_and_cube(view: CubeView, setup: CubeSetup, half_view_rad: float, axes: Any) -> None:
    """Draw a camera before a cube that stands edge-on, to scale: from above, as if level, then from the side.

    Parameters
    ----------
    view : CubeView
        Of the camera.
    setup : CubeSetup
    half_view_rad : float
        From the camera's axis to the lower border of its picture.
    axes : two matplotlib.axes.Axes
    """
    above, aside = axes
    near, half = setup.distance_mm / 10, setup.side_mm / np.sqrt(2) / 10
    middle, pane = near + half, 0.3 * (near + half)
    above.fill([near, middle, near + 2 * half, middle], [0, half, 0, -half], color="0.85", ec="0.4")
    for side in (-1, 1):
        above.plot([0, middle], [0, side * half], color=OURS, lw=1.4)
    above.plot([pane, pane], [-pane / 2, pane / 2], color="0.3", lw=2)
    above.plot(0, 0, "o", color=OURS, ms=8)
    _measure(above, (middle, -half), (middle, half), "L")
    _measure(above, (0, -half - 9), (middle, -half - 9), "Z")
    _measure(above, (pane - 2, -pane * half / middle), (pane - 2, pane * half / middle), "w")
    _measure(above, (0, pane / 2), (pane, pane / 2), "f")
    above.set(title="from above, as for a level camera", aspect="equal")
    above.set(xlabel="forward (cm)", ylabel="to the left (cm)")
    above.set(xlim=(-20, near + 2 * half + 3), ylim=(-half - 13, half + 4))
    height, reach = view.camera_height_mm / 10, near + 2 * half
    border = view.pitch_rad + half_view_rad * np.array([-1, 1])
    aside.fill_between([0, reach], height + np.tan(border[0]) * np.array([0, reach]),
                       height + np.tan(border[1]) * np.array([0, reach]), color=OURS, alpha=0.08, lw=0)  # fmt: skip
    aside.fill([near, reach, reach, near], [0, 0, setup.side_mm / 10, setup.side_mm / 10], color="0.85", ec="0.4")
    aside.axhline(0, color="0.3", lw=2)
    aside.plot([0, reach], [height, height], color="0.6", lw=0.8, ls=":")
    aside.plot([0, reach], [height, height + np.tan(view.pitch_rad) * reach], color=OURS, lw=1.2, ls="--")
    aside.plot([0, near], [height, 0], color=OURS, lw=1.4)
    aside.plot(0, height, "o", color=OURS, ms=8)
    aside.text(
        0.55 * near, height + 0.27 * np.tan(view.pitch_rad) * near, r"$\theta$", ha="center", va="center", fontsize=12
    )
    _measure(aside, (-4, 0), (-4, height), r"h_\mathrm{cam}")
    _measure(aside, (0, -11), (near, -11), "D")
    aside.set(title="from the side", xlabel="forward (cm)", ylabel="up (cm)", aspect="equal")
    aside.set(xlim=(-20, reach + 3), ylim=(-15, setup.side_mm / 10 + 6))


@default_style
def plot_pair(pictures: tuple[UInt8, UInt8], points_px: Any, axes: Any) -> None:
    """Draw both pictures of a pair with ringed points, their places in pixels beside them.

    Parameters
    ----------
    pictures : left and right, (H, W) or (H, W, 3) uint8
    points_px : two (N, 2) arrays, px
        Of the left and of the right picture; either may be empty.
    axes : two matplotlib.axes.Axes
    """
    for ax, name, picture, points in zip(axes, ("left picture", "right picture"), pictures, points_px, strict=True):
        plot_image(picture, ax, name)
        for column, row in np.reshape(points, (-1, 2)):
            ax.plot(column, row, "o", ms=11, mfc="none", mec="black", mew=3.2)
            ax.plot(column, row, "o", ms=11, mfc="none", mec="white", mew=1.6)
            low = row > picture.shape[0] / 2
            ax.annotate(
                f"column {column:.0f}\nrow {row:.0f}",
                (column, row),
                (11, -13 if low else 7),
                textcoords="offset points",
                va="bottom",
                fontsize=9,
                bbox={"facecolor": "white", "alpha": 0.85, "lw": 0, "pad": 1.5},
            )


@default_style
def plot_line_of_sight(line_px: Floats, depths_mm: Sequence[float], ax: Axes) -> Axes:
    """Draw onto a picture where a point of the other one would be at many distances, and name some of these.

    Parameters
    ----------
    line_px : (N, 2) float, px
        From near to far; the places of ``depths_mm`` stand at its end.
    depths_mm : sequence of float
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
    """
    line = np.asarray(line_px, float)
    curve, named = line[: -len(depths_mm)], line[-len(depths_mm) :]
    ax.plot(*curve.T, color=OURS, lw=1.6)
    for k, (place, depth) in enumerate(zip(named, depths_mm, strict=True)):
        ax.plot(*place, "o", ms=5, color=OURS)
        ax.annotate(
            f"{depth / 1000:g} m",
            tuple(place),
            (0, 13 if k % 2 else -13),
            textcoords="offset points",
            ha="center",
            va="bottom" if k % 2 else "top",
            fontsize=9,
            bbox={"facecolor": "white", "alpha": 0.85, "lw": 0, "pad": 1.0},
        )
    return ax
