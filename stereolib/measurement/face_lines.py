"""Lines of an object's visible faces on the floor: as the scan has them, as the pair has them, and both in one.

Frame: origin on the floor below the left camera, x forward along the optical axis laid flat, y left, mm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolib.calibration import LidarCamera
from stereolib.laser import Footprint
from stereolib.measurement.faces import Face
from stereolib.measurement.floor import Floor
from stereolib.measurement.object_height import Uncertainty

Array = np.ndarray
_TURN = np.pi / 2
_DISAGREE = 5.0  # standard deviations between laser and picture


@dataclass(frozen=True, eq=False)
class LaserOnFloor:
    """Where the laser stands in the floor's frame: ``p_floor = R p_scan + t``, and the covariance of (x, y, yaw)."""

    R: Array
    t: Array
    covariance: Array

    @classmethod
    def of(cls, lidar: LidarCamera, floor: Floor) -> LaserOnFloor:
        """Pose of a calibrated laser over a floor; its plane is taken as parallel to the floor."""
        T = floor.axes @ floor.rectified.R1 @ lidar.T_left_lidar[:3]
        yaw = np.arctan2(T[1, 0], T[0, 0])
        R = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        J = np.zeros((3, 6))
        J[:2, 3:5], J[2, 2] = R, 1.0
        return cls(R, T[:2, 3], J @ lidar.covariance @ J.T)

    @property
    def yaw_rad(self) -> float:
        """Direction of the laser's beam 0."""
        return float(np.arctan2(self.R[1, 0], self.R[0, 0]))

    def points_mm(self, points_mm: Array) -> Array:
        """Points of the scan (N, 2) on the floor, (N, 2) mm."""
        return np.asarray(points_mm, float) @ self.R.T + self.t


@dataclass(frozen=True, eq=False)
class Lines:
    """Lines ``n . p = c`` of an upright object's one or two visible faces; normals point away from the camera.

    Attributes
    ----------
    x : (3,) float64
        Angle of the right face's normal (the left one's is a quarter turn less), c of the right and of the left face,
        rad and mm; NaN for a face that is not seen. A single face is the right one.
    covariance : (3, 3) float64
    """

    x: Array
    covariance: Array

    @property
    def seen(self) -> tuple[int, ...]:
        """Which faces: 0 right, 1 left."""
        return tuple(k for k in (0, 1) if np.isfinite(self.x[1 + k]))

    def normal(self, face: int) -> Array:
        angle = self.x[0] - face * _TURN
        return np.array([np.cos(angle), np.sin(angle)])


def scanned_lines(footprint: Footprint | None, laser: LaserOnFloor | None, bias_mm: float) -> Lines | None:
    """The footprint's lines on the floor, with the errors that its readings share and those of the laser's pose."""
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
        n, along = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        if k == 0:
            x[0] = angle
        elif abs(wrapped(angle - x[0] + _TURN)) > 0.1:
            return None  # the corner points away
        x[1 + k] = offset + n @ laser.t
        pose[0], pose[1 + k] = (0, 0, 1), (*n, along @ laser.t)
        seen = laser.points_mm(members) - laser.t
        facing = float(np.mean(seen @ n / np.linalg.norm(seen, axis=1)))
        shared[1 + k, k] = bias_mm * facing
        shared[1 + k, 2] = float(seen.mean(axis=0) @ along)  # turned about the middle of its readings
    length = max(float(np.linalg.norm(np.ptp(points, axis=0))), 1.0)
    shared[0, 2] = 1.0
    shared[:, 2] *= 0.3 * bias_mm / length
    known = slice(1 + count)
    C[known, known] = max(footprint.misfit, 1.0) ** 2 * fit.covariance * np.outer(signs[known], signs[known])
    return Lines(x, C + shared @ shared.T + pose @ laser.covariance @ pose.T)


def pictured_lines(faces: tuple[Face, ...], floor: Floor, given: Uncertainty) -> Lines | None:
    """The lines ``1 = a x + b y`` of the faces that the pair sees, with the errors that their disparities share."""
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
        middle, half = (right + left) / 2, max((left - right) / 2, 0.01)
        shift, tilt = np.array([1.0, 0.0]), np.array([-middle, 1.0]) / half
        common = (given.face_px / scale) ** 2 * (np.outer(shift, shift) + np.outer(tilt, tilt))
        C[mine, mine] = D @ (face.covariance + common) @ D.T
        offset[mine] = D[:, 0] * given.offset_px / scale
    C += np.outer(offset, offset)
    off = wrapped(y[0] - y[2] - _TURN) if len(faces) == 2 else 0.0
    if len(faces) == 2 and abs(off) > max(0.2, 4 * np.sqrt(C[0, 0] + C[2, 2])):  # not a box's corner
        best = int(faces[1].pixels > faces[0].pixels)
        return pictured_lines(faces[best : best + 1], floor, given)
    if len(faces) == 1:
        full = np.zeros((3, 3))
        full[:2, :2] = C
        return Lines(np.append(y, np.nan), full)
    H = np.array([[1.0, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0, 1]])
    y[2] = y[0] - off
    W = np.linalg.inv(C)
    covariance = np.linalg.inv(H.T @ W @ H)
    return Lines(covariance @ (H.T @ W @ y), covariance)


def _as_left(lines: Lines) -> Lines:
    """A single face in the role of the left one."""
    order = [0, 2, 1]
    return Lines(np.array([lines.x[0] + _TURN, np.nan, lines.x[1]]), lines.covariance[np.ix_(order, order)])


def _as_right(lines: Lines) -> Lines:
    """A left face that stays alone is the right one."""
    order = [0, 2, 1]
    return Lines(np.array([lines.x[0] - _TURN, lines.x[2], np.nan]), lines.covariance[np.ix_(order, order)])


def combined(scanned: Lines | None, pictured: Lines | None) -> tuple[Lines, str, str]:
    """Both sensors' lines in one, who gave how much, and in what they contradict each other."""
    if scanned is None or pictured is None:
        one = scanned or pictured
        assert one is not None
        return one, "scan" if scanned is not None else "image", ""
    turn = wrapped(pictured.x[0] - scanned.x[0])
    if len(pictured.seen) == 1 and turn < -_TURN / 2:
        pictured = _as_left(pictured)
    elif len(scanned.seen) == 1 and turn > _TURN / 2:
        scanned = _as_left(scanned)
    turn = wrapped(pictured.x[0] - scanned.x[0])
    apart = [k for k in scanned.seen if k in pictured.seen and _far_apart(scanned, pictured, 1 + k)]
    text = " and ".join(f"{scanned.x[1 + k]:.0f} and {pictured.x[1 + k]:.0f} mm" for k in apart)
    text = f"scan and pair disagree about the distance of a face's line: {text}" if text else ""
    if len(apart) == len(pictured.seen) or abs(turn) > 0.5:
        return pictured, "image", text or f"scan and pair disagree by {abs(np.degrees(turn)):.0f} degrees on a face"
    for k in apart:
        scanned, pictured = (
            Lines(np.where(np.arange(3) == 1 + k, np.nan, one.x), one.covariance) for one in (scanned, pictured)
        )
    both = [0, *(1 + k for k in scanned.seen if k in pictured.seen)]
    off = (pictured.x - scanned.x)[both]
    off[0] = turn
    spread = (scanned.covariance + pictured.covariance)[np.ix_(both, both)]
    chi2 = float(off @ np.linalg.solve(spread, off))
    scale = max(1.0, chi2 / len(both))
    A, rhs, mine = np.zeros((3, 3)), np.zeros(3), np.zeros((3, 3))
    for lines, x in ((scanned, scanned.x), (pictured, np.append(scanned.x[0] + turn, pictured.x[1:]))):
        known = [0, *(1 + k for k in lines.seen)]
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
    lines = Lines(x, covariance)
    return (
        lines if 0 in lines.seen else _as_right(lines),
        f"scan {100 * share:.0f} %, image {100 - 100 * share:.0f} %",
        text,
    )


def _far_apart(a: Lines, b: Lines, k: int) -> bool:
    return bool((a.x[k] - b.x[k]) ** 2 > _DISAGREE**2 * (a.covariance[k, k] + b.covariance[k, k]))


def without(lines: Lines, face: int) -> Lines:
    """One face left out; the other stays alone."""
    x = lines.x.copy()
    x[1 + face] = np.nan
    one = Lines(x, lines.covariance)
    return one if 0 in one.seen else _as_right(one)


def wrapped(angle: float) -> float:
    """The same angle between -pi and pi."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)
