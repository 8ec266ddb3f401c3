"""The notebooks of exercises, one a chapter, made of what the modules of the chapters say.

They carry nbgrader's metadata: what the student fills in, what is locked, how many points it gives.
"""

from __future__ import annotations

from typing import Any

from stereolib.exercises.asking import NOBODY, exercise_numbers, recipe_of, recipes

#: Chapter and name of its notebook of exercises, which is also the name of the chapter's own notebook.
SHEETS = {
    0: "00_two_pictures",
    1: "01_calibration",
    2: "02_rectification",
    3: "03_sgbm_parameters",
    4: "04_dilation",
    5: "05_lrf",
    6: "06_height",
    7: "07_pixel_cm",
    8: "08_environment_map",
}
_HEAD = """\
# {chapter:02d} · Exercises

These belong to chapter {chapter:02d}, the notebook `{name}`: {count} exercises, {points} points, about {minutes} \
minutes.

Write your name below, as the teacher has it, and run the cells from the top (Shift and Enter). **Your name draws your \
numbers**: those of your neighbour are other ones. Your code finds yours in `task.given`. Put each answer into its \
cell, run it, and then run the cell below it, which says whether the answer is right and what the mistake may have \
been. Do not round on the way, and give four digits; where fewer will do, the question says so. Try as often as you \
like. Are you stuck? `task.hint()` gives a hint, and a second one when asked again."""
_CHECK = """\
from stereolib.exercises import exercise

print(exercise("{number}", student).check({answer}))"""


def _v4() -> Any:
    """The library that makes notebooks; its functions have no types."""
    from nbformat import v4

    return v4


def make_sheet(chapter: int) -> Any:
    """Make the notebook of a chapter's exercises, not executed.

    Parameters
    ----------
    chapter : int

    Returns
    -------
    nbformat.NotebookNode
    """
    of_it = recipes(chapter)
    said = {"count": len(of_it), "points": sum(r.points for r in of_it), "minutes": sum(r.minutes for r in of_it)}
    first = [
        _locked("markdown", "head", _HEAD.format(chapter=chapter, name=SHEETS[chapter], **said)),
        _locked("code", "import", "from stereolib.exercises import exercise"),
        _cell("code", "student", f'student = "{NOBODY}"  # your name, as the teacher has it'),
    ]
    cells = [cell for number in exercise_numbers(chapter) for cell in _exercise(number)]
    return _v4().new_notebook(cells=first + cells)


def _exercise(number: str) -> list[Any]:
    """Cells of one exercise: what it is, its question, its picture, the student's own, the check."""
    recipe, name = recipe_of(number), number.replace(".", "-")
    points = f"{recipe.points} point{'s' * (recipe.points > 1)}"
    goal = f"*{recipe.minutes} minutes, {points}. The goal: to {recipe.goal}.*"
    cells = [
        _locked("markdown", f"goal-{name}", f"## {number} {recipe.title}\n\n{goal}"),
        _locked("code", f"task-{name}", f'task = exercise("{number}", student)\ntask'),
    ]
    if recipe.has_picture:
        cells.append(_locked("code", f"picture-{name}", "task.picture()"))
    check = _CHECK.format(number=number, answer=recipe.answer_name)
    return [
        *cells,
        _cell("code", f"answer-{name}", recipe.start, solution=True),
        _check(f"check-{name}", check, recipe.points),
    ]


def _check(name: str, source: str, points: int) -> Any:
    """A check, after which the notebook runs on although a wrong answer raises."""
    cell = _locked("code", name, source, grade=True, points=points)
    cell.metadata["tags"] = ["raises-exception"]
    return cell


def _cell(kind: str, name: str, source: str, **roles: Any) -> Any:
    """A cell with an id; with roles, these are nbgrader's."""
    cell = getattr(_v4(), f"new_{kind}_cell")(source, id=name)
    if roles:
        plain = {"grade": False, "locked": False, "solution": False, "task": False}
        cell.metadata["nbgrader"] = plain | {"grade_id": name, "schema_version": 3} | roles
    return cell


def _locked(kind: str, name: str, source: str, **roles: Any) -> Any:
    return _cell(kind, name, source, locked=True, **roles)
