"""How the site is made: what Sphinx gets of a notebook, where links lead, and which broken ones are found."""

from __future__ import annotations

import base64
import io
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import build_site
import conf
import pytest
from docutils import nodes
from docutils.utils import new_document
from PIL import Image

GOOD = (
    '<a href="deep/b.html#place">b</a><a href="https://example.org">out</a><img src="data:,"><a href="#here" id="here">'
)


def a_png() -> str:
    stream = io.BytesIO()
    Image.new("RGB", (2000, 1000)).save(stream, format="png")
    return base64.b64encode(stream.getvalue()).decode()


def code(source: str, **more: Any) -> dict[str, Any]:
    return {"id": "x", "cell_type": "code", "metadata": {}, "source": source, "outputs": [], **more}


def site(folder: Path, page: str) -> list[str]:
    (folder / "deep").mkdir()
    (folder / "a.html").write_text(page)
    (folder / "deep" / "b.html").write_text('<h1 id="place">b</h1><a href="../a.html">a</a>')
    return list(build_site.broken_links(folder))


def test_links_and_places_that_are_there_are_right(tmp_path: Path) -> None:
    assert site(tmp_path, GOOD) == []


@pytest.mark.parametrize(
    ("page", "said"),
    [
        ('<a href="c.html">', "c.html leads nowhere"),
        ('<a href="deep/">', "deep/ leads nowhere"),
        ('<a href="../secret.html">', "../secret.html leads nowhere"),
        ('<a href="deep/b.html#elsewhere">', "deep/b.html#elsewhere has no such place"),
        ('<a href="#nowhere">', "#nowhere has no such place"),
        ('<a href="/deep/b.html">', "/deep/b.html is not in the site"),
        ('<script src="https://example.org/x.js">', "https://example.org/x.js is not in the site"),
        ('<link href="//example.org/x.css">', "//example.org/x.css is not in the site"),
        ('<img src="gone.png">', "gone.png leads nowhere"),
    ],
)
def test_what_is_broken_is_named_with_its_page(tmp_path: Path, page: str, said: str) -> None:
    (tmp_path.parent / "secret.html").write_text("outside")
    assert site(tmp_path, GOOD + page) == [f"a.html: {said}"]


def test_a_style_that_asks_elsewhere_is_named(tmp_path: Path) -> None:
    (tmp_path / "x.css").write_text('a { background: url("own.png") } @import "https://example.org/f.css";')
    assert site(tmp_path, GOOD) == ["x.css: https://example.org/f.css is not in the site"]


def test_figures_get_anchor_and_text_and_sliders_their_page() -> None:
    drawn = code('save_figure("fig08", fig)', outputs=[{"data": {"image/png": a_png()}}])
    folded = code("print(1)", metadata={"jupyter": {"outputs_hidden": True}})
    cells = [drawn, folded, code("explore(draw)"), code("explore(other)")]
    notebook = {"cells": cells.copy()}
    (figure,) = build_site.adapt(notebook, "notebooks/06_height")
    anchor, *_ = notebook["cells"]
    assert anchor["source"] == '<a id="fig08"></a>' and notebook["cells"][1] is drawn
    assert figure.name == "fig08" and drawn["metadata"]["mystnb"]["image"]["alt"] == figure.alt != ""
    assert folded["metadata"]["tags"] == ["hide-output"]
    linking = [n for n, cell in enumerate(notebook["cells"]) if "../sliders/06_height.html" in cell["source"]]
    assert [notebook["cells"][n - 1] for n in linking] == [cells[2]]


def test_a_notebook_that_was_not_executed_has_no_figure_yet() -> None:
    notebook = {"cells": [code('save_figure("fig08", fig)'), code("explore(draw)")]}
    assert build_site.adapt(notebook, "notebooks/exercises/06_height") == [] and len(notebook["cells"]) == 2


def test_a_thumbnail_is_small_and_keeps_its_shape(tmp_path: Path) -> None:
    build_site.thumbnail(base64.b64decode(a_png()), tmp_path / "thumbnails" / "x.webp")
    with Image.open(tmp_path / "thumbnails" / "x.webp") as small:
        assert small.size == (build_site.THUMBNAIL_PX, build_site.THUMBNAIL_PX // 2)


@pytest.mark.parametrize(
    ("page", "written_in", "link", "leads_to"),
    [
        ("notebooks/00_two_pictures", "notebooks/00_two_pictures.ipynb", "01_calibration.ipynb", "01_calibration.html"),
        ("notebooks/00_two_pictures", "notebooks/00_two_pictures.ipynb", "glossary.md#depth", "glossary.html#depth"),
        ("notebooks/a", "notebooks/a.ipynb", "../figures/report.html#fig01", "../figures/report.html#fig01"),
        ("docs/measure_box", "README.md", "notebooks/08_map.ipynb", "../notebooks/08_map.html"),  # what it includes
        ("index", "README.md", "figures/ledger.csv", "figures/ledger.csv"),
        ("index", "README.md", "https://example.org/a.md", "https://example.org/a.md"),
        ("index", "README.md", "#here", "#here"),
    ],
)
def test_links_of_the_repository_lead_to_pages(
    tmp_path: Path, page: str, written_in: str, link: str, leads_to: str
) -> None:
    tree, reference = new_document("page"), nodes.reference(refuri=link)
    reference.source = str(tmp_path / written_in)
    tree += reference
    app: Any = SimpleNamespace(srcdir=tmp_path, config=SimpleNamespace(source_suffix={".md": "", ".ipynb": ""}))
    conf.lead_to_pages(app, tree, page)
    assert reference["refuri"] == leads_to


def test_an_equation_becomes_mathml_and_a_wrong_one_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    writer = SimpleNamespace(body=[])
    for equation in (nodes.math("", r"Z = f B / d"), nodes.math_block("", r"\nonsense{d}")):
        with pytest.raises(nodes.SkipNode):
            conf.write_math(writer, equation)
    (written,) = writer.body
    assert written.startswith('<span class="math"><math xmlns="http://www.w3.org/1998/Math/MathML"')
    (said,) = caplog.records
    assert said.levelname == "WARNING" and "\\nonsense" in said.getMessage()
