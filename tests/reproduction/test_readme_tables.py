"""The README's tables are what the ledger and the benchmarks say."""

from __future__ import annotations

from pathlib import Path

import pytest

from stereolib import paper
from stereolib.base import ROOT
from stereolib.reproduction import readme_tables, update_readme_tables


def test_the_readme_quotes_the_ledger_and_the_benchmarks_as_they_are() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for mark, block in readme_tables._blocks(ROOT / "figures", ROOT / "benchmarks" / "results").items():
        assert f"<!-- {mark} -->\n{block}\n<!-- /{mark} -->" in text


def test_blocks_are_written_between_their_marks(tmp_path: Path) -> None:
    readme, blocks = tmp_path / "README.md", readme_tables._blocks(ROOT / "figures", tmp_path)
    assert not blocks["bench"] and not blocks["rigs"]
    readme.write_text("".join(f"a {mark}\n<!-- {mark} -->old<!-- /{mark} -->\n" for mark in blocks))
    for _ in range(2):  # the second time nothing changes
        update_readme_tables(readme, ROOT / "figures", tmp_path)
        assert readme.read_text() == "".join(
            f"a {mark}\n<!-- {mark} -->\n{block}\n<!-- /{mark} -->\n" for mark, block in blocks.items()
        )


def test_a_readme_without_marks_is_left_alone(tmp_path: Path) -> None:
    readme = tmp_path / "README.md"
    marks = "".join(f"<!-- {mark} -->\n<!-- /{mark} -->\n" for mark in ("finding", "counts", "ledger"))
    readme.write_text(marks)
    with pytest.raises(ValueError, match="no <!-- bench -->"):
        update_readme_tables(readme, ROOT / "figures", tmp_path)
    assert readme.read_text() == marks


def test_the_summary_counts_what_could_have_failed() -> None:
    """Six rows, of which three could have failed: one did, one holds in part."""
    cheap = paper.published()["claim.dilation_is_cheap"].conditions
    rows = paper.compare_with_paper(
        {
            "claim.glare_on_object": {"points": 1.0},
            "claim.dilation_is_cheap": {name: 9.0 * (name == "darkest_points") for name in cheap},
            "height.cube": [30.0, 30.0],
            "setup.distance": 0.7,
            "scale.width_cm": 50.0,
            "fig.1": None,
        },
    )
    text = readme_tables.ledger_summary(rows)
    assert "**Of 6 rows, 3 could have failed**" in text
    assert (
        "**1 of them did, of 1 causes**: `claim.glare_on_object`. 1 hold in part, 1 hold (meets the truth (1))." in text
    )
    own = "In 1 of the 3 stereolib's method stands in the paper's place: 0 failed, 0 hold in part, 1 hold."
    assert f"{own} In 1 of the others the paper contradicts itself" in text
    assert "| does not hold (1), " not in text
    assert "meets the truth (1), holds in part (1), does not hold (1) |" in text
