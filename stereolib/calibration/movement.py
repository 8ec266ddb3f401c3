"""What has moved since a calibration: the fewest movements of the right camera, and of focus, that explain boards."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from stereolib.base import Float64
from stereolib.calibration.board_views import BoardViews
from stereolib.calibration.bundle_adjustment import RigFit, fit_rig, inverse_normal, moved_rig
from stereolib.calibration.record import CalibrationRecord
from stereolib.rig import StereoRig

#: Movements that are fitted together, in rad, mm, and shares of a focal length, and how far each can be at most: more
#: is no camera that has slipped in its mount. Without these bounds one board would leave some of them open.
_FARTHEST = {
    "tilt": 0.1,
    "yaw": 0.1,
    "roll": 0.1,
    "baseline": 20.0,
    "rise": 20.0,
    "advance": 20.0,
    "left focus": 0.3,
    "right focus": 0.3,
}
MOVEMENTS = (*_FARTHEST, "both focus")  # the last: both focal lengths by the same share
_ROWS = np.vstack([np.eye(len(_FARTHEST)), [name.endswith("focus") for name in _FARTHEST]])  # each as a sum of those
_STEPS = 4  # of Gauss-Newton: a degree is 1e-2 rad, whose square a second one takes away
SURE = 4.0  # standard deviations: of nine movements and many checks, chance reaches less
_LEAST_PX = 0.05  # a movement that shifts corners by less, rms, matters to nobody


class Moved(NamedTuple):
    """One movement that boards show.

    Attributes
    ----------
    what : str
        A name of `MOVEMENTS`.
    value, std : float
        rad, mm, or a share of the focal length.
    alike : tuple of str
        Movements that would explain it as well.
    """

    what: str
    value: float
    std: float
    alike: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Movement:
    """How a rig differs from its calibration, as boards show it.

    Attributes
    ----------
    rig : StereoRig
        As it stands now: the calibrated lenses but for their focal lengths, the right camera moved.
    fit : RigFit
        The boards posed before it.
    values, std : (8,) float64
        All `MOVEMENTS` but the last, fitted together.
    correlation : (8, 8) float64
    named : tuple of Moved
        The fewest that explain the boards; empty if nothing has moved for sure.
    """

    rig: StereoRig
    fit: RigFit
    values: Float64
    std: Float64
    correlation: Float64
    named: tuple[Moved, ...]


def estimate_movement(views: BoardViews, rig: StereoRig, record: CalibrationRecord) -> Movement:
    """Find out how far a rig has moved since its calibration.

    Parameters
    ----------
    views : BoardViews
        Taken since then.
    rig : StereoRig
        The calibrated one.
    record : CalibrationRecord
        How sure it is.

    Returns
    -------
    Movement

    Notes
    -----
    With the boards' poses eliminated, the normal matrix N and the gradient g tell of the shared parameters ``S m + e``:
    movements m along the columns of S, and the calibration's error e with covariance C. Then g has the covariance
    ``V = sigma^2 N + N C N``, and generalised least squares gives ``m = (S' W S)^-1 S' N V^-1 g`` with
    ``W = N V^-1 N``. Movements are named one by one, the one that explains most first (stepwise regression), as long as
    each explains more than chance; what a name stands for is linearised where it ends, which is near, while all eight
    together may run far along what one board leaves open.
    """
    S, held = _directions(rig), np.diag(np.array(list(_FARTHEST.values())) ** -2.0)
    m, chosen = np.zeros(len(held)), list[int]()
    for _ in range(_STEPS):
        fit = fit_rig(views, moved_rig(rig, S @ m), free=False)
        N, g = fit.normal.sum(axis=0), fit.gradient.sum(axis=0)
        noise = (record.scatter * max(fit.sigma_px, record.sigma_px)) ** 2
        NV = np.linalg.solve(noise * np.eye(len(N)) + N @ record.covariance, np.column_stack([N, g]))
        W = S.T @ NV[:, :-1] @ S
        candidates = _Candidates((W + W.T) / 2 + held, S.T @ NV[:, -1] + W @ m)
        chosen = candidates.chosen()
        m = candidates.fitted(chosen)[0] @ _ROWS[chosen] if chosen else np.zeros(len(held))
    values, std, covariance = candidates.fitted(list(range(len(held))))
    pixels = np.sqrt(np.diag(S.T @ N @ S) / fit.known.sum())
    named = tuple(moved for moved in candidates.named(chosen) if _seen_px(moved, pixels) >= _LEAST_PX)
    return Movement(fit.rig, fit, values, std, covariance / np.outer(std, std), named)


def _directions(rig: StereoRig) -> Float64:
    """How the shared parameters change with each movement. (s, 8)."""
    n = 4 + rig.left.dist.size
    S = np.zeros((2 * n + 6, len(_FARTHEST)))
    S[2 * n : 2 * n + 3, :3] = np.eye(3)
    along = rig.T / rig.baseline_mm
    down = np.array([0.0, 1.0, 0.0]) - along[1] * along
    down /= np.linalg.norm(down)
    S[-3:, 3], S[-3:, 4] = along, down
    S[-3:, 5] = np.cross(along, down)  # T points to the left: towards what is seen is -z
    for column, camera, first in ((6, rig.left, 0), (7, rig.right, n)):
        S[first : first + 2, column] = camera.K[0, 0], camera.K[1, 1]
    return S


def _seen_px(moved: Moved, pixels: Float64) -> float:
    """By how much a movement shifts corners, rms, when every board is posed anew."""
    return float(abs(moved.value) * np.linalg.norm(_ROWS[MOVEMENTS.index(moved.what)] * pixels))


@dataclass(frozen=True, eq=False)
class _Candidates:
    """What the boards say of the movements: the normal matrix of those fitted together, and its right-hand side."""

    W: Float64
    found: Float64

    def fitted(self, chosen: list[int]) -> tuple[Float64, Float64, Float64]:
        """Values of the chosen ones alone, their deviations and covariance."""
        some = _ROWS[chosen]
        covariance = inverse_normal(some @ self.W @ some.T)
        return covariance @ some @ self.found, np.sqrt(np.diag(covariance)), covariance

    def explained(self, chosen: list[int]) -> float:
        """Squares, in deviations, that the chosen ones explain."""
        return float(self.fitted(chosen)[0] @ _ROWS[chosen] @ self.found) if chosen else 0.0

    def chosen(self) -> list[int]:
        """The fewest that explain all but chance: the best one is added, what it makes superfluous is taken away."""
        chosen: list[int] = []
        for _ in range(len(self.W)):
            others = [k for k in range(len(_ROWS)) if k not in chosen]
            more = [*chosen, max(others, key=lambda k: self.explained([*chosen, k]))]
            if self.explained(more) - self.explained(chosen) < SURE**2:
                break
            chosen = [k for k in more if self.explained(more) - self.explained(_without(more, k)) >= SURE**2]
        return chosen

    def named(self, chosen: list[int]) -> Iterator[Moved]:
        """The chosen ones, each with those that could stand in its place."""
        if not chosen:
            return
        others = [k for k in range(len(_ROWS)) if k not in chosen]
        least = self.explained(chosen) - SURE**2
        for k, value, std in zip(chosen, *self.fitted(chosen)[:2], strict=True):
            alike = [other for other in others if self.explained([*_without(chosen, k), other]) > least]
            yield Moved(MOVEMENTS[k], float(value), float(std), tuple(MOVEMENTS[other] for other in alike))


def _without(chosen: list[int], k: int) -> list[int]:
    return [other for other in chosen if other != k]
