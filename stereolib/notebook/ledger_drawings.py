"""What the slider about the verdicts draws (notebook 00)."""

from __future__ import annotations

from stereolib import paper
from stereolib.base import UInt8


def draw_verdicts(verdict: str) -> tuple[UInt8, str]:
    """Notebook 00: how many rows of each notebook got a verdict.

    Parameters
    ----------
    verdict : str

    Returns
    -------
    picture : (H, W, 3) uint8, blue-green-red
    text : str
    """
    from stereolib.plotting import figure_to_image, panels, plot_bars

    rows = paper.recorded_rows()
    chosen = rows[rows["verdict"] == verdict]
    figure, axes = panels(1, width_in=7, aspect=0.45)
    counts = chosen["notebook"].value_counts(sort=False).sort_index()
    plot_bars({str(name): int(n) for name, n in counts.items()}, axes[0], xlabel="rows", title=verdict)
    return figure_to_image(figure), ", ".join(chosen["id"])
