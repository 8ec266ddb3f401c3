"""Whether two sets of tables say the same: equal words, and numbers within the repeat tolerance."""

from __future__ import annotations

import csv
import re
from decimal import Decimal
from io import StringIO
from pathlib import Path

from stereolib.base import read_text

# Two runs on one machine agree to the last digit. Between processors and library versions sums are taken in another
# order, which iterative fits magnify: 1 %, or one unit of the last digit printed where that is more.
REPEAT_RTOL = 0.01
REPEAT_ATOL = 1e-9  # numbers that are rounding alone
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])")


def same_text(committed: str, fresh: str) -> bool:
    """Tell whether two table cells say the same: equal words, and numbers within the repeat tolerance.

    Parameters
    ----------
    committed, fresh : str

    Returns
    -------
    bool

    Notes
    -----
    ``|b - a| <= max(REPEAT_RTOL |a|, u, REPEAT_ATOL)`` with ``u`` one unit in the last digit printed, of whichever
    of the two numbers shows fewer digits.

    Examples
    --------
    >>> same_text("1.234 px", "1.235 px"), same_text("1.234 px", "1.249 px")
    (True, False)
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


def table_rows(path: Path) -> list[list[str]]:
    """Rows of a CSV file, the head among them.

    Parameters
    ----------
    path : Path

    Returns
    -------
    list of list of str
    """
    return list(csv.reader(StringIO(read_text(path), newline="")))


def compare_table(committed: Path, fresh: Path) -> list[str]:
    """List what changed between two CSV tables: row, column, both values.

    A ledger's ``difference`` is skipped, as ``ours`` holds the same news at its proper scale.

    Parameters
    ----------
    committed, fresh : Path

    Returns
    -------
    list of str
        One line for each cell that changed, or one for a table of another shape.
    """
    old, new = table_rows(committed), table_rows(fresh)
    name = fresh.name
    if not old or not new or old[0] != new[0]:
        return [f"{name}: columns changed from {old[:1]} to {new[:1]}"]
    if len(old) != len(new):
        return [f"{name}: {len(old) - 1} rows before, {len(new) - 1} now"]
    changed = []
    for before, after in zip(old[1:], new[1:], strict=True):
        for column, a, b in zip(old[0], before, after, strict=False):
            if not same_text(a, b) and not (column == "difference" and "ours" in old[0]):
                changed.append(f"{name}, row {before[0]}, {column}: {a} before, {b} now")
    return changed


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

    Examples
    --------
    >>> compare_tables(Path("a/folder/without/tables"), Path("another"))
    []
    """
    changed = []
    for committed in [committed_dir / "ledger.csv", *sorted((committed_dir / "tables").glob("*.csv"))]:
        fresh = fresh_dir / committed.relative_to(committed_dir)
        if fresh.is_file() and committed.is_file():
            changed += compare_table(committed, fresh)
        elif committed.is_file() and complete:
            changed.append(f"{committed.name}: no notebook makes it any more")
    return changed
