"""Dilation of disparity maps (section II.D) and its rivals, one signature: ``smooth(disparity_px, method, ...)``."""

from __future__ import annotations

import cv2
import numpy as np

from stereolib.matching import filling
from stereolib.matching.filling import checked as _checked

Array = np.ndarray
_NO_KERNEL = ("speckle", "background", "inpaint_biharmonic")
_SHAPES = {"rect": cv2.MORPH_RECT, "ellipse": cv2.MORPH_ELLIPSE, "cross": cv2.MORPH_CROSS}


#: What `smooth` knows: name -> what it needs beside the map.
METHODS = {
    "dilation": "",
    "closing": "",
    "opening_closing": "",
    "median": "",
    "speckle": "",
    "background": "",
    "inpaint_telea": "",
    "inpaint_navier_stokes": "",
    "inpaint_biharmonic": "",
    "left_right": "right_px",
    "weighted_median": "image",
    "least_squares": "image",
}


def smooth(
    disparity_px: Array, method: str, *, size_px: int = 9, image: Array | None = None, right_px: Array | None = None
) -> Array:
    """Repair a disparity map by a method's name.

    Parameters
    ----------
    disparity_px : (H, W) float, px, NaN is a hole
    method : str
        One of `METHODS`.
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
    """
    if method not in METHODS:
        raise ValueError(f"unknown method {method!r}; choose one of {', '.join(METHODS)}")
    disparity, size = _checked(disparity_px, size_px)
    if method not in _NO_KERNEL and size > min(disparity.shape):
        raise ValueError(f"a kernel of {size} px is larger than the map {disparity.shape}: every pixel would see all "
                         f"of it; take at most {min(disparity.shape)}")  # fmt: skip
    if METHODS[method] == "right_px":
        if right_px is None:
            raise ValueError(f'"{method}" compares both views: pass right_px=, the disparity of the right view')
        return median(filling.left_right(disparity, right_px), size)
    if METHODS[method] == "image":
        if image is None:
            raise ValueError(f'"{method}" is guided by the picture: pass image=, the rectified left one, uint8')
        guided = filling.weighted_median if method == "weighted_median" else filling.least_squares
        return guided(disparity, image, size)
    if method.startswith("inpaint_"):
        return filling.inpaint(disparity, size, method=method.removeprefix("inpaint_"))
    if method == "background":
        return filling.fill_background(disparity)
    kernels = {"dilation": dilate, "closing": close, "opening_closing": open_close, "median": median}
    return filling.remove_speckles(disparity, size) if method == "speckle" else kernels[method](disparity, size)


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


def open_close(disparity_px: Array, size_px: int, *, shape: str = "rect") -> Array:
    """Grey opening, then closing: small near specks go first, so that the closing does not spread them.

    A hole takes part in neither: the opening leaves out what is no value, then gives each pixel its own hole back.
    """
    disparity, size = _checked(disparity_px, size_px)
    kernel, high = _kernel(shape, size), np.float32(1e9)
    hole = np.isnan(disparity)
    lowest = cv2.erode(np.where(hole, high, disparity), kernel)
    opened = cv2.dilate(np.where(lowest >= high, -high, lowest), kernel)
    return close(np.where(hole, np.float32(np.nan), opened), size, shape=shape)


def median(disparity_px: Array, size_px: int) -> Array:
    """Median of the valid disparities under a square kernel; NaN where the kernel met none."""
    disparity, size = _checked(disparity_px, size_px)
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
