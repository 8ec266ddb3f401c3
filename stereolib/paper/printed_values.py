"""What the paper prints: the entries of ``data/paper/published.toml``."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np

from stereolib.base import data_path, read_text

KINDS = ("test", "built in", "argument", "redrawn")
DATA = ("virtual rig", "real unit", "print")
METHODS = ("the paper's", "stereolib's")
# what an item is held against -> how many tolerances it has, and whether it has conditions
AGAINST = {
    "number": {(1, False)},
    "truth": {(1, False), (0, True)},
    "claim": {(0, True)},
    "itself": {(1, False), (0, True)},
    "nothing": {(0, False)},
    "not attempted": {(0, False)},
}


@dataclass(frozen=True)
class Condition:
    """What a computed quantity must fulfil for a claim to hold.

    Raises
    ------
    ValueError
        If it has no limit or no reason for it, or its sentence no place for the number.
    """

    says: str
    because: str
    least: float | None = None
    most: float | None = None
    digits: int = 0

    def __post_init__(self) -> None:
        if self.says.count("{}") != 1:
            raise ValueError(f"a condition's sentence needs one {{}} for its number: {self.says!r}")
        if self.least is None and self.most is None:
            raise ValueError(f"a condition needs least, most or both: {self.says!r}")
        if not self.because:
            raise ValueError(f"a limit needs its reason: {self.says!r}")

    @property
    def limit(self) -> str:
        """Its limits in words."""
        if self.least == self.most:
            return f"{self.least:g}"
        if self.least is not None and self.most is not None:
            return f"{self.least:g} to {self.most:g}"
        return f"at least {self.least:g}" if self.most is None else f"at most {self.most:g}"

    def holds(self, value: float) -> bool:
        """Whether a number keeps the limits; NaN never does.

        Parameters
        ----------
        value : float

        Returns
        -------
        bool
        """
        low, high = (-np.inf if self.least is None else self.least), (np.inf if self.most is None else self.most)
        return bool(low <= value <= high)


@dataclass(frozen=True)
class Published:
    """One item of the paper; the head of ``published.toml`` explains the fields.

    Raises
    ------
    ValueError
        If it has no reason, an unknown kind or opponent, is a number without one tolerance, or a claim without a
        condition.
    """

    id: str
    value: Any
    where: str
    kind: str
    against: str
    reason: str
    notebook: str
    what: str = ""
    unit: str = ""
    digits: int | list[int] = 0
    shown: int | list[int] | None = None
    convention: str = ""
    atol: float | str | list[Any] | None = None
    rtol: float | None = None
    conditions: Mapping[str, Condition] = field(default_factory=dict)
    figure: str = ""
    data: str = ""
    method: str = "the paper's"
    cause: str = ""

    def __post_init__(self) -> None:
        if not self.data:
            object.__setattr__(self, "data", "print" if self.kind == "argument" else "virtual rig")
        if self.data not in DATA:
            raise ValueError(f"data {self.data!r} is none of {DATA}")
        if self.method not in METHODS:
            raise ValueError(f"method {self.method!r} is none of {METHODS}")
        if self.kind not in KINDS:
            raise ValueError(f"kind {self.kind!r} is none of {KINDS}")
        if self.against not in AGAINST:
            raise ValueError(f"against {self.against!r} is none of {tuple(AGAINST)}")
        if not self.reason:
            raise ValueError("a tolerance or a verdict needs its reason")
        conditions = {name: c if isinstance(c, Condition) else Condition(**c) for name, c in self.conditions.items()}
        object.__setattr__(self, "conditions", MappingProxyType(conditions))
        self._check_limits()

    def _check_limits(self) -> None:
        if isinstance(self.atol, str) and self.atol != "computed":
            raise ValueError(f'atol must be a number, one per element or "computed", got {self.atol!r}')
        has = (self.atol is not None) + (self.rtol is not None), bool(self.conditions)
        if has not in AGAINST[self.against]:
            raise ValueError(
                f"held against {self.against!r}: a number needs either atol or rtol, a claim needs conditions, "
                f"nothing to hold against has neither; got {has[0]} tolerances, {len(self.conditions)} conditions"
            )
        if self.kind == "redrawn" and self.against != "nothing":
            raise ValueError("what is only redrawn is held against nothing")

    @property
    def numeric(self) -> bool:
        """Whether it is a number with a tolerance."""
        return self.atol is not None or self.rtol is not None

    @property
    def places(self) -> int | list[int]:
        """Decimals shown of ours: those that hold on other machines."""
        return self.digits if self.shown is None else self.shown


@cache
def published() -> dict[str, Published]:
    """Every published item by its id, in the paper's order.

    Returns
    -------
    dict of str to Published

    Raises
    ------
    ValueError
        If the file is missing, or an entry lacks a field, has an unknown one or a bad value.

    Examples
    --------
    >>> published()["setup.cube"].value, published()["setup.cube"].unit
    ([30, 30, 30], 'cm')
    """
    return parse_published(read_text(data_path("paper/published.toml")))


def parse_published(text: str) -> dict[str, Published]:
    """Items of a text in the format of ``published.toml``.

    Parameters
    ----------
    text : str

    Returns
    -------
    dict of str to Published

    Raises
    ------
    ValueError
        As `published`.
    """
    known, items = {f.name for f in fields(Published)}, {}
    for key, entry in tomllib.loads(text).items():
        if key == "assumed":
            continue
        if strange := sorted(set(entry) - known):
            raise ValueError(f"published.toml, {key}: unknown {strange}; known: {sorted(known)}")
        try:
            items[key] = Published(id=key, **entry)
        except (TypeError, ValueError) as error:
            raise ValueError(f"published.toml, {key}: {error}") from error
    return items


def assumed() -> dict[str, Any]:
    """Values that are needed and not printed.

    Returns
    -------
    dict
        ``image_size_px`` and ``camera_height_unit``.
    """
    return dict(_assumed())


@cache
def _assumed() -> dict[str, Any]:
    return dict(tomllib.loads(read_text(data_path("paper/published.toml")))["assumed"])


def printed_item(id: str) -> Published:
    """One published item.

    Parameters
    ----------
    id : str
        For example ``"table1.left.fx"``.

    Returns
    -------
    Published

    Raises
    ------
    ValueError
        If there is none; the text names those that are spelled like it.
    """
    if id not in published():
        close = difflib.get_close_matches(id, published(), n=4, cutoff=0.4)
        raise ValueError(f"nothing is published under {id!r}; near it: {', '.join(close) or '-'}")
    return published()[id]


def printed_value(id: str) -> Any:
    """Value of one published item, in its printed unit.

    Parameters
    ----------
    id : str
        For example ``"table1.left.fx"``.

    Returns
    -------
    number, list or str

    Raises
    ------
    ValueError
        If nothing is published under it.

    Examples
    --------
    >>> printed_value("scale.cm_per_px")
    0.116
    """
    return printed_item(id).value


def max_deviation(id: str, ours: Any) -> float:
    """Largest absolute difference between a printed number or matrix and ours.

    Parameters
    ----------
    id : str
        For example ``"stereo.E"``.
    ours : array_like
        In the paper's unit and convention.

    Returns
    -------
    float

    Examples
    --------
    >>> round(max_deviation("scale.cm_per_px", 42 / 362), 6)
    2.2e-05
    """
    return float(np.abs(np.asarray(ours, float) - np.asarray(printed_value(id), float)).max())
