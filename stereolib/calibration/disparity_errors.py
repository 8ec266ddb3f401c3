"""What a calibration's uncertainty does to disparities at one place: it shifts, turns and bends planes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stereolib.base import Float64
from stereolib.calibration.uncertainty import BASELINES, rectified_rows, triangulation_jacobian
from stereolib.rig import RectifiedRig

_LEAST_PX = 1.0  # of a disparity: what is farther is asked as if it were there


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
            As `rectified_covariance` tells it of the whole picture: of focal length, baseline and a shift.

        Raises
        ------
        ValueError
            If the cameras see nothing together where rigs measure.
        """
        f_px, baseline_mm = self.rectified.f_px, self.rectified.baseline_mm
        disparity = np.repeat(f_px / np.array(BASELINES), len(u))
        moves = self._moves(np.tile(u, len(BASELINES)), np.tile(v, len(BASELINES)), disparity)
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

    def _moves(self, u: Float64, v: Float64, disparity_px: Float64) -> Float64:
        """Derivatives of disparities of pixels by the rig's parameters, without what turns the scene. (N, s)."""
        rectified = self.rectified
        points = rectified.triangulate(np.stack([u, v], axis=1), disparity_px)
        moves = np.einsum("ij,njs->nis", rectified.R1, triangulation_jacobian(rectified.rig, points @ rectified.R1))
        depth, rays = points[:, 2:], points[:, :2] / points[:, 2:]
        ahead, (x, y) = moves[:, 2] / depth, rays.T
        unzoomed = moves[:, :2] / depth[..., None] - rays[..., None] * (ahead - self._focal)[:, None]  # zoom: -focal
        turns = np.concatenate([[-x * y, 1 + x * x, -y], [-1 - y * y, x * y, x]], axis=1).T  # of rays, by w
        w_x, w_y, _ = np.linalg.lstsq(turns, np.concatenate([unzoomed[:, 0], unzoomed[:, 1]]), rcond=None)[0]
        return np.asarray(-disparity_px[:, None] * (ahead + np.outer(x, w_y) - np.outer(y, w_x)))

    @cached_property
    def _rows(self) -> Float64:
        return rectified_rows(self.rectified)

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
