"""How sure a calibration is: standard deviations of every parameter, and what they mean in millimetres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from stereolib.calibration.boards import BoardViews
from stereolib.calibration.bundle_adjustment import Fit, covariance, crosses, fit, project, vector
from stereolib.rig import Camera, RectifiedRig, StereoRig

if TYPE_CHECKING:
    import pandas as pd

Array = np.ndarray
#: Fewer pairs than this say too little about their own scatter.
MIN_JACKKNIFE = 10
#: Half the width of a 95 % interval in standard deviations: Student's t for thirty pairs.
INTERVAL = 2.05
_LENS = (
    "fx",
    "fy",
    "cx",
    "cy",
    "k1",
    "k2",
    "p1",
    "p2",
    "k3",
    "k4",
    "k5",
    "k6",
    "s1",
    "s2",
    "s3",
    "s4",
    "tau_x",
    "tau_y",
)


@dataclass(frozen=True, eq=False)
class RigStd:
    """Standard deviations (one sigma; `INTERVAL` of them to either side make the 95 % interval) of a rig's parameters.

    ``left_K``, ``right_K`` are (4,): fx fy cx cy, px; ``left_dist``, ``right_dist`` as the lens's coefficients;
    ``R_rad`` (3,) turns about the right camera's x, y and z; ``T_mm`` (3,); ``baseline_mm``.
    """

    left_K: Array
    left_dist: Array
    right_K: Array
    right_dist: Array
    R_rad: Array
    T_mm: Array
    baseline_mm: float


@dataclass(frozen=True, eq=False)
class ErrorMap:
    """One-sigma errors that a calibration's uncertainty causes at one depth, on a grid of left pixels.

    ``columns_px`` (w,), ``rows_px`` (h,); ``depth_mm`` and ``length_mm`` (h, w), the latter of a level length of
    ``of_mm`` held there. NaN where the right camera does not see the point.
    """

    columns_px: Array
    rows_px: Array
    depth_mm: Array
    length_mm: Array
    at_mm: float
    of_mm: float


@dataclass(frozen=True, eq=False)
class Agreement:
    """Two calibrations of one rig from different pictures.

    ``z`` (s,): difference of each parameter over its predicted standard deviation; ``names`` (s,).
    ``depth_mm`` (h, w): difference of the depths that both give the same pixels; ``predicted_mm`` (h, w) its predicted
    standard deviation.
    """

    names: tuple[str, ...]
    z: Array
    depth_mm: Array
    predicted_mm: Array

    @property
    def rms_z(self) -> float:
        """Near 1 when the stated uncertainties are right."""
        return float(np.sqrt(np.mean(self.z**2)))


def rig_covariance(fitted: Fit, *, method: str = "auto") -> Array:
    """Covariance of the shared parameters. (s, s), in `bundle`'s order.

    Parameters
    ----------
    method : "auto" | "jackknife" | "corners"
        ``"corners"`` takes every corner's error as independent: ``sigma^2 (J'J)^-1``. ``"jackknife"`` leaves each pair
        out in turn, ``(n - 1)/n sum d_k d_k'``, and so also counts errors that a pair's corners share: a board that
        bends, a hand that moved between two shutters. On rendered boards both agree; on real webcams the first is too
        small several times over. ``"auto"`` is the jackknife from `MIN_JACKKNIFE` pairs on.

    References
    ----------
    Efron, The jackknife, the bootstrap and other resampling plans, SIAM 1982, chapter 3.
    """
    if method not in ("auto", "jackknife", "corners"):
        raise ValueError(f'method must be "auto", "jackknife" or "corners", got {method!r}')
    pairs = len(fitted.turns)
    if method == "corners" or (method == "auto" and pairs < MIN_JACKKNIFE):
        return fitted.sigma_px**2 * covariance(fitted.normal.sum(axis=0))
    moves = fitted.without_each()
    moves = moves - moves.mean(axis=0)
    return (pairs - 1) / pairs * moves.T @ moves


def bootstrap_covariance(views: BoardViews, fitted: Fit, draws: int, rng: np.random.Generator) -> Array:
    """The same by refitting on pairs drawn with replacement: slow, and independent of any Jacobian. (s, s)."""
    moves = []
    for _ in range(draws):
        drawn = views.only(rng.integers(0, len(views), len(views)).tolist())
        moves.append(vector(fit(drawn, fitted.rig).rig, fitted.rig))
    return np.cov(np.array(moves).T)


def parameter_names(rig: StereoRig) -> tuple[str, ...]:
    """Names of the shared parameters in their order: ``"left fx"``, ... ``"Rx"``, ... ``"Tz"``."""
    lens = _LENS[: 4 + rig.left.dist.size]
    return (*(f"{side} {name}" for side in ("left", "right") for name in lens), "Rx", "Ry", "Rz", "Tx", "Ty", "Tz")


def rig_std(rig: StereoRig, covariance: Array) -> RigStd:
    """Standard deviations from `rig_covariance`."""
    std, n = np.sqrt(np.diag(covariance)), 4 + rig.left.dist.size
    along = rig.T / rig.baseline_mm
    baseline = float(np.sqrt(along @ covariance[-3:, -3:] @ along))
    left, right, R, T = std[:n], std[n : 2 * n], std[2 * n : 2 * n + 3], std[2 * n + 3 :]
    return RigStd(left[:4], left[4:], right[:4], right[4:], R, T, baseline)


def table(rig: StereoRig, covariance: Array, truth: StereoRig) -> pd.DataFrame:
    """Every parameter of a rig with its 95 % interval, beside the true one; ready to be shown.

    Returns
    -------
    DataFrame of str
        Columns parameter, true, ours, ± (95 %), inside. R stands as the turns about x, y, z that lead from the true
        one to ours, rad. True coefficients that ours has not are left out, those that only ours has are zero.
    """
    import pandas as pd

    n = rig.left.dist.size
    left, right = (Camera(c.K, np.pad(c.dist, (0, n))[:n], c.size) for c in (truth.left, truth.right))
    truth = StereoRig(left, right, truth.R, truth.T)
    ours = np.concatenate([*(_lens_values(c) for c in (rig.left, rig.right)), vector(rig, truth)[-6:-3], rig.T])
    true = np.concatenate([*(_lens_values(c) for c in (truth.left, truth.right)), np.zeros(3), truth.T])
    rows = []
    widths = INTERVAL * np.sqrt(np.diag(covariance))
    for name, a, b, width in zip(parameter_names(rig), true, ours, widths, strict=True):
        digits = int(np.clip(1 - np.floor(np.log10(width)), 1, 7))  # two digits of the interval
        inside = "yes" if abs(b - a) <= width else "no"
        rows.append((name, f"{a:.{digits}f}", f"{b:.{digits}f}", f"{width:.{digits}f}", inside))
    return pd.DataFrame(rows, columns=["parameter", "true", "ours", "± (95 %)", "inside"])


def triangulation_jacobian(rig: StereoRig, points_mm: Array) -> Array:
    """How triangulated points move when the rig's parameters do and the pixels stay. (N, 3, s), mm per unit.

    Parameters
    ----------
    points_mm : (N, 3) in the left camera's frame

    Notes
    -----
    With ``u`` the four pixel coordinates of a point X: ``du = A dX + B dp = 0``, so ``dX/dp = -(A'A)^-1 A' B``.
    """
    turned = points_mm @ rig.R.T
    _, left_by_point, by_left = project(rig.left, points_mm)
    _, right_by_point, by_right = project(rig.right, turned + rig.T)
    n = by_left.shape[-1]
    B = np.zeros((len(points_mm), 4, 2 * n + 6))
    B[:, :2, :n], B[:, 2:, n : 2 * n] = by_left, by_right
    B[:, 2:, 2 * n : 2 * n + 3] = right_by_point @ crosses(turned)
    B[:, 2:, 2 * n + 3 :] = right_by_point
    A = np.concatenate([left_by_point, right_by_point @ rig.R], 1)
    AT = A.transpose(0, 2, 1)
    return -np.linalg.solve(AT @ A, AT @ B)


def rectified_std(rectified: RectifiedRig, covariance: Array, *, step_px: int = 40) -> dict[str, float]:
    """What the uncertainty of a calibration leaves open in its rectified pictures, as standard deviations.

    Parameters
    ----------
    rectified : RectifiedRig
        Of the calibrated rig.
    covariance : (s, s), from `rig_covariance`
    step_px : int
        Spacing of the left pixels that are asked.

    Returns
    -------
    dict
        ``f_px`` and ``baseline_mm``; ``offset_px``, by which all disparities are shifted alike: ready for
        ``SystematicUncertainty(**...)`` of `stereolib.measurement`.

    Notes
    -----
    Pixels stay, the parameters move: the inverse depth moves by ``a + b / Z`` over the image and depths of 6.5 to
    15 baselines, fitted by least squares; ``offset_px = f B std(a)``. Taken from the whole covariance: the errors of cx
    and of the turn about y, each of some tenths of a pixel, cancel but for their sum.
    """
    rig, scale = rectified.rig, rectified.f_px * rectified.baseline_mm
    grids = [_grid(rig, k * rig.baseline_mm, step_px)[2:] for k in (6.5, 10.0, 15.0)]
    points = np.concatenate([points[seen] for points, seen in grids])
    depth = points[:, 2]
    moves = -triangulation_jacobian(rig, points)[:, 2] / depth[:, None] ** 2
    offset = scale * np.linalg.lstsq(np.column_stack([np.ones_like(depth), 1 / depth]), moves, rcond=None)[0][0]
    n, focal = 4 + rig.left.dist.size, np.zeros(len(covariance))
    focal[[0, 1, n, n + 1]] = rectified.f_px / sum(camera.K[i, i] for camera in (rig.left, rig.right) for i in (0, 1))
    along = np.concatenate([np.zeros(len(covariance) - 3), rig.T / rig.baseline_mm])
    rows = {"f_px": focal, "baseline_mm": along, "offset_px": offset}
    return {name: float(np.sqrt(max(row @ covariance @ row, 0.0))) for name, row in rows.items()}


def error_map(
    rig: StereoRig, covariance: Array, *, at_mm: float = 700.0, of_mm: float = 100.0, step_px: int = 20
) -> ErrorMap:
    """What the uncertainty of the calibration does to depths and lengths, over the left image.

    Parameters
    ----------
    covariance : (s, s), from `rig_covariance`
    at_mm : float
        Depth along the left optical axis.
    of_mm : float
        The length, level and across the line of sight.

    Notes
    -----
    ``sigma^2 = g C g'`` with g the row of `triangulation_jacobian` for the depth, or the difference of two for a
    length. The noise of a matched pixel comes on top of it.
    """
    columns, rows, points, seen = _grid(rig, at_mm, step_px)
    half = np.array([of_mm / 2, 0.0, 0.0])
    ends = triangulation_jacobian(rig, points + half)[:, 0] - triangulation_jacobian(rig, points - half)[:, 0]
    depth = triangulation_jacobian(rig, points)[:, 2]
    sigmas = [np.sqrt(np.einsum("ni,ij,nj->n", g, covariance, g)) for g in (depth, ends)]
    depth_mm, length_mm = (np.where(seen, s, np.nan).reshape(len(rows), len(columns)) for s in sigmas)
    return ErrorMap(columns, rows, depth_mm, length_mm, at_mm, of_mm)


def compare_calibrations(first: Fit, second: Fit, *, at_mm: float = 700.0, step_px: int = 20) -> Agreement:
    """Whether two calibrations from disjoint pictures differ by what their uncertainties predict."""
    difference = vector(first.rig, second.rig)
    total = rig_covariance(first) + rig_covariance(second)
    _, rows, points, seen = _grid(second.rig, at_mm, step_px)
    by_depth = triangulation_jacobian(second.rig, points)[:, 2]
    values = by_depth @ difference, np.sqrt(np.einsum("ni,ij,nj->n", by_depth, total, by_depth))
    depth, predicted = (np.where(seen, v, np.nan).reshape(len(rows), -1) for v in values)
    return Agreement(parameter_names(first.rig), difference / np.sqrt(np.diag(total)), depth, predicted)


def _lens_values(camera: Camera) -> Array:
    return np.concatenate([camera.K[[0, 1, 0, 1], [0, 1, 2, 2]], camera.dist])


def _grid(rig: StereoRig, at_mm: float, step_px: int) -> tuple[Array, Array, Array, Array]:
    """Columns, rows, points at a depth on a grid of left pixels (N, 3), and whether the right camera sees them."""
    width, height = rig.left.size
    columns, rows = np.arange(step_px // 2, width, step_px), np.arange(step_px // 2, height, step_px)
    pixels = np.stack(np.meshgrid(columns, rows), -1).reshape(-1, 2)
    points = rig.left.rays(pixels, clamp=True) * at_mm
    where = rig.right.project(points @ rig.R.T + rig.T)
    seen = np.all((where >= 0) & (where <= np.array(rig.right.size) - 1), axis=1)
    return columns, rows, points, seen
