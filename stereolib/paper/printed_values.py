"""What the paper prints: the entries of ``data/paper/published.toml``."""

from __future__ import annotations

import difflib
import tomllib
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

import numpy as np

from stereolib.base import data_path, read_text

NUMERIC = ("exact", "same-method")
OTHER = ("qualitative", "internally-inconsistent", "not-reproducible")


@dataclass(frozen=True)
class Published:
    """One item of the paper; the head of ``published.toml`` explains the fields.

    Raises
    ------
    ValueError
        If it has no reason, an unknown comparability, or is a number without one tolerance.
    """

    id: str
    value: Any
    where: str
    comparability: str
    reason: str
    notebook: str
    what: str = ""
    unit: str = ""
    digits: int | list[int] = 0
    shown: int | list[int] | None = None
    convention: str = ""
    atol: float | list[Any] | None = None
    rtol: float | None = None
    figure: str = ""

    def __post_init__(self) -> None:
        if self.comparability not in NUMERIC + OTHER:
            raise ValueError(f"comparability {self.comparability!r} is none of {NUMERIC + OTHER}")
        if self.comparability in NUMERIC and (self.atol is None) == (self.rtol is None):
            raise ValueError("a number needs either atol or rtol")
        if not self.reason:
            raise ValueError("a tolerance or comparability needs its reason")

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
