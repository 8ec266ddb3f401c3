"""A station of the rig: where it stood, and what it measured there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from stereolib.base import Float64, Floats, finite_array, set_frozen, turn_2d
from stereolib.measurement import MeasuredObject, Measurement

#: Standard deviations of an XV-11's bias, which averaging does not remove, mm and 1/mm (see `refine_poses`).
XV11_BIAS = (1.0, 0.8e-6)


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


def laser_errors_mm(stations: Sequence[Station], by_range: float) -> Float64:
    """Tell by how much each error of the laser shifts all readings in the map, for one standard deviation of it.

    Parameters
    ----------
    stations : sequence of Station
    by_range : float
        Standard deviation of the bias that grows with the square of the range, 1/mm.

    Returns
    -------
    (k, N, 2) float64, mm
        Of the N readings of all stations, one after the other: first what all stations share (the bias, then
        `Station.laser_common`), then what each of them has alone.
    """
    ends = np.cumsum([0, *(len(station.scan_mm) for station in stations)])
    many = max(station.laser_common.shape[1] for station in stations)
    shared, own = np.zeros((1 + many, ends[-1], 2)), []
    for station, start, end in zip(stations, ends[:-1], ends[1:], strict=True):
        R, beams, common = turn_2d(-station.pose[2]), station.scan_mm - station.laser_mm, station.laser_common
        J = np.zeros((len(beams), 2, 4))  # of place, turn and scale
        J[:, 0, 0] = J[:, 1, 1] = 1.0
        J[:, 0, 2], J[:, 1, 2], J[:, :, 3] = -beams[:, 1], beams[:, 0], -beams
        values, vectors = np.linalg.eigh(station.laser_covariance - common @ common.T)
        shared[0, start:end] = by_range * np.linalg.norm(beams, axis=1)[:, None] * beams @ R
        shared[1 : 1 + common.shape[1], start:end] = np.moveaxis(J @ common, 2, 0) @ R
        alone = np.zeros((len(values), ends[-1], 2))
        alone[:, start:end] = np.moveaxis(J @ (vectors * np.sqrt(np.maximum(values, 0.0))), 2, 0) @ R
        own.append(alone)
    return np.concatenate([shared, *own])


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
