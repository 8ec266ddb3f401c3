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
_MOVED_OFFSET_PX = 1.0  # by which a camera turned a little shifts all disparities
_LASER_ODDS, _CAMERA_ODDS = 0.1, 0.02  # that they have moved, before anything was seen: a laser's mount is home-made
_LASER = slice(Shared.LASER_X, Shared.LASER_SCALE + 1)
_POSE = slice(0, len(_MOVED_LASER))  # in it
_LEAST_EXCESS = 3.0  # of cost: moving gains no more, which outweighs no odds


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
    that is too little, none is solved. What such a scene tells nothing of, as the slide along one lone face, remains
    as likely to have moved as it was.
    """
    first = solve(priors, seen)
    if not scanned:
        return Judged(first, {Moved.NOTHING: 1.0}, scanned)
    if first.excess <= _LEAST_EXCESS:
        loose, odds = _loosened(first, priors), _LASER_ODDS
        return Judged(
            _mixed({Moved.NOTHING: first, Moved.LASER: loose}, {Moved.NOTHING: 1 - odds, Moved.LASER: odds}),
            {Moved.NOTHING: 1.0},
            scanned,
        )
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
        cameras[0, 0] += _MOVED_OFFSET_PX**2
    return replace(priors, laser=laser, cameras=cameras)


def _loosened(solution: Solution, priors: Priors) -> Solution:
    """The same with the laser's pose less well known.

    By Woodbury's formula, twice: a wider prior has the precision ``P^-1 - U S^-1 U'`` with ``U = P^-1 E``, E the pose's
    columns, and ``S = M^-1 + E' U``; so the covariance is ``C + C_L U (S - U' C_LL U)^-1 U' C_L'``.
    """
    precision, C = np.linalg.inv(priors.laser.covariance), solution.covariance
    U = precision[:, _POSE]
    told = C[:, _LASER] @ U
    left = np.linalg.inv(_MOVED_LASER) + U[_POSE] - U.T @ told[_LASER]
    return replace(solution, covariance=C + told @ np.linalg.solve(left, told.T))


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
