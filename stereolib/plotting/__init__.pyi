from .calibration_report import lens_shift_px, write_calibration_report
from .curves import plot_bars, plot_curves, plot_dots
from .maps import plot_occupancy, plot_scan, plot_scan_polar, plot_scans, plot_sizes, plot_top_view
from .measurements import plot_height_attempt, plot_intervals
from .output import figure_to_image, save_figure, save_table
from .pictures import (
    ImageQuantity,
    color_disparity,
    plot_arrows,
    plot_box,
    plot_corners,
    plot_disparity,
    plot_errors,
    plot_height,
    plot_image,
    plot_mask,
    plot_points,
    plot_quantity,
    plot_rows,
)
from .style import COLORS, LASER, OURS, PAPER, REFUSED, RIVAL, TRUTH, panels
from .triangulation import plot_triangulation

__all__ = [
    "COLORS",
    "LASER",
    "OURS",
    "PAPER",
    "REFUSED",
    "RIVAL",
    "TRUTH",
    "ImageQuantity",
    "color_disparity",
    "figure_to_image",
    "lens_shift_px",
    "panels",
    "plot_arrows",
    "plot_bars",
    "plot_box",
    "plot_corners",
    "plot_curves",
    "plot_disparity",
    "plot_dots",
    "plot_errors",
    "plot_height",
    "plot_height_attempt",
    "plot_image",
    "plot_intervals",
    "plot_mask",
    "plot_occupancy",
    "plot_points",
    "plot_quantity",
    "plot_rows",
    "plot_scan",
    "plot_scan_polar",
    "plot_scans",
    "plot_sizes",
    "plot_top_view",
    "plot_triangulation",
    "save_figure",
    "save_table",
    "write_calibration_report",
]
