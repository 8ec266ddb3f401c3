from .camera_drawings import draw_lens, draw_rectification
from .first_drawings import draw_two_pictures
from .height_drawings import draw_heights, draw_recipe, draw_width, height_text, recording_labels
from .laser_drawings import draw_map_view, draw_matching, draw_pose, draw_sweep, who_saw
from .matching_drawings import (
    draw_dilation,
    draw_guided,
    draw_motorcycle,
    draw_own_pair,
    draw_paths,
    draw_prices,
    draw_sgbm,
    draw_surface,
)
from .sliders import Explorer, explore
from .toed_in import cube_foot_mm, shoot_cube, toe_in

__all__ = [
    "Explorer",
    "cube_foot_mm",
    "draw_dilation",
    "draw_guided",
    "draw_heights",
    "draw_lens",
    "draw_map_view",
    "draw_matching",
    "draw_motorcycle",
    "draw_own_pair",
    "draw_paths",
    "draw_pose",
    "draw_prices",
    "draw_recipe",
    "draw_rectification",
    "draw_sgbm",
    "draw_surface",
    "draw_sweep",
    "draw_two_pictures",
    "draw_width",
    "explore",
    "height_text",
    "recording_labels",
    "shoot_cube",
    "toe_in",
    "who_saw",
]
