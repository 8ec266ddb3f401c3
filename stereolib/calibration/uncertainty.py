"""How sure a calibration is: standard deviations of every parameter, and what they mean in millimetres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

from stereolib.base import Bools, Float64, Ints, counted
from stereolib.calibration.bundle_adjustment import (
    RigFit,
    inverse_normal,
    lens_vector,
    project_with_derivatives,
    rig_difference,
    turn_derivatives,
    with_coefficients,
)
from stereolib.rig import RectifiedRig, StereoRig

if TYPE_CHECKING:
    import pandas as pd

#: Half the width of a 95 % interval in standard deviations: Student's t for thirty pairs.
INTERVAL_STDS = 2.05
#: Depth at which calibrations are judged where nobody says where the rig is to measure.
JUDGED_AT_MM = 1000.0
_LEAST_PAIRS = 2  # one of which can be left out
_INTERVAL, _USUAL_PAIRS = 0.975, 30  # quantile of Student's t, and the number of pairs whose t is `INTERVAL_STDS`
_STEP_PX = 20  # of the grid of left pixels that are asked
_LEAST_AT_MM = 10.0  # no camera sees two pictures of what is nearer: metres were given
_DIST_NAMES = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tau_x", "tau_y")
#: Parameters of a lens, the coefficients in OpenCV's order.
LENS_NAMES = ("fx", "fy", "cx", "cy", *_DIST_NAMES)


@dataclass(frozen=True, eq=False)
class RigStd:
    """Standard deviations of a rig's parameters: `INTERVAL_STDS` of them to either side make the 95 % interval.

    Attributes
    ----------
    left_K, right_K : (4,) float64, px
        Of fx fy cx cy.
    left_dist, right_dist : (n,) float64
        Of the lens's coefficients.
    R_rad : (3,) float64
        Of turns about the right camera's x, y and z.
    T_mm : (3,) float64
    baseline_mm : float
    """

    left_K: Float64
    left_dist: Float64
    right_K: Float64
    right_dist: Float64
    R_rad: Float64
    T_mm: Float64
    baseline_mm: float


@dataclass(frozen=True, eq=False)
class ErrorMap:
    """One-sigma errors that a calibration's uncertainty causes at one depth, on a grid of left pixels.

    Attributes
    ----------
    columns_px, rows_px : (w,) and (h,) int
    depth_mm : (h, w) float64
        NaN where the right camera does not see the point.
    length_mm : (h, w) float64
        Of a level length of `of_mm` held there; NaN likewise.
    at_mm, of_mm : float
        The depth, and the length.
    """

    columns_px: Ints
    rows_px: Ints
    depth_mm: Float64
    length_mm: Float64
    at_mm: float
    of_mm: float


@dataclass(frozen=True, eq=False)
class Agreement:
    """Two calibrations of one rig from different pictures.

    Attributes
    ----------
    names : (s,) tuple of str
        Of the parameters.
    z : (s,) float64
        Difference of each parameter over its predicted standard deviation.
    depth_mm, predicted_mm : (h, w) float64
        Difference of the depths that both give the same pixels, and its predicted standard deviation.
    """

    names: tuple[str, ...]
    z: Float64
    depth_mm: Float64
    predicted_mm: Float64

    @property
    def rms_z(self) -> float:
        """Near 1 when the stated uncertainties are right, from some 25 pairs in each calibration on: of fewer,
        `rig_covariance` states too much, and from 12 it averages 0.8, from 6 some 0.6."""
        return float(np.sqrt(np.mean(self.z**2)))


def rig_covariance(fitted: RigFit, *, method: str = "auto") -> Float64:
    """Estimate the covariance of a rig's parameters.

    Parameters
    ----------
    fitted : RigFit
    method : "auto" | "jackknife" | "corners"
        ``"corners"`` takes every corner's error as independent: ``sigma^2 (J'J)^-1``. ``"jackknife"`` leaves each pair
        out in turn, ``(n - 1)/n sum d_k d_k'``, and so also counts errors that a pair's corners share: a board that
        bends, a hand that moved between two shutters. On pictures of bent boards, and on real webcams, the first is
        too small several times over. With the detector's noise alone both agree for many pairs; of few, leaving one
        out moves a rig farther than noise does, and the jackknife's deviations are too large: rms by a tenth for 30
        pairs, a quarter for 12, a half for 6. ``"auto"`` is the jackknife, widened for few pairs by Student's t,
        ``(t(n - 1) / t(29))^2``, so that `INTERVAL_STDS` deviations make at least the 95 % interval for any number of
        pairs from five on; with the detector's noise alone its deviations are 1.35 times too large for 12 pairs, 1.9
        times for 6.

    Returns
    -------
    (s, s) float64
        In the order of `rig_parameter_names`.

    Raises
    ------
    ValueError
        If the method is none of these, or there is one pair and nothing left without it.

    References
    ----------
    Efron, The jackknife, the bootstrap and other resampling plans, SIAM 1982, chapter 3.
    """
    if method not in ("auto", "jackknife", "corners"):
        raise ValueError(f'method must be "auto", "jackknife" or "corners", got {method!r}')
    if method == "corners":
        return fitted.sigma_px**2 * inverse_normal(fitted.normal.sum(axis=0))
    if (pairs := len(fitted.turns)) < _LEAST_PAIRS:
        why = f"{counted(pairs, 'pair')} cannot be left out in turn, at least {_LEAST_PAIRS} are needed"
        raise ValueError(f'{why}: take more, or choose method="corners"')
    moves = fitted.without_each()
    moves = moves - moves.mean(axis=0)
    widened = 1.0
    if method == "auto":
        widened = float(np.divide(*stdtrit([pairs - 1, _USUAL_PAIRS - 1], _INTERVAL)))
    return np.asarray(widened**2 * (pairs - 1) / pairs * moves.T @ moves)


def rig_parameter_names(rig: StereoRig) -> tuple[str, ...]:
    """Name the parameters of a rig in the order of its covariance.

    Parameters
    ----------
    rig : StereoRig

    Returns
    -------
    (s,) tuple of str
        ``"left fx"``, ... ``"right fx"``, ... ``"Rx"``, ... ``"Tz"``.

    Examples
    --------
    >>> from stereolib.rig import Camera
    >>> camera = Camera([[700, 0, 320], [0, 700, 240], [0, 0, 1]], [], (640, 480))
    >>> rig_parameter_names(StereoRig(camera, camera, np.eye(3), [-90, 0, 0]))[3:9]
    ('left cy', 'right fx', 'right fy', 'right cx', 'right cy', 'Rx')
    """
    lens = LENS_NAMES[: 4 + rig.left.dist.size]
    return (*(f"{side} {name}" for side in ("left", "right") for name in lens), "Rx", "Ry", "Rz", "Tx", "Ty", "Tz")


def rig_std(rig: StereoRig, covariance: Float64) -> RigStd:
    """Sort the standard deviations of a rig's parameters by their names.

    Parameters
    ----------
    rig : StereoRig
    covariance : (s, s) float64
        From `rig_covariance`.

    Returns
    -------
    RigStd
    """
    std, n = np.sqrt(np.diag(covariance)), 4 + rig.left.dist.size
    along = rig.T / rig.baseline_mm
    baseline = float(np.sqrt(along @ covariance[-3:, -3:] @ along))
    left, right, R, T = np.split(std, [n, 2 * n, 2 * n + 3])
    return RigStd(left[:4], left[4:], right[:4], right[4:], R, T, baseline)


def interval_table(rig: StereoRig, covariance: Float64, truth: StereoRig | None = None) -> pd.DataFrame:
    """Lay out every parameter of a rig with its 95 % interval, beside the true one if it is known, ready to be shown.

    Parameters
    ----------
    rig : StereoRig
    covariance : (s, s) float64
        From `rig_covariance`.
    truth : StereoRig, optional

    Returns
    -------
    DataFrame of str
        Columns parameter, true, ours, ± (95 %), inside; without a truth the second and the last are missing. R stands
        as the turns about x, y, z that lead from the true one to ours, or from none, rad. True coefficients that ours
        has not are left out, those that only ours has are zero.
    """
    import pandas as pd

    is_known = truth is not None
    truth = with_coefficients(truth or StereoRig(rig.left, rig.right, np.eye(3), rig.T), rig.left.dist.size)
    turns = rig_difference(rig, truth)[-6:-3]
    ours = np.concatenate([lens_vector(rig.left), lens_vector(rig.right), turns, rig.T])
    true = np.concatenate([lens_vector(truth.left), lens_vector(truth.right), np.zeros(3), truth.T])
    rows = []
    widths = INTERVAL_STDS * np.sqrt(np.diag(covariance))
    for name, a, b, width in zip(rig_parameter_names(rig), true, ours, widths, strict=True):
        digits = int(np.clip(1 - np.floor(np.log10(width)), 1, 7))  # two digits of the interval
        inside = "yes" if abs(b - a) <= width else "no"
        rows.append((name, f"{a:.{digits}f}", f"{b:.{digits}f}", f"{width:.{digits}f}", inside))
    table = pd.DataFrame(rows, columns=["parameter", "true", "ours", "± (95 %)", "inside"])
    return table if is_known else table[["parameter", "ours", "± (95 %)"]]


def triangulation_jacobian(rig: StereoRig, points_mm: Float64) -> Float64:
    """Differentiate triangulated points by the rig's parameters, the pixels staying.

    Parameters
    ----------
    rig : StereoRig
    points_mm : (N, 3) float64
        In the left camera's frame.

    Returns
    -------
    (N, 3, s) float64
        mm per unit of each parameter.

    Notes
    -----
    With ``u`` the four pixel coordinates of a point X: ``du = A dX + B dp = 0``, so ``dX/dp = -(A'A)^-1 A' B``.
    """
    A, B = _by_point_and_rig(rig, points_mm)
    AT = A.transpose(0, 2, 1)
    return np.asarray(-np.linalg.solve(AT @ A, AT @ B))


def row_jacobian(rectified: RectifiedRig, points_mm: Float64) -> Float64:
    """Differentiate what rows of rectified pictures disagree by, by the rig's parameters, the pixels staying.

    Parameters
    ----------
    rectified : RectifiedRig
    points_mm : (N, 3) float64
        In the left camera's frame.

    Returns
    -------
    (N, s) float64
        Row in the right picture minus that in the left one, px per unit of each parameter.

    Notes
    -----
    Of the four pixel coordinates ``u`` of a point X, ``du = A dX + B dp``, no dX undoes what lies along n with
    ``n A = 0``: ``n B dp``, in units of what a row of the rectified right picture is along n.
    """
    rig = rectified.rig
    A, B = _by_point_and_rig(rig, points_mm)
    n = np.linalg.svd(A)[0][:, :, 3]
    depth = (points_mm @ rectified.R1[2])[:, None]
    row_mm = depth / rectified.f_px * rectified.R2[1]  # what is a row lower, in the right camera's frame
    by_point = project_with_derivatives(rig.right, points_mm @ rig.R.T + rig.T)[1]
    of_row = np.einsum("nk,nkj,nj->n", n[:, 2:], by_point, row_mm)
    return np.asarray(-np.einsum("nk,nks->ns", n, B) / of_row[:, None])


def _by_point_and_rig(rig: StereoRig, points_mm: Float64) -> tuple[Float64, Float64]:
    """Derivatives of the four pixels of points by these, (N, 4, 3), and by the rig's parameters, (N, 4, s)."""
    turned = points_mm @ rig.R.T
    _, left_by_point, by_left = project_with_derivatives(rig.left, points_mm)
    _, right_by_point, by_right = project_with_derivatives(rig.right, turned + rig.T)
    n = by_left.shape[-1]
    B = np.zeros((len(points_mm), 4, 2 * n + 6))
    B[:, :2, :n], B[:, 2:, n : 2 * n] = by_left, by_right
    B[:, 2:, 2 * n : 2 * n + 3] = right_by_point @ turn_derivatives(turned)
    B[:, 2:, 2 * n + 3 :] = right_by_point
    return np.concatenate([left_by_point, right_by_point @ rig.R], 1), B


def check_distance(at_mm: float) -> None:
    """Refuse a distance that is none, or that was given in metres.

    Parameters
    ----------
    at_mm : float
        Where depths are judged.

    Raises
    ------
    ValueError
        If it is no positive number, or nearer than any camera sees.

    Examples
    --------
    >>> check_distance(1.0)
    Traceback (most recent call last):
    ...
    ValueError: the distance to judge depths at was given as 1, but millimetres are expected: for 1 m that is 1000
    """
    if not (np.isfinite(at_mm) and at_mm > 0):
        raise ValueError(f"the distance to judge depths at must be a positive number of mm, got {at_mm}")
    if at_mm < _LEAST_AT_MM:
        meant = f"millimetres are expected: for {at_mm:g} m that is {1000 * at_mm:g}"
        raise ValueError(f"the distance to judge depths at was given as {at_mm:g}, but {meant}")


def left_grid(rig: StereoRig, at_mm: float, step_px: int) -> tuple[Ints, Ints, Float64, Bools]:
    """Lay a grid of left pixels at one depth.

    Parameters
    ----------
    rig : StereoRig
    at_mm : float
        Depth along the left optical axis.
    step_px : int
        Spacing of the grid.

    Returns
    -------
    columns, rows : (M,), (N,) int
    points_mm : (N * M, 3) float64
        In the left camera's frame, row by row.
    in_sight : (N * M,) bool
        The right camera sees them.
    """
    width, height = rig.left.size
    columns, rows = np.arange(step_px // 2, width, step_px), np.arange(step_px // 2, height, step_px)
    pixels = np.stack(np.meshgrid(columns, rows), -1).reshape(-1, 2)
    points = rig.left.rays(pixels, clamp=True) * at_mm
    where = rig.right.project(points @ rig.R.T + rig.T)
    in_sight = np.all((where >= 0) & (where <= np.array(rig.right.size) - 1), axis=1)
    return columns, rows, points, in_sight


def error_map(rig: StereoRig, covariance: Float64, *, at_mm: float = JUDGED_AT_MM, of_mm: float = 100.0) -> ErrorMap:
    """Map what the uncertainty of the calibration does to depths and lengths, over the left image.

    Parameters
    ----------
    rig : StereoRig
    covariance : (s, s) float64
        From `rig_covariance`.
    at_mm : float
        Depth along the left optical axis.
    of_mm : float
        The length, level and across the line of sight.

    Returns
    -------
    ErrorMap

    Raises
    ------
    ValueError
        If the distance is no positive number of mm, or given in metres.

    Notes
    -----
    ``sigma^2 = g C g'`` with g the row of `triangulation_jacobian` for the depth, or the difference of two for a
    length. The noise of a matched pixel comes on top of it.
    """
    check_distance(at_mm)
    columns, rows, points, in_sight = left_grid(rig, at_mm, _STEP_PX)
    half = np.array([of_mm / 2, 0.0, 0.0])
    ends = triangulation_jacobian(rig, points + half)[:, 0] - triangulation_jacobian(rig, points - half)[:, 0]
    depth = triangulation_jacobian(rig, points)[:, 2]
    sigmas = [np.sqrt(np.einsum("ni,ij,nj->n", g, covariance, g)) for g in (depth, ends)]
    depth_mm, length_mm = (np.where(in_sight, s, np.nan).reshape(len(rows), len(columns)) for s in sigmas)
    return ErrorMap(columns, rows, depth_mm, length_mm, at_mm, of_mm)


def compare_calibrations(first: RigFit, second: RigFit, *, at_mm: float = JUDGED_AT_MM) -> Agreement:
    """Find out whether two calibrations from disjoint pictures differ by what their uncertainties predict.

    Parameters
    ----------
    first, second : RigFit
    at_mm : float
        Depth at which they are compared.

    Returns
    -------
    Agreement

    Raises
    ------
    ValueError
        As `error_map` and `rig_covariance`.
    """
    check_distance(at_mm)
    difference = rig_difference(first.rig, second.rig)
    total = rig_covariance(first) + rig_covariance(second)
    _, rows, points, in_sight = left_grid(second.rig, at_mm, _STEP_PX)
    by_depth = triangulation_jacobian(second.rig, points)[:, 2]
    values = by_depth @ difference, np.sqrt(np.einsum("ni,ij,nj->n", by_depth, total, by_depth))
    depth, predicted = (np.where(in_sight, v, np.nan).reshape(len(rows), -1) for v in values)
    return Agreement(rig_parameter_names(first.rig), difference / np.sqrt(np.diag(total)), depth, predicted)
