from .disparity_map import add_outliers, check_disparity_map, pixel_rays
from .face_lines import LaserOnFloor
from .faces import Face
from .floor import Floor, FloorLimits, fit_floor, floor_from_pose, floor_tolerance_px
from .height_attempt import HeightAttempt, attempt_height, corner_width_mm
from .instrument import Instrument, save_laser_pose
from .measure import Measurement, measure_objects
from .measured_object import SIZE_NAMES, MeasuredObject
from .object_height import GroundHeight, SystematicUncertainty, measure_height
from .overlay import draw_objects
from .plane_alignment import AlignedPair, CannotMeasure
from .regions import ObjectRegion, find_objects

__all__ = [
    "SIZE_NAMES",
    "AlignedPair",
    "CannotMeasure",
    "Face",
    "Floor",
    "FloorLimits",
    "GroundHeight",
    "HeightAttempt",
    "Instrument",
    "LaserOnFloor",
    "MeasuredObject",
    "Measurement",
    "ObjectRegion",
    "SystematicUncertainty",
    "add_outliers",
    "attempt_height",
    "check_disparity_map",
    "corner_width_mm",
    "draw_objects",
    "find_objects",
    "fit_floor",
    "floor_from_pose",
    "floor_tolerance_px",
    "measure_height",
    "measure_objects",
    "pixel_rays",
    "save_laser_pose",
]
