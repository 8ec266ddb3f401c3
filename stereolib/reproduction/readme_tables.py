"""What the README says of the ledger, in counts and in short, and of the benchmarks."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stereolib.base import read_json, read_text, write_atomic
from stereolib.paper import published, recorded_rows
from stereolib.reproduction.code_hash import code_sha256
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
_POINTS = "points of bad-2"
_OLDER = "measured with older code"
_HOLE = re.compile(r"{([\w.]+)}")
# What the README quotes of the benchmarks: label -> (file, key, unit, goal). A label's {key} is filled from the file.
BENCHES = {
    "focal lengths, virtual boards calibrated": ("accuracy", "focal_error_pct", "% off", "at most 0.1"),
    "their principal points": ("accuracy", "principal_point_error_px", "px off", "at most 1"),
    "their baseline": ("accuracy", "baseline_error_mm", "mm off", "at most 0.05"),
    "their rows after rectification": ("accuracy", "epipolar_rms_px", "px rms", "under 0.1"),
    "true values within the stated 95 % intervals, {held_pct.corners.draws} draws of virtual corners with "
    "independent noise": ("calibration", "held_pct.corners.all", "%", "90 to 99"),
    "the same, {rendered.sets} board sets rendered by the virtual rig and detected": (
        "calibration",
        "rendered.all",
        "%",
        "90 to 99",
    ),
    "faulty virtual board sets not named, of {faults.sets}": ("calibration", "faults_missed", "missed", "0"),
    "squares of virtual boards left out": ("calibration", "square_error_pct", "% off", "at most 0.1"),
    "boards found, rig calibrated, one core": (
        "calibration_time",
        "one_core_ratio",
        "x the bare calls",
        "at most 1.15",
    ),
    "the same on two cores": ("calibration_time", "two_cores_ratio", "x the bare calls", "under 1"),
    "rectify + SGBM against the bare cv2 calls": ("overhead", "ratio", "x their time", "at most 1.05"),
    "laser bytes decoded": ("lrf_time", "mb_per_s", "MB/s", "at least 100"),
    "the same against a plain loop over packets": ("lrf_time", "times_a_plain_loop", "times faster", "at least 15"),
    "intact packets in a damaged stream of {packets}": ("lrf", "intact_lost", "lost", "0"),
    "reading the emulated laser live": ("lrf_time", "live_cpu_pct", "% of a core", "under 5"),
    "virtual laser on the virtual cube, median of five turns": ("lrf", "sweep_error_mm", "mm off (median)", "under 3"),
    "the laser's search window against 128 disparities, slowest of {distances} distances to the virtual cube": (
        "study_time",
        "times_faster_least",
        "times faster",
        "at least 3",
    ),
    "the same against a window cut to the cube, slowest": ("study_time", "cut_times_faster_least", "times faster", ""),
    "the same, fastest": ("study_time", "cut_times_faster_most", "times faster", ""),
    "against a window cut to the cube, with the laser's own settings of SGBM, slowest": (
        "study_time",
        "cut_alike_times_faster_least",
        "times faster",
        "",
    ),
    "its bad pixels on the virtual cube, fewer than with 128 disparities by at least": (
        "study",
        "least_gain_bad2_points",
        _POINTS,
        "at least 0",
    ),
    "the same against the window cut to the cube": ("study", "cut_least_gain_bad2_points", _POINTS, ""),
    "its price: rms error on the virtual cube": ("study", "rms_times", "times that of 128 disparities (median)", ""),
    "its price: pull towards whole pixels": ("study", "locking_times", "times that of 128 disparities (median)", ""),
    "a sweep against the bare cv2 time": ("study_time", "overhead_pct", "% more", "at most 3"),
    "two workers against one": ("study_time", "two_workers_times", "times faster", "at least 1.85"),
    "`best` on photographs, all pixels": ("pipeline", "motorcycle_best_bad2_pct", "% bad-2", "at most 6"),
    "its errors inside one standard deviation, virtual scenes": ("pipeline", "virtual_inside_pct", "%", "63 to 73"),
    "the same on photographs": ("pipeline", "motorcycle_inside_pct", "%", "63 to 73"),
    "`fast` against plain SGBM, which leaves the left columns out": (
        "pipeline_time",
        "fast_times_plain",
        "times faster",
        "at least 2",
    ),
    "`fast` against SGBM on the same columns (`whole=True`)": ("pipeline_time", "fast_times_whole", "times faster", ""),
    "its bad pixels on {pairs} virtual pairs, fewer than plain SGBM's by": (
        "pipeline",
        "fast_less_bad2_points",
        _POINTS,
        "-1 or more",
    ),
    "the same against SGBM on the same columns": ("pipeline", "fast_less_bad2_than_whole_points", _POINTS, ""),
    **{
        f"{what} of {{{what}.measured}} of {{scenes}} virtual boxes, {how}": (
            "dimensions",
            f"{what}.{key}",
            "% off",
            f"at most {goal:g}",
        )
        for what, goals in (("height", (1, 3)), ("length", (1.5, 4)), ("width", (1.5, 4)), ("volume", (3, 8)))
        for how, key, goal in zip(("median", "95th percentile"), ("median_pct", "p95_pct"), goals, strict=True)
    },
    "their {sizes} 95 % intervals that hold the truth": ("dimensions", "coverage95_pct", "%", "90 to 99"),
    "virtual boxes that lack a size, each with its reason": ("dimensions", "refused_pct", "% of {scenes}", ""),
    "virtual boxes more than 10 % off, unsaid": ("dimensions", "silent_error_pct", "% of {scenes}", "at most 1"),
    "the paper's recipe on the {paper.near.boxes} virtual boxes {paper.near.from_mm} to {paper.near.to_mm} mm away, "
    "where the paper meant the cube to stand, median": ("dimensions", "paper.near.median_pct", "% off", ""),
    "the same on the other {paper.others.boxes}": ("dimensions", "paper.others.median_pct", "% off", ""),
    "the recipe on those {paper.near_told.boxes} near virtual boxes whose height is told above, median": (
        "dimensions",
        "paper.near_told.median_pct",
        "% off",
        "",
    ),
    "the heights told above, of the same {paper.near_told.boxes} virtual boxes, median": (
        "dimensions",
        "paper.near_told.ours_median_pct",
        "% off",
        "",
    ),
    "the recipe on all {paper.told.boxes} virtual boxes whose height is told above, median": (
        "dimensions",
        "paper.told.median_pct",
        "% off",
        "",
    ),
    "measurements on one core": ("dimensions_time", "per_second", "a second", "at least 20"),
    "one of them against the cv2 calls inside": ("dimensions_time", "times_cv2_inside", "x their time", "at most 1.25"),
    "`import stereolib`": ("time", "import_s", "s", "under 0.5"),
    "all notebooks and the report": ("time", "reproduce_s", "s", "under 300"),
}


def update_readme_tables(readme: Path, figures: Path, results: Path) -> None:
    """Write what the README says of the ledger and of the benchmarks, between its marks.

    Parameters
    ----------
    readme : Path
        Holds ``<!-- counts --> ... <!-- /counts -->`` and the same for ``finding``, ``ledger`` and ``bench``.
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
        "finding": textwrap.fill(f"**The main finding.** {finding(figures)}", 125),
        "counts": ledger_summary(rows),
        "ledger": ledger_table(rows),
        "bench": bench_table(results),
    }


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
    tests, failed, part, against = (sorted_out[name] for name in ("tests", "failed", "in_part", "contradictions"))
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
        f"({_counted(holding, 0)}). In {len(against)} of the others the paper contradicts itself. "
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


def bench_table(results: Path) -> str:
    """What the benchmarks wrote, as Markdown; what was not measured yet is left out.

    Parameters
    ----------
    results : Path
        Folder of the benchmarks' JSON files. Where the ``code`` of one has another hash than the same rooms have
        today, or none, its rows say that they were measured with older code.

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
    files = {name: results / f"{name}.json" for name, *_ in BENCHES.values()}
    found = {name: read_json(path) for name, path in files.items() if path.is_file()}
    older = {name: f", {_OLDER}" * (not _is_of_today(result)) for name, result in found.items()}
    for label, (name, key, unit, goal) in BENCHES.items():
        value = _look_up(found.get(name, {}), key)
        if value is not None:
            label, unit = (_fill_in(text, found[name]) for text in (label, unit))
            missed = ", **missed**" * (not meets(value, goal))
            lines.append(f"| {label} | {value:g} {unit}{older[name]} | {goal}{missed} |")
    return "\n".join(lines)


def meets(value: float, goal: str) -> bool:
    """Whether a value reaches a goal as the README words it.

    Parameters
    ----------
    value : float
    goal : str
        Such as "at most 3", "under 3", "at least 3", "3 or more", "3 to 5", "3"; "" is always reached.

    Returns
    -------
    bool

    Raises
    ------
    ValueError
        If the goal is worded in another way.

    Examples
    --------
    >>> [meets(3.0, goal) for goal in ("at most 3", "under 3", "-1 or more", "4 to 5", "")]
    [True, False, True, False, True]
    """
    match = re.fullmatch(r"(at most |under |at least |)(-?[\d.]+)(?: (or more)| to ([\d.]+))?", goal)
    if not goal:
        return True
    if match is None:
        raise ValueError(f"a goal is worded as in the examples, got {goal!r}")
    first, low, more, high = match.groups()
    limit = float(low)
    if high:
        return limit <= value <= float(high)
    if first == "under ":
        return value < limit
    return value >= limit if first == "at least " or more else value <= limit


def _look_up(result: dict[str, Any], key: str) -> Any:
    """What stands in a result under a key such as ``"height.median_pct"``; None where nothing does."""
    for part in key.split("."):
        result = result.get(part, {})
    return None if result == {} else result


def _fill_in(text: str, result: dict[str, Any]) -> str:
    """Put a result's values for the keys in braces, 400,000 as ``400 000``."""
    return _HOLE.sub(lambda hole: f"{_look_up(result, hole[1]) or 0:,}".replace(",", " "), text)


def _is_of_today(result: dict[str, Any]) -> bool:
    """Whether a result was measured with the code that its rooms have today."""
    code = result.get("code")
    return code is not None and code["sha256"] == code_sha256(code["rooms"])
