"""The recorded walk, measured: its laser calibrated with boards, its five stations through `measure_objects`."""

from __future__ import annotations

from functools import cache

import numpy as np

from stereolib import paper
from stereolib.calibration import LidarCamera, calibrate_lidar_to_camera
from stereolib.measurement import Instrument, Measurement, measure_objects
from stereolib.virtual import recordings, walk
from stereolib.virtual.laser_boards import laser_board_views
from stereolib.virtual.lidar import VirtualLidar


@cache
def laser(seed: int = 8) -> LidarCamera:
    """Where the walk's laser stands to the left camera, from ten poses of a board that both saw."""
    sensor, rng = VirtualLidar(height_mm=walk.LASER_HEIGHT_MM), np.random.default_rng(seed)
    views = laser_board_views(sensor, recordings.LASER_POSE, recordings.setup(), paper.paper_rig().left, rng)
    return calibrate_lidar_to_camera(views)


def measure_walk(seed: int = 8) -> dict[str, Measurement]:
    """What was measured at every station, by its name ``"room/1"`` to ``"room/5"``."""
    instrument = Instrument(recordings.rectified(), laser())
    return {
        name: measure_objects(
            *recordings.load_pair(name), recordings.scan(name), instrument, rng=np.random.default_rng(seed)
        )
        for name in walk.POSES
    }
