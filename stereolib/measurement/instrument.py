"""A calibrated instrument, in one file: the rig, where its laser stands, and how well both are known."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from stereolib.base import Float64, read_json, write_atomic
from stereolib.calibration import LidarCamera
from stereolib.rig import RectifiedRig, StereoRig, formats

_ROTATION_TOLERANCE = 1e-6  # of R R', for which a file's digits are enough


@dataclass(frozen=True)
class SystematicUncertainty:
    """What a calibration leaves open, and no scatter within one pair shows, as standard deviations.

    Attributes
    ----------
    f_px, baseline_mm : float
        Of the focal length after rectification, and of the baseline.
    offset_px : float
        Error that shifts every disparity of the picture alike.
    correlation : tuple of 3 floats
        Of the focal length with the baseline and with the offset, and of these two.
    """

    f_px: float = 0.0
    baseline_mm: float = 0.0
    offset_px: float = 0.0
    correlation: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def covariance(self) -> Float64:
        """Of focal length (px), baseline (mm) and offset (px). (3, 3)."""
        std, together = np.array([self.f_px, self.baseline_mm, self.offset_px]), np.eye(3)
        together[np.triu_indices(3, 1)] = self.correlation
        together.T[np.triu_indices(3, 1)] = self.correlation
        return np.asarray(together * np.outer(std, std))


@dataclass(frozen=True, eq=False)
class Instrument:
    """Two cameras and a laser.

    Attributes
    ----------
    rectified : RectifiedRig
    lidar : LidarCamera or None
        Where the laser stands to the left camera; None: nobody knows, and it is taken to stand straight below the
        camera, within 50 mm and five degrees.
    uncertainty : SystematicUncertainty
        That of the calibration, where it is known.
    """

    rectified: RectifiedRig
    lidar: LidarCamera | None = None
    uncertainty: SystematicUncertainty = field(default_factory=SystematicUncertainty)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Instrument:
        """Read ``calibration.json``, as ``stereolib calibrate`` and ``calibrate-laser`` write it.

        Parameters
        ----------
        path : path

        Returns
        -------
        Instrument

        Raises
        ------
        ValueError
            If it is no rig file, or what it says of the laser or the deviations cannot be used.
        """
        rig, text = _read_rig(path)
        with formats.naming(path):
            rectified = rig.rectify()
        remedy = "run `stereolib calibrate` again"
        try:
            known = text.get("calibration", {}).get("std", {}).get("rectified", {})
            uncertainty = _uncertainty(**known)
            laser = text.get("lidar")
            remedy = 'run `stereolib calibrate-laser` again, or take the entry "lidar" out of the file'
            lidar = None if laser is None else _lidar(laser["T_left_lidar"], laser["covariance"])
        except (ValueError, LookupError, TypeError, AttributeError) as error:
            what = f"what it says of the laser or of deviations is damaged ({error})"
            raise ValueError(f"{path}: {what}: {remedy}") from error
        return cls(rectified, lidar, uncertainty)


def save_laser_pose(path: str | PathLike[str], lidar: LidarCamera) -> Path:
    """Write the laser's pose into a rig file; all else in it stays.

    Parameters
    ----------
    path : path
        Of a rig file, as ``stereolib calibrate`` writes it.
    lidar : LidarCamera

    Returns
    -------
    Path
        Where it was written.

    Raises
    ------
    ValueError
        If the file is no rig file.
    OSError
        If it cannot be written.
    """
    rig = dict(_read_rig(path)[1])
    rig["lidar"] = {"T_left_lidar": lidar.T_left_lidar.tolist(), "covariance": lidar.covariance.tolist()}
    return write_atomic(path, json.dumps(rig, indent=1, allow_nan=False) + "\n")


def _read_rig(path: str | PathLike[str]) -> tuple[StereoRig, Mapping[str, Any]]:
    """The rig of a file, checked, and all that the file says."""
    return StereoRig.load(path), read_json(path)


def _uncertainty(correlation: Any = (0.0, 0.0, 0.0), **stds: Any) -> SystematicUncertainty:
    together = tuple(float(r) for r in correlation)
    if len(together) != 3 or not all(abs(r) <= 1 for r in together):
        raise ValueError(f"three correlations from -1 to 1 are needed, got {correlation}")
    for name, value in stds.items():
        if not 0 <= float(value) < np.inf:
            raise ValueError(f"the deviation of {name} must be a finite number from 0 on, got {value}")
    return SystematicUncertainty(**{name: float(value) for name, value in stds.items()}, correlation=together)


def _lidar(pose: Any, covariance: Any) -> LidarCamera:
    T, C = np.array(pose, float), np.array(covariance, float)
    if (T.shape, C.shape) != ((4, 4), (6, 6)):
        raise ValueError(f"T_left_lidar must be a (4, 4) pose and covariance (6, 6), got {T.shape} and {C.shape}")
    if not (np.isfinite(T).all() and np.isfinite(C).all()):
        raise ValueError("T_left_lidar and covariance must be finite numbers")
    is_rotation = np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=_ROTATION_TOLERANCE)
    if not (is_rotation and np.linalg.det(T[:3, :3]) > 0 and np.array_equal(T[3], (0, 0, 0, 1))):
        raise ValueError("T_left_lidar must be a rotation (3, 3) and a shift in mm, above the row 0 0 0 1")
    least = float(np.linalg.eigvalsh((C + C.T) / 2)[0])
    if not np.allclose(C, C.T) or least < -_ROTATION_TOLERANCE * np.trace(C):
        raise ValueError("covariance must be symmetric, without negative variances")
    std = np.sqrt(np.diag(C))
    return LidarCamera(T, std_rad=std[:3], std_mm=std[3:], covariance=C, view_misses=np.zeros(0))
