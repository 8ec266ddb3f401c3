"""Dilation of disparity maps (section II.D) and its nearest rivals, one signature."""

from __future__ import annotations

import warnings

import cv2
import numpy as np

Array = np.ndarray
_SHAPES = {"rect": cv2.MORPH_RECT, "ellipse": cv2.MORPH_ELLIPSE, "cross": cv2.MORPH_CROSS}


def dilate(disparity_px: Array, size_px: int, *, shape: str = "rect") -> Array:
    """Grey dilation: every pixel takes the largest disparity under the kernel.

    Parameters
    ----------
    disparity_px : (H, W) float, NaN where invalid
    size_px : int
        Odd edge of the kernel; 1 changes nothing.
    shape : {"rect", "ellipse", "cross"}

    Returns
    -------
    (H, W) float32, NaN only where the kernel met no valid pixel

    Raises
    ------
    ValueError

    Notes
    -----
    ``out(p) = max_{b in B} d(p + b)``. The paper prints the set operation ``union of A_b`` (section II.D), which is
    defined for binary images; for grey values its counterpart is this maximum, and it grows near objects by the
    kernel's radius on every side.
    """
    return _morphology(cv2.MORPH_DILATE, disparity_px, size_px, shape)


def dilate_set(pixels: Array, size_px: int, *, shape: str = "rect") -> Array:
    """Dilation of a set of pixels, as section II.D prints it: the union of its translates over the kernel.

    Parameters
    ----------
    pixels : (H, W) bool
        The set A.
    size_px : int
        Odd edge of the kernel B, centred on the origin.
    shape : {"rect", "ellipse", "cross"}

    Returns
    -------
    (H, W) bool
        ``A + B = union over b in B of A_b``, cut at the image's border. Written literally: `dilate` is the fast one.

    Raises
    ------
    ValueError
    """
    if np.asarray(pixels).dtype != bool or np.ndim(pixels) != 2:
        raise ValueError("the set operation needs a set: a mask (H, W) of bool, for example disparity_px >= 90")
    size, (height, width) = _checked(np.zeros((1, 1)), size_px)[1], pixels.shape
    r = size // 2
    roomy, grown = np.pad(pixels, r), np.zeros_like(pixels)
    for row, column in np.argwhere(_kernel(shape, size)):
        grown |= roomy[row : row + height, column : column + width]
    return grown


def close(disparity_px: Array, size_px: int, *, shape: str = "rect") -> Array:
    """Grey closing, dilation then erosion: fills holes as dilation does and gives the outlines back."""
    return _morphology(cv2.MORPH_CLOSE, disparity_px, size_px, shape)


def median(disparity_px: Array, size_px: int) -> Array:
    """Median of the valid disparities under a square kernel; NaN where the kernel met none."""
    from scipy.ndimage import vectorized_filter

    disparity, size = _checked(disparity_px, size_px)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "All-NaN slice", RuntimeWarning)  # NaN is the answer there
        out = vectorized_filter(disparity, np.nanmedian, size=(size, size), mode="constant", cval=np.nan)
    return np.asarray(out, np.float32)


def _morphology(operation: int, disparity_px: Array, size_px: int, shape: str) -> Array:
    disparity, size = _checked(disparity_px, size_px)
    kernel = _kernel(shape, size)
    low = np.float32(-1e9)
    out = cv2.morphologyEx(np.where(np.isnan(disparity), low, disparity), operation, kernel)
    return np.where(out == low, np.float32(np.nan), out)


def _kernel(shape: str, size: int) -> Array:
    if shape not in _SHAPES:
        raise ValueError(f"unknown kernel shape {shape!r}; choose one of {', '.join(_SHAPES)}")
    return np.asarray(cv2.getStructuringElement(_SHAPES[shape], (size, size)))


def _checked(disparity_px: Array, size_px: int) -> tuple[Array, int]:
    disparity = np.asarray(disparity_px, np.float32)
    if disparity.ndim != 2 or disparity.size == 0:
        raise ValueError(f"expected a disparity map of shape (H, W), got {disparity.shape}")
    if size_px < 1 or size_px % 2 == 0 or int(size_px) != size_px:
        raise ValueError(f"the kernel's edge must be an odd whole number of pixels from 1 on, got {size_px}")
    return disparity, int(size_px)
