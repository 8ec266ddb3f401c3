"""What the README says of the ledger, in counts and in short, and of the benchmarks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from stereolib.base import read_json, read_text, write_atomic
from stereolib.paper import published, recorded_rows
from stereolib.reproduction.report import MEANINGS, count_kinds, sort_out

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
_POINTS = "points of bad-2"
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
        _POINTS,
        "at least 0",
    ),
    "a sweep against the bare cv2 time": ("study", "overhead_pct", "% more", "at most 3"),
    "two workers against one": ("study", "two_workers_times", "times faster", "at least 1.85"),
    "`best` on photographs, all pixels": ("pipeline", "motorcycle_best_bad2_pct", "% bad-2", "at most 6"),
    "its errors inside one standard deviation": ("pipeline", "virtual_inside_pct", "%", "63 to 73"),
    "the same on photographs": ("pipeline", "motorcycle_inside_pct", "%", "63 to 73"),
    "`fast` against plain SGBM": ("pipeline", "fast_times_plain", "times faster", "at least 2"),
    "its bad pixels, fewer than plain SGBM's by": ("pipeline", "fast_less_bad2_points", _POINTS, "-1 or more"),
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


def update_readme_tables(readme: Path, figures: Path, results: Path) -> None:
    """Write what the README says of the ledger and of the benchmarks, between its marks.

    Parameters
    ----------
    readme : Path
        Holds ``<!-- counts --> ... <!-- /counts -->`` and the same for ``ledger`` and ``bench``.
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
    rows = recorded_rows(figures)
    for mark, table in (
        ("counts", ledger_summary(rows)),
        ("ledger", ledger_table(rows)),
        ("bench", bench_table(results)),
    ):
        before, opening, rest = text.partition(f"<!-- {mark} -->")
        _, closing, after = rest.partition(f"<!-- /{mark} -->")
        if not closing:
            raise ValueError(f"{readme} has no <!-- {mark} --> ... <!-- /{mark} --> to write the table between")
        text = f"{before}{opening}\n{table}\n{closing}{after}"
    write_atomic(readme, text)


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
        verdict = "; ".join(f"*{kind}*: {_counted(counts, len(some))}" for kind, counts in count_kinds(some).items())
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
    failed, part, against = (sorted_out[name] for name in ("failed", "in_part", "contradictions"))
    lines = [
        f"**Of {len(rows)} rows, {len(sorted_out['tests'])} could have failed**: data could have turned their verdict. "
        f"**{len(failed)} of them did** ({_named(failed)}), {len(part)} hold in part ({_named(part)}). "
        f"In {len(against)} others the paper contradicts itself ({_named(against)}).",
        "",
        "| kind of row | what it means | verdicts |",
        "|---|---|---|",
    ]
    lines += [f"| {kind} | {MEANINGS[kind]} | {_counted(counts, 0)} |" for kind, counts in kinds.items()]
    return "\n".join([*lines, "", "[Each row with its limits and its reason](figures/ledger.csv)."])


def _named(rows: list[dict[str, str]]) -> str:
    return ", ".join(f"`{row['id']}`" for row in rows)


def _counted(counts: dict[str, int], alone: int) -> str:
    """Verdicts with their counts; of `alone` rows with a single verdict the count goes without saying."""
    return ", ".join(name if n == alone else f"{name} ({n})" for name, n in counts.items())


def bench_table(results: Path) -> str:
    """What the benchmarks wrote, as Markdown; what was not measured yet is left out.

    Parameters
    ----------
    results : Path
        Folder of the benchmarks' JSON files.

    Returns
    -------
    str

    Examples
    --------
    >>> print(bench_table(Path("no/results/yet")))
    | measured | value | goal |
    |---|---|---|
    """
    lines = ["| measured | value | goal |", "|---|---|---|"]
    for label, (name, key, unit, goal) in BENCHES.items():
        path = results / f"{name}.json"
        value = read_json(path) if path.is_file() else {}
        for part in key.split("."):
            value = value.get(part, {})
        if value != {}:
            lines.append(f"| {label} | {value:g} {unit} | {goal} |")
    return "\n".join(lines)
