"""The recorded walk, measured: its laser calibrated with boards, its five stations through `measure_objects`."""

from __future__ import annotations

from functools import cache

import numpy as np

from stereolib.calibration import LidarCamera, calibrate_lidar_to_camera
from stereolib.measurement import Instrument, Measurement, measure_objects
from stereolib.paper import paper_rig
from stereolib.virtual import recordings, walk
from stereolib.virtual.laser_boards import laser_board_views
from stereolib.virtual.lidar import VirtualLidar

_SEED = 8  # of the boards' noise, and of what the measurement draws


@cache
def walk_laser() -> LidarCamera:
    """Find out where the walk's laser stands to the left camera, from ten poses of a board that both saw.

    Returns
    -------
    LidarCamera
    """
    sensor, rng = VirtualLidar(height_mm=walk.LASER_HEIGHT_MM), np.random.default_rng(_SEED)
    return calibrate_lidar_to_camera(laser_board_views(sensor, paper_rig().left, rng))


def measure_walk() -> dict[str, Measurement]:
    """Measure what was recorded at every station.

    Returns
    -------
    dict
        Measurements by the stations' names, ``"room/1"`` to ``"room/5"``.
    """
    instrument = Instrument(recordings.rectified(), walk_laser())
    return {
        name: measure_objects(*recordings.load_pair(name), recordings.scan(name), instrument) for name in walk.POSES
    }
