"""The README's tables are what the ledger and the benchmarks say."""

from __future__ import annotations

from pathlib import Path

import pytest

from stereolib import paper
from stereolib.base import ROOT
from stereolib.reproduction import readme_tables, update_readme_tables


def test_the_readme_quotes_the_ledger_and_the_benchmarks_as_they_are() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    rows = paper.recorded_rows(ROOT / "figures")
    assert readme_tables.ledger_table(rows) in text
    assert readme_tables.ledger_summary(rows) in text
    assert readme_tables.bench_table(ROOT / "benchmarks" / "results") in text


def test_tables_are_written_between_their_marks(tmp_path: Path) -> None:
    readme = tmp_path / "README.md"
    start = "<!-- counts -->\n<!-- /counts -->\na\n<!-- ledger -->\nold\n<!-- /ledger -->\n"
    readme.write_text(f"{start}b\n<!-- bench -->\n<!-- /bench -->\nc\n")
    rows = paper.recorded_rows(ROOT / "figures")
    counts, ledger = readme_tables.ledger_summary(rows), readme_tables.ledger_table(rows)
    for _ in range(2):  # the second time nothing changes
        update_readme_tables(readme, ROOT / "figures", tmp_path)
        assert readme.read_text() == (
            f"<!-- counts -->\n{counts}\n<!-- /counts -->\na\n<!-- ledger -->\n{ledger}\n<!-- /ledger -->\n"
            "b\n<!-- bench -->\n| measured | value | goal |\n|---|---|---|\n<!-- /bench -->\nc\n"
        )


def test_a_readme_without_marks_is_left_alone(tmp_path: Path) -> None:
    readme = tmp_path / "README.md"
    marks = "".join(f"<!-- {mark} -->\n<!-- /{mark} -->\n" for mark in ("counts", "ledger"))
    readme.write_text(marks)
    with pytest.raises(ValueError, match="no <!-- bench -->"):
        update_readme_tables(readme, ROOT / "figures", tmp_path)
    assert readme.read_text() == marks


def test_the_summary_counts_what_could_have_failed() -> None:
    """Six rows, of which three could have failed: one did, one holds in part."""
    rows = paper.compare_with_paper(
        {
            "claim.glare_on_object": {"times": 1.0},
            "claim.dilation_is_cheap": {"share": 0.0, "bad_times": 9.0},
            "height.plane": 30.0,
            "table1.left.fx": 729.9,
            "scale.width_cm": 50.0,
            "fig.1": None,
        },
        tolerances={"height.plane": 0.1, "table1.left.fx": 0.55},
    )
    text = readme_tables.ledger_summary(rows)
    assert "**Of 6 rows, 3 could have failed**" in text
    assert "**1 of them did** (`claim.glare_on_object`), 1 hold in part (`claim.dilation_is_cheap`)" in text
    assert "In 1 others the paper contradicts itself (`scale.width_cm`)" in text
    assert "| does not hold (1), " not in text
    assert "meets the truth (1), holds in part (1), does not hold (1) |" in text
