"""Numbers in sentences: found in a page's prose, and held against the places that they can come from."""

from __future__ import annotations

import ast
import csv
import json
import math
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from stereolib.base import ROOT
from stereolib.matching import SGBMParams, compute_disparity, motorcycle_view, score

#: Unit as written -> its kind, and how many of the kind's own unit it is.
UNITS = {
    **dict.fromkeys(("mm", "millimetre", "millimetres"), ("mm", 1.0)),
    **dict.fromkeys(("cm", "centimetre", "centimetres"), ("mm", 10.0)),
    **dict.fromkeys(("m", "metre", "metres"), ("mm", 1000.0)),
    **dict.fromkeys(("cm/px", "cm per px", "cm per pixel"), ("cm/px", 1.0)),
    **dict.fromkeys(("mm/px", "mm per px", "mm per pixel"), ("cm/px", 0.1)),
    **dict.fromkeys(("px", "pixel", "pixels", "rows", "columns", "disparities"), ("px", 1.0)),
    **dict.fromkeys(("%", "per cent", "pct"), ("%", 1.0)),
    **dict.fromkeys(("°", "deg", "degree", "degrees"), ("degree", 1.0)),
    **dict.fromkeys(("s", "second", "seconds"), ("s", 1.0)),
    **dict.fromkeys(("minute", "minutes"), ("s", 60.0)),
    "ms": ("s", 0.001),
    "times": ("times", 1.0),
    "x": ("times", 1.0),
    **{unit: (unit, 1.0) for unit in ("MB", "MB/s", "Hz", "rpm", "grey levels")},
}
_UNIT = "|".join(sorted((re.escape(unit) for unit in UNITS if unit not in "%°"), key=len, reverse=True))
_AFTER = re.compile(rf"[ \n\u202f]?([%°])|[ \n\u202f](?:(?:{_UNIT})\b(?!\s*\d))", re.ASCII)
_NUMBER = re.compile(
    r"(?<![\w.^/])(?<![A-Za-z]-)(?:\d{1,3}(?:[ ,\u202f]\d{3})+(?!\d)|\d+(?:\.\d+)?(?:e[-+]?\d+)?)(?![\w^]|\.\d|-bit)"
)
_TO_THE_NEXT = re.compile(r"\s*(?:to|and|or|x|[-,–/±]|\+-)\s*(?:about |[-+±−]\s?)?(?=\d)")
DECLARED_ALONE = ("CONTRIBUTING.md",)  # a page of rules: every number on it is declared
NEAR = 2  # cells between a paragraph and the cell that prints its number
COUNTS = 12  # whole numbers up to here without a unit are plain counts and names: "two cameras", "3 knobs"
_COMMON = "the and for are was with that this from than its not one but more all less which them they these there their"
_COMMON += " where when what have about only both each other " + " ".join(UNITS)
_COMMON_STEMS = frozenset(word[:4] for word in _COMMON.split())
_LARGE = 1000  # from here on a text may leave its last zeros unmeasured: 71 100 for 71 134

#: What carries a number that measures nothing: code, formulas, addresses, headings, numerals of lists, names, years.
_NO_PROSE: tuple[tuple[re.Pattern[str], Any], ...] = (
    (re.compile(r"<!-- (counts|finding|ledger|bench|rigs) -->.*?<!-- /\1 -->", re.DOTALL), " "),
    (re.compile(r"```.*?```|\$\$.*?\$\$|\$[^$\n]*\$", re.DOTALL), " § "),
    (re.compile(r"`[^`]*`"), lambda code: "§" + re.sub(r"[^A-Za-z_]+", " ", code[0]).strip() + "§"),  # its words stay
    (re.compile(r"\*\*Exercise \d+\.\*\*.*?(?=<details>|\Z)", re.DOTALL), " "),  # a question sets its numbers
    (re.compile(r"^#+ .*$", re.MULTILINE), " "),
    (re.compile(r"^( {4,}\S.*\n?)+", re.MULTILINE), " "),
    (re.compile(r"\[\d\d(?: [^\]]*)?\](?=\([^)]*\.ipynb)"), "[]"),
    (re.compile(r"\]\([^)]*\)"), "]"),
    (re.compile(r"<[^>]+>"), " "),
    (re.compile(r"^\s*\d+\. ", re.MULTILINE), " "),
    (
        re.compile(
            r"\b(?:Figs?\.|[Ff]igures?|[Tt]ables?|[Ss]ections?|[Cc]onclusions?|[Ee]xercises?|[Ee]quations?|[Ll]ines?|"
            r"[Nn]otebooks?|[Ss]teps?|[Nn]umbers?|[Ff]loors?|OpenCV|Python|Middlebury|ICRA|version|bad|BSD)[ \n]"
            r"\d+(?:\.\d+)*(?:(?:,| to| and| or|-)\s*\d+)*\b"
        ),
        " § ",
    ),
    (re.compile(r"\b(?:19|20)\d\d\b(?! ?(?:px|mm|m|%)\b)"), " § "),
)
_PART = r"(?:half|third|quarter|fifth|tenth|hundredth|thousandth)s?"
_MANY = r"(?:two|three|four|five|six|seven|eight|nine|ten|twenty|a hundred)"
#: Words that stand for a measured number. They match no source by themselves: each is declared.
WORDS = re.compile(
    rf"\b(?:(?:an?|one|two|three|some|a few)\ {_PART}\ of\ an?\ (?:millimetre|centimetre|metre|pixel|degree|per\ cent)"
    r"|half\ an?\ (?:millimetre|centimetre|metre|pixel|degree|per\ cent|second)"
    rf"|(?:by|about|nearly|over|under|more\ than|less\ than|almost|only)\ (?:an?\ )?{_PART}\b"
    r"(?!\ of\ an?\b|\ (?:the|its|an?)\b)"
    rf"|an?\ {_PART}\ (?:too|more|less|larger|smaller|wider|taller|better|worse)"
    rf"|(?:about|more\ than|nearly|almost|over|less\ than|at\ least)\ (?:twice|{_MANY}(?:\ to\ {_MANY})?\ times|double)"
    rf"|{_MANY}(?:\ to\ {_MANY})?\ times\ (?:as|the|its|more|less|faster|slower|larger|smaller)"
    rf"|(?:one|{_MANY})\ in\ (?:{_MANY})|{_MANY}\ per\ cent|(?:about|nearly|almost)\ (?:doubles?|triples?))\b".replace(
        r"\ ", r"\s+"
    ),
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Number:
    """A number as it is written: its text, size without sign, digits after the point, unit; where it stands."""

    text: str
    value: float
    places: int
    unit: str | None
    start: int
    about: frozenset[str] = frozenset()

    @property
    def kind(self) -> str | None:
        return UNITS[self.unit][0] if self.unit else None


def numbers(text: str) -> list[Number]:
    """Every numeral of a text with the unit that follows; of "3, 6 and 18 mm" all three are in mm."""
    found: list[Number] = []
    matches = list(_NUMBER.finditer(text))
    for k in range(len(matches) - 1, -1, -1):
        match = matches[k]
        unit, following = unit_after(text, match.end()), matches[k + 1] if k + 1 < len(matches) else None
        joined = _TO_THE_NEXT.match(text, match.end())
        if unit is None and following and joined and joined.end() == following.start():
            unit = found[-1].unit
        plain = re.sub("[ ,\u202f]", "", match[0])
        places = len(plain.partition(".")[2]) if "e" not in plain else 12
        if places == 0 and float(plain) >= _LARGE:
            places = -(len(plain) - len(plain.rstrip("0")))
        found.append(Number(match[0], float(plain), places, unit, match.start()))
    return found[::-1]


def stems(text: str) -> frozenset[str]:
    """The beginnings of a text's longer words: what it is about."""
    words = re.findall(r"[a-z]{3,}", re.sub("([a-z])([A-Z])", r"\1 \2", text).lower())
    return frozenset(word[:4] for word in words) - _COMMON_STEMS


def about(found: Iterable[Number], text: str, unit: str | None = None) -> Iterator[Number]:
    """Say of numbers what they are about, and their unit where it is not written."""
    words = stems(text)
    for number in found:
        yield replace(number, about=words, unit=number.unit or (unit if unit in UNITS else None), start=-1)


def sentence(paragraph: str, start: int) -> str:
    """The sentence of a paragraph in which something stands."""
    ends = [match.end() for match in re.finditer(r"[.!?:;]\s", paragraph)]
    low, high = (max((e for e in ends if e <= start), default=0), min((e for e in ends if e > start), default=None))
    return paragraph[low:high]


def unit_after(text: str, end: int) -> str | None:
    match = _AFTER.match(text, end)
    return " ".join(match[0].split()) if match else None


def prose(markdown: str) -> list[str]:
    """The paragraphs and table cells of a page, without what is no sentence; one space between words."""
    paragraphs = []
    for part in re.split(r"\n\s*\n|\n(?=\s*(?:[*-]|\d+\.) )|\n(?=\|)", cut(markdown)):
        cells = part.split("|") if part.lstrip().startswith("|") else [part]
        paragraphs += [text for cell in cells if (text := " ".join(cell.split()))]
    return paragraphs


def cut(markdown: str) -> str:
    for pattern, instead in _NO_PROSE:
        markdown = pattern.sub(instead, markdown)
    return markdown


def claims(paragraph: str) -> Iterator[Number]:
    """The numbers of a paragraph that have to come from somewhere; words among them are NaN."""
    for number in numbers(paragraph):
        if number.unit or number.value > COUNTS or number.value != int(number.value):
            yield number
    for match in WORDS.finditer(paragraph):
        yield Number(match[0], math.nan, 0, None, match.start())


def agree(said: Number, source: Number, *, lax: bool = False) -> bool:
    """Whether a source, rounded as the text rounds, is what the text says.

    Units must be of one kind. A source whose unit is not known serves a text without unit, and, if `lax`, any.
    """
    if source.kind != said.kind and not (lax and source.kind is None):
        return False
    scale = UNITS[source.unit][1] / UNITS[said.unit][1] if said.unit and source.unit else 1.0
    return close(said, source.value * scale)


def close(said: Number, value: float) -> bool:
    """Whether a value, rounded to the digits of the text, is what it says."""
    return abs(abs(value) - said.value) <= 0.5 * 10.0**-said.places * (1 + 1e-9) + 1e-12


# --- sources


def _plain(value: float, unit: str | None, text: str) -> Number:
    return Number(repr(value), abs(float(value)), 12, unit if unit in UNITS else None, -1, stems(text))


def unit_of_name(name: str) -> str | None:
    """The unit that a key, a column or a variable ends in: ``median_pct``, ``"mm per px"``, ``"bad-2 %"``."""
    words = [word for word in re.split(r"[\s_]+", name.strip()) if word]
    for unit in (" ".join(words[-3:]), words[-1] if len(words) > 1 else ""):
        if unit in UNITS and unit != "x":
            return unit
    return "times" if "times" in words or words[-1:] == ["ratio"] else None


def of_output(text: str) -> Iterator[Number]:
    """Numbers of what a cell printed; in a table the unit is that of the head above."""
    heads: dict[int, str] = {}
    head = ""
    for line in text.splitlines():
        found = numbers(line)
        for number in found:
            unit = number.unit or heads.get(number.start + len(number.text))
            yield Number(number.text, number.value, number.places, unit, -1, stems(head + " " + line))
        if len(found) < 2:
            head = line
            words = list(re.finditer(r"\S+", line))
            for k, word in enumerate(words):
                named = [w[0] for w in words[max(0, k - 2) : k + 1]]
                unit = next((u for u in (" ".join(named), named[-1]) if u in UNITS and u not in ("x", "s")), None)
                heads.pop(word.end(), None)
                if unit:
                    heads[word.end()] = unit


@cache
def notebook(number: str) -> dict[str, Any]:
    (path,) = (ROOT / "notebooks").glob(f"{number}_*.ipynb")
    return json.loads(path.read_text(encoding="utf-8"))


def printed_by(cell: dict[str, Any]) -> str:
    """What a cell printed."""
    shown = (output.get("text") or output.get("data", {}).get("text/plain", "") for output in cell.get("outputs", []))
    return "\n".join("".join(part) for part in shown)


def outputs(number: str) -> str:
    """All that a notebook prints."""
    return "\n".join(map(printed_by, notebook(number)["cells"]))


@cache
def knobs(number: str) -> dict[str, tuple[Any, str | None, str]]:
    """A notebook's parameters: value, the unit that the comment beside it or its name ends in, and that line."""
    found = {}
    for cell in notebook(number)["cells"]:
        if "parameters" in cell["metadata"].get("tags", []):
            source = "".join(cell["source"])
            for node in ast.parse(source).body:
                line = source.splitlines()[(node.end_lineno or 1) - 1]
                for target in (t for t in getattr(node, "targets", []) if isinstance(t, ast.Name)):
                    ends = (part.split(":")[0].strip() for part in re.split("[,;.]", line.partition("#")[2]))
                    unit = next((u for u in ends if u in UNITS), None) or unit_of_name(target.id)
                    found[target.id] = (node.value, unit, line)  # type: ignore[attr-defined]
    return found


def of_notebook(number: str) -> Iterator[Number]:
    for place, cell in enumerate(notebook(number)["cells"]):
        for source in of_output(printed_by(cell)):
            yield replace(source, start=place)
    for value, unit, line in knobs(number).values():
        for node in ast.walk(value):
            if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
                yield _plain(node.value, unit, line)


@cache
def published() -> dict[str, Any]:
    return tomllib.loads((ROOT / "data" / "paper" / "published.toml").read_text(encoding="utf-8"))


def flat(value: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """Every number in a tree of lists and dictionaries, with the key that names it."""
    if isinstance(value, dict):
        for key, part in value.items():
            yield from flat(part, key)
    elif isinstance(value, list):
        for part in value:
            yield from flat(part, name)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield name, float(value)


def of_published() -> Iterator[Number]:
    for name, item in published().items():
        words = " ".join([name, "paper printed", *(text for text in item.values() if isinstance(text, str))])
        for _, value in flat(item.get("value", 0)):
            yield _plain(value, item.get("unit"), words)
        yield from about(numbers(words), words)


@cache
def result(name: str) -> dict[str, Any]:
    """One benchmark's results, without the machine."""
    text = (ROOT / "benchmarks" / "results" / f"{name}.json").read_text(encoding="utf-8")
    return {key: value for key, value in json.loads(text).items() if key not in ("machine", "versions", "code")}


def of_results() -> Iterator[Number]:
    for path in sorted((ROOT / "benchmarks" / "results").glob("*.json")):
        for name, value in flat(result(path.stem)):
            yield _plain(value, unit_of_name(name), f"{path.stem} {name}")


@cache
def rows(path: str) -> list[dict[str, str]]:
    """A CSV file of `figures`."""
    with (ROOT / "figures" / path).open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def of_ledger(notebooks: Iterable[str] | None = None) -> Iterator[Number]:
    for row in rows("ledger.csv"):
        if notebooks is None or row["notebook"][:2] in notebooks:
            words = " ".join(row.values())
            for column in ("paper", "ours", "difference", "tolerance"):
                yield from about(numbers(row[column]), words, row["unit"])
            yield from about(numbers(row["reason"]), words)


def of_tables(names: Iterable[str]) -> Iterator[Number]:
    for name in names:
        for row in rows(f"tables/{name}.csv"):
            labels = " ".join(text for text in row.values() if text and not numbers(text))
            for column, text in row.items():
                yield from about(numbers(text or ""), f"{name} {labels} {column}", unit_of_name(column))


def tables() -> list[str]:
    names = (path.stem for path in sorted((ROOT / "figures" / "tables").glob("*.csv")))
    return [name for name in names if not name.startswith("ledger_")]


Sources = dict[str | None, list[Number]]


def by_kind(found: Iterable[Number]) -> Sources:
    kinds: Sources = {}
    for number in dict.fromkeys(found):
        kinds.setdefault(number.kind, []).append(number)
    return kinds


@cache
def of_paper() -> Sources:
    return by_kind(number for number in of_published() if number.unit)


@cache
def sources(page: str) -> tuple[Sources, Sources]:
    """Where a page's numbers may come from: what is known with its unit, and what the page's own notebook prints."""
    if page.endswith(".md"):
        return by_kind([*of_published(), *of_results(), *of_ledger(), *of_tables(tables())]), {}
    number = page[:2]
    saved = [name for name in tables() if f'"{name}"' in json.dumps(notebook(number)).replace('\\"', '"')]
    known = [*of_published(), *of_ledger([number]), *of_tables(saved)]
    return by_kind(known), by_kind(of_notebook(number))


def is_sourced(said: Number, paragraph: str, page: str, place: int) -> bool:
    """Whether a number stands in one of its page's sources, or in a notebook that the same paragraph names.

    The source must have the number's unit and share a word with the sentence; two words on a page and where the number
    has one digit. Three exceptions: what the paper prints with a unit and more than one digit needs no word; what the
    page's own notebook prints without a unit may serve a number with one; and what it prints near the paragraph, which
    is cell `place`, may share a word less if its unit agrees.
    """
    if page in DECLARED_ALONE or (page.endswith(".md") and said.unit is None):
        return False
    words, digits = stems(sentence(paragraph, said.start)), len(said.text.lstrip("0.").replace(".", ""))
    needed = 2 if digits == 1 or page.endswith(".md") else 1
    if digits > 1 and any(agree(said, source) for source in of_paper().get(said.kind, [])):
        return True
    known, own = sources(page)
    pools = [known, *(sources(f"{other}_")[1] for other in re.findall(r"\u2192(\d\d)", paragraph))]
    for source in (source for pool in pools for source in pool.get(said.kind, [])):
        if len(words & source.about) >= needed and agree(said, source):
            return True
    for source in [*own.get(said.kind, []), *(own.get(None, []) if said.unit else [])]:
        near = (
            said.unit is not None
            and source.kind == said.kind
            and source.start >= 0
            and abs(source.start - place) <= NEAR
        )
        if len(words & source.about) >= needed - near and agree(said, source, lax=True):
            return True
    return False


# --- pages and what is declared


def cells_of(page: str) -> list[tuple[int, str]]:
    """A page's Markdown and where it stands: a notebook's cells with their places, or a page's paragraphs, all at 0."""
    if page.endswith(".md"):
        text = (ROOT / page).read_text(encoding="utf-8")
        for pattern, instead in _NO_PROSE[:2]:  # these may have empty lines in them
            text = pattern.sub(instead, text)
        return [(0, part) for part in re.split(r"\n\s*\n", text)]
    cells = enumerate(notebook(page[:2])["cells"])
    return [(place, "".join(cell["source"])) for place, cell in cells if cell["cell_type"] == "markdown"]


def declarations() -> list[dict[str, Any]]:
    """What the files of ``numbers_in_text/`` declare, one a page.

    ``text`` is the phrase as it stands on the page, without Markdown's code and links; ``value`` computes its numbers
    in their order, counting words in {braces}; ``between`` bounds what a phrase of words stands for. ``decided`` in
    place of a value: nothing measures it, somebody set it, and says why.
    """
    found = []
    for path in sorted((ROOT / "tests" / "numbers_in_text").glob("*.toml")):
        page = path.stem + (".ipynb" if path.stem[0].isdigit() else ".md")
        found += [entry | {"page": page} for entry in tomllib.loads(path.read_text(encoding="utf-8"))["number"]]
    return found


NAMES: dict[str, Any] = {
    "result": result,
    "table": lambda name: rows(f"tables/{name}.csv"),
    "paper": lambda id: published()[id]["value"],
    "ours": lambda id: [
        n.value for row in rows("ledger.csv") if row["id"] == id for n in numbers(row["ours"].replace("x", " "))
    ],
    "printed": lambda number, pattern: [
        float(group) for match in re.finditer(pattern, outputs(number)) for group in match.groups()
    ],
    "knob": lambda number, name: ast.literal_eval(knobs(number)[name][0]),
    "stands": lambda path, pattern: [
        float(text.replace(",", "").replace("_", ""))
        for text in re.findall(pattern, (ROOT / path).read_text(encoding="utf-8"))
    ],
    "motorcycle": lambda disparities, ratio=10: _motorcycle(disparities, ratio),
    "module": import_module,
    "ROOT": ROOT,
    "math": math,
}


@cache
def _motorcycle(disparities: int, ratio: int) -> dict[str, Any]:
    """SGBM on notebook 09's photographs: bad 2 (%), and where it returned something, and where that is right."""
    view = motorcycle_view()
    found = compute_disparity(view.left, view.right, SGBMParams(disparities, 5, uniqueness_ratio=ratio), whole=True)
    known = np.isfinite(view.truth_px)
    return {
        "bad2": score(found, view.truth_px).bad2_pct,
        "returned": np.isfinite(found)[known],
        "right": (np.abs(found - view.truth_px) <= 2)[known],
    }


def declared_values(entry: dict[str, Any]) -> list[float]:
    """Compute what a declaration says that its numbers are."""
    value = eval(entry["value"], dict(NAMES))
    return [float(each) for each in (value if isinstance(value, list | tuple) else [value])]


_WORDS = "none one two three four five six seven eight nine ten"
_WORD_VALUES = {word: k for k, word in enumerate(_WORDS.split())}


def declared_numbers(entry: dict[str, Any]) -> list[Number]:
    """The numbers of a declared phrase in their order: those that need a source, and what stands in {braces}."""
    text, found = " ".join(entry["text"].split()), dict[int, Number]()
    for k, match in enumerate(re.finditer(r"{([^}]*)}", text)):
        word = match[1]
        value = float(_WORD_VALUES.get(word, word.replace(" ", "")))
        found[match.start() - 2 * k] = Number(word, value, len(word.partition(".")[2]), None, match.start() - 2 * k)
    said = {number.start: number for number in claims(phrase(entry))}
    return [number for _, number in sorted((said | found).items())]


def phrase(entry: dict[str, Any]) -> str:
    return re.sub("[{}]", "", " ".join(entry["text"].split()))


def wrong(entry: dict[str, Any]) -> str:
    """What is wrong with a declaration, "" if nothing: its numbers are as computed, its words between their bounds."""
    said = declared_numbers(entry)
    if "decided" in entry:
        return "" if said else f"{entry['text']!r} has no number to declare"
    values = declared_values(entry)
    if len(values) != len(said):
        return f"{entry['text']!r} has {len(said)} numbers, its expression {len(values)}"
    low, high = entry.get("between", (math.nan, math.nan))
    for number, value in zip(said, values, strict=True):
        if not (low <= value <= high if math.isnan(number.value) else close(number, value)):
            return f"{entry['text']!r} says {number.text!r}, computed is {value:.6g}"
    return ""


def marked(markdown: str) -> str:
    """Put a mark with its number behind every notebook that a text names."""
    linked = re.sub(r"\[([^\]]*)\]\((\d\d)_\w+\.ipynb[^)]*\)", "[\\1](\\2_.ipynb) \u2192\\2\u200b", markdown)
    return re.sub(r"(\b[Nn]otebook (\d\d))\b", "\\1 \u2192\\2\u200b", linked)


def unsourced(page: str, cells: list[tuple[int, str]], declared: list[dict[str, Any]]) -> list[str]:
    """Everything that a page says without a source, and every declaration whose phrase is not there."""
    found, used = [], set[str]()
    entries = {phrase(entry): entry for entry in declared if entry["page"] == page}
    for place, markdown in cells:
        for paragraph in prose(marked(markdown)):
            bare = re.sub(" ?\u2192\\d\\d\u200b", "", paragraph)
            spans = [(m.start(), m.end(), text) for text in entries for m in re.finditer(re.escape(text), bare)]
            used |= {text for _, _, text in spans}
            for said in claims(bare):
                if any(low <= said.start and said.start + len(said.text) <= high for low, high, _ in spans):
                    continue
                if math.isnan(said.value) or not is_sourced(said, with_marks(bare, paragraph), page, place):
                    around = bare[max(0, said.start - 50) : said.start + len(said.text) + 30]
                    found.append(f"{said.text} {said.unit or ''}".strip() + f": ...{around}...")
    return found + [f"declared, but not there: {text!r}" for text in entries if text not in used]


def changed(markdown: str) -> Iterator[tuple[str, str]]:
    """Change one number of a text that needs a source, in several ways: the number before, the text after."""
    before = [number.text for paragraph in prose(markdown) for number in claims(paragraph)]
    for match in _NUMBER.finditer(markdown):
        (said,) = numbers(match[0])
        step = 10.0 ** -max(said.places, 0)
        for value in (said.value + step, said.value - step, said.value + 2 * step, 1.5 * said.value):
            text = f"{value:.{max(said.places, 0)}f}"
            after = markdown[: match.start()] + text + markdown[match.end() :]
            now = [number.text for paragraph in prose(after) for number in claims(paragraph)]
            if value > 0 and float(text) != said.value and now != before:
                yield match[0], after


def with_marks(bare: str, paragraph: str) -> str:
    """A paragraph in which numbers stand where they are found, and its marks behind."""
    return bare + " " + " ".join(re.findall("\u2192\\d\\d", paragraph))


def proposals(page: str) -> Iterator[str]:
    """For every number of a page that has no source, a declaration to be read, judged and completed by hand."""
    for place, markdown in cells_of(page):
        for bare in (re.sub(" ?\u2192\\d\\d\u200b", "", text) for text in prose(marked(markdown))):
            for said in claims(bare):
                if not math.isnan(said.value) and is_sourced(said, bare, page, place):
                    continue
                start = bare.rfind(" ", 0, max(0, said.start - 18)) + 1
                text = bare[start : (bare + " ").find(" ", said.start + len(said.text) + 12)]
                value = next(_pointers(said, page), "")
                yield f"[[number]]\ntext = '''{text}'''\nvalue = '''{value}'''\n"


def _pointers(said: Number, page: str) -> Iterator[str]:
    """Expressions that give what a number says: lines that the notebook prints, then the ledger's rows."""
    for line in [] if page.endswith(".md") or math.isnan(said.value) else outputs(page[:2]).splitlines():
        for source in numbers(line):
            if agree(said, replace(source, unit=source.unit or said.unit)):
                before = line[max(0, source.start - 25) : source.start].lstrip()
                if re.search("[a-z]{2}", before):
                    pattern = re.escape(before).replace("\\ ", " ")
                    yield f'printed("{page[:2]}", r"{pattern}([\\d.]+)")[0]'
    for row in rows("ledger.csv"):
        for k, value in enumerate(NAMES["ours"](row["id"])):
            if close(said, value):
                yield f'ours("{row["id"]}")[{k}]'


if __name__ == "__main__":
    print(*(text for name in sys.argv[1:] for text in proposals(name)), sep="\n")
