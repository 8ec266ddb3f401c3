"""The geometry of disparity, as the paper draws it in Fig. 2."""

from __future__ import annotations

import matplotlib.patheffects as effects
import numpy as np
from matplotlib.axes import Axes

from stereolib.plotting.style import COLORS, TRUTH, default_style

_PLANE = 0.3  # of the depth: where the image planes are drawn; true ones lie at a few millimetres
_HALO = (effects.withStroke(linewidth=2.5, foreground="white"),)


@default_style
def plot_triangulation(f_px: float, baseline_mm: float, depth_mm: float, ax: Axes) -> Axes:
    """Draw the geometry of disparity (Fig. 2) from above, true in all its lengths and angles.

    The cameras look to the right. Only the image planes are drawn before the lenses and enlarged, so that the rays
    cross them where they do in the picture; of each its middle is shown.

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
    plane, point_mm = _PLANE * depth_mm, 0.35 * baseline_mm
    half = 0.47 * baseline_mm
    for name, x, color in (("left", 0.0, COLORS[5]), ("right", baseline_mm, COLORS[3])):
        side = 1 if name == "left" else -1  # labels stand outside
        ax.plot([0, depth_mm], [x, x], color="0.6", lw=0.8, ls=":")
        ax.plot([0, depth_mm], [x, point_mm], color=color, lw=1.3)
        ax.plot([plane, plane], [x - half, x + half], color=color, lw=2.5)
        crossing = x + (point_mm - x) * _PLANE
        ax.plot([plane, plane], [x, crossing], color=TRUTH, lw=5, solid_capstyle="butt")
        ax.plot(0, x, "o", color=color)
        ax.annotate(f"{name} camera", (0, x), (-8, 0), textcoords="offset points", ha="right", va="center")
        ax.annotate(
            f"$x_{name[0]}$ = {f_px * (point_mm - x) / depth_mm:+.1f} px".replace("-", "\N{MINUS SIGN}"),
            (plane, (x + crossing) / 2),
            (1.2 * plane, x - side * 0.4 * baseline_mm),
            va="center",
            arrowprops={"arrowstyle": "-", "color": "0.4", "lw": 0.8, "shrinkB": 3},
            path_effects=_HALO,
        )
    ax.text(0.95 * plane, -0.7 * half, "image planes, enlarged; in px", ha="right", va="center", fontsize=9)
    ax.plot(depth_mm, point_mm, "s", color=TRUTH)
    ax.annotate("P", (depth_mm, point_mm), (8, 0), textcoords="offset points", va="center")
    below, beside = 1.75 * baseline_mm, -0.36 * depth_mm
    arrow = {"arrowstyle": "<->", "shrinkA": 0, "shrinkB": 0}
    for start, end, text in (
        ((0.0, below), (depth_mm, below), f"Z = {depth_mm:.0f} mm"),
        ((beside, 0.0), (beside, baseline_mm), f"B = {baseline_mm:.1f} mm"),
    ):
        ax.annotate("", start, end, arrowprops=arrow)
        middle = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
        ax.text(*middle, text, ha="center", va="center", bbox={"facecolor": "white", "lw": 0, "pad": 2})
    ax.set(xlim=(-0.48 * depth_mm, 1.1 * depth_mm), ylim=(2 * baseline_mm, -0.75 * baseline_mm), aspect="equal")
    ax.set_xticks(np.arange(0, depth_mm + 1, 100))
    ax.set(xlabel="forward, z (mm)", ylabel="to the right, x (mm)")
    ax.set_title(f"$d = x_l - x_r = fB/Z$ = {f_px * baseline_mm / depth_mm:.1f} px", fontsize=11)
    return ax
