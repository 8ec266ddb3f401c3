"""The notebooks of exercises: as made, executed, without an answer in them; solved they are right, else wrong."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path
from typing import Any

import nbformat
import pytest

from stereolib.base import ROOT
from stereolib.exercises import SHEETS, WrongAnswer, exercise, exercise_numbers, make_sheet
from stereolib.exercises.answers import OR
from stereolib.exercises.asking import recipe_of, recipes

FOLDER = ROOT / "notebooks" / "exercises"

each_sheet = pytest.mark.parametrize("chapter", SHEETS, ids=SHEETS.values())


def committed(chapter: int) -> Any:
    return nbformat.read(FOLDER / f"{SHEETS[chapter]}.ipynb", as_version=4)


def test_there_is_one_for_each_chapter() -> None:
    assert sorted(path.stem for path in FOLDER.glob("*.ipynb")) == sorted(SHEETS.values())


@each_sheet
def test_it_is_as_the_library_says_and_was_executed(chapter: int) -> None:
    cells, made = committed(chapter).cells, make_sheet(chapter).cells
    remedy = f"python notebooks/exercises/make_sheets.py {chapter:02d}"
    assert [(cell.id, cell.source, cell.metadata) for cell in cells] == [
        (cell.id, cell.source, cell.metadata) for cell in made
    ], remedy
    code = [cell for cell in cells if cell.cell_type == "code"]
    checks = [cell for cell in code if cell.id.startswith("check-")]
    assert not any(cell.outputs or cell.execution_count for cell in checks)  # nothing is answered yet
    counts = {cell.execution_count or number for number, cell in enumerate(code, 1)}
    assert counts == set(range(1, len(code) + 1)), remedy
    outputs = [output for cell in code for output in cell.outputs]
    assert not [output for output in outputs if output.get("name") == "stderr" or output.output_type == "error"]
    assert all("raises-exception" in cell.metadata.tags for cell in checks)  # so that the cells below are run too
    asked = [o.data["text/markdown"] for o in outputs if "text/markdown" in o.get("data", {})]
    assert asked == [exercise(number, "reader")._repr_markdown_() for number in exercise_numbers(chapter)], remedy
    pictures = [output for output in outputs if "image/png" in output.get("data", {})]
    assert len(pictures) == sum(recipe_of(number).has_picture for number in exercise_numbers(chapter)) > 0
    assert all(len(output.metadata["image/png"]["alt"]) > 40 for output in pictures)


@each_sheet
def test_nbgrader_can_read_it(chapter: int) -> None:
    marked = [cell.metadata["nbgrader"] for cell in committed(chapter).cells if "nbgrader" in cell.metadata]
    names = [mark["grade_id"] for mark in marked]
    assert len(names) == len(set(names))
    for number in exercise_numbers(chapter):
        name = number.replace(".", "-")
        answer, check = (next(m for m in marked if m["grade_id"] == f"{kind}-{name}") for kind in ("answer", "check"))
        assert answer["solution"] and not answer["locked"] and not answer["grade"]
        assert check["grade"] and check["locked"] and check["points"] == recipe_of(number).points


@each_sheet
def test_no_answer_stands_in_it(chapter: int) -> None:
    text = (FOLDER / f"{SHEETS[chapter]}.ipynb").read_text(encoding="utf-8")
    said = [cell for cell in committed(chapter).cells if cell.id.startswith("check-")]
    assert not [cell.id for cell in said if "Right." in str(cell.outputs)]
    for number in exercise_numbers(chapter):
        for hint in recipe_of(number).hints:
            assert hint not in text


@each_sheet
def test_what_is_not_answered_is_told_in_one_sentence_and_stops_the_cell(chapter: int) -> None:
    sheet, names = committed(chapter), {}
    checked = 0
    for cell in sheet.cells:
        if cell.id.startswith("check-"):
            with pytest.raises(WrongAnswer, match=r"\ANo answer yet[^\n]*\.\Z"):
                exec(cell.source, names)
            checked += 1
        elif cell.cell_type == "code" and not cell.id.startswith("picture-"):
            exec(cell.source, names)
    assert checked == len(exercise_numbers(chapter))


def run(chapter: int, student: str, answers: dict[str, Any]) -> dict[str, str]:
    """Execute a sheet in this process with some answers put in; return what the checks say."""
    names: dict[str, Any] = {}
    said: dict[str, str] = {}
    for cell in make_sheet(chapter).cells:
        if cell.cell_type != "code":
            continue
        kind, _, number = cell.id.partition("-")
        number = number.replace("-", ".")
        if kind == "student":
            names["student"] = student
        elif kind == "answer":
            names[recipe_of(number).answer_name] = answers[number]
        elif kind != "picture":  # these have tests of their own, and take long
            printed = io.StringIO()
            try:
                with contextlib.redirect_stdout(printed):
                    exec(cell.source, names)
            except WrongAnswer as wrong:
                printed.write(str(wrong))
            if kind == "check":
                said[number] = printed.getvalue().strip()
    return said


@each_sheet
def test_right_answers_are_right_and_wrong_ones_named(chapter: int) -> None:
    numbers = exercise_numbers(chapter)
    judges = {number: exercise(number, "anna")._task.answer for number in numbers}
    said = run(chapter, "anna", {number: judge.right_answer() for number, judge in judges.items()})
    assert said == dict.fromkeys(numbers, "Right.")
    wrong = {number: next(iter(judge.wrong_answers())) for number, judge in judges.items()}
    said = run(chapter, "anna", {number: answer for number, (_, answer) in wrong.items()})
    assert said.keys() == wrong.keys()
    for number, (mistake, _) in wrong.items():
        assert mistake in said[number].removeprefix("Not yet. ").split(OR)


@each_sheet
def test_chapter_leads_to_it(chapter: int) -> None:
    text = (ROOT / "notebooks" / f"{SHEETS[chapter]}.ipynb").read_text(encoding="utf-8")
    assert f"(exercises/{SHEETS[chapter]}.ipynb)" in text
    assert Path(FOLDER / f"../{SHEETS[chapter]}.ipynb").exists()


def test_teachers_page_counts_as_the_exercises_do() -> None:
    """The table of docs/teaching.md, and each exercise that its plans name."""
    page = (ROOT / "docs" / "teaching.md").read_text(encoding="utf-8")
    rows = []
    for chapter, name in SHEETS.items():
        of_it = recipes(chapter)
        longest = max(of_it, key=lambda recipe: recipe.minutes).title
        minutes, points = (sum(getattr(recipe, what) for recipe in of_it) for what in ("minutes", "points"))
        link = f"[{chapter:02d}](../notebooks/exercises/{name}.ipynb)"
        rows.append(f"| {link} | {len(of_it)} | {minutes} | {points} | {longest} |")
    table = page.partition("<!-- sheets -->")[2].partition("<!-- /sheets -->")[0]
    assert table.strip().splitlines()[2:] == rows
    assert set(re.findall(r"\b0\d\.\d\b", page)) <= set(exercise_numbers())
