from .drawings import (
    draw_dilation,
    draw_heights,
    draw_lens,
    draw_map_view,
    draw_matching,
    draw_motorcycle,
    draw_recipe,
    draw_rectification,
    draw_sgbm,
    draw_surface,
    draw_sweep,
    draw_verdicts,
    draw_width,
)
from .sliders import Explorer, explore

__all__ = [
    "Explorer",
    "draw_dilation",
    "draw_heights",
    "draw_lens",
    "draw_map_view",
    "draw_matching",
    "draw_motorcycle",
    "draw_recipe",
    "draw_rectification",
    "draw_sgbm",
    "draw_surface",
    "draw_sweep",
    "draw_verdicts",
    "draw_width",
    "explore",
]
