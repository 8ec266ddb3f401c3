"""The report shows everything or says what is missing."""

from __future__ import annotations

import base64
import csv
import html
import io
import re
import shutil
from dataclasses import replace

import nbformat
import numpy as np
import pandas as pd
import pytest
from PIL import Image, PngImagePlugin

from stereolib import paper
from stereolib.base import datasets
from stereolib.paper import ledger, published
from stereolib.reproduction import chapters, embedded, report

TITLES = {"03_sgbm_parameters": "03 · The matcher", "04_dilation": "04 · Dilation"}
DRAWN = {"03_sgbm_parameters": ["fig04", "fig04_blocks"], "04_dilation": ["fig04_dilation"]}
TOLD = "Three small arrays: the hole is filled & the object is larger."


def write_picture(path, told=""):
    """A small PNG, different for each name."""
    about = PngImagePlugin.PngInfo()
    if told:
        about.add_itxt("Description", told)
    shade = sum(path.stem.encode()) % 256
    Image.new("RGB", (30, 20), (shade, 90, 200)).save(path, pnginfo=about)


def answer(item):
    """A fair answer for any item; those of the claims hold."""
    if item.numeric:
        return np.array(item.value, float)
    if not item.conditions:
        return "1 < 2 & so on"
    return {name: c.most if c.least is None else c.least for name, c in item.conditions.items()}


def write_notebook(folder, stem, drawn):
    """A notebook that asks a question and draws figures."""
    markdown = f"# {TITLES.get(stem, stem)}\n\n**The question:** what does [{stem}](x.ipynb) *ask*?\n"
    code = "\n".join(f'save_figure("{name}", fig)' for name in drawn)
    cells = [nbformat.v4.new_markdown_cell(markdown, id="a"), nbformat.v4.new_code_cell(code, id="b")]
    nbformat.write(nbformat.v4.new_notebook(cells=cells), folder / f"{stem}.ipynb")


@pytest.fixture
def figures(tmp_path):
    """A figures folder with a row for each published item and eleven pictures, beside the notebooks that draw them."""
    folder, notebooks = tmp_path / "figures", tmp_path / "notebooks"
    notebooks.mkdir()
    for notebook in {item.notebook for item in published().values()}:
        mine = {item.id: answer(item) for item in published().values() if item.notebook == notebook}
        loose = {id: 0.1 for id in mine if published()[id].atol == "computed"}
        paper.record_rows(paper.compare_with_paper(mine, tolerances=loose), notebook, folder)
        own = {item.figure: None for item in published().values() if item.figure and item.notebook == notebook}
        write_notebook(notebooks, notebook, DRAWN.get(notebook, own))
    for name in [*(f"fig0{n}" for n in range(1, 10)), "fig04_blocks", "fig04_dilation"]:
        write_picture(folder / f"{name}.png", TOLD if name == "fig04_dilation" else "")
    committed = datasets.ROOT / "figures" / "tables"  # of which the finding is made
    for path in [*committed.glob("recipe_*.csv"), committed / "height_recordings.csv"]:
        shutil.copy(path, folder / "tables")
    return folder


def build(figures):
    """The report of that folder, as text."""
    return report.build_report(figures, figures.parent / "notebooks").read_text(encoding="utf-8")


def sections_of(page):
    """The chapters' parts of the page."""
    return dict(re.findall(r'<section id="(\w+)">(.*?)</section>', page.split("<nav>")[1], re.S))


def plain(code):
    """An id without the marks of where it may break."""
    return code.replace("<wbr>", "")


def test_ledger_holds_every_item_once_in_order(figures):
    build(figures)
    with (figures / "ledger.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["id"] for row in rows] == list(published())
    assert all(row["verdict"] and row["reason"] and row["notebook"] for row in rows)


def test_rows_stand_with_the_question_that_they_answer(figures):
    sections = sections_of(build(figures))
    assert list(sections) == sorted({item.notebook for item in published().values()})
    for name, body in sections.items():
        assert f"What does {name} ask?" in body
        ids = re.findall(r'<tr id="([^"]+)">', body)
        assert ids == [item.id for item in published().values() if item.notebook == name]
        assert sorted(map(plain, re.findall(r"<code>([^<]+(?:<wbr>[^<]*)*)</code>", body))) == sorted(
            [*ids, *(f"{figure}.png" for figure in re.findall(r'<figure id="(\w+)">', body))]
        )
    assert "04 · Dilation" in sections["04_dilation"]


def test_every_figure_is_embedded_where_it_is_drawn(figures):
    page = build(figures)
    places = {
        figure: name for name, body in sections_of(page).items() for figure in re.findall(r'<figure id="(\w+)">', body)
    }
    assert places["fig04"] == places["fig04_blocks"] == "03_sgbm_parameters"
    assert places["fig04_dilation"] == "04_dilation"
    assert set(places) == {path.stem for path in figures.glob("*.png")}
    for figure, (kind, data) in {
        name: re.search(rf'<figure id="{name}">.*?src="data:image/(\w+);base64,([^"]+)"', page, re.S).groups()
        for name in places
    }.items():
        with Image.open(io.BytesIO(base64.b64decode(data))) as shown, Image.open(figures / f"{figure}.png") as drawn:
            assert shown.format.lower() == kind and shown.size == drawn.size
            assert np.abs(np.subtract(shown.convert("RGB"), drawn.convert("RGB"), dtype=int)).max() < 12


def test_every_figure_has_a_text(figures):
    page = build(figures)
    alts = dict(re.findall(r'<figure id="(\w+)">.*?<img alt="([^"]+)"', page, re.S))
    assert alts["fig04_dilation"] == html.escape(TOLD)
    assert alts["fig07"] == "Figure 7 of the paper, as we draw it"
    assert alts["fig04_blocks"] == "fig04_blocks, drawn by its notebook"


def test_names_lead_to_figure_and_notebook(figures):
    page = build(figures)
    places = set(re.findall(r'id="([^"]+)"', page))
    assert set(re.findall(r'href="#([^"]+)"', page)) <= places
    for target in set(re.findall(r'href="(\.\./[^"]+)"', page)):
        assert (figures / target).is_file(), target
    row = re.search(r'<tr id="height\.cube">.*?</tr>', page, re.S)[0]
    assert 'href="#fig08"' in row and 'href="../notebooks/06_height.ipynb"' in row


def test_ids_break_between_their_words_only(figures):
    page = build(figures)
    assert "<code>claim.<wbr>dilation_<wbr>removes_<wbr>noise</code>" in page
    assert "break-all" not in page and "anywhere" not in page


def test_page_begins_with_the_finding_in_one_picture_and_three_sentences(figures):
    page = build(figures)
    (first,) = re.findall(r'<h1>.*?</h1>\n<section id="finding">(.*?)</section>', page, re.S)
    said = re.search(r'<p class="first">(.*?)</p>', first, re.S)[1]
    assert len(re.findall(r"\.(?:\s|$)", said)) == 3
    assert first.count("<img ") == 1 and page.index('id="finding"') < page.index('id="first"')


def test_page_fits_a_telephone_and_paper(figures):
    page = build(figures)
    assert 'name="viewport"' in page
    narrow, printed = page.split("@media (max-width: 640px) {")[1].split("@media print {")
    assert "display: block" in narrow and "overflow-x: auto" in narrow and "break-inside: avoid" in printed
    assert "<details" not in page  # what is folded is not printed
    for row in re.findall(r'<tr id="[^"]+">.*?</tr>', page, re.S):
        assert 'data-is="printed"' in row and 'data-is="ours"' in row


def test_large_figures_are_embedded_smaller(tmp_path):
    noise = np.random.default_rng(0).integers(0, 255, (200, 1600, 3), dtype=np.uint8)
    Image.fromarray(noise).save(tmp_path / "noise.png")
    one = embedded.embed(tmp_path / "noise.png")
    assert (one.width, one.height, one.alt) == (900, 112, "")
    assert one.address.startswith("data:image/webp;base64,")
    assert len(one.address) < (tmp_path / "noise.png").stat().st_size / 4


def test_chapters_are_read_from_their_notebooks(figures):
    read = {one.stem: one for one in chapters.read_chapters(figures.parent / "notebooks")}
    assert read["03_sgbm_parameters"].figures == ("fig04", "fig04_blocks")
    assert read["04_dilation"].title == "04 · Dilation"
    assert read["04_dilation"].question == "What does 04_dilation ask?"


def test_page_works_offline_and_escapes(figures):
    page = build(figures)
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


def test_what_could_have_failed_and_did_comes_before_all_rows(figures):
    bad = {
        "claim__glare_on_object": "does not hold",
        "height__plane": "misses the truth",
        "claim__rectification_needed": "holds in part",
    }
    spoil(figures, **bad, table1__left__fx="not recovered", scale__width_cm="paper contradicts itself")
    page = build(figures)
    (first,) = re.findall(r'<section id="first">(.*?)</section>', page, re.S)
    assert page.index(first) < page.index("<nav>")
    tests = sum(item.kind == "test" for item in published().values())
    assert f"Of {len(published())} rows, {tests} could have failed" in first
    assert "<b>2 of them did</b>, of 2 causes;\n1 hold in part; " in first
    listed, rest = first.split("<p>The other ")
    held = [link for link in re.findall(r'href="#([^"]+)"', listed) if not link.startswith("fig")]
    assert held == ["claim.glare_on_object", "height.plane", "claim.rectification_needed"]
    assert re.findall(r'href="#([^"]+)"', rest) == ["scale.width_cm", "table1.left.fx"]
    assert rest.startswith(f"{len(published()) - tests} rows")


def test_failures_of_one_cause_are_counted_as_one(monkeypatch):
    every = {id: replace(item, cause="") for id, item in published().items()}
    every |= {id: replace(every[id], cause="one cause") for id in ("height.recipe", "fig.7")}
    monkeypatch.setattr(report, "published", lambda: every)
    rows = [{"id": id} for id in ("height.recipe", "fig.4", "fig.7")]
    assert report.by_cause(rows) == {"one cause": [rows[0], rows[2]], "fig.4": [rows[1]]}


def test_counts_add_up(figures):
    page = build(figures)
    counts = re.findall(r"<tr><td>([a-z ]+)</td><td>[^<]+</td><td>(.*?)</td></tr>", page)
    shown = {kind: sum(map(int, re.findall(r">(\d+)</b>", cell))) for kind, cell in counts}
    kinds = [item.kind for item in published().values()]
    assert shown == {kind: kinds.count(kind) for kind in paper.KINDS}


def test_build_is_repeatable(figures):
    first = [build(figures), (figures / "ledger.csv").read_bytes()]
    assert first == [build(figures), (figures / "ledger.csv").read_bytes()]


def test_gaps_are_named_and_nothing_is_written(figures):
    for name in ("fig03", "fig04_blocks"):
        (figures / f"{name}.png").unlink()
    (figures / "tables" / "ledger_04_dilation.csv").unlink()
    with pytest.raises(
        ValueError, match=r"claim\.dilation_removes_noise \(04_dilation\).*fig03\.png.*fig04_blocks\.png"
    ):
        build(figures)
    assert not (figures / "report.html").exists()
    assert not (figures / "ledger.csv").exists()


def test_every_verdict_has_its_colour():
    words = {word for three in ledger._VERDICTS.values() for word in three}
    assert {*words, "redrawn", "not comparable", "not attempted"} == set(report.VERDICTS)
    assert sorted(verdict for some in report.WORDS for verdict in some) == sorted(report.VERDICTS)


def test_every_committed_figure_stands_in_the_report():
    drawn = {name for one in chapters.read_chapters(datasets.ROOT / "notebooks") for name in one.figures}
    assert drawn == {path.stem for path in (datasets.ROOT / "figures").glob("*.png")}


def test_the_committed_report_is_what_the_committed_tables_make(tmp_path):
    """Byte by byte: also the entities and the line breaks."""
    committed = datasets.ROOT / "figures"
    (tmp_path / "tables").mkdir()
    for path in [*committed.glob("*.png"), *committed.glob("tables/*.csv")]:
        (tmp_path / path.relative_to(committed)).write_bytes(path.read_bytes())
    report.build_report(tmp_path)
    for name in ("report.html", "ledger.csv"):
        assert (tmp_path / name).read_bytes() == (committed / name).read_bytes()
    assert (committed / "report.html").stat().st_size <= 4e6
