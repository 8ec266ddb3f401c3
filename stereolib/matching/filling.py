"""Filling and smoothing of disparity maps that looks further than a kernel: at the row, the picture, the other view."""

from __future__ import annotations

from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Float32, Float64, Floats, UInt8
from stereolib.matching.sgbm import STEPS_PER_PX
from stereolib.rig import to_grey

Columns: TypeAlias = npt.NDArray[np.int32]
#: Methods of `inpaint`, with OpenCV's flags.
SOLVERS = {"telea": cv2.INPAINT_TELEA, "navier_stokes": cv2.INPAINT_NS, "biharmonic": -1}  # the last is no flag
_SPECKLE_RANGE_PX = 1.0  # neighbours that differ by no more are one patch
_HOLE = -32768  # of 16 bits, in OpenCV's search for specks
_GREY_STEP = 10.0  # grey levels: steps of the picture clearly above it separate
_ROUNDS = 3  # of the least squares solution, along rows and columns in turn


def check_map(disparity_px: npt.ArrayLike, size_px: float = 1) -> tuple[Float32, int]:
    """Refuse what is no disparity map, or no kernel.

    Parameters
    ----------
    disparity_px : (H, W) array_like, px
    size_px : int
        The kernel's edge.

    Returns
    -------
    disparity_px : (H, W) float32, px
    size_px : int

    Raises
    ------
    ValueError
        If the map has another shape, is empty or infinite somewhere, or the edge is no odd whole number from 1 on.
    """
    disparity = np.ascontiguousarray(disparity_px, np.float32)  # OpenCV's filters of 16 bits take no other
    if np.ndim(disparity_px) != 2 or disparity.size == 0:
        raise ValueError(f"expected a disparity map of shape (H, W), got {np.shape(disparity_px)}")
    if np.isinf(disparity).any():
        raise ValueError("the map has infinite disparities: NaN is a hole")
    if size_px < 1 or size_px % 2 == 0 or int(size_px) != size_px:
        raise ValueError(f"the kernel's edge must be an odd whole number of pixels from 1 on, got {size_px}")
    return disparity, int(size_px)


def remove_speckles(disparity_px: npt.ArrayLike, size_px: int) -> Float32:
    """Make holes of patches of fewer than ``size_px ** 2`` pixels; neighbours within 1 px are one patch.

    Parameters
    ----------
    disparity_px : (H, W) float, px, NaN is a hole
    size_px : int
        Odd edge of the largest square that goes.

    Returns
    -------
    (H, W) float32, px

    Raises
    ------
    ValueError
        If the map or the edge is none, or a disparity is 2047 px or more, which 16 bits do not hold.
    """
    disparity, size = check_map(disparity_px, size_px)
    valid = np.isfinite(disparity)
    if np.abs(disparity[valid]).max(initial=0) >= 2047:
        raise ValueError("speckles are looked for in steps of 1/16 px in 16 bits: disparities must be below 2047 px")
    steps = np.where(valid, np.rint(np.nan_to_num(disparity) * STEPS_PER_PX), _HOLE).astype(np.int16)
    kept, _ = cv2.filterSpeckles(steps, _HOLE, size * size - 1, round(STEPS_PER_PX * _SPECKLE_RANGE_PX))[:2]
    return np.where(kept == _HOLE, np.float32(np.nan), disparity)


def fill_background(disparity_px: npt.ArrayLike) -> Float32:
    """Fill holes with the smaller of the nearest valid disparities left and right in their row.

    What one camera alone sees lies behind what hides it from the other, so the farther neighbour is the better guess.
    Rows without any valid disparity take that of the row above or below, likewise.

    Parameters
    ----------
    disparity_px : (H, W) float, px, NaN is a hole

    Returns
    -------
    (H, W) float32, px
        NaN only if nothing was valid at all.

    Raises
    ------
    ValueError
        If the map is none.

    Examples
    --------
    >>> fill_background([[np.nan, 5, np.nan, 3]])
    array([[5., 5., 3., 3.]], dtype=float32)
    """
    disparity, _ = check_map(disparity_px)
    rows: Float32 = np.fmin(*neighbours(disparity))
    if not np.isnan(rows).any():
        return rows
    above, below = (side.T for side in neighbours(rows.T))
    return np.where(np.isnan(rows), np.fmin(above, below), rows)


def neighbours(disparity_px: Float32, nearest: tuple[Columns, Columns] | None = None) -> tuple[Float32, Float32]:
    """Find each pixel's nearest valid disparities in its row.

    Parameters
    ----------
    disparity_px : (H, W) float32, px, NaN is a hole
    nearest : (H, W) int32, (H, W) int32, optional
        Of `nearest_columns`, if they are known.

    Returns
    -------
    before, after : (H, W) float32, px
        At or left of the pixel, and at or right of it; NaN where there is none.
    """
    before, after = nearest or nearest_columns(disparity_px)
    flat, start = disparity_px.ravel(), np.arange(0, disparity_px.size, disparity_px.shape[1], dtype=np.int32)[:, None]
    # where there is none, the outermost pixel is a hole
    return flat.take(np.maximum(before, 0) + start), flat.take(np.minimum(after, before.shape[1] - 1) + start)


def nearest_columns(disparity_px: Float32) -> tuple[Columns, Columns]:
    """Find the columns of each pixel's nearest valid disparities in its row.

    Parameters
    ----------
    disparity_px : (H, W) float32, px, NaN is a hole

    Returns
    -------
    before, after : (H, W) int32
        At or left of the pixel, and at or right of it; -1 and W where there is none.
    """
    width, columns = np.int32(disparity_px.shape[1]), np.arange(disparity_px.shape[1], dtype=np.int32)
    hole = np.isnan(disparity_px)
    before = np.maximum.accumulate(np.where(hole, np.int32(-1), columns), axis=1)
    return before, np.minimum.accumulate(np.where(hole, width, columns)[:, ::-1], axis=1)[:, ::-1]


def inpaint(disparity_px: npt.ArrayLike, size_px: int = 5, *, method: str = "telea") -> Float32:
    """Continue holes from their rim.

    Parameters
    ----------
    disparity_px : (H, W) float, px, NaN is a hole
    size_px : int
        Odd edge of the neighbourhood of OpenCV's methods; the biharmonic one has none.
    method : {"telea", "navier_stokes", "biharmonic"}
        `cv2.inpaint` twice (Telea's does not stay level in a large hole even where all around it is), and
        `skimage.restoration.inpaint_biharmonic` (slow: a linear system over all holes).

    Returns
    -------
    (H, W) float32, px

    Raises
    ------
    ValueError
        If the map or the edge is none, or the method is unknown.
    """
    disparity, size = check_map(disparity_px, size_px)
    if method not in SOLVERS:
        raise ValueError(f"unknown method {method!r}; choose one of {', '.join(SOLVERS)}")
    hole = np.isnan(disparity)
    if hole.all() or not hole.any():
        return disparity.copy()
    if method != "biharmonic":
        filled = cv2.inpaint(np.nan_to_num(disparity), hole.astype(np.uint8), max(size // 2, 1), SOLVERS[method])
        return np.where(hole, filled, disparity)
    from skimage.restoration import inpaint_biharmonic

    low, high = np.nanmin(disparity), np.nanmax(disparity)
    unit = np.nan_to_num((disparity - low) / np.maximum(high - low, 1e-6)).astype(np.float64)
    filled = low + inpaint_biharmonic(unit, hole, split_into_regions=True) * (high - low)
    return np.where(hole, filled, disparity).astype(np.float32)


def weighted_median(disparity_px: npt.ArrayLike, image: UInt8, size_px: int = 15) -> Float32:
    """Take the median of the valid disparities around a pixel, those that look like it in the picture counting more.

    Parameters
    ----------
    disparity_px : (H, W) float, px, NaN is a hole
    image : (H, W) or (H, W, 3) uint8
        The rectified left picture.
    size_px : int
        Odd edge of the window.

    Returns
    -------
    (H, W) float32, px

    Raises
    ------
    ValueError
        If the map or the edge is none, or the picture is no uint8 of the map's shape.

    Notes
    -----
    The weights are a guided filter's, applied to one layer ``d <= k`` a pixel of disparity; where a layer passes one
    half is the median, taken as the mean of the layer's values (Ma et al., Constant time weighted median filtering,
    doi:10.1109/ICCV.2013.13).
    """
    disparity, size = check_map(disparity_px, size_px)
    guide = _guide(disparity, image)
    box = (size, size)
    mean = cv2.blur(guide, box)
    variance = cv2.blur(guide * guide, box) - mean * mean + np.float32(_GREY_STEP**2)

    def guided(layer: Float32) -> Any:
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


def least_squares(disparity_px: npt.ArrayLike, image: UInt8, size_px: int = 15) -> Float32:
    """Find the map nearest to the valid disparities that is smooth except across edges of the picture.

    Parameters
    ----------
    disparity_px : (H, W) float, px, NaN is a hole
    image : (H, W) or (H, W, 3) uint8
        The rectified left picture.
    size_px : int
        Reach on a surface without edges, about the width over which it averages.

    Returns
    -------
    (H, W) float32, px

    Raises
    ------
    ValueError
        As `weighted_median`.

    Notes
    -----
    ``min_u sum_p c_p (u_p - d_p)^2 + lambda sum_pq exp(-|I_p - I_q| / 10) (u_p - u_q)^2``, c = 1 where valid,
    solved along rows and columns in turn (Min et al., Fast global image smoothing, doi:10.1109/TIP.2014.2366600);
    ``lambda = size_px^2 / 4``.
    """
    disparity, size = check_map(disparity_px, size_px)
    guide, valid = _guide(disparity, image), np.isfinite(disparity)
    if not valid.any():
        return disparity.copy()
    couple = [np.exp(-np.abs(np.diff(guide, axis=axis)) / np.float32(_GREY_STEP)) for axis in (0, 1)]
    u = np.stack([np.nan_to_num(disparity), valid.astype(np.float32)]).astype(np.float64)
    for k in range(_ROUNDS):
        strength = 3 * size**2 / 4 * 4 ** (_ROUNDS - 1 - k) / (4**_ROUNDS - 1)
        u = _tridiagonal(u, strength * couple[0])
        u = _tridiagonal(u.transpose(0, 2, 1), strength * couple[1].T).transpose(0, 2, 1)
    return np.where(u[1] > 1e-9, u[0] / np.maximum(u[1], 1e-9), np.nan).astype(np.float32)


def _tridiagonal(right: Float64, weight: Floats) -> Float64:
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


def _guide(disparity: Float32, image: Any) -> Float32:
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8:
        kind = getattr(image, "dtype", type(image).__name__)
        raise ValueError(f"this method is guided by the rectified left picture: pass image=, uint8; got {kind}")
    if image.shape[:2] != disparity.shape:
        raise ValueError(f"the picture has shape {image.shape[:2]}, the disparity map {disparity.shape}")
    return to_grey(image).astype(np.float32)
