"""The report: every published item beside ours, as ``ledger.csv`` and one HTML file."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stereolib.base import read_bytes, write_atomic
from stereolib.paper import KINDS, Published, published, recorded_rows
from stereolib.reproduction.finding import finding, templates

if TYPE_CHECKING:
    import pandas as pd

# verdict -> colour of its badge; the order is that of the counts
VERDICTS = {
    "reproduced": "#1b6e3c",
    "agrees": "#1b6e3c",
    "meets the truth": "#1b6e3c",
    "holds in part": "#8a6100",
    "differs": "#a33a12",
    "does not hold": "#a33a12",
    "misses the truth": "#a33a12",
    "recovered": "#555555",
    "follows": "#555555",
    "follows in part": "#555555",
    "does not follow": "#a33a12",
    "not recovered": "#a33a12",
    "consistent": "#555555",
    "paper contradicts itself": "#6a3d8f",
    "redrawn": "#555555",
    "not comparable": "#555555",
    "not attempted": "#555555",
}
MEANINGS = {
    "test": "measured in pictures or scans, and no construction fixes the outcome: data could have turned the verdict",
    "built in": "the construction of the virtual rig fixes it: its numbers, its geometry or its noise law",
    "argument": "the paper against itself, against geometry or a cited source; no data",
    "redrawn": "a picture about which the paper states nothing that a number could be held against",
}
FAILED = ("differs", "does not hold", "misses the truth", "not recovered", "does not follow")
_TABLE = ("table1.", "stereo.", "check.")  # what stands in the section of Table I


def build_report(figures: Path) -> Path:
    """Write ``ledger.csv`` and ``report.html`` into the figures folder.

    Parameters
    ----------
    figures : Path
        Holds ``fig01.png`` and so on, and ``tables/ledger_*.csv``.

    Returns
    -------
    Path
        The report: self-contained, for reading offline and for printing.

    Raises
    ------
    ValueError
        If a figure is missing, or a published item was recorded by no notebook; all are named.
    """
    rows = recorded_rows(figures)
    missing = [f"{item.id} ({item.notebook})" for id, item in published().items() if id not in set(rows["id"])]
    pictures = {item.figure: figures / f"{item.figure}.png" for item in _figures()}
    absent = [path.name for path in pictures.values() if not path.is_file()]
    gaps = [f"no row for {', '.join(missing)}"] * bool(missing) + [f"no figure {', '.join(absent)}"] * bool(absent)
    if gaps:
        raise ValueError(f"the report would have gaps: {'; '.join(gaps)}. Run those notebooks (make reproduce)")
    page = _page(rows, {name: read_bytes(path) for name, path in pictures.items()}, finding(figures))
    write_atomic(figures / "ledger.csv", rows.to_csv(index=False, lineterminator="\n"))
    return write_atomic(figures / "report.html", page)


def count_verdicts(rows: pd.DataFrame) -> dict[str, int]:
    """Count the rows of each verdict that occurs.

    Parameters
    ----------
    rows : DataFrame
        Of `stereolib.paper.recorded_rows` or `stereolib.paper.compare_with_paper`.

    Returns
    -------
    dict of str to int

    Examples
    --------
    >>> from stereolib.paper import compare_with_paper
    >>> count_verdicts(compare_with_paper({"scale.cm_per_px": 42 / 362, "setup.max_distance": 2, "fig.1": None}))
    {'not recovered': 1, 'consistent': 1, 'redrawn': 1}
    """
    counts = rows["verdict"].value_counts()
    return {verdict: int(counts[verdict]) for verdict in VERDICTS if verdict in counts}


def count_kinds(rows: pd.DataFrame) -> dict[str, dict[str, int]]:
    """Count the verdicts of each kind of row that occurs.

    Parameters
    ----------
    rows : DataFrame
        Of `stereolib.paper.recorded_rows` or `stereolib.paper.compare_with_paper`.

    Returns
    -------
    dict of str to dict
        Kind, as ``"test"``, to `count_verdicts` of its rows.

    Examples
    --------
    >>> from stereolib.paper import compare_with_paper
    >>> count_kinds(compare_with_paper({"scale.cm_per_px": 42 / 362, "setup.max_distance": 1, "fig.1": None}))
    {'built in': {'recovered': 1}, 'argument': {'consistent': 1}, 'redrawn': {'redrawn': 1}}
    """
    kinds = set(rows["kind"])
    return {kind: count_verdicts(rows[rows["kind"] == kind]) for kind in KINDS if kind in kinds}


def sort_out(rows: pd.DataFrame) -> dict[str, list[dict[str, str]]]:
    """Which rows could have failed, which of them did, and where the paper contradicts itself.

    Parameters
    ----------
    rows : DataFrame
        Of `stereolib.paper.recorded_rows`.

    Returns
    -------
    dict of str to list of rows
        ``tests`` are of kind *test*; ``failed`` and ``in_part`` are among them; ``contradictions`` among the
        arguments; ``lost`` are built in and did not come back.
    """
    every = rows.to_dict("records")
    tests = [row for row in every if row["kind"] == "test"]
    return {
        "tests": tests,
        "failed": [row for row in tests if row["verdict"] in FAILED],
        "in_part": [row for row in tests if row["verdict"] == "holds in part"],
        "contradictions": [row for row in every if row["verdict"] == "paper contradicts itself"],
        "lost": [row for row in every if row["kind"] == "built in" and row["verdict"] in FAILED],
    }


def by_cause(rows: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Put failed rows together that fail for one reason.

    Parameters
    ----------
    rows : list of dict
        As `sort_out` gives them.

    Returns
    -------
    dict of str to list of rows
        By the item's cause, a row without one by its own id; in the ledger's order.
    """
    causes: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        causes.setdefault(published()[row["id"]].cause or row["id"], []).append(row)
    return causes


def _figures() -> list[Published]:
    return [item for item in published().values() if item.id.startswith("fig.")]


def _page(rows: pd.DataFrame, pictures: dict[str, bytes], found: str) -> str:
    by_id = {row["id"]: _cells(row) for row in rows.to_dict("records")}
    sections: list[dict[str, Any]] = []
    for item in _figures():
        others = [other for other in published().values() if other.figure == item.figure and other is not item]
        sections.append(
            {
                "id": item.figure,
                "title": f"Figure {item.id.removeprefix('fig.')}",
                "shows": item.value,
                "png_base64": base64.b64encode(pictures[item.figure]).decode("ascii"),
                "rows": [by_id[one.id] for one in (item, *others)],
            }
        )
    rest = [item.id for item in published().values() if not item.figure]
    table = [id for id in rest if id.startswith(_TABLE)]
    text = [id for id in rest if id not in table]
    for name, title, ids in (("table", "Table I and the matrices", table), ("text", "Text and equations", text)):
        sections.append({"id": name, "title": title, "rows": [by_id[id] for id in ids]})
    template = templates().get_template("report.html.jinja")
    first: dict[str, Any] = {name: [by_id[row["id"]] for row in some] for name, some in sort_out(rows).items()}
    first |= {"causes": by_cause(first["failed"]), "kinds": count_kinds(rows), "total": len(rows)}
    return template.render(sections=sections, colours=VERDICTS, meanings=MEANINGS, finding=found, **first)


def _cells(row: dict[str, str]) -> dict[str, Any]:
    """A row of the ledger as the template shows it."""
    item = published()[row["id"]]
    unit = f" {row['unit']}" if row["unit"] else ""
    paper, ours = row["paper"] + unit, row["ours"] + (unit if row["difference"] else "")
    is_matrix = not isinstance(item.value, str)  # one of its rows a line
    return row | {
        "about": "; ".join(part for part in (item.where, item.what, item.convention) if part),
        "says": item.what or item.value,
        "paper_lines": paper.split("; ") if is_matrix else [paper],
        "our_lines": ours.split("; ") if is_matrix else [ours],
    }
