"""What was observed of a scene, each as differences between what the model predicts and what was seen, in sigmas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from stereolib.base import Float64
from stereolib.measurement.box import Box, Edge, Numbers, Own, Side, World
from stereolib.measurement.faces import Face

_GRAZING = 0.05  # cosine between a beam and a normal: flatter beams tell no more
_UNIFORM = float(np.sqrt(12.0))  # an interval over its standard deviation
_UNKNOWN_MM = 1000.0  # standard deviation of what nobody may see
_ROUNDING = 1e-12  # of a covariance: directions known better than that are known to it


class Observation(Protocol):
    """Something that was seen."""

    @property
    def robust(self) -> bool:
        """It may be mistaken, so that far-off values count less."""

    @property
    def of_scan(self) -> bool:
        """The laser saw it."""

    def residuals(self, world: World, box: Box) -> Numbers:
        """Predicted minus observed, in standard deviations: (..., m)."""


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
    """A plane as the pair sees it: the disparity is ``coefficients . (u - u0, v - v0, 1)``.

    Attributes
    ----------
    centre_px : (2,) float64
        u0 and v0.
    coefficients : (3,) float64
    root : (3, 3) float64
        From `whitening`.
    side : Side or None
        The face; None: the floor.
    """

    centre_px: Float64
    coefficients: Float64
    root: Float64
    side: Side | None = None

    @classmethod
    def of(cls, face: Face, side: Side) -> PlaneSeen:
        """A face that was aligned."""
        return cls(face.centre_px, face.coefficients, whitening(face.plane_covariance), side)

    @property
    def robust(self) -> bool:
        """A face may be mistaken; the floor holds for all."""
        return self.side is not None

    @property
    def of_scan(self) -> bool:
        """The pictures show it."""
        return False

    def residuals(self, world: World, box: Box) -> Numbers:
        """Predicted minus observed disparity plane, in standard deviations: (..., 3)."""
        if self.side is None:
            normal = np.zeros((*world.camera_height.shape, 3))
            normal[..., 2] = 1.0
            plane = world.disparity_plane(normal, np.zeros_like(world.camera_height))
        else:
            flat = box.normal(self.side)
            normal = np.concatenate([flat, np.zeros_like(flat[..., :1])], axis=-1)
            plane = world.disparity_plane(normal, box.distance(self.side))
        at_centre = plane[..., :2] @ self.centre_px + plane[..., 2]
        predicted = np.concatenate([plane[..., :2], at_centre[..., None]], axis=-1)
        return (predicted - self.coefficients) @ self.root


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

    edge: Edge
    point_px: Float64
    across: Float64
    std_px: float
    located: bool = True
    right: bool = False

    @classmethod
    def near(cls, at: EdgeSeen, std_px: float) -> EdgeSeen:
        """An edge that was not located: it is where it was predicted, roughly."""
        return replace(at, std_px=std_px, located=False)

    @property
    def robust(self) -> bool:
        """It may be another edge."""
        return True

    @property
    def of_scan(self) -> bool:
        """The pictures show it."""
        return False

    def residuals(self, world: World, box: Box) -> Numbers:
        """How far the predicted edge passes the point, across it, in standard deviations: (..., 1)."""
        return edge_residuals((self,), world, box)


def edge_residuals(edges: Sequence[EdgeSeen], world: World, box: Box) -> Numbers:
    """How far predicted edges pass the points where they were seen, all at once.

    Parameters
    ----------
    edges : sequence of n EdgeSeen
    world : World
    box : Box

    Returns
    -------
    (..., n)
        In standard deviations.
    """
    right = np.repeat([edge.right for edge in edges], 2)
    ends = world.pixels(box.points(np.concatenate([edge.edge.value for edge in edges])), right)
    ends = ends.reshape(*ends.shape[:-2], len(edges), 2, 2)
    point, across = np.array([edge.point_px for edge in edges]), np.array([edge.across for edge in edges])
    along = ends[..., 1, :] - ends[..., 0, :]
    off = ends[..., 0, :] - point
    miss = along[..., 0] * off[..., 1] - along[..., 1] * off[..., 0]
    facing = along[..., 0] * across[:, 1] - along[..., 1] * across[:, 0]
    found: Numbers = miss / facing / np.array([edge.std_px for edge in edges])
    return found


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

    side: Side
    origins_mm: Float64
    beams: Float64
    ranges_mm: Float64
    sigma_mm: Float64

    @property
    def robust(self) -> bool:
        """Some may have met something else."""
        return True

    @property
    def of_scan(self) -> bool:
        """The laser saw it."""
        return True

    def residuals(self, world: World, box: Box) -> Numbers:
        """Face minus reading along the beams, in standard deviations: (..., N)."""
        normal = box.normal(self.side)[..., None, :]
        beams = world.from_laser(self.beams)
        points = (
            world.from_laser(self.origins_mm + self.ranges_mm[:, None] * self.beams) + world.laser_place[..., None, :]
        )
        facing = (normal * beams).sum(axis=-1)
        facing = np.where(facing.real > _GRAZING, facing, _GRAZING)
        off = box.distance(self.side)[..., None] - (normal * points).sum(axis=-1)
        found: Numbers = (off / facing + box.own[..., self.side.bias, None]) / self.sigma_mm
        return found


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

    side: Side
    at_corner: bool
    origins_mm: Float64
    beams: Float64

    @property
    def robust(self) -> bool:
        """The next beam may have been lost on the face itself."""
        return True

    @property
    def of_scan(self) -> bool:
        """The laser saw it."""
        return True

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
        found: Numbers = ((end - met.mean(axis=-1)) * _UNIFORM / width)[..., None]
        return found


@dataclass(frozen=True, eq=False)
class OwnPrior:
    """What is known of one of a box's parameters beforehand.

    Attributes
    ----------
    name : Own
    value, std : float
    """

    name: Own
    value: float
    std: float

    @property
    def robust(self) -> bool:
        """It is not a reading."""
        return False

    @property
    def of_scan(self) -> bool:
        """Neither shows it."""
        return False

    def residuals(self, world: World, box: Box) -> Numbers:
        """Parameter minus value, in standard deviations: (..., 1)."""
        return prior_residuals((self,), box)


def prior_residuals(priors: Sequence[OwnPrior], box: Box) -> Numbers:
    """Parameters minus what is known of them beforehand, all at once.

    Parameters
    ----------
    priors : sequence of n OwnPrior
    box : Box

    Returns
    -------
    (..., n)
        In standard deviations.
    """
    values, stds = np.array([prior.value for prior in priors]), np.array([prior.std for prior in priors])
    found: Numbers = (box.own[..., [prior.name for prior in priors]] - values) / stds
    return found


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
