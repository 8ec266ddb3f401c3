from .board_files import find_in_files
from .board_poses import board_pose
from .board_size import board_size_error_pct, triangulate
from .board_views import BoardViews
from .board_watch import BoardLook, BoardWatch
from .boards import Board, Charuco, Checkerboard
from .bundle_adjustment import RigFit, fit_rig, moved_rig, rig_difference
from .capture_session import CAPTURE_NOTES, CaptureSession, CaptureState
from .check_wording import CHECK_MEANINGS
from .coverage import Coverage, boards_per_cell
from .diagnosis import Diagnosis, diagnose
from .find_boards import find_board, find_charuco, find_checkerboard, find_in_pairs
from .findings import Check
from .first_boards import check_first_boards, check_sides
from .fresh_check import CalibrationCheck, Estimate, check_calibration
from .laser_boards import LaserBoardView, find_board_in_scan, find_laser_boards_in_files
from .laser_pose import (
    LASER_SCALE_STD,
    LidarCamera,
    ViewsDisagree,
    calibrate_lidar_to_camera,
    is_beyond_lasers,
    read_share,
)
from .lens_choice import HoldOut, choose_lens_model, hold_out_errors, hold_out_rigs, hold_out_splits
from .lens_models import LENS_MODELS, LensFold, fold_inside
from .movement import MOVEMENTS, Moved, Movement
from .outliers import MIN_PAIRS
from .record import CalibrationRecord, damage
from .rectified_errors import DisparityErrors, deviations, rectified_std
from .solve import (
    CameraCalibration,
    StereoCalibration,
    calibrate_camera,
    calibrate_stereo,
    epipolar_errors_px,
)
from .uncertainty import (
    INTERVAL_STDS,
    JUDGED_AT_MM,
    Agreement,
    ErrorMap,
    RigStd,
    compare_calibrations,
    error_map,
    interval_table,
    rig_covariance,
    rig_parameter_names,
    rig_std,
)
from .wording import (
    VERDICT_MEANINGS,
    board_text,
    calibration_facts,
    calibration_text,
    check_rows,
    result_rows,
    save_calibration,
)
from .wrong_corners import CornerOff

__all__ = [
    "CAPTURE_NOTES",
    "CHECK_MEANINGS",
    "INTERVAL_STDS",
    "JUDGED_AT_MM",
    "LASER_SCALE_STD",
    "LENS_MODELS",
    "MIN_PAIRS",
    "MOVEMENTS",
    "VERDICT_MEANINGS",
    "Agreement",
    "Board",
    "BoardLook",
    "BoardViews",
    "BoardWatch",
    "CalibrationCheck",
    "CalibrationRecord",
    "CameraCalibration",
    "CaptureSession",
    "CaptureState",
    "Charuco",
    "Check",
    "Checkerboard",
    "CornerOff",
    "Coverage",
    "Diagnosis",
    "DisparityErrors",
    "ErrorMap",
    "Estimate",
    "HoldOut",
    "LaserBoardView",
    "LensFold",
    "LidarCamera",
    "Moved",
    "Movement",
    "RigFit",
    "RigStd",
    "StereoCalibration",
    "ViewsDisagree",
    "board_pose",
    "board_size_error_pct",
    "board_text",
    "boards_per_cell",
    "calibrate_camera",
    "calibrate_lidar_to_camera",
    "calibrate_stereo",
    "calibration_facts",
    "calibration_text",
    "check_calibration",
    "check_first_boards",
    "check_rows",
    "check_sides",
    "choose_lens_model",
    "compare_calibrations",
    "damage",
    "deviations",
    "diagnose",
    "epipolar_errors_px",
    "error_map",
    "find_board",
    "find_board_in_scan",
    "find_charuco",
    "find_checkerboard",
    "find_in_files",
    "find_in_pairs",
    "find_laser_boards_in_files",
    "fit_rig",
    "fold_inside",
    "hold_out_errors",
    "hold_out_rigs",
    "hold_out_splits",
    "interval_table",
    "is_beyond_lasers",
    "moved_rig",
    "read_share",
    "rectified_std",
    "result_rows",
    "rig_covariance",
    "rig_difference",
    "rig_parameter_names",
    "rig_std",
    "save_calibration",
    "triangulate",
]
