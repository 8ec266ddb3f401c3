"""The report: every published item beside ours, as ``ledger.csv`` and one HTML file."""

from __future__ import annotations

import re
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from stereolib.base import datasets, write_atomic
from stereolib.paper import KINDS, published, recorded_rows
from stereolib.reproduction.chapters import Chapter, read_chapters
from stereolib.reproduction.embedded import Embedded, embed
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
# verdict -> what it says; some mean one thing for what was measured and for what is built in
WORDS = {
    ("reproduced", "recovered"): "our number is within its tolerance of the printed one",
    ("differs", "not recovered"): "our number is farther from the printed one than its tolerance",
    ("meets the truth",): "our number is within its tolerance of what is known of the virtual rig",
    ("misses the truth",): "our number is farther from what is known of it than its tolerance",
    ("agrees", "follows"): "all conditions of the claim hold",
    ("holds in part", "follows in part"): "some of them hold",
    ("does not hold", "does not follow"): "none of them holds",
    ("consistent",): "the printed numbers agree with each other, or with geometry",
    ("paper contradicts itself",): "the printed numbers do not agree with each other, or with geometry",
    ("redrawn",): "a picture without a statement, drawn again",
    ("not comparable",): "the paper prints nothing that ours could be held against",
    ("not attempted",): "the paper names it and does not do it",
}
MEANINGS = {
    "test": "measured in pictures or scans, and no construction fixes the outcome: data could have turned the verdict",
    "built in": "the construction of the virtual rig fixes it: its numbers, its geometry or its noise law",
    "argument": "the paper against itself, against geometry or a cited source; no data",
    "redrawn": "a picture about which the paper states nothing that a number could be held against",
}
FAILED = ("differs", "does not hold", "misses the truth", "not recovered", "does not follow")
_FIRST_PICTURE = "fig08"  # beside the finding


def build_report(figures: Path, notebooks: Path | None = None) -> Path:
    """Write ``ledger.csv`` and ``report.html`` into the figures folder.

    Parameters
    ----------
    figures : Path
        Holds ``fig01.png`` and so on, and ``tables/ledger_*.csv``.
    notebooks : Path, optional
        The folder of those that drew them. Default: the repository's.

    Returns
    -------
    Path
        The report: self-contained, for reading offline and for printing.

    Raises
    ------
    ValueError
        If a figure is missing, or a published item was recorded by no notebook; all are named.
    """
    rows, chapters = recorded_rows(figures), read_chapters(notebooks or datasets.repository() / "notebooks")
    missing = [f"{item.id} ({item.notebook})" for id, item in published().items() if id not in set(rows["id"])]
    papers = {item.figure: item.notebook for item in published().values() if item.figure}
    drawn = papers | {name: chapter.stem for chapter in chapters for name in chapter.figures}
    absent = [f"{name}.png ({stem})" for name, stem in drawn.items() if not (figures / f"{name}.png").is_file()]
    gaps = [f"no row for {', '.join(missing)}"] * bool(missing) + [f"no figure {', '.join(absent)}"] * bool(absent)
    if gaps:
        raise ValueError(f"the report would have gaps: {'; '.join(gaps)}. Run those notebooks (make reproduce)")
    pictures = {name: _figure(name, embed(figures / f"{name}.png")) | {"notebook": drawn[name]} for name in drawn}
    page = _page(rows, chapters, pictures, (finding(figures, short=True), finding(figures)))
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
        ``tests`` are of kind *test*; ``failed`` and ``in_part`` are among them, and so are ``own``, in which
        stereolib's method stands in the paper's place, with ``own_failed`` and ``own_part`` of these;
        ``contradictions`` are among the arguments; ``lost`` are built in and did not come back.
    """
    every = rows.to_dict("records")
    tests = [row for row in every if row["kind"] == "test"]
    failed = [row for row in tests if row["verdict"] in FAILED]
    in_part = [row for row in tests if row["verdict"] == "holds in part"]
    return {
        "tests": tests,
        "failed": failed,
        "in_part": in_part,
        "own": [row for row in tests if _is_own(row)],
        "own_failed": [row for row in failed if _is_own(row)],
        "own_part": [row for row in in_part if _is_own(row)],
        "contradictions": [row for row in every if row["verdict"] == "paper contradicts itself"],
        "lost": [row for row in every if row["kind"] == "built in" and row["verdict"] in FAILED],
    }


def _is_own(row: dict[str, str]) -> bool:
    return published()[row["id"]].method == "stereolib's"


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


def _page(
    rows: pd.DataFrame, chapters: list[Chapter], pictures: dict[str, dict[str, Any]], found: tuple[str, str]
) -> str:
    by_id = {row["id"]: _cells(row) for row in rows.to_dict("records")}
    sections: list[dict[str, Any]] = []
    for chapter in chapters:
        order = {name: k for k, name in enumerate(chapter.figures)}
        mine = [one for one in pictures.values() if one["notebook"] == chapter.stem]
        shown = sorted(mine, key=lambda one: order.get(one["id"], -1))
        held = [row for row in by_id.values() if row["notebook"] == chapter.stem]
        if held or shown:
            sections.append({"chapter": chapter, "rows": held, "figures": shown})
    template = templates().get_template("report.html.jinja")
    first: dict[str, Any] = {name: [by_id[row["id"]] for row in some] for name, some in sort_out(rows).items()}
    first |= {"causes": by_cause(first["failed"]), "kinds": count_kinds(rows), "total": len(rows)}
    first |= {"finding": found, "picture": pictures[_FIRST_PICTURE]}
    return template.render(sections=sections, colours=VERDICTS, words=WORDS, meanings=MEANINGS, **first)


def _figure(name: str, picture: Embedded) -> dict[str, Any]:
    """A figure as the template shows it; where its file says nothing, its text is what the paper's shows."""
    papers = {item.figure: item for item in published().values() if item.id.startswith("fig.")}
    shows = papers[name].value if name in papers else ""
    title = f"Figure {papers[name].id.removeprefix('fig.')}" if name in papers else name
    alt = picture.alt or (f"{title} of the paper, as we draw it" if shows else f"{name}, drawn by its notebook")
    return {"id": name, "title": title, "shows": shows, "picture": picture, "alt": alt, "told": bool(picture.alt)}


def _cells(row: dict[str, str]) -> dict[str, Any]:
    """A row of the ledger as the template shows it."""
    item = published()[row["id"]]
    unit = f" {row['unit']}" if row["unit"] else ""
    paper, ours = row["paper"] + unit, row["ours"] + (unit if row["difference"] else "")
    is_matrix = not isinstance(item.value, str)  # one of its rows a line
    if not item.what:  # a statement, which stands as the row's name, or a figure
        paper = "a picture" if item.id.startswith("fig.") else "says so"
    return row | {
        "code": Markup(re.sub(r"([._])", r"\1<wbr>", escape(row["id"]))),  # an id breaks after these, not in a word
        "figure": item.figure,
        "says": item.what or item.value,
        "convention": item.convention,
        "paper_lines": paper.split("; ") if is_matrix else [paper],
        "our_lines": ours.split("; ") if is_matrix else [ours],
    }
