from .calibration import (
    denominator_gain,
    fundamental_readings,
    joint_and_two_parts,
    joint_and_two_parts_redrawn,
    pose_by_equation,
    pose_by_words,
    pose_readings,
    projection_restored,
    recovery_tolerances,
    redrawn_corners,
    tangential_misprint,
)
from .matching import glare_times
from .rectification import (
    board_points_mm,
    partner_offsets_px,
    rectification_gain,
    rows_left_out,
    sizes_by_depth_equation,
)

__all__ = [
    "board_points_mm",
    "denominator_gain",
    "fundamental_readings",
    "glare_times",
    "joint_and_two_parts",
    "joint_and_two_parts_redrawn",
    "partner_offsets_px",
    "pose_by_equation",
    "pose_by_words",
    "pose_readings",
    "projection_restored",
    "recovery_tolerances",
    "rectification_gain",
    "redrawn_corners",
    "rows_left_out",
    "sizes_by_depth_equation",
    "tangential_misprint",
]
