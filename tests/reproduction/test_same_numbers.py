"""What counts as the same number, word and table."""

from __future__ import annotations

from pathlib import Path

import pytest

from stereolib.reproduction import compare_tables
from stereolib.reproduction.same_numbers import same_text


@pytest.mark.parametrize(
    ("committed", "fresh", "same"),
    [
        ("1.234", "1.235", True),  # one unit of the last digit
        ("1.234", "1.2", True),  # printed with fewer digits
        ("1.234", "1.249", False),
        ("12345", "12400", True),  # within 1 %
        ("12345", "12500", False),
        ("0.0012", "0.0014", False),
        ("1.2e-13", "5e-11", True),  # rounding noise around zero
        ("[1.00 -2.00] px", "[1.01 -2.01] px", True),
        ("[1.00 -2.00] px", "[1.00 2.00] px", False),
        ("agrees", "differs", False),
        ("fig04", "fig05", False),  # a name, not a number
        ("3.0", "nan", False),
    ],
)
def test_repeat_tolerance(committed: str, fresh: str, same: bool) -> None:
    assert same_text(committed, fresh) is same


def test_tables_that_vanish_or_change_shape_are_named(tmp_path: Path) -> None:
    for name, text in {"old/tables/a.csv": "id,v\nx,1\n", "old/tables/b.csv": "id,v\nx,1\n"}.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "new" / "tables").mkdir(parents=True)
    (tmp_path / "new" / "tables" / "b.csv").write_text("id,v\nx,1\ny,2\n")
    changed = compare_tables(tmp_path / "old", tmp_path / "new")
    assert changed == ["a.csv: no notebook makes it any more", "b.csv: 1 rows before, 2 now"]
