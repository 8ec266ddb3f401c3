"""How far printed numbers may lie from what was rounded to them: worst cases, by interval arithmetic."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stereolib.base import Float64
from stereolib.paper.printed_rig import essential_factors, printed_camera_matrix, printed_essential
from stereolib.paper.printed_values import printed_item, printed_value
from stereolib.rig import skew


def printed_half_width(id: str) -> Float64:
    """Half a unit of the last printed decimal of each element: what was rounded lies no farther away.

    Parameters
    ----------
    id : str
        For example ``"stereo.E"``.

    Returns
    -------
    float64, shaped as the printed value, in its unit

    Examples
    --------
    >>> printed_half_width("scale.cm_per_px")
    array(0.0005)
    """
    item = printed_item(id)
    return np.asarray(np.broadcast_to(0.5 * 10.0 ** -np.asarray(item.digits, float), np.shape(item.value)))


def product_half_width(*factors: tuple[npt.ArrayLike, npt.ArrayLike]) -> Float64:
    """Bound how far a product of matrices moves when each element of each factor moves within its half width.

    Parameters
    ----------
    *factors : (matrix, half widths)
        From left to right; both of one shape.

    Returns
    -------
    float64, shaped as the product

    Notes
    -----
    ``|(A + dA)(B + dB)... - A B...| <= (|A| + a)(|B| + b)... - |A||B|...`` for ``|dA| <= a``, ``|dB| <= b``: no choice
    of the factors does worse, and where every element of the factors enters an element of the product once, some
    choice does as badly.

    Examples
    --------
    >>> product_half_width(([[2.0]], [[0.5]]), ([[-3.0]], [[0.1]]))
    array([[1.75]])
    """
    shapes = [np.asarray(matrix, float).shape for matrix, _ in factors]
    widest, middle = np.eye(shapes[0][0]), np.eye(shapes[0][0])
    for matrix, half_width in factors:
        widest = widest @ (np.abs(matrix) + np.asarray(half_width, float))
        middle = middle @ np.abs(matrix)
    return np.asarray(widest - middle)


def essential_budget(convention: str = "paper") -> Float64:
    """Bound how far the printed E may lie from the one that the printed R and T give, by their digits alone.

    Parameters
    ----------
    convention : "paper" | "opencv" | "rows"
        As `printed_essential`.

    Returns
    -------
    (3, 3) float64, mm

    Notes
    -----
    Half widths of R and T through the product (`product_half_width`), plus the printed E's own.
    """
    R, T = printed_half_width("stereo.R"), np.abs(skew(printed_half_width("stereo.T")))
    wide = {"R": R, "R'": R.T, "skew(T)": T}
    factors = [(matrix, wide[name]) for name, matrix in essential_factors(convention)]
    return product_half_width(*factors) + printed_half_width("stereo.E")


def fundamental_budget() -> Float64:
    """Bound how far the printed F may lie from the one that the printed E and Table I give, by their digits alone.

    Returns
    -------
    (3, 3) float64

    Notes
    -----
    ``F = A' E B`` with ``A = inv(K_R)``, ``B = inv(K_L)``. The inverse of ``[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]`` has
    the elements ``1/fx``, ``-cx/fx``, ``1/fy``, ``-cy/fy``, each monotonous in what is printed: the ends of the
    intervals give its half widths, `product_half_width` those of F, and the printed F's own are added.
    """
    E = np.asarray(printed_value("stereo.E")), printed_half_width("stereo.E")
    right, left = (_inverse_with_half_widths(side) for side in ("right", "left"))
    return product_half_width((right[0].T, right[1].T), E, left) + printed_half_width("stereo.F")


def _inverse_with_half_widths(side: str) -> tuple[Float64, Float64]:
    """Inverse of a printed camera matrix, and the half widths of its elements."""
    K, wide = printed_camera_matrix(side), np.zeros((3, 3))
    for (row, column), name in {(0, 0): "fx", (0, 2): "cx", (1, 1): "fy", (1, 2): "cy"}.items():
        wide[row, column] = printed_half_width(f"table1.{side}.{name}")
    inverse = np.asarray(np.linalg.inv(K), np.float64)
    turned = wide * np.array([[-1, 0, 1], [0, -1, 1], [0, 0, 0]])
    ends = [np.linalg.inv(K + sign * turned) for sign in (-1, 1)]  # larger centres go with smaller focal lengths
    return inverse, np.abs(np.array(ends) - inverse).max(axis=0)


def within_budget(miss: npt.ArrayLike, budget: npt.ArrayLike) -> float:
    """Tell how large a difference is against what the digits allow: up to 1 they explain it.

    Parameters
    ----------
    miss, budget : array_like of one shape

    Returns
    -------
    float
        The largest element's.

    Examples
    --------
    >>> within_budget([0.25, -0.75], [0.5, 0.5])
    1.5
    """
    return float(np.max(np.abs(np.asarray(miss, float)) / np.asarray(budget, float)))


def essential_miss(convention: str = "paper") -> float:
    """Tell how far the printed E is missed in a convention, over what the printed digits allow.

    Parameters
    ----------
    convention : "paper" | "opencv" | "rows"
        As `printed_essential`.

    Returns
    -------
    float
        Up to 1 the digits explain it.

    Examples
    --------
    >>> essential_miss("paper") < 1 < 50 < essential_miss("opencv")
    True
    """
    miss = printed_essential(convention) - np.asarray(printed_value("stereo.E"))
    return within_budget(miss, essential_budget(convention))
