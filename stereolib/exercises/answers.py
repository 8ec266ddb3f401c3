"""What is right, and what a wrong answer probably came from: a number, an array, a choice.

A mistake has a name, which is a sentence for the student, and the answer to which it leads, computed from the same
numbers as the right one. Those that any quantity allows (another unit, the sign, half of it) are added here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from stereolib.base import Float64, listed

#: From what a student is likely to have done to what comes out then.
Mistakes: TypeAlias = Mapping[str, Any]
#: Between mistakes that lead to the same answer.
OR = " Or: "
_ROUNDED = "It is rounded too much. Give four digits."
_FACTORS = {"mm": (10, 1000), "cm": (10, 100), "m": (100, 1000), "litres": (10, 1000)}  # to units that are in use


@dataclass(frozen=True)
class Verdict:
    """What is said to an answer.

    Parameters
    ----------
    right : bool
        Also the truth value of the verdict.
    text : str
        A sentence for the student.
    mistake : str
        The mistake that was recognised; empty where none was.
    """

    right: bool
    text: str
    mistake: str = ""

    def __bool__(self) -> bool:
        return self.right

    def __str__(self) -> str:
        return self.text

    __repr__ = __str__


class Answer(Protocol):
    """What can judge an answer, and knows right and wrong ones to be tried with."""

    def judge(self, given: Any) -> Verdict:
        """Say whether an answer is right, and if not, why it probably is not."""

    def right_answer(self) -> Any:
        """Return an answer that is right."""

    def wrong_answers(self) -> Iterator[tuple[str, Any]]:
        """Yield the mistakes that are recognised, each with its answer."""


def mistaken(mistake: str) -> Verdict:
    """Say of a wrong answer what it came from.

    Parameters
    ----------
    mistake : str
        A sentence for the student.

    Returns
    -------
    Verdict
    """
    return Verdict(False, f"Not yet. {mistake}", mistake)


def misshapen(wanted: tuple[int, ...], given: tuple[int, ...]) -> Verdict:
    """Say that an answer has another shape than what is asked for.

    Parameters
    ----------
    wanted, given : tuple of int

    Returns
    -------
    Verdict

    Examples
    --------
    >>> misshapen((3,), ())
    Not yet. The shape (3,) is asked for, yours is a single number.
    """
    asked = f"The shape {wanted}" if wanted else "A single number"
    return Verdict(False, f"Not yet. {asked} is asked for, yours is {given or 'a single number'}.")


def _floats(given: Any) -> Float64:
    """Numbers as an array; a text raises, also if it holds a number."""
    if np.asarray(given).dtype.kind in "SU":
        raise TypeError("a text")
    return np.asarray(given, float)


def _named(given: Any, own: Mistakes, usual: Iterator[tuple[str, Any]], near: Callable[[Any, Any], bool]) -> Verdict:
    """All of the exercise's own mistakes that lead to the given answer; else the first usual one that does."""
    if found := [mistake for mistake, result in own.items() if near(given, result)]:
        return mistaken(OR.join(found))
    for mistake, result in usual:
        if near(given, result):
            return mistaken(mistake)
    return Verdict(False, "Not yet, and it is none of the usual mistakes. `task.hint()` gives a hint.")


def _usual(right: Any, unit: str) -> Iterator[tuple[str, Any]]:
    """Mistakes that any quantity allows; of a count, which has no unit, only the sign."""
    yield "The sign is wrong.", -right
    if not unit:
        return
    for factor in _FACTORS.get(unit, ()):
        yield f"It is {factor} times too large. Is it in {unit}?", right * factor
        yield f"It is {factor} times too small. Is it in {unit}?", right / factor
    if unit == "%":
        yield "This is a share of one. In % it is a hundred times as much.", right / 100
    if unit == "degrees":
        yield "This is the angle in radians; degrees are asked for.", np.radians(right)
    yield "It is half of the right one.", right / 2
    yield "It is twice the right one.", right * 2


@dataclass(frozen=True)
class Number:
    """One number.

    Parameters
    ----------
    right : float
    unit : str
        In which it is asked for; empty for a count.
    within : float
        Share of the right answer by which it may be off.
    mistakes : mapping of str to float
        What this exercise's own mistakes lead to.
    off : float
        By which it may be off whatever its size, for what is read off a figure or counted.
    """

    right: float
    unit: str
    within: float = 0.01
    mistakes: Mistakes = field(default_factory=dict)
    off: float = 0.0

    def _near(self, given: float, wanted: float) -> bool:
        return abs(given - wanted) <= max(self.off, self.within * abs(wanted))

    def _is_rounded(self, given: float) -> bool:
        """Whether it is the right answer to two or three digits, where these are too few."""
        return self.within > 0 and any(np.isclose(given, float(f"{self.right:.{k}g}"), rtol=1e-9) for k in (2, 3))

    def judge(self, given: Any) -> Verdict:
        """Judge a number.

        Parameters
        ----------
        given : float

        Returns
        -------
        Verdict

        Examples
        --------
        >>> Number(700.0, "mm").judge(70.0)
        Not yet. It is 10 times too small. Is it in mm?
        """
        try:
            number = _floats(given).item()  # also an array of one number
        except (TypeError, ValueError, OverflowError):
            return Verdict(False, f"A number is asked for, not {type(given).__name__}.")
        if not np.isfinite(number):
            return Verdict(False, "Your number is not finite: something was divided by zero, or is missing.")
        if self._near(number, self.right):
            return Verdict(True, "Right.")
        verdict = _named(number, self.mistakes, _usual(self.right, self.unit), self._near)
        return mistaken(_ROUNDED) if not verdict.mistake and self._is_rounded(number) else verdict

    def right_answer(self) -> float:
        """Return the right number.

        Returns
        -------
        float
        """
        return self.right

    def wrong_answers(self) -> Iterator[tuple[str, float]]:
        """Yield mistakes and their numbers, the exercise's own first.

        Yields
        ------
        tuple of (str, float)
        """
        yield from self.mistakes.items()
        yield from _usual(self.right, self.unit)


@dataclass(frozen=True, eq=False)
class Array:
    """Several numbers: a vector or a matrix.

    Parameters
    ----------
    right : array_like of float
    unit : str
    within : float
        Share of the largest number by which each may be off.
    mistakes : mapping of str to array_like
    """

    right: ArrayLike
    unit: str = ""
    within: float = 0.01
    mistakes: Mistakes = field(default_factory=dict)

    def _near(self, given: Float64, wanted: ArrayLike) -> bool:
        there = np.asarray(wanted, float)
        if given.shape != there.shape:
            return False
        return bool(np.max(np.abs(given - there)) <= self.within * np.max(np.abs(there)))

    def judge(self, given: Any) -> Verdict:
        """Judge several numbers.

        Parameters
        ----------
        given : array_like of float

        Returns
        -------
        Verdict

        Examples
        --------
        >>> Array([[0.0, 1.0], [2.0, 0.0]]).judge([[0, 2], [1, 0]])
        Not yet. It is transposed: rows and columns are exchanged.
        """
        right = np.asarray(self.right, float)
        try:
            numbers = _floats(given)
        except (TypeError, ValueError, OverflowError):
            return Verdict(False, f"Numbers are asked for, not {type(given).__name__}.")
        if numbers.shape != right.shape:
            return misshapen(right.shape, numbers.shape)
        if not np.isfinite(numbers).all():
            return Verdict(False, "Not yet. Some of your numbers are not finite.")
        if self._near(numbers, right):
            return Verdict(True, "Right.")
        return _named(numbers, self.mistakes, self._usual(), self._near)

    def right_answer(self) -> Float64:
        """Return the right numbers.

        Returns
        -------
        (...) float64
        """
        return np.array(self.right, float)

    def wrong_answers(self) -> Iterator[tuple[str, Float64]]:
        """Yield mistakes and their numbers, the exercise's own first.

        Yields
        ------
        tuple of (str, ndarray)
        """
        yield from self.mistakes.items()
        yield from self._usual()

    def _usual(self) -> Iterator[tuple[str, Float64]]:
        right = self.right_answer()
        if right.ndim == 2 and right.shape[0] == right.shape[1]:
            yield "It is transposed: rows and columns are exchanged.", right.T
        if right.ndim == 1 and len(right) > 1:
            yield "The order of your numbers is reversed.", right[::-1]
        yield from _usual(right, self.unit)


@dataclass(frozen=True)
class Choice:
    """One of a few words.

    Parameters
    ----------
    right : str
    wrong : mapping of str to str
        The other words, and why each is not the answer.
    """

    right: str
    wrong: Mapping[str, str]

    def judge(self, given: Any) -> Verdict:
        """Judge a word.

        Parameters
        ----------
        given : str

        Returns
        -------
        Verdict

        Examples
        --------
        >>> Choice("near", {"far": "Far things move less."}).judge("far")
        Not yet. Far things move less.
        """
        word = str(given).strip().casefold()
        if word == self.right.casefold():
            return Verdict(True, "Right.")
        for other, why in self.wrong.items():
            if word == other.casefold():
                return mistaken(why)
        return Verdict(False, f"Answer with one of these words: {listed(sorted([self.right, *self.wrong]))}.")

    def right_answer(self) -> str:
        """Return the right word.

        Returns
        -------
        str
        """
        return self.right

    def wrong_answers(self) -> Iterator[tuple[str, str]]:
        """Yield why a word is wrong, and the word.

        Yields
        ------
        tuple of (str, str)
        """
        yield from ((why, word) for word, why in self.wrong.items())
