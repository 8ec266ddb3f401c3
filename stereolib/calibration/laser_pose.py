"""Where the laser stands to the camera, from boards that both see (Zhang and Pless, IROS 2004).

The picture gives the board's plane, the scan a line of points on it: in the camera's frame they must lie on the plane.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from stereolib import laser
from stereolib.base import finite_array, set_frozen
from stereolib.calibration import bundle_adjustment
from stereolib.calibration.boards import Board, find_board
from stereolib.laser import XV11_SIGMA, LaserScan, find_segments, fit_line
from stereolib.rig import Camera, pose_left_world, read_image, rigid, skew

Array = np.ndarray
#: Where objects stand: 0.5 to 1.2 m ahead, 20 degrees to either side.
_PLACES_MM = tuple((x, y * x) for x in (500.0, 1200.0) for y in (-0.36, 0.0, 0.36))
#: Gauss-Newton steps after `least_squares`, which stops at 1e-4 mm: the second reaches rounding, two are a margin.
_POLISH_STEPS = 4
_LEVER_MM = 1000.0  # turns count as what they move at this distance
_UNHELD = 1e-6  # share of the firmest direction below which the boards hold none: it stays where it is
_FLAT_MM = 6.0  # black squares read longer than white ones


@dataclass(frozen=True, eq=False)
class BoardView:
    """One pose of the board, as both saw it.

    Parameters
    ----------
    T_left_board : (4, 4) array
        Pose of the board in the left camera's frame; its plane is z = 0 (`stereolib.targets`, `cv2.solvePnP`).
    points_mm : (N, 2) array
        Readings on the board, in the laser's frame.
    sigma_mm : (N,) array
        Standard deviation of each along its beam.
    """

    T_left_board: Array
    points_mm: Array
    sigma_mm: Array

    def __post_init__(self) -> None:
        set_frozen(self, T_left_board=finite_array(self.T_left_board, (4, 4), "T_left_board"))
        count = len(self.points_mm)
        if count < 2:
            raise ValueError(f"a line on the board needs at least 2 readings, got {count}; hold it nearer to the laser")
        set_frozen(self, points_mm=finite_array(self.points_mm, (count, 2), "points_mm"))
        set_frozen(self, sigma_mm=finite_array(self.sigma_mm, (count,), "sigma_mm"))


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

    T_left_lidar: Array
    std_rad: Array
    std_mm: Array
    covariance: Array
    view_misses: Array

    def to_camera(self, points_mm: Array) -> Array:
        """Points of the scan (N, 2) in the left camera's frame, (N, 3) mm."""
        p = np.asarray(points_mm, float)
        return p @ self.T_left_lidar[:3, :2].T + self.T_left_lidar[:3, 3]


def board_view(
    scan: LaserScan,
    T_left_board: Array,
    *,
    diagonal_mm: float,
    sigma: Callable[[Array], Array] = XV11_SIGMA,
    expected: Array | None = None,
) -> BoardView:
    """Find the board in a scan: the straight thing that is not larger than it.

    Parameters
    ----------
    scan : LaserScan
    T_left_board : (4, 4) array
        From the picture taken with it.
    diagonal_mm : float
        Of the board.
    sigma : callable
        Noise of a reading (see `stereolib.laser.find_segments`).
    expected : (4, 4) array, optional
        Rough ``T_left_lidar``: decides if several things could be the board.

    Raises
    ------
    ValueError
        If nothing in the scan, or more than one thing, could be the board.
    """
    things = [part for part in find_segments(scan, sigma=sigma) if part.kind == "object"]
    found = [
        part for part in things if part.extent_mm < 1.1 * diagonal_mm and fit_line(part.points_mm).rms_mm < _FLAT_MM
    ]
    if len(found) > 1 and expected is not None:
        pose = np.asarray(expected, float)
        off = [
            np.linalg.norm(pose[:3, :2] @ f.points_mm.mean(axis=0) + pose[:3, 3] - T_left_board[:3, 3]) for f in found
        ]
        found = [found[int(np.argmin(off))]]
    if len(found) != 1:
        raise ValueError(
            f"{len(found)} things in the scan could be the board (straight, at most {diagonal_mm:.0f} mm long): see "
            f"that the laser's plane cuts it and nothing like it stands near, or give the expected pose"
        )
    return BoardView(T_left_board, found[0].points_mm, found[0].sigma_mm)


def views_from_files(
    pictures: Sequence[Path], scans: Sequence[Path], board: Board, left: Camera, *, margin_mm: float = 0.0
) -> list[BoardView]:
    """Boards that both saw, from pictures of the left camera and recordings of the laser, one for one.

    Parameters
    ----------
    pictures, scans : sequences of Path
    board : Board
    left : Camera
    margin_mm : float
        By how much the board reaches beyond its squares.

    Raises
    ------
    ValueError
        Naming the file in which the board was not found.
    """
    found = []
    diagonal = float(np.hypot(*(np.ptp(board.points_mm[:, :2], axis=0) + 2 * (board.square_mm + margin_mm))))
    for picture, scan in zip(pictures, scans, strict=True):
        corners = find_board(read_image(picture), board)
        if corners is None:
            raise ValueError(f"{picture}: the board was not found in it; take this pose out, or take it again")
        seen = np.isfinite(corners).all(axis=1)
        turn, t = bundle_adjustment.pose(board.points_mm[seen], corners[seen], left)
        try:
            turns = laser.average(laser.turns(laser.read_recording(scan)))
            found.append(board_view(turns, rigid(cv2.Rodrigues(turn)[0], t), diagonal_mm=diagonal))
        except ValueError as error:
            raise ValueError(f"{scan}: {error}") from error
    return found


def calibrate_lidar_to_camera(
    views: Sequence[BoardView],
    *,
    start: Array | None = None,
    board_std_mm: float = 0.5,
    bias_mm: float = 1.0,
    max_std_mm: float = 6.0,
) -> LidarCamera:
    """Pose of the laser from boards that both see.

    Parameters
    ----------
    views : sequence of BoardView
        At least 4; 8 to 12 make a good calibration.
    start : (4, 4) array, optional
        Rough ``T_left_lidar``; by default the laser stands upright near the camera, turned in any direction.
    board_std_mm, bias_mm : float
        Errors that all points of a view share: of the board's plane, and of the laser (which all views share, too).
    max_std_mm : float
        Points of the scan, 0.5 to 1.2 m ahead, must be known in the camera's frame to this standard deviation.

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
    if len(views) < 4:
        raise ValueError(f"at least 4 poses of the board are needed, got {len(views)}; 8 to 12 make a good calibration")
    if start is None:
        turns = np.radians([0, 90, 180, 270])
        starts = [pose_left_world(0.0, 0.0)[:3, :3] @ _turn([0, 0, angle]) for angle in turns]
        fits = [_solve(views, rigid(R, np.zeros(3)), board_std_mm, bias_mm) for R in starts]
        pose, J, e = min(fits, key=lambda fit: float(fit[2] @ fit[2]))
    else:
        pose, J, e = _solve(views, finite_array(start, (4, 4), "start"), board_std_mm, bias_mm)
    _check_observable(views, pose, J, max_std_mm)
    misses = _misses(views, e)
    if misses.max() > 4.0:
        raise ValueError(_contradiction(views, pose, board_std_mm, bias_mm))
    scale = max(1.0, float(np.sqrt(e @ e / max(len(e) - 6, 1))))
    covariance = np.linalg.inv(J.T @ J) * scale**2
    toward = _toward(views)
    covariance[3:, 3:] += bias_mm**2 * np.outer(toward, toward)  # a bias common to all views shifts the laser
    std = np.sqrt(np.diag(covariance))
    return LidarCamera(pose, std[:3], std[3:], covariance, misses)


def _misses(views: Sequence[BoardView], e: Array) -> Array:
    """How far each view's plane is missed on average, in standard deviations. (views,)."""
    ends = np.cumsum([len(view.points_mm) for view in views])[:-1]
    return np.array([abs(part.mean()) * np.sqrt(len(part)) for part in np.split(e, ends)])


def _contradiction(views: Sequence[BoardView], pose: Array, board_std_mm: float, bias_mm: float) -> str:
    """Which view is wrong: one bad view bends the whole fit, so each is left out in turn."""
    left = []
    for k in range(len(views)):
        others = [*views[:k], *views[k + 1 :]]
        left.append(float(_misses(others, _solve(others, pose, board_std_mm, bias_mm)[2]).max()))
    k = int(np.argmin(left))
    if left[k] > 4.0:
        return (
            f"the {len(views)} views contradict each other, and leaving out any one does not mend it: see that "
            f"pictures and scans belong together, and that the readings lie on the board"
        )
    return (
        f"view {k + 1} of {len(views)} contradicts the others, which agree without it: the board moved between picture "
        f"and scan, or the readings lie on something else; leave it out"
    )


def _toward(views: Sequence[BoardView]) -> Array:
    """Mean direction of the boards from the laser, (3,) unit."""
    middle = np.concatenate([view.points_mm for view in views]).mean(axis=0)
    return np.append(middle / max(float(np.linalg.norm(middle)), 1e-9), 0.0)


def _turn(vector: Sequence[float] | Array) -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(np.asarray(vector, float)).as_matrix())


def _solve(views: Sequence[BoardView], start: Array, board_std_mm: float, bias_mm: float) -> tuple[Array, Array, Array]:
    """Pose (4, 4), Jacobian (N, 6) in the laser's frame and residuals (N,), both over their deviations."""
    from scipy.optimize import least_squares

    p = np.concatenate([np.pad(view.points_mm, ((0, 0), (0, 1))) for view in views])
    counts = [len(view.points_mm) for view in views]
    n = np.repeat([view.T_left_board[:3, 2] for view in views], counts, axis=0)
    d = np.repeat([view.T_left_board[:3, 2] @ view.T_left_board[:3, 3] for view in views], counts)
    sigma = np.concatenate([view.sigma_mm for view in views])
    many = np.repeat(counts, counts)
    beam = p / np.linalg.norm(p, axis=1, keepdims=True)

    def at(x: Array) -> Array:
        return start @ rigid(_turn(x[:3]), x[3:])

    def whitened(pose: Array) -> tuple[Array, Array]:
        m = n @ pose[:3, :3]
        facing = np.maximum(np.abs((m * beam).sum(axis=1)), 0.1)
        # An error common to the N points of a view counts N times in each, so that together they count once.
        # Most of the laser's bias is common to all views; what differs from view to view is taken as 0.4 of it.
        scale = np.sqrt((sigma * facing) ** 2 + many * (board_std_mm**2 + (0.4 * bias_mm * facing) ** 2))
        residual = (m * p).sum(axis=1) + n @ pose[:3, 3] - d
        return np.column_stack([np.cross(p, m), m]) / scale[:, None], residual / scale

    pose = start
    for _ in range(3):  # the weights follow the pose
        scale = whitened(pose)
        weight = np.linalg.norm(scale[0][:, 3:], axis=1)
        fit = least_squares(
            lambda x, w=weight: ((p @ at(x)[:3, :3].T + at(x)[:3, 3]) * n).sum(axis=1) * w - d * w,
            np.zeros(6), x_scale=np.array([1e-2] * 3 + [10.0] * 3), method="trf", max_nfev=60,
        )  # fmt: skip
        pose = at(fit.x)
        for _ in range(_POLISH_STEPS):
            m = n @ pose[:3, :3]
            J = np.column_stack([np.cross(p, m) / _LEVER_MM, m]) * weight[:, None]
            e = ((m * p).sum(axis=1) + n @ pose[:3, 3] - d) * weight
            step = np.linalg.lstsq(J, -e, rcond=_UNHELD)[0]
            pose = pose @ rigid(_turn(step[:3] / _LEVER_MM), step[3:])
        start = pose
    return pose, *whitened(pose)


def _check_observable(views: Sequence[BoardView], pose: Array, J: Array, max_std_mm: float) -> None:
    """Refuse poses that leave a motion open; say which, and what pose would fix it."""
    unit = np.array([1000.0] * 3 + [1.0] * 3)
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
    name = ("forward", "sideways", "up")[int(motion.argmax())]
    upright = name == "up"
    m = np.array([pose[:3, :3].T @ view.T_left_board[:3, 2] for view in views])
    centres = np.array([view.points_mm.mean(axis=0) for view in views])
    tilted = np.abs(m[:, 2]) > np.sin(np.radians(10))
    if upright and tilted.sum() < 3:
        advice = f"only {tilted.sum()} boards lean: tilt at least three of them 20 to 40 degrees forward or back"
    elif upright:
        ahead_mm, across_mm = np.ptp(centres[tilted], axis=0)
        where = "one to the left and one to the right" if across_mm < ahead_mm else "one near and one far"
        advice = (
            f"the leaning boards stand too close together: hold a leaning board {where}, and lean some the other way"
        )
    else:
        facing = np.degrees(np.arctan2(m[:, 1], m[:, 0])) % 180
        spread = float(np.ptp((facing - facing[0] + 90) % 180))
        advice = (
            f"the boards face nearly the same way (within {spread:.0f} degrees): turn some 30 to 45 degrees to the "
            f"left, and some to the right"
            if spread < 50
            else "the boards stand too close together: hold some to the left, to the right, nearer and farther"
        )
    raise ValueError(
        f"these {len(views)} poses leave open where the scan lies: {name}, its points at 0.5 to 1.2 m are uncertain by "
        f"{min(worst, 9999):.0f} mm ({max_std_mm:g} mm are allowed): {advice}"
    )
