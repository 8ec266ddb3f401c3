"""The true rig with its laser, as a measurement takes them."""

from __future__ import annotations

import numpy as np

from stereolib.calibration import LidarCamera
from stereolib.measurement import Instrument
from stereolib.rig import rigid
from stereolib.virtual import VirtualLidar, recordings

RECT = recordings.rectified()
SENSOR = VirtualLidar()
LIDAR = LidarCamera(
    recordings.setup() @ rigid(np.eye(3), [0.0, 0.0, SENSOR.height_mm]), 0.0,
    np.diag([1e-6] * 3 + [0.25] * 3 + [1e-6]),
)  # fmt: skip
INSTRUMENT = Instrument(RECT, LIDAR)
