"""What was observed of a scene, each as differences between what the model predicts and what was seen, in sigmas."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol, TypeAlias

import numpy as np
from scipy.linalg import block_diag

from stereolib.base import Float64, Ints
from stereolib.measurement.box import Box, Edge, Level, Numbers, Own, Side, Surface, World
from stereolib.measurement.edges import UNIFORM
from stereolib.measurement.faces import Face

_GRAZING = 0.05  # cosine between a beam and a normal: flatter beams tell no more
_UNKNOWN_MM = 1000.0  # standard deviation of what nobody may see
_BIASES = slice(Own.RIGHT_BIAS, Own.LEFT_BIAS + 1)
_LEAST_PX = 1e-6  # of an edge's length
_ROUNDING = 1e-12  # of a covariance: directions known better than that are known to it


#: Predicted minus observed, in standard deviations: (..., m).
Residuals: TypeAlias = Callable[[World, Box], Numbers]


class Observation(Protocol):
    """Something that was seen."""

    @property
    def robust(self) -> bool:
        """It may be mistaken, so that far-off values count less."""

    @property
    def of_scan(self) -> bool:
        """The laser saw it."""

    @property
    def count(self) -> int:
        """How many residuals it has."""

    @staticmethod
    def together(several: Sequence[Any], /) -> Residuals:
        """Residuals of several of one kind, one after the other."""


def whitening(covariance: Float64) -> Float64:
    """Matrix that makes errors of a covariance independent and of one sigma: ``root root' = C^-1``.

    Parameters
    ----------
    covariance : (k, k) float64
        May be singular: what is known perfectly is taken as known to a millionth of the largest deviation.

    Returns
    -------
    (k, k) float64
        Residuals are ``root' error``.
    """
    scale = np.sqrt(np.maximum(np.diag(covariance), _ROUNDING * max(float(np.trace(covariance)), _ROUNDING)))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray(vectors / np.sqrt(np.maximum(values, _ROUNDING)) / scale[:, None])


@dataclass(frozen=True, eq=False)
class PlaneSeen:
    """A plane as the pair sees it: the disparity is ``coefficients @ (u - u0, v - v0, 1)``.

    Attributes
    ----------
    centre_px : (2,) float64
        u0 and v0.
    coefficients : (3,) float64
    root : (3, 3) float64
        From `whitening`.
    surface : Surface
        What it is of the box, or the floor.
    """

    of_scan: ClassVar[bool] = False  # the pictures show it

    centre_px: Float64
    coefficients: Float64
    root: Float64
    surface: Surface = Level.FLOOR

    @classmethod
    def of(cls, face: Face, surface: Surface) -> PlaneSeen:
        """A face that was aligned."""
        return cls(face.centre_px, face.coefficients, whitening(face.plane_covariance), surface)

    @property
    def robust(self) -> bool:
        """A face may be mistaken; the floor holds for all."""
        return self.surface is not Level.FLOOR

    @property
    def count(self) -> int:
        """One a coefficient."""
        return 3

    @staticmethod
    def together(several: Sequence[PlaneSeen]) -> Residuals:
        """Residuals of many at once."""
        moved = [np.array([[1.0, 0.0, p.centre_px[0]], [0.0, 1.0, p.centre_px[1]], [0.0, 0.0, 1.0]]) for p in several]
        roots = block_diag(*[to_centre @ plane.root for to_centre, plane in zip(moved, several, strict=True)])
        seen = np.concatenate([plane.coefficients @ plane.root for plane in several])

        def residuals(world: World, box: Box) -> Numbers:
            planes_mm = [box.plane(plane.surface) for plane in several]
            normals = np.stack([normal for normal, _ in planes_mm], axis=-2)
            distances = np.stack([distance for _, distance in planes_mm], axis=-1)
            planes = world.disparity_planes(normals, distances)
            found: Numbers = planes.reshape(*planes.shape[:-2], -1) @ roots - seen
            return found

        return residuals


@dataclass(frozen=True, eq=False)
class EdgeSeen:
    """An edge in a picture: a point on it, and across which direction it was located.

    Attributes
    ----------
    edge : Edge
    point_px, across : (2,) float64
        px; unit vector.
    std_px : float
    located : bool
        In the pictures themselves; else only as the disparity map has it.
    right : bool
        The point lies in the right picture.
    """

    of_scan: ClassVar[bool] = False  # the pictures show it
    robust: ClassVar[bool] = True  # it may be another edge

    edge: Edge
    point_px: Float64
    across: Float64
    std_px: float
    located: bool = True
    right: bool = False

    @classmethod
    def through(cls, edge: Edge, first_px: Float64, last_px: Float64, *, right: bool = False) -> EdgeSeen:
        """Both its ends as they would be seen, (2,) each: in the middle, known to 1 px."""
        along = last_px - first_px
        across = np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), _LEAST_PX)
        return cls(edge, (first_px + last_px) / 2, across, 1.0, right=right)

    @classmethod
    def near(cls, at: EdgeSeen, std_px: float) -> EdgeSeen:
        """An edge that was not located: it is where it was predicted, roughly."""
        return replace(at, std_px=std_px, located=False)

    @property
    def count(self) -> int:
        """Across it."""
        return 1

    @staticmethod
    def together(several: Sequence[EdgeSeen]) -> Residuals:
        """Residuals of many at once."""
        shares = np.concatenate([edge.edge.value for edge in several])
        right = np.repeat([edge.right for edge in several], 2) if any(edge.right for edge in several) else False
        point_u, point_v = np.array([edge.point_px for edge in several]).T
        across_u, across_v = np.array([edge.std_px * edge.across for edge in several]).T

        def residuals(world: World, box: Box) -> Numbers:
            ends = world.pixels(box.points(shares), right)
            u, v = ends[..., ::2, 0], ends[..., ::2, 1]
            along_u, along_v = ends[..., 1::2, 0] - u, ends[..., 1::2, 1] - v
            miss = along_u * (v - point_v) - along_v * (u - point_u)
            found: Numbers = miss / (along_u * across_v - along_v * across_u)
            return found

        return residuals


@dataclass(frozen=True, eq=False)
class RangesSeen:
    """Readings of the laser on one face.

    Attributes
    ----------
    side : Side
    origins_mm, beams, ranges_mm : (N, 2), (N, 2) and (N,) float64
        Where each beam leaves the sensor, its direction, and its reading, in the laser's frame.
    sigma_mm : (N,) float64
        Along the beam.
    """

    of_scan: ClassVar[bool] = True  # the laser saw it
    robust: ClassVar[bool] = True  # some may have met something else

    side: Side
    origins_mm: Float64
    beams: Float64
    ranges_mm: Float64
    sigma_mm: Float64

    @property
    def count(self) -> int:
        """One a reading."""
        return len(self.ranges_mm)

    @staticmethod
    def together(several: Sequence[RangesSeen]) -> Residuals:
        """Residuals of many at once."""
        face = np.concatenate([np.full(seen.count, int(seen.side is Side.LEFT)) for seen in several])
        ranges = np.concatenate([seen.ranges_mm for seen in several])
        sigma = np.concatenate([seen.sigma_mm for seen in several])
        beams = _by_face(face, np.concatenate([seen.beams for seen in several]))
        met = _by_face(
            face, np.concatenate([seen.origins_mm + seen.ranges_mm[:, None] * seen.beams for seen in several])
        )

        def residuals(world: World, box: Box) -> Numbers:
            normals = (box.normals @ world.laser_turn).reshape(*box.own.shape[:-1], 4)  # in the laser's frame
            facing = normals @ beams
            facing = np.where(facing.real > _GRAZING, facing, _GRAZING)
            off = box.distances - (box.normals @ world.laser_place[..., None])[..., 0]
            bias = box.own[..., _BIASES][..., face] + world.laser_scale[..., None] * ranges
            found: Numbers = ((off[..., face] - normals @ met) / facing + bias) / sigma
            return found

        return residuals


def _by_face(face: Ints, vectors: Float64) -> Float64:
    """Vectors (N, 2) as (4, N), to be multiplied by both faces' normals (..., 4): each meets that of its face only."""
    found = np.zeros((2, 2, len(face)))
    found[face, :, np.arange(len(face))] = vectors
    return found.reshape(4, -1)


@dataclass(frozen=True, eq=False)
class EndBetweenBeams:
    """Two beams of the laser between which a face ends.

    Attributes
    ----------
    side : Side
    at_corner : bool
        It ends at the near corner, else at its outer end.
    origins_mm, beams : (2, 2) float64
        Of the last beam on it and of the next one.
    """

    of_scan: ClassVar[bool] = True  # the laser saw it
    robust: ClassVar[bool] = True  # the next beam may have been lost on the face itself

    side: Side
    at_corner: bool
    origins_mm: Float64
    beams: Float64

    @property
    def count(self) -> int:
        """Along the face."""
        return 1

    @staticmethod
    def together(several: Sequence[EndBetweenBeams]) -> Residuals:
        """Residuals of some."""
        return lambda world, box: np.concatenate([end.residuals(world, box) for end in several], axis=-1)

    def residuals(self, world: World, box: Box) -> Numbers:
        """End minus the middle of where both beams meet the face, over a uniform interval's deviation: (..., 1)."""
        normal, along = box.normal(self.side)[..., None, :], box.normal(self.side.other)[..., None, :]
        beams = world.from_laser(self.beams)
        origins = world.from_laser(self.origins_mm) + world.laser_place[..., None, :]
        facing = (normal * beams).sum(axis=-1)
        facing = np.where(facing.real > _GRAZING, facing, _GRAZING)
        t = (box.distance(self.side)[..., None] - (normal * origins).sum(axis=-1)) / facing
        met = (along * (origins + t[..., None] * beams)).sum(axis=-1)
        end = (along[..., 0, :] * box.corner).sum(axis=-1)
        if not self.at_corner:
            end = end + box.own[..., self.side.extent]
        width = met[..., 1] - met[..., 0]
        width = np.where(width.real < 0, -width, width)
        found: Numbers = ((end - met.mean(axis=-1)) * UNIFORM / width)[..., None]
        return found


@dataclass(frozen=True, eq=False)
class OwnPrior:
    """What is known of one of a box's parameters beforehand.

    Attributes
    ----------
    name : Own
    value, std : float
    """

    of_scan: ClassVar[bool] = False  # neither shows it
    robust: ClassVar[bool] = False  # it is not a reading

    name: Own
    value: float
    std: float

    @property
    def count(self) -> int:
        """One."""
        return 1

    @staticmethod
    def together(several: Sequence[OwnPrior]) -> Residuals:
        """Residuals of many at once."""
        names = np.array([prior.name for prior in several])
        values, stds = np.array([prior.value for prior in several]), np.array([prior.std for prior in several])
        return lambda world, box: (box.own[..., names] - values) / stds


def weak_priors(own: Float64, bias_mm: float) -> list[Observation]:
    """What keeps the least squares regular where nobody sees anything; and the laser's bias.

    Parameters
    ----------
    own : (8,) float64
        In the order of `Own`.
    bias_mm : float
        Standard deviation of the error that all readings on one face share.

    Returns
    -------
    list of Observation
    """
    seen = (Own.X, Own.Y, Own.RIGHT, Own.LEFT, Own.HEIGHT)
    free: list[Observation] = [OwnPrior(name, float(own[name]), _UNKNOWN_MM) for name in seen]
    return free + [OwnPrior(side.bias, 0.0, bias_mm) for side in Side]
