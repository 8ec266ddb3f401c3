"""Where the laser stands over the floor, as its calibration or the scene itself has it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from stereolib.base import Bools, Float64, Floats, turn_2d
from stereolib.calibration import LidarCamera
from stereolib.measurement.floor import Floor

_LEAST_LEAN_RAD = np.radians(0.7)  # less costs a beam of 3 m a few centimetres of height, and floors err as much
_ON_FLOOR_MM = 10.0  # above it, what a beam's width and an uneven floor make
_LEAN_CHI2 = 16.0  # squared deviations of two slopes, which chance passes once in 3,000


@dataclass(frozen=True, eq=False)
class Lean:
    """How the laser's plane leans over the floor: its beams are ``slope @ p_scan + height_mm`` above it.

    Attributes
    ----------
    slope : (2,) float64
        Ahead and to the left of the laser.
    height_mm : float
        At the laser.
    covariance : (2, 2) float64
        Of the slope, as the calibration knows it.
    """

    slope: Float64
    height_mm: float
    covariance: Float64

    def meets_floor(self, points_mm: Float64) -> Bools:
        """Which points of the scan, (N, 2) mm, lie on the floor or so near to it that nothing tells them from it."""
        height_mm = points_mm @ self.slope + self.height_mm
        std_mm = np.sqrt(np.einsum("nk,kl,nl->n", points_mm, self.covariance, points_mm))
        return np.asarray(height_mm < _ON_FLOOR_MM + 2 * std_mm)

    @property
    def angle_rad(self) -> float:
        """How much, from level."""
        return float(np.arctan(np.hypot(*self.slope)))

    @property
    def is_sure(self) -> bool:
        """More than a floor errs, and more than the calibration leaves open."""
        chi2 = float(self.slope @ np.linalg.solve(self.covariance, self.slope))
        return self.angle_rad > _LEAST_LEAN_RAD and chi2 > _LEAN_CHI2

    @property
    def floor_at_mm(self) -> float:
        """How far off the beams that fall most meet the floor."""
        return self.height_mm / max(float(np.hypot(*self.slope)), 1e-9)

    @property
    def down(self) -> str:
        """The side to which they fall: ahead, left, behind or right."""
        return ("ahead", "left", "behind", "right")[int(np.rint(2 * np.arctan2(*-self.slope[::-1]) / np.pi)) % 4]


@dataclass(frozen=True, eq=False)
class LaserOnFloor:
    """Where the laser stands in the floor's frame: ``p_floor = (1 - scale) R p_scan + t``.

    Attributes
    ----------
    R : (2, 2) float64
    t : (2,) float64, mm
    covariance : (4, 4) float64
        Of (x, y, yaw, scale): mm, rad, share.
    bias_mm : float
        Standard deviation of the error that all readings on one face share.
    lean : Lean or None
        How its plane leans over the floor, where that is known.
    scale : float
        Share by which it reads farther than its calibration has it.
    common : (4, k) float64
        What (x, y, yaw, scale) are off for one standard deviation of each error that other pairs of its calibration
        share: ``common @ common.T`` is a part of the covariance.
    """

    R: Float64
    t: Float64
    covariance: Float64
    bias_mm: float = 1.0
    lean: Lean | None = None
    scale: float = 0.0
    common: Float64 = field(default_factory=lambda: np.zeros((4, 0)))

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
        J = np.zeros((4, 7))
        J[:2, 3:5], J[2, 2], J[3, 6] = R, 1.0, 1.0
        turned = lidar.covariance[:2, :2]  # about its x and y, which tilt its y and x
        lean = Lean(
            T[2, :2],
            T[2, 3] + floor.camera_height_mm,
            np.array([[turned[1, 1], -turned[0, 1]], [-turned[0, 1], turned[0, 0]]]),
        )
        return cls(R, T[:2, 3], J @ lidar.covariance @ J.T, lean=lean)

    @property
    def yaw_rad(self) -> float:
        """Direction of the laser's beam 0."""
        return float(np.arctan2(self.R[1, 0], self.R[0, 0]))

    def moved(self, x_mm: float, y_mm: float, yaw_rad: float, scale: float = 0.0) -> LaserOnFloor:
        """Another pose of it: shifted along the floor, and turned about itself; and another scale.

        Parameters
        ----------
        x_mm, y_mm, yaw_rad, scale : float
            Changes.

        Returns
        -------
        LaserOnFloor
        """
        return replace(self, R=turn_2d(yaw_rad) @ self.R, t=self.t + np.array([x_mm, y_mm]), scale=self.scale + scale)

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
        return np.asarray((1 - self.scale) * np.asarray(points_mm, float) @ self.R.T + self.t)
