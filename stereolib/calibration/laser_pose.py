"""Where the laser stands to the camera, and what it reads too far, from boards that both see.

The picture gives the board's plane, the scan a line of points on it: in the camera's frame they must lie on the plane
(Zhang and Pless, IROS 2004).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stereolib.base import Float64
from stereolib.calibration.laser_boards import LaserBoardView
from stereolib.rig import pose_left_world, rigid, skew

#: Where objects stand: 0.5 to 1.2 m ahead, 20 degrees to either side.
_PLACES_MM = tuple((x, y * x) for x in (500.0, 1200.0) for y in (-0.36, 0.0, 0.36))
_LEAST_POSES = 4  # three planes determine a pose, the fourth tells whether they agree
_CONTRADICTS = 4.0  # standard deviations by which a view may miss its plane: chance does not in 10000 views
#: Share by which a laser that nobody calibrated reads too far or too near: standard deviation.
LASER_SCALE_STD = 0.02
_MOST_SCALE = 0.02  # no such laser is off by more, if it is whole
_VAGUE_SCALE = 0.01  # standard deviation of what had better be known
_SURE_STDS = 3.0  # what is told as wrong is so by as many
_BOARD_STD_MM, _BIAS_MM = 0.5, 1.0  # errors that all points of a view share: of the board's plane, and of the laser
_OWN_BIAS = 0.4  # share of the laser's bias that differs from view to view
_LEAST_FACING = 0.1  # cosine of the angle between beam and normal: beams that graze more tell next to nothing
_ROUNDS = 3  # of weights and poses; the second changes next to nothing
_STEP_SCALE = np.array([1e-2] * 3 + [10.0] * 3 + [1e-2])  # rad, mm, share: about what the start is off
_MOST_STEPS = 60
#: Gauss-Newton steps after `least_squares`, which stops at 1e-4 mm: the second reaches rounding, two are a margin.
_POLISH_STEPS = 4
_LEVER_MM = 1000.0  # turns and scale count as what they move at this distance
_POSE = 6  # the first parameters; the scale comes last
_UNIT = np.array([_LEVER_MM] * 3 + [1.0] * 3 + [_LEVER_MM])
_UNHELD = 1e-6  # share of the firmest direction below which the boards hold none: it stays where it is
_TILT_DEG = 10.0  # boards that lean by less say nothing of the height
_LEAST_TILTED = 3  # boards that must lean
_SPREAD_DEG = 50.0  # boards that face ways nearer together hold no place
_IF_TOLD_RIGHT = (
    "if they are as they were told, it is taken off, and all is well; else run calibrate-laser again, and till then "
    "use no scan"
)


class ViewsDisagree(ValueError):
    """What some views of the board say of the laser's pose cannot be true together.

    Parameters
    ----------
    text : str
    view : int, optional
        Number of the one without which the others agree, if there is one.
    """

    def __init__(self, text: str, view: int | None = None) -> None:
        super().__init__(text if view is None else f"view {view + 1} {text}")
        self.text, self.view = text, view


def is_beyond_lasers(scale: float, std: float) -> bool:
    """Tell whether a laser reads surely too far, or too near, by more than such a laser errs.

    Parameters
    ----------
    scale, std : float
        Share by which it reads too far, and its standard deviation.

    Returns
    -------
    bool
        False where the scale is known too vaguely to tell.
    """
    return std <= _VAGUE_SCALE and abs(scale) >= _MOST_SCALE + _SURE_STDS * std


def read_share(scale: float) -> str:
    """Say by how much a laser reads too far.

    Parameters
    ----------
    scale : float

    Returns
    -------
    str

    Examples
    --------
    >>> read_share(-0.052)
    '5.2 % shorter'
    """
    return f"{100 * abs(scale):.1f} % {'longer' if scale > 0 else 'shorter'}"


@dataclass(frozen=True, eq=False)
class LidarCamera:
    """The laser in the left camera's frame.

    Attributes
    ----------
    T_left_lidar : (4, 4) float64
        Maps points of the scan (x forward, y left, z up; z = 0) into the left camera, mm.
    scale : float
        Share by which the laser reads too far, as the cameras tell lengths: ``1 - scale`` of what it reads is right.
    covariance : (7, 7) float64
        Of turns, shifts and scale: rad, mm, share.
    """

    T_left_lidar: Float64
    scale: float
    covariance: Float64

    @property
    def is_vague(self) -> bool:
        """The boards leave open whether the laser reads too far."""
        return self.std_scale > _VAGUE_SCALE

    @property
    def is_beyond_lasers(self) -> bool:
        """It reads surely too far, or too near, by more than such a laser errs."""
        return is_beyond_lasers(self.scale, self.std_scale)

    @property
    def doubt(self) -> str:
        """What is doubtful of a scale that the boards leave open, or that is beyond such a laser; "" of others."""
        if self.is_vague:
            why = "the boards stand too close together to tell whether the laser reads too far"
            return f"{why}, which is known to {100 * self.std_scale:.1f} % only: hold some nearer and some farther"
        if not self.is_beyond_lasers:
            return ""
        why = "than the boards have it, more than such a laser errs: measure the squares of its board over many of them"
        return f"the laser reads {read_share(self.scale)} {why}"

    @property
    def warning(self) -> str:
        """The same, and what to do with scans until it is settled."""
        return f"{self.doubt}; {_IF_TOLD_RIGHT}" if self.is_beyond_lasers else self.doubt

    @property
    def std_rad(self) -> Float64:
        """Standard deviations of small turns about the laser's own axes x, y, z. (3,)."""
        return np.sqrt(np.diag(self.covariance))[:3]

    @property
    def std_mm(self) -> Float64:
        """Of small shifts along them. (3,)."""
        return np.sqrt(np.diag(self.covariance))[3:6]

    @property
    def std_scale(self) -> float:
        """Of `scale`."""
        return float(np.sqrt(self.covariance[6, 6]))


def calibrate_lidar_to_camera(views: Sequence[LaserBoardView], *, max_std_mm: float = 6.0) -> LidarCamera:
    """Find the laser's pose, and its scale against the cameras', from boards that both see.

    The laser stands upright near the camera, turned in any direction.

    Parameters
    ----------
    views : sequence of LaserBoardView
        At least 4; 8 to 12 make a good calibration.
    max_std_mm : float
        Points of the scan, 0.5 to 1.2 m ahead, must be known in the camera's frame to this standard deviation.

    Returns
    -------
    LidarCamera

    Raises
    ------
    ValueError
        If the poses do not determine the laser's pose (the text names the direction that they leave open, and the
        board pose that is missing).
    ViewsDisagree
        If a view contradicts the others, or nobody knows which one does.

    Notes
    -----
    Minimises ``sum ((n . (R (1 - e) p + t) - d) / s)^2 + (e / 0.02)^2`` with n, d the board's plane and e the scale, by
    `scipy.optimize.least_squares` and then Gauss-Newton to rounding. For a small turn w and shift tau in the laser's
    own frame, with ``m = R' n``: ``d residual = (p x m) . w + m . tau - m . p de``. As p = (x, y, 0): upright boards
    (m_z = 0) say nothing of roll, pitch and height; boards that all stand at one place say nothing of the scale.
    """
    if len(views) < _LEAST_POSES:
        why = f"at least {_LEAST_POSES} poses of the board are needed, got {len(views)}"
        raise ValueError(f"{why}; 8 to 12 make a good calibration")
    starts = [pose_left_world(0.0, 0.0)[:3, :3] @ _turn([0, 0, angle]) for angle in np.radians([0, 90, 180, 270])]
    fits = [_solve(views, rigid(R, np.zeros(3))) for R in starts]
    found = min(fits, key=lambda fit: float(fit.misses @ fit.misses))
    _check_observable(views, found, max_std_mm)
    if _of_views(views, found.misses).max() > _CONTRADICTS:
        raise _contradiction(views, found.pose)
    e = np.append(found.misses, found.scale / LASER_SCALE_STD)
    scatter = max(1.0, float(np.sqrt(e @ e / max(len(e) - len(_STEP_SCALE), 1))))
    covariance = np.asarray(np.linalg.inv(found.precision) * scatter**2, np.float64)
    toward = _toward(views)
    covariance[3:6, 3:6] += _BIAS_MM**2 * np.outer(toward, toward)  # a bias common to all views shifts the laser
    return LidarCamera(found.pose, found.scale, covariance)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Pose (4, 4) and scale; Jacobian (N, 7) in the laser's frame, and residuals (N,), both over their deviations."""

    pose: Float64
    scale: float
    J: Float64
    misses: Float64

    @property
    def precision(self) -> Float64:
        """Of turns, shifts and scale. (7, 7)."""
        return np.asarray(self.J.T @ self.J + np.diag([0.0] * 6 + [LASER_SCALE_STD**-2]))


def _of_views(views: Sequence[LaserBoardView], e: Float64) -> Float64:
    """How far each view's plane is missed on average, in standard deviations. (views,)."""
    ends = np.cumsum([len(view.points_mm) for view in views])[:-1]
    return np.array([abs(part.mean()) * np.sqrt(len(part)) for part in np.split(e, ends)])


def _contradiction(views: Sequence[LaserBoardView], pose: Float64) -> ViewsDisagree:
    """Which view is wrong: one bad view bends the whole fit, so each is left out in turn."""
    left = []
    for k in range(len(views)):
        others = [*views[:k], *views[k + 1 :]]
        left.append(float(_of_views(others, _solve(others, pose).misses).max()))
    k = int(np.argmin(left))
    if left[k] > _CONTRADICTS:
        remedy = "see that pictures and scans belong together, and that the readings lie on the board"
        why = f"the {len(views)} views contradict each other, and leaving out any one does not mend it: {remedy}"
        return ViewsDisagree(why)
    why = "the board moved between picture and scan, or the readings lie on something else; leave it out"
    return ViewsDisagree(f"contradicts the other {len(views) - 1}, which agree without it: {why}", k)


def _toward(views: Sequence[LaserBoardView]) -> Float64:
    """Mean direction of the boards from the laser, (3,) unit."""
    middle = np.concatenate([view.points_mm for view in views]).mean(axis=0)
    return np.append(middle / max(float(np.linalg.norm(middle)), 1e-9), 0.0)


def _turn(vector: Sequence[float] | Float64) -> Float64:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(np.asarray(vector, float)).as_matrix())


def _solve(views: Sequence[LaserBoardView], start: Float64) -> _Fit:
    from scipy.optimize import least_squares

    p = np.concatenate([np.pad(view.points_mm, ((0, 0), (0, 1))) for view in views])
    counts = [len(view.points_mm) for view in views]
    n = np.repeat([view.T_left_board[:3, 2] for view in views], counts, axis=0)
    d = np.repeat([view.T_left_board[:3, 2] @ view.T_left_board[:3, 3] for view in views], counts)
    sigma = np.concatenate([view.sigma_mm for view in views])
    many = np.repeat(counts, counts)
    beam = p / np.linalg.norm(p, axis=1, keepdims=True)

    def moved(pose: Float64, scale: float, x: Float64) -> tuple[Float64, float]:
        return np.asarray(pose @ rigid(_turn(x[:3]), x[3:6])), scale + float(x[6])

    def off(pose: Float64, scale: float, weight: Float64) -> Float64:
        R, t = pose[:3, :3], pose[:3, 3]
        miss = ((1 - scale) * (p @ R.T * n).sum(axis=1) + (n @ t - d)) * weight
        return np.append(miss, scale / LASER_SCALE_STD)

    def missed(x: Float64, pose: Float64, scale: float, weight: Float64) -> Float64:
        return off(*moved(pose, scale, x), weight)

    def slopes(pose: Float64, scale: float, weight: Float64) -> Float64:
        m = n @ pose[:3, :3]
        J = np.column_stack([(1 - scale) * np.cross(p, m), m, -(m * p).sum(axis=1)]) * weight[:, None]
        return np.vstack([J, [0.0] * 6 + [1 / LASER_SCALE_STD]])

    def weights(pose: Float64) -> Float64:
        facing = np.maximum(np.abs((n @ pose[:3, :3] * beam).sum(axis=1)), _LEAST_FACING)
        # An error common to the N points of a view counts N times in each, so that together they count once.
        # Most of the laser's bias is common to all views; the share that differs from view to view is `_OWN_BIAS`.
        shared = _BOARD_STD_MM**2 + (_OWN_BIAS * _BIAS_MM * facing) ** 2
        return np.asarray(1 / np.sqrt((sigma * facing) ** 2 + many * shared))

    pose, scale = start, 0.0
    for _ in range(_ROUNDS):  # the weights follow the pose
        weight = weights(pose)
        known = pose, scale, weight
        fit = least_squares(missed, np.zeros(7), args=known, x_scale=_STEP_SCALE, max_nfev=_MOST_STEPS)
        pose, scale = moved(pose, scale, fit.x)
        for _ in range(_POLISH_STEPS):
            J, e = slopes(pose, scale, weight) / _UNIT, off(pose, scale, weight)
            pose, scale = moved(pose, scale, np.linalg.lstsq(J, -e, rcond=_UNHELD)[0] / _UNIT)
    weight = weights(pose)
    return _Fit(pose, scale, slopes(pose, scale, weight)[:-1], off(pose, scale, weight)[:-1])


def _check_observable(views: Sequence[LaserBoardView], found: _Fit, max_std_mm: float) -> None:
    """Refuse poses that leave a motion open; say which, and what pose would fix it.

    What they leave open of the scale is carried on, and told.
    """
    unit = _UNIT[:_POSE]
    values, vectors = np.linalg.eigh(found.precision[:_POSE, :_POSE] / np.outer(unit, unit))
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
    advice = (_advice_for_height if direction == "up" else _advice_for_place)(views, found.pose)
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
