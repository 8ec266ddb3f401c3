"""Whether laser or cameras have moved since their calibration, as the scene itself tells, and what follows from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from stereolib.base import Float64
from stereolib.measurement.box import Shared
from stereolib.measurement.scene_solver import Priors, Seen, Solution, solve

_MOVED_LASER = np.diag([50.0**2, 50.0**2, np.radians(5.0) ** 2])  # how far, if it has; its scale stays
_MOVED_OFFSET_PX = np.array([[1.0**2]])  # by which a camera turned a little shifts all disparities, squared
_LASER_ODDS, _CAMERA_ODDS = 0.1, 0.02  # that they have moved, before anything was seen: a laser's mount is home-made
_LASER, _CAMERAS = slice(Shared.LASER_X, Shared.LASER_SCALE + 1), slice(Shared.OFFSET, len(Shared))
_POSE = slice(0, len(_MOVED_LASER))  # in the former
# Moving gains no more of cost than this excess, and cameras are no likelier to have moved: one solution tells enough.
_LEAST_EXCESS, _LEAST_CHANCE = 3.0, 0.05


class Moved(Enum):
    """What has moved since its calibration."""

    NOTHING = "nothing"
    LASER = "the laser"
    CAMERAS = "the cameras"
    BOTH = "the laser and the cameras"

    @property
    def laser(self) -> bool:
        """The laser has."""
        return self in (Moved.LASER, Moved.BOTH)

    @property
    def cameras(self) -> bool:
        """The cameras have."""
        return self in (Moved.CAMERAS, Moved.BOTH)


@dataclass(frozen=True, eq=False)
class Judged:
    """A solution over all hypotheses.

    Attributes
    ----------
    solution : Solution
        Mean and covariance over the hypotheses, each with its probability.
    probability : dict
        Of what has moved.
    scanned : bool
        Objects that both sensors show took part: they tell where the laser is.
    """

    solution: Solution
    probability: dict[Moved, float]
    scanned: bool = True

    def chance(self, *, laser: bool = False, cameras: bool = False) -> float:
        """Probability that the laser, or the cameras, have moved.

        Parameters
        ----------
        laser, cameras : bool
            Which of them; both: one of them at least.

        Returns
        -------
        float, 0..1
        """
        return sum(p for what, p in self.probability.items() if (laser and what.laser) or (cameras and what.cameras))


def judge(priors: Priors, seen: Sequence[Seen], *, scanned: bool) -> Judged:
    """Solve a scene with laser and cameras where they were calibrated, and moved; weigh the solutions.

    Parameters
    ----------
    priors : Priors
    seen : sequence of Seen
    scanned : bool
        A scan takes part; without it nothing tells.

    Returns
    -------
    Judged

    Notes
    -----
    A hypothesis H weighs ``P(H) exp(-cost) sqrt(det C / det C0)`` (Laplace's approximation of its evidence), C the
    covariance of its solution and C0 that of its priors. What moving could gain at most is the misfit there is: where
    that is too little, none is solved anew, but told from the first solution, linearised, unless the cameras may well
    have moved. The laser is then as likely to have moved as it was: of some ways, as the slide along one lone face,
    such a scene tells nothing.
    """
    first = solve(priors, seen)
    if not scanned:
        return Judged(first, {Moved.NOTHING: 1.0}, scanned)
    if first.excess <= _LEAST_EXCESS and (linear := _linearised(priors, first)).chance(cameras=True) < _LEAST_CHANCE:
        return linear
    solutions, logs = {Moved.NOTHING: first}, {Moved.NOTHING: _evidence(Moved.NOTHING, priors, first)}
    for what in (Moved.LASER, Moved.CAMERAS, Moved.BOTH):
        wide, nearest = widened(priors, what), min(solutions.values(), key=lambda solution: solution.cost)
        starts = [replace(s, start=x, shared=nearest.shared) for s, x in zip(seen, nearest.boxes, strict=True)]
        solutions[what] = solve(wide, starts)
        logs[what] = _evidence(what, wide, solutions[what])
    top = max(logs.values())
    weights = {what: float(np.exp(value - top)) for what, value in logs.items()}
    total = sum(weights.values())
    probability = {what: weight / total for what, weight in weights.items()}
    return Judged(_mixed(solutions, probability), probability, scanned)


def widened(priors: Priors, what: Moved) -> Priors:
    """Priors if something has moved.

    Parameters
    ----------
    priors : Priors
    what : Moved

    Returns
    -------
    Priors
        With variances added: of the laser's pose (50 mm, 50 mm, 5 degrees)^2, of the disparities' offset (1 px)^2.
    """
    laser, cameras = priors.laser, priors.cameras.copy()
    if what.laser:
        covariance = laser.covariance.copy()
        covariance[_POSE, _POSE] += _MOVED_LASER
        laser = replace(laser, covariance=covariance)
    if what.cameras:
        cameras[:1, :1] += _MOVED_OFFSET_PX
    return replace(priors, laser=laser, cameras=cameras)


def _linearised(priors: Priors, first: Solution) -> Judged:
    """What the solution with nothing moved tells of the others; the laser keeps its odds and stays where it is."""
    loose, _ = _loosened(first, _LASER, priors.laser.covariance, _MOVED_LASER)
    turned, gain = _loosened(first, _CAMERAS, priors.cameras, _MOVED_OFFSET_PX)
    weight = _CAMERA_ODDS * float(np.exp(gain))
    chance = weight / (1 + weight)
    solutions = {Moved.NOTHING: first, Moved.LASER: replace(first, covariance=loose.covariance), Moved.CAMERAS: turned}
    still = {Moved.NOTHING: 1 - _LASER_ODDS, Moved.LASER: _LASER_ODDS}
    shares = {what: (1 - chance) * share for what, share in still.items()} | {Moved.CAMERAS: chance}
    return Judged(_mixed(solutions, shares), {Moved.NOTHING: 1 - chance, Moved.CAMERAS: chance})


def _loosened(solution: Solution, at: slice, known: Float64, moved: Float64) -> tuple[Solution, float]:
    """The same with some shared parameters, of a known covariance, less well known, linearised; and its log evidence.

    The first of them may have moved, by a covariance M. By Woodbury's formula, twice: a wider prior has the precision
    ``P^-1 - U S^-1 U'`` with ``U = P^-1 E``, E the moved ones' columns, and ``S = M^-1 + E' U``; so the covariance is
    ``C + C_a U T^-1 U' C_a'`` with ``T = S - U' C_aa U``, the shift ``C_a U T^-1 t`` with ``t = U' x_a``, and the
    evidence, over that of nothing moved, ``det(M T)^-1/2 exp(t' T^-1 t / 2)``.
    """
    U, C = np.linalg.inv(known)[:, : len(moved)], solution.covariance
    told, t = C[:, at] @ U, U.T @ solution.shared[at]
    left = np.linalg.inv(moved) + U[: len(moved)] - U.T @ told[at]
    by = told @ np.linalg.inv(left)
    shared, *boxes = np.split(by @ t, np.arange(len(Shared), len(C), len(solution.boxes[0])) if solution.boxes else [])
    found = replace(
        solution,
        shared=solution.shared + shared,
        boxes=tuple(own + move for own, move in zip(solution.boxes, boxes, strict=True)),
        covariance=C + by @ told.T,
    )
    return found, 0.5 * float(t @ np.linalg.solve(left, t) - np.linalg.slogdet(moved @ left)[1])


def _prior_log(what: Moved, priors: Priors) -> float:
    """Logarithm of a hypothesis's probability, over the volume of what it leaves open."""
    odds = what.laser * np.log(_LASER_ODDS) + what.cameras * np.log(_CAMERA_ODDS)
    volume = 0.5 * sum(np.linalg.slogdet(known)[1] for known in (priors.laser.covariance, priors.cameras))
    return float(odds - volume)


def _evidence(what: Moved, priors: Priors, solution: Solution) -> float:
    return _prior_log(what, priors) - solution.cost + solution.log_volume


def _mixed(solutions: dict[Moved, Solution], probability: dict[Moved, float]) -> Solution:
    """Mean and covariance of a mixture: ``sum p (C + (x - mean)(x - mean)')``."""
    best = solutions[max(probability, key=lambda what: probability[what])]
    vectors = {what: np.concatenate([s.shared, *s.boxes]) for what, s in solutions.items()}
    mean: Float64 = np.sum([probability[what] * x for what, x in vectors.items()], axis=0)
    spread = [
        probability[what] * (solutions[what].covariance + np.outer(x - mean, x - mean)) for what, x in vectors.items()
    ]
    boxes = np.split(mean[len(Shared) :], len(best.boxes)) if best.boxes else []
    return replace(best, shared=mean[: len(Shared)], boxes=tuple(boxes), covariance=np.sum(spread, axis=0))
