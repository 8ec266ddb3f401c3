"""Edges of a box that contradict each other: one of them is mistaken, and what the others say without it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stereolib.base import Float64
from stereolib.measurement.box import Edge, Own
from stereolib.measurement.observations import EdgeSeen
from stereolib.measurement.scene_solver import Priors, Seen, Solution, solve

_CONTRADICTION = 2.7  # as `Solution.misfits` counts: four standard deviations


def weigh_contradictions(priors: Priors, seen: Seen, solution: Solution) -> tuple[frozenset[Edge], Float64]:
    """What edges that contradict each other leave open of a box.

    Parameters
    ----------
    priors : Priors
    seen : Seen
    solution : Solution
        Of this box alone.

    Returns
    -------
    doubtful : frozenset of Edge
        Those that miss the box by more than four standard deviations, if some do whichever edge is left out.
    doubt : (8, 8) float64
        Covariance of the box's parameters besides the solution's; 0 where no edge contradicts.

    Notes
    -----
    Each located edge is left out in turn. Solutions in which none contradicts any more are as likely as ``exp(-cost)``,
    and the doubt is ``sum p (x - x0)(x - x0)'``, x0 being the solution with all edges: where two edges alone tell a
    size, nobody knows which is wrong, and what hangs on neither stays as well known as it was.

    References
    ----------
    Baarda: A testing procedure for use in geodetic networks. Netherlands Geodetic Commission 2/5 (1968).
    """
    doubtful, none = _contradicting(seen, solution), np.zeros((len(Own), len(Own)))
    if not doubtful:
        return doubtful, none
    found = list[tuple[float, Float64]]()
    for mistaken in (o for o in seen.observations if isinstance(o, EdgeSeen) and o.located):
        rest = replace(seen, observations=tuple(o for o in seen.observations if o is not mistaken))
        without = solve(priors, [rest])
        if not _contradicting(rest, without):
            found.append((without.cost, without.boxes[0] - solution.boxes[0]))
    if not found:
        return doubtful, none
    costs, off = np.array([cost for cost, _ in found]), np.array([off for _, off in found])
    likely = np.exp(costs.min() - costs)
    return frozenset(), np.asarray((likely / likely.sum() * off.T) @ off)


def _contradicting(seen: Seen, solution: Solution) -> frozenset[Edge]:
    misfits = zip(seen.observations, solution.misfits[0].tolist(), strict=True)
    return frozenset(o.edge for o, misfit in misfits if isinstance(o, EdgeSeen) and misfit > _CONTRADICTION)
