"""What a calibration's uncertainty does to rectified pictures: to the whole, and to disparities at one place."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from stereolib.base import Float64
from stereolib.calibration.bundle_adjustment import project_with_derivatives
from stereolib.calibration.uncertainty import left_grid, row_jacobian, triangulation_jacobian
from stereolib.rig import Camera, RectifiedRig

_BASELINES = (6.5, 10.0, 15.0)  # depths over which they are asked: where rigs measure
_STEP_PX = 40  # between the left pixels that are asked
_LEAST_PX = 1.0  # of a disparity: what is farther is asked as if it were there


def rectified_std(rectified: RectifiedRig, covariance: Float64) -> dict[str, Any]:
    """Tell what the uncertainty of a calibration leaves open in its rectified pictures, as standard deviations.

    Parameters
    ----------
    rectified : RectifiedRig
        Of the calibrated rig.
    covariance : (s, s) float64
        From `rig_covariance`.

    Returns
    -------
    dict
        ``f_px`` and ``baseline_mm``; ``offset_px``, by which all disparities are shifted alike; ``correlation``, of the
        first with the second and the third, and of these two: ready for ``SystematicUncertainty(**...)`` of
        `stereolib.measurement`.

    Raises
    ------
    ValueError
        If the cameras see nothing together where rigs measure.

    Notes
    -----
    Pixels stay, the parameters move: the inverse depth moves by ``a + b / Z`` over the image and depths of 6.5 to
    15 baselines, fitted by least squares with weights from 1 in the picture's middle down to 0 on its rim: what is
    measured lies in it, and in the corners, where boards hardly come, errors are many times as large. So disparities
    are ``f B / Z + offset`` with ``offset = -f B a`` and the baseline changed by ``-b - df / f`` of itself. The focal
    length is that of the whole left picture, weighted likewise, by which all its rays zoom: what fx is off, the lens's
    distortion mostly makes good. Taken from the whole covariance: the errors of cx and of the turn about y, each of
    some tenths of a pixel, cancel but for their sum.
    """
    rows = _rectified_rows(rectified)
    return deviations(rows @ covariance @ rows.T)


def deviations(covariance: Float64) -> dict[str, Any]:
    """Turn a covariance as `DisparityErrors.alike` tells it into standard deviations and correlations.

    Parameters
    ----------
    covariance : (3, 3) float64

    Returns
    -------
    dict
        As of `rectified_std`.
    """
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    correlation = (covariance / np.maximum(np.outer(std, std), 1e-30))[np.triu_indices(3, 1)]
    return dict(zip(("f_px", "baseline_mm", "offset_px"), std.tolist(), strict=True)) | {
        "correlation": tuple(np.clip(correlation, -1.0, 1.0).tolist())
    }


@dataclass(frozen=True, eq=False)
class DisparityErrors:
    """Errors of disparities that a calibration leaves open, from place to place.

    Attributes
    ----------
    rectified : RectifiedRig
        Of the calibrated rig.
    covariance : (s, s) float64
        From `rig_covariance`: symmetric, without negative variances.

    Notes
    -----
    Pixels stay, the parameters move: a point X by ``dX``, its ray ``r = X / Z`` by ``dr`` and its inverse depth by
    ``-dX_z / Z^2``. What turns all rays of some pixels turns the scene, and shows in no size: a turn ``w`` is fitted to
    ``dr - zoom r``, and its ``(w_y x - w_x y) / Z`` is taken off. The zoom is that of the whole picture.
    """

    rectified: RectifiedRig
    covariance: Float64

    def alike(self, u: Float64, v: Float64) -> Float64:
        """Tell how the disparities of some pixels err alike.

        Parameters
        ----------
        u, v : (N,) float64, px
            Of the rectified left picture; three and more that lie on no line.

        Returns
        -------
        (3, 3) float64
            Of the focal length (px), the baseline (mm) and the shift of all disparities (px), as true minus believed.

        Raises
        ------
        ValueError
            If the cameras see nothing together where rigs measure.
        """
        f_px, baseline_mm = self.rectified.f_px, self.rectified.baseline_mm
        disparity = np.repeat(f_px / np.array(_BASELINES), len(u))
        moves = self._moves(np.tile(u, len(_BASELINES)), np.tile(v, len(_BASELINES)), disparity)
        shift, scale = np.linalg.lstsq(np.stack([np.ones_like(disparity), disparity], axis=1), moves, rcond=None)[0]
        focal = self._focal
        rows = np.stack([f_px * focal, -baseline_mm * (scale + focal), -shift])
        return np.asarray(rows @ self.covariance @ rows.T)

    def within(self, u: Float64, v: Float64, disparity_px: Float64) -> Float64:
        """Tell how the disparities of some pixels err against each other.

        Parameters
        ----------
        u, v : (N,) float64, px
            Of the rectified left picture; three and more that lie on no line.
        disparity_px : (N,) float64

        Returns
        -------
        (N, s) float64, px
            `F` without its mean; their covariance is ``F F'``. A plane fitted to them errs as one fitted to `F` says.

        Raises
        ------
        ValueError
            If the cameras see nothing together where rigs measure.
        """
        disparity = np.maximum(disparity_px, _LEAST_PX)
        moves = self._moves(u, v, disparity) - np.outer(disparity, self._scale)
        return np.asarray((moves - moves.mean(axis=0)) @ self._root)

    def of_points(self, u: Float64, v: Float64, disparity_px: Float64) -> Float64:
        """Tell how triangulated points err, each and together.

        Parameters
        ----------
        u, v : (N,) float64, px
            Of the rectified left picture.
        disparity_px : (N,) float64
            Above 0.

        Returns
        -------
        (N, 3, s) float64, mm
            `F`, in the rectified left camera's frame: the covariance of coordinates i and j is ``F_i . F_j``, whether
            of one point or of two.
        """
        return np.asarray(self._points_moved(u, v, disparity_px)[1] @ self._root)

    def of_rows(self, u: Float64, v: Float64, disparity_px: Float64) -> Float64:
        """Tell how the rows of pixels err, of right pictures against left ones.

        Parameters
        ----------
        u, v : (N,) float64, px
            Of the rectified left picture.
        disparity_px : (N,) float64
            Above 0.

        Returns
        -------
        (N, s) float64, px
            `F`: their covariance is ``F F'``.
        """
        points = self.rectified.triangulate(np.stack([u, v], axis=1), disparity_px)
        return np.asarray(row_jacobian(self.rectified, points @ self.rectified.R1) @ self._root)

    def _points_moved(self, u: Float64, v: Float64, disparity_px: Float64) -> tuple[Float64, Float64]:
        """Points (N, 3), mm, and their derivatives by the rig's parameters (N, 3, s)."""
        rectified = self.rectified
        points = rectified.triangulate(np.stack([u, v], axis=1), disparity_px)
        moves = triangulation_jacobian(rectified.rig, points @ rectified.R1)
        return points, np.einsum("ij,njs->nis", rectified.R1, moves)

    def _moves(self, u: Float64, v: Float64, disparity_px: Float64) -> Float64:
        """Derivatives of disparities of pixels by the rig's parameters, without what turns the scene. (N, s)."""
        points, moves = self._points_moved(u, v, disparity_px)
        depth, rays = points[:, 2:], points[:, :2] / points[:, 2:]
        ahead, (x, y) = moves[:, 2] / depth, rays.T
        unzoomed = moves[:, :2] / depth[..., None] - rays[..., None] * (ahead - self._focal)[:, None]  # zoom: -focal
        turns = np.concatenate([[-x * y, 1 + x * x, -y], [-1 - y * y, x * y, x]], axis=1).T  # of rays, by w
        w_x, w_y, _ = np.linalg.pinv(turns) @ np.concatenate([unzoomed[:, 0], unzoomed[:, 1]])
        return np.asarray(-disparity_px[:, None] * (ahead + np.outer(x, w_y) - np.outer(y, w_x)))

    @cached_property
    def _rows(self) -> Float64:
        return _rectified_rows(self.rectified)

    @property
    def _focal(self) -> Float64:
        """Change of the focal length, as a share, by the rig's parameters. (s,)."""
        return np.asarray(self._rows[0] / self.rectified.f_px)

    @property
    def _scale(self) -> Float64:
        """Change of all disparities of the whole picture, as a share. (s,)."""
        return np.asarray(-self._rows[1] / self.rectified.baseline_mm - self._focal)

    @cached_property
    def _root(self) -> Float64:
        """Of the covariance: ``root root' = C``. (s, s)."""
        std = np.sqrt(np.diag(self.covariance))
        std[std == 0] = 1.0  # what is known perfectly goes together with nothing
        values, vectors = np.linalg.eigh(self.covariance / np.outer(std, std))
        return np.asarray(std[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def _rectified_rows(rectified: RectifiedRig) -> Float64:
    """Derivatives of focal length, baseline and shift, as `rectified_std` tells of them, by the rig's. (3, s)."""
    rig, scale = rectified.rig, rectified.f_px * rectified.baseline_mm
    grids = [left_grid(rig, k * rig.baseline_mm, _STEP_PX)[2:] for k in _BASELINES]
    points = np.concatenate([points[in_sight] for points, in_sight in grids])
    if not len(points):
        raise ValueError(f"the cameras see nothing together between {_BASELINES[0]:g} and {_BASELINES[-1]:g} baselines")
    depth, weight = points[:, 2], _middle(rig.left, points)
    moves = -triangulation_jacobian(rig, points)[:, 2] / depth[:, None] ** 2
    constant, by_depth = _fitted(np.column_stack([np.ones_like(depth), 1 / depth]), moves, weight)
    focal = np.zeros(moves.shape[1])
    focal[: 4 + rig.left.dist.size] = -rectified.f_px * _zoom(rig.left, points, weight)
    return np.stack([focal, -rectified.baseline_mm * (by_depth + focal / rectified.f_px), -scale * constant])


def _middle(camera: Camera, points_mm: Float64) -> Float64:
    """Weights (N,) of points by where a camera sees them: 1 in the picture's middle, 0 on its rim."""
    share = 2 * camera.project(points_mm) / (np.array(camera.size) - 1) - 1
    return np.asarray(np.maximum(1 - share**2, 0.0).prod(axis=1))


def _fitted(x: Float64, y: Float64, weight: Float64) -> Float64:
    """Weighted least squares of ``x @ c = y``: c."""
    root = np.sqrt(weight)[:, None]
    return np.asarray(np.linalg.lstsq(root * x, root * y, rcond=None)[0])


def _zoom(camera: Camera, points_mm: Float64, weight: Float64) -> Float64:
    """Share by which the rays of pixels that see points (N, 3) spread for each parameter of a lens, (4 + n,).

    Fitted to the rays of all pixels, which stay, beside a shift and a turn; each by its weight.
    """
    rays = points_mm / points_mm[:, 2:]
    _, by_ray, by_lens = project_with_derivatives(camera, rays)
    moves = -np.linalg.solve(by_ray[..., :2], by_lens)  # (N, 2, 4 + n)
    (x, y, one), none = rays.T, np.zeros(len(rays))
    like = np.stack([[x, y], [one, none], [none, one], [-y, x]], axis=-1)  # (2, N, 4)
    found = _fitted(like.reshape(-1, 4), np.concatenate([moves[:, 0], moves[:, 1]]), np.tile(weight, 2))
    return np.asarray(found[0])
