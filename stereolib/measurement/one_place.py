"""Two objects that would stand in one another: bodies cannot, so at least one of them is mistaken."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from stereolib.base import Float64
from stereolib.measurement.measured_object import MeasuredObject
from stereolib.measurement.reasons import Reason, Why

_LEAST_MM, _SURE_STDS = 5.0, 2.0  # by which one reaches into another: less is chance, or both touch
_SHAPES = ("box", "face")  # whose outlines have sides


def without_shared_places(objects: Sequence[MeasuredObject]) -> list[MeasuredObject]:
    """Objects without length and width where two of them would stand in one another; heights remain.

    Parameters
    ----------
    objects : sequence of MeasuredObject

    Returns
    -------
    list of MeasuredObject
        In their order.
    """
    found = list(objects)
    for i, j in combinations(range(len(found)), 2):
        one, other = objects[i], objects[j]
        if one.shape not in _SHAPES or other.shape not in _SHAPES:
            continue
        into_mm = reach_into_mm(one.outline_mm, other.outline_mm)
        if into_mm > max(_LEAST_MM, _SURE_STDS * float(np.hypot(_std_mm(one), _std_mm(other)))):
            for k in (i, j):
                found[k] = found[k].without_outline(Why(Reason.IN_ANOTHER, f"by {into_mm:.0f} mm"))
    return found


def reach_into_mm(one_mm: Float64, other_mm: Float64) -> float:
    """How far an outline reaches into another: by so much one has to be moved for both to touch.

    Parameters
    ----------
    one_mm, other_mm : (N, 2) float64
        Corners of a rectangle, in their order, or both ends of a line.

    Returns
    -------
    float, mm
        Negative where they are apart.

    Notes
    -----
    The least overlap along the directions of the sides of both, and across them (separating axes).

    References
    ----------
    Gottschalk, Lin, Manocha: OBBTree: a hierarchical structure for rapid interference detection. SIGGRAPH 96,
    doi:10.1145/237170.237244.

    Examples
    --------
    >>> square = np.array([[0.0, 0], [10, 0], [10, 10], [0, 10]])
    >>> reach_into_mm(square, square + [8, 3]), reach_into_mm(square, np.array([[7.0, -5], [7, 20]]))
    (2.0, 3.0)
    """
    overlaps = list[float]()
    for corners in (one_mm, other_mm):
        along = (corners[1] - corners[0]) / np.hypot(*(corners[1] - corners[0]))
        for axis in (along, np.array([-along[1], along[0]])):
            a, b = one_mm @ axis, other_mm @ axis
            overlaps.append(float(min(a.max() - b.min(), b.max() - a.min())))
    return min(overlaps)


def _std_mm(item: MeasuredObject) -> float:
    """How well what is seen of it is known: its told sizes, and across its faces; an end that is cut is no harm."""
    known = np.diag(item.covariance)[:2]
    across = float(np.linalg.eigvalsh(item.position_covariance)[0])
    return float(np.sqrt(known[np.isfinite(known)].max(initial=0.0) + max(across, 0.0)))
