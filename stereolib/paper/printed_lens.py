"""The paper's projection equation (II.A) letter by letter, and what can be counted in it."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

from stereolib.base import Float64
from stereolib.paper.printed_values import printed_value
from stereolib.rig import Camera


def printed_projection(camera: Camera, xy: npt.ArrayLike, *, squares: bool = False) -> Float64:
    """Project ideal coordinates by the equation as it is printed.

    Parameters
    ----------
    camera : Camera
        Its matrix and up to eight coefficients.
    xy : (N, 2) array_like
        ``x' = x/z``, ``y' = y/z``.
    squares : bool
        Put ``2 x'^2`` and ``2 y'^2`` where ``2 x'`` and ``2 y'`` are printed.

    Returns
    -------
    (N, 2) float64, px

    Notes
    -----
    ``x'' = x' (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6) + 2 P1 x' y' + P2 (r^2 + 2 x')``,
    ``y''`` likewise with ``2 P2 x' y' + P1 (r^2 + 2 y')``; ``u = fx x'' + Cx``, ``v = fy y'' + Cy``.

    Examples
    --------
    >>> camera = Camera([[700, 0, 320], [0, 700, 240], [0, 0, 1]], [0, 0, 0, 0.001], (640, 480))
    >>> [printed_projection(camera, [[0.1, 0.0]], squares=s).round(3).tolist() for s in (False, True)]
    [[[390.147, 240.0]], [[390.021, 240.0]]]
    """
    k1, k2, p1, p2, k3, k4, k5, k6 = np.pad(camera.dist, (0, 8))[:8]
    x, y = np.asarray(xy, float).reshape(-1, 2).T
    r2 = x**2 + y**2
    g = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    twice_x, twice_y = (2 * x**2, 2 * y**2) if squares else (2 * x, 2 * y)
    seen_x = x * g + 2 * p1 * x * y + p2 * (r2 + twice_x)
    seen_y = y * g + 2 * p2 * x * y + p1 * (r2 + twice_y)
    return np.column_stack([camera.K[0, 0] * seen_x + camera.K[0, 2], camera.K[1, 1] * seen_y + camera.K[1, 2]])


def equation_symbols(equation: str, letter: str) -> set[str]:
    """Collect the numbered symbols of one letter in an equation, capitals or not.

    Parameters
    ----------
    equation : str
    letter : str

    Returns
    -------
    set of str

    Examples
    --------
    >>> sorted(equation_symbols("x (1 + k1 r^2) + 2 P1 x y", "p"))
    ['p1']
    """
    return {found.lower() for found in re.findall(rf"\b{letter}\d+\b", equation, re.IGNORECASE)}


def printed_counts() -> dict[str, int]:
    """Count lens coefficients where the paper prints them.

    Returns
    -------
    dict
        ``listed``: in Table I, of the camera that has more; ``equation``: in the projection equation; ``radial``: those
        of them that multiply powers of r.

    Examples
    --------
    >>> printed_counts()
    {'listed': 5, 'equation': 8, 'radial': 6}
    """
    equation = printed_value("eq.projection")
    radial, tangential = (equation_symbols(equation, letter) for letter in "kp")
    listed = max(len(printed_value(f"table1.{side}.dist")) for side in ("left", "right"))
    return {"listed": listed, "equation": len(radial | tangential), "radial": len(radial)}
