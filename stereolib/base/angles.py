"""Angles and turns in the plane, counter-clockwise, in radians."""

from __future__ import annotations

from typing import overload

import numpy as np

from stereolib.base.arrays import Float64


@overload
def wrap_rad(angle_rad: float, period_rad: float = ...) -> float: ...
@overload
def wrap_rad(angle_rad: Float64, period_rad: float = ...) -> Float64: ...
def wrap_rad(angle_rad: float | Float64, period_rad: float = 2 * np.pi) -> float | Float64:
    """Bring angles into one period around zero, ``[-period / 2, period / 2)``.

    Parameters
    ----------
    angle_rad : float or array, rad
    period_rad : float, rad
        ``2 pi`` for directions, ``pi`` for lines, ``pi / 2`` for squares.

    Returns
    -------
    float or array like `angle_rad`, rad

    Examples
    --------
    >>> wrap_rad(1.5 * np.pi) / np.pi
    -0.5
    """
    return (angle_rad + period_rad / 2) % period_rad - period_rad / 2


def direction(angle_rad: float | Float64) -> Float64:
    """Unit vectors ``(cos, sin)`` of angles.

    Parameters
    ----------
    angle_rad : float or (...) array, rad

    Returns
    -------
    (..., 2) float64

    Examples
    --------
    >>> direction(0.0)
    array([1., 0.])
    """
    return np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=-1)


def turn_2d(yaw_rad: float) -> Float64:
    """Rotation matrix of a turn in the plane: ``turn_2d(yaw) @ p`` is p turned by yaw.

    Parameters
    ----------
    yaw_rad : float, rad

    Returns
    -------
    (2, 2) float64

    Examples
    --------
    >>> (turn_2d(np.pi / 2) @ [1.0, 0.0]).round(12)
    array([0., 1.])
    """
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([[c, -s], [s, c]])


def turn_about_z(yaw_rad: float) -> Float64:
    """Rotation matrix of a turn about the vertical z axis.

    Parameters
    ----------
    yaw_rad : float, rad

    Returns
    -------
    (3, 3) float64

    Examples
    --------
    >>> (turn_about_z(np.pi / 2) @ [1.0, 0.0, 5.0]).round(12)
    array([0., 1., 5.])
    """
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
