"""Edges of a box that contradict each other: one of them is mistaken, and what the others say without it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from stereolib.base import Float64
from stereolib.measurement.box import Edge, Own
from stereolib.measurement.edges import SHARP_PX
from stereolib.measurement.observations import EdgeSeen
from stereolib.measurement.scene_solver import Priors, Seen, Solution, solve

_CONTRADICTION = 2.7  # as `Solution.misfits` counts: four standard deviations
_SELDOM = np.log(100.0)  # a sharp edge of a face is mistaken so much more seldom than another, or one behind a top


def weigh_contradictions(
    priors: Priors, seen: Seen, solution: Solution, followed: Mapping[Edge, EdgeSeen]
) -> tuple[frozenset[Edge], Float64]:
    """What edges that contradict each other leave open of a box.

    Parameters
    ----------
    priors : Priors
    seen : Seen
    solution : Solution
        Of this box alone.
    followed : Mapping of EdgeSeen
        Where edges are roughly, from the following of faces alone: what is known of one that is left out.

    Returns
    -------
    doubtful : frozenset of Edge
        Those that miss the box by more than four standard deviations, if some do whichever edge is left out.
    doubt : (8, 8) float64
        Covariance of the box's parameters besides the solution's; 0 where no edge contradicts.

    Notes
    -----
    Each located edge is left out in turn. Solutions in which none contradicts any more are as likely as ``exp(-cost)``,
    and a hundredth of that where a sharp edge of a face was left out. The doubt is ``sum p (x - x0)(x - x0)'``, with x0
    the solution with all edges: where two edges alone tell a size, nobody knows which is wrong, and what hangs on
    neither stays as well known as it was.

    References
    ----------
    Baarda: A testing procedure for use in geodetic networks. Netherlands Geodetic Commission 2/5 (1968).
    """
    doubtful, none = _contradicting(seen, solution), np.zeros((len(Own), len(Own)))
    if not doubtful:
        return doubtful, none
    found = list[tuple[float, Float64]]()
    for mistaken in (o for o in seen.observations if isinstance(o, EdgeSeen) and o.located):
        others = tuple(o for o in seen.observations if o is not mistaken)
        known = (followed[mistaken.edge],) if mistaken.edge in followed else ()
        rest = replace(seen, observations=others + known)
        without = solve(priors, [rest])
        if not _contradicting(rest, without):
            seldom = _SELDOM if not mistaken.edge.is_back and mistaken.std_px < SHARP_PX else 0.0
            found.append((without.cost + seldom, without.boxes[0] - solution.boxes[0]))
    if not found:
        return doubtful, none
    return frozenset(), _doubt(found)


def weigh_ends(priors: Priors, seen: Seen, own: Float64) -> Float64:
    """What a scan leaves open of a box whose faces it confirms, but not where they end.

    Parameters
    ----------
    priors : Priors
    seen : Seen
        Of pictures and scan.
    own : (8,) float64
        The box as the pictures alone show it.

    Returns
    -------
    (8, 8) float64
        Covariance of the box's parameters besides the pictures' own; 0 where the scan misses the faces too, or where no
        single edge explains it.

    Notes
    -----
    Each upright edge that is not sharp is left out in turn. Where nothing contradicts any more, the pictures may be
    mistaken about it as well as the scan: ``sum p (x - own)(x - own)'`` with ``p = 1/2``, shared among such edges as
    in `weigh_contradictions`.
    """
    none = np.zeros((len(Own), len(Own)))
    found = list[tuple[float, Float64]]()
    upright, sharp = [o for o in seen.observations if isinstance(o, EdgeSeen) and o.edge.upright], sharp_edges(seen)
    for mistaken in (o for o in upright if o.edge not in sharp):
        rest = replace(seen, observations=tuple(o for o in seen.observations if o is not mistaken))
        without = solve(priors, [rest])
        if not (without.misfits[0] > _CONTRADICTION).any():
            found.append((without.cost, without.boxes[0] - own))
    return _doubt(found) / 2 if found else none


def sharp_edges(seen: Seen) -> frozenset[Edge]:
    """Edges of a box that the pictures show so sharply that they are hardly mistaken.

    Parameters
    ----------
    seen : Seen

    Returns
    -------
    frozenset of Edge
    """
    edges = (o for o in seen.observations if isinstance(o, EdgeSeen))
    return frozenset(o.edge for o in edges if o.located and o.std_px < SHARP_PX)


def _doubt(found: list[tuple[float, Float64]]) -> Float64:
    """Mean square of what solutions are off, weighted with how likely they are: ``exp(-cost)``."""
    costs, off = np.array([cost for cost, _ in found]), np.array([off for _, off in found])
    likely = np.exp(costs.min() - costs)
    return np.asarray((likely / likely.sum() * off.T) @ off)


def _contradicting(seen: Seen, solution: Solution) -> frozenset[Edge]:
    misfits = zip(seen.observations, solution.misfits[0].tolist(), strict=True)
    return frozenset(o.edge for o, misfit in misfits if isinstance(o, EdgeSeen) and misfit > _CONTRADICTION)
