"""The report shows everything or says what is missing."""

from __future__ import annotations

import base64
import csv
import re
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from stereolib import paper
from stereolib.base import datasets
from stereolib.paper import ledger, published
from stereolib.reproduction import report

PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)


def answer(item):
    """A fair answer for any item; those of the claims hold."""
    if item.numeric:
        return np.array(item.value, float)
    if not item.conditions:
        return "1 < 2 & so on"
    return {name: c.most if c.least is None else c.least for name, c in item.conditions.items()}


@pytest.fixture
def figures(tmp_path):
    """A figures folder with a row for each published item and nine pictures, all different."""
    for notebook in {item.notebook for item in published().values()}:
        mine = {item.id: answer(item) for item in published().values() if item.notebook == notebook}
        loose = {id: 0.1 for id in mine if published()[id].atol == "computed"}
        paper.record_rows(paper.compare_with_paper(mine, tolerances=loose), notebook, tmp_path)
    for n in range(1, 10):
        (tmp_path / f"fig0{n}.png").write_bytes(PIXEL + bytes([n]))
    committed = datasets.ROOT / "figures" / "tables"  # of which the finding is made
    for path in [*committed.glob("recipe_*.csv"), committed / "height_recordings.csv"]:
        shutil.copy(path, tmp_path / "tables")
    return tmp_path


def test_ledger_holds_every_item_once_in_order(figures):
    report.build_report(figures)
    with (figures / "ledger.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["id"] for row in rows] == list(published())
    assert all(row["verdict"] and row["reason"] and row["notebook"] for row in rows)


def test_page_embeds_each_picture_beside_its_rows(figures):
    page = report.build_report(figures).read_text(encoding="utf-8")
    sections = re.findall(r'<section id="(\w+)">(.*?)</section>', page.split("<nav>")[1], re.S)
    assert [name for name, _ in sections] == [*(f"fig0{n}" for n in range(1, 10)), "table", "text"]
    for name, body in sections[:-2]:
        (data,) = re.findall(r'src="data:image/png;base64,([^"]+)"', body)
        assert base64.b64decode(data) == (figures / f"{name}.png").read_bytes()
        ids = re.findall(r"<code>([^<]+)</code>", body)
        assert ids[0] == f"fig.{name[-1]}"
        assert set(ids) == {item.id for item in published().values() if item.figure == name}
    assert {"table1.left.fx", "stereo.F"} < set(re.findall(r"<code>([^<]+)</code>", sections[-2][1]))
    shown = re.findall(r"<code>([^<]+)</code>", page.split("<nav>")[1])
    assert sorted(shown) == sorted(published())


def test_page_works_offline_and_escapes(figures):
    page = report.build_report(figures).read_text(encoding="utf-8")
    assert not re.search(r"https?:|<script|<link|url\(", page)
    assert "1 &lt; 2 &amp; so on" in page
    assert "1 < 2" not in page


def spoil(figures, **verdicts):
    """Give rows of the recorded tables another verdict, by id with __ for the point."""
    for path in figures.glob("tables/ledger_*.csv"):
        rows = pd.read_csv(path, dtype=str, keep_default_na=False)
        for id, verdict in verdicts.items():
            rows.loc[rows["id"] == id.replace("__", "."), "verdict"] = verdict
        path.write_text(rows.to_csv(index=False, lineterminator="\n"), encoding="utf-8")


def test_the_page_begins_with_what_could_have_failed_and_did(figures):
    bad = {"claim__glare_on_object": "does not hold", "height__plane": "misses the truth", "eq__depth": "holds in part"}
    spoil(figures, **bad, table1__left__fx="not recovered", scale__width_cm="paper contradicts itself")
    page = report.build_report(figures).read_text(encoding="utf-8")
    (first,) = re.findall(r'<section id="first">(.*?)</section>', page, re.S)
    assert page.index(first) < page.index("<nav>")
    tests = sum(item.kind == "test" for item in published().values())
    assert f"Of {len(published())} rows, {tests} could have failed" in first
    assert "<b>2 of them did</b>, of 2 causes;\n1 hold in part; " in first
    listed, rest = first.split("<p>The other ")
    assert re.findall(r'href="#([^"]+)"', listed) == ["claim.glare_on_object", "height.plane", "eq.depth"]
    assert re.findall(r'href="#([^"]+)"', rest) == ["scale.width_cm", "table1.left.fx"]
    assert rest.startswith(f"{len(published()) - tests} rows")


def test_failures_of_one_cause_are_counted_as_one(monkeypatch):
    every = {id: replace(item, cause="") for id, item in published().items()}
    every |= {id: replace(every[id], cause="one cause") for id in ("height.recipe", "fig.7")}
    monkeypatch.setattr(report, "published", lambda: every)
    rows = [{"id": id} for id in ("height.recipe", "fig.4", "fig.7")]
    assert report.by_cause(rows) == {"one cause": [rows[0], rows[2]], "fig.4": [rows[1]]}


def test_counts_add_up(figures):
    page = report.build_report(figures).read_text(encoding="utf-8")
    counts = re.findall(r"<tr><td>([a-z ]+)</td><td>[^<]+</td><td>(.*?)</td></tr>", page)
    shown = {kind: sum(map(int, re.findall(r">(\d+)</b>", cell))) for kind, cell in counts}
    kinds = [item.kind for item in published().values()]
    assert shown == {kind: kinds.count(kind) for kind in paper.KINDS}


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
    words = {word for three in ledger._VERDICTS.values() for word in three}
    assert {*words, "redrawn", "not comparable", "not attempted"} == set(report.VERDICTS)


def test_the_committed_report_is_what_the_committed_tables_make(tmp_path):
    """Byte by byte: also the entities and the line breaks."""
    committed = datasets.ROOT / "figures"
    (tmp_path / "tables").mkdir()
    for path in [*committed.glob("fig0*.png"), *committed.glob("tables/*.csv")]:
        (tmp_path / path.relative_to(committed)).write_bytes(path.read_bytes())
    report.build_report(tmp_path)
    for name in ("report.html", "ledger.csv"):
        assert (tmp_path / name).read_bytes() == (committed / name).read_bytes()
