"""One camera: a pinhole with OpenCV's lens model, exact in both directions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from stereolib.base import Bools, Float64, as_rows, finite_array, set_frozen

_DIST_LENGTHS = (0, 4, 5, 8, 12, 14)
_LARGEST_PX = 2**15 - 1  # a side of a picture: OpenCV's lookup maps hold no more
_LEAST_FOCAL_PX, _MOST_PX = 0.1, 1e6  # of K: whatever lies outside is no lens but a slip, and products overflow
_MOST_DIST = 1e6  # a coefficient of the lens: those that are fitted to noise reach thousands
_AT_ONCE = 1 << 14
_NEWTON_STEPS = 20  # four or five do far from the fold
_DAMPED_STEPS = 60  # tried, halved ones among them: next to a fold that is none forty are needed
_FARTHEST = 1e6  # ideal coordinates: a direction along the picture plane, whose powers do not overflow yet
_START_INSIDE = 0.9  # of the fold radius: on it the Jacobian is singular
_SETTLED = 1e-12  # step of ideal coordinates: a thousandth of a millionth of a pixel
_MISS = 1e-7  # what a solution may miss its target by, ideal coordinates: 1e-4 px
_LEAST_DETERMINANT = 1e-6  # a step at the fold stays finite
_DESCENT_STEPS, _DESCENT = 40, 0.5  # along the fold circle, to the point nearest to a target beyond it
_FOLD_RADII = np.linspace(0.0, 4.0, 8001)  # where a fold is searched for: up to 76 degrees off the axis


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole with OpenCV's lens model.

    Attributes
    ----------
    K : (3, 3) array_like, px
        Camera matrix; pixel centres have integer coordinates.
    dist : (0 | 4 | 5 | 8 | 12 | 14,) array_like
        Distortion in OpenCV's order ``k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [tau_x tau_y]]]]``.
    size : (width, height), px

    Raises
    ------
    ValueError
        If a shape is wrong, or a value is not finite or out of range.
    """

    K: Float64
    dist: Float64
    size: tuple[int, int]

    def __post_init__(self) -> None:
        size = finite_array(self.size, (2,), "size", most=_LARGEST_PX)
        if (size < 1).any() or (size % 1).any():
            raise ValueError(f"size must be a positive (width, height) in whole pixels, got {self.size!r}")
        set_frozen(self, K=finite_array(self.K, (3, 3), "K", most=_MOST_PX), size=(int(size[0]), int(size[1])))
        if self.K[1, 0] != 0 or not np.array_equal(self.K[2], (0, 0, 1)):
            raise ValueError(f"K must be [[fx, skew, cx], [0, fy, cy], [0, 0, 1]], got {self.K.tolist()}")
        if min(self.K[0, 0], self.K[1, 1]) < _LEAST_FOCAL_PX:
            why = f"focal lengths must be positive, {_LEAST_FOCAL_PX:g} px at least"
            raise ValueError(f"{why}, got fx={self.K[0, 0]:g}, fy={self.K[1, 1]:g}")
        dist = finite_array(self.dist, None, "dist", most=_MOST_DIST).ravel()
        if dist.size not in _DIST_LENGTHS:
            raise ValueError(f"dist has {dist.size} coefficients; OpenCV's models have {_DIST_LENGTHS}")
        set_frozen(self, dist=dist)

    def project(self, points_mm: ArrayLike) -> Float64:
        """Pixels of points in the camera's own frame.

        Parameters
        ----------
        points_mm : (N, 3) array_like, mm
            x right, y down, z forward. Points with z <= 0 come back as NaN.

        Returns
        -------
        (N, 2) float64, px

        Raises
        ------
        ValueError
            If the points are not rows of three.

        Examples
        --------
        >>> camera = Camera([[700, 0, 320], [0, 700, 240], [0, 0, 1]], [], (640, 480))
        >>> camera.project([[100.0, 0.0, 1000.0], [0.0, 0.0, -1.0]])
        array([[390., 240.],
               [ nan,  nan]])
        """
        points = as_rows(points_mm, 3, "points_mm")
        with np.errstate(divide="ignore", invalid="ignore"):
            xy = np.where(points[:, 2:] > 0, points[:, :2] / points[:, 2:], np.nan)
        distorted, *_ = _image(xy[:, 0], xy[:, 1], _coefficients(self.dist))
        return np.asarray(_tilted(distorted, self.dist) @ self.K[:2, :2].T + self.K[:2, 2])

    def rays(self, pixels: ArrayLike, *, clamp: bool = False) -> Float64:
        """Directions (x/z, y/z, 1) that the lens maps to these pixels, by Newton's method.

        A strong lens folds over: past some radius its image runs backwards, and pixels beyond the fold have no
        direction. (`cv2.undistortPoints` iterates blindly there and is wrong by pixels.)

        Parameters
        ----------
        pixels : (N, 2) array_like, px
        clamp : bool
            Give pixels without a direction the one at the fold instead of NaN: what a renderer wants. Of a lens that
            does not fold and yet reaches no such pixel, one whose image comes near it.

        Returns
        -------
        (N, 3) float64
            Third column 1.

        Raises
        ------
        ValueError
            If the pixels are not rows of two.

        Notes
        -----
        Solves ``distort(x) = K^-1 u`` with ``x <- x - J^-1 (distort(x) - K^-1 u)``, the iterate kept inside the
        fold radius, where ``d(r g(r^2))/dr`` first vanishes. Where that derivative only comes near 0, whole steps
        may leap to and fro: what they miss is solved again by steps that are halved until they lead nearer.

        Examples
        --------
        >>> camera = Camera([[700, 0, 320], [0, 700, 240], [0, 0, 1]], [0.1, 0.0, 0.0, 0.0], (640, 480))
        >>> camera.project(camera.rays([[100.0, 50.0]])).round(6)
        array([[100.,  50.]])
        """
        uv = as_rows(pixels, 2, "pixels")
        target = _tilted((uv - self.K[:2, 2]) @ np.linalg.inv(self.K[:2, :2]).T, self.dist, inverse=True)
        if not self.dist.any():
            found = np.isfinite(target).all(axis=1, keepdims=True)
            return np.column_stack([np.where(found, target, np.nan), np.ones(len(target))])
        limit = min(self.fold_radius, _FARTHEST)
        xy = np.concatenate([_newton(part, self.dist, limit) for part in _in_parts(target)])
        if (lost := self._missed(xy, target)).any():
            xy[lost] = _damped(target[lost], self.dist, limit)
            lost = self._missed(xy, target)
            if not clamp:
                xy[lost] = np.nan
            elif limit < _FARTHEST:
                xy[lost] = _at_fold(target[lost], self.dist, limit)
        return np.column_stack([xy, np.ones(len(xy))])

    def _missed(self, xy: Float64, target: Float64) -> Bools:
        """Which ideal coordinates the lens does not map to their target."""
        return np.asarray(
            ~(np.abs(_image(xy[:, 0], xy[:, 1], _coefficients(self.dist))[0] - target).max(axis=1, initial=0.0) < _MISS)
        )

    @cached_property
    def fold_radius(self) -> float:
        """Radius ``sqrt(x^2 + y^2)`` of ideal coordinates at which the radial model folds over; inf if it does not."""
        if not self.dist.any():
            return np.inf
        radial = np.pad(self.dist, (0, 14 - self.dist.size))
        radial[[2, 3]] = radial[8:] = 0
        x, _ = distort(np.column_stack([_FOLD_RADII, np.zeros_like(_FOLD_RADII)]), radial)
        falling = np.flatnonzero(np.diff(x[:, 0]) <= 0)
        return float(_FOLD_RADII[falling[0]]) if falling.size else np.inf


def distort(xy: ArrayLike, dist: ArrayLike) -> tuple[Float64, Float64]:
    """Ideal coordinates through the lens, and the Jacobian.

    Parameters
    ----------
    xy : (N, 2) array_like
        ``x/z, y/z``, no unit.
    dist : (n,) or (1, n) array_like
        OpenCV's order; the tilt of the 14-coefficient model is not applied here.

    Returns
    -------
    xy_distorted : (N, 2) float64
    jacobian : (4, N) float64
        ``dx'/dx, dx'/dy, dy'/dx, dy'/dy``.

    Raises
    ------
    ValueError
        If the coordinates are not rows of two.

    Notes
    -----
    ``x' = x g + 2 p1 x y + p2 (r2 + 2 x^2) + s1 r2 + s2 r2^2`` and
    ``y' = y g + p1 (r2 + 2 y^2) + 2 p2 x y + s3 r2 + s4 r2^2`` with
    ``g = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)``. The paper prints the tangential
    terms (section II.A) with ``2 x`` for ``2 x^2``: a misprint, which stretches the image where the model bends it.

    Examples
    --------
    >>> distorted, _ = distort([[0.5, 0.0]], [0.1, 0.0, 0.0, 0.0])
    >>> distorted
    array([[0.5125, 0.    ]])
    """
    x, y = as_rows(xy, 2, "xy").T
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = coefficients = _coefficients(dist)
    value, r2, g, under = _image(x, y, coefficients)
    dg = k1 + r2 * (2 * k2 + 3 * r2 * k3)
    if k4 or k5 or k6:
        dg = (dg - g * (k4 + r2 * (2 * k5 + 3 * r2 * k6))) / under
    cross = 2 * x * y * dg + 2 * p1 * x + 2 * p2 * y
    along_x = g + 2 * x * x * dg + 2 * p1 * y + 6 * p2 * x
    along_y = g + 2 * y * y * dg + 6 * p1 * y + 2 * p2 * x
    if not (s1 or s2 or s3 or s4):
        return value, np.stack([along_x, cross, cross, along_y])
    prism_x, prism_y = 2 * (s1 + 2 * s2 * r2), 2 * (s3 + 2 * s4 * r2)
    along_x, along_y = along_x + x * prism_x, along_y + y * prism_y
    return value, np.stack([along_x, cross + y * prism_x, cross + x * prism_y, along_y])


def _coefficients(dist: ArrayLike) -> list[float]:
    """The twelve of the model, without the tilt; those that a shorter one lacks are 0."""
    given = np.ravel(np.asarray(dist, float))[:12].tolist()
    return [*given, *[0.0] * (12 - len(given))]


def _image(x: Float64, y: Float64, coefficients: list[float]) -> tuple[Float64, Float64, Float64, Float64 | float]:
    """The lens's image (N, 2) of ideal coordinates, and ``r2``, ``g`` and the divisor of `distort`, each (N,)."""
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = coefficients
    r2 = x * x + y * y
    g: Float64 = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    under: Float64 | float = 1.0
    if k4 or k5 or k6:  # most lenses have none of these, and no prism: what is zero need not be computed
        under = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
        g = g / under
    xd = x * g + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    yd = y * g + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    if s1 or s2 or s3 or s4:
        xd, yd = xd + r2 * (s1 + s2 * r2), yd + r2 * (s3 + s4 * r2)
    return np.column_stack([xd, yd]), r2, g, under


def _in_parts(rows: Float64) -> list[Float64]:
    """Rows (N, 2) in parts, N of 0 too, that stay in a processor's cache while they are worked on."""
    return np.array_split(rows, max(1, -(-len(rows) // _AT_ONCE)))


def _newton(target: Float64, dist: Float64, limit: float) -> Float64:
    """Ideal coordinates of targets by Newton's whole steps, kept within a circle, (N, 2)."""
    xy = _within(target, _START_INSIDE * limit)
    for _ in range(_NEWTON_STEPS):
        step = _newton_step(*distort(xy, dist), target)
        xy = _within(xy - step, limit)
        if np.abs(step).max(initial=0.0) < _SETTLED:
            break
    return xy


def _newton_step(value: Float64, jacobian: Float64, target: Float64) -> Float64:
    """By how much ideal coordinates, with their image and Jacobian, are off their target by a linear lens, (N, 2)."""
    determinant = jacobian[0] * jacobian[3] - jacobian[1] * jacobian[2]
    determinant = np.where(np.abs(determinant) < _LEAST_DETERMINANT, _LEAST_DETERMINANT, determinant)
    ex, ey = (value - target).T
    step = np.stack([jacobian[3] * ex - jacobian[1] * ey, jacobian[0] * ey - jacobian[2] * ex], 1)
    return np.asarray(step / determinant[:, None])


def _within(xy: Float64, limit: float) -> Float64:
    """Ideal coordinates, those beyond a circle drawn in to it, (N, 2)."""
    return np.asarray(xy * np.minimum(1.0, limit / np.maximum(np.hypot(*xy.T), 1e-12))[:, None])


def _damped(target: Float64, dist: Float64, limit: float) -> Float64:
    """Ideal coordinates of targets by Newton's steps, each halved until it leads nearer, (N, 2)."""
    xy = _within(target, _START_INSIDE * min(limit, 1.0))
    value, jacobian = distort(xy, dist)
    share = np.ones(len(xy))
    for _ in range(_DAMPED_STEPS):
        there = _within(xy - share[:, None] * _newton_step(value, jacobian, target), limit)
        value_there, jacobian_there = distort(there, dist)
        nearer = np.hypot(*(value_there - target).T) < np.hypot(*(value - target).T)
        xy, value = (np.where(nearer[:, None], new, old) for new, old in ((there, xy), (value_there, value)))
        jacobian = np.where(nearer, jacobian_there, jacobian)
        share = np.where(nearer, np.minimum(2 * share, 1.0), share / 2)
    return xy


def _at_fold(target: Float64, dist: Float64, limit: float) -> Float64:
    """Ideal coordinates on the fold circle whose image is nearest to targets beyond it; steepest descent. (N, 2)."""
    xy: Float64 = target * (limit / np.hypot(*target.T))[:, None]
    for _ in range(_DESCENT_STEPS):
        value, jacobian = distort(xy, dist)
        ex, ey = (value - target).T
        xy = xy - _DESCENT * np.stack([jacobian[0] * ex + jacobian[2] * ey, jacobian[1] * ex + jacobian[3] * ey], 1)
        xy *= (limit / np.hypot(*xy.T))[:, None]
    return xy


def _tilted(xy: Float64, dist: Float64, *, inverse: bool = False) -> Float64:
    """The tilted-sensor homography of the 14-coefficient model (OpenCV's ``computeTiltProjectionMatrix``)."""
    if dist.size < 14 or not dist[12:].any():
        return xy
    cx, cy = np.cos(dist[12:])
    sx, sy = np.sin(dist[12:])
    turn = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]]) @ np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    H = np.array([[turn[2, 2], 0, -turn[0, 2]], [0, turn[2, 2], -turn[1, 2]], [0, 0, 1]]) @ turn
    xyw = np.column_stack([xy, np.ones(len(xy))]) @ (np.linalg.inv(H) if inverse else H).T
    return np.asarray(xyw[:, :2] / xyw[:, 2:])
