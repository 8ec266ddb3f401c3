"""One camera: a pinhole with OpenCV's lens model, exact in both directions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stereolib.base import finite_array, set_frozen

Array = np.ndarray
_DIST_LENGTHS = (0, 4, 5, 8, 12, 14)


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole with OpenCV's lens model.

    Parameters
    ----------
    K : (3, 3) array_like, px
        Camera matrix; pixel centres have integer coordinates.
    dist : (0 | 4 | 5 | 8 | 12 | 14,) array_like
        Distortion in OpenCV's order ``k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tau_x tau_y]]]]``.
    size : (width, height), px

    Raises
    ------
    ValueError
        If a shape is wrong or a value is not finite.
    """

    K: Array
    dist: Array
    size: tuple[int, int]

    def __post_init__(self) -> None:
        size = finite_array(self.size, (2,), "size")
        if (size < 1).any() or (size % 1).any():
            raise ValueError(f"size must be a positive (width, height) in whole pixels, got {self.size!r}")
        set_frozen(self, K=finite_array(self.K, (3, 3), "K"), size=(int(size[0]), int(size[1])))
        dist = np.asarray(self.dist, float).ravel()
        if dist.size not in _DIST_LENGTHS:
            raise ValueError(f"dist has {dist.size} coefficients; OpenCV's models have {_DIST_LENGTHS}")
        set_frozen(self, dist=finite_array(dist, dist.shape, "dist"))
        if self.K[0, 0] <= 0 or self.K[1, 1] <= 0:
            raise ValueError(f"focal lengths must be positive, got fx={self.K[0, 0]:g}, fy={self.K[1, 1]:g}")

    def project(self, points_mm: Array) -> Array:
        """Pixels of points in the camera's own frame.

        Parameters
        ----------
        points_mm : (N, 3) array, mm
            x right, y down, z forward. Points with z <= 0 come back as NaN.

        Returns
        -------
        (N, 2) float64, px
        """
        points = np.asarray(points_mm, float).reshape(-1, 3)
        with np.errstate(divide="ignore", invalid="ignore"):
            xy = np.where(points[:, 2:] > 0, points[:, :2] / points[:, 2:], np.nan)
        distorted, _ = distort(xy, self.dist)
        return _tilted(distorted, self.dist) @ self.K[:2, :2].T + self.K[:2, 2]

    def rays(self, pixels: Array, *, clamp: bool = False) -> Array:
        """Directions (x/z, y/z, 1) that the lens maps to these pixels, by Newton's method.

        A strong lens folds over: past some radius its image runs backwards, and pixels beyond the fold have no
        direction. (`cv2.undistortPoints` iterates blindly there and is wrong by pixels.)

        Parameters
        ----------
        pixels : (N, 2) array, px
        clamp : bool
            Give pixels without a direction the one at the fold instead of NaN: what a renderer wants.

        Returns
        -------
        (N, 3) float64
            Third column 1.

        Notes
        -----
        Solves ``distort(x) = K^-1 u`` with ``x <- x - J^-1 (distort(x) - K^-1 u)``, the iterate kept inside the
        fold radius, where ``d(r g(r^2))/dr`` first vanishes.
        """
        pixels = np.asarray(pixels, float).reshape(-1, 2)
        target = (pixels - self.K[:2, 2]) @ np.linalg.inv(self.K[:2, :2]).T
        target = _tilted(target, self.dist, inverse=True)
        limit = self.fold_radius
        xy = target * np.minimum(1.0, 0.9 * limit / np.maximum(np.hypot(*target.T), 1e-12))[:, None]
        for _ in range(20):
            value, jacobian = distort(xy, self.dist)
            determinant = jacobian[0] * jacobian[3] - jacobian[1] * jacobian[2]
            determinant = np.where(np.abs(determinant) < 1e-6, 1e-6, determinant)
            ex, ey = (value - target).T
            step = np.stack([jacobian[3] * ex - jacobian[1] * ey, jacobian[0] * ey - jacobian[2] * ex], 1)
            step /= determinant[:, None]
            xy = xy - step
            xy *= np.minimum(1.0, limit / np.maximum(np.hypot(*xy.T), 1e-12))[:, None]
            if np.abs(step).max(initial=0.0) < 1e-12:
                break
        lost = ~(np.abs(distort(xy, self.dist)[0] - target).max(axis=1, initial=0.0) < 1e-7)
        if lost.any():
            xy[lost] = _at_fold(target[lost], self.dist, limit) if clamp and np.isfinite(limit) else np.nan
        return np.column_stack([xy, np.ones(len(xy))])

    @cached_property
    def fold_radius(self) -> float:
        """Radius ``sqrt(x^2 + y^2)`` of ideal coordinates at which the radial model folds over; inf if it does not."""
        if not self.dist.any():
            return np.inf
        r = np.linspace(0.0, 4.0, 8001)
        x, _ = distort(np.column_stack([r, np.zeros_like(r)]), _radial_only(self.dist))
        falling = np.flatnonzero(np.diff(x[:, 0]) <= 0)
        return float(r[falling[0]]) if falling.size else np.inf


def distort(xy: Array, dist: Array) -> tuple[Array, Array]:
    """Ideal coordinates through the lens, and the Jacobian.

    Parameters
    ----------
    xy : (N, 2) array
        ``x/z, y/z``, no unit.
    dist : (n,) array
        OpenCV's order; the tilt of the 14-coefficient model is not applied here.

    Returns
    -------
    xy_distorted : (N, 2) float64
    jacobian : (4, N) float64
        ``dx'/dx, dx'/dy, dy'/dx, dy'/dy``.

    Notes
    -----
    ``x' = x g + 2 p1 x y + p2 (r2 + 2 x^2) + s1 r2 + s2 r2^2`` and
    ``y' = y g + p1 (r2 + 2 y^2) + 2 p2 x y + s3 r2 + s4 r2^2`` with
    ``g = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)``. The paper prints the tangential
    terms (section II.A) with ``2 x`` for ``2 x^2``: a misprint, the units would not agree.
    """
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = np.pad(np.asarray(dist, float), (0, 14))[:12]
    x, y = np.asarray(xy, float).T
    r2 = x * x + y * y
    over = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    under = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    g = over / under
    dg = ((k1 + r2 * (2 * k2 + 3 * r2 * k3)) - g * (k4 + r2 * (2 * k5 + 3 * r2 * k6))) / under
    xd = x * g + 2 * p1 * x * y + p2 * (r2 + 2 * x * x) + r2 * (s1 + s2 * r2)
    yd = y * g + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y + r2 * (s3 + s4 * r2)
    prism_x, prism_y = 2 * (s1 + 2 * s2 * r2), 2 * (s3 + 2 * s4 * r2)
    cross = 2 * x * y * dg + 2 * p1 * x + 2 * p2 * y
    jacobian = np.stack(
        [
            g + 2 * x * x * dg + 2 * p1 * y + 6 * p2 * x + x * prism_x,
            cross + y * prism_x,
            cross + x * prism_y,
            g + 2 * y * y * dg + 6 * p1 * y + 2 * p2 * x + y * prism_y,
        ]
    )
    return np.column_stack([xd, yd]), jacobian


def _at_fold(target: Array, dist: Array, limit: float) -> Array:
    """Ideal coordinates on the fold circle whose image is nearest to targets beyond it; steepest descent. (N, 2)."""
    xy = target * (limit / np.hypot(*target.T))[:, None]
    for _ in range(40):
        value, jacobian = distort(xy, dist)
        ex, ey = (value - target).T
        xy = xy - 0.5 * np.stack([jacobian[0] * ex + jacobian[2] * ey, jacobian[1] * ex + jacobian[3] * ey], 1)
        xy *= (limit / np.hypot(*xy.T))[:, None]
    return xy


def _radial_only(dist: Array) -> Array:
    radial = np.pad(dist, (0, 14 - dist.size))
    radial[[2, 3]] = radial[8:] = 0
    return radial


def _tilted(xy: Array, dist: Array, *, inverse: bool = False) -> Array:
    """The tilted-sensor homography of the 14-coefficient model (OpenCV's ``computeTiltProjectionMatrix``)."""
    if dist.size < 14 or not dist[12:].any():
        return xy
    cx, cy = np.cos(dist[12:])
    sx, sy = np.sin(dist[12:])
    turn = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]]) @ np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    H = np.array([[turn[2, 2], 0, -turn[0, 2]], [0, turn[2, 2], -turn[1, 2]], [0, 0, 1]]) @ turn
    xyw = np.column_stack([xy, np.ones(len(xy))]) @ (np.linalg.inv(H) if inverse else H).T
    return xyw[:, :2] / xyw[:, 2:]
