"""One exercise of one student: its question, its hints, its verdict."""

from __future__ import annotations

import copy
import hashlib
import unicodedata
from functools import cache
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from stereolib.exercises.answers import Verdict
from stereolib.exercises.function_answers import Function
from stereolib.exercises.tampering import refuse_tampering
from stereolib.exercises.tasks import Recipe, Task

CHAPTERS = sorted(int(path.stem[-2:]) for path in Path(__file__).parent.glob("chapter_??.py"))
#: The name that stands in a new sheet.
NOBODY = "reader"
_UNNAMED = f"These are the numbers of `{NOBODY}`. Write your own name into the second cell; run it, then this one."
_DRAWS = 500  # until no usual mistake leads to the right answer by accident


class WrongAnswer(AssertionError):
    """A wrong answer; nbgrader gives no points where a cell raises, and a notebook shows the sentence alone."""

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
    unnamed : bool
        Whether to tell the student that these are nobody's numbers.

    """

    def __init__(self, number: str, recipe: Recipe, task: Task, *, unnamed: bool = False) -> None:
        self.number, self._recipe, self._task, self._told, self._unnamed = number, recipe, task, 0, unnamed

    @property
    def given(self) -> SimpleNamespace:
        """The numbers of the question, by name; a copy, so that nothing spoils them for the next try."""
        return SimpleNamespace(**copy.deepcopy(dict(self._task.given)))

    def __repr__(self) -> str:
        return f"{self.number} {self._recipe.title}\n\n{self._task.question}"

    def _repr_markdown_(self) -> str:
        return self._task.question + (f"\n\n*{_UNNAMED}*" if self._unnamed else "")

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
        """Tell the first hint, the second one when asked again, and then that there are no more.

        Returns
        -------
        str
        """
        self._told += 1
        hints = self._recipe.hints
        return hints[self._told - 1] if self._told <= len(hints) else "There are only two hints."

    def check(self, answer: Any) -> Verdict:
        """Say that an answer is right, or what the mistake probably was.

        Parameters
        ----------
        answer : float, array_like, str or callable
            What the exercise asks for.

        Returns
        -------
        Verdict

        Raises
        ------
        WrongAnswer
            If it is not right; its text says why.
        """
        unsolved = answer is None or answer is Ellipsis
        verdict = Verdict(False, "No answer yet.") if unsolved else self._task.answer.judge(answer)
        if not verdict:
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
        Any name; each name draws its numbers. Small letters and capitals differ, spaces around it do not count.

    Returns
    -------
    Exercise
        The same one for the same number and student.

    Raises
    ------
    ValueError
        If there is no such exercise.

    Examples
    --------
    >>> depth = exercise("00.2", student="anna")
    >>> depth.check("far")
    Traceback (most recent call last):
    stereolib.exercises.asking.WrongAnswer: A number is asked for, not str.
    """
    recipe_of(number)
    _watch()
    return _drawn(number, plain_name(student))


@cache
def _watch() -> None:
    """Let a notebook say of each cell that is run from now on if it would not be run while grading."""
    from IPython import get_ipython

    if shell := get_ipython():
        shell.events.register("pre_run_cell", _tell_tampering)


def _tell_tampering(cell: Any) -> None:
    if why := refuse_tampering(cell.raw_cell):
        print(f"Note: a teacher who grades this sheet with nbgrader will not run this cell, because {why}.")


def plain_name(student: str) -> str:
    """Return a name without what cannot be seen: how its accents are coded, and spaces around it."""
    return unicodedata.normalize("NFC", str(student)).strip()


def handed_in_by(owner: str, student: str) -> str:
    """Refuse a sheet with the numbers of another student; `nbgrader_config.py` puts it before each check.

    Parameters
    ----------
    owner : str
        Who handed it in.
    student : str
        The name in the sheet.

    Returns
    -------
    str
        The name of the owner.

    Raises
    ------
    WrongAnswer
        If the names differ.
    """
    if plain_name(student) != plain_name(owner):
        raise WrongAnswer(f"These are the numbers of {student!r}, and {owner!r} handed them in.")
    return owner


@cache
def _drawn(number: str, student: str) -> Exercise:
    """An exercise in which no usual mistake leads to the right answer with this student's numbers."""
    recipe = recipe_of(number)
    seed = int.from_bytes(hashlib.sha256(f"{number} {student}".encode()).digest()[:8], "little")
    rng = np.random.default_rng(seed)
    for _ in range(_DRAWS):
        task = recipe.make(rng)
        if is_clear(task):
            return Exercise(number, recipe, task, unnamed=student == NOBODY)
    raise RuntimeError(f"exercise {number}: in {_DRAWS} draws some mistake could not be told from the right answer")


def is_clear(task: Task) -> bool:
    """Tell whether every usual mistake leads away from the right answer; of a function, its inputs see to that."""
    answer = task.answer
    return isinstance(answer, Function) or not any(answer.judge(wrong) for _, wrong in answer.wrong_answers())
