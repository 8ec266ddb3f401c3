"""The relation of pixels and lengths: the paper's constant, and its parametric form (sections II.F and IV)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from stereolib.base import Float64

_MM_PER_CM = 10.0


def cm_per_px(length_cm: float, width_px: float) -> float:
    """The paper's constant: a known length over its width in the image (section IV).

    Parameters
    ----------
    length_cm : float, cm
    width_px : float, px

    Returns
    -------
    float, cm/px

    Raises
    ------
    ValueError
        If one of them is not positive.

    Examples
    --------
    >>> round(cm_per_px(42, 362), 3)
    0.116
    """
    if not (length_cm > 0 and width_px > 0):
        raise ValueError(f"length and width must be positive, got {length_cm} cm, {width_px} px")
    return length_cm / width_px


def cm_per_px_at(depth_mm: ArrayLike, f_px: float) -> Float64:
    """The parametric relation: one pixel at a depth stands for ``Z / f``, in cm/px.

    Parameters
    ----------
    depth_mm : float or array_like, mm
        Along the optical axis; NaN where unknown.
    f_px : float, px

    Returns
    -------
    float64, cm/px, shaped like `depth_mm`

    Raises
    ------
    ValueError
        If the focal length is not positive.

    Examples
    --------
    >>> cm_per_px_at([700.0, 847.0], 730.0).round(3)
    array([0.096, 0.116])
    """
    if not f_px > 0:
        raise ValueError(f"the focal length must be positive, got {f_px} px")
    return np.asarray(np.asarray(depth_mm, float) / (_MM_PER_CM * f_px))


def depth_of_scale_mm(scale_cm_per_px: float, f_px: float) -> float:
    """Depth at which a scale is true, ``Z = scale f``.

    Parameters
    ----------
    scale_cm_per_px : float, cm/px
    f_px : float, px

    Returns
    -------
    float, mm

    Examples
    --------
    >>> round(depth_of_scale_mm(0.116, 730.0))
    847
    """
    return _MM_PER_CM * scale_cm_per_px * f_px


def fit_focal_length_px(depth_mm: ArrayLike, scale_cm_per_px: ArrayLike) -> float:
    """Focal length of measured scales: least squares of ``scale = Z / f``.

    Parameters
    ----------
    depth_mm : (N,) array_like, mm
    scale_cm_per_px : (N,) array_like, cm/px

    Returns
    -------
    float, px

    Raises
    ------
    ValueError
        If the lengths differ, or a value is not positive and finite.

    Examples
    --------
    >>> round(fit_focal_length_px([700.0, 1400.0], [0.1, 0.2]), 6)
    700.0
    """
    depth, scale = np.asarray(depth_mm, float), _MM_PER_CM * np.asarray(scale_cm_per_px, float)
    if depth.shape != scale.shape or depth.ndim != 1 or not depth.size:
        raise ValueError(f"need as many depths as scales, got {depth.shape} and {scale.shape}")
    if not all(np.isfinite(a).all() and (a > 0).all() for a in (depth, scale)):
        raise ValueError("depths and scales must be positive and finite: drop the invalid ones")
    return float(depth @ depth / (depth @ scale))
