"""The joint least-squares problem of a stereo calibration: residuals, exact Jacobian, normal equations, refits.

Parameters that all pairs share stand first: fx fy cx cy and the n coefficients of the left lens, the same of the
right one, three turns and three shifts of the pair, ``s = 2 (4 + n) + 6`` in all. Each pair's board pose, six more, is
eliminated from the normal equations (Schur complement), so that what is left has the size s whatever the number of
pairs (Triggs et al., Bundle adjustment: a modern synthesis, 2000, section 6).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from stereolib.calibration.boards import BoardViews
from stereolib.rig import Camera, StereoRig

Array = np.ndarray
_DAMPING = 1e-3
#: Gauss-Newton steps after `cv2.solvePnP`, which stops at 1e-7 rad: each gains two digits or more, six reach rounding.
_POSE_STEPS = 6


@dataclass(frozen=True, eq=False)
class Fit:
    """A rig, the boards' poses in the left camera, and the problem linearised there.

    Attributes
    ----------
    turns (n, 3, 3), shifts (n, 3) mm : ``x_left = turn @ x_board + shift``
    residuals_px : (n, 2, corners, 2), found minus predicted, left then right; 0 where `seen` is False
    seen : (n, 2, corners) bool
    normal : (n, s, s), each pair's part of the normal matrix, its pose eliminated
    gradient : (n, s), each pair's part of the right-hand side
    """

    rig: StereoRig
    turns: Array
    shifts: Array
    residuals_px: Array
    seen: Array
    normal: Array
    gradient: Array
    _poses: tuple[Array, Array, Array]

    @property
    def rms_px(self) -> float:
        """Rms distance of found and predicted corners over both cameras, as OpenCV counts it."""
        return float(np.sqrt((self.residuals_px**2).sum() / self.seen.sum()))

    @property
    def pair_rms_px(self) -> Array:
        """The same of each pair and camera, (n, 2)."""
        return np.sqrt((self.residuals_px**2).sum(axis=(2, 3)) / self.seen.sum(axis=2))

    @property
    def sigma_px(self) -> float:
        """Standard deviation of one coordinate, from the residuals and the degrees of freedom."""
        free = 2 * int(self.seen.sum()) - 6 * len(self.turns) - self.normal.shape[1]
        return float(np.sqrt((self.residuals_px**2).sum() / max(free, 1)))

    def without_each(self) -> Array:
        """How the shared parameters move when each pair in turn is left out. (n, s).

        One Gauss-Newton step from the optimum, ``-(N - N_k)^-1 g_k``: exact to first order.
        """
        rest = self.normal.sum(axis=0) - self.normal
        return np.array([_solve(N, -g) for N, g in zip(rest, self.gradient, strict=True)])


def fit(views: BoardViews, rig: StereoRig, *, iterations: int = 30, free: bool = True) -> Fit:
    """Fit a rig and the boards' poses to all corners, from a start that is near.

    Parameters
    ----------
    views : BoardViews
        Corners that were not found are NaN.
    rig : StereoRig
        Where to start; the number of its coefficients is that of the lens fitted.
    free : bool
        False keeps the rig and poses the boards only, as for pairs that the rig has never seen.

    Notes
    -----
    Levenberg-Marquardt with the diagonal as the scale, until a step gains less than 1e-9 of the sum of squares.
    """
    now = _linearise(views, rig, *_start(views, rig))
    if not free:
        return _posed(views, now, iterations)
    damping = _DAMPING
    for _ in range(iterations):
        before = float((now.residuals_px**2).sum())
        gain = -1.0
        while gain < 0 and damping < 1e8:
            total = now.normal.sum(axis=0)
            step = _solve(total + damping * np.diag(np.diag(total)), now.gradient.sum(axis=0))
            try:
                trial = _linearise(views, moved(now.rig, step), *_pose_step(now, step))
                gain = before - float((trial.residuals_px**2).sum())
            except ValueError:  # a step out of what a camera can be
                gain = -1.0
            damping *= 0.1 if gain >= 0 else 10.0
        if gain < 0:
            break
        now = trial
        if gain <= 1e-9 * before:
            break
    return now


def moved(rig: StereoRig, step: Array) -> StereoRig:
    """A rig after a step (s,) of its shared parameters."""
    n = 4 + rig.left.dist.size
    cameras = []
    for camera, part in ((rig.left, step[:n]), (rig.right, step[n : 2 * n])):
        K = camera.K + np.array([[part[0], 0, part[2]], [0, part[1], part[3]], [0, 0, 0]])
        cameras.append(Camera(K, camera.dist + part[4:], camera.size))
    turn = cv2.Rodrigues(step[2 * n : 2 * n + 3])[0]
    return StereoRig(cameras[0], cameras[1], turn @ rig.R, rig.T + step[2 * n + 3 :])


def vector(rig: StereoRig, reference: StereoRig) -> Array:
    """The step (s,) that leads from one rig to another of the same lens model; undoes `moved`."""
    parts = [
        np.concatenate([a.K[[0, 1, 0, 1], [0, 1, 2, 2]] - b.K[[0, 1, 0, 1], [0, 1, 2, 2]], a.dist - b.dist])
        for a, b in ((rig.left, reference.left), (rig.right, reference.right))
    ]
    return np.concatenate([*parts, cv2.Rodrigues(rig.R @ reference.R.T)[0].ravel(), rig.T - reference.T])


def project(camera: Camera, points: Array) -> tuple[Array, Array, Array]:
    """Pixels (..., 2) of points (..., 3) in the camera's frame, and derivatives.

    Returns
    -------
    pixels : (..., 2)
    by_point : (..., 2, 3), px/mm
    by_lens : (..., 2, 4 + n), by fx fy cx cy and the coefficients
    """
    dist = camera.dist if camera.dist.size else np.zeros(5)
    none = np.zeros(3)
    pixels, jacobian = cv2.projectPoints(points.reshape(-1, 1, 3), none, none, camera.K, dist)
    jacobian = jacobian.reshape(*points.shape[:-1], 2, -1)
    return pixels.reshape(*points.shape[:-1], 2), jacobian[..., 3:6], jacobian[..., 6 : 10 + camera.dist.size]


def crosses(vectors: Array) -> Array:
    """``-skew(v)`` of vectors (..., 3): the derivative of ``w x v`` by w. (..., 3, 3)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    o = np.zeros_like(x)
    return np.stack([o, z, -y, -z, o, x, y, -x, o], -1).reshape(*vectors.shape, 3)


def _linearise(views: BoardViews, rig: StereoRig, turns: Array, shifts: Array) -> Fit:
    board = views.board.points_mm.astype(float)
    turned = board @ turns.transpose(0, 2, 1)
    X = turned + shifts[:, None]
    RX = X @ rig.R.T
    n = 4 + rig.left.dist.size
    found = np.stack([views.left_px, views.right_px], 1).astype(float)
    seen = np.isfinite(found).all(axis=-1)
    predicted_l, by_point_l, by_lens_l = project(rig.left, X)
    predicted_r, by_point_r, by_lens_r = project(rig.right, RX + rig.T)
    residuals = np.where(seen[..., None], found - np.stack([predicted_l, predicted_r], 1), 0.0)
    pairs, corners = X.shape[:2]
    shared = np.zeros((pairs, 2, corners, 2, 2 * n + 6))
    shared[:, 0, ..., :n], shared[:, 1, ..., n : 2 * n] = by_lens_l, by_lens_r
    shared[:, 1, ..., 2 * n : 2 * n + 3] = by_point_r @ crosses(RX)
    shared[:, 1, ..., 2 * n + 3 :] = by_point_r
    by_point = np.stack([by_point_l, by_point_r @ rig.R], 1)
    pose = np.concatenate([by_point @ crosses(turned)[:, None], by_point], -1)
    shared *= seen[..., None, None]
    pose *= seen[..., None, None]
    J, P, r = shared.reshape(pairs, -1, 2 * n + 6), pose.reshape(pairs, -1, 6), residuals.reshape(pairs, -1, 1)
    JT, PT = J.transpose(0, 2, 1), P.transpose(0, 2, 1)
    inverse = np.linalg.inv(PT @ P)
    cross, own = PT @ J, PT @ r
    normal = JT @ J - cross.transpose(0, 2, 1) @ inverse @ cross
    gradient = (JT @ r - cross.transpose(0, 2, 1) @ inverse @ own)[..., 0]
    return Fit(rig, turns, shifts, residuals, seen, normal, gradient, (inverse, cross, own[..., 0]))


def _pose_step(now: Fit, step: Array) -> tuple[Array, Array]:
    """The poses after a step of the shared parameters: each pair's own least squares."""
    inverse, cross, own = now._poses
    pose = np.einsum("kij,kj->ki", inverse, own - cross @ step)
    turned = np.array([cv2.Rodrigues(w)[0] for w in pose[:, :3]]) @ now.turns
    return turned, now.shifts + pose[:, 3:]


def _posed(views: BoardViews, now: Fit, iterations: int) -> Fit:
    still = np.zeros(now.normal.shape[1])
    for _ in range(min(iterations, 10)):
        trial = _linearise(views, now.rig, *_pose_step(now, still))
        gain = 1 - float((trial.residuals_px**2).sum()) / max(float((now.residuals_px**2).sum()), 1e-30)
        if gain < 0:
            break
        now = trial
        if gain < 1e-9:
            break
    return now


def _start(views: BoardViews, rig: StereoRig) -> tuple[Array, Array]:
    """Poses of the boards by the left camera alone."""
    turns, shifts = poses(views.board.points_mm, views.left_px, rig.left)
    return turns, shifts


def poses(board_mm: Array, corners_px: Array, camera: Camera) -> tuple[Array, Array]:
    """Pose of each board by one camera: turns (n, 3, 3) and shifts (n, 3) mm; corners (n, N, 2), NaN not found."""
    found = []
    for corners in np.asarray(corners_px, float):
        seen = np.isfinite(corners[:, 0])
        turn, shift = pose(board_mm[seen], corners[seen], camera)
        found.append((cv2.Rodrigues(turn)[0], shift))
    turns, shifts = zip(*found, strict=True)
    return np.array(turns), np.array(shifts)


def pose(board_mm: Array, corners_px: Array, camera: Camera) -> tuple[Array, Array]:
    """Pose of one board by one camera, to rounding: the same on every processor.

    Parameters
    ----------
    board_mm : (N, 3) array
    corners_px : (N, 2) array
        All of them found.
    camera : Camera

    Returns
    -------
    turn, shift : (3,) float64
        ``x_camera = Rodrigues(turn) @ x_board + shift``, rad and mm.

    Notes
    -----
    Minimises distances in pixels, as `cv2.solvePnP` does, which stops early and at another place for every order of
    summation. `cv2.solvePnPRefineVVS` would minimise them after undistorting, by a few fixed-point steps.
    """
    points, corners = np.asarray(board_mm, float), np.asarray(corners_px, float)
    _, turn, shift = cv2.solvePnP(points, corners, camera.K, camera.dist)
    for _ in range(_POSE_STEPS):
        pixels, J = cv2.projectPoints(points, turn, shift, camera.K, camera.dist)
        step = np.linalg.lstsq(J[:, :6], (corners - pixels[:, 0]).ravel(), rcond=None)[0]
        turn, shift = turn + step[:3, None], shift + step[3:, None]
    return turn.ravel(), shift.ravel()


def _solve(normal: Array, right: Array) -> Array:
    """Solution of symmetric normal equations, columns scaled to one, directions that nothing holds left at rest."""
    scale = 1 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    values, vectors = np.linalg.eigh(normal * scale * scale[:, None])
    usable = values > 1e-13 * values[-1]
    return scale * (vectors[:, usable] @ ((vectors[:, usable].T @ (scale * right)) / values[usable]))


def covariance(normal: Array) -> Array:
    """Inverse of a normal matrix (s, s); directions that nothing holds come out huge, not zero."""
    scale = 1 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    values, vectors = np.linalg.eigh(normal * scale * scale[:, None])
    values = np.maximum(values, 1e-14 * values[-1])
    return scale[:, None] * ((vectors / values) @ vectors.T) * scale


def only(fitted: Fit, indices: Array) -> Fit:
    """A fit's pairs of these indices, linearised where they were."""
    inverse, cross, own = fitted._poses
    return replace(
        fitted, turns=fitted.turns[indices], shifts=fitted.shifts[indices],
        residuals_px=fitted.residuals_px[indices], seen=fitted.seen[indices], normal=fitted.normal[indices],
        gradient=fitted.gradient[indices], _poses=(inverse[indices], cross[indices], own[indices]),
    )  # fmt: skip
