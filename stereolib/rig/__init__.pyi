from .camera import Camera, distort
from .formats import load_kalibr, load_opencv, load_rig, load_ros, save_kalibr, save_opencv, save_ros
from .images import check_image, check_pair, image_size, read_image, read_pair, to_grey, to_light
from .live_camera import CameraError, CameraWish, LiveCamera
from .live_pair import LivePair, LiveRig
from .matlab_format import from_matlab_struct, to_matlab_struct
from .opencv_threads import one_opencv_thread, over_cores
from .pair_files import (
    PICTURES,
    PairFile,
    find_pair,
    find_pairs,
    left_pictures,
    one_size,
    pair_name,
    pair_sides,
    turned_by_exif,
)
from .stereo_rig import RectifiedRig, StereoRig, calibration_notes
from .transforms import pose_left_world, rigid, skew

__all__ = [
    "PICTURES",
    "Camera",
    "CameraError",
    "CameraWish",
    "LiveCamera",
    "LivePair",
    "LiveRig",
    "PairFile",
    "RectifiedRig",
    "StereoRig",
    "calibration_notes",
    "check_image",
    "check_pair",
    "distort",
    "find_pair",
    "find_pairs",
    "from_matlab_struct",
    "image_size",
    "left_pictures",
    "load_kalibr",
    "load_opencv",
    "load_rig",
    "load_ros",
    "one_opencv_thread",
    "one_size",
    "over_cores",
    "pair_name",
    "pair_sides",
    "pose_left_world",
    "read_image",
    "read_pair",
    "rigid",
    "save_kalibr",
    "save_opencv",
    "save_ros",
    "skew",
    "to_grey",
    "to_light",
    "to_matlab_struct",
    "turned_by_exif",
]
