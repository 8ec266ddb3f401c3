"""Numbers as people read them."""

from __future__ import annotations

import math
from collections.abc import Iterable


def counted(count: int, noun: str) -> str:
    """Write a number of things; the noun takes an s where they are not one.

    Parameters
    ----------
    count : int
    noun : str
        Of one thing.

    Returns
    -------
    str

    Examples
    --------
    >>> counted(1, "station"), counted(0, "wall")
    ('1 station', '0 walls')
    """
    return f"{count} {noun}{'s' * (count != 1)}"


def listed(things: Iterable[object], most: int = 8) -> str:
    """Write things one after the other, at most so many, and how many more there are.

    Parameters
    ----------
    things : iterable
    most : int

    Returns
    -------
    str

    Examples
    --------
    >>> listed(["1.png", "2.png", "3.png"], most=2)
    '1.png, 2.png and 1 more'
    """
    names = list(map(str, things))
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def rounded(value: float, decimals: int = 0) -> str:
    """Write a value to so many decimals, and 0 without a minus.

    Parameters
    ----------
    value : float
    decimals : int

    Returns
    -------
    str

    Examples
    --------
    >>> rounded(-0.4), rounded(-1.26, 1)
    ('0', '-1.3')
    """
    return f"{round(float(value), decimals) + 0.0:.{decimals}f}"  # + 0.0: never -0


def plus_minus(value: float, std: float) -> str:
    """Write a value with its standard deviation: this to two digits, or whole, and the value to as many decimals.

    Parameters
    ----------
    value : float
        NaN where it is not known.
    std : float
        In the same unit; 0 or NaN where it has none.

    Returns
    -------
    str

    Examples
    --------
    >>> plus_minus(299.634, 0.1234), plus_minus(12.34, 9.96), plus_minus(2.5, 0), plus_minus(float("nan"), 1)
    ('299.63 ± 0.12', '12 ± 10', '2.5', '?')
    """
    if not math.isfinite(value):
        return "?"
    if not (math.isfinite(std) and std > 0):
        return f"{value:.6g}"
    exponent = int(f"{std:.1e}".partition("e")[2])  # of what it is rounded to
    decimals = min(max(1 - exponent, 0), 9)
    return f"{rounded(value, decimals)} ± {std:.{decimals}f}"
