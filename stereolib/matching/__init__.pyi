from .census_sgm import CensusSGM, SGMResult, census
from .disparity import (
    check_rectified,
    check_told,
    compute_disparity,
    depth_to_disparity,
    disparity_to_depth,
    left_right_check,
    raw_disparity,
)
from .filling import fill_background, inpaint, least_squares, left_right, remove_speckles, weighted_median
from .filter_comparison import case, growth_px, measure
from .filters import METHODS, close, dilate, dilate_set, median, open_close, smooth
from .ground_truth import Ready, View, motorcycle
from .guided import Expected, compute_disparity_guided, expected_disparity
from .pipelines import SIGMA_PX, Estimate, features, match_best, stereo_pipeline
from .scoring import (
    Repair,
    Score,
    correlation_length_px,
    fattening_px,
    near_edge,
    overreach_px,
    repair,
    score,
    smallest_window,
)
from .sgbm import SGBMParams
from .sweeps import grid, random, sweep

__all__ = [
    "METHODS",
    "SIGMA_PX",
    "CensusSGM",
    "Estimate",
    "Expected",
    "Ready",
    "Repair",
    "SGBMParams",
    "SGMResult",
    "Score",
    "View",
    "case",
    "census",
    "check_rectified",
    "check_told",
    "close",
    "compute_disparity",
    "compute_disparity_guided",
    "correlation_length_px",
    "depth_to_disparity",
    "dilate",
    "dilate_set",
    "disparity_to_depth",
    "expected_disparity",
    "fattening_px",
    "features",
    "fill_background",
    "grid",
    "growth_px",
    "inpaint",
    "least_squares",
    "left_right",
    "left_right_check",
    "match_best",
    "measure",
    "median",
    "motorcycle",
    "near_edge",
    "open_close",
    "overreach_px",
    "random",
    "raw_disparity",
    "remove_speckles",
    "repair",
    "score",
    "smallest_window",
    "smooth",
    "stereo_pipeline",
    "sweep",
    "weighted_median",
]
