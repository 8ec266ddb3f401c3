"""A calibrated instrument, in one file: the rig, where its laser stands, and how well both are known."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scipy.linalg import block_diag

from stereolib.base import Float64, finite_array, read_json, write_atomic
from stereolib.calibration import (
    LASER_SCALE_STD,
    CalibrationRecord,
    DisparityErrors,
    LidarCamera,
    damage,
    deviations,
    rectified_std,
)
from stereolib.rig import RectifiedRig, StereoRig, calibration_notes, formats

_TOLD_RISE = 0.005  # baselines: a smaller rise is not said
_TOLD_PX, _UNTOLD_PX = 0.1, 10.0  # a smaller turn is not said; where only larger ones show, rows say nothing
_ROTATION_TOLERANCE = 1e-6  # of R R', for which a file's digits are enough
_CENTIMETRES_MM = 20.0  # no two webcams stand nearer to each other
_MOST_SCALE = 0.5  # of a laser: no reading is twice as far
_ROUNDED = 0.01  # below zero: digits that a file leaves out make an eigenvalue of correlations so small
_MOST_STD = 1e6  # of deviations, mm or px: a kilometre is damage, and products overflow
_FARTHEST_MM = 2000.0  # from the left lens to the laser: no rig is larger


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
    errors : DisparityErrors or None
        Errors besides, from place to place, where the covariance of all parameters is known.

    Raises
    ------
    ValueError
        If no three quantities can be correlated so.
    """

    f_px: float = 0.0
    baseline_mm: float = 0.0
    offset_px: float = 0.0
    correlation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    errors: DisparityErrors | None = None

    def __post_init__(self) -> None:
        if not np.linalg.eigvalsh(self._together)[0] >= -_ROUNDED:
            why = "no three quantities are correlated so: each must be within -1 and 1, and all fit to each other"
            raise ValueError(f"correlation {self.correlation}: {why}; leave it out if it is not known")

    @classmethod
    def of(cls, rectified: RectifiedRig, covariance: Float64) -> SystematicUncertainty:
        """Tell all that a calibration leaves open.

        Parameters
        ----------
        rectified : RectifiedRig
            Of the calibrated rig.
        covariance : (s, s) float64
            From `stereolib.calibration.rig_covariance`.

        Returns
        -------
        SystematicUncertainty

        Raises
        ------
        ValueError
            If the cameras see nothing together where rigs measure.
        """
        return cls(**rectified_std(rectified, covariance), errors=DisparityErrors(rectified, covariance))

    def at(self, u: Float64, v: Float64) -> SystematicUncertainty:
        """The same at one place of the picture, where the errors from place to place are known.

        Parameters
        ----------
        u, v : (N,) float64, px
            Pixels of the rectified left picture that lie there; three and more that lie on no line.

        Returns
        -------
        SystematicUncertainty
        """
        return self if self.errors is None else replace(self, **deviations(self.errors.alike(u, v)))

    @property
    def covariance(self) -> Float64:
        """Of focal length (px), baseline (mm) and offset (px). (3, 3)."""
        std = np.array([self.f_px, self.baseline_mm, self.offset_px])
        return np.asarray(self._together * np.outer(std, std))

    @property
    def _together(self) -> Float64:
        """The correlations as a matrix. (3, 3)."""
        together = np.eye(3)
        together[np.triu_indices(3, 1)] = self.correlation
        together.T[np.triu_indices(3, 1)] = self.correlation
        return together

    def with_offset(self, std_px: float) -> SystematicUncertainty:
        """The same, with something else that shifts every disparity.

        Parameters
        ----------
        std_px : float
            Its standard deviation.

        Returns
        -------
        SystematicUncertainty
        """
        both, (f_and_b, *with_it) = float(np.hypot(self.offset_px, std_px)), self.correlation
        first, second = (self.offset_px / both * r if both else r for r in with_it)
        return replace(self, offset_px=both, correlation=(f_and_b, first, second))


@dataclass(frozen=True)
class CameraMoves:
    """How far the cameras moved against each other since their calibration, as a pair tells.

    Attributes
    ----------
    turn_px, turn_std_px : float
        By how much all disparities were too small for a turn sideways, and the standard deviation of what it leaves.
    chance : float
        Probability that they were turned at all, as far as the pair makes it likelier than one in ten.
    seen_px : float
        A turn by more is taken as one in 39 of 40 pairs; what is less may show in nothing.
    rise_mm, rise_std_mm : float
        By how much the right camera rose against the left one, and the standard deviation of what that leaves.
    """

    turn_px: float
    turn_std_px: float
    chance: float
    seen_px: float
    rise_mm: float = 0.0
    rise_std_mm: float = 0.0


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
    moves : CameraMoves or None
        What a pair told of its cameras, which are moved back by it (`moved_back`).
    """

    rectified: RectifiedRig
    lidar: LidarCamera | None = None
    uncertainty: SystematicUncertainty = field(default_factory=SystematicUncertainty)
    moves: CameraMoves | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.rectified, RectifiedRig):
            raise TypeError(f"an instrument takes a RectifiedRig (rig.rectify()), got {type(self.rectified).__name__}")

    @property
    def warnings(self) -> tuple[str, ...]:
        """What makes everything doubtful that is measured with it."""
        said = [] if self.lidar is None else [self.lidar.warning]
        again = "Corrected here: calibrate again; stereolib check tells what has moved"
        if self.moves is not None and abs(self.moves.turn_px) > _TOLD_PX:
            turn_px, std_px = abs(self.moves.turn_px), self.moves.turn_std_px
            turned, std = (np.degrees(px / self.rectified.f_px) for px in (turn_px, std_px))
            how = f"by {turned:.2f} ± {std:.2f} degrees, {turn_px:.1f} px of all disparities"
            said.append(
                "rows drift apart towards the corners, as of cameras that turned sideways against each other since "
                f"their calibration: {how}. {again}"
            )
        if self.moves is not None and abs(self.moves.rise_mm) > _TOLD_RISE * self.rectified.baseline_mm:
            how = f"{'rose' if self.moves.rise_mm > 0 else 'sank'} by {abs(self.moves.rise_mm):.1f}"
            said.append(
                "rows disagree the more the nearer something is, as of a right camera that "
                f"{how} ± {self.moves.rise_std_mm:.1f} mm against the left one since the calibration, or of things "
                f"that moved between the two pictures. {again}"
            )
        if (apart_mm := self.rectified.baseline_mm) < _CENTIMETRES_MM:
            why = "if the board's squares were told in centimetres, all sizes are; calibrate again with millimetres"
            said.append(f"the calibration has the cameras {apart_mm:.1f} mm apart: {why}")
        return tuple(filter(None, said))

    @property
    def turn_std_px(self) -> float:
        """What is left open of a turn of the cameras: a shift of all disparities, as a standard deviation."""
        return 0.0 if self.moves is None else self.moves.turn_std_px

    def moved_back(self, moves: CameraMoves) -> Instrument:
        """Turn both cameras back, each by half, about the upright axis; and both by a rise, about the optical one.

        Parameters
        ----------
        moves : CameraMoves

        Returns
        -------
        Instrument
            Whose rows lie along a baseline that rises with the right camera, and that may point half a turn ahead or
            back: nobody knows which of the cameras was turned. Nor whether a rise made it longer, or turned it.
        """
        rectified, errors = self.rectified, self.uncertainty.errors
        half = cv2.Rodrigues(np.array([0.0, moves.turn_px / rectified.f_px / 2, 0.0]))[0]
        rise_rad = np.arctan(moves.rise_mm / rectified.baseline_mm)
        level = cv2.Rodrigues(np.array([0.0, 0.0, rise_rad]))[0]
        R1, R2 = level @ half @ rectified.R1, level @ half.T @ rectified.R2
        rig = replace(rectified.rig, R=R2.T @ R1, T=-rectified.baseline_mm * R2[0])
        rectified = replace(rectified, rig=rig, R1=R1, R2=R2)
        if errors is not None:
            open_mm = np.zeros((2, len(errors.covariance)))  # ahead; and along
            open_mm[:, -3:] = rectified.baseline_mm * np.array([half[0, 2] * R2[2], rise_rad**2 / 2 * R2[0]])
            errors = DisparityErrors(rectified, errors.covariance + open_mm.T @ open_mm)
        return replace(self, rectified=rectified, uncertainty=replace(self.uncertainty, errors=errors), moves=moves)

    def turned_unseen(self, depth_mm: float, *, is_opposed: bool = False) -> str:
        """Say what a camera that was turned sideways changes, which nothing in a pair shows.

        Parameters
        ----------
        depth_mm : float
            Of what is measured.
        is_opposed : bool
            A scan agrees with nothing in the pair, and is left out.

        Returns
        -------
        str
        """
        pct = 100 * depth_mm / (self.rectified.f_px * self.rectified.baseline_mm)
        shown = "that may be what the scan opposes" if is_opposed else "nothing here shows it"
        if self.moves is not None and self.moves.seen_px < _UNTOLD_PX:
            shown = f"less than {self.moves.seen_px:.1f} px of it may show in nothing here"
        return (
            f"sizes are the pair's alone: if a camera was turned sideways since its calibration, {shown}; each pixel "
            f"of it changes them by {pct:.1f} %, which is not in their intervals"
        )

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
        notes, remedy = calibration_notes(path), "run `stereolib calibrate` again"
        std = notes.get("std", {})
        try:
            uncertainty = _uncertainty(**std.get("rectified", {}))
            laser = text.get("lidar")
            remedy = 'run `stereolib calibrate-laser` again, or take the entry "lidar" out of the file'
            lidar = None if laser is None else _lidar(laser["T_left_lidar"], laser["covariance"], laser.get("scale"))
        except (ValueError, LookupError, TypeError, AttributeError) as error:
            what = f"what it says of the laser or of deviations is damaged ({damage(error)})"
            raise ValueError(f"{path}: {what}: {remedy}") from error
        if "record" in notes and std.get("rectified"):
            covariance = CalibrationRecord.load(path, rig).covariance
            uncertainty = replace(uncertainty, errors=DisparityErrors(rectified, covariance))
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
    pose, covariance = lidar.T_left_lidar.tolist(), lidar.covariance.tolist()
    rig["lidar"] = {"T_left_lidar": pose, "scale": lidar.scale, "covariance": covariance}
    return write_atomic(path, json.dumps(rig, indent=1, allow_nan=False) + "\n")


def _read_rig(path: str | PathLike[str]) -> tuple[StereoRig, Mapping[str, Any]]:
    """The rig of a file, checked, and all that the file says."""
    return StereoRig.load(path), read_json(path)


def _uncertainty(
    f_px: Any = 0.0, baseline_mm: Any = 0.0, offset_px: Any = 0.0, correlation: Any = (0.0, 0.0, 0.0)
) -> SystematicUncertainty:
    given = {"f_px": f_px, "baseline_mm": baseline_mm, "offset_px": offset_px}
    f, b, offset = (float(finite_array(value, (), name, most=_MOST_STD)) for name, value in given.items())
    if min(f, b, offset) < 0:
        raise ValueError(f"a deviation is 0 or more, got {given}")
    r = finite_array(correlation, (3,), "correlation", most=1.0)
    return SystematicUncertainty(f, b, offset, (float(r[0]), float(r[1]), float(r[2])))


def _lidar(pose: Any, covariance: Any, scale: Any) -> LidarCamera:
    """From what a file says; one without a scale is of a laser whose scale nobody calibrated."""
    T = finite_array(pose, (4, 4), "T_left_lidar", most=_FARTHEST_MM)
    size = 6 if scale is None else 7
    C = finite_array(covariance, (size, size), "covariance", most=_MOST_STD**2)
    e = 0.0 if scale is None else float(finite_array(scale, (), "scale", most=_MOST_SCALE))
    is_rotation = np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=_ROTATION_TOLERANCE)
    if not (is_rotation and np.linalg.det(T[:3, :3]) > 0 and np.array_equal(T[3], (0, 0, 0, 1))):
        raise ValueError("T_left_lidar must be a rotation (3, 3) and a shift in mm, above the row 0 0 0 1")
    least = float(np.linalg.eigvalsh((C + C.T) / 2)[0])
    if not np.allclose(C, C.T) or least < -_ROTATION_TOLERANCE * np.trace(C) or not np.diag(C).min() > 0:
        raise ValueError("covariance must be symmetric, without zero or negative variances")
    C = C if size == 7 else block_diag(C, LASER_SCALE_STD**2)
    return LidarCamera(T, e, C)
