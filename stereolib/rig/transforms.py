"""Rigid transforms: as one matrix, the cross product as a matrix, and the pose of a camera over the floor."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from stereolib.base import Float64


def rigid(R: ArrayLike, t: ArrayLike) -> Float64:
    """Homogeneous transform of a rotation and a translation.

    Parameters
    ----------
    R : (3, 3) array_like
    t : (3,), (3, 1) or (1, 3) array_like

    Returns
    -------
    (4, 4) float64
        ``[[R, t], [0, 1]]``: takes ``(x, 1)`` to ``(R x + t, 1)``.

    Raises
    ------
    ValueError
        If R is no matrix, as a vector of Rodrigues is none, or t has not three numbers.

    Examples
    --------
    >>> rigid(np.eye(3), [10.0, 20.0, 30.0]) @ [1.0, 2.0, 3.0, 1.0]
    array([11., 22., 33.,  1.])
    """
    if np.shape(R) != (3, 3) or np.size(t) != 3:
        remedy = "of a rotation's vector cv2.Rodrigues makes the matrix"
        raise ValueError(f"R must be (3, 3) and t (3,), got shapes {np.shape(R)} and {np.shape(t)}: {remedy}")
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, np.ravel(t)
    return T


def skew(t: ArrayLike) -> Float64:
    """Matrix of the cross product with a vector.

    Parameters
    ----------
    t : (3,) array_like

    Returns
    -------
    (3, 3) float64
        ``skew(t) @ x == np.cross(t, x)``.

    Examples
    --------
    >>> skew([1.0, 0.0, 0.0]) @ [0.0, 1.0, 0.0]
    array([0., 0., 1.])
    """
    x, y, z = np.ravel(t)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def pose_left_world(pitch_rad: float, height_mm: float) -> Float64:
    """Pose ``T_left_world`` of a left camera above the world's origin, looking along +x.

    Parameters
    ----------
    pitch_rad : float, rad
        Angle of the optical axis above the horizontal.
    height_mm : float, mm
        Height of the optical centre above the floor.

    Returns
    -------
    (4, 4) float64
        Maps homogeneous world points (x forward, y left, z up, mm) into the left camera (x right, y down, z forward).

    Examples
    --------
    A point of the floor half a metre ahead stands 85 mm below a level camera at that height.

    >>> pose_left_world(0.0, 85.0) @ [500.0, 0.0, 0.0, 1.0]
    array([  0.,  85., 500.,   1.])
    """
    c, s = np.cos(pitch_rad), np.sin(pitch_rad)
    R = np.array([[0.0, -1.0, 0.0], [s, 0.0, -c], [c, 0.0, s]])
    return rigid(R, -R @ [0.0, 0.0, height_mm])
