"""The report: every published item beside ours, as ``ledger.csv`` and one HTML file."""

from __future__ import annotations

import base64
import json
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from stereolib.base import write_atomic
from stereolib.paper import Published, published, recorded

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
# What the README lists: the paper's item -> its id, or how the ids of a group begin.
SUMMARY = {
    "Table I: both lenses": "table1.",
    "R, T, E, F": "stereo.",
    **{f"Fig. {n}": f"fig.{n}" for n in range(1, 10)},
    "height by maximum disparity": "height.",
    "362 px, 42 cm, 0.116 cm/px": "scale.",
    "laser: 3 m, five turns, 1 mm": "lrf.",
    "claims of the text": "claim.",
}
# What the README quotes of the benchmarks: label -> (file, key, unit, goal)
BENCHES = {
    "focal lengths, rendered and calibrated": ("accuracy", "focal_error_pct", "% off", "at most 0.1"),
    "principal points": ("accuracy", "principal_point_error_px", "px off", "at most 1"),
    "baseline": ("accuracy", "baseline_error_mm", "mm off", "at most 0.05"),
    "rows after rectification": ("accuracy", "epipolar_rms_px", "px rms", "under 0.1"),
    "true values within the stated 95 % intervals": ("calibration", "interval_held_pct", "% of draws", "90 to 99"),
    "faulty board sets not named": ("calibration", "faults_missed", "missed", "0"),
    "squares of boards left out": ("calibration", "square_error_pct", "% off", "at most 0.1"),
    "boards found, rig calibrated, one core": ("calibration", "one_core_ratio", "x the bare calls", "at most 1.15"),
    "the same on two cores": ("calibration", "two_cores_ratio", "x the bare calls", "under 1"),
    "rectify + SGBM against the bare cv2 calls": ("overhead", "ratio", "x their time", "at most 1.05"),
    "laser bytes decoded": ("lrf", "mb_per_s", "MB/s", "at least 100"),
    "the same against a plain loop over packets": ("lrf", "times_a_plain_loop", "times faster", "at least 15"),
    "intact packets in a damaged stream": ("lrf", "intact_lost", "lost", "0"),
    "reading a laser live": ("lrf", "live_cpu_pct", "% of a core", "under 5"),
    "laser on the cube, median of five turns": ("lrf", "sweep_error_mm", "mm off (median)", "under 3"),
    "the laser's search window against 128 disparities": ("study", "times_faster_least", "times faster", "at least 3"),
    "its bad pixels on the cube, fewer than plain SGBM's by": (
        "study",
        "least_gain_bad2_points",
        "points of bad-2",
        "at least 0",
    ),
    "a sweep against the bare cv2 time": ("study", "overhead_pct", "% more", "at most 3"),
    "two workers against one": ("study", "two_workers_times", "times faster", "at least 1.85"),
    "`best` on photographs, all pixels": ("pipeline", "motorcycle_best_bad2_pct", "% bad-2", "at most 6"),
    "its errors inside one standard deviation": ("pipeline", "virtual_inside_pct", "%", "63 to 73"),
    "the same on photographs": ("pipeline", "motorcycle_inside_pct", "%", "63 to 73"),
    "`fast` against plain SGBM": ("pipeline", "fast_times_plain", "times faster", "at least 2"),
    "its bad pixels, fewer than plain SGBM's by": (
        "pipeline",
        "fast_less_bad2_points",
        "points of bad-2",
        "-1 or more",
    ),
    **{
        f"{what} of 200 boxes, {how}": ("dimensions", f"{what}.{key}", "% off", f"at most {goal:g}")
        for what, goals in (("height", (1, 3)), ("length", (1.5, 4)), ("width", (1.5, 4)), ("volume", (3, 8)))
        for how, key, goal in zip(("median", "95th percentile"), ("median_pct", "p95_pct"), goals, strict=True)
    },
    "their 95 % intervals hold the truth": ("dimensions", "coverage95_pct", "%", "90 to 99"),
    "boxes more than 10 % off, unsaid": ("dimensions", "silent_error_pct", "%", "at most 1"),
    "the paper's recipe on the same boxes, median": ("dimensions", "paper_height_median_pct", "% off", ""),
    "measurements on one core": ("dimensions", "per_second", "a second", "at least 20"),
    "one of them against the cv2 calls inside": ("dimensions", "times_cv2_inside", "x their time", "at most 1.25"),
    "`import stereolib`": ("time", "import_s", "s", "under 0.5"),
    "all notebooks and the report": ("time", "reproduce_s", "s", "under 300"),
}
_TABLE = ("table1.", "stereo.", "check.")  # what stands in the section of Table I
_STYLE = """
body { margin: 2rem auto; max-width: 72rem; padding: 0 1.5rem; background: #fff; color: #1a1a1a;
       font: 16px/1.5 system-ui, sans-serif; }
h1 { line-height: 1.2; } h2 { margin-top: 3rem; border-bottom: 1px solid #ccc; }
figure { margin: 1rem 0; } img { max-width: 100%; height: auto; }
figcaption { color: #444; } nav a { margin-right: 1rem; white-space: nowrap; }
.rows { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; min-width: 52rem; font-size: 0.85rem; }
th, td { text-align: left; vertical-align: top; padding: 0.35rem 0.6rem;
         border-bottom: 1px solid #ddd; }
td { overflow-wrap: anywhere; }
th:nth-child(1) { width: 19%; } th:nth-child(2), th:nth-child(3) { width: 18%; }
th:nth-child(4) { width: 10%; } th:nth-child(5) { width: 10%; }
td small { color: #555; } code { font-size: 0.8rem; }
b.verdict { font-weight: 600; } .counts { list-style: none; padding: 0; display: flex;
         flex-wrap: wrap; gap: 1.5rem; } .counts b { font-size: 1.6rem; display: block; }
@media print { table { min-width: 0; } body { max-width: none; font-size: 11px; } nav { display: none; }
         figure, tr { break-inside: avoid; } img { max-height: 12cm; } }
"""


def build(figures: Path) -> Path:
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
    rows = recorded(figures)
    missing = [f"{item.id} ({item.notebook})" for id, item in published().items() if id not in set(rows["id"])]
    pictures = {item.figure: figures / f"{item.figure}.png" for item in _figures()}
    absent = [path.name for path in pictures.values() if not path.is_file()]
    gaps = [f"no row for {', '.join(missing)}"] * bool(missing) + [f"no figure {', '.join(absent)}"] * bool(absent)
    if gaps:
        raise ValueError(f"the report would have gaps: {'; '.join(gaps)}. Run those notebooks (make reproduce)")
    page = _page(rows, {name: path.read_bytes() for name, path in pictures.items()})
    write_atomic(figures / "ledger.csv", rows.to_csv(index=False, lineterminator="\n"))
    return write_atomic(figures / "report.html", page)


def tally(rows: pd.DataFrame) -> dict[str, int]:
    """Number of rows for each verdict that occurs."""
    counts = rows["verdict"].value_counts()
    return {verdict: int(counts[verdict]) for verdict in VERDICTS if verdict in counts}


def update_readme(readme: Path, figures: Path, results: Path) -> None:
    """Write the README's two tables, of the ledger and of the benchmarks, between their marks.

    Parameters
    ----------
    readme : Path
        Holds ``<!-- ledger --> ... <!-- /ledger -->`` and the same for ``bench``.
    figures : Path
        With the recorded tables.
    results : Path
        Folder of the benchmarks' JSON files.
    """
    text = readme.read_text(encoding="utf-8")
    for mark, table in (("ledger", ledger_table(recorded(figures))), ("bench", bench_table(results))):
        before, opening, rest = text.partition(f"<!-- {mark} -->")
        _, closing, after = rest.partition(f"<!-- /{mark} -->")
        if not closing:
            raise ValueError(f"{readme} has no <!-- {mark} --> ... <!-- /{mark} --> to write the table between")
        text = f"{before}{opening}\n{table}\n{closing}{after}"
    write_atomic(readme, text)


def ledger_table(rows: pd.DataFrame) -> str:
    """The paper's items in short, as Markdown: item, notebook, figure, verdict."""
    lines = ["| in the paper | notebook | figure | verdict |", "|---|---|---|---|"]
    for label, prefix in SUMMARY.items():
        some = rows[[id == prefix or (prefix.endswith(".") and id.startswith(prefix)) for id in rows["id"]]]
        counts = tally(some)
        verdict = ", ".join(f"{name} ({n})" if len(counts) > 1 else name for name, n in counts.items())
        notebooks, figures = sorted(set(some["notebook"])), sorted({published()[id].figure for id in some["id"]} - {""})
        links = " ".join(f"[{name[:2]}](notebooks/{name}.ipynb)" for name in notebooks)
        pictures = " ".join(f"[{name}](figures/{name}.png)" for name in figures) if len(notebooks) == 1 else ""
        lines.append(f"| {label} | {links} | {pictures} | {verdict} |")
    total = ", ".join(f"{n} {name}" for name, n in tally(rows).items())
    summary = f"All {len(rows)} rows of the ledger: {total}. [Each with its reason](figures/ledger.csv)."
    return "\n".join([*lines, "", summary])


def bench_table(results: Path) -> str:
    """What the benchmarks wrote, as Markdown; what was not measured yet is left out."""
    lines = ["| measured | value | goal |", "|---|---|---|"]
    for label, (name, key, unit, goal) in BENCHES.items():
        path = results / f"{name}.json"
        value = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
        for part in key.split("."):
            value = value.get(part, {})
        if value != {}:
            lines.append(f"| {label} | {value:g} {unit} | {goal} |")
    return "\n".join(lines)


def _figures() -> list[Published]:
    return [item for item in published().values() if item.id.startswith("fig.")]


def _page(rows: pd.DataFrame, pictures: dict[str, bytes]) -> str:
    by_id = {row["id"]: row for row in rows.to_dict("records")}
    counts = "".join(
        f'<li><b style="color: {VERDICTS[verdict]}">{count}</b>{escape(verdict)}</li>'
        for verdict, count in tally(rows).items()
    )
    links, sections = [], []
    for item in _figures():
        others = [i.id for i in published().values() if i.figure == item.figure and i is not item]
        number = item.id.removeprefix("fig.")
        data = base64.b64encode(pictures[item.figure]).decode("ascii")
        links.append(f'<a href="#{item.figure}">Figure {number}</a>')
        sections.append(
            f'<section id="{item.figure}">\n<h2>Figure {number}</h2>\n<figure>'
            f'<img alt="{escape(item.value, quote=True)}" src="data:image/png;base64,{data}">\n'
            f"<figcaption>The paper shows: {escape(item.value)}.</figcaption></figure>\n"
            f"{_table([by_id[id] for id in (item.id, *others)])}</section>"
        )
    rest = [item.id for item in published().values() if not item.figure]
    table = [id for id in rest if id.startswith(_TABLE)]
    for name, title, ids in (
        ("table", "Table I and the matrices", table),
        ("text", "Text and equations", [id for id in rest if id not in table]),
    ):
        links.append(f'<a href="#{name}">{title}</a>')
        sections.append(f'<section id="{name}">\n<h2>{title}</h2>\n{_table([by_id[id] for id in ids])}</section>')
    body = "\n".join(sections)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>The paper, reproduced: report</title>
<style>{_STYLE}</style>
</head>
<body>
<h1>The paper, reproduced</h1>
<p>Every figure, table, number and claim of <em>Object Dimension Extraction for Environment Mapping
with Low Cost Cameras Fused with Laser Ranging</em> (University of Peradeniya) beside ours. Its
photographs and recordings were never published: unless a caption says otherwise, pictures and
scans here are of a virtual rig with the paper's cameras.</p>
<ul class="counts">{counts}</ul>
<nav>{" ".join(links)}</nav>
{body}
</body>
</html>
"""


def _table(rows: list[dict[str, str]]) -> str:
    head = "".join(f"<th>{name}</th>" for name in ("item", "paper", "ours", "difference", "verdict", "reason"))
    return f'<div class="rows"><table>\n<tr>{head}</tr>\n' + "".join(map(_row, rows)) + "</table></div>\n"


def _row(row: dict[str, str]) -> str:
    item = published()[row["id"]]
    unit = f" {row['unit']}" if row["unit"] else ""
    tolerance = f"<br><small>tolerance {escape(row['tolerance'])}</small>" if row["tolerance"] else ""
    about = "; ".join(part for part in (item.where, item.what, item.convention) if part)
    paper, ours = escape(row["paper"] + unit), escape(row["ours"] + (unit if row["difference"] else ""))
    if not isinstance(item.value, str):  # a matrix: one row a line
        paper, ours = paper.replace("; ", "<br>"), ours.replace("; ", "<br>")
    cells = (
        f"<code>{escape(row['id'])}</code><br><small>{escape(about)}</small>",
        paper,
        ours,
        escape(row["difference"]) + tolerance,
        f'<b class="verdict" style="color: {VERDICTS[row["verdict"]]}">{escape(row["verdict"])}</b>',
        f"{escape(row['reason'])} <small>{escape(row['notebook'])}</small>",
    )
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>\n"
