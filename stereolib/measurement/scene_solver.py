"""The one least squares: all boxes of a scene, and what they share, from everything that was observed of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import least_squares

from stereolib.base import Bools, Float64, Ints
from stereolib.measurement.box import COMPLEX_STEP, Box, Numbers, Own, Shared, World
from stereolib.measurement.floor import Floor
from stereolib.measurement.laser_on_floor import LaserOnFloor
from stereolib.measurement.observations import (
    Observation,
    PlaneSeen,
    Residuals,
    whitening,
)

_REACH = 2.5  # standard deviations beyond which an observation that may be mistaken counts less and less
_NO_REACH = 1e6  # of the others
_TOLERANCE = 1e-4  # relative: a hundredth of a standard deviation at most
_MOST_STEPS = 40
_LASER = slice(Shared.LASER_X, Shared.LASER_SCALE + 1)
_CAMERAS = slice(Shared.OFFSET, None)
#: What errs alike in all pairs of one calibration: the laser's pose and scale, and of the cameras all but the rows.
_COMMON = [0, 1, 2, 3, 4, 6, 7]  # of the laser's four and the cameras' four
COMMON_ERRORS = len(_COMMON)
_STEPS = 1j * COMPLEX_STEP * np.eye(len(Shared) + len(Own))
_FLOOR_ROUNDING = np.array([1e-5, 1e-5, 1e-3])  # of a floor's plane: one that is given is known so well at most
#: What the parameters are off at first, at most: the first step goes no farther.
_SHARED_SCALE = np.array([0.1, 0.01, 0.01, 10.0, 10.0, 0.01, 0.01, 1.0, 1.0, 0.01, 0.01])
_OWN_SCALE = np.array([10.0, 10.0, 0.01, 10.0, 10.0, 10.0, 5.0, 5.0])


@dataclass(frozen=True, eq=False)
class Priors:
    """What is known beforehand of what all boxes share.

    Attributes
    ----------
    floor : Floor
        As it was seen.
    laser : LaserOnFloor
        As it was calibrated.
    cameras : (4, 4) float64
        Covariance of `Shared`'s last four, from the calibration: offset and rows (px), focal length and baseline
        (shares).
    """

    floor: Floor
    laser: LaserOnFloor
    cameras: Float64

    def world(self, shared: Numbers) -> World:
        """Cameras, floor and laser for shared parameters.

        Parameters
        ----------
        shared : (..., 11)

        Returns
        -------
        World
        """
        return World.of(self.floor, self.laser.t, self.laser.yaw_rad, shared)

    @cached_property
    def roots(self) -> tuple[Float64, Float64, Float64]:
        """What makes errors of laser, floor and cameras independent: (4, 4), (3, 3) and (4, 4)."""
        floor = self.floor.covariance + np.diag(_FLOOR_ROUNDING**2)
        return whitening(self.laser.covariance), whitening(floor), whitening(self.cameras)

    @property
    def common(self) -> Float64:
        """How many of the residuals' standard deviations each error is that all pairs of a calibration share. (8, 7).

        For one standard deviation of each: columns of the covariance's symmetric root, so that they mean the same in
        every pair; rows are the residuals of laser and cameras.
        """
        laser, _, cameras = self.roots
        both = block_diag(laser.T @ _root(self.laser.covariance), cameras.T @ _root(self.cameras))
        return np.asarray(both[:, _COMMON])

    def residuals(self, shared: Numbers, world: World) -> Numbers:
        """Shared parameters minus what is known of them, and the floor, in standard deviations: (..., 11).

        Parameters
        ----------
        shared : (..., 11)
        world : World
            Of them.

        Returns
        -------
        (..., 11)
        """
        laser, _, cameras = self.roots
        seen = self._floor_seen(world, Box(shared))
        return np.concatenate([seen, shared[..., _LASER] @ laser, shared[..., _CAMERAS] @ cameras], axis=-1)

    @cached_property
    def _floor_seen(self) -> Residuals:
        return PlaneSeen.together((PlaneSeen(np.zeros(2), self.floor.plane, self.roots[1]),))


@dataclass(frozen=True, eq=False)
class Solution:
    """What the least squares found.

    Attributes
    ----------
    shared : (11,) float64
    boxes : tuple of (8,) float64
    covariance : (11 + 8 n, 11 + 8 n) float64
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
        What of the variances (11 + 8 n,) comes from ``"floor"``, ``"laser"``, ``"cameras"``, and from each kind of
        observation, by the name of its class: they add up to the covariance's diagonal.
    common : (11 + 8 n, 7) float64
        What all are off for one standard deviation of each error that other pairs of the same calibration share
        (`Priors.common`): ``common @ common.T`` is a part of the covariance.
    """

    shared: Float64
    boxes: tuple[Float64, ...]
    covariance: Float64
    cost: float
    log_volume: float
    misfits: tuple[Float64, ...]
    excess: float
    given: dict[str, Float64]
    common: Float64

    @property
    def laser(self) -> Float64:
        """Shift (mm), turn (rad) and change of scale (share) of the laser since its calibration. (4,)."""
        return self.shared[_LASER]

    @property
    def laser_std(self) -> Float64:
        """Standard deviations of `laser`. (4,)."""
        return np.sqrt(np.diag(self.covariance))[_LASER]

    def on_floor(self, laser: LaserOnFloor) -> LaserOnFloor:
        """A laser as it was calibrated, where this has it and as well known."""
        known, moved = self.covariance[_LASER, _LASER], laser.moved(*self.laser)
        return replace(moved, covariance=known, common=self.common[_LASER])

    def at(self, own: Float64) -> Solution:
        """The same, with other parameters of its first box, (8,)."""
        return replace(self, boxes=(own, *self.boxes[1:]))

    def of_box(self, box: int) -> tuple[Float64, Float64]:
        """Shared and own parameters of a box in one vector (19,), and their covariance (19, 19)."""
        at = _places(box)
        return np.concatenate([self.shared, self.boxes[box]]), self.covariance[np.ix_(at, at)]

    def common_of_box(self, box: int) -> Float64:
        """`common` of the parameters of `of_box`. (19, 7)."""
        return self.common[_places(box)]


@dataclass(frozen=True, eq=False)
class Seen:
    """One box before the least squares.

    Attributes
    ----------
    start : (8,) float64
        In the order of `Own`.
    observations : sequence of Observation
    shared : (11,) float64
        What is shared, as this box has it: the search begins at the mean.
    """

    start: Float64
    observations: Sequence[Observation] = field(default_factory=tuple)
    shared: Float64 = field(default_factory=lambda: np.zeros(len(Shared)))


def solve(priors: Priors, seen: Sequence[Seen], *, tolerance: float = _TOLERANCE) -> Solution:
    """Find what all boxes and the shared parameters are.

    Parameters
    ----------
    priors : Priors
    seen : sequence of Seen
    tolerance : float
        Relative, of the cost and of the way from the start: where it ends. A solution that only predicts where
        something is seen may be a hundredth off.

    Returns
    -------
    Solution

    Notes
    -----
    Minimises ``sum rho(r^2)`` over all residuals r in standard deviations, by `scipy.optimize.least_squares` with the
    Jacobian of `derivatives`. ``rho(s) = s`` for what is known, and ``C^2 log(1 + s / C^2)`` (Cauchy's, C = 2.5) for
    observations that may be mistaken. The covariance is ``(J' W J)^-1``, ``W = rho'``.
    """
    problem = _Problem(priors, tuple(seen))
    shared = np.mean([s.shared for s in seen], axis=0) if seen else np.zeros(len(Shared))
    x0 = np.concatenate([shared, *(s.start for s in seen)])
    scale = np.concatenate([_SHARED_SCALE, *([_OWN_SCALE] * len(seen))])
    found = least_squares(
        lambda y: problem.at(x0 + scale * y)[0],
        np.zeros(len(x0)),
        jac=lambda y: problem.at(x0 + scale * y)[1] * scale,
        loss=problem.loss,
        xtol=tolerance,
        ftol=tolerance,
        max_nfev=_MOST_STEPS,
    )
    x = x0 + scale * found.x
    r, J = problem.at(x)
    rho, weight, _ = problem.loss(r**2)
    unit = J * (np.sqrt(weight)[:, None] * scale)
    precision = unit.T @ unit
    covariance = np.linalg.inv(precision) * np.outer(scale, scale)
    volume = float(np.log(scale).sum() - 0.5 * np.linalg.slogdet(precision)[1])
    boxes = tuple(x[_places(k)[len(Shared) :]] for k in range(len(seen)))
    given = problem.sorted_by_kind(weight * (covariance @ J.T) ** 2)
    known = slice(Shared.LASER_X, len(Shared))  # residuals of laser and cameras stand where their parameters do
    common = (covariance @ J[known].T * np.sqrt(weight[known])) @ priors.common
    cost, of_scan = 0.5 * (rho - 1), problem.of_scan
    excess = sum(max(float(cost[some].sum()), 0.0) for some in (of_scan, problem.robust & ~of_scan))
    misfits = problem.misfits(rho)
    return Solution(x[: len(Shared)], boxes, covariance, float(found.cost), volume, misfits, excess, given, common)


def _root(covariance: Float64) -> Float64:
    """The symmetric root of a covariance."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T)


def _places(box: int) -> Ints:
    """Where shared and own parameters of a box stand in the vector of all."""
    return np.concatenate([np.arange(len(Shared)), len(Shared) + len(Own) * box + np.arange(len(Own))])


class _Problem:
    """Residuals and Jacobian of a scene, kept for the last point: `least_squares` asks for them one after the other.

    Their order: the shared ones, then box by box and kind by kind; `owners` tells whose each is.
    """

    def __init__(self, priors: Priors, seen: tuple[Seen, ...]) -> None:
        self._priors = priors
        self.owners: list[Observation | None] = [None] * len(Shared)
        self._boxes: list[list[Residuals]] = []
        self._numbers: list[Ints] = []  # of the observation that each residual of a box belongs to
        for box in seen:
            kinds: dict[type[Observation], list[int]] = {}
            for k, o in enumerate(box.observations):
                kinds.setdefault(type(o), []).append(k)
            self._boxes.append([kind.together([box.observations[k] for k in some]) for kind, some in kinds.items()])
            numbers = [k for some in kinds.values() for k in some for _ in range(box.observations[k].count)]
            self._numbers.append(np.array(numbers, int))
            self.owners += [box.observations[k] for k in numbers]
        self.robust = np.array([o is not None and o.robust for o in self.owners])
        self._reach = np.where(self.robust, _REACH**2, _NO_REACH**2)
        self._last: tuple[bytes, tuple[Float64, Float64]] = (b"", (np.zeros(0), np.zeros((0, 0))))

    def at(self, x: Float64) -> tuple[Float64, Float64]:
        """Residuals (m,) and their Jacobian (m, n)."""
        if self._last[0] != x.tobytes():
            self._last = (x.tobytes(), self._evaluate(x))
        return self._last[1]

    def _evaluate(self, x: Float64) -> tuple[Float64, Float64]:
        n = len(Shared)
        shared = x[:n] + _STEPS[:, :n]
        world = self._priors.world(shared)
        parts = [self._priors.residuals(shared, world)]
        J, row = np.zeros((len(self.owners), len(x))), n
        J[:n, :n] = parts[0].imag[:n].T
        for residuals, at in zip(self._boxes, range(n, len(x), len(Own)), strict=True):
            box = Box(x[at : at + len(Own)] + _STEPS[:, n:])
            parts.append(np.concatenate([each(world, box) for each in residuals], axis=-1))
            rows = slice(row, row := row + parts[-1].shape[-1])
            J[rows, :n], J[rows, at : at + len(Own)] = parts[-1].imag[:n].T, parts[-1].imag[n:].T
        return np.concatenate([part[0].real for part in parts]), J / COMPLEX_STEP

    def loss(self, s: Float64) -> Float64:
        """Value and first two derivatives of rho: (3, m)."""
        t, rho = s / self._reach, np.empty((3, len(s)))
        rho[0] = self._reach * np.log1p(t)
        rho[1] = 1 / (1 + t)
        rho[2] = -(rho[1] ** 2) / self._reach
        return rho

    @property
    def of_scan(self) -> Bools:
        """Which residuals depend on the laser's pose."""
        mine = np.array([o is not None and o.of_scan for o in self.owners])
        mine[_LASER] = True
        return mine

    def sorted_by_kind(self, parts: Float64) -> dict[str, Float64]:
        """Sum columns (one a residual) by what gave them."""
        known = ["floor"] * 3 + ["laser"] * 4 + ["cameras"] * 4
        names = np.array(known + [type(o).__name__ for o in self.owners[len(known) :]])
        return {name: parts @ (names == name) for name in dict.fromkeys(names.tolist())}

    def misfits(self, cost: Float64) -> tuple[Float64, ...]:
        """Root of the mean cost of each observation of each box, in the order in which they were given."""
        ends = np.cumsum([len(Shared), *(len(numbers) for numbers in self._numbers)])
        parts = zip(self._numbers, np.split(cost, ends)[1:], strict=False)
        return tuple(np.sqrt(np.bincount(numbers, part) / np.bincount(numbers)) for numbers, part in parts)
