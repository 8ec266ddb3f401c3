"""What the README says of the ledger, in counts and in short; and all its tables, written between their marks."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

from stereolib.base import read_text, write_atomic
from stereolib.paper import published, recorded_rows
from stereolib.reproduction.bench_tables import bench_table, rigs_table
from stereolib.reproduction.finding import finding
from stereolib.reproduction.report import MEANINGS, by_cause, count_kinds, count_verdicts, sort_out

if TYPE_CHECKING:
    import pandas as pd

# What the README lists: the paper's item -> its id, or how the ids of a group begin.
SUMMARY = {
    "Table I: both lenses": "table1.",
    "R, T, E, F": ("stereo.", "twopart."),
    **{f"Fig. {n}": f"fig.{n}" for n in range(1, 10)},
    "height by maximum disparity": "height.",
    "the title: length, width, height": "title.",
    "362 px, 42 cm, 0.116 cm/px": "scale.",
    "laser: 3 m, five turns, 1 mm": "lrf.",
    "equations and misprints": ("eq.", "misprint.", "check."),
    "set-up of the cube": "setup.",
    "claims of the text": "claim.",
    "its future work": "future.",
}


def update_readme_tables(readme: Path, figures: Path, results: Path) -> None:
    """Write what the README says of the ledger and of the benchmarks, between its marks.

    Parameters
    ----------
    readme : Path
        Holds ``<!-- counts --> ... <!-- /counts -->`` and the same for ``finding``, ``ledger``, ``bench`` and ``rigs``.
    figures : Path
        With the recorded tables.
    results : Path
        Folder of the benchmarks' JSON files.

    Raises
    ------
    ValueError
        If the README has no such marks; nothing is written then.
    """
    text = read_text(readme)
    for mark, block in _blocks(figures, results).items():
        before, opening, rest = text.partition(f"<!-- {mark} -->")
        _, closing, after = rest.partition(f"<!-- /{mark} -->")
        if not closing:
            raise ValueError(f"{readme} has no <!-- {mark} --> ... <!-- /{mark} --> to write between")
        text = f"{before}{opening}\n{block}\n{closing}{after}"
    write_atomic(readme, text)


def _blocks(figures: Path, results: Path) -> dict[str, str]:
    """What stands between which marks."""
    rows = recorded_rows(figures)
    return {
        "finding": _finding(figures),
        "counts": ledger_summary(rows),
        "ledger": ledger_table(rows),
        "bench": bench_table(results),
        "rigs": rigs_table(results),
    }


def _finding(figures: Path) -> str:
    """The finding in three sentences, and the whole of it, folded."""
    parts = f"**The main finding.** {finding(figures, short=True)}", finding(figures)
    short, full = (textwrap.fill(part, 125) for part in parts)
    return f"{short}\n\n<details><summary>The finding in full</summary>\n\n{full}\n\n</details>"


def ledger_table(rows: pd.DataFrame) -> str:
    """The paper's items in short, as Markdown: item, notebook, figure, verdict.

    Parameters
    ----------
    rows : DataFrame
        Of `stereolib.paper.recorded_rows`.

    Returns
    -------
    str
    """
    lines = ["| in the paper | notebook | figure | kind: verdict |", "|---|---|---|---|"]
    for label, prefix in SUMMARY.items():
        some = rows[rows["id"].str.startswith(prefix)]
        is_ours = some["id"].map(lambda id: published()[id].method == "stereolib's")
        kinds = count_kinds(some[~is_ours]) | {"in its place, stereolib's method": count_verdicts(some[is_ours])}
        verdict = "; ".join(f"*{kind}*: {_counted(counts, len(some))}" for kind, counts in kinds.items() if counts)
        notebooks, figures = sorted(set(some["notebook"])), sorted({published()[id].figure for id in some["id"]} - {""})
        links = " ".join(f"[{name[:2]}](notebooks/{name}.ipynb)" for name in notebooks)
        pictures = " ".join(f"[{name}](figures/{name}.png)" for name in figures) if len(notebooks) == 1 else ""
        lines.append(f"| {label} | {links} | {pictures} | {verdict} |")
    return "\n".join(lines)


def ledger_summary(rows: pd.DataFrame) -> str:
    """How many rows could have failed, how many did, and which, as Markdown.

    Parameters
    ----------
    rows : DataFrame
        Of `stereolib.paper.recorded_rows`.

    Returns
    -------
    str
    """
    sorted_out, kinds = sort_out(rows), count_kinds(rows)
    tests, failed, part, against = (sorted_out[name] for name in ("tests", "failed", "in_part", "contradictions"))
    own, own_failed, own_part = (len(sorted_out[name]) for name in ("own", "own_failed", "own_part"))
    bad = [row["id"] for row in (*failed, *part)]
    holding = count_verdicts(rows[(rows["kind"] == "test") & ~rows["id"].isin(bad)])
    causes = [
        f"{cause} ({_named(some)})" if cause != some[0]["id"] else _named(some)
        for cause, some in by_cause(failed).items()
    ]
    lines = [
        f"**Of {len(rows)} rows, {len(tests)} could have failed**: measured in pictures or scans whose construction "
        f"does not fix the outcome. **{len(failed)} of them did, of {len(causes)} causes**: {'; '.join(causes)}. "
        f"{len(part)} hold in part, {len(tests) - len(failed) - len(part)} hold "
        f"({_counted(holding, 0)}). In {own} of the {len(tests)} stereolib's method stands in the paper's place: "
        f"{own_failed} failed, {own_part} hold in part, {own - own_failed - own_part} hold. "
        f"In {len(against)} of the others the paper contradicts itself. "
        "[The report](figures/report.html) begins with these, "
        "[the ledger](figures/ledger.csv) has each row with its limits and its reasons.",
        "",
        "| kind of row | what it means | verdicts |",
        "|---|---|---|",
    ]
    lines += [f"| {kind} | {MEANINGS[kind]} | {_counted(counts, 0)} |" for kind, counts in kinds.items()]
    return "\n".join(lines)


def _named(rows: list[dict[str, str]]) -> str:
    return ", ".join(f"`{row['id']}`" for row in rows)


def _counted(counts: dict[str, int], alone: int) -> str:
    """Verdicts with their counts; of `alone` rows with a single verdict the count goes without saying."""
    return ", ".join(name if n == alone else f"{name} ({n})" for name, n in counts.items())
