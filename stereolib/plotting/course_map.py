"""How the chapters of the course hang together."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

from stereolib.plotting.style import LASER, OURS, REFUSED, default_style

#: What stands where: name to (column, row, text, colour).
_BOXES = {
    "pictures": (0, 2, "00\ntwo pictures", OURS),
    "01": (1, 2, "01\ncalibration", OURS),
    "02": (2, 2, "02\nrectification", OURS),
    "03": (3, 2, "03\nmatching", OURS),
    "04": (4, 2, "04\nfilter", OURS),
    "07": (5.3, 2.6, "07\npixel to cm", OURS),
    "06": (5.3, 1.5, "06\nheight", OURS),
    "laser": (0, 0.35, "laser\nscan", LASER),
    "05": (1, 0.35, "05\nlaser error", LASER),
    "08": (5.3, 0.35, "08\nmap", "#000000"),
    "09": (2.05, 1.17, "09\nreal data", REFUSED),
    "10": (3.35, 1.0, "10\nbeyond", REFUSED),
    "11": (4.35, 1.0, "11\nyour rig", REFUSED),
}
_ARROWS = ("pictures 01", "01 02", "02 03", "03 04", "04 06", "04 07", "laser 05", "05 08", "06 08", "01 09", "05 09",
           "03 10", "05 10", "08 11")  # fmt: skip
_WIDTH, _HEIGHT = 0.8, 0.62


@default_style
def plot_course(ax: Axes) -> Axes:
    """Draw the chapters as boxes, with an arrow from each to those that need it.

    Parameters
    ----------
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
    """
    for column, row, text, color in _BOXES.values():
        corner = (column - _WIDTH / 2, row - _HEIGHT / 2)
        style = "round,pad=0.02,rounding_size=0.1"
        ax.add_patch(FancyBboxPatch(corner, _WIDTH, _HEIGHT, boxstyle=style, fc="white", ec=color, lw=2, zorder=2))
        ax.text(column, row, text, ha="center", va="center", zorder=3, fontsize=10)
    for arrow in _ARROWS:
        (x0, y0), (x1, y1) = (_BOXES[name][:2] for name in arrow.split())
        across = abs(x1 - x0) > 0.5 and abs(y1 - y0) < 1.3
        side, up = (_WIDTH / 2 + 0.03) * (x1 > x0 or -1), (_HEIGHT / 2 + 0.04) * (y1 > y0 or -1)
        begin, end = ((x0 + side, y0), (x1 - side, y1)) if across else ((x0, y0 + up), (x1, y1 - up))
        ax.annotate("", end, begin, arrowprops={"arrowstyle": "-|>", "color": "0.35", "lw": 1.4})
    ax.set(xlim=(-0.5, 5.8), ylim=(-0.05, 3.0))
    ax.set_axis_off()
    return ax
