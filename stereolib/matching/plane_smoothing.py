"""Smoothing of a dense disparity map by the planes that fit in windows, the flattest of which count most."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Float32
from stereolib.matching.filling import check_map

_MOST_ROUGH_PX2 = 100.0  # beyond, windows weigh alike: sums of far smaller weights would be lost beside flat ones


def smooth_by_planes(
    disparity_px: npt.ArrayLike,
    detail: npt.ArrayLike | None = None,
    *,
    size_px: int = 17,
    rough_px: float = 0.2,
    most_px: float = 1.0,
    half_detail: float = 8.0,
) -> Float32:
    """Move each disparity towards the planes of the windows that hold it, of the flat ones more than of others.

    A pixel beside a step lies in windows that do not reach across it, and takes their planes: noise on a surface goes,
    however steep it is, and steps stay. Where the picture shows much detail, disparities are sure and the relief that
    they have is real: there they move less.

    Parameters
    ----------
    disparity_px : (H, W) float, px
        Dense.
    detail : (H, W) float, optional
        As `EvenPair.detail` tells it, 0 or more; None: none anywhere.
    size_px : int
        Odd edge of the windows; as much of it as the map has.
    rough_px : float, px
        Deviations from its plane up to about so much are not held against a window.
    most_px : float, px
        Where there is no detail, planes this far off move the disparity by half of that, the most there is; farther
        ones are another surface's and move it less.
    half_detail : float
        Root of the detail at which that is half-way to `rough_px`, where it ends. All four were chosen on virtual
        scenes by `benchmarks/choose_best.py`.

    Returns
    -------
    (H, W) float32, px

    Raises
    ------
    ValueError
        If the map or the edge is none, a disparity is no number, a limit is not positive, `most_px` is below
        `rough_px`, or the detail differs from the map in shape or has a value below 0 or none.

    Notes
    -----
    In every window W that lies in the map ``d = a + b x + c y`` is fitted by least squares; v is the mean square that
    it leaves, at most 100 px^2. With ``q = (v + rough^2)^-3`` a pixel's planes give
    ``s = sum_W q (a + b x + c y) / sum_W q``, over the windows that hold it, and it becomes
    ``d + (s - d) / (1 + ((s - d) / m)^2)`` with ``m = rough + (most - rough) / (1 + detail / half_detail^2)``. All sums
    are box filters.

    Examples
    --------
    >>> wall = np.tile(np.linspace(10, 14, 41, dtype=np.float32), (41, 1))
    >>> wall[:, 20:] += 20
    >>> noisy = wall + np.random.default_rng(0).normal(0, 0.3, wall.shape)
    >>> [round(float(np.abs(one - wall).mean()), 2) for one in (noisy, smooth_by_planes(noisy))]
    [0.24, 0.04]
    """
    disparity, size = check_map(disparity_px, size_px)
    if not np.isfinite(disparity).all():
        raise ValueError("planes are laid through a dense map: fill its holes first")
    if not (0 < rough_px <= most_px < np.inf and half_detail > 0):
        raise ValueError(f"need 0 < rough_px <= most_px and half_detail > 0; got {rough_px}, {most_px}, {half_detail}")
    sure = np.zeros(disparity.shape, np.float32) if detail is None else np.asarray(detail, np.float32)
    if sure.shape != disparity.shape:
        raise ValueError(f"the detail has shape {sure.shape}, the disparity map {disparity.shape}")
    if not (sure >= 0).all():
        raise ValueError("the detail is 0 or more at every pixel")
    rows, columns = (min(size, (n - 1) // 2 * 2 + 1) for n in disparity.shape)
    x, y = (np.arange(n, dtype=np.float32) - np.float32(n / 2) for n in disparity.shape[::-1])
    y = y[:, None]
    near_px = disparity - np.median(disparity)  # of small numbers 32 bits hold the squares
    level = _mean(near_px, rows, columns)
    along, down = _slope(near_px, rows, columns), _slope(near_px.T, columns, rows).T
    left_over = _mean(near_px * near_px, rows, columns) - level * level
    left_over -= along * along * np.float32((columns**2 - 1) / 12) + down * down * np.float32((rows**2 - 1) / 12)
    flat = left_over.clip(0, _MOST_ROUGH_PX2) + np.float32(rough_px**2)
    weight = np.zeros_like(flat)
    inside = np.s_[rows // 2 : len(flat) - rows // 2, columns // 2 : flat.shape[1] - columns // 2]
    weight[inside] = 1 / (flat * flat * flat)[inside]
    parts = weight, weight * (level - along * x - down * y), weight * along, weight * down
    total, level, along, down = (_mean(part, rows, columns) for part in parts)
    off = (level + along * x + down * y) / total - near_px
    most = np.float32(rough_px) + np.float32(most_px - rough_px) / (1 + sure / np.float32(half_detail**2))
    return np.asarray(disparity + off / (1 + (off / most) ** 2))


def _mean(values: Float32, rows: int, columns: int) -> Float32:
    """Over the window around each pixel; there is nothing beyond the map."""
    return np.asarray(cv2.boxFilter(values, -1, (columns, rows), borderType=cv2.BORDER_CONSTANT))


def _slope(values: Float32, rows: int, columns: int) -> Float32:
    """By how much the plane of the window around each pixel rises from column to column."""
    place = np.arange(columns, dtype=np.float32) - columns // 2
    kernel = place / max(float(place @ place), 1.0)
    every = np.full(rows, 1 / rows, np.float32)
    return np.asarray(cv2.sepFilter2D(values, cv2.CV_32F, kernel, every, borderType=cv2.BORDER_CONSTANT))
