"""The lines of upright planes on the floor: from a face as it was aligned, or of a box, and round its corners."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolib.base import Float64
from stereolib.measurement.box import Box, Numbers, Side, World, derivatives
from stereolib.measurement.faces import Face


@dataclass(frozen=True, eq=False)
class UprightLine:
    """An upright plane over its line ``normal @ p = distance`` on the floor.

    Attributes
    ----------
    normal : (2,) float64
        Away from the camera.
    distance_mm : float or (...) float64
        Of one, or of parallel ones.
    """

    normal: Float64
    distance_mm: float | Float64

    @property
    def along(self) -> Float64:
        """Unit vector along it, to the left as the camera sees it. (2,)."""
        return np.array([-self.normal[1], self.normal[0]])

    def at(self, t: Float64 | float) -> Float64:
        """Its points in some directions.

        Parameters
        ----------
        t : float or (...) float64
            Tangents of their bearings, left positive.

        Returns
        -------
        (..., 2) float64, mm
            ``r (1, t)`` with ``normal . r (1, t) = distance``; NaN where it is not met.

        Examples
        --------
        >>> UprightLine(np.array([1.0, 0.0]), 500.0).at(0.1)
        array([500.,  50.])
        """
        ray = np.stack([np.ones_like(t), t], axis=-1)
        facing = ray @ self.normal
        return np.asarray(ray * (self.distance_mm / np.where(facing > 1e-3, facing, np.nan))[..., None])

    def round_corner(self, t: Float64 | float, outwards: int) -> UprightLine:
        """The line at a right angle to it, round an end.

        Parameters
        ----------
        t : float or (...) float64
            Tangent of the end's bearing.
        outwards : int
            -1: its right end; 1: its left one.

        Returns
        -------
        UprightLine
        """
        normal = -outwards * self.along
        return UprightLine(normal, self.at(t) @ normal)


def face_line(box: Box, side: Side) -> UprightLine:
    """The line of a box's face.

    Parameters
    ----------
    box : Box
        One, real.
    side : Side

    Returns
    -------
    UprightLine
    """
    return UprightLine(box.normal(side), float(box.distance(side)))


def upright_line(world: World, face: Face, at_mm: float) -> tuple[UprightLine, float, float]:
    """The line of a face's plane at a height, and the plane's tilt.

    Parameters
    ----------
    world : World
        One, real.
    face : Face
        Only its plane is used.
    at_mm : float
        Height above the floor.

    Returns
    -------
    line : UprightLine
    tilt_rad, tilt_std_rad : float
        Positive where the face leans forward: its top is nearer than its foot.

    Notes
    -----
    A disparity plane ``(a, b, c)`` per (u - u0, v - v0, 1) is the plane ``m . X = 1`` seen from the camera,
    ``m = axes (a f, b f, c - offset) / (f B)``; its tilt is ``atan2(m_z, |m_xy|)``.
    """
    f, (u0, v0) = float(world.focal), world.centre_px

    def normal(coefficients: Numbers) -> Numbers:
        a, b, at_centre = (coefficients[..., k] for k in range(3))
        c = at_centre + a * (u0 - face.centre_px[0]) + b * (v0 - face.centre_px[1]) - float(world.offset)
        return np.stack([a * f, b * f, c], axis=-1) @ world.axes.T / float(world.scale)

    m, J = derivatives(normal, face.coefficients)
    size = float(np.hypot(*m[:2]))
    tilt = np.array([-m[2] * m[0] / size, -m[2] * m[1] / size, size]) / (m @ m) @ J
    distance = (1 + m[2] * (float(world.camera_height) - at_mm)) / size
    std = float(np.sqrt(tilt @ face.plane_covariance @ tilt))
    return UprightLine(m[:2] / size, float(distance)), float(np.arctan2(m[2], size)), std
