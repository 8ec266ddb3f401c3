"""A station of the rig: where it stood, and what it measured there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from stereolib.base import Float64, Floats, finite_array, set_frozen, turn_2d
from stereolib.measurement import MeasuredObject, Measurement


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
    laser_mm : (2,) or (N, 2) float64
        Where the laser stands in its floor frame, or where each reading's beam starts.
    covariance : (3, 3) float64
        Of `pose`, mm and rad; zero if the pose is known.
    name : str
        What texts and drawings call it; its number among the others if empty.
    laser_covariance : (4, 4) float64
        Of the laser's place and turn in its floor frame and of its scale, by which all its readings err: mm, rad, and
        the share by which they are too far.
    laser_common : (4, k) float64
        What these are off for one standard deviation of each error that the stations share: ``common @ common.T`` is a
        part of the covariance.
    """

    pose: Float64
    objects: tuple[MeasuredObject, ...]
    scan_mm: Float64 = field(default_factory=lambda: np.zeros((0, 2)))
    laser_mm: Float64 = field(default_factory=lambda: np.zeros(2))
    covariance: Float64 = field(default_factory=lambda: np.zeros((3, 3)))
    name: str = ""
    laser_covariance: Float64 = field(default_factory=lambda: np.zeros((4, 4)))
    laser_common: Float64 = field(default_factory=lambda: np.zeros((4, 0)))

    def __post_init__(self) -> None:
        scan = np.asarray(self.scan_mm, float)
        if scan.ndim != 2 or scan.shape[1] != 2:
            raise ValueError(f"a station's scan is (N, 2) mm in its floor frame, got shape {scan.shape}")
        read, laser = np.isfinite(scan).all(axis=1), np.asarray(self.laser_mm, float)
        laser = laser[read] if laser.ndim == 2 and len(laser) == len(scan) else laser
        set_frozen(self, pose=finite_array(self.pose, (3,), "pose"), scan_mm=scan[read])
        set_frozen(self, laser_mm=finite_array(laser, (2,) if laser.ndim < 2 else (int(read.sum()), 2), "laser_mm"))
        set_frozen(self, covariance=finite_array(self.covariance, (3, 3), "covariance"))
        set_frozen(self, laser_covariance=finite_array(self.laser_covariance, (4, 4), "laser_covariance"))

    def to_map(self, points_mm: Floats) -> Float64:
        """Bring points of its floor frame into the map.

        Parameters
        ----------
        points_mm : (..., 2) array

        Returns
        -------
        (..., 2) float64, mm

        Examples
        --------
        >>> Station(np.array([1000.0, 0, np.pi / 2]), ()).to_map(np.array([[100.0, 0]])).round(6)
        array([[1000.,  100.]])
        """
        return np.asarray(np.asarray(points_mm) @ turn_2d(-self.pose[2]) + self.pose[:2])

    @classmethod
    def of(cls, measured: Measurement, pose: Sequence[float] | Float64, *, name: str = "") -> Station:
        """Make a station of what `measure_objects` measured there.

        Parameters
        ----------
        measured : Measurement
        pose : (x_mm, y_mm, yaw_rad)
        name : str

        Returns
        -------
        Station
        """
        laser = measured.laser
        return cls(
            np.asarray(pose, float),
            measured.objects,
            measured.scan_mm,
            laser.t,
            name=name,
            laser_covariance=laser.covariance,
            laser_common=laser.common,
        )


def station_names(stations: Sequence[Station]) -> list[str]:
    """List what stations are called: their names, or their numbers from 1.

    Parameters
    ----------
    stations : sequence of Station

    Returns
    -------
    list of str

    Examples
    --------
    >>> station_names([Station(np.zeros(3), ()), Station(np.zeros(3), (), name="door")])
    ['1', 'door']
    """
    return [station.name or str(k) for k, station in enumerate(stations, start=1)]
