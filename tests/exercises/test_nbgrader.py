"""A course from its release to the points: ten students, of whom four hand in something broken and one cheats.

It needs nbgrader and runs by ``make test-nbgrader``, in an environment of its own; elsewhere it is skipped.
"""

from __future__ import annotations

import csv
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import nbformat
import pytest

pytest.importorskip("nbgrader", reason="make test-nbgrader runs it")

from stereolib.base import ROOT
from stereolib.exercises import Function, exercise, exercise_numbers
from stereolib.exercises.asking import recipe_of

CHAPTER, SHEET, ASSIGNMENT = 5, "05_lrf", "ex05"
NUMBERS = exercise_numbers(CHAPTER)
MOST = sum(recipe_of(number).points for number in NUMBERS)
LOOP_S = 8  # after which an endless loop is stopped here
LIMIT_S = 240  # for one command, on a slow machine with two cores that are busy
Answers = dict[str, str]


def solution(number: str, student: str) -> str:
    """Source of a right answer."""
    recipe, answer = recipe_of(number), exercise(number, student)._task.answer
    if isinstance(answer, Function):  # the exercise of this chapter, solved as a student would
        return (
            "def distances_mm(data):\n    found = []\n    for k in range(0, len(data), 4):\n"
            "        low, high = data[k], data[k + 1]\n"
            "        found.append(float('nan') if high & 0x80 else low + 256 * (high & 0x3F))\n    return found"
        )
    right = answer.right_answer()
    return f"{recipe.answer_name} = {getattr(right, 'tolist', lambda: right)()}"


def solved(student: str, *without: str) -> Answers:
    """All answers of a student but some."""
    return {number: solution(number, student) for number in NUMBERS if number not in without}


def points(*numbers: str) -> float:
    return float(sum(recipe_of(number).points for number in numbers))


def loses(*numbers: str) -> float:
    return MOST - points(*numbers)


# What each hands in, and the points that it is worth. The last four but one are broken, the last one cheats.
FIRST, SECOND, THIRD, FOURTH, FIFTH, WRITTEN = NUMBERS
HANDED_IN: dict[str, tuple[Answers, float]] = {
    "anna": (solved("anna"), loses()),
    "ben": (solved("ben"), loses()),
    "cara": (solved("cara", FIRST, SECOND), loses(FIRST, SECOND)),
    "dirk": (solved("dirk") | {SECOND: solution(SECOND, "dirk") + " / 10"}, loses(SECOND)),
    "eva": ({}, 0.0),
    "syntax": (solved("syntax") | {SECOND: "distance_mm = (3 +"}, loses(SECOND)),
    "loop": (solved("loop") | {FOURTH: "while True:\n    pass"}, loses(FOURTH)),
    "deleted": (solved("deleted"), loses(SECOND, FIFTH)),
    "huge": (solved("huge") | {THIRD: f"print('0123456789\\n' * 300_000)\n{solution(THIRD, 'huge')}"}, loses()),
    "cheat": (
        {
            FIRST: "class Yes:\n    check = print\nexercise = lambda *_: Yes()",
            SECOND: solution(SECOND, "anna"),  # another student's number
            THIRD: "import stereolib.exercises as e\ne.Exercise.check = lambda self, answer: True\nplace_mm = 1",
            FOURTH: "noise_mm = exercise('05.4', student)._task.answer.right",
            FIFTH: f"student = 'anna'\n{solution(FIFTH, 'anna')}",  # with the name that belongs to it
            WRITTEN: "import pathlib\npathlib.os.environ.pop('NBGRADER_EXECUTION')\ndistances_mm = len",
        },
        0.0,
    ),
}


def hand_in(released: Path, student: str, answers: Answers) -> Any:
    """A student's notebook."""
    notebook = nbformat.read(released, as_version=4)
    for cell in notebook.cells:
        kind, _, number = cell.id.partition("-")
        if kind == "student":
            cell.source = f"student = {student!r}"
        elif kind == "answer":
            cell.source = answers.get(number.replace("-", "."), cell.source)
    if student == "deleted":  # the whole of one exercise, and the check of another one
        gone = {f"answer-{SECOND}".replace(".", "-"), *(f"check-{n}".replace(".", "-") for n in (SECOND, FIFTH))}
        notebook.cells = [cell for cell in notebook.cells if cell.id not in gone]
    return notebook


@pytest.fixture(scope="module")
def course(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A course from the release of its sheet to the points: ten have handed in and all is graded."""
    folder = tmp_path_factory.mktemp("course")
    shutil.copy(ROOT / "notebooks" / "exercises" / "nbgrader_config.py", folder)
    (folder / "source" / ASSIGNMENT).mkdir(parents=True)
    shutil.copy(ROOT / "notebooks" / "exercises" / f"{SHEET}.ipynb", folder / "source" / ASSIGNMENT)
    run_nbgrader(folder, "generate_assignment", ASSIGNMENT)
    released = folder / "release" / ASSIGNMENT / f"{SHEET}.ipynb"
    for student in HANDED_IN:
        (folder / "submitted" / student / ASSIGNMENT).mkdir(parents=True)
        handed_in = hand_in(released, student, HANDED_IN[student][0])
        nbformat.write(handed_in, folder / "submitted" / student / ASSIGNMENT / released.name)
    run_nbgrader(folder, "autograde", ASSIGNMENT, f"--Execute.timeout={LOOP_S}")
    run_nbgrader(folder, "generate_feedback", ASSIGNMENT)
    run_nbgrader(folder, "export", "--to", "points.csv")
    return folder


def run_nbgrader(folder: Path, *words: str) -> None:
    """Run one command of nbgrader as a teacher does; once more, for who is not graded yet, where a kernel died."""
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"  # it calls alembic
    environment = os.environ | {"PATH": programs, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "nbgrader", *words]
    for _ in (1, 2):
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=LIMIT_S)
        if "Kernel died before replying" not in done.stderr:
            break
    assert done.returncode == 0, f"{words}: {done.stdout[-3000:]}{done.stderr[-6000:]}"


def feedback(course: Path, student: str) -> str:
    return (course / "feedback" / student / ASSIGNMENT / f"{SHEET}.html").read_text(encoding="utf-8")


def test_release_has_all_questions_and_no_answer(course: Path) -> None:
    released = nbformat.read(course / "release" / ASSIGNMENT / f"{SHEET}.ipynb", as_version=4)
    source = nbformat.read(course / "source" / ASSIGNMENT / f"{SHEET}.ipynb", as_version=4)
    assert [cell.source for cell in released.cells] == [cell.source for cell in source.cells]
    locked = [cell for cell in released.cells if cell.metadata.get("nbgrader", {}).get("locked")]
    assert all(not cell.metadata.editable for cell in locked)


def test_everyone_has_the_points_that_are_due(course: Path) -> None:
    with (course / "points.csv").open(newline="", encoding="utf-8") as stream:
        rows = {row["student_id"]: row for row in csv.DictReader(stream)}
    assert {float(row["max_score"]) for row in rows.values()} == {float(MOST)}
    assert {student: float(row["score"]) for student, row in rows.items()} == {
        student: due for student, (_, due) in HANDED_IN.items()
    }


@pytest.mark.parametrize(
    ("student", "said"),
    [
        ("anna", ["Right."]),
        ("dirk", ["It is 10 times too small. Is it in mm?"]),
        ("eva", ["No answer yet."]),
        ("syntax", ["SyntaxError", "Right."]),
        ("loop", ["CellTimeoutError", "Right."]),
        ("huge", ["... Output truncated ...", "Right."]),
        (
            "cheat",
            [
                "it gives the name exercise a new meaning",
                "it imports stereolib.exercises",
                "it reaches for the attribute _task",
                "and 'cheat' handed them in",
                "Not yet",
            ],
        ),
    ],
)
def test_feedback_says_why(course: Path, student: str, said: list[str]) -> None:
    page = feedback(course, student)
    assert [text for text in said if text not in page] == []


def test_huge_output_leaves_small_files(course: Path) -> None:
    file = course / "autograded" / "huge" / ASSIGNMENT / f"{SHEET}.ipynb"
    assert file.stat().st_size < 1_000_000
