"""The report shows everything or says what is missing."""

from __future__ import annotations

import base64
import csv
import re

import numpy as np
import pytest

from stereolib import paper
from stereolib.base import datasets
from stereolib.paper import ledger, printed_values, published
from stereolib.reproduction import report

PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)


def answer(item):
    """A fair answer for any item."""
    if item.comparability in printed_values.NUMERIC:
        return np.array(item.value, float)
    return "yes: 1 < 2 & so on" if item.comparability == "qualitative" else None


@pytest.fixture
def figures(tmp_path):
    """A figures folder with a row for each published item and nine pictures, all different."""
    for notebook in {item.notebook for item in published().values()}:
        mine = {item.id: answer(item) for item in published().values() if item.notebook == notebook}
        paper.record_rows(paper.compare_with_paper(mine), notebook, tmp_path)
    for n in range(1, 10):
        (tmp_path / f"fig0{n}.png").write_bytes(PIXEL + bytes([n]))
    return tmp_path


def test_ledger_holds_every_item_once_in_order(figures):
    report.build_report(figures)
    with (figures / "ledger.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["id"] for row in rows] == list(published())
    assert all(row["verdict"] and row["reason"] and row["notebook"] for row in rows)


def test_page_embeds_each_picture_beside_its_rows(figures):
    page = report.build_report(figures).read_text(encoding="utf-8")
    sections = re.findall(r'<section id="(\w+)">(.*?)</section>', page, re.S)
    assert [name for name, _ in sections] == [*(f"fig0{n}" for n in range(1, 10)), "table", "text"]
    for name, body in sections[:-2]:
        (data,) = re.findall(r'src="data:image/png;base64,([^"]+)"', body)
        assert base64.b64decode(data) == (figures / f"{name}.png").read_bytes()
        ids = re.findall(r"<code>([^<]+)</code>", body)
        assert ids[0] == f"fig.{name[-1]}"
        assert set(ids) == {item.id for item in published().values() if item.figure == name}
    assert {"table1.left.fx", "stereo.F"} < set(re.findall(r"<code>([^<]+)</code>", sections[-2][1]))
    shown = re.findall(r"<code>([^<]+)</code>", page)
    assert sorted(shown) == sorted(published())


def test_page_works_offline_and_escapes(figures):
    page = report.build_report(figures).read_text(encoding="utf-8")
    assert not re.search(r"https?:|<script|<link|url\(", page)
    assert "1 &lt; 2 &amp; so on" in page
    assert "1 < 2" not in page


def test_counts_add_up(figures):
    page = report.build_report(figures).read_text(encoding="utf-8")
    counts = re.findall(r"<li><b[^>]*>(\d+)</b>([^<]+)</li>", page)
    kinds = [item.comparability for item in published().values()]
    assert {verdict: int(n) for n, verdict in counts} == {
        "reproduced": kinds.count("exact") + kinds.count("same-method"),
        "agrees": kinds.count("qualitative"),
        "paper contradicts itself": kinds.count("internally-inconsistent"),
        "not comparable": kinds.count("not-reproducible"),
    }


def test_build_is_repeatable(figures):
    first = [report.build_report(figures).read_bytes(), (figures / "ledger.csv").read_bytes()]
    assert first == [report.build_report(figures).read_bytes(), (figures / "ledger.csv").read_bytes()]


def test_gaps_are_named_and_nothing_is_written(figures):
    (figures / "fig03.png").unlink()
    (figures / "tables" / "ledger_04_dilation.csv").unlink()
    with pytest.raises(ValueError, match=r"claim\.dilation_removes_noise \(04_dilation\).*fig03\.png"):
        report.build_report(figures)
    assert not (figures / "report.html").exists()
    assert not (figures / "ledger.csv").exists()


def test_every_verdict_has_its_colour():
    assert {*ledger._CLAIM.values(), "reproduced", "differs", "paper contradicts itself", "not comparable"} == set(
        report.VERDICTS
    )


def test_the_committed_report_is_what_the_committed_tables_make(tmp_path):
    """Byte by byte: also the entities and the line breaks."""
    committed = datasets.ROOT / "figures"
    (tmp_path / "tables").mkdir()
    for path in [*committed.glob("fig0*.png"), *committed.glob("tables/ledger_*.csv")]:
        (tmp_path / path.relative_to(committed)).write_bytes(path.read_bytes())
    report.build_report(tmp_path)
    for name in ("report.html", "ledger.csv"):
        assert (tmp_path / name).read_bytes() == (committed / name).read_bytes()
