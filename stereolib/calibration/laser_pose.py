"""Where the laser stands to the camera, from boards that both see (Zhang and Pless, IROS 2004).

The picture gives the board's plane, the scan a line of points on it: in the camera's frame they must lie on the plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stereolib.base import Float64, Floats, finite_array
from stereolib.calibration.laser_boards import LaserBoardView
from stereolib.rig import pose_left_world, rigid, skew

#: Where objects stand: 0.5 to 1.2 m ahead, 20 degrees to either side.
_PLACES_MM = tuple((x, y * x) for x in (500.0, 1200.0) for y in (-0.36, 0.0, 0.36))
_LEAST_POSES = 4  # three planes determine a pose, the fourth tells whether they agree
_CONTRADICTS = 4.0  # standard deviations by which a view may miss its plane: chance does not in 10000 views
_OWN_BIAS = 0.4  # share of the laser's bias that differs from view to view
_LEAST_FACING = 0.1  # cosine of the angle between beam and normal: beams that graze more tell next to nothing
_ROUNDS = 3  # of weights and poses; the second changes next to nothing
_STEP_SCALE = np.array([1e-2] * 3 + [10.0] * 3)  # rad and mm: about what the start is off
_MOST_STEPS = 60
#: Gauss-Newton steps after `least_squares`, which stops at 1e-4 mm: the second reaches rounding, two are a margin.
_POLISH_STEPS = 4
_LEVER_MM = 1000.0  # turns count as what they move at this distance
_UNHELD = 1e-6  # share of the firmest direction below which the boards hold none: it stays where it is
_TILT_DEG = 10.0  # boards that lean by less say nothing of the height
_LEAST_TILTED = 3  # boards that must lean
_SPREAD_DEG = 50.0  # boards that face ways nearer together hold no place


@dataclass(frozen=True, eq=False)
class LidarCamera:
    """The laser's pose in the left camera's frame.

    Attributes
    ----------
    T_left_lidar : (4, 4) float64
        Maps points of the scan (x forward, y left, z up; z = 0) into the left camera, mm.
    std_rad : (3,) float64
        Standard deviations of small turns about the laser's own axes x, y, z.
    std_mm : (3,) float64
        Of small shifts along them.
    covariance : (6, 6) float64
        Of both, turns first: rad, mm.
    view_misses : (views,) float64
        How far each view's plane is missed, in standard deviations: about 1 where all is well.
    """

    T_left_lidar: Float64
    std_rad: Float64
    std_mm: Float64
    covariance: Float64
    view_misses: Float64

    def to_camera(self, points_mm: Floats) -> Float64:
        """Bring points of the scan into the left camera's frame.

        Parameters
        ----------
        points_mm : (N, 2) array

        Returns
        -------
        (N, 3) float64, mm
        """
        p = np.asarray(points_mm, float)
        return np.asarray(p @ self.T_left_lidar[:3, :2].T + self.T_left_lidar[:3, 3])


def calibrate_lidar_to_camera(
    views: Sequence[LaserBoardView],
    *,
    start: Float64 | None = None,
    board_std_mm: float = 0.5,
    bias_mm: float = 1.0,
    max_std_mm: float = 6.0,
) -> LidarCamera:
    """Find the pose of the laser from boards that both see.

    Parameters
    ----------
    views : sequence of LaserBoardView
        At least 4; 8 to 12 make a good calibration.
    start : (4, 4) array, optional
        Rough ``T_left_lidar``; by default the laser stands upright near the camera, turned in any direction.
    board_std_mm, bias_mm : float
        Errors that all points of a view share: of the board's plane, and of the laser (which all views share, too).
    max_std_mm : float
        Points of the scan, 0.5 to 1.2 m ahead, must be known in the camera's frame to this standard deviation.

    Returns
    -------
    LidarCamera

    Raises
    ------
    ValueError
        If the poses do not determine the laser's pose (the text names the direction that they leave open, and the
        board pose that is missing), or if a view contradicts the others.

    Notes
    -----
    Minimises ``sum ((n . (R p + t) - d) / s)^2`` with n, d the board's plane, by `scipy.optimize.least_squares` and
    then Gauss-Newton to rounding. For a small turn w and shift tau in the laser's own frame, with ``m = R' n``:
    ``d residual = (p x m) . w + m . tau``. As p = (x, y, 0): upright boards (m_z = 0) say nothing of roll, pitch and
    height.
    """
    if len(views) < _LEAST_POSES:
        why = f"at least {_LEAST_POSES} poses of the board are needed, got {len(views)}"
        raise ValueError(f"{why}; 8 to 12 make a good calibration")
    if start is None:
        starts = [pose_left_world(0.0, 0.0)[:3, :3] @ _turn([0, 0, angle]) for angle in np.radians([0, 90, 180, 270])]
        fits = [_solve(views, rigid(R, np.zeros(3)), board_std_mm, bias_mm) for R in starts]
        pose, J, e = min(fits, key=lambda fit: float(fit[2] @ fit[2]))
    else:
        pose, J, e = _solve(views, finite_array(start, (4, 4), "start"), board_std_mm, bias_mm)
    _check_observable(views, pose, J, max_std_mm)
    misses = _misses(views, e)
    if misses.max() > _CONTRADICTS:
        raise ValueError(_contradiction(views, pose, board_std_mm, bias_mm))
    scale = max(1.0, float(np.sqrt(e @ e / max(len(e) - 6, 1))))
    covariance = np.asarray(np.linalg.inv(J.T @ J) * scale**2, np.float64)
    toward = _toward(views)
    covariance[3:, 3:] += bias_mm**2 * np.outer(toward, toward)  # a bias common to all views shifts the laser
    std = np.sqrt(np.diag(covariance))
    return LidarCamera(pose, std[:3], std[3:], covariance, misses)


def _misses(views: Sequence[LaserBoardView], e: Float64) -> Float64:
    """How far each view's plane is missed on average, in standard deviations. (views,)."""
    ends = np.cumsum([len(view.points_mm) for view in views])[:-1]
    return np.array([abs(part.mean()) * np.sqrt(len(part)) for part in np.split(e, ends)])


def _contradiction(views: Sequence[LaserBoardView], pose: Float64, board_std_mm: float, bias_mm: float) -> str:
    """Which view is wrong: one bad view bends the whole fit, so each is left out in turn."""
    left = []
    for k in range(len(views)):
        others = [*views[:k], *views[k + 1 :]]
        left.append(float(_misses(others, _solve(others, pose, board_std_mm, bias_mm)[2]).max()))
    k = int(np.argmin(left))
    if left[k] > _CONTRADICTS:
        remedy = "see that pictures and scans belong together, and that the readings lie on the board"
        return f"the {len(views)} views contradict each other, and leaving out any one does not mend it: {remedy}"
    why = "the board moved between picture and scan, or the readings lie on something else; leave it out"
    return f"view {k + 1} of {len(views)} contradicts the others, which agree without it: {why}"


def _toward(views: Sequence[LaserBoardView]) -> Float64:
    """Mean direction of the boards from the laser, (3,) unit."""
    middle = np.concatenate([view.points_mm for view in views]).mean(axis=0)
    return np.append(middle / max(float(np.linalg.norm(middle)), 1e-9), 0.0)


def _turn(vector: Sequence[float] | Float64) -> Float64:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(np.asarray(vector, float)).as_matrix())


def _solve(
    views: Sequence[LaserBoardView], start: Float64, board_std_mm: float, bias_mm: float
) -> tuple[Float64, Float64, Float64]:
    """Pose (4, 4), Jacobian (N, 6) in the laser's frame and residuals (N,), both over their deviations."""
    from scipy.optimize import least_squares

    p = np.concatenate([np.pad(view.points_mm, ((0, 0), (0, 1))) for view in views])
    counts = [len(view.points_mm) for view in views]
    n = np.repeat([view.T_left_board[:3, 2] for view in views], counts, axis=0)
    d = np.repeat([view.T_left_board[:3, 2] @ view.T_left_board[:3, 3] for view in views], counts)
    sigma = np.concatenate([view.sigma_mm for view in views])
    many = np.repeat(counts, counts)
    beam = p / np.linalg.norm(p, axis=1, keepdims=True)

    def at(x: Float64) -> Float64:
        return np.asarray(start @ rigid(_turn(x[:3]), x[3:]))

    def off(x: Float64, weight: Float64) -> Float64:
        pose = at(x)
        return np.asarray(((p @ pose[:3, :3].T + pose[:3, 3]) * n).sum(axis=1) * weight - d * weight)

    def whitened(pose: Float64) -> tuple[Float64, Float64]:
        m = n @ pose[:3, :3]
        facing = np.maximum(np.abs((m * beam).sum(axis=1)), _LEAST_FACING)
        # An error common to the N points of a view counts N times in each, so that together they count once.
        # Most of the laser's bias is common to all views; the share that differs from view to view is `_OWN_BIAS`.
        scale = np.sqrt((sigma * facing) ** 2 + many * (board_std_mm**2 + (_OWN_BIAS * bias_mm * facing) ** 2))
        residual = (m * p).sum(axis=1) + n @ pose[:3, 3] - d
        return np.column_stack([np.cross(p, m), m]) / scale[:, None], residual / scale

    pose = start
    for _ in range(_ROUNDS):  # the weights follow the pose
        weight = np.linalg.norm(whitened(pose)[0][:, 3:], axis=1)
        fit = least_squares(off, np.zeros(6), args=(weight,), x_scale=_STEP_SCALE, max_nfev=_MOST_STEPS)
        pose = at(fit.x)
        for _ in range(_POLISH_STEPS):
            m = n @ pose[:3, :3]
            J = np.column_stack([np.cross(p, m) / _LEVER_MM, m]) * weight[:, None]
            e = ((m * p).sum(axis=1) + n @ pose[:3, 3] - d) * weight
            step = np.linalg.lstsq(J, -e, rcond=_UNHELD)[0]
            pose = pose @ rigid(_turn(step[:3] / _LEVER_MM), step[3:])
        start = pose
    return pose, *whitened(pose)


def _check_observable(views: Sequence[LaserBoardView], pose: Float64, J: Float64, max_std_mm: float) -> None:
    """Refuse poses that leave a motion open; say which, and what pose would fix it."""
    unit = np.array([_LEVER_MM] * 3 + [1.0] * 3)
    values, vectors = np.linalg.eigh((J / unit).T @ (J / unit))
    root = vectors / np.sqrt(np.maximum(values, 1e-10)) / unit[:, None]
    worst, motion = 0.0, np.zeros(3)
    ahead = _toward(views)
    for x, y in _PLACES_MM:
        p = x * ahead + y * np.array([-ahead[1], ahead[0], 0.0])
        move = np.concatenate([-skew(p), np.eye(3)], axis=1) @ root
        axes, lengths, _ = np.linalg.svd(move)
        if lengths[0] > worst:
            worst, motion = float(lengths[0]), np.abs(axes[:, 0])
    if worst <= max_std_mm:
        return
    direction = ("forward", "sideways", "up")[int(motion.argmax())]
    advice = _advice_for_height(views, pose) if direction == "up" else _advice_for_place(views, pose)
    why = f"these {len(views)} poses leave open where the scan lies: {direction}, its points at 0.5 to 1.2 m are"
    raise ValueError(f"{why} uncertain by {min(worst, 9999):.0f} mm ({max_std_mm:g} mm are allowed): {advice}")


def _facing(views: Sequence[LaserBoardView], pose: Float64) -> Float64:
    """Normals of the boards in the laser's frame. (views, 3)."""
    return np.array([pose[:3, :3].T @ view.T_left_board[:3, 2] for view in views])


def _advice_for_height(views: Sequence[LaserBoardView], pose: Float64) -> str:
    centres = np.array([view.points_mm.mean(axis=0) for view in views])
    tilted = np.abs(_facing(views, pose)[:, 2]) > np.sin(np.radians(_TILT_DEG))
    if tilted.sum() < _LEAST_TILTED:
        return f"only {tilted.sum()} boards lean: tilt at least three of them 20 to 40 degrees forward or back"
    ahead_mm, across_mm = np.ptp(centres[tilted], axis=0)
    where = "one to the left and one to the right" if across_mm < ahead_mm else "one near and one far"
    return f"the leaning boards stand too close together: hold a leaning board {where}, and lean some the other way"


def _advice_for_place(views: Sequence[LaserBoardView], pose: Float64) -> str:
    normals = _facing(views, pose)
    facing = np.degrees(np.arctan2(normals[:, 1], normals[:, 0])) % 180
    spread = float(np.ptp((facing - facing[0] + 90) % 180))
    if spread >= _SPREAD_DEG:
        return "the boards stand too close together: hold some to the left, to the right, nearer and farther"
    remedy = "turn some 30 to 45 degrees to the left, and some to the right"
    return f"the boards face nearly the same way (within {spread:.0f} degrees): {remedy}"
