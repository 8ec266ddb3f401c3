from .camera_drawings import draw_lens, draw_rectification
from .height_drawings import draw_heights, draw_recipe, draw_width
from .laser_drawings import draw_map_view, draw_matching, draw_pose, draw_sweep
from .ledger_drawings import draw_verdicts
from .matching_drawings import draw_dilation, draw_motorcycle, draw_sgbm, draw_surface
from .sliders import Explorer, explore

__all__ = [
    "Explorer",
    "draw_dilation",
    "draw_heights",
    "draw_lens",
    "draw_map_view",
    "draw_matching",
    "draw_motorcycle",
    "draw_pose",
    "draw_recipe",
    "draw_rectification",
    "draw_sgbm",
    "draw_surface",
    "draw_sweep",
    "draw_verdicts",
    "draw_width",
    "explore",
]
