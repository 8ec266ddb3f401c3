"""Drawings of one camera or one laser at work: what the equations of the notebooks 05 to 07 speak of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from stereolib.base import Float64
from stereolib.paper import CubeSetup, CubeView
from stereolib.plotting.curves import plot_curves
from stereolib.plotting.style import LASER, OURS, RIVAL, TRUTH, default_style

_UNIT_CM = 7.5  # so long is a unit vector drawn: the lower camera of notebook 06 stands hardly higher


@default_style
def plot_laser_triangle(ax: Axes) -> Axes:
    """Draw how a laser measures by triangulation: two targets, and the spot of each on the chip. Not to scale.

    Parameters
    ----------
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
    """
    base, focal, near, far = 2.0, 1.6, 4.0, 9.0
    ax.plot([0, far], [0, 0], color=LASER, lw=2)
    for r, style in ((near, "-"), (far, "--")):
        spot = -base - focal * base / r
        ax.plot([r, -focal], [0, spot], color=OURS, lw=1.2, ls=style)
        ax.plot([r, r], [-0.45, 0.45], color="0.3", lw=4)
        ax.plot(-focal, spot, "o", color=OURS, ms=5)
    ax.plot([0, -focal], [-base, -base], color="0.6", lw=0.8, ls=":")
    ax.plot([-focal, -focal], [-base - 1.3, -base + 0.4], color=TRUTH, lw=3)
    ax.plot([0, 0], [-base - 0.35, -base + 0.35], color="0.4", lw=4, solid_capstyle="round")
    ax.plot(0, 0, "s", color=LASER, ms=9)
    _length(ax, (0.45, 0), (0.45, -base), "$B$", (9, -6))
    _length(ax, (-focal, -base + 0.65), (0, -base + 0.65), "$f$", (0, 8))
    _length(ax, (0, 0.9), (near, 0.9), "$r$", (0, 8))
    _length(ax, (-focal - 0.35, -base), (-focal - 0.35, -base - focal * base / near), "$s$", (-9, 0))
    for text, place in (("lamp", (-0.2, 0.45)), ("lens", (0.1, -base - 0.75)), ("chip", (-focal, -base - 1.75)),
                        ("near target", (near + 0.2, 0.45)), ("far target", (far + 0.2, 0.45))):  # fmt: skip
        ax.text(*place, text, ha="left" if text == "lens" or "target" in text else "center", va="center", fontsize=10)
    ax.set(xlim=(-3, far + 2.2), ylim=(-base - 2.1, 1.6), aspect="equal", title="from above; not to scale")
    ax.set_axis_off()
    return ax


@default_style
def plot_expected_ray(ax: Axes) -> Axes:
    """Draw a pixel's ray from the side, and the two surfaces that it can meet: the floor, what the laser met. No scale.

    Parameters
    ----------
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
    """
    h, X, floor, step = 1.0, 2.9, 3.9, 1.25
    down = step * h / floor
    ax.axhline(0, color="0.3", lw=2)
    ax.plot([0, X], [1.3, 1.3], color=LASER, lw=1.2, ls="--", label="laser's beam")
    ax.plot([X, X], [0, 1.6], color=LASER, lw=3, label="what it met, upright")
    ax.plot([0, X], [h, h * (1 - X / floor)], color=OURS, lw=1.8, label="ray of a pixel")
    ax.plot([X, floor], [h * (1 - X / floor), 0], color=OURS, lw=1.2, ls=":")
    ax.plot(0, h, "s", color=OURS, ms=9)
    ax.plot(step, h - down, "o", color=OURS, ms=7)
    ax.plot([0, step, step], [h, h, h - down], color="0.4", lw=1, ls=":")
    _length(ax, (-0.2, 0), (-0.2, h), "$h$", (-9, 0))
    _length(ax, (0, -0.13), (X, -0.13), "$X$", (0, -9))
    for text, place in (("$D_x$", (0.7, 1.1)), ("$-D_z$", (step + 0.33, h - down / 2))):
        ax.text(*place, text, fontsize=12, ha="center", va="center")
    ax.annotate("depth 1", (step, h - down), (-6, -16), textcoords="offset points", fontsize=10, ha="center")
    ax.set(xlim=(-0.6, floor + 0.2), ylim=(-0.42, 2.25), title="from the side; not to scale")
    ax.legend(frameon=False, fontsize=9, loc="upper left")
    ax.set_axis_off()
    return ax


@default_style
def plot_face_end(setup: CubeSetup, axes: Any, *, turned_deg: float = 0.0) -> None:
    """Draw a laser's beams on the faces of a cube that stands edge-on, to scale, and large where one face ends.

    Parameters
    ----------
    setup : CubeSetup
    axes : two matplotlib.axes.Axes
    turned_deg : float
        By which the first beam is turned from the near edge.
    """
    near, half = setup.distance_mm, setup.side_mm / np.sqrt(2)
    beams = np.radians(np.arange(-25, 26) + turned_deg)
    along = near / (np.cos(beams) - np.sin(np.abs(beams)))  # on the lines that hold the faces
    points = np.c_[along * np.sin(beams), along * np.cos(beams)]
    meets = np.abs(points[:, 0]) <= half
    last = points[meets][-1]
    missing = points[np.flatnonzero(meets)[-1] + 1]
    for ax, reach in zip(axes, (2500.0, 2500.0), strict=True):
        for beam, point, hit in zip(beams, points, meets, strict=True):
            end = point if hit else reach * np.array([np.sin(beam), np.cos(beam)])
            ax.plot([0, end[0]], [0, end[1]], color=LASER, lw=0.7, alpha=0.7, zorder=1)
        ax.fill([0, half, 0, -half], near + half * np.array([0, 1, 2, 1]), color="0.88", ec="0.4", zorder=2)
        for side in (-1, 1):
            ax.plot([0, side * 1.2 * half], [near, near + 1.2 * half], color=TRUTH, lw=1.2, ls="--", zorder=3)
        ax.plot(*points[meets].T, "o", color=LASER, ms=5, zorder=4)
        ax.set(aspect="equal", xlabel="to the right (mm)", ylabel="forward (mm)")
    axes[0].plot(0, 0, "^", color=TRUTH, ms=8)
    axes[0].set(xlim=(-350, 350), ylim=(-60, near + 2 * half + 30), title="the beams")
    middle = (last + missing) / 2
    axes[1].plot(*missing, "o", mfc="white", mec=LASER, ms=7, zorder=4)
    axes[1].plot(*middle, "D", color=OURS, ms=7, zorder=4)
    for text, point, shift in (("last beam that meets it", last, (18, -46)), ("first that misses", missing, (-40, 24)),
                               ("end, put half-way", middle, (14, -24))):  # fmt: skip
        axes[1].annotate(text, point, shift, textcoords="offset points", fontsize=9, arrowprops={"arrowstyle": "-"},
                         ha="left" if shift[0] > 0 else "right",
                         bbox={"facecolor": "white", "alpha": 0.85, "lw": 0, "pad": 1}, zorder=5)  # fmt: skip
    axes[1].set(xlim=(half - 65, half + 75), ylim=(near + half - 75, near + half + 65), title="where the face ends")


@default_style
def plot_edge_depths(views: Mapping[str, CubeView], setup: CubeSetup, axes: Any) -> None:
    """Draw cameras before the near edge of a cube from the side, to scale, and how far along the axis its ends are.

    Parameters
    ----------
    views : mapping of str to CubeView
        A camera for each panel.
    setup : CubeSetup
    axes : sequence of matplotlib.axes.Axes
    """
    near, tall, back = setup.distance_mm / 10, setup.side_mm / 10, np.sqrt(2) * setup.side_mm / 10
    for ax, (name, view) in zip(axes, views.items(), strict=True):
        eye, axis = (
            np.array([0.0, view.camera_height_mm / 10]),
            np.array([np.cos(view.pitch_rad), np.sin(view.pitch_rad)]),
        )
        ax.fill([near, near + back, near + back, near], [0, 0, tall, tall], color="0.88", lw=0)
        ax.axhline(0, color="0.3", lw=2)
        ax.plot(*np.c_[eye, eye + 100 * axis], color=OURS, lw=1.2, ls="--", label="the camera's axis")
        ax.plot([near, near], [0, tall], color=TRUTH, lw=3, label="near edge")
        for place, up, look in (
            ("foot", 0.0, {"marker": "o", "ms": 11, "mfc": "none"}),
            ("top", tall, {"marker": "s"}),
        ):
            point = np.array([near, up])
            depth = (point - eye) @ axis
            ax.plot(*np.c_[point, eye + depth * axis], color=RIVAL, lw=1.4, ls=":")
            label = f"$Z$ of its {place}: {depth:.1f} cm"
            ax.plot(*(eye + depth * axis), ls="", color=RIVAL, label=label, **look)
        ax.plot(*eye, "o", color=OURS, ms=8)
        ax.set(xlim=(-8, 105), ylim=(-4, 62), aspect="equal", title=name, xlabel="forward (cm)", ylabel="up (cm)")
        ax.legend(frameon=False, fontsize=8.5, loc="upper left", ncols=2)


@default_style
def plot_floor_rays(setup: CubeSetup, heights_cm: Mapping[str, float], axes: Any) -> None:
    """Draw the ray to a cube's top and where it meets the plane of the floor, from the side and to scale.

    Parameters
    ----------
    setup : CubeSetup
    heights_cm : mapping of str to float
        Of the cameras, one for each panel: above the cube the ray meets the floor behind it, below it behind the
        camera.
    axes : sequence of matplotlib.axes.Axes
    """
    near, tall, back = setup.distance_mm / 10, setup.side_mm / 10, np.sqrt(2) * setup.side_mm / 10
    for ax, (name, height) in zip(axes, heights_cm.items(), strict=True):
        floor = near * height / (height - tall)
        ax.fill([near, near + back, near + back, near], [0, 0, tall, tall], color="0.88", lw=0)
        ax.axhline(0, color="0.3", lw=2)
        ax.plot([0, near], [height, tall], color=OURS, lw=1.6)
        ax.plot([0 if floor < 0 else near, floor], [height if floor < 0 else tall, 0], color=OURS, lw=1.2, ls="--")
        ax.plot(near, tall, "s", color=TRUTH, ms=7, label="top of the edge")
        ax.plot(floor, 0, "D", color=RIVAL, ms=8, zorder=5, label="the same ray on the floor's plane")
        ax.plot(0, height, "o", color=OURS, ms=8)
        beside = -33 if floor > 0 else 24
        _length(ax, (beside, 0), (beside, height), r"$h_\mathrm{cam}$", (18, 0))
        _length(ax, (near - 5, 0), (near - 5, tall), "$h$", (-8, 0))
        ax.annotate("", (0, height - _UNIT_CM), (0, height), arrowprops={"arrowstyle": "->", "lw": 1.6})
        side = {"xytext": (-6, 0), "ha": "right"} if floor > 0 else {"xytext": (6, 0)}
        ax.annotate("$n / |n|$", (0, height - _UNIT_CM), **side, textcoords="offset points", fontsize=12)
        ends = {"xlim": (-40, 150), "ylim": (-6, 92)} if floor > 0 else {"xlim": (-35, 79), "ylim": (-4, 54.8)}
        ax.set(**ends, aspect="equal", title=name, xlabel="forward (cm)", ylabel="up (cm)")
        ax.legend(frameon=False, fontsize=8.5, loc="upper left")


@default_style
def plot_camera_heights(
    heights_mm: Float64,
    widths_px: Mapping[str, Float64],
    ax: Axes,
    *,
    printed_px: float,
    ends_px: float,
    from_mm: float,
) -> Axes:
    """Draw how wide a cube is in the picture over the height of the camera, and where that agrees with what is printed.

    Parameters
    ----------
    heights_mm : (N,) float
    widths_px : mapping of str to (M, N) float
        For each way to read the print its M set-ups; the middle one is as printed.
    ax : matplotlib.axes.Axes
    printed_px : float
        The printed width.
    ends_px : float
        By which a width may miss it.
    from_mm : float
        The camera height from which the second way differs from the first.

    Returns
    -------
    matplotlib.axes.Axes
    """
    lines, fits = {}, np.zeros((len(widths_px), len(heights_mm)), bool)
    for k, ((name, widths), color) in enumerate(zip(widths_px.items(), (OURS, RIVAL), strict=False)):
        drawn = heights_mm >= (from_mm if k else 0)
        lines[name] = heights_mm[drawn] / 10, widths[len(widths) // 2][drawn], color
        fits[k] = drawn & (np.abs(widths - printed_px) <= ends_px).any(axis=0)
        low, high = widths.min(axis=0), widths.max(axis=0)
        ax.fill_between(heights_mm / 10, low, high, where=drawn, color=color, alpha=0.15, lw=0)
        ax.fill_between(heights_mm / 10, np.maximum(low, printed_px - ends_px), np.minimum(high, printed_px + ends_px),
                        where=fits[k], color=color, alpha=0.5, lw=0)  # fmt: skip
    plot_curves(lines, ax, marker="", xlabel="camera height (cm)", ylabel="width of the cube (px)")
    ax.axhline(printed_px, color=TRUTH, ls=":", lw=1.2, label=f"printed: {printed_px:g} px")
    ax.legend(frameon=False, fontsize=9, loc="lower left")
    return ax


def _length(
    ax: Axes, begin: tuple[float, float], end: tuple[float, float], name: str, offset: tuple[float, float]
) -> None:
    ax.annotate("", begin, end, arrowprops={"arrowstyle": "<->", "lw": 1.0, "shrinkA": 0, "shrinkB": 0})
    middle = (begin[0] + end[0]) / 2, (begin[1] + end[1]) / 2
    ax.annotate(name, middle, offset, textcoords="offset points", fontsize=12, ha="center", va="center")
