"""Lines of an object's visible faces on the floor: as the scan has them, as the pair has them, and both in one.

Frame: origin on the floor below the left camera, x forward along the optical axis laid flat, y left, mm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolib.base import Float64, Floats, direction, turn_2d, wrap_rad
from stereolib.calibration import LidarCamera
from stereolib.laser import Footprint
from stereolib.measurement.faces import Face
from stereolib.measurement.floor import Floor
from stereolib.measurement.object_height import SystematicUncertainty

_TURN = np.pi / 2
_DISAGREE = 5.0  # standard deviations between laser and picture
_DISAGREE_RAD = 0.5  # and so much between their directions
_CORNER_RAD = 0.1  # what a scan's two lines may differ from a right angle: they were fitted with one
_PICTURED_CORNER = (0.2, 4.0)  # what two faces of the pair may: rad, or standard deviations
_LEAST_HALF = 0.01  # tangent: half of a face's width is taken as so much at least
_TILT = 0.3  # share of the laser's bias by which it differs from end to end of a face


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


@dataclass(frozen=True, eq=False)
class FaceLines:
    """Lines ``n . p = c`` of an upright object's one or two visible faces; normals point away from the camera.

    Attributes
    ----------
    x : (3,) float64
        Angle of the right face's normal (the left one's is a quarter turn less), c of the right and of the left face,
        rad and mm; NaN for a face that is not seen. A single face is the right one.
    covariance : (3, 3) float64
    """

    x: Float64
    covariance: Float64

    @property
    def visible(self) -> tuple[int, ...]:
        """Which faces are seen: 0 right, 1 left."""
        return tuple(k for k in (0, 1) if np.isfinite(self.x[1 + k]))

    def normal(self, face: int) -> Float64:
        """Unit normal of a face.

        Parameters
        ----------
        face : int
            0 right, 1 left.

        Returns
        -------
        (2,) float64
        """
        return direction(self.x[0] - face * _TURN)


def scanned_lines(footprint: Footprint | None, laser: LaserOnFloor | None) -> FaceLines | None:
    """Put a footprint's lines on the floor, with the errors that its readings share and those of the laser's pose.

    Parameters
    ----------
    footprint : Footprint or None
    laser : LaserOnFloor or None

    Returns
    -------
    FaceLines or None
        None where the scan shows no straight face.
    """
    if footprint is None or laser is None or footprint.fit is None:
        return None
    fit, points = footprint.fit, footprint.segment.points_mm
    x, C = np.full(3, np.nan), np.zeros((3, 3))
    count = len(fit.parameters) - 1
    signs = np.ones(3)
    pose, shared = np.zeros((3, 3)), np.zeros((3, 3))
    for k in range(count):
        members = (points[: fit.split], points[fit.split :])[k]
        angle, offset = fit.parameters[0] + k * _TURN, fit.parameters[1 + k]
        if offset < 0:
            angle, offset, signs[1 + k] = angle + np.pi, -offset, -1.0
        angle += laser.yaw_rad
        n = direction(angle)
        along = np.array([-n[1], n[0]])
        if k == 0:
            x[0] = angle
        elif abs(wrap_rad(angle - x[0] + _TURN)) > _CORNER_RAD:
            return None  # the corner points away
        x[1 + k] = offset + n @ laser.t
        pose[0], pose[1 + k] = (0, 0, 1), (*n, along @ laser.t)
        beams = laser.points_mm(members) - laser.t
        facing = float(np.mean(beams @ n / np.linalg.norm(beams, axis=1)))
        shared[1 + k, k] = laser.bias_mm * facing
        shared[1 + k, 2] = float(beams.mean(axis=0) @ along)  # turned about the middle of its readings
    length = max(float(np.linalg.norm(np.ptp(points, axis=0))), 1.0)
    shared[0, 2] = 1.0
    shared[:, 2] *= _TILT * laser.bias_mm / length
    known = slice(1 + count)
    C[known, known] = max(footprint.misfit, 1.0) ** 2 * fit.covariance * np.outer(signs[known], signs[known])
    return FaceLines(x, C + shared @ shared.T + pose @ laser.covariance @ pose.T)


def pictured_lines(faces: tuple[Face, ...], floor: Floor, uncertainty: SystematicUncertainty) -> FaceLines | None:
    """Lines ``1 = a x + b y`` of the faces that the pair shows, with the errors that their disparities share.

    Parameters
    ----------
    faces : tuple of Face
    floor : Floor
    uncertainty : SystematicUncertainty

    Returns
    -------
    FaceLines or None
        None without faces. Two that make no box's corner leave the one with more pixels.
    """
    if not faces:
        return None
    scale = floor.rectified.f_px * floor.rectified.baseline_mm
    y, C, offset = np.zeros(2 * len(faces)), np.zeros((2 * len(faces),) * 2), np.zeros(2 * len(faces))
    for k, face in enumerate(faces):
        a, b = face.line
        size = np.hypot(a, b)
        D = np.array([[-b, a], [-a / size, -b / size]]) / size**2
        mine = slice(2 * k, 2 * k + 2)
        y[mine] = np.arctan2(b, a), 1 / size
        right, left = face.bearing
        middle, half = (right + left) / 2, max((left - right) / 2, _LEAST_HALF)
        shift, tilt = np.array([1.0, 0.0]), np.array([-middle, 1.0]) / half
        common = (uncertainty.face_px / scale) ** 2 * (np.outer(shift, shift) + np.outer(tilt, tilt))
        C[mine, mine] = D @ (face.covariance + common) @ D.T
        offset[mine] = D[:, 0] * uncertainty.offset_px / scale
    C += np.outer(offset, offset)
    off = wrap_rad(y[0] - y[2] - _TURN) if len(faces) == 2 else 0.0
    least, deviations = _PICTURED_CORNER
    if len(faces) == 2 and abs(off) > max(least, deviations * np.sqrt(C[0, 0] + C[2, 2])):
        best = int(faces[1].pixels > faces[0].pixels)
        return pictured_lines(faces[best : best + 1], floor, uncertainty)
    if len(faces) == 1:
        return FaceLines(np.append(y, np.nan), np.pad(C, (0, 1)))
    H = np.array([[1.0, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0, 1]])
    y[2] = y[0] - off
    W = np.linalg.inv(C)
    covariance = np.linalg.inv(H.T @ W @ H)
    return FaceLines(covariance @ (H.T @ W @ y), covariance)


def _swapped(lines: FaceLines, turn: float) -> FaceLines:
    """A single face in the other one's role; its normal's angle is that of the right one, `turn` on."""
    order = [0, 2, 1]
    x = np.array([lines.x[0] + turn, lines.x[2], lines.x[1]])
    return FaceLines(x, lines.covariance[np.ix_(order, order)])


def combined(scanned: FaceLines | None, pictured: FaceLines | None) -> tuple[FaceLines, str, str]:
    """Combine both sensors' lines by their covariances.

    Parameters
    ----------
    scanned, pictured : FaceLines or None
        At least one of them is given.

    Returns
    -------
    lines : FaceLines
        Where the sensors contradict each other on all faces, the picture's.
    shares : str
        Who gave how much: ``"scan"``, ``"image"`` or ``"scan 24 %, image 76 %"``.
    disagreement : str
        In what they contradict each other; empty if they do not.
    """
    if scanned is None or pictured is None:
        one = scanned or pictured
        assert one is not None
        return one, "scan" if scanned is not None else "image", ""
    turn = wrap_rad(pictured.x[0] - scanned.x[0])
    if len(pictured.visible) == 1 and turn < -_TURN / 2:
        pictured = _swapped(pictured, _TURN)
    elif len(scanned.visible) == 1 and turn > _TURN / 2:
        scanned = _swapped(scanned, _TURN)
    turn = wrap_rad(pictured.x[0] - scanned.x[0])
    apart = [k for k in scanned.visible if k in pictured.visible and _far_apart(scanned, pictured, 1 + k)]
    text = " and ".join(f"{scanned.x[1 + k]:.0f} and {pictured.x[1 + k]:.0f} mm" for k in apart)
    text = f"scan and pair disagree about the distance of a face's line: {text}" if text else ""
    if len(apart) == len(pictured.visible) or abs(turn) > _DISAGREE_RAD:
        return pictured, "image", text or f"scan and pair disagree by {abs(np.degrees(turn)):.0f} degrees on a face"
    for k in apart:
        scanned, pictured = (_blanked(lines, k) for lines in (scanned, pictured))
    both = [0, *(1 + k for k in scanned.visible if k in pictured.visible)]
    off = (pictured.x - scanned.x)[both]
    off[0] = turn
    spread = (scanned.covariance + pictured.covariance)[np.ix_(both, both)]
    chi2 = float(off @ np.linalg.solve(spread, off))
    scale = max(1.0, chi2 / len(both))
    A, rhs, mine = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3))
    for lines, x in ((scanned, scanned.x), (pictured, np.append(scanned.x[0] + turn, pictured.x[1:]))):
        known = [0, *(1 + k for k in lines.visible)]
        at = np.ix_(known, known)
        W = np.linalg.inv(lines.covariance[at] * scale)
        A[at] += W
        rhs[known] += W @ x[known]
        if lines is scanned:
            mine[at] = W
    known = [k for k in range(3) if A[k, k] > 0]
    at = np.ix_(known, known)
    x, covariance = np.full(3, np.nan), np.zeros((3, 3))
    covariance[at] = np.linalg.inv(A[at])
    x[known] = covariance[at] @ rhs[known]
    share = float(np.trace(covariance @ mine)) / len(known)
    lines = FaceLines(x, covariance)
    shares = f"scan {100 * share:.0f} %, image {100 - 100 * share:.0f} %"
    return lines if 0 in lines.visible else _swapped(lines, -_TURN), shares, text


def _far_apart(a: FaceLines, b: FaceLines, k: int) -> bool:
    return bool((a.x[k] - b.x[k]) ** 2 > _DISAGREE**2 * (a.covariance[k, k] + b.covariance[k, k]))


def _blanked(lines: FaceLines, face: int) -> FaceLines:
    return FaceLines(np.where(np.arange(3) == 1 + face, np.nan, lines.x), lines.covariance)


def without(lines: FaceLines, face: int) -> FaceLines:
    """Leave one face out; the other stays alone, as the right one.

    Parameters
    ----------
    lines : FaceLines
        Of two faces.
    face : int
        0 right, 1 left.

    Returns
    -------
    FaceLines
    """
    return _swapped(_blanked(lines, face), -_TURN) if face == 0 else _blanked(lines, face)
