"""A station of the rig: where it stood, and what it measured there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from stereolib.base import finite_array, set_frozen
from stereolib.measurement import MeasuredObject, Measurement

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Station:
    """Where the rig stood, and what it measured there.

    Attributes
    ----------
    pose : (x_mm, y_mm, yaw_rad)
        Of its floor frame in the map: the place below the left camera, and where the camera looks.
    objects : tuple of MeasuredObject
        In its floor frame.
    scan_mm : (N, 2) float64
        The laser's readings in its floor frame, in the order of their angles.
    laser_mm : (2,) float64
        Where the laser stands in its floor frame.
    covariance : (3, 3) float64
        Of `pose`, mm and rad; zero if the pose is known.
    """

    pose: Array
    objects: tuple[MeasuredObject, ...]
    scan_mm: Array = field(default_factory=lambda: np.zeros((0, 2)))
    laser_mm: Array = field(default_factory=lambda: np.zeros(2))
    covariance: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def __post_init__(self) -> None:
        scan = np.asarray(self.scan_mm, float)
        if scan.ndim != 2 or scan.shape[1] != 2:
            raise ValueError(f"a station's scan is (N, 2) mm in its floor frame, got shape {scan.shape}")
        set_frozen(self, pose=finite_array(self.pose, (3,), "pose"), scan_mm=scan[np.isfinite(scan).all(axis=1)])
        set_frozen(self, laser_mm=finite_array(self.laser_mm, (2,), "laser_mm"))
        set_frozen(self, covariance=finite_array(self.covariance, (3, 3), "covariance"))

    def to_map(self, points_mm: Array) -> Array:
        """Points (..., 2) of its floor frame in the map, mm."""
        c, s = np.cos(self.pose[2]), np.sin(self.pose[2])
        return np.asarray(points_mm) @ np.array([[c, s], [-s, c]]) + self.pose[:2]

    @classmethod
    def of(cls, measured: Measurement, pose: Sequence[float] | Array) -> Station:
        """A station from what `stereolib.measure.measure_objects` found there."""
        return cls(np.asarray(pose, float), measured.objects, measured.scan_mm, measured.laser.t)
