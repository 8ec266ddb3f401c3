"""Regenerate the paper: execute the notebooks, compare their numbers with the committed ones, then replace.

Everything is made in a staging folder beside ``figures/``. Only when every notebook succeeded, and no committed
number changed beyond the repeat tolerance, is each file moved over its predecessor, one ``os.replace`` each. An
interruption at any moment leaves every committed file whole; what it leaves in staging goes at the next run.
"""

from __future__ import annotations

import os
import shutil
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from stereolib.base import counted, datasets, read_bytes, read_json
from stereolib.reproduction.execution import execute_notebooks
from stereolib.reproduction.readme_tables import update_readme_tables
from stereolib.reproduction.report import build_report
from stereolib.reproduction.same_numbers import compare_tables, table_rows

_WIDEST = 40  # characters of a column in the terminal


def find_notebooks(folder: Path, names: Sequence[str] = ()) -> list[Path]:
    """Notebooks of a folder in order.

    Parameters
    ----------
    folder : Path
    names : sequence of str
        Numbers or names (``"03"``, ``"03_sgbm_parameters"``) of those that are meant; none means all.

    Returns
    -------
    list of Path

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


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold a lock that the system drops with the process: one run at a time, and no lock outlives its run."""
    try:
        stream = path.open("a")
    except OSError as error:
        why = f"{path.parent} cannot be written ({error.strerror})"
        raise ValueError(f"{why}: name a folder of your own with --output, or copy the project to one") from None
    with stream:
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


def _promote(staged_dir: Path, target_dir: Path) -> list[Path]:
    """Move staged files over their predecessors, each whole at any moment; equal ones stay. Return what moved."""
    moved = list[Path]()
    for staged in sorted(path for path in staged_dir.rglob("*") if path.is_file()):
        target = target_dir / staged.relative_to(staged_dir)
        if target.is_file() and read_bytes(target) == read_bytes(staged):
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        os.replace(staged, target)
        moved.append(target)
    return moved


def _skipped(notebook: Path) -> bool:
    """Whether a cell of an executed notebook had to do without its recording (`datasets.available`)."""
    cells = read_json(notebook)["cells"]
    outputs = (output for cell in cells for output in cell.get("outputs", ()))
    return any("".join(output.get("text", "")).startswith("skipped: ") for output in outputs)


def _verdicts(ledger: Path) -> str:
    """The ledger as a table for the terminal, and below it how many rows got each verdict."""
    header, *rows = table_rows(ledger)
    columns = [header.index(name) for name in ("id", "paper", "ours", "difference", "unit", "verdict")]
    table = [[row[column] for column in columns] for row in [header, *rows]]
    widths = [min(max(len(row[k]) for row in table), _WIDEST) for k in range(len(columns))]
    lines = ["  ".join(cell[:_WIDEST].ljust(width) for cell, width in zip(row, widths, strict=True)) for row in table]
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
        execute_notebooks(sources, staged_notebooks, staged_figures, jobs)
        build_report(staged_figures, notebooks_dir)
        changed = compare_tables(figures_dir, staged_figures, complete=not names)
        if (ledger := staged_figures / "ledger.csv").is_file():
            print(_verdicts(ledger))
        for path in sorted(staged_notebooks.glob("*.ipynb")):
            if _skipped(path) and (notebooks_dir / path.name).is_file():
                print(f"{path.stem}: some recordings are not available here, so its committed outputs are kept")
                path.unlink()
        if check or (changed and not accept):
            return changed
        moved = _promote(staged_figures, figures_dir) + _promote(staged_notebooks, notebooks_dir)
        if (readme := figures_dir.parent / "README.md").is_file():
            before = read_bytes(readme)
            update_readme_tables(readme, figures_dir, figures_dir.parent / "benchmarks" / "results")
            moved += [readme] if read_bytes(readme) != before else []
        named = "".join(f"\n  {os.path.relpath(path, figures_dir.parent)}" for path in moved)
        done = counted(len(sources), "notebook")
        print(f"{done} executed; new: {counted(len(moved), 'file')}; the others came out the same{named}")
        shutil.rmtree(staging, ignore_errors=True)
    return changed
