"""What an exercise is made of: what all students share, and what is drawn for each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stereolib.exercises.answers import Answer


@dataclass(frozen=True, eq=False)
class Task:
    """An exercise with the numbers of one student.

    Parameters
    ----------
    question : str
        Markdown, with these numbers.
    given : mapping of str to object
        The same numbers by name, for the student's code.
    answer : Number, Array, Choice or Function
    draw : callable, optional
        Returns a figure and what there is to see in it.
    """

    question: str
    given: Mapping[str, Any]
    answer: Answer
    draw: Callable[[], tuple[Any, str]] | None = None


@dataclass(frozen=True)
class Recipe:
    """An exercise before its numbers are drawn.

    Parameters
    ----------
    make : callable
        From a random generator to a `Task`.
    title : str
    goal : str
        What can be done after it: "turn a disparity into a depth".
    minutes : int
    start : str
        What stands in the student's cell; its first word that is no ``def`` names the answer.
    hints : (str, str)
    points : int
    has_picture : bool
    """

    make: Callable[[np.random.Generator], Task]
    title: str
    goal: str
    minutes: int
    start: str
    hints: tuple[str, str]
    points: int = 1
    has_picture: bool = False

    @property
    def answer_name(self) -> str:
        """Name under which the notebook keeps the answer."""
        return self.start.removeprefix("def ").replace("(", " ").split()[0]


def task(title: str, goal: str, **about: Any) -> Callable[[Callable[[np.random.Generator], Task]], Recipe]:
    """Make an exercise of a function that draws its numbers.

    Parameters
    ----------
    title, goal : str
    **about
        ``minutes``, ``start`` and ``hints`` of the `Recipe`; ``points`` if not 1, ``has_picture`` if it has one.

    Returns
    -------
    callable
        Turns the function into a `Recipe`.
    """

    def recipe(make: Callable[[np.random.Generator], Task]) -> Recipe:
        return Recipe(make, title, goal, **about)

    return recipe


def drawn(rng: np.random.Generator, low: float, high: float, step: float = 1.0) -> float:
    """Draw a number that is easy to write down.

    Parameters
    ----------
    rng : numpy.random.Generator
    low, high : float
        Both may come.
    step : float
        Between the numbers that may come.

    Returns
    -------
    float
    """
    return round(low + step * float(rng.integers(round((high - low) / step) + 1)), 9)


def table(rows: Any, columns: Sequence[str] = (), names: Sequence[str] = ()) -> str:
    """Write an array as a table in Markdown.

    Parameters
    ----------
    rows : (H, W) array_like
    columns, names : sequence of str
        What stands above the columns and before the rows; empty: nothing.

    Returns
    -------
    str

    Examples
    --------
    >>> print(table([[1, 2]], columns=["first", "second"]))
    | first | second |
    | --- | --- |
    | 1 | 2 |
    """
    cells = [[*([names[k]] if names else []), *map(str, row)] for k, row in enumerate(np.asarray(rows).tolist())]
    above = [*([""] if names else []), *(columns or [""] * len(np.asarray(rows)[0]))]
    lines = [above, ["---"] * len(above), *cells]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
