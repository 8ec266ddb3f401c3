"""Filling and smoothing of disparity maps that looks further than a kernel: at the row, the picture, the other view."""

from __future__ import annotations

import cv2
import numpy as np

from stereolib.matching.disparity import left_right_check
from stereolib.rig import to_grey

Array = np.ndarray
_SOLVERS = ("telea", "navier_stokes", "biharmonic")


def checked(disparity_px: Array, size_px: int = 1) -> tuple[Array, int]:
    """A map as (H, W) float32 and an odd kernel's edge; ValueError for anything else."""
    disparity = np.asarray(disparity_px, np.float32)
    if disparity.ndim != 2 or disparity.size == 0:
        raise ValueError(f"expected a disparity map of shape (H, W), got {disparity.shape}")
    if size_px < 1 or size_px % 2 == 0 or int(size_px) != size_px:
        raise ValueError(f"the kernel's edge must be an odd whole number of pixels from 1 on, got {size_px}")
    return disparity, int(size_px)


def remove_speckles(disparity_px: Array, size_px: int, *, range_px: float = 1.0) -> Array:
    """Patches of fewer than ``size_px ** 2`` pixels become holes; neighbours within `range_px` are one patch."""
    disparity, size = checked(disparity_px, size_px)
    valid = np.isfinite(disparity)
    if disparity[valid].size and np.abs(disparity[valid]).max() >= 2047:
        raise ValueError("speckles are looked for in steps of 1/16 px in 16 bits: disparities must be below 2047 px")
    steps = np.where(valid, np.rint(np.nan_to_num(disparity) * 16), -32768).astype(np.int16)
    kept, _ = cv2.filterSpeckles(steps, -32768, size * size - 1, round(16 * range_px))[:2]
    return np.where(kept == -32768, np.float32(np.nan), disparity)


def fill_background(disparity_px: Array) -> Array:
    """Holes take the smaller of the nearest valid disparities left and right in their row, then the row above or below.

    What one camera alone sees lies behind what hides it from the other, so the farther neighbour is the better guess.
    NaN is left only if nothing was valid at all.
    """
    disparity, _ = checked(disparity_px)
    rows = np.fmin(*neighbours(disparity))
    if not np.isnan(rows).any():
        return rows
    above, below = (side.T for side in neighbours(rows.T))
    return np.where(np.isnan(rows), np.fmin(above, below), rows)


def neighbours(disparity_px: Array) -> tuple[Array, Array]:
    """The nearest valid disparity at or left of each pixel, and at or right of it; NaN where there is none."""
    return _last_valid(disparity_px), _last_valid(disparity_px[:, ::-1])[:, ::-1]


def left_right(disparity_px: Array, right_px: Array, *, tolerance_px: float = 1.0) -> Array:
    """Left-right check, then background fill.

    Parameters
    ----------
    disparity_px, right_px : (H, W) float, px
        Disparity of the left and of the right view.

    Raises
    ------
    ValueError
    """
    disparity, _ = checked(disparity_px)
    if np.shape(right_px) != disparity.shape:
        raise ValueError(f"the right view's map has shape {np.shape(right_px)}, the left one's {disparity.shape}")
    return fill_background(left_right_check(disparity, np.asarray(right_px, np.float32), tolerance_px))


def inpaint(disparity_px: Array, size_px: int = 5, *, method: str = "telea") -> Array:
    """Holes continued from their rim.

    Parameters
    ----------
    disparity_px : (H, W) float, NaN is a hole
    size_px : int
        Odd edge of the neighbourhood of OpenCV's methods; the biharmonic one has none.
    method : {"telea", "navier_stokes", "biharmonic"}
        `cv2.inpaint` twice, and `skimage.restoration.inpaint_biharmonic` (slow: a linear system over all holes).

    Raises
    ------
    ValueError
    """
    disparity, size = checked(disparity_px, size_px)
    hole = np.isnan(disparity)
    if method not in _SOLVERS:
        raise ValueError(f"unknown method {method!r}; choose one of {', '.join(_SOLVERS)}")
    if hole.all() or not hole.any():
        return disparity.copy()
    if method == "biharmonic":
        from skimage.restoration import inpaint_biharmonic

        low, high = np.nanmin(disparity), np.nanmax(disparity)
        unit = np.nan_to_num((disparity - low) / max(high - low, 1e-6)).astype(np.float64)
        found = low + inpaint_biharmonic(unit, hole, split_into_regions=True) * (high - low)
    else:
        flag = cv2.INPAINT_TELEA if method == "telea" else cv2.INPAINT_NS
        found = cv2.inpaint(np.nan_to_num(disparity), hole.astype(np.uint8), max(size // 2, 1), flag)
    return np.where(hole, found, disparity).astype(np.float32)


def weighted_median(disparity_px: Array, image: Array, size_px: int = 15, *, grey_step: float = 10.0) -> Array:
    """Median of the valid disparities around a pixel, those that look like it in the picture counting more.

    Parameters
    ----------
    disparity_px : (H, W) float, NaN is a hole
    image : (H, W) or (H, W, 3) uint8
        The rectified left picture.
    size_px : int
        Odd edge of the window.
    grey_step : float
        Steps of the picture clearly above it separate.

    Notes
    -----
    The weights are a guided filter's, applied to one layer ``d <= k`` a pixel of disparity; where a layer passes one
    half is the median, taken as the mean of the layer's values (Ma et al., Constant time weighted median filtering,
    doi:10.1109/ICCV.2013.13).
    """
    disparity, size = checked(disparity_px, size_px)
    guide = _guide(disparity, image)
    box = (size, size)
    mean = cv2.blur(guide, box)
    variance = cv2.blur(guide * guide, box) - mean * mean + np.float32(grey_step**2)

    def guided(layer: Array) -> Array:
        level = cv2.blur(layer, box)
        slope = (cv2.blur(layer * guide, box) - level * mean) / variance
        return cv2.blur(slope, box) * guide + cv2.blur(level - slope * mean, box)

    valid = np.isfinite(disparity)
    if not valid.any():
        return disparity.copy()
    weight = np.maximum(guided(valid.astype(np.float32)), 1e-3)
    met = cv2.blur(valid.astype(np.float32), box) > 0
    out, filled = np.full_like(disparity, np.nan), np.nan_to_num(disparity)
    for k in np.arange(np.floor(disparity[valid].min()), np.ceil(disparity[valid].max()) + 1, dtype=np.float32):
        passed = np.isnan(out) & (guided((valid & (disparity <= k)).astype(np.float32)) >= 0.5 * weight) & met
        layer = (valid & (disparity > k - 1) & (disparity <= k)).astype(np.float32)
        count = cv2.blur(layer, box)
        mean_px = np.where(count > 1e-6, cv2.blur(layer * filled, box) / np.maximum(count, 1e-6), k - 0.5)
        out[passed] = mean_px[passed]
    return np.where(np.isnan(out) & met, disparity, out)


def least_squares(disparity_px: Array, image: Array, size_px: int = 15, *, grey_step: float = 10.0) -> Array:
    """The smooth map nearest to the valid disparities, smooth except across edges of the picture.

    Parameters
    ----------
    disparity_px, image : see `weighted_median`
    size_px : int
        Reach on a surface without edges, about the width over which it averages.
    grey_step : float
        Step of the picture at which neighbours are coupled by 1/e.

    Notes
    -----
    ``min_u sum_p c_p (u_p - d_p)^2 + lambda sum_pq exp(-|I_p - I_q| / grey_step) (u_p - u_q)^2``, c = 1 where valid,
    solved along rows and columns in turn (Min et al., Fast global image smoothing, doi:10.1109/TIP.2014.2366600);
    ``lambda = size_px^2 / 4``.
    """
    disparity, size = checked(disparity_px, size_px)
    guide, valid = _guide(disparity, image), np.isfinite(disparity)
    if not valid.any():
        return disparity.copy()
    couple = [np.exp(-np.abs(np.diff(guide, axis=axis)) / np.float32(grey_step)) for axis in (0, 1)]
    u = np.stack([np.nan_to_num(disparity), valid.astype(np.float32)]).astype(np.float64)
    rounds = 3
    for k in range(rounds):
        strength = 3 * size**2 / 4 * 4 ** (rounds - 1 - k) / (4**rounds - 1)
        u = _tridiagonal(u, strength * couple[0])
        u = _tridiagonal(u.transpose(0, 2, 1), strength * couple[1].T).transpose(0, 2, 1)
    return np.where(u[1] > 1e-9, u[0] / np.maximum(u[1], 1e-9), np.nan).astype(np.float32)


def _tridiagonal(right: Array, weight: Array) -> Array:
    """Solve ``u_i + sum_j w_ij (u_i - u_j) = right_i`` down the columns; right (2, N, M), weight (N-1, M)."""
    count = right.shape[1]
    edge = np.zeros((1, weight.shape[1]))
    up, down = np.concatenate([edge, weight]), np.concatenate([weight, edge])
    ratio, out = np.empty_like(up), np.empty_like(right)
    ratio[0], out[:, 0] = -down[0] / (1 + down[0]), right[:, 0] / (1 + down[0])
    for i in range(1, count):
        pivot = 1 + up[i] + down[i] + up[i] * ratio[i - 1]
        ratio[i] = -down[i] / pivot
        out[:, i] = (right[:, i] + up[i] * out[:, i - 1]) / pivot
    for i in range(count - 2, -1, -1):
        out[:, i] -= ratio[i] * out[:, i + 1]
    return out


def _guide(disparity: Array, image: Array) -> Array:
    if image is None or not isinstance(image, np.ndarray) or image.dtype != np.uint8:
        kind = getattr(image, "dtype", type(image).__name__)
        raise ValueError(f"this method is guided by the rectified left picture: pass image=, uint8; got {kind}")
    if image.shape[:2] != disparity.shape:
        raise ValueError(f"the picture has shape {image.shape[:2]}, the disparity map {disparity.shape}")
    return to_grey(image).astype(np.float32)


def _last_valid(values: Array) -> Array:
    columns = np.arange(values.shape[1], dtype=np.intp)
    where = np.maximum.accumulate(np.where(np.isnan(values), np.intp(-1), columns), axis=1)
    return np.where(where < 0, np.float32(np.nan), np.take_along_axis(values, np.maximum(where, 0), axis=1))
