"""The README's tables are what the ledger and the benchmarks say."""

from __future__ import annotations

from pathlib import Path

import pytest

from stereolib import paper
from stereolib.base import ROOT
from stereolib.reproduction import readme_tables, update_readme_tables


def test_the_readme_quotes_the_ledger_and_the_benchmarks_as_they_are() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert readme_tables.ledger_table(paper.recorded_rows(ROOT / "figures")) in text
    assert readme_tables.bench_table(ROOT / "benchmarks" / "results") in text


def test_tables_are_written_between_their_marks(tmp_path: Path) -> None:
    readme = tmp_path / "README.md"
    readme.write_text("a\n<!-- ledger -->\nold\n<!-- /ledger -->\nb\n<!-- bench -->\n<!-- /bench -->\nc\n")
    ledger = readme_tables.ledger_table(paper.recorded_rows(ROOT / "figures"))
    for _ in range(2):  # the second time nothing changes
        update_readme_tables(readme, ROOT / "figures", tmp_path)
        assert readme.read_text() == (
            f"a\n<!-- ledger -->\n{ledger}\n<!-- /ledger -->\n"
            "b\n<!-- bench -->\n| measured | value | goal |\n|---|---|---|\n<!-- /bench -->\nc\n"
        )


def test_a_readme_without_marks_is_left_alone(tmp_path: Path) -> None:
    readme = tmp_path / "README.md"
    readme.write_text("<!-- ledger -->\n<!-- /ledger -->\n")
    with pytest.raises(ValueError, match="no <!-- bench -->"):
        update_readme_tables(readme, ROOT / "figures", tmp_path)
    assert readme.read_text() == "<!-- ledger -->\n<!-- /ledger -->\n"
