"""The one model: upright boxes on a floor, and what two cameras and a laser see of them.

World frame: origin on the floor below the left camera, x forward along the optical axis laid flat, y left, z up, mm.

A box has a near corner. From it the right face runs to the right end and the left face to the left end, as the camera
sees them; a box of which one face is seen has the corner at one of that face's ends, and the other face is hidden.
Every function takes any number of parameter vectors at once, complex ones too: derivatives are taken by a complex step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, IntEnum, auto
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from stereolib.base import Bools, Float64
from stereolib.measurement.floor import Floor

Numbers: TypeAlias = npt.NDArray[Any]  # real, or complex for a derivative
#: Of derivatives: ``df/dx = Im f(x + i h) / h``.
COMPLEX_STEP = 1e-30


class Shared(IntEnum):
    """What all boxes of one pair and one scan share, by its place in the vector of parameters.

    The camera's height (a share), pitch and roll (rad) are changes of the floor that was given; the laser's place (mm),
    yaw (rad) and scale (share by which it reads too far) are changes of what its calibration says; the disparities'
    offset and the rows' (px); focal length and baseline are relative changes.
    """

    CAMERA_HEIGHT = 0
    PITCH = auto()
    ROLL = auto()
    LASER_X = auto()
    LASER_Y = auto()
    LASER_YAW = auto()
    LASER_SCALE = auto()
    OFFSET = auto()
    ROWS = auto()
    FOCAL = auto()
    BASELINE = auto()


class Own(IntEnum):
    """What each box has of its own: place of its near corner (mm), turn (rad), extents (mm), the laser's bias (mm).

    ``TURN`` is the angle of the right face's normal, pointing away from the camera; the left face's is a quarter turn
    less.
    """

    X = 0
    Y = auto()
    TURN = auto()
    RIGHT = auto()
    LEFT = auto()
    HEIGHT = auto()
    RIGHT_BIAS = auto()
    LEFT_BIAS = auto()


_CORNER, _SIDES = slice(Own.X, Own.Y + 1), slice(Own.LEFT, Own.RIGHT - 1, -1)


class Side(Enum):
    """A face of a box, right or left of the near corner."""

    RIGHT = "right"
    LEFT = "left"

    @property
    def other(self) -> Side:
        """The other one."""
        return Side.LEFT if self is Side.RIGHT else Side.RIGHT

    @property
    def extent(self) -> Own:
        """Its width among a box's parameters."""
        return Own.RIGHT if self is Side.RIGHT else Own.LEFT

    @property
    def bias(self) -> Own:
        """The laser's bias on it."""
        return Own.RIGHT_BIAS if self is Side.RIGHT else Own.LEFT_BIAS

    @property
    def end(self) -> Edge:
        """The upright edge at its outer end."""
        return Edge.RIGHT_END if self is Side.RIGHT else Edge.LEFT_END

    @property
    def top(self) -> Edge:
        """Its upper edge."""
        return Edge.TOP_RIGHT if self is Side.RIGHT else Edge.TOP_LEFT

    @property
    def back(self) -> Edge:
        """The back edge of the top that runs parallel to it."""
        return Edge.BACK_RIGHT if self is Side.RIGHT else Edge.BACK_LEFT


class Level(Enum):
    """A level surface."""

    FLOOR = "floor"
    TOP = "top"


#: What a plane may be.
Surface: TypeAlias = Side | Level


class Edge(Enum):
    """An edge of a box that a picture may show, from one end to the other: shares of (right, left, height)."""

    CORNER = ((0.0, 0.0, 0.1), (0.0, 0.0, 0.9))
    RIGHT_END = ((1.0, 0.0, 0.1), (1.0, 0.0, 0.9))
    LEFT_END = ((0.0, 1.0, 0.1), (0.0, 1.0, 0.9))
    TOP_RIGHT = ((0.04, 0.0, 1.0), (0.96, 0.0, 1.0))
    TOP_LEFT = ((0.0, 0.04, 1.0), (0.0, 0.96, 1.0))
    BACK_RIGHT = ((0.04, 1.0, 1.0), (0.96, 1.0, 1.0))
    BACK_LEFT = ((1.0, 0.04, 1.0), (1.0, 0.96, 1.0))

    @property
    def upright(self) -> bool:
        """It stands, the others are level."""
        return self in (Edge.CORNER, Edge.RIGHT_END, Edge.LEFT_END)

    @property
    def is_top(self) -> bool:
        """It is the upper edge of a face."""
        return self in (Edge.TOP_RIGHT, Edge.TOP_LEFT)

    @property
    def is_back(self) -> bool:
        """It ends the top behind."""
        return self in (Edge.BACK_RIGHT, Edge.BACK_LEFT)


_ENDS = {edge: np.array(edge.value) for edge in Edge}


@dataclass(frozen=True, eq=False)
class World:
    """Cameras, floor and laser for one or many vectors of shared parameters.

    Attributes
    ----------
    axes : (..., 3, 3)
        World axes as rows, in the rectified left camera's frame.
    camera_height, focal, scale : (...)
        mm; px; focal length times baseline, px mm.
    offset, rows : (...)
        By which all disparities and all rows of the right picture are off, px.
    laser_place, laser_yaw, laser_scale : (..., 2), (...) and (...)
        mm, rad, and the share by which the laser reads too far.
    centre_px : (2,)
        Principal point of the left picture.
    """

    axes: Numbers
    camera_height: Numbers
    focal: Numbers
    scale: Numbers
    offset: Numbers
    rows: Numbers
    laser_place: Numbers
    laser_yaw: Numbers
    laser_scale: Numbers
    centre_px: Float64

    @classmethod
    def of(cls, floor: Floor, laser_place_mm: Float64, laser_yaw_rad: float, shared: Numbers) -> World:
        """Build it about a floor and a laser's pose.

        Parameters
        ----------
        floor : Floor
        laser_place_mm : (2,) float64
        laser_yaw_rad : float
        shared : (..., 11) real or complex
            In the order of `Shared`.

        Returns
        -------
        World
        """
        rectified, (ahead, left, up) = floor.rectified, floor.axes
        pitch, roll = shared[..., Shared.PITCH, None], shared[..., Shared.ROLL, None]
        down = (-up - pitch * ahead - roll * left) / np.sqrt(1 + pitch * pitch + roll * roll)
        x, y, z = (down[..., k] for k in range(3))
        level = np.sqrt(1 - z * z)  # of the optical axis (0, 0, 1), which becomes the axis forward
        axes = np.zeros((*down.shape[:-1], 3, 3), down.dtype)
        axes[..., 0, :2], axes[..., 0, 2] = down[..., :2] * (-z / level)[..., None], level
        axes[..., 1, 0], axes[..., 1, 1], axes[..., 2, :] = -y / level, x / level, -down
        focal = rectified.f_px * (1 + shared[..., Shared.FOCAL])
        return cls(
            axes=axes,
            camera_height=floor.camera_height_mm * (1 + shared[..., Shared.CAMERA_HEIGHT]),
            focal=focal,
            scale=focal * rectified.baseline_mm * (1 + shared[..., Shared.BASELINE]),
            offset=shared[..., Shared.OFFSET],
            rows=shared[..., Shared.ROWS],
            laser_place=laser_place_mm + shared[..., Shared.LASER_X : Shared.LASER_Y + 1],
            laser_yaw=laser_yaw_rad + shared[..., Shared.LASER_YAW],
            laser_scale=shared[..., Shared.LASER_SCALE],
            centre_px=rectified.P1[:2, 2],
        )

    def disparity_plane(self, normal: Numbers, distance: Numbers) -> Numbers:
        """Disparity as the pair measures it on a plane ``normal . X = distance`` of the world: (..., 3), per (u, v, 1).

        Parameters
        ----------
        normal : (..., 3)
        distance : (...)

        Returns
        -------
        (..., 3) px per px, px per px, px
        """
        found: Numbers = self.disparity_planes(normal[..., None, :], np.asarray(distance)[..., None])[..., 0, :]
        return found

    def disparity_planes(self, normals: Numbers, distances: Numbers) -> Numbers:
        """As `disparity_plane`, of k planes at once.

        Parameters
        ----------
        normals : (..., k, 3)
        distances : (..., k)

        Returns
        -------
        (..., k, 3) px per px, px per px, px

        Notes
        -----
        With ``X = axes X_c + h z`` the plane is ``m . X_c = 1``, ``m = axes' normal / (distance - h normal_z)``, and
        the disparity ``f B m . K^-1 (u, v, 1)``; on it come the offset, and the rows' offset times the plane's slope.
        """
        m = normals @ self.axes
        m *= (self.scale[..., None] / (distances - self.camera_height[..., None] * normals[..., 2]))[..., None]
        m[..., :2] /= self.focal[..., None, None]
        u, v = self.centre_px
        m[..., 2] += self.offset[..., None] - m[..., 0] * u + m[..., 1] * (self.rows[..., None] - v)
        return m

    def pixels(self, points: Numbers, right: Bools | bool = False) -> Numbers:
        """Project points of the world into either picture: (..., N, 3) mm to (..., N, 2) px.

        Parameters
        ----------
        points : (..., N, 3)
        right : bool or (N,) bool
            Which of them into the right one, ``u - f B / Z - offset``; its rows are taken to be the left one's.

        Returns
        -------
        (..., N, 2) px
        """
        seen = points @ self.axes
        seen -= (self.camera_height[..., None] * self.axes[..., 2, :])[..., None, :]
        zoom = self.focal[..., None] / seen[..., 2]
        found: Numbers = seen[..., :2] * zoom[..., None]
        found += self.centre_px
        if right is not False:
            shift = zoom * (self.scale / self.focal)[..., None] + self.offset[..., None]
            found[..., 0] -= np.where(right, shift, 0.0)
        return found

    def from_laser(self, points_mm: Numbers) -> Numbers:
        """Turn directions and points of the scan into the world, about the laser's place: (N, 2) to (..., N, 2).

        Parameters
        ----------
        points_mm : (N, 2)

        Returns
        -------
        (..., N, 2)
        """
        found: Numbers = points_mm @ np.swapaxes(self.laser_turn, -1, -2)
        return found

    @cached_property
    def laser_turn(self) -> Numbers:
        """Rotation matrix from the laser's frame to the world's. (..., 2, 2)."""
        c, s = np.cos(self.laser_yaw), np.sin(self.laser_yaw)
        turn = np.empty((*c.shape, 2, 2), c.dtype)
        turn[..., 0, 0] = turn[..., 1, 1] = c
        turn[..., 0, 1], turn[..., 1, 0] = -s, s
        return turn


@dataclass(frozen=True, eq=False)
class Box:
    """One box, or many in its place.

    Attributes
    ----------
    own : (..., 8) real or complex
        In the order of `Own`.
    """

    own: Numbers

    def normal(self, side: Side) -> Numbers:
        """Unit normal of a face, away from the camera.

        Parameters
        ----------
        side : Side

        Returns
        -------
        (..., 2)
        """
        return self.normals[..., 0 if side is Side.RIGHT else 1, :]

    @cached_property
    def normals(self) -> Numbers:
        """Unit normals of the right and of the left face, away from the camera. (..., 2, 2)."""
        normals = np.empty((*self.own.shape[:-1], 2, 2), self.own.dtype)
        normals[..., 0, 0] = normals[..., 1, 1] = np.cos(self.own[..., Own.TURN])
        normals[..., 0, 1] = normals[..., 1, 0] = np.sin(self.own[..., Own.TURN])
        normals[..., 1, 1] *= -1
        return normals

    def distance(self, side: Side) -> Numbers:
        """How far behind the origin a face's line ``normal @ p = distance`` lies, mm.

        Parameters
        ----------
        side : Side

        Returns
        -------
        (...)
        """
        return self.distances[..., 0 if side is Side.RIGHT else 1][()]

    @cached_property
    def distances(self) -> Numbers:
        """How far behind the origin the right and the left face's lines lie, mm. (..., 2)."""
        found: Numbers = (self.normals @ self.corner[..., None])[..., 0]
        return found

    def plane(self, surface: Surface) -> tuple[Numbers, Numbers]:
        """A plane ``normal . X = distance`` of the world.

        Parameters
        ----------
        surface : Surface

        Returns
        -------
        normal, distance : (..., 3) and (...), mm
        """
        normal = np.zeros((*self.own.shape[:-1], 3), self.own.dtype)
        if isinstance(surface, Side):
            normal[..., :2] = self.normal(surface)
            return normal, self.distance(surface)
        normal[..., 2] = 1.0
        return normal, self.own[..., Own.HEIGHT] * (surface is Level.TOP)

    @property
    def corner(self) -> Numbers:
        """Place of the near corner on the floor. (..., 2) mm."""
        return self.own[..., _CORNER]

    def points(self, shares: Float64) -> Numbers:
        """Points of the box, by their shares of (right, left, height).

        Parameters
        ----------
        shares : (N, 3) float64

        Returns
        -------
        (..., N, 3) mm
        """
        found = np.empty((*self.own.shape[:-1], len(shares), 3), self.own.dtype)
        sides = self.own[..., _SIDES, None] * self.normals  # along the left and the right face
        found[..., :2] = shares[:, 1::-1] @ sides + self.corner[..., None, :]
        found[..., 2] = self.own[..., Own.HEIGHT, None] * shares[:, 2]
        return found

    def from_other_end(self, first: Side) -> Box:
        """The same box with its corner at the other end of a face, which so becomes the other side's.

        Parameters
        ----------
        first : Side
            The face.

        Returns
        -------
        Box
        """
        own = self.own.copy()
        own[..., [Own.X, Own.Y]] += self.own[..., first.extent, None] * self.normal(first.other)
        own[..., Own.TURN] += np.pi / 2 if first is Side.RIGHT else -np.pi / 2
        own[..., [Own.RIGHT, Own.LEFT]] = self.own[..., [Own.LEFT, Own.RIGHT]]
        own[..., [Own.RIGHT_BIAS, Own.LEFT_BIAS]] = self.own[..., [Own.LEFT_BIAS, Own.RIGHT_BIAS]]
        return Box(own)

    def edge(self, edge: Edge) -> Numbers:
        """Both ends of an edge.

        Parameters
        ----------
        edge : Edge

        Returns
        -------
        (..., 2, 3) mm
        """
        return self.points(_ENDS[edge])


def derivatives(function: Callable[[Numbers], Numbers], x: Float64) -> tuple[Float64, Float64]:
    """Value and Jacobian of an analytic function of a parameter vector, exact to rounding.

    Parameters
    ----------
    function : callable
        Takes (K, n) complex to (K, m).
    x : (n,) float64

    Returns
    -------
    values : (m,) float64
    J : (m, n) float64

    Notes
    -----
    ``df/dx_k = Im f(x + i h e_k) / h`` with h = 1e-30: no difference is taken, so nothing cancels.

    References
    ----------
    Squire, Trapp: Using complex variables to estimate derivatives of real functions. SIAM Rev. 40 (1998).

    Examples
    --------
    >>> derivatives(lambda x: x[..., :1] ** 2 * x[..., 1:], np.array([3.0, 2.0]))
    (array([18.]), array([[12.,  9.]]))
    """
    moved = function(x + 1j * COMPLEX_STEP * np.eye(len(x)))
    return np.asarray(moved[0].real), np.asarray(moved.imag.T / COMPLEX_STEP)
