"""The joint least-squares problem of a stereo calibration: residuals, exact Jacobian, normal equations, refits.

Parameters that all pairs share stand first: fx fy cx cy and the n coefficients of the left lens, the same of the
right one, three turns and three shifts of the pair, ``s = 2 (4 + n) + 6`` in all. Each pair's board pose, six more, is
eliminated from the normal equations (Schur complement), so that what is left has the size s whatever the number of
pairs (Triggs et al., Bundle adjustment: a modern synthesis, 2000, section 6).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.base import Bools, Float64
from stereolib.calibration.board_poses import board_poses
from stereolib.calibration.board_views import BoardViews
from stereolib.rig import Camera, StereoRig

_DAMPING = 1e-3  # of the first Levenberg-Marquardt step, over the diagonal
_MOST_DAMPING = 1e8  # steps that are damped so much and still gain nothing are at the minimum
_FASTEST_FALL = 0.1  # of the damping in one step
_LEAST_GAIN = 1e-9  # share of the sum of squares: a step that gains less is the last one, if it was not damping's doing
_STEPS = 200  # rational lenses creep along curved valleys and need a hundred, others six
_SETTLED = 1e-3  # standard deviations: a minimum that is nearer is reached
_EXACT_PX = 1e-6  # corners that fit better are rounded, not noisy
_POSE_ROUNDS = 10  # steps of the boards' poses alone, which have six unknowns each and settle in three
_UNHELD = 1e-13  # of the largest eigenvalue: directions below are held by nothing
_ROUNDED = 1e-40  # of the largest diagonal element: far below what a coefficient of 1e6 leaves, whose squares count
_LEAST_EIGENVALUE = 1e-14  # of the largest: bounds the covariance of directions that nothing holds


@dataclass(frozen=True, eq=False)
class RigFit:
    """A rig, the boards' poses in the left camera, and the problem linearised there.

    Attributes
    ----------
    rig : StereoRig
    turns, shifts : (n, 3, 3) and (n, 3) float64, mm
        Poses of the boards: ``x_left = turn @ x_board + shift``.
    residuals_px : (n, 2, corners, 2) float64
        Found minus predicted, left then right; 0 where `known` is False.
    known : (n, 2, corners) bool
        The corner was found.
    normal : (n, s, s) float64
        Each pair's part of the normal matrix, its pose eliminated.
    gradient : (n, s) float64
        Each pair's part of the right-hand side.
    """

    rig: StereoRig
    turns: Float64
    shifts: Float64
    residuals_px: Float64
    known: Bools
    normal: Float64
    gradient: Float64
    _poses: tuple[Float64, Float64, Float64]

    @property
    def rms_px(self) -> float:
        """Rms distance of found and predicted corners over both cameras, as OpenCV counts it."""
        return float(np.sqrt((self.residuals_px**2).sum() / self.known.sum()))

    @property
    def pair_rms_px(self) -> Float64:
        """Rms distance of found and predicted corners in each pair and camera. (n, 2)."""
        return np.asarray(np.sqrt((self.residuals_px**2).sum(axis=(2, 3)) / self.known.sum(axis=2)))

    @property
    def sigma_px(self) -> float:
        """Standard deviation of one coordinate, from the residuals and the degrees of freedom."""
        free = 2 * int(self.known.sum()) - 6 * len(self.turns) - self.normal.shape[1]
        return float(np.sqrt(self.squares_px2 / max(free, 1)))

    @property
    def squares_px2(self) -> float:
        """Sum of the squares of all residuals, what a fit makes least."""
        return float((self.residuals_px**2).sum())

    @property
    def converged(self) -> bool:
        """Whether the minimum is reached, of a rig that was fitted: one that was kept is at no minimum.

        By the problem as linearised here it is nearer, along any combination of parameters, than a thousandth of the
        standard deviation that the corners' noise leaves.
        """
        left = self.promised_px2(_solve(self.normal.sum(axis=0), self.gradient.sum(axis=0)))
        return left <= (_SETTLED * max(self.sigma_px, _EXACT_PX)) ** 2

    def promised_px2(self, step: Float64) -> float:
        """What a step takes off the sum of squares by the problem as linearised here, the boards' poses following.

        Parameters
        ----------
        step : (s,) float64
            Of the shared parameters.

        Returns
        -------
        float
        """
        inverse, _, own = self._poses
        shared = 2 * self.gradient.sum(axis=0) - self.normal.sum(axis=0) @ step
        return float(np.einsum("ki,kij,kj->", own, inverse, own) + step @ shared)

    def without_each(self) -> Float64:
        """How the shared parameters move when each pair in turn is left out.

        One Gauss-Newton step from the optimum, ``-(N - N_k)^-1 g_k``: exact to first order.

        Returns
        -------
        (n, s) float64
        """
        rest = self.normal.sum(axis=0) - self.normal
        return np.array([_solve(N, -g) for N, g in zip(rest, self.gradient, strict=True)])


def fit_rig(views: BoardViews, rig: StereoRig, *, iterations: int = _STEPS, free: bool = True) -> RigFit:
    """Fit a rig and the boards' poses to all corners, from a start that is near.

    Parameters
    ----------
    views : BoardViews
        Corners that were not found are NaN.
    rig : StereoRig
        Where to start; the number of its coefficients is that of the lens fitted.
    iterations : int
        Steps at most.
    free : bool
        False keeps the rig and poses the boards only, as for pairs that the rig has never seen.

    Returns
    -------
    RigFit
        `RigFit.converged` says whether the steps were enough.

    Notes
    -----
    Levenberg-Marquardt with the diagonal as the scale, until a step gains less than 1e-9 of the sum of squares and the
    minimum is no farther than a thousandth of a standard deviation. The damping follows how much of what a step
    promised it kept (Nielsen, Damping parameter in Marquardt's method, IMM-REP-1999-05), which goes along the curved
    valleys of rational lenses in a third of the steps. Lenses of twelve and more coefficients may not settle.
    """
    now = _linearise(views, rig, *board_poses(views.board.points_mm, views.left_px, rig.left))
    if not free:
        return _posed(views, now, iterations)
    damping = _DAMPING
    for _ in range(iterations):
        before = now.squares_px2
        better, damping = _damped_step(views, now, damping)
        if better is None:
            break
        now = better
        if before - now.squares_px2 <= _LEAST_GAIN * before and now.converged:
            break
    return now


def lens_vector(camera: Camera) -> Float64:
    """Write fx fy cx cy and the n coefficients of a camera in a row.

    Parameters
    ----------
    camera : Camera

    Returns
    -------
    (4 + n,) float64

    Examples
    --------
    >>> lens_vector(Camera([[700, 0, 320], [0, 710, 240], [0, 0, 1]], [], (640, 480)))
    array([700., 710., 320., 240.])
    """
    return np.concatenate([camera.K[[0, 1, 0, 1], [0, 1, 2, 2]], camera.dist])


def moved_rig(rig: StereoRig, step: Float64) -> StereoRig:
    """Move a rig by a step of its shared parameters; `rig_difference` undoes it.

    Parameters
    ----------
    rig : StereoRig
    step : (s,) float64

    Returns
    -------
    StereoRig
    """
    n = 4 + rig.left.dist.size
    cameras = []
    for camera, part in ((rig.left, step[:n]), (rig.right, step[n : 2 * n])):
        K = camera.K + np.array([[part[0], 0, part[2]], [0, part[1], part[3]], [0, 0, 0]])
        cameras.append(Camera(K, camera.dist + part[4:], camera.size))
    turn = cv2.Rodrigues(step[2 * n : 2 * n + 3])[0]
    return StereoRig(cameras[0], cameras[1], turn @ rig.R, rig.T + step[2 * n + 3 :])


def rig_difference(rig: StereoRig, reference: StereoRig) -> Float64:
    """Tell by which step of the shared parameters one rig differs from another of the same lens model.

    Parameters
    ----------
    rig, reference : StereoRig

    Returns
    -------
    (s,) float64
        In the order of `rig_parameter_names`: px, coefficients, rad, mm. R's part are the turns about x, y and z that
        lead from the reference's to the rig's.

    Examples
    --------
    >>> left = Camera([[700, 0, 320], [0, 700, 240], [0, 0, 1]], [], (640, 480))
    >>> one, other = (StereoRig(left, left, np.eye(3), [x, 0, 0]) for x in (-90.5, -93.0))
    >>> rig_difference(one, other)[-3:]
    array([2.5, 0. , 0. ])
    """
    lenses = [lens_vector(a) - lens_vector(b) for a, b in ((rig.left, reference.left), (rig.right, reference.right))]
    return np.concatenate([*lenses, cv2.Rodrigues(rig.R @ reference.R.T)[0].ravel(), rig.T - reference.T])


def with_coefficients(rig: StereoRig, count: int) -> StereoRig:
    """Give both lenses of a rig another number of coefficients: further ones are zero, superfluous ones are cut.

    Parameters
    ----------
    rig : StereoRig
    count : int

    Returns
    -------
    StereoRig
    """
    left, right = (Camera(c.K, np.pad(c.dist, (0, count))[:count], c.size) for c in (rig.left, rig.right))
    return StereoRig(left, right, rig.R, rig.T)


def project_with_derivatives(camera: Camera, points_mm: Float64) -> tuple[Float64, Float64, Float64]:
    """Project points, with the derivatives of their pixels.

    Parameters
    ----------
    camera : Camera
    points_mm : (..., 3) float64
        In the camera's frame.

    Returns
    -------
    pixels : (..., 2) float64
    by_point : (..., 2, 3) float64, px/mm
    by_lens : (..., 2, 4 + n) float64
        By fx fy cx cy and the coefficients.
    """
    dist = camera.dist if camera.dist.size else np.zeros(5)
    none, shape = np.zeros(3), points_mm.shape[:-1]
    pixels, jacobian = cv2.projectPoints(points_mm.reshape(-1, 1, 3), none, none, camera.K, dist)
    jacobian = jacobian.reshape(*shape, 2, -1)
    return pixels.reshape(*shape, 2), jacobian[..., 3:6], jacobian[..., 6 : 10 + camera.dist.size]


def turn_derivatives(vectors: Float64) -> Float64:
    """Differentiate ``w x v`` by w, which is ``-skew(v)``.

    Parameters
    ----------
    vectors : (..., 3) float64

    Returns
    -------
    (..., 3, 3) float64

    Examples
    --------
    >>> turn_derivatives(np.array([1.0, 2.0, 3.0]))[0]
    array([ 0.,  3., -2.])
    """
    x, y, z = np.moveaxis(vectors, -1, 0)
    o = np.zeros_like(x)
    return np.stack([o, z, -y, -z, o, x, y, -x, o], -1).reshape(*vectors.shape, 3)


def _linearise(views: BoardViews, rig: StereoRig, turns: Float64, shifts: Float64) -> RigFit:
    board = views.board.points_mm.astype(float)
    turned = board @ turns.transpose(0, 2, 1)
    X = turned + shifts[:, None]
    RX = X @ rig.R.T
    n = 4 + rig.left.dist.size
    corners_px = np.stack([views.left_px, views.right_px], 1).astype(float)
    known = np.isfinite(corners_px).all(axis=-1)
    predicted_l, by_point_l, by_lens_l = project_with_derivatives(rig.left, X)
    predicted_r, by_point_r, by_lens_r = project_with_derivatives(rig.right, RX + rig.T)
    residuals = np.where(known[..., None], corners_px - np.stack([predicted_l, predicted_r], 1), 0.0)
    pairs, corners = X.shape[:2]
    shared = np.zeros((pairs, 2, corners, 2, 2 * n + 6))
    shared[:, 0, ..., :n], shared[:, 1, ..., n : 2 * n] = by_lens_l, by_lens_r
    shared[:, 1, ..., 2 * n : 2 * n + 3] = by_point_r @ turn_derivatives(RX)
    shared[:, 1, ..., 2 * n + 3 :] = by_point_r
    by_point = np.stack([by_point_l, by_point_r @ rig.R], 1)
    pose = np.concatenate([by_point @ turn_derivatives(turned)[:, None], by_point], -1)
    shared *= known[..., None, None]
    pose *= known[..., None, None]
    J, P, r = shared.reshape(pairs, -1, 2 * n + 6), pose.reshape(pairs, -1, 6), residuals.reshape(pairs, -1, 1)
    JT, PT = J.transpose(0, 2, 1), P.transpose(0, 2, 1)
    inverse = np.linalg.inv(PT @ P)
    cross, own = PT @ J, PT @ r
    normal = JT @ J - cross.transpose(0, 2, 1) @ inverse @ cross
    gradient = (JT @ r - cross.transpose(0, 2, 1) @ inverse @ own)[..., 0]
    return RigFit(rig, turns, shifts, residuals, known, normal, gradient, (inverse, cross, own[..., 0]))


def _damped_step(views: BoardViews, now: RigFit, damping: float) -> tuple[RigFit | None, float]:
    """The problem after the first step that gains, None if there is none, and the damping that the next begins with."""
    total, pull, growth = now.normal.sum(axis=0), now.gradient.sum(axis=0), 2.0
    while damping < _MOST_DAMPING:
        step = _solve(total + damping * np.diag(np.diag(total)), pull)
        with suppress(ValueError):  # a step out of what a camera can be gains nothing
            trial = _linearise(views, moved_rig(now.rig, step), *_pose_step(now, step))
            gain = now.squares_px2 - trial.squares_px2
            if gain >= 0:
                kept = min(gain / max(now.promised_px2(step), 1e-30), 1.0)
                return trial, damping * max(_FASTEST_FALL, 1 - (2 * kept - 1) ** 3)
        damping, growth = damping * growth, 2 * growth
    return None, damping


def _pose_step(now: RigFit, step: Float64) -> tuple[Float64, Float64]:
    """The poses after a step of the shared parameters: each pair's own least squares."""
    inverse, cross, own = now._poses
    pose = np.einsum("kij,kj->ki", inverse, own - cross @ step)
    turned = np.array([cv2.Rodrigues(w)[0] for w in pose[:, :3]]) @ now.turns
    return turned, now.shifts + pose[:, 3:]


def _posed(views: BoardViews, now: RigFit, iterations: int) -> RigFit:
    still = np.zeros(now.normal.shape[1])
    for _ in range(min(iterations, _POSE_ROUNDS)):
        try:
            trial = _linearise(views, now.rig, *_pose_step(now, still))
        except ValueError:  # a step to where no camera sees the board gains nothing
            break
        gain = 1 - trial.squares_px2 / max(now.squares_px2, 1e-30)
        if not gain >= 0:
            break
        now = trial
        if gain < _LEAST_GAIN:
            break
    return now


def _scaled_eigen(normal: Float64) -> tuple[Float64, Float64, Float64]:
    """Scale that makes the columns of a normal matrix one, and the eigenvalues and vectors of what it makes of it.

    Of a parameter whose part rounding left at nothing, or below, nothing is known.
    """
    diagonal = np.diag(normal)
    least = max(_ROUNDED * float(diagonal.max()), 1e-300)
    known = diagonal > least
    scale = 1 / np.sqrt(np.maximum(diagonal, least))
    values, vectors = np.linalg.eigh(np.where(np.outer(known, known), normal, 0.0) * scale * scale[:, None])
    return scale, values, vectors


def _solve(normal: Float64, right: Float64) -> Float64:
    """Solution of symmetric normal equations; directions that nothing holds are left at rest."""
    scale, values, vectors = _scaled_eigen(normal)
    usable = values > _UNHELD * values[-1]
    return np.asarray(scale * (vectors[:, usable] @ ((vectors[:, usable].T @ (scale * right)) / values[usable])))


def inverse_normal(normal: Float64) -> Float64:
    """Invert a normal matrix; directions that nothing holds come out huge, not zero.

    Parameters
    ----------
    normal : (s, s) float64

    Returns
    -------
    (s, s) float64

    Examples
    --------
    >>> inverse_normal(np.diag([4.0, 0.5])).round(6)
    array([[0.25, 0.  ],
           [0.  , 2.  ]])
    """
    scale, values, vectors = _scaled_eigen(normal)
    values = np.maximum(values, _LEAST_EIGENVALUE * values[-1])
    return np.asarray(scale[:, None] * ((vectors / values) @ vectors.T) * scale)
