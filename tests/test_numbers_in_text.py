"""Numbers in sentences are what the notebooks print, what the tables hold, or what their declaration computes.

Looked at is every numeral with a unit, above twelve or with a decimal point in the prose of README and CONTRIBUTING
and of every notebook; not code, formulas, links, headings, questions, names ("OpenCV 4", "notebook 06"), years, nor
what the README has generated (`update_readme_tables`), which has a test of its own. A numeral agrees with a source
that is the same when rounded to the text's digits, in the same unit (of a length mm, cm or m), and shares a word with
the sentence or was printed by one of the cells next to it (`numbers_in_text.is_sourced` has the rule). On the README
numerals without a unit are declared, in CONTRIBUTING all are. Of number words a list of patterns is looked at ("a
third of a millimetre", "about twice"); these are always declared, in `numbers_in_text/`.

What it cannot see: a wrong number that happens to be another one of its page's sources, unit and a word alike (the last
test counts how often that would happen); signs; what a number is said to be of; counts up to twelve; words that no
pattern has; outputs of a notebook that are themselves old, which `make reproduce` finds.
"""

from __future__ import annotations

import pytest
from support import numbers_in_text as texts

PAGES = ["README.md", "CONTRIBUTING.md", *(path.name for path in sorted((texts.ROOT / "notebooks").glob("*.ipynb")))]
DECLARED = texts.declarations()


@pytest.mark.parametrize("page", PAGES)
def test_every_number_has_a_source(page: str) -> None:
    found = texts.unsourced(page, texts.cells_of(page), DECLARED)
    assert not found, "\n".join(found)


@pytest.mark.parametrize("entry", DECLARED, ids=lambda entry: f"{entry['page']}: {entry['text'][:40]}")
def test_declared_numbers_are_what_is_computed(entry: dict[str, object]) -> None:
    assert texts.wrong(entry) == ""
    assert entry["page"] in PAGES and ("decided" in entry) != ("value" in entry)


# --- the mechanism itself


def said(text: str) -> list[tuple[str, str | None]]:
    return [(n.text, n.unit) for paragraph in texts.prose(text) for n in texts.claims(paragraph)]


def test_numbers_are_found_with_their_units() -> None:
    assert said("It is 0.70 m away, 3, 6 and 18 mm wide, 32 767 grey levels, 0.116 cm per pixel and 71 %.") == [
        ("0.70", "m"), ("3", "mm"), ("6", "mm"), ("18", "mm"), ("32 767", "grey levels"), ("0.116", "cm per pixel"),
        ("71", "%"),
    ]  # fmt: skip
    assert said("Of 23 pairs 8 x 9 fit; 1e-16 in, a third of a millimetre out, about twice as much.") == [
        ("23", None), ("1e-16", None), ("a third of a millimetre", None), ("about twice", None)
    ]  # fmt: skip


def test_what_is_no_sentence_is_not_looked_at() -> None:
    text = (
        "# 44 · A title\n\nSee `f(99)`, $x = 77$ and [notebook 06](06_height.ipynb), Fig. 14, OpenCV 14, bad-22, "
        "3D, 640x480 and the year 2014.\n\n```\n55 mm\n```\n\n15. A step\n\n    x = 66 mm\n"
        "<!-- bench -->88 %<!-- /bench -->"
    )
    assert said(text) == []


@pytest.mark.parametrize(
    ("text", "source", "agrees"),
    [
        ("37.7 cm", "377.4 mm", True),
        ("37.7 cm", "378 mm", False),
        ("200 boxes", "186 boxes", False),
        ("71 100 px", "71134 px", True),
        ("5 %", "5 mm", False),
        ("5 %", "5.4 %", True),
        ("5.0 %", "5.4 %", False),
    ],
)
def test_a_source_agrees_when_it_rounds_to_the_text(text: str, source: str, agrees: bool) -> None:
    (a,), (b,) = texts.numbers(text), texts.numbers(source)
    assert texts.agree(a, b) is agrees


def test_a_table_s_head_gives_the_unit() -> None:
    printed = " distance mm  lost %  first\n         500    11.6     99\n"
    assert [(n.text, n.unit) for n in texts.of_output(printed)] == [("500", "mm"), ("11.6", "%"), ("99", None)]


@pytest.mark.parametrize(
    "entry",
    [
        {"text": "reads 37.8 cm", "value": "37.7"},
        {"text": "all within a third of a millimetre", "value": "0.18", "between": [0.28, 0.38]},
        {"text": "{three} of 23 pairs", "value": "[2, 23]"},
        {"text": "three of 23 pairs", "value": "[3, 23]"},
    ],
)
def test_a_declaration_that_is_wrong_is_said(entry: dict[str, object]) -> None:
    assert texts.wrong(entry)


def test_a_declared_phrase_that_was_changed_is_missed() -> None:
    entry = {"page": "README.md", "text": "of 23 pairs", "value": "23"}
    assert texts.unsourced("README.md", [(0, "Seen are three of 23 pairs.")], [entry]) == []
    first, second = texts.unsourced("README.md", [(0, "Seen are three of 24 pairs.")], [entry])
    assert first.startswith("24") and second.startswith("declared, but not there")


#: Share of changed numbers that is found. All of those that are declared, some of those that find a source themselves.
FOUND = {
    "05_lrf.ipynb": 0.35,
    "README.md": 0.85,
    "CONTRIBUTING.md": 1.0,
    "00_two_pictures.ipynb": 0.9,
    "09_real_recordings.ipynb": 0.9,
}


@pytest.mark.parametrize("page", PAGES)
def test_a_number_that_is_changed_is_found(page: str) -> None:
    found = []
    for place, markdown in texts.cells_of(page):
        before = set(texts.unsourced(page, [(place, markdown)], DECLARED))
        for number, after in texts.changed(markdown):
            if not any(text.startswith(number) for text in before):
                found.append(bool(set(texts.unsourced(page, [(place, after)], DECLARED)) - before))
    assert sum(found) >= FOUND.get(page, 0.5) * len(found), f"{sum(found)} of {len(found)}"
