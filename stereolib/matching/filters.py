"""Dilation of disparity maps (section II.D) and its rivals, one signature: ``smooth(disparity_px, method, ...)``."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Bools, Float32, Floats, UInt8
from stereolib.matching import filling
from stereolib.matching.disparity import left_right_check

_FAR, _NEAR = np.float32(-1e9), np.float32(1e9)  # px; stand for holes where OpenCV takes the largest or the least
_SHAPES = {"rect": cv2.MORPH_RECT, "ellipse": cv2.MORPH_ELLIPSE, "cross": cv2.MORPH_CROSS}


def dilate(disparity_px: npt.ArrayLike, size_px: int, *, shape: str = "rect") -> Float32:
    """Dilate a disparity map: every pixel takes the largest disparity under the kernel.

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
        If the map is none, the edge is not odd, or the shape is unknown.

    Notes
    -----
    ``out(p) = max_{b in B} d(p + b)``. The paper prints the set operation ``union of A_b`` (section II.D), which is
    defined for binary images; for grey values its counterpart is this maximum, and it grows near objects by the
    kernel's radius on every side.

    Examples
    --------
    >>> dilate([[np.nan, 3, np.nan, np.nan, 9, 2]], 3)
    array([[3., 3., 3., 9., 9., 9.]], dtype=float32)
    """
    return _morphology(cv2.MORPH_DILATE, disparity_px, size_px, shape)


def dilate_set(pixels: Bools, size_px: int, *, shape: str = "rect") -> Bools:
    """Dilate a set of pixels as section II.D prints it: the union of its translates over the kernel.

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
        If `pixels` is no mask, the edge is not odd, or the shape is unknown.

    Examples
    --------
    >>> dilate_set(np.array([[False, False, True, False]]), 3).astype(int)
    array([[0, 1, 1, 1]])
    """
    if np.asarray(pixels).dtype != bool or np.ndim(pixels) != 2:
        raise ValueError("the set operation needs a set: a mask (H, W) of bool, for example disparity_px >= 90")
    pixels = np.asarray(pixels)
    size, (height, width) = filling.check_map(np.zeros((1, 1)), size_px)[1], pixels.shape
    roomy, grown = np.pad(pixels, size // 2), np.zeros_like(pixels)
    for row, column in np.argwhere(_kernel(shape, size)):
        grown |= roomy[row : row + height, column : column + width]
    return grown


def close(disparity_px: npt.ArrayLike, size_px: int, *, shape: str = "rect") -> Float32:
    """Close a disparity map: dilation, which fills holes, then erosion, which gives the outlines back.

    Parameters
    ----------
    disparity_px, size_px, shape
        As `dilate`.

    Returns
    -------
    (H, W) float32, px
    """
    return _morphology(cv2.MORPH_CLOSE, disparity_px, size_px, shape)


def open_close(disparity_px: npt.ArrayLike, size_px: int) -> Float32:
    """Open a disparity map, then close it: small near specks go first, so that the closing does not spread them.

    A hole takes part in neither: the opening leaves out what is no value, then gives each pixel its own hole back.

    Parameters
    ----------
    disparity_px, size_px
        As `dilate`.

    Returns
    -------
    (H, W) float32, px
    """
    disparity, size = filling.check_map(disparity_px, size_px)
    kernel, hole = _kernel("rect", size), np.isnan(disparity)
    lowest = cv2.erode(np.where(hole, _NEAR, disparity), kernel)
    opened = cv2.dilate(np.where(lowest >= _NEAR, _FAR, lowest), kernel)
    return close(np.where(hole, np.float32(np.nan), opened), size)


def median_filter(disparity_px: npt.ArrayLike, size_px: int) -> Float32:
    """Take the median of the valid disparities under a square kernel.

    Parameters
    ----------
    disparity_px : (H, W) float, px, NaN is a hole
    size_px : int
        Odd edge of the kernel.

    Returns
    -------
    (H, W) float32, px
        NaN where the kernel met no valid disparity.

    Raises
    ------
    ValueError
        If the map is none or the edge is not odd.

    Examples
    --------
    >>> median_filter([[4, 90, 5, np.nan]], 3)
    array([[47. ,  5. , 47.5,  5. ]], dtype=float32)
    """
    disparity, size = filling.check_map(disparity_px, size_px)
    roomy = np.pad(np.where(np.isnan(disparity), np.float32(np.inf), disparity), size // 2, constant_values=np.inf)
    windows = np.lib.stride_tricks.sliding_window_view(roomy, (size, size))
    out = np.empty_like(disparity)
    for row, under in enumerate(windows):  # holes sort to the end
        values = np.sort(under.reshape(len(under), -1), axis=1)
        count = np.isfinite(values).sum(axis=1)
        middle = np.stack([np.maximum(count - 1, 0) // 2, count // 2], axis=1)
        both = np.take_along_axis(values, middle, axis=1)
        out[row] = np.where(count > 0, (both[:, 0] + both[:, 1]) / 2, np.nan)
    return out


def smooth(
    disparity_px: npt.ArrayLike,
    method: str,
    *,
    size_px: int = 9,
    image: UInt8 | None = None,
    right_px: Floats | None = None,
) -> Float32:
    """Repair a disparity map by a method's name.

    Parameters
    ----------
    disparity_px : (H, W) float, px, NaN is a hole
    method : str
        One of `SMOOTHING_METHODS`.
    size_px : int
        Odd edge of the kernel or window. Of ``"speckle"``: patches below ``size_px ** 2`` pixels go. Of
        ``"left_right"``: of the median at the end. ``"background"`` and ``"inpaint_biharmonic"`` have no kernel.
    image : (H, W) or (H, W, 3) uint8
        The rectified left picture, for ``"weighted_median"`` and ``"least_squares"``.
    right_px : (H, W) float, px
        The right view's disparity, for ``"left_right"``.

    Returns
    -------
    (H, W) float32, px

    Raises
    ------
    ValueError
        If the method is unknown (the text lists the names), lacks what it needs, shapes differ, or the kernel is larger
        than the map.

    Examples
    --------
    >>> smooth([[7, np.nan, 7], [np.nan, 7, 7]], "closing", size_px=1)
    array([[ 7., nan,  7.],
           [nan,  7.,  7.]], dtype=float32)
    """
    if method not in SMOOTHING_METHODS:
        raise ValueError(f"unknown method {method!r}; choose one of {', '.join(SMOOTHING_METHODS)}")
    disparity, size = filling.check_map(disparity_px, size_px)
    if method not in _NO_KERNEL and size > min(disparity.shape):
        why = f"every pixel would see all of it; take at most {min(disparity.shape)}"
        raise ValueError(f"a kernel of {size} px is larger than the map {disparity.shape}: {why}")
    if not (need := SMOOTHING_METHODS[method]):
        return _PLAIN[method](disparity, size)
    needed: Any = {"image": image, "right_px": right_px}[need]
    if needed is None:
        raise ValueError(f'"{method}" {_WHY[need]}')
    return _WITH_MORE[method](disparity, needed, size)


def _left_right(disparity: Float32, right_px: Floats, size: int) -> Float32:
    if np.shape(right_px) != disparity.shape:
        raise ValueError(f"the right view's map has shape {np.shape(right_px)}, the left one's {disparity.shape}")
    return median_filter(filling.fill_background(left_right_check(disparity, np.asarray(right_px, np.float32))), size)


_PLAIN: dict[str, Callable[[Float32, int], Float32]] = {
    "dilation": dilate,
    "closing": close,
    "opening_closing": open_close,
    "median": median_filter,
    "speckle": filling.remove_speckles,
    "background": lambda disparity, _: filling.fill_background(disparity),
    **{f"inpaint_{solver}": partial(filling.inpaint, method=solver) for solver in filling.SOLVERS},
}
_WITH_MORE: dict[str, Callable[[Float32, Any, int], Float32]] = {
    "left_right": _left_right,
    "weighted_median": filling.weighted_median,
    "least_squares": filling.least_squares,
}
_NO_KERNEL = ("speckle", "background", "inpaint_biharmonic")
_WHY = {
    "right_px": "compares both views: pass right_px=, the disparity of the right view",
    "image": "is guided by the picture: pass image=, the rectified left one, uint8",
}
#: What `smooth` knows: the method's name, and what it needs beside the map.
SMOOTHING_METHODS = dict.fromkeys(_PLAIN, "") | dict.fromkeys(_WITH_MORE, "image") | {"left_right": "right_px"}


def _morphology(operation: int, disparity_px: npt.ArrayLike, size_px: int, shape: str) -> Float32:
    disparity, size = filling.check_map(disparity_px, size_px)
    out = cv2.morphologyEx(np.where(np.isnan(disparity), _FAR, disparity), operation, _kernel(shape, size))
    return np.where(out == _FAR, np.float32(np.nan), out)


def _kernel(shape: str, size: int) -> UInt8:
    if shape not in _SHAPES:
        raise ValueError(f"unknown kernel shape {shape!r}; choose one of {', '.join(_SHAPES)}")
    return np.asarray(cv2.getStructuringElement(_SHAPES[shape], (size, size)))
