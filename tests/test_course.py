"""The notebooks as a course: length, plain English, small cells, links to the glossary, an appendix for the tests."""

from __future__ import annotations

import doctest
import re
import statistics
import symtable
import tomllib
from collections.abc import Iterator

import nbformat
import numpy as np
import pytest

from stereolib.base import ROOT

#: Chapters that are held to all of this.
CHAPTERS: list[str] = [
    "00_two_pictures",
    "01_calibration",
    "02_rectification",
    "03_sgbm_parameters",
    "04_dilation",
    "05_lrf",
    "06_height",
    "07_pixel_cm",
    "08_environment_map",
    "09_real_recordings",
    "10_matching_beyond",
    "11_your_own_rig",
]
GLOSSARY = ROOT / "notebooks" / "glossary.md"
APPENDIX = "## Appendix"
MOST_WORDS, MOST_LINES = 1800, 5
GRADES = (5.0, 10.5)  # of a reader at school; below it sentences are telegrams
WIDE, MOST_WIDE = 6, 1  # columns, and tables of the whole book with more

TERMS = re.findall(r'<a id="([\w-]+)"></a>', GLOSSARY.read_text(encoding="utf-8"))
each_chapter = pytest.mark.parametrize("chapter", CHAPTERS)


def cells(chapter: str, *, appendix: bool = False) -> list[nbformat.NotebookNode]:
    """The cells of a chapter before its appendix, or those of the appendix."""
    found = nbformat.read(ROOT / "notebooks" / f"{chapter}.ipynb", as_version=4).cells
    begins = [k for k, cell in enumerate(found) if cell.cell_type == "markdown" and cell.source.startswith(APPENDIX)]
    at = begins[0] if begins else len(found)
    return found[at:] if appendix else found[:at]


def prose(chapter: str) -> str:
    """The text of a chapter without headings, tables, code, formulas and folded solutions."""
    text = "\n\n".join(cell.source for cell in cells(chapter) if cell.cell_type == "markdown")
    text = re.sub(r"```.*?```|\$\$.*?\$\$|<details>.*?</details>", " ", text, flags=re.DOTALL)
    text = re.sub(r"<[^>]+>|^#.*$|^\|.*$", " ", text, flags=re.MULTILINE)
    return re.sub(r"\[([^\]]+)\]\([^)]*\)", r"\1", text)


def grade(text: str) -> float:
    """Years at school by Flesch and Kincaid: words a sentence and syllables a word."""
    plain = re.sub(r"`[^`]*`|\$[^$]*\$", "x", text)
    sentences = [s for s in re.split(r"[.!?:]+(?:\s|$)|\n\s*(?:[*\d-]|\n)", plain) if len(s.split()) > 2]
    words = [w for s in sentences for w in re.findall(r"[A-Za-z][A-Za-z'-]*", s)]
    syllables = sum(max(1, len(re.findall(r"[aeiouy]+", re.sub(r"(?:e|es|ed)$", "", w.lower())))) for w in words)
    return 0.39 * len(words) / len(sentences) + 11.8 * syllables / len(words) - 15.59


def test_grade_knows_plain_from_heavy() -> None:
    assert grade("The cat sat on the mat. It was warm there.") < 3
    heavy = "Notwithstanding considerable methodological heterogeneity, reproducibility characteristically necessitates"
    assert grade(f"{heavy} comprehensive documentation of computational environments.") > 20


@each_chapter
def test_chapter_is_short_and_plain(chapter: str) -> None:
    text = prose(chapter)
    assert len(text.split()) <= MOST_WORDS
    assert GRADES[0] <= grade(text) <= GRADES[1]


@each_chapter
def test_cells_are_small(chapter: str) -> None:
    sizes = [
        sum(bool(line.strip()) for line in cell.source.splitlines())
        for cell in cells(chapter)
        if cell.cell_type == "code" and "parameters" not in cell.metadata.get("tags", [])
    ]
    assert statistics.median(sizes) <= MOST_LINES


@each_chapter
def test_a_guess_is_asked_for(chapter: str) -> None:
    assert any("**Guess" in cell.source for cell in cells(chapter) if cell.cell_type == "markdown")


@each_chapter
def test_what_only_tests_need_is_folded(chapter: str) -> None:
    code = [cell for cell in cells(chapter, appendix=True) if cell.cell_type == "code"]
    assert all({"hide-input", "hide-cell"} & set(cell.metadata.get("tags", [])) for cell in code)
    assert not [cell.source for cell in cells(chapter) if "record_rows(" in cell.source]


@each_chapter
def test_pictures_have_a_text(chapter: str) -> None:
    for cell in cells(chapter):
        for output in cell.get("outputs", []):
            if "image/png" in output.get("data", {}):
                assert len(output.metadata.get("image/png", {}).get("alt", "")) > 40, cell.source


def test_each_text_of_a_picture_has_its_picture() -> None:
    code = "\n".join(
        cell.source for chapter in CHAPTERS for folded in (False, True) for cell in cells(chapter, appendix=folded)
    )
    texts = tomllib.loads((ROOT / "stereolib" / "plotting" / "alt_texts.toml").read_text(encoding="utf-8"))
    assert sorted(re.findall(r'(?:save|show)_figure\("(\w+)"', code)) == sorted(texts)


@each_chapter
def test_terms_lead_to_the_glossary(chapter: str) -> None:
    linked = set(re.findall(r"\(glossary\.md#([\w-]+)\)", "".join(cell.source for cell in cells(chapter))))
    assert linked, chapter
    assert linked <= set(TERMS)


def test_wide_tables_are_rare() -> None:
    wide = []
    for chapter in CHAPTERS:
        for cell in cells(chapter):
            rows = [line for line in cell.source.splitlines() if line.startswith("|")] * (cell.cell_type == "markdown")
            wide += [chapter for row in rows[:1] if row.count("|") - 1 > WIDE]
            for output in cell.get("outputs", []):
                table = "".join(output.get("data", {}).get("text/html", ""))
                wide += [chapter] * (table.partition("</thead>")[0].count("<th") > WIDE)
                first = output.get("text", "").splitlines()[:1]
                wide += [chapter for line in first if len(re.split(r"\s{2,}", line.strip())) > WIDE]
    assert len(wide) <= MOST_WIDE, wide


def test_glossary_explains_thirty_terms_by_code_that_runs() -> None:
    assert len(TERMS) == len(set(TERMS)) >= 30
    parts = re.split(r'<a id="[\w-]+"></a>', GLOSSARY.read_text(encoding="utf-8"))[1:]
    assert all(">>>" in part or "![" in part for part in parts)
    assert doctest.testfile(str(GLOSSARY), module_relative=False, globs={"np": np}).failed == 0


@pytest.mark.skipif(not CHAPTERS, reason="no chapter is held to it yet")
def test_every_term_is_used() -> None:
    text = "".join(cell.source for chapter in CHAPTERS for cell in cells(chapter))
    unused = [term for term in TERMS if f"(glossary.md#{term})" not in text]
    assert len(CHAPTERS) < 9 or not unused


def bound_and_read(source: str) -> tuple[set[str], set[str]]:
    """Names that a cell binds, and those of other cells that it reads, also within functions."""

    def scopes(table: symtable.SymbolTable) -> Iterator[symtable.SymbolTable]:
        yield table
        for inner in table.get_children():
            yield from scopes(inner)

    cell = symtable.symtable(source, "cell", "exec")
    bound = {symbol.get_name() for symbol in cell.get_symbols() if symbol.is_assigned() or symbol.is_imported()}
    read = {s.get_name() for t in scopes(cell) for s in t.get_symbols() if s.is_referenced() and s.is_global()}
    return bound, read - bound


def test_a_name_of_another_cell_is_told_from_the_own() -> None:
    assert bound_and_read("a = [b for b in c]\ndef f(d):\n    return d + e + a") == ({"a", "f"}, {"c", "e"})


@each_chapter
def test_any_cell_can_be_run_again(chapter: str) -> None:
    """A reader turns a knob and runs a cell again: what it reads means the same as before, whatever ran since.

    A drawing that takes several cells is run as all of them.
    """
    code = [c for part in (False, True) for c in cells(chapter, appendix=part) if c.cell_type == "code"]
    names = [bound_and_read(cell.source) for cell in code]
    again = [
        f"{name}, which the cell that begins with {cell.source.splitlines()[0]!r} reads"
        for k, (cell, (_, read)) in enumerate(zip(code, names, strict=True))
        for name in sorted(read - {"fig", "ax", "axis"})
        if any(name in bound for bound, _ in names[:k]) and any(name in bound for bound, _ in names[k + 1 :])
    ]
    assert not again
