from .box import Box, Side
from .camera_moves import moved_back
from .depth_map import DepthMap, measure_depth, whole_mm
from .disparity_map import add_outliers, check_disparity_map, pixel_rays
from .faces import Face
from .floor import Floor, FloorLimits, fit_floor, floor_from_pose, floor_tolerance_px
from .height_attempt import HeightAttempt, attempt_height, attempt_standing, corner_width_mm
from .instrument import CameraMoves, Instrument, SystematicUncertainty, save_laser_pose
from .laser_on_floor import LaserOnFloor
from .measure import Measurement, disagreement, measure_objects, measure_standing
from .measured_object import SIZE_NAMES, UNSURE_MM, WORST_STD, MeasuredObject
from .missing_floor import FLOOR_BY_HAND, NoFloor, find_floor, why_no_floor
from .overlay import OBJECT_RGB, add_caption, draw_length, draw_objects, is_pictured
from .plane_alignment import AlignedPair, CannotMeasure
from .reasons import Reason, ScanFit, Source, Why
from .regions import ObjectRegion, find_objects
from .standing import Standing, see_standing
from .two_points import Between, SurfacePoint, find_surface, length_between, match_views, measure_between
from .views import Views

__all__ = [
    "FLOOR_BY_HAND",
    "OBJECT_RGB",
    "SIZE_NAMES",
    "UNSURE_MM",
    "WORST_STD",
    "AlignedPair",
    "Between",
    "Box",
    "CameraMoves",
    "CannotMeasure",
    "DepthMap",
    "Face",
    "Floor",
    "FloorLimits",
    "HeightAttempt",
    "Instrument",
    "LaserOnFloor",
    "MeasuredObject",
    "Measurement",
    "NoFloor",
    "ObjectRegion",
    "Reason",
    "ScanFit",
    "Side",
    "Source",
    "Standing",
    "SurfacePoint",
    "SystematicUncertainty",
    "Views",
    "Why",
    "add_caption",
    "add_outliers",
    "attempt_height",
    "attempt_standing",
    "check_disparity_map",
    "corner_width_mm",
    "disagreement",
    "draw_length",
    "draw_objects",
    "find_floor",
    "find_objects",
    "find_surface",
    "fit_floor",
    "floor_from_pose",
    "floor_tolerance_px",
    "is_pictured",
    "length_between",
    "match_views",
    "measure_between",
    "measure_depth",
    "measure_objects",
    "measure_standing",
    "moved_back",
    "pixel_rays",
    "save_laser_pose",
    "see_standing",
    "whole_mm",
    "why_no_floor",
]
