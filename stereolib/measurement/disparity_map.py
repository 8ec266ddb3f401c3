"""Disparity maps as this room takes them: checked against the rig, with the rays of their pixels, spoilt for trials."""

from __future__ import annotations

import numpy as np

from stereolib.base import Float64, Floats
from stereolib.rig import RectifiedRig


def check_disparity_map(disparity_px: Floats, rectified: RectifiedRig) -> Floats:
    """Refuse a disparity map that does not fit the rig.

    Parameters
    ----------
    disparity_px : (H, W) float, px
        Of the rectified left image, NaN where invalid.
    rectified : RectifiedRig

    Returns
    -------
    (H, W) float, px
        The map itself.

    Raises
    ------
    ValueError
        If its size is not that of the rig's images, or its values are not floats.

    Examples
    --------
    >>> from stereolib.paper import paper_rig
    >>> check_disparity_map(np.ones((480, 640), np.int16), paper_rig().rectify())
    Traceback (most recent call last):
    ...
    ValueError: the disparity is int16: give float pixels with NaN for invalid ones
    """
    disparity = np.asarray(disparity_px)
    if disparity.shape != rectified.size[::-1]:
        why = f"the disparity map has shape {disparity.shape}, the calibration is for images of"
        raise ValueError(f"{why} {rectified.size[0]}x{rectified.size[1]}: use a map of that size or calibrate again")
    if disparity.dtype.kind != "f":
        raise ValueError(f"the disparity is {disparity.dtype}: give float pixels with NaN for invalid ones")
    return disparity


def pixel_rays(u: Floats, v: Floats, rectified: RectifiedRig) -> Float64:
    """Viewing rays of pixels, ``((u - cx) / f, (v - cy) / f, 1)``.

    Parameters
    ----------
    u, v : (N,) float, px
        Columns and rows of the rectified left image.
    rectified : RectifiedRig

    Returns
    -------
    (N, 3) float64
        Times the depth they are points in the rectified left camera's frame.

    Examples
    --------
    >>> from stereolib.paper import paper_rig
    >>> rig = paper_rig().rectify()
    >>> (cx, cy), f = rig.P1[:2, 2], rig.f_px
    >>> pixel_rays(np.array([cx, cx + f]), np.array([cy, cy]), rig)
    array([[0., 0., 1.],
           [1., 0., 1.]])
    """
    f, (cx, cy) = rectified.f_px, rectified.P1[:2, 2]
    return np.asarray(np.stack([(u - cx) / f, (v - cy) / f, np.ones(len(u))]).T, np.float64)


def add_outliers(disparity_px: Floats, count: int, rng: np.random.Generator, *, highest_px: float = 160.0) -> Floats:
    """Strew outliers, as wrong matches are, over a disparity map, to try what a method makes of them.

    Parameters
    ----------
    disparity_px : (H, W) float, px
        It is left as it is.
    count : int
        Pixels that are drawn; some may be drawn twice.
    rng : numpy.random.Generator
    highest_px : float
        The wrong disparities lie evenly between 1 px and this: SGBM's search range.

    Returns
    -------
    (H, W) float, px

    Examples
    --------
    >>> spoilt = add_outliers(np.full((4, 5), 50.0), 3, np.random.default_rng(0))
    >>> int((spoilt != 50).sum())
    3
    """
    spoilt = np.array(disparity_px)
    rows, columns = (rng.integers(0, size, count) for size in spoilt.shape)
    spoilt[rows, columns] = rng.uniform(1.0, highest_px, count)
    return spoilt
