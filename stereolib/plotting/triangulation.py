"""The geometry of disparity, as the paper draws it in Fig. 2."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from stereolib.plotting.style import COLORS, default_style


@default_style
def plot_triangulation(f_px: float, baseline_mm: float, depth_mm: float, ax: Axes) -> Axes:
    """Draw the geometry of disparity (Fig. 2), seen from above, image planes before the lenses and enlarged.

    Parameters
    ----------
    f_px, baseline_mm : float
        Of the rectified rig.
    depth_mm : float
        Of the point, mm.
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
    """
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
        ax.annotate(
            f"${sign}$ = {f_px * (point[0] - x) / depth_mm:+.1f} px",
            ((x + crossing) / 2, plane),
            (side * 42, 10),
            textcoords="offset points",
            ha="center",
        )
    ax.plot(*point, "s", color="black")
    ax.annotate(f"P, Z = {depth_mm:.0f} mm", tuple(point), (8, 4), textcoords="offset points")
    ax.annotate("", (0, -0.13 * depth_mm), (baseline_mm, -0.13 * depth_mm), arrowprops={"arrowstyle": "<->"})
    ax.annotate(f"B = {baseline_mm:.1f} mm", (baseline_mm / 2, -0.17 * depth_mm), ha="center", va="top")
    ax.set(xlim=(-110, baseline_mm + 110), ylim=(-0.26 * depth_mm, 1.1 * depth_mm), xlabel="x (mm)", ylabel="z (mm)")
    ax.set_title(f"$d = x_l - x_r = fB/Z$ = {f_px * baseline_mm / depth_mm:.1f} px")
    return ax
