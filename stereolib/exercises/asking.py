"""One exercise of one student: its question, its hints, its verdict."""

from __future__ import annotations

import hashlib
import os
from functools import cache
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from stereolib.exercises.answers import Array, Choice, Number, Verdict
from stereolib.exercises.tasks import Recipe, Task

CHAPTERS = sorted(int(path.stem[-2:]) for path in Path(__file__).parent.glob("chapter_??.py"))
_DRAWS = 100  # until no usual mistake leads to the right answer by accident


class WrongAnswer(AssertionError):
    """A wrong answer under nbgrader, which gives no points where a cell raises."""

    def _render_traceback_(self) -> list[str]:  # IPython shows these lines in place of a traceback
        return [str(self)]


class Exercise:
    """One exercise with the numbers of one student; it shows its question in a notebook.

    Parameters
    ----------
    number : str
        Chapter and exercise, ``"03.2"``.
    recipe : Recipe
    task : Task

    Attributes
    ----------
    given : namespace
        The numbers of the question, by name.
    """

    def __init__(self, number: str, recipe: Recipe, task: Task) -> None:
        self.number, self.given = number, SimpleNamespace(**task.given)
        self._recipe, self._task, self._told = recipe, task, 0

    def __repr__(self) -> str:
        return f"{self.number} {self._recipe.title}\n\n{self._task.question}"

    def _repr_markdown_(self) -> str:
        return self._task.question

    def picture(self) -> Any:
        """Show the figure of the question.

        Returns
        -------
        stereolib.plotting.Picture

        Raises
        ------
        ValueError
            If the exercise has none.
        """
        from stereolib.plotting import show_figure

        if self._task.draw is None:
            raise ValueError(f"exercise {self.number} has no picture")
        figure, alt = self._task.draw()
        picture = show_figure(None, figure)
        picture.alt = alt
        return picture

    def hint(self) -> str:
        """Tell the first hint, and the second one when asked again.

        Returns
        -------
        str
        """
        hint = self._recipe.hints[min(self._told, 1)]
        self._told += 1
        return hint

    def check(self, answer: Any) -> Verdict:
        """Say whether an answer is right, and if not, what the mistake probably was.

        Parameters
        ----------
        answer : float, array_like, str or callable
            What the exercise asks for.

        Returns
        -------
        Verdict
            True where it is right; its text is a sentence.

        Raises
        ------
        WrongAnswer
            If it is wrong and nbgrader runs the notebook.
        """
        unsolved = answer is None or answer is Ellipsis
        verdict = Verdict(False, "No answer yet.") if unsolved else self._task.answer.judge(answer)
        if not verdict and os.environ.get("NBGRADER_EXECUTION"):
            raise WrongAnswer(verdict.text)
        return verdict


def exercise_numbers(chapter: int | None = None) -> list[str]:
    """List the exercises.

    Parameters
    ----------
    chapter : int, optional
        Of this chapter only.

    Returns
    -------
    list of str

    Examples
    --------
    >>> exercise_numbers(3)[:2]
    ['03.1', '03.2']
    """
    chapters = CHAPTERS if chapter is None else [chapter]
    return [f"{k:02d}.{n}" for k in chapters for n in range(1, len(recipes(k)) + 1)]


def recipes(chapter: int) -> tuple[Recipe, ...]:
    """Return the exercises of a chapter, before anything is drawn."""
    found: tuple[Recipe, ...] = import_module(f"stereolib.exercises.chapter_{chapter:02d}").RECIPES
    return found


def recipe_of(number: str) -> Recipe:
    """Return one exercise before anything is drawn; refuse a number that there is not."""
    chapter, _, place = str(number).partition(".")
    if not (chapter.isdecimal() and int(chapter) in CHAPTERS and number in exercise_numbers(int(chapter))):
        raise ValueError(f"there is no exercise {number!r}; they run from 00.1 to {exercise_numbers()[-1]}")
    return recipes(int(chapter))[int(place) - 1]


def exercise(number: str, student: str = "") -> Exercise:
    """Give an exercise with the numbers of a student.

    Parameters
    ----------
    number : str
        Chapter and exercise, ``"03.2"``.
    student : str
        Any name; each name draws other numbers. Small letters and capitals count alike.

    Returns
    -------
    Exercise
        The same one for the same number and student.

    Raises
    ------
    ValueError
        If there is no such exercise.
    WrongAnswer
        If nbgrader grades, and another student has handed the notebook in.

    Examples
    --------
    >>> depth = exercise("00.2", student="anna")
    >>> depth.check("far")
    A number is asked for, not str.
    """
    recipe_of(number)
    name = _plain(student)
    if os.environ.get("NBGRADER_EXECUTION") == "autograde":
        handed_in_by = Path.cwd().parent.name  # nbgrader works in autograded/STUDENT/ASSIGNMENT
        if name != _plain(handed_in_by):
            raise WrongAnswer(f"These are the numbers of {student!r}, and {handed_in_by!r} handed them in.")
    return _drawn(number, name)


def _plain(student: str) -> str:
    """A name without what is easily typed differently."""
    return " ".join(str(student).casefold().split())


@cache
def _drawn(number: str, student: str) -> Exercise:
    """An exercise whose mistakes can be told apart for this student's numbers."""
    recipe = recipe_of(number)
    seed = int.from_bytes(hashlib.sha256(f"{number} {student}".encode()).digest()[:8], "little")
    rng = np.random.default_rng(seed)
    for _ in range(_DRAWS):
        task = recipe.make(rng)
        if is_clear(task):
            return Exercise(number, recipe, task)
    raise RuntimeError(f"exercise {number}: in {_DRAWS} draws some mistake could not be told from the right answer")


def is_clear(task: Task) -> bool:
    """Tell whether each mistake of this exercise's own is recognised as what it is, not as another or as right."""
    answer = task.answer
    if not isinstance(answer, (Number, Array, Choice)):
        return True
    own = answer.wrong if isinstance(answer, Choice) else answer.mistakes
    named = {why: wrong for why, wrong in answer.wrong_answers() if isinstance(answer, Choice) or why in own}
    return all(answer.judge(wrong).mistake == why for why, wrong in named.items())
