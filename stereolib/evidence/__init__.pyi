from .height import (
    box_spread,
    edge_mask,
    first_row_off,
    fitting_setups,
    floor_disturbs,
    mask_on_edge,
    maximum_marks_edge,
    reading_at_threshold_cm,
    recipe_over_setups,
    threshold_matters,
    whole_edge_reading_cm,
    whole_edge_tolerance_px,
)
from .matching import glare_times
from .scale import ENDS_PX, box_off_px, boxes_right, camera_heights_left, one_scale, relation_error, width_tolerance_px

__all__ = [
    "ENDS_PX",
    "box_off_px",
    "box_spread",
    "boxes_right",
    "camera_heights_left",
    "edge_mask",
    "first_row_off",
    "fitting_setups",
    "floor_disturbs",
    "glare_times",
    "mask_on_edge",
    "maximum_marks_edge",
    "one_scale",
    "reading_at_threshold_cm",
    "recipe_over_setups",
    "relation_error",
    "threshold_matters",
    "whole_edge_reading_cm",
    "whole_edge_tolerance_px",
    "width_tolerance_px",
]
