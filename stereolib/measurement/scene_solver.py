"""The one least squares: all boxes of a scene, and what they share, from everything that was observed of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum, auto
from functools import cached_property
from typing import cast

import numpy as np

from stereolib.base import Bools, Float64, Ints
from stereolib.measurement.box import COMPLEX_STEP, Box, Numbers, Own, Shared, World
from stereolib.measurement.floor import Floor
from stereolib.measurement.laser_on_floor import LaserOnFloor
from stereolib.measurement.observations import (
    EdgeSeen,
    Observation,
    OwnPrior,
    PlaneSeen,
    edge_residuals,
    prior_residuals,
    whitening,
)

_REACH = 2.5  # standard deviations beyond which an observation that may be mistaken counts less and less
_TOLERANCE = 1e-6  # of cost: what gains less moves nothing by more than 1.5 thousandths of its deviation
_MOST_STEPS = 40
_DAMPED, _UNDAMPED = 10.0, 0.1  # by what the damping changes after a step that fails, and one that gains
_LEAST_DAMPING = 1e-3
_STEPS = 1j * COMPLEX_STEP * np.eye(len(Shared) + len(Own))
_LASER = slice(Shared.LASER_X, Shared.LASER_YAW + 1)
_CAMERAS = slice(Shared.OFFSET, None)
_FLOOR_ROUNDING = np.array([1e-5, 1e-5, 1e-3])  # of a floor's plane: one that is given is known so well at most


@dataclass(frozen=True, eq=False)
class Priors:
    """What is known beforehand of what all boxes share.

    Attributes
    ----------
    floor : Floor
        As it was seen.
    laser : LaserOnFloor
        As it was calibrated.
    cameras_std : (4,) float64
        Of `Shared`'s last four, from the calibration: offset and rows (px), focal length and baseline (shares).
    """

    floor: Floor
    laser: LaserOnFloor
    cameras_std: Float64

    def world(self, shared: Numbers) -> World:
        """Cameras, floor and laser for shared parameters.

        Parameters
        ----------
        shared : (..., 10)

        Returns
        -------
        World
        """
        return World.of(self.floor, self.laser.t, self.laser.yaw_rad, shared)

    @cached_property
    def roots(self) -> tuple[Float64, Float64]:
        """What makes errors of the laser's pose and of the floor's plane independent: two (3, 3)."""
        return whitening(self.laser.covariance), whitening(self.floor.covariance + np.diag(_FLOOR_ROUNDING**2))

    def residuals(self, shared: Numbers, world: World) -> Numbers:
        """Shared parameters minus what is known of them, and the floor, in standard deviations: (..., 10).

        Parameters
        ----------
        shared : (..., 10)
        world : World
            Of them.

        Returns
        -------
        (..., 10)
        """
        laser, floor = self.roots
        seen = PlaneSeen(np.zeros(2), self.floor.plane, floor).residuals(world, Box(shared))
        return np.concatenate([seen, shared[..., _LASER] @ laser, shared[..., _CAMERAS] / self.cameras_std], axis=-1)


@dataclass(frozen=True, eq=False)
class Solution:
    """What the least squares found.

    Attributes
    ----------
    shared : (10,) float64
    boxes : tuple of (8,) float64
    covariance : (10 + 8 n, 10 + 8 n) float64
        Of all, `shared` first.
    cost : float
        Half the sum of the squared residuals, in standard deviations; those that may be mistaken count less.
    log_volume : float
        Half the logarithm of the covariance's determinant.
    misfits : tuple of (m,) float64
        Of each box's observations: root mean square residual, far ones counting less.
    excess : float
        What the laser's readings and its pose, and what the pictures show of the boxes, cost more than they would on
        average.
    given : dict
        What of the variances (10 + 8 n,) comes from ``"floor"``, ``"laser"``, ``"cameras"``, and from each kind of
        observation, by the name of its class: they add up to the covariance's diagonal.
    """

    shared: Float64
    boxes: tuple[Float64, ...]
    covariance: Float64
    cost: float
    log_volume: float
    misfits: tuple[Float64, ...]
    excess: float
    given: dict[str, Float64]

    @property
    def laser(self) -> Float64:
        """Shift (mm) and turn (rad) of the laser from where it was calibrated. (3,)."""
        return self.shared[_LASER]

    @property
    def laser_std(self) -> Float64:
        """Standard deviations of `laser`. (3,)."""
        return np.sqrt(np.diag(self.covariance))[_LASER]

    def at(self, own: Float64) -> Solution:
        """The same, with other parameters of its first box, (8,)."""
        return replace(self, boxes=(own, *self.boxes[1:]))

    def of_box(self, box: int) -> tuple[Float64, Float64]:
        """Shared and own parameters of a box in one vector (18,), and their covariance (18, 18)."""
        at = _places(box)
        return np.concatenate([self.shared, self.boxes[box]]), self.covariance[np.ix_(at, at)]


@dataclass(frozen=True, eq=False)
class Seen:
    """One box before the least squares.

    Attributes
    ----------
    start : (8,) float64
        In the order of `Own`.
    observations : sequence of Observation
    """

    start: Float64
    observations: Sequence[Observation] = field(default_factory=tuple)


def solve(priors: Priors, seen: Sequence[Seen], shared: Float64 | None = None) -> Solution:
    """Find what all boxes and the shared parameters are.

    Parameters
    ----------
    priors : Priors
    seen : sequence of Seen
    shared : (10,) float64, optional
        Where to start.

    Returns
    -------
    Solution

    Notes
    -----
    Minimises ``sum rho(r^2) / 2`` over all residuals r in standard deviations: ``rho(s) = s`` for what is known, and
    ``C^2 log(1 + s / C^2)`` (Cauchy's, C = 2.5) for observations that may be mistaken. The first Gauss-Newton step
    takes them all for right, so that the start tells little about which are mistaken; the others weigh each with
    ``rho' + 2 s rho''``, as Newton's would, and after a step that gained nothing with ``rho'``, damped if need be. They
    end when ``g' H^-1 g / 2``, the cost that another would gain, is small. The covariance is ``(J' W J)^-1``,
    ``W = rho'``.

    References
    ----------
    Triggs, McLauchlan, Hartley, Fitzgibbon: Bundle adjustment - a modern synthesis. Vision Algorithms (2000), section
    4.3, doi:10.1007/3-540-44480-7_21.
    """
    problem = _Problem(priors, tuple(seen))
    start = np.concatenate([np.zeros(len(Shared)) if shared is None else shared, *(s.start for s in seen)])
    x, r, J = _minimum(problem, start)
    rho, weight, _ = problem.loss(r**2)
    precision = J.T @ (weight[:, None] * J)
    unit = 1 / np.sqrt(np.diag(precision))
    alike = precision * np.outer(unit, unit)
    covariance = np.linalg.inv(alike) * np.outer(unit, unit)
    cost, of_scan = 0.5 * (rho - 1), problem.of_scan
    return Solution(
        shared=x[: len(Shared)],
        boxes=tuple(x[_places(k)[len(Shared) :]] for k in range(len(seen))),
        covariance=covariance,
        cost=float(0.5 * rho.sum()),
        log_volume=float(np.log(unit).sum() - 0.5 * np.linalg.slogdet(alike)[1]),
        misfits=problem.misfits(rho),
        excess=sum(max(float(cost[some].sum()), 0.0) for some in (of_scan, problem.robust & ~of_scan)),
        given=problem.sorted_by_kind(weight * (covariance @ J.T) ** 2),
    )


def _minimum(problem: _Problem, x: Float64) -> tuple[Float64, Float64, Float64]:
    """Where the cost is least, from a start on; residuals and Jacobian there."""
    (r, J), how, damping = problem.at(x), _Step.PLAIN, 0.0
    rho, slope, curvature = problem.loss(r**2)
    alike = np.ones_like(r)
    for _ in range(_MOST_STEPS):
        pull, bend = {_Step.PLAIN: (alike, alike), _Step.NEWTON: (slope, curvature), _Step.SAFE: (slope, slope)}[how]
        gradient, hessian = J.T @ (pull * r), J.T @ (bend[:, None] * J)
        step = np.linalg.solve(hessian + damping * np.diag(np.diag(hessian)), gradient)
        if how is not _Step.PLAIN and 0.5 * float(gradient @ step) < _TOLERANCE:
            break
        there = problem.at(x - step)
        loss = problem.loss(there[0] ** 2)
        if loss[0].sum() < rho.sum():
            x, (r, J), (rho, slope, curvature) = x - step, there, loss
            how, damping = _Step.NEWTON, _UNDAMPED * damping
        else:
            damping = max(_DAMPED * damping, _LEAST_DAMPING) if how is _Step.SAFE else damping
            how = _Step.SAFE
    return x, r, J


def _places(box: int) -> Ints:
    """Where shared and own parameters of a box stand in the vector of all."""
    return np.concatenate([np.arange(len(Shared)), len(Shared) + len(Own) * box + np.arange(len(Own))])


def _grouped(observations: Sequence[Observation]) -> list[tuple[Observation, ...]]:
    """Edges together, priors together, all others alone: a group's residuals are taken at once."""
    edges = tuple(o for o in observations if isinstance(o, EdgeSeen))
    priors = tuple(o for o in observations if isinstance(o, OwnPrior))
    rest: list[tuple[Observation, ...]] = [(o,) for o in observations if not isinstance(o, EdgeSeen | OwnPrior)]
    together: list[tuple[Observation, ...]] = [group for group in (edges, priors) if group]
    return together + rest


def _residuals(group: tuple[Observation, ...], world: World, box: Box) -> Numbers:
    if isinstance(group[0], EdgeSeen):
        return edge_residuals(cast(tuple[EdgeSeen, ...], group), world, box)
    if isinstance(group[0], OwnPrior):
        return prior_residuals(cast(tuple[OwnPrior, ...], group), box)
    return group[0].residuals(world, box)


class _Step(Enum):
    """How residuals that may be mistaken count in a step."""

    PLAIN = auto()  # as all others
    NEWTON = auto()  # by the curvature of their cost, where it is positive
    SAFE = auto()  # by its slope: gains wherever the model is linear


class _Problem:
    """Residuals and Jacobian of a scene.

    Their order: the shared ones, then box by box and group by group; `owners` tells whose each is.
    """

    def __init__(self, priors: Priors, seen: tuple[Seen, ...]) -> None:
        self._priors, self._seen = priors, seen
        self._groups = [_grouped(box.observations) for box in seen]
        self.owners: list[Observation | None] = []
        self.robust = np.zeros(0, bool)

    def at(self, x: Float64) -> tuple[Float64, Float64]:
        """Residuals (m,) and their Jacobian (m, n)."""
        shared = len(Shared)
        moved = x[:shared] + _STEPS[:, :shared]
        world = self._priors.world(moved)
        parts: list[tuple[Ints, Numbers]] = [(np.arange(shared), self._priors.residuals(moved, world)[:shared])]
        owners: list[Observation | None] = [None] * parts[0][1].shape[-1]
        for k, groups in enumerate(self._groups):
            at = _places(k)
            box = Box(x[at[shared:]] + _STEPS[:, shared:])
            for group in groups:
                parts.append((at, _residuals(group, world, box)))
                if not self.owners:
                    owners += [o for o in group for _ in range(parts[-1][1].shape[-1] // len(group))]
        if not self.owners:
            self.owners = owners
            self.robust = np.array([o is not None and o.robust for o in owners])
        J, row = np.zeros((len(self.owners), len(x))), 0
        for at, part in parts:
            J[row : row + part.shape[-1], at] = part.imag.T / COMPLEX_STEP
            row += part.shape[-1]
        return np.concatenate([part[0].real for _, part in parts]), J

    def loss(self, s: Float64) -> Float64:
        """Value of rho, slope ``rho'`` and curvature ``rho' + 2 s rho''`` (0 where it is negative): (3, m)."""
        t = 1 + s / _REACH**2
        cauchy = np.stack([_REACH**2 * np.log(t), 1 / t, np.maximum(2 - t, 0) / t**2])
        return np.where(self.robust, cauchy, np.stack([s, np.ones_like(s), np.ones_like(s)]))

    @property
    def of_scan(self) -> Bools:
        """Which residuals depend on the laser's pose."""
        mine = np.array([o is not None and o.of_scan for o in self.owners])
        mine[_LASER] = True
        return mine

    def sorted_by_kind(self, parts: Float64) -> dict[str, Float64]:
        """Sum columns (one a residual) by what gave them."""
        known = ["floor"] * 3 + ["laser"] * 3 + ["cameras"] * 4
        names = known + [type(o).__name__ for o in self.owners[len(known) :]]
        return {name: parts[:, [other == name for other in names]].sum(axis=1) for name in dict.fromkeys(names)}

    def misfits(self, cost: Float64) -> tuple[Float64, ...]:
        """Root of the mean cost of each observation of each box, in the order in which they were given."""
        costs: dict[int, list[float]] = {}
        for o, value in zip(self.owners, cost.tolist(), strict=True):
            costs.setdefault(id(o), []).append(value)
        return tuple(np.array([np.sqrt(np.mean(costs[id(o)])) for o in box.observations]) for box in self._seen)
