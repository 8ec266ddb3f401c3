"""A calibration's check as a picture: the board as it came out, and the rows."""

from __future__ import annotations

from typing import Any

import numpy as np

from stereolib.base import plus_minus
from stereolib.calibration import CalibrationCheck
from stereolib.plotting.curves import plot_dots
from stereolib.plotting.style import image_axes, panels


def check_figure(check: CalibrationCheck) -> Any:
    """Draw how far the board's corners lie off its plane, and how far the rows disagree over the picture.

    Parameters
    ----------
    check : CalibrationCheck

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure, axes = panels(2, width_in=12, aspect=0.7)
    views, size = check.views, check.board_pct
    way = "large" if size.value >= 0 else "small"
    seen = np.isfinite(check.off_plane_mm).any(axis=0)
    x, y, _ = views.board.points_mm[seen].T
    plot_dots(
        x,
        y,
        axes[0],
        color=np.nanmean(check.off_plane_mm[:, seen], axis=0),
        label="off its plane, towards the cameras (mm)",
        title=f"the board, mean of {len(views)}: {plus_minus(abs(size.value), size.std)} % too {way}",
        xlabel="along its columns (mm)",
        ylabel="along its rows (mm)",
        aspect="equal",
        ylim=(y.max() + views.board.square_mm / 2, y.min() - views.board.square_mm / 2),
    )
    known = np.isfinite(check.row_errors_px)
    u, v = views.left_px[known].T
    plot_dots(u, v, axes[1], color=check.row_errors_px[known], label="left row minus right row (px)")
    image_axes(views.size, axes[1], f"rows, rectified: {check.row_rms_px:.2f} px rms")
    return figure
