from .census_sgm import CensusSGM, SGMResult, census_transform, match_census_sgm
from .checked_match import CheckedMatch, match_checked
from .disparity import compute_disparity, depth_to_disparity, disparity_to_depth, left_right_check
from .even_pair import EvenPair, even_out
from .fill_around import fill_from_around
from .filter_comparison import FilterCase, compare_filters, outline_growth_px
from .filters import SMOOTHING_METHODS, dilate, dilate_set, median_filter, smooth
from .ground_truth import KnownView, motorcycle_view, seen_by_both
from .guided import ExpectedDisparity, compute_disparity_guided, expected_disparity
from .pair_checks import check_matchable, check_rectified, check_sides, is_doubtful, moved_between
from .pipelines import (
    DisparityEstimate,
    FilledMap,
    FillSteps,
    fill_matched,
    match_best,
    search_range,
    stereo_pipeline,
)
from .pixel_cost import PixelCost, pixel_cost
from .plane_fill import continue_background
from .plane_smoothing import smooth_by_planes
from .row_cells import RowCells
from .rows import RowOffset, find_rows
from .scenes import correlation_length_px, near_edge_mask, smallest_window
from .scoring import RepairScore, Score, fattening_px, overreach_px, score, score_repair
from .sgbm import SGBMParams, match_pair
from .surfaces import Surfaces, choose_surface
from .sweeps import Workers, settings_grid, sweep

__all__ = [
    "SMOOTHING_METHODS",
    "CensusSGM",
    "CheckedMatch",
    "DisparityEstimate",
    "EvenPair",
    "ExpectedDisparity",
    "FillSteps",
    "FilledMap",
    "FilterCase",
    "KnownView",
    "PixelCost",
    "RepairScore",
    "RowCells",
    "RowOffset",
    "SGBMParams",
    "SGMResult",
    "Score",
    "Surfaces",
    "Workers",
    "census_transform",
    "check_matchable",
    "check_rectified",
    "check_sides",
    "choose_surface",
    "compare_filters",
    "compute_disparity",
    "compute_disparity_guided",
    "continue_background",
    "correlation_length_px",
    "depth_to_disparity",
    "dilate",
    "dilate_set",
    "disparity_to_depth",
    "even_out",
    "expected_disparity",
    "fattening_px",
    "fill_from_around",
    "fill_matched",
    "find_rows",
    "is_doubtful",
    "left_right_check",
    "match_best",
    "match_census_sgm",
    "match_checked",
    "match_pair",
    "median_filter",
    "motorcycle_view",
    "moved_between",
    "near_edge_mask",
    "outline_growth_px",
    "overreach_px",
    "pixel_cost",
    "score",
    "score_repair",
    "search_range",
    "seen_by_both",
    "settings_grid",
    "smallest_window",
    "smooth",
    "smooth_by_planes",
    "stereo_pipeline",
    "sweep",
]
