from .calibration_report import lens_shift_px, write_calibration_report
from .calibration_views import plot_boards_in_space, plot_epipolar_lines, plot_epipolar_plane, plot_lens_arrows
from .check_figure import check_figure
from .course_map import plot_course
from .curves import plot_bars, plot_curves, plot_dots, plot_shares
from .gallery import Exhibit, plot_cells, plot_gallery, plot_repairs
from .maps import plot_occupancy, plot_scan, plot_scan_polar, plot_scans, plot_sizes, plot_top_view
from .matches import (
    mark_pixels,
    plot_cost_cells,
    plot_matched,
    plot_pixel_cost,
    plot_row_cost,
    plot_row_pair,
    plot_strips,
)
from .measurements import plot_height_attempt, plot_intervals
from .output import figure_to_image, save_figure, save_table
from .pictures import (
    ImageQuantity,
    color_disparity,
    plot_arrows,
    plot_box,
    plot_corners,
    plot_crop,
    plot_disparity,
    plot_errors,
    plot_height,
    plot_image,
    plot_mask,
    plot_points,
    plot_quantity,
)
from .rows import plot_partners, plot_row_crops, plot_row_test, plot_rows
from .style import COLORS, LASER, OURS, PAPER, REFUSED, RIVAL, TRUTH, panels
from .triangulation import plot_triangulation
from .two_views import plot_line_of_sight, plot_pair, plot_similar_triangles, plot_thumb

__all__ = [
    "COLORS",
    "LASER",
    "OURS",
    "PAPER",
    "REFUSED",
    "RIVAL",
    "TRUTH",
    "Exhibit",
    "ImageQuantity",
    "check_figure",
    "color_disparity",
    "figure_to_image",
    "lens_shift_px",
    "mark_pixels",
    "panels",
    "plot_arrows",
    "plot_bars",
    "plot_boards_in_space",
    "plot_box",
    "plot_cells",
    "plot_corners",
    "plot_cost_cells",
    "plot_course",
    "plot_crop",
    "plot_curves",
    "plot_disparity",
    "plot_dots",
    "plot_epipolar_lines",
    "plot_epipolar_plane",
    "plot_errors",
    "plot_gallery",
    "plot_height",
    "plot_height_attempt",
    "plot_image",
    "plot_intervals",
    "plot_lens_arrows",
    "plot_line_of_sight",
    "plot_mask",
    "plot_matched",
    "plot_occupancy",
    "plot_pair",
    "plot_partners",
    "plot_pixel_cost",
    "plot_points",
    "plot_quantity",
    "plot_repairs",
    "plot_row_cost",
    "plot_row_crops",
    "plot_row_pair",
    "plot_row_test",
    "plot_rows",
    "plot_scan",
    "plot_scan_polar",
    "plot_scans",
    "plot_shares",
    "plot_similar_triangles",
    "plot_sizes",
    "plot_strips",
    "plot_thumb",
    "plot_top_view",
    "plot_triangulation",
    "save_figure",
    "save_table",
    "write_calibration_report",
]
