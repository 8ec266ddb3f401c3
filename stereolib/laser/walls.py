"""Straight walls in a laser scan: total least squares, made robust."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from stereolib.base import Bools, Float64

_REFITS = 50  # a line settles within a few; this stops one that swings between two sets of points
_LEAST_EXTENT = 1e-9  # of the points' coordinates: nearer to each other they differ by rounding alone
_TRIALS = 500  # random pairs per wall: a wall with a fifth of the points is missed once in 1e9 times


@dataclass(frozen=True, eq=False)
class Wall:
    """A line ``normal @ p = offset_mm`` through some of the points.

    Attributes
    ----------
    normal : (2,) float64
        Unit normal, pointing away from the origin.
    offset_mm : float
        Distance of the line from the origin, mm, >= 0.
    inliers : (N,) bool
        The points taken to lie on it.
    residuals_mm : (N,) float64
        Signed distance of every point to the line, mm.
    """

    normal: Float64
    offset_mm: float
    inliers: Bools
    residuals_mm: Float64

    @property
    def rms_mm(self) -> float:
        """Root mean square distance of the inliers to the line, mm."""
        return float(np.sqrt(np.mean(self.residuals_mm[self.inliers] ** 2)))


def _checked(points: ArrayLike, least: int) -> Float64:
    p = np.asarray(points, np.float64)
    if p.ndim != 2 or p.shape[1] != 2 or np.isfinite(p).all(axis=1).sum() < least:
        got = f"got shape {p.shape} with {np.isfinite(p).sum() // 2} finite; average more turns or widen the gate"
        raise ValueError(f"a line fit needs at least {least} finite points of shape (N, 2), {got}")
    return p


def _wall(p: Float64, inliers: Bools) -> Wall:
    """Total least squares."""
    centre = p[inliers].mean(axis=0)
    _, extents, directions = np.linalg.svd(p[inliers] - centre, full_matrices=False)
    if not extents[0] > _LEAST_EXTENT * np.abs(p[inliers]).max():
        at = f"({centre[0]:g}, {centre[1]:g}) mm"
        raise ValueError(f"all {inliers.sum()} points lie at {at}, through which any line goes: give more of the wall")
    normal = directions[1]
    offset = float(normal @ centre)
    normal, offset = (normal, offset) if offset >= 0 else (-normal, -offset)
    return Wall(normal, offset, inliers, p @ normal - offset)


def fit_line(points: ArrayLike, threshold_mm: float = np.inf, start: Wall | None = None) -> Wall:
    """Fit a straight line by total least squares, leaving out points that lie off it.

    Minimises the squared distances at right angles to the line, then drops points farther than
    the threshold and repeats until nothing changes (at most 50 times).

    Parameters
    ----------
    points : (N, 2) array_like, mm
        NaN rows are ignored.
    threshold_mm : float
        Largest distance of an inlier; infinite: every point counts.
    start : Wall, optional
        Line to start from, instead of the one through all points.

    Returns
    -------
    Wall

    Raises
    ------
    ValueError
        If there are fewer than two finite points, or fewer than two near the line, or all of them at one place.

    Examples
    --------
    >>> line = fit_line([[500, -100], [500, 0], [500, 200], [700, 50]], threshold_mm=100)
    >>> round(line.offset_mm, 6), line.inliers
    (500.0, array([ True,  True,  True, False]))
    """
    p = _checked(points, 2)
    finite = np.asarray(np.isfinite(p).all(axis=1))
    wall = start if start is not None else _wall(p, finite)
    for _ in range(_REFITS):
        near = finite & (np.abs(p @ wall.normal - wall.offset_mm) <= threshold_mm)
        if near.sum() < 2:
            raise ValueError(f"fewer than two points lie within {threshold_mm:g} mm of the line; raise threshold_mm")
        again = _wall(p, near)
        if np.array_equal(near, wall.inliers):
            return again
        wall = again
    return wall


def fit_walls(
    points: ArrayLike,
    count: int = 4,
    *,
    threshold_mm: float = 4.0,
    min_length_mm: float = 60.0,
    rng: np.random.Generator,
) -> list[Wall]:
    """Fit the walls of a room, the one with the most points first.

    Parameters
    ----------
    points : (N, 2) array_like, mm
        From `points_mm`; NaN rows are ignored.
    count : int
        Number of walls.
    threshold_mm : float
        Largest distance of a wall's point to it, mm.
    min_length_mm : float
        Pairs of points nearer to each other than this are not tried: they point anywhere.
    rng : numpy.random.Generator
        Draws the pairs of points.

    Returns
    -------
    list of Wall

    Raises
    ------
    ValueError
        If the number is less than 1, or the points run out before `count` walls are found.

    Notes
    -----
    One wall after the other: lines through random pairs of the points left (RANSAC), the best one
    refined with `fit_line`, its points taken away. At last each point goes to its nearest wall,
    so that corners are shared out fairly, and every wall is fitted again.

    Examples
    --------
    >>> t = np.linspace(-500, 500, 50)
    >>> points = np.concatenate([np.stack([0 * t + 800, t], 1), np.stack([t, 0 * t - 600], 1)])
    >>> [round(wall.offset_mm) for wall in fit_walls(points, 2, rng=np.random.default_rng(0))]
    [800, 600]
    """
    if count < 1:
        raise ValueError(f"count must be 1 wall or more, got {count}")
    p = _checked(points, 2 * count)
    free = np.asarray(np.isfinite(p).all(axis=1))
    walls: list[Wall] = []
    for k in range(count):
        if len(left := p[free]) < 2:
            raise ValueError(f"only {k} of {count} walls found: no points left; ask for fewer")
        a, b = left[rng.integers(len(left), size=(2, _TRIALS))]
        length = np.hypot(*(b - a).T)
        a, along, length = (v[length > min_length_mm] for v in (a, b - a, length))
        if not len(a):
            why = f"the points left are closer together than min_length_mm = {min_length_mm:g}"
            raise ValueError(f"only {k} of {count} walls found: {why}; ask for fewer")
        normals = np.stack([-along[:, 1], along[:, 0]], axis=1) / length[:, None]
        distances = np.abs(left @ normals.T - np.sum(a * normals, axis=1))
        k_best = int((distances <= threshold_mm).sum(axis=0).argmax())
        normal, offset = normals[k_best], float(a[k_best] @ normals[k_best])
        start = Wall(normal, offset, np.zeros(len(p), bool), p @ normal - offset)
        walls.append(fit_line(np.where(free[:, None], p, np.nan), threshold_mm, start))
        free &= ~walls[-1].inliers
    gaps = np.abs(np.stack([w.residuals_mm for w in walls]))
    nearest = np.where(np.isfinite(gaps), gaps, np.inf).argmin(axis=0)
    shared = [_wall(p, (nearest == k) & (gaps[k] <= threshold_mm)) for k in range(count)]
    return sorted(shared, key=lambda w: -int(w.inliers.sum()))
