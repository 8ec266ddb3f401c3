from .camera_place import (
    CubeSetup,
    CubeView,
    cube_view,
    left_level_roll,
    paper_setup,
    rig_pose,
    setup_family,
    setups_in_print,
    solve_camera_height,
    solve_pitch,
)
from .canny import PixelBox, canny_bounding_box, canny_edges
from .digit_budget import (
    essential_budget,
    essential_miss,
    fundamental_budget,
    printed_half_width,
    product_half_width,
    within_budget,
)
from .height_recipe import HeightResult, height_by_maximum, height_from_depth, height_of_top, heights_over_tolerances
from .ledger import compare_with_paper, record_rows, recorded_rows, show_rows
from .pixel_cm import cm_per_px, cm_per_px_at, depth_of_scale_mm, fit_focal_length_px
from .printed_lens import printed_counts, printed_projection
from .printed_rig import paper_rig, printed_camera_matrix, printed_essential, printed_form, printed_fundamental
from .printed_values import KINDS, Published, max_deviation, printed_value, published

__all__ = [
    "KINDS",
    "CubeSetup",
    "CubeView",
    "HeightResult",
    "PixelBox",
    "Published",
    "canny_bounding_box",
    "canny_edges",
    "cm_per_px",
    "cm_per_px_at",
    "compare_with_paper",
    "cube_view",
    "depth_of_scale_mm",
    "essential_budget",
    "essential_miss",
    "fit_focal_length_px",
    "fundamental_budget",
    "height_by_maximum",
    "height_from_depth",
    "height_of_top",
    "heights_over_tolerances",
    "left_level_roll",
    "max_deviation",
    "paper_rig",
    "paper_setup",
    "printed_camera_matrix",
    "printed_counts",
    "printed_essential",
    "printed_form",
    "printed_fundamental",
    "printed_half_width",
    "printed_projection",
    "printed_value",
    "product_half_width",
    "published",
    "record_rows",
    "recorded_rows",
    "rig_pose",
    "setup_family",
    "setups_in_print",
    "show_rows",
    "solve_camera_height",
    "solve_pitch",
    "within_budget",
]
