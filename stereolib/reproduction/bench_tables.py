"""What the README says of the benchmarks; ``benchmarks/readme.toml`` says which of their values, and the goals."""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from stereolib.base import read_json, read_text, repository
from stereolib.reproduction.code_hash import code_sha256

_OLDER, _MISSED = "measured with older code", ", **missed**"
_BENCH_HEAD = ("measured", "value", "goal")
_HOLE = re.compile(r"{([\w.]+)}")
_BY_CHANCE = 0.01  # a share of intervals misses its goal where chance alone is less probable than this
_SIZES = ("length", "width", "height", "volume")


class Line(NamedTuple):
    """A line of the README: what stands in ``results/<file>.json`` under a key such as ``"height.median_pct"``."""

    label: str
    file: str
    key: str
    unit: str
    goal: str


class _Row(NamedTuple):
    """A row of the README's table, whether its goal is met, where it has one, and whether older code was measured."""

    text: str
    is_met: bool | None
    is_older: bool


@cache
def _quoted() -> dict[str, Any]:
    """What ``benchmarks/readme.toml`` says."""
    return tomllib.loads(read_text(repository() / "benchmarks" / "readme.toml"))


def bench_topics() -> dict[str, tuple[Line, ...]]:
    """List what the README quotes of the benchmarks, by topics, in its order.

    Returns
    -------
    dict of str to tuple of Line

    Examples
    --------
    >>> bench_topics()["Calibration"][0].goal
    'at most 0.1'
    """
    return {topic["title"]: tuple(Line(*line) for line in topic["lines"]) for topic in _quoted()["topics"]}


def bench_table(results: Path) -> str:
    """What the benchmarks wrote, as Markdown: the goals missed, then all by topics, folded.

    Parameters
    ----------
    results : Path
        Folder of the benchmarks' JSON files. Where the ``code`` of one has another hash than the same rooms have
        today, or none, its rows say that they were measured with older code. What was not measured yet is left out.

    Returns
    -------
    str

    Examples
    --------
    >>> bench_table(Path("no/results/yet"))
    ''
    """
    folded, all_rows = [], []
    for title, lines in bench_topics().items():
        rows = [row for line in lines if (row := _bench_row(line, _result(results, line.file)))]
        aimed = [row for row in rows if row.is_met is not None]
        title = f"{title}: {sum(bool(row.is_met) for row in aimed)} of {len(aimed)} goals met"
        folded += [_folded(title, _table(_BENCH_HEAD, [row.text for row in rows]))] if rows else []
        all_rows += aimed
    missed = [row.text for row in all_rows if not row.is_met]
    older = sum(row.is_older for row in all_rows)
    return _missed_first("goals are met", len(all_rows), _BENCH_HEAD, missed, folded, older)


def _bench_row(line: Line, result: dict[str, Any]) -> _Row | None:
    value = _look_up(result, line.key)
    if value is None:
        return None
    label, unit = (_fill_in(text, result) for text in (line.label, line.unit))
    is_older, is_met = not _is_of_today(result), meets(value, line.goal) if line.goal else None
    told = f"{value:g} {unit}" + f", {_OLDER}" * is_older
    return _Row(f"| {label} | {told} | {_marked(line.goal, is_met is False)} |", is_met, is_older)


def rigs_table(results: Path) -> str:
    """What disturbed rigs do to the sizes, as Markdown: a row each, goals in brackets, what was not told beside it.

    Parameters
    ----------
    results : Path
        As for `bench_table`; nothing is shown before ``rigs.json`` is there.

    Returns
    -------
    str

    Notes
    -----
    A share of intervals outside its goal misses it only where the two-sided binomial test against the goal's nearest
    end rejects at 1 %.
    """
    found = _result(results, "rigs")
    if not found:
        return ""
    goals = _quoted()["rigs"]
    inside, silent, all_refused = goals["within_2_sigma_pct"], goals["silent"], goals["all_refused"]
    head = (
        "what is wrong", "boxes refused", "lack a size, of those that could have all",
        "of those with a top or second face 12 px wide", "sizes told",
        "median error of length / width / height / volume, %", "95th percentile of all, %",
        f"in the 95 % interval, % ({inside})", "inside ± σ, %", f"wrong, unsaid ({silent})",
    )  # fmt: skip
    rows, missed = [], []
    for name, row in found["rows"].items():
        medians = " / ".join(f"{row[size]['median_pct']:.2g}" if row[size]["told"] else "-" for size in _SIZES)
        off_goal = not meets(row.get("within_2_sigma_pct", 95.0), inside) and row["binomial_p"] < _BY_CHANCE
        goal, lacking = goals["measurable_lacking_pct"].get(name, ""), row["measurable_lacking_pct"]
        seen = row["scenes"] - row["refused"] if name in all_refused else 0
        cells = (
            row["about"], _marked(f"{row['refused']} of {row['scenes']}", seen > 0),
            _marked(f"{lacking:g} % of {row['measurable']}" + f" ({goal})" * bool(goal), not meets(lacking, goal)),
            f"{row['wide_lacking']} of {row['wide']}", f"{row['sizes']}", medians,
            f"{row['p95_pct']:.2g}" if "p95_pct" in row else "-",
            _marked(f"{row.get('within_2_sigma_pct', '-')}", off_goal),
            f"{row.get('within_1_sigma_pct', '-')}",
            _marked(f"{row['silent']} beyond {row['silent_beyond_pct']:g} %", not meets(row["silent"], silent)),
        )  # fmt: skip
        rows.append(f"| {' | '.join(cells)} |")
        told = [
            f"{title}: {cell.removesuffix(_MISSED)}"
            for title, cell in zip(head, cells, strict=True)
            if cell.endswith(_MISSED)
        ]
        missed += [f"| {row['about']} | {'; '.join(told)} |"] if told else []
    rest, older = [_folded(f"All {len(rows)} rows", _table(head, rows))], 0 if _is_of_today(found) else len(rows)
    return _missed_first("rows meet all their goals", len(rows), ("what is wrong", "goals missed"), missed, rest, older)


def _missed_first(what: str, of: int, head: tuple[str, ...], missed: list[str], rest: list[str], older: int) -> str:
    """How many goals are met, by which code, then those that are not, then the rest; "" where nothing was measured."""
    count = f"**{of - len(missed)} of {of} {what}.**"
    if older:
        count += f" Of the {of}, {'all' if older == of else older} were {_OLDER}."
    shown = [f"Missed:\n\n{_table(head, missed)}"] if missed else []
    return "\n\n".join([count, *shown, *rest]) if rest else ""


def _table(head: tuple[str, ...], rows: list[str]) -> str:
    return "\n".join([f"| {' | '.join(head)} |", "|" + "---|" * len(head), *rows])


def _folded(title: str, block: str) -> str:
    title = re.sub("`([^`]+)`", r"<code>\1</code>", title)  # no Markdown is read there
    return f"<details><summary>{title}</summary>\n\n{block}\n\n</details>"


def _marked(text: str, missed: bool) -> str:
    return f"{text}{_MISSED}" if missed else text


def _result(results: Path, name: str) -> dict[str, Any]:
    """What a benchmark wrote; empty if it was never run."""
    path = results / f"{name}.json"
    return read_json(path) if path.is_file() else {}


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
    values = {name: _look_up(result, name) or 0 for name in _HOLE.findall(text)}
    shown = {name: one if isinstance(one, str) else f"{one:,}".replace(",", " ") for name, one in values.items()}
    return _HOLE.sub(lambda hole: shown[hole[1]], text)


def _is_of_today(result: dict[str, Any]) -> bool:
    """Whether a result was measured with the code that its rooms, or modules, have today."""
    code = result.get("code")
    try:
        return code is not None and code["sha256"] == code_sha256(code["rooms"])
    except ValueError:
        return False  # a module of it is gone
