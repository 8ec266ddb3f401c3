"""The report: every published item beside ours, as ``ledger.csv`` and one HTML file."""

from __future__ import annotations

import base64
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jinja2
from markupsafe import Markup

from stereolib.base import read_bytes, write_atomic
from stereolib.paper import Published, published, recorded_rows

if TYPE_CHECKING:
    import pandas as pd

# verdict -> colour of its badge; the order is that of the counts
VERDICTS = {
    "reproduced": "#1b6e3c",
    "agrees": "#1b6e3c",
    "holds in part": "#8a6100",
    "differs": "#a33a12",
    "does not hold": "#a33a12",
    "paper contradicts itself": "#6a3d8f",
    "not comparable": "#555555",
}
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
    page = _page(rows, {name: read_bytes(path) for name, path in pictures.items()})
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
    >>> count_verdicts(compare_with_paper({"scale.cm_per_px": 42 / 362, "scale.width_px": 0}))
    {'reproduced': 1, 'differs': 1}
    """
    counts = rows["verdict"].value_counts()
    return {verdict: int(counts[verdict]) for verdict in VERDICTS if verdict in counts}


def _figures() -> list[Published]:
    return [item for item in published().values() if item.id.startswith("fig.")]


def _page(rows: pd.DataFrame, pictures: dict[str, bytes]) -> str:
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
    template = _templates().get_template("report.html.jinja")
    return template.render(sections=sections, counts=count_verdicts(rows), colours=VERDICTS)


def _templates() -> jinja2.Environment:
    """Templates of this room; quotes become the entities of `html.escape`, which the committed report has."""
    return jinja2.Environment(
        loader=jinja2.PackageLoader(__package__),
        autoescape=True,
        finalize=lambda value: value if isinstance(value, Markup) else Markup(escape(str(value))),
        trim_blocks=True,
        keep_trailing_newline=True,
    )


def _cells(row: dict[str, str]) -> dict[str, Any]:
    """A row of the ledger as the template shows it."""
    item = published()[row["id"]]
    unit = f" {row['unit']}" if row["unit"] else ""
    paper, ours = row["paper"] + unit, row["ours"] + (unit if row["difference"] else "")
    is_matrix = not isinstance(item.value, str)  # one of its rows a line
    return row | {
        "about": "; ".join(part for part in (item.where, item.what, item.convention) if part),
        "paper_lines": paper.split("; ") if is_matrix else [paper],
        "our_lines": ours.split("; ") if is_matrix else [ours],
    }
