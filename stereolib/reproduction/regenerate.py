"""Regenerate the paper: execute the notebooks, compare their numbers with the committed ones, then replace.

Everything is made in a staging folder beside ``figures/``. Only when every notebook succeeded, and no committed
number changed beyond the repeat tolerance, is each file moved over its predecessor, one ``os.replace`` each. An
interruption at any moment leaves every committed file whole; what it leaves in staging goes at the next run.
"""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from decimal import Decimal
from pathlib import Path

from stereolib.base import datasets
from stereolib.reproduction import execution

# Two runs on one machine agree to the last digit. Between processors and library versions sums are taken in another
# order, which iterative fits magnify: 1 %, or one unit of the last digit printed where that is more.
REPEAT_RTOL = 0.01
REPEAT_ATOL = 1e-9
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])")


def find_notebooks(folder: Path, names: Sequence[str] = ()) -> list[Path]:
    """Notebooks of a folder in order; ``names`` (``"03"``, ``"03_sgbm_parameters"``) selects some.

    Raises
    ------
    ValueError
        If there is none, or a name fits none or several; the text lists what is there.
    """
    present = sorted(folder.glob("*.ipynb"))
    if not present:
        raise ValueError(f"no notebooks in {folder}; run from a checkout of the whole repository")
    chosen = set()
    for name in names:
        stem = Path(name).name.removesuffix(".ipynb")
        fits = [path for path in present if path.stem == stem] or [
            path for path in present if path.stem.startswith(stem)
        ]
        if len(fits) != 1:
            there = ", ".join(path.stem for path in present)
            raise ValueError(f"{len(fits)} notebooks fit {name!r}; there are {there}. Give a number or a whole name")
        chosen.add(fits[0])
    return [path for path in present if not names or path in chosen]


def same_text(committed: str, fresh: str) -> bool:
    """Tell whether two table cells say the same: equal words, and numbers within the repeat tolerance.

    Notes
    -----
    ``|b - a| <= max(REPEAT_RTOL |a|, u, REPEAT_ATOL)`` with ``u`` one unit in the last digit printed, of whichever
    of the two numbers shows fewer digits.
    """
    if committed == fresh:
        return True
    if _NUMBER.split(committed) != _NUMBER.split(fresh):
        return False
    for a, b in zip(_NUMBER.findall(committed), _NUMBER.findall(fresh), strict=True):
        unit = max(10.0 ** int(Decimal(x).as_tuple().exponent) for x in (a, b))
        if abs(float(a) - float(b)) > max(REPEAT_RTOL * abs(float(a)), unit, REPEAT_ATOL) * (1 + 1e-9):
            return False
    return True


def _rows(path: Path) -> list[list[str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.reader(stream))


def compare_table(committed: Path, fresh: Path) -> list[str]:
    """List what changed between two CSV tables: row, column, both values. A ledger's ``difference`` is skipped, as
    ``ours`` holds the same news at its proper scale."""
    old, new = _rows(committed), _rows(fresh)
    name = fresh.name
    if not old or not new or old[0] != new[0]:
        return [f"{name}: columns changed from {old[:1]} to {new[:1]}"]
    if len(old) != len(new):
        return [f"{name}: {len(old) - 1} rows before, {len(new) - 1} now"]
    found = []
    for before, after in zip(old[1:], new[1:], strict=True):
        for column, a, b in zip(old[0], before, after, strict=False):
            if not same_text(a, b) and not (column == "difference" and "ours" in old[0]):
                found.append(f"{name}, row {before[0]}, {column}: {a} before, {b} now")
    return found


def compare_tables(committed_dir: Path, fresh_dir: Path, complete: bool = True) -> list[str]:
    """Compare every table of two figure folders: ``ledger.csv`` and ``tables/*.csv``.

    Parameters
    ----------
    committed_dir, fresh_dir : Path
        Figure folders. A table that only ``fresh_dir`` has is new, not changed.
    complete : bool
        Whether ``fresh_dir`` should hold every table; if so a missing one is reported.

    Returns
    -------
    list of str
        One line for each number or word that changed beyond the repeat tolerance; empty when none did.
    """
    found = []
    for committed in [committed_dir / "ledger.csv", *sorted((committed_dir / "tables").glob("*.csv"))]:
        fresh = fresh_dir / committed.relative_to(committed_dir)
        if fresh.is_file() and committed.is_file():
            found += compare_table(committed, fresh)
        elif committed.is_file() and complete:
            found.append(f"{committed.name}: no notebook makes it any more")
    return found


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold a lock that the system drops with the process: one run at a time, and no lock outlives its run."""
    with path.open("a") as stream:
        try:
            if os.name == "nt":
                import msvcrt

                msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined, unused-ignore]
            else:
                import fcntl

                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise ValueError(f"another reproduce is at work here ({path}); wait for it, or stop it") from None
        yield


@contextmanager
def _figures_in(folder: Path) -> Iterator[None]:
    before = os.environ.get("STEREOLIB_FIGURES")
    os.environ["STEREOLIB_FIGURES"] = str(folder)
    try:
        yield
    finally:
        del os.environ["STEREOLIB_FIGURES"]
        if before is not None:
            os.environ["STEREOLIB_FIGURES"] = before


def _promote(staged_dir: Path, target_dir: Path) -> int:
    """Move staged files over their predecessors, each whole at any moment; equal ones stay. Return how many moved."""
    moved = 0
    for staged in sorted(path for path in staged_dir.rglob("*") if path.is_file()):
        target = target_dir / staged.relative_to(staged_dir)
        if target.is_file() and target.read_bytes() == staged.read_bytes():
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(staged, target)
        moved += 1
    return moved


def _skipped(notebook: Path) -> bool:
    """Whether a cell of an executed notebook had to do without its recording (`datasets.available`)."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    outputs = (output for cell in cells for output in cell.get("outputs", ()))
    return any("".join(output.get("text", "")).startswith("skipped: ") for output in outputs)


def _build_report(figures_dir: Path) -> None:
    from stereolib.reproduction import report

    report.build(figures_dir)


def verdicts(ledger: Path) -> str:
    """The ledger as a table for the terminal, and below it how many rows got each verdict."""
    header, *rows = _rows(ledger)
    columns = [header.index(name) for name in ("id", "paper", "ours", "difference", "unit", "verdict")]
    table = [[row[column] for column in columns] for row in [header, *rows]]
    widths = [min(max(len(row[k]) for row in table), 40) for k in range(len(columns))]
    lines = ["  ".join(cell[:40].ljust(width) for cell, width in zip(row, widths, strict=True)) for row in table]
    counts = Counter(row[-1] for row in table[1:])
    lines.append("")
    lines.append(f"{len(rows)} rows: " + ", ".join(f"{n} {verdict}" for verdict, n in counts.most_common()))
    return "\n".join(line.rstrip() for line in lines)


def reproduce(
    notebooks_dir: Path | None = None,
    figures_dir: Path | None = None,
    names: Sequence[str] = (),
    jobs: int = 2,
    check: bool = False,
    accept: bool = False,
    build_report: Callable[[Path], None] = _build_report,
) -> list[str]:
    """Execute notebooks, rebuild the report, and replace the committed files when no number changed.

    Parameters
    ----------
    notebooks_dir, figures_dir : Path, optional
        Default: the repository's. Staging is made beside ``figures_dir``, on the same disk.
    names : sequence of str
        Which notebooks; none means all.
    jobs : int
        Notebooks at once.
    check : bool
        Compare only; replace nothing.
    accept : bool
        Replace although numbers changed.
    build_report : callable
        Writes ``ledger.csv`` and ``report.html`` into the folder it gets.

    Returns
    -------
    list of str
        What changed beyond the repeat tolerance. When it is not empty and not accepted, nothing was replaced and the
        new files stay in staging to be looked at.

    Raises
    ------
    NotebookError
        When a notebook failed; nothing was replaced.
    ValueError
        If a name fits no notebook, or another run is at work.
    """
    notebooks_dir = notebooks_dir or datasets.repository() / "notebooks"
    figures_dir = (figures_dir or datasets.figures_dir()).resolve()
    sources = find_notebooks(notebooks_dir, names)
    staging = figures_dir.parent / ".staging"
    with _locked(figures_dir.parent / ".staging.lock"):
        shutil.rmtree(staging, ignore_errors=True)
        staged_figures, staged_notebooks = staging / "figures", staging / "notebooks"
        if names and figures_dir.is_dir():  # the other notebooks' tables and figures are still in the report
            shutil.copytree(figures_dir, staged_figures)
        staged_figures.mkdir(parents=True, exist_ok=True)
        execution.execute(sources, staged_notebooks, staged_figures, jobs)
        with _figures_in(staged_figures):
            build_report(staged_figures)
        changed = compare_tables(figures_dir, staged_figures, complete=not names)
        if (ledger := staged_figures / "ledger.csv").is_file():
            print(verdicts(ledger))
        for path in sorted(staged_notebooks.glob("*.ipynb")):
            if _skipped(path) and (notebooks_dir / path.name).is_file():
                print(f"{path.stem}: some recordings are not available here, so its committed outputs are kept")
                path.unlink()
        if check or (changed and not accept):
            return changed
        moved = _promote(staged_figures, figures_dir) + _promote(staged_notebooks, notebooks_dir)
        if (readme := figures_dir.parent / "README.md").is_file():
            from stereolib.reproduction import report

            report.update_readme(readme, figures_dir, figures_dir.parent / "benchmarks" / "results")
        print(f"{len(sources)} notebooks executed; {moved} files are new, the others came out the same")
        shutil.rmtree(staging, ignore_errors=True)
    return changed
