"""The ledger: our numbers beside the paper's, judged, kept by notebook, and shown as a table."""

from __future__ import annotations

import os
import re
import textwrap
from collections.abc import Mapping
from dataclasses import replace
from html import escape
from io import StringIO
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stereolib.base import figures_dir, read_text, write_atomic
from stereolib.paper.printed_values import Published, printed_item, published

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("id", "where", "kind", "data", "paper", "ours", "difference", "tolerance", "unit", "verdict", "reason")
_EXTRA_DIGITS = int(os.environ.get("STEREOLIB_EXTRA_DIGITS", "0"))  # `make same` looks behind the rounding
# verdicts of what is held against ...: when all of it holds, a part, nothing
_VERDICTS = {
    "number": ("reproduced", "differs", "differs"),
    "truth": ("meets the truth", "misses the truth", "misses the truth"),
    "claim": ("agrees", "holds in part", "does not hold"),
    "itself": ("consistent", "paper contradicts itself", "paper contradicts itself"),
    # what the construction of the virtual rig fixes: a number, a claim
    "built in number": ("recovered", "not recovered", "not recovered"),
    "built in claim": ("follows", "follows in part", "does not follow"),
}
_WIDTHS = {"id": 18, "kind": 8, "paper": 17, "ours": 20, "difference": 10, "tolerance": 9, "verdict": 11, "reason": 20}
_ROUNDING = 1e-9  # of a difference that is as large as its tolerance, which still counts


def compare_with_paper(
    values: Mapping[str, Any], reasons: Mapping[str, str] | None = None, tolerances: Mapping[str, Any] | None = None
) -> pd.DataFrame:
    """Rows of the ledger: ours against the paper's, with the verdict that the item's own limits give.

    Parameters
    ----------
    values : mapping of id to ours
        Numbers and matrices in the paper's unit and convention (see `printed_form`). For a claim the computed
        quantities by the names of its conditions, as ``{"times": 82.0}``. Where there is nothing to compare: any
        number or text, or None.
    reasons : mapping of id to text, optional
        Replaces the reason of ``published.toml`` where this run knows better.
    tolerances : mapping of id to number or array, optional
        For every item whose tolerance is computed (``atol = "computed"``), and for no other.

    Returns
    -------
    DataFrame of str
        Columns `COLUMNS`, rounded, so that they read the same on every machine.

    Raises
    ------
    ValueError
        If an id is unknown (close ones are named), a shape is wrong, a claim is answered with something else than
        its quantities, or a computed tolerance is missing.

    Examples
    --------
    >>> row = compare_with_paper({"scale.cm_per_px": 42 / 362}).iloc[0]
    >>> row["paper"], row["ours"], row["difference"], row["verdict"]
    ('0.116', '0.1160', '+0.0000', 'consistent')
    """
    import pandas as pd

    reasons, tolerances = reasons or {}, tolerances or {}
    if extra := sorted((set(reasons) | set(tolerances)) - set(values)):
        raise ValueError(f"reasons or tolerances for ids that are not compared: {extra}")
    rows = []
    for id, ours in values.items():
        item = printed_item(id)
        if (item.atol == "computed") != (id in tolerances):
            raise ValueError(
                f"{id}: its tolerance is {'' if item.atol == 'computed' else 'not '}computed by the caller"
            )
        if id in tolerances:
            item = replace(item, atol=np.asarray(tolerances[id], float).tolist())
        rows.append(_row(item, ours, reasons.get(id)))
    return pd.DataFrame(rows, columns=COLUMNS)


def record_rows(rows: pd.DataFrame, notebook: str, figures: Path | None = None) -> None:
    """Keep a notebook's rows as ``tables/ledger_<notebook>.csv`` in the figures folder.

    Parameters
    ----------
    rows : DataFrame
        Of `compare_with_paper`.
    notebook : str
        Its name, as ``"01_calibration"``.
    figures : Path, optional
        Default: `stereolib.base.figures_dir`.

    Raises
    ------
    ValueError
        If the name is not a notebook's, as ``"01_calibration"``, or the rows not `compare_with_paper`'s.
    """
    if not re.fullmatch(r"\d\d_\w+", notebook):
        raise ValueError(f'notebook must be named as "01_calibration", got {notebook!r}')
    if tuple(rows.columns) != COLUMNS or rows.empty:
        raise ValueError(f"rows must come from compare_with_paper(), got {len(rows)} with {list(rows.columns)}")
    path = (figures or figures_dir()) / "tables" / f"ledger_{notebook}.csv"
    write_atomic(path, rows.to_csv(index=False, lineterminator="\n"))


def recorded_rows(figures: Path | None = None) -> pd.DataFrame:
    """All recorded rows in the paper's order, with a column ``notebook``.

    An id recorded by several notebooks is taken from the one ``published.toml`` names for it.

    Parameters
    ----------
    figures : Path, optional
        Default: `stereolib.base.figures_dir`.

    Returns
    -------
    DataFrame of str

    Raises
    ------
    ValueError
        If nothing was recorded yet, a file is not a ledger, or an id in it is unknown.
    """
    import pandas as pd

    folder, kept = (figures or figures_dir()) / "tables", dict[str, dict[str, str]]()
    for path in sorted(folder.glob("ledger_*.csv")):
        rows = pd.read_csv(StringIO(read_text(path)), dtype=str, keep_default_na=False)
        if tuple(rows.columns) != COLUMNS:
            raise ValueError(f"{path} is not a ledger: run its notebook again")
        notebook = path.stem.removeprefix("ledger_")
        for row in rows.to_dict("records"):
            if printed_item(row["id"]).notebook == notebook or row["id"] not in kept:
                kept[row["id"]] = row | {"notebook": notebook}
    if not kept:
        raise ValueError(f"no ledger_*.csv in {folder}: run the notebooks (make reproduce) first")
    ordered = [kept[id] for id in published() if id in kept]
    return pd.DataFrame(ordered, columns=[*COLUMNS, "notebook"])


class ShownRows:
    """Rows of the ledger: a table where HTML is shown, text elsewhere.

    Parameters
    ----------
    rows : DataFrame
        Of `compare_with_paper` or `recorded_rows`.
    """

    def __init__(self, rows: pd.DataFrame) -> None:
        self._rows = rows.to_dict("records")

    def __repr__(self) -> str:
        lines = []
        for row in [{name: name for name in _WIDTHS}, *self._rows]:
            cells = [textwrap.wrap(row[name], width) for name, width in _WIDTHS.items()]
            words = textwrap.wrap(re.sub(r"[._]", r"\g<0> ", row["id"]), _WIDTHS["id"])
            cells[0] = [re.sub(r"([._]) ", r"\1", part) for part in words]  # breaks after . and _
            for parts in zip_longest(*cells, fillvalue=""):
                lines.append(" ".join(map(str.ljust, parts, _WIDTHS.values())).rstrip())
            lines.append("")
        return "\n".join(lines[:-1])

    def _repr_html_(self) -> str:
        left = ' style="text-align: left"'
        head = "".join(f"<th{left}>{name}</th>" for name in _WIDTHS)
        cells = ("".join(f"<td{left}>{escape(row[name])}</td>" for name in _WIDTHS) for row in self._rows)
        body = "\n".join(f"<tr>{row}</tr>" for row in cells)
        return f"<table>\n<tr>{head}</tr>\n{body}\n</table>"


def show_rows(rows: pd.DataFrame) -> ShownRows:
    """Show rows of the ledger: the last expression of a cell, or printed as text of 120 columns.

    Parameters
    ----------
    rows : DataFrame
        Of `compare_with_paper` or `recorded_rows`.

    Returns
    -------
    ShownRows

    Examples
    --------
    >>> print(str(show_rows(compare_with_paper({"scale.cm_per_px": 42 / 362}))).splitlines()[0])
    id                 kind     paper             ours                 difference tolerance verdict     reason
    """
    return ShownRows(rows)


def _row(item: Published, ours: Any, reason: str | None) -> tuple[str, ...]:
    difference = tolerance = ""
    why = reason or item.reason
    if item.conditions:
        mine, difference, tolerance, holding = _weigh(item, ours)
        limits = [c for c in item.conditions.values() if c.because not in ("as above", "the same")]
        why = " ".join([why, *(f"{c.limit[0].upper()}{c.limit[1:]}: {c.because}." for c in limits)])
    else:
        mine = "-" if ours is None else _text(ours, np.add(item.places, _EXTRA_DIGITS))
        if item.numeric:
            difference, tolerance, holding = _judge(item, ours)
    if item.against in ("nothing", "not attempted"):
        verdict = {"redrawn": "redrawn"}.get(item.kind, item.against.replace("nothing", "not comparable"))
    else:
        words = _VERDICTS.get(f"{item.kind} {item.against}", _VERDICTS[item.against])
        verdict = words[0 if holding == 1 else 1 if holding else 2]
    row = (item.id, item.where, item.kind, item.data, _text(item.value, item.digits), mine, difference, tolerance)
    return (*row, item.unit, verdict, why)


def _weigh(item: Published, ours: Any) -> tuple[str, str, str, float]:
    """A claim: what was measured, how many of its conditions hold, their limits, and the share that holds."""
    if not isinstance(ours, Mapping) or set(ours) != set(item.conditions):
        raise ValueError(f"{item.id} is a claim: give {sorted(item.conditions)} with a number each, got {ours!r}")
    said, held = [], []
    for name, condition in item.conditions.items():
        value = float(ours[name])
        held.append(condition.holds(value))
        number = "unknown" if np.isnan(value) else _text(value, condition.digits + _EXTRA_DIGITS)
        said.append(condition.says.replace("{}", number))
    answers = [f"{text}: {'yes' if yes else 'no'}" for text, yes in zip(said, held, strict=True)]
    limits = "; ".join(condition.limit for condition in item.conditions.values())
    return "; ".join(answers), f"{sum(held)} of {len(held)} hold", limits, sum(held) / len(held)


def _judge(item: Published, ours: Any) -> tuple[str, str, float]:
    """Difference (of a matrix the largest, without sign), tolerance, and 1 if all is within it, else 0."""
    paper = np.asarray(item.value, float)
    if isinstance(ours, (str, bool)) or ours is None or np.shape(ours) != paper.shape:
        kind = f"shape {paper.shape}" if paper.ndim else "a single number"
        raise ValueError(f"{item.id} is {kind} in the paper; ours is {ours!r}")
    step = np.asarray(ours, float) - paper
    if paper.ndim:
        difference = "max " + _text(np.abs(step).max(), np.max(item.places))
    else:
        difference = _text(step, item.places, "+")
    if item.rtol is not None:
        limit, tolerance = item.rtol * np.abs(paper).max(), f"{100 * item.rtol:g} %"
    else:
        limit = np.asarray(item.atol, float)
        tolerance = " to ".join(f"{v:.3g}" for v in sorted({limit.min(), limit.max()}))
    return difference, tolerance, float((np.abs(step) <= limit + _ROUNDING).all())


def _text(value: Any, digits: Any, sign: str = "") -> str:
    """A number with its decimals, minus zero never shown; rows of a matrix parted by ``;``."""
    if isinstance(value, (str, bool)):
        return str(value)
    array = np.atleast_1d(np.asarray(value, float))
    texts = [
        f"{round(v, d) + 0.0:{sign}.{d}f}"
        for v, d in zip(array.flat, np.broadcast_to(digits, array.shape).flat, strict=True)
    ]
    width = array.shape[-1]
    return "; ".join(" ".join(texts[i : i + width]) for i in range(0, len(texts), width))
