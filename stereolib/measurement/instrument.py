"""A calibrated instrument, in one file: the rig, where its laser stands, and how well both are known."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from stereolib.base import write_atomic
from stereolib.calibration import LidarCamera
from stereolib.measurement.object_height import Uncertainty
from stereolib.rig import RectifiedRig, StereoRig


@dataclass(frozen=True, eq=False)
class Instrument:
    """Two cameras and a laser.

    Attributes
    ----------
    rectified : RectifiedRig
    lidar : LidarCamera or None
        None where the file has none.
    uncertainty : Uncertainty
        That of the calibration, where the file tells it.
    """

    rectified: RectifiedRig
    lidar: LidarCamera | None
    uncertainty: Uncertainty

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Instrument:
        """Read ``calibration.json``, as ``stereolib calibrate`` and ``calibrate-laser`` write it.

        Raises
        ------
        ValueError
            If it is no rig file, or what it says of the laser or the deviations cannot be used.
        """
        rig = StereoRig.load(path)
        text: Mapping[str, Any] = json.loads(Path(path).read_text(encoding="utf-8"))
        try:
            known = text.get("calibration", {}).get("std", {}).get("rectified", {})
            uncertainty = Uncertainty(**{name: float(known[name]) for name in sorted(known)})
            laser = text.get("lidar")
            lidar = None if laser is None else _lidar(laser["T_left_lidar"], laser["covariance"])
        except (ValueError, LookupError, TypeError, AttributeError) as error:
            raise ValueError(f"{path}: what it says of the laser or of deviations is damaged ({error})") from error
        return cls(rig.rectify(), lidar, uncertainty)


def save_lidar(path: str | PathLike[str], lidar: LidarCamera) -> Path:
    """Write the laser's pose into a rig file; all else in it stays.

    Raises
    ------
    ValueError
        If the file is no rig file.
    """
    StereoRig.load(path)
    rig = json.loads(Path(path).read_text(encoding="utf-8"))
    rig["lidar"] = {"T_left_lidar": lidar.T_left_lidar.tolist(), "covariance": lidar.covariance.tolist()}
    return write_atomic(path, json.dumps(rig, indent=1, allow_nan=False) + "\n")


def _lidar(pose: Any, covariance: Any) -> LidarCamera:
    T, C = np.array(pose, float), np.array(covariance, float)
    turn = T[:3, :3] if T.shape == (4, 4) else np.zeros((3, 3))
    if C.shape != (6, 6) or not np.isfinite(C).all() or not np.allclose(turn @ turn.T, np.eye(3), atol=1e-6):
        raise ValueError(f"T_left_lidar must be a (4, 4) pose and covariance (6, 6), got {T.shape} and {C.shape}")
    std = np.sqrt(np.diag(C))
    return LidarCamera(T, std[:3], std[3:], C, np.zeros(0))
