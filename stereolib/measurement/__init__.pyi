from .edges import Edge, vertical_edge
from .faces import Face, find_faces
from .floor import Floor, checked_disparity, fit_floor, floor_from_pose, scaled_pixels
from .height_attempt import Attempt, add_specks, attempt_height, corner_width_mm
from .instrument import Instrument, save_lidar
from .measure import Measurement, measure_objects
from .measured_object import SIZES, MeasuredObject
from .object_height import GroundHeight, Uncertainty, measure_height
from .overlay import draw_objects
from .plane_alignment import CannotMeasure
from .regions import Region, find_objects

__all__ = [
    "SIZES",
    "Attempt",
    "CannotMeasure",
    "Edge",
    "Face",
    "Floor",
    "GroundHeight",
    "Instrument",
    "MeasuredObject",
    "Measurement",
    "Region",
    "Uncertainty",
    "add_specks",
    "attempt_height",
    "checked_disparity",
    "corner_width_mm",
    "draw_objects",
    "find_faces",
    "find_objects",
    "fit_floor",
    "floor_from_pose",
    "measure_height",
    "measure_objects",
    "save_lidar",
    "scaled_pixels",
    "vertical_edge",
]
