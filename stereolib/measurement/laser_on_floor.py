"""Where the laser stands over the floor, as its calibration or the scene itself has it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stereolib.base import Float64, Floats, turn_2d
from stereolib.calibration import LidarCamera
from stereolib.measurement.floor import Floor


@dataclass(frozen=True, eq=False)
class LaserOnFloor:
    """Where the laser stands in the floor's frame: ``p_floor = R p_scan + t``.

    Attributes
    ----------
    R : (2, 2) float64
    t : (2,) float64, mm
    covariance : (3, 3) float64
        Of (x, y, yaw), mm and rad.
    bias_mm : float
        Standard deviation of the error that all readings on one face share.
    """

    R: Float64
    t: Float64
    covariance: Float64
    bias_mm: float = 1.0

    @classmethod
    def of(cls, lidar: LidarCamera, floor: Floor) -> LaserOnFloor:
        """Pose of a calibrated laser over a floor; its plane is taken as parallel to the floor.

        Parameters
        ----------
        lidar : LidarCamera
        floor : Floor

        Returns
        -------
        LaserOnFloor
        """
        T = floor.axes @ floor.rectified.R1 @ lidar.T_left_lidar[:3]
        R = turn_2d(np.arctan2(T[1, 0], T[0, 0]))
        J = np.zeros((3, 6))
        J[:2, 3:5], J[2, 2] = R, 1.0
        return cls(R, T[:2, 3], J @ lidar.covariance @ J.T)

    @property
    def yaw_rad(self) -> float:
        """Direction of the laser's beam 0."""
        return float(np.arctan2(self.R[1, 0], self.R[0, 0]))

    def moved(self, x_mm: float, y_mm: float, yaw_rad: float) -> LaserOnFloor:
        """Another pose of it: shifted along the floor, and turned about itself.

        Parameters
        ----------
        x_mm, y_mm, yaw_rad : float

        Returns
        -------
        LaserOnFloor
        """
        return replace(self, R=turn_2d(yaw_rad) @ self.R, t=self.t + np.array([x_mm, y_mm]))

    def points_mm(self, points_mm: Floats) -> Float64:
        """Put points of the scan on the floor.

        Parameters
        ----------
        points_mm : (N, 2) float, mm
            In the laser's frame.

        Returns
        -------
        (N, 2) float64, mm
        """
        return np.asarray(np.asarray(points_mm, float) @ self.R.T + self.t)
