"""The ledger: what the paper prints (``data/paper/published.toml``), and how ours compares."""

from __future__ import annotations

import difflib
import re
import textwrap
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from html import escape
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stereolib.base import data_path, figures_dir, write_atomic
from stereolib.rig import Camera, StereoRig, skew

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("id", "where", "paper", "ours", "difference", "tolerance", "unit", "verdict", "reason")
NUMERIC = ("exact", "same-method")
OTHER = ("qualitative", "internally-inconsistent", "not-reproducible")
_CLAIM = {"yes": "agrees", "in part": "holds in part", "no": "does not hold"}
_WIDTHS = {"id": 20, "paper": 19, "ours": 19, "difference": 10, "tolerance": 9, "verdict": 11, "reason": 26}


@dataclass(frozen=True)
class Published:
    """One item of the paper; the head of ``published.toml`` explains the fields."""

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

    Raises
    ------
    ValueError
        If the file is missing, or an entry lacks a field, has an unknown one or a bad value.
    """
    return parse(data_path("paper/published.toml").read_text(encoding="utf-8"))


def parse(text: str) -> dict[str, Published]:
    """Items of a text in the format of ``published.toml``; raises as `published`."""
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
    """What is needed and not printed: ``image_size_px`` and ``camera_height_unit``."""
    text = data_path("paper/published.toml").read_text(encoding="utf-8")
    return dict(tomllib.loads(text)["assumed"])


def value(id: str) -> Any:
    """The printed number, list or text of one item, in its printed unit."""
    return _item(id).value


@cache
def paper_rig() -> StereoRig:
    """The paper's cameras (Table I, section II.B) in our conventions.

    Returns
    -------
    StereoRig
        Image size 640 x 480, which the paper does not print.

    Notes
    -----
    Three conversions, made here and nowhere else:

    - Table I lists ``k1 k2 k3`` and ``p1 p2``; OpenCV's order is ``k1 k2 p1 p2 k3``.
    - The printed R is the transpose of ours, for the printed ``E = R' skew(T)``. Four digits make no rotation: the
      nearest one is taken, ``U V'`` of the singular value decomposition.
    - The printed T stands in the left camera's frame (``E T = 0``): ``x_right = R (x_left + T)``, and OpenCV's T is
      ``R T``. Left as printed, it would miss the printed E by 0.34 mm.
    """
    size, cameras = tuple(assumed()["image_size_px"]), []
    for side in ("left", "right"):
        fx, fy, cx, cy = (value(f"table1.{side}.{name}") for name in ("fx", "fy", "cx", "cy"))
        k1, k2, k3, p1, p2 = value(f"table1.{side}.dist")
        K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        cameras.append(Camera(K, np.array([k1, k2, p1, p2, k3]), size))
    u, _, vt = np.linalg.svd(np.array(value("stereo.R")).T)
    R = u @ vt
    return StereoRig(cameras[0], cameras[1], R, R @ np.array(value("stereo.T")))


def printed_form(rig: StereoRig) -> dict[str, Any]:
    """A rig in the paper's order and conventions, ready for `compare`; undoes `paper_rig`.

    Returns
    -------
    dict
        ``table1.*`` and ``stereo.*`` by id.
    """
    values: dict[str, Any] = {}
    for side, camera in (("left", rig.left), ("right", rig.right)):
        k1, k2, p1, p2, k3 = np.pad(camera.dist, (0, 5))[:5]
        (fx, _, cx), (_, fy, cy), _ = camera.K
        table = {"fx": fx, "fy": fy, "cx": cx, "cy": cy, "dist": [k1, k2, k3, p1, p2]}
        values |= {f"table1.{side}.{name}": entry for name, entry in table.items()}
    pair = {"R": rig.R.T, "T": rig.R.T @ rig.T, "E": rig.E, "F": rig.F}
    return values | {f"stereo.{name}": entry for name, entry in pair.items()}


def printed_essential(convention: str = "paper") -> np.ndarray:
    """Essential matrix from the printed R and T as they stand. (3, 3), mm.

    Parameters
    ----------
    convention : "paper" | "opencv"
        ``R' skew(T)``, which gives the printed E, or ``skew(T) R``, which does not.
    """
    if convention not in ("paper", "opencv"):
        raise ValueError(f'convention must be "paper" or "opencv", got {convention!r}')
    R, T = np.array(value("stereo.R")), np.array(value("stereo.T"))
    return R.T @ skew(T) if convention == "paper" else skew(T) @ R


def printed_fundamental(order: str = "right-left") -> np.ndarray:
    """Fundamental matrix from the printed E and Table I, not normalised. (3, 3).

    Parameters
    ----------
    order : "right-left" | "left-right"
        ``inv(K_R)' E inv(K_L)``, which gives the printed F, or the cameras exchanged.
    """
    if order not in ("right-left", "left-right"):
        raise ValueError(f'order must be "right-left" or "left-right", got {order!r}')
    rig = paper_rig()
    first, second = (rig.right, rig.left) if order == "right-left" else (rig.left, rig.right)
    return np.linalg.inv(first.K).T @ np.array(value("stereo.E")) @ np.linalg.inv(second.K)


def max_deviation(id: str, ours: Any) -> float:
    """Largest absolute difference between a printed number or matrix and ours."""
    return float(np.abs(np.asarray(ours, float) - np.asarray(value(id), float)).max())


def compare(values: Mapping[str, Any], reasons: Mapping[str, str] | None = None) -> pd.DataFrame:
    """Rows of the ledger: ours against the paper's.

    Parameters
    ----------
    values : mapping of id to ours
        Numbers and matrices in the paper's unit and convention (see `printed_form`). For a claim or a figure True,
        False, or a text that begins with ``yes``, ``in part`` or ``no``, as ``"no: 7.4 mm near 3 m"``. Where the
        paper contradicts itself or prints nothing to compare: any number or text, or None.
    reasons : mapping of id to text, optional
        Replaces the reason of ``published.toml`` where this run knows better.

    Returns
    -------
    DataFrame of str
        Columns `COLUMNS`, rounded, so that they read the same on every machine.

    Raises
    ------
    ValueError
        If an id is unknown (close ones are named), a shape is wrong, or a claim is answered with something else.
    """
    import pandas as pd

    reasons = reasons or {}
    if extra := sorted(set(reasons) - set(values)):
        raise ValueError(f"reasons for ids that are not compared: {extra}")
    rows = [_row(_item(id), ours, reasons.get(id)) for id, ours in values.items()]
    return pd.DataFrame(rows, columns=COLUMNS)


def record(rows: pd.DataFrame, notebook: str, figures: Path | None = None) -> None:
    """Keep a notebook's rows as ``tables/ledger_<notebook>.csv`` in the figures folder.

    Raises
    ------
    ValueError
        If the name is not a notebook's, as ``"01_calibration"``, or the rows not `compare`'s.
    """
    if not re.fullmatch(r"\d\d_\w+", notebook):
        raise ValueError(f'notebook must be named as "01_calibration", got {notebook!r}')
    if tuple(rows.columns) != COLUMNS or rows.empty:
        raise ValueError(f"rows must come from compare(), got {len(rows)} with {list(rows.columns)}")
    path = (figures or figures_dir()) / "tables" / f"ledger_{notebook}.csv"
    write_atomic(path, rows.to_csv(index=False, lineterminator="\n"))


def recorded(figures: Path | None = None) -> pd.DataFrame:
    """All recorded rows in the paper's order, with a column ``notebook``.

    An id recorded by several notebooks is taken from the one ``published.toml`` names for it.

    Raises
    ------
    ValueError
        If nothing was recorded yet, a file is not a ledger, or an id in it is unknown.
    """
    import pandas as pd

    folder, found = (figures or figures_dir()) / "tables", {}
    for path in sorted(folder.glob("ledger_*.csv")):
        rows = pd.read_csv(path, dtype=str, keep_default_na=False)
        if tuple(rows.columns) != COLUMNS:
            raise ValueError(f"{path} is not a ledger: run its notebook again")
        notebook = path.stem.removeprefix("ledger_")
        for row in rows.to_dict("records"):
            if row["id"] not in found or _item(row["id"]).notebook == notebook:
                found[_item(row["id"]).id] = row | {"notebook": notebook}
    if not found:
        raise ValueError(f"no ledger_*.csv in {folder}: run the notebooks (make reproduce) first")
    ordered = [found[id] for id in published() if id in found]
    return pd.DataFrame(ordered, columns=[*COLUMNS, "notebook"])


class Shown:
    """Rows of the ledger: a table where HTML is shown, text elsewhere."""

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


def show(rows: pd.DataFrame) -> Shown:
    """Rows of `compare` or `recorded` as a table: the last expression of a cell, or printed as text of 120 columns."""
    return Shown(rows)


def _item(id: str) -> Published:
    if id not in published():
        close = difflib.get_close_matches(id, published(), n=4, cutoff=0.4)
        raise ValueError(f"nothing is published under {id!r}; near it: {', '.join(close) or '-'}")
    return published()[id]


def _row(item: Published, ours: Any, reason: str | None) -> tuple[str, ...]:
    difference = tolerance = ""
    if isinstance(ours, (bool, np.bool_)) and item.comparability not in NUMERIC:
        ours = "yes" if ours else "no"
    if item.comparability in NUMERIC:
        difference, tolerance, verdict = _judge(item, ours)
    elif item.comparability == "qualitative":
        begins = [word for word in _CLAIM if re.match(rf"{word}\b", str(ours))]
        if not begins:
            raise ValueError(f"{item.id} is a claim: answer True, False or 'yes|in part|no: why', got {ours!r}")
        verdict = _CLAIM[begins[0]]
    else:
        inconsistent = item.comparability == "internally-inconsistent"
        verdict = "paper contradicts itself" if inconsistent else "not comparable"
    mine = "-" if ours is None else _text(ours, item.places)
    row = (item.id, item.where, _text(item.value, item.digits), mine, difference, tolerance)
    return (*row, item.unit, verdict, reason or item.reason)


def _judge(item: Published, ours: Any) -> tuple[str, str, str]:
    """Difference (of a matrix the largest, without sign), tolerance and verdict of a number."""
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
        tolerance = " to ".join(f"{v:g}" for v in sorted({limit.min(), limit.max()}))
    within = bool((np.abs(step) <= limit + 1e-9).all())  # 1e-9: the limit itself counts
    return difference, tolerance, "reproduced" if within else "differs"


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
