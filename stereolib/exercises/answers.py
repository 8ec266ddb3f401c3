"""The kinds of answers, and what a wrong one probably came from: a number, an array, a choice, a function.

A mistake has a name, which is a sentence for the student, and the answer to which it leads, computed from the same
numbers as the right one. Those that any quantity allows (another unit, the sign, half of it) are added here.
"""

from __future__ import annotations

import copy
import inspect
import warnings
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
_TRIALS = 12  # random inputs on which a function is tried
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


def _wrong(mistake: str) -> Verdict:
    return Verdict(False, f"Not yet. {mistake}", mistake)


def _named(given: Any, own: Mistakes, usual: Iterator[tuple[str, Any]], near: Callable[[Any, Any], bool]) -> Verdict:
    """All of the exercise's own mistakes that lead to the given answer; else the first usual one that does."""
    if found := [mistake for mistake, result in own.items() if near(given, result)]:
        return _wrong(OR.join(found))
    for mistake, result in usual:
        if near(given, result):
            return _wrong(mistake)
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
            number = float(np.asarray(given, float))  # also an array of one number; a text raises
        except (TypeError, ValueError):
            return Verdict(False, f"A number is asked for, not {type(given).__name__}.")
        if not np.isfinite(number):
            return Verdict(False, "Your number is not finite: something was divided by zero, or is missing.")
        if self._near(number, self.right):
            return Verdict(True, "Right.")
        return _named(number, self.mistakes, _usual(self.right, self.unit), self._near)

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
            numbers = np.asarray(given, float)
        except (TypeError, ValueError):
            return Verdict(False, f"Numbers are asked for, not {type(given).__name__}.")
        if numbers.shape != right.shape:
            return Verdict(False, f"Not yet. The shape {right.shape} is asked for, yours is {numbers.shape}.")
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
                return _wrong(why)
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


@dataclass(frozen=True)
class Function:
    """A function, tried on random inputs.

    Parameters
    ----------
    twin : callable
        Does what is asked for.
    draw : callable
        From a random generator to the arguments of one call.
    rules : mapping of str to callable
        Sentences, and whether a result (first argument) obeys them for the other arguments.
    mistakes : mapping of str to callable
        Functions as they come out by the usual mistakes.
    off : float
        By which each number may be off, as a share of the largest.
    """

    twin: Callable[..., Any]
    draw: Callable[[np.random.Generator], tuple[Any, ...]]
    rules: Mapping[str, Callable[..., bool]] = field(default_factory=dict)
    mistakes: Mistakes = field(default_factory=dict)
    off: float = 1e-5

    def judge(self, given: Any) -> Verdict:
        """Judge a function on inputs that are drawn anew each time.

        Parameters
        ----------
        given : callable

        Returns
        -------
        Verdict

        Examples
        --------
        >>> half = Function(lambda x: x / 2, lambda rng: (rng.uniform(1, 2),), mistakes={"Twice.": lambda x: 2 * x})
        >>> half.judge(lambda x: x + x)
        Not yet. Twice.
        """
        if not callable(given):
            return Verdict(False, "A function is asked for: give its name, without brackets.")
        with warnings.catch_warnings(), np.errstate(all="ignore"):  # on stderr they would cost points
            warnings.simplefilter("ignore")
            return self._tried(given, np.random.default_rng())  # seeded by the system: no input can be foreseen

    def _tried(self, given: Callable[..., Any], rng: np.random.Generator) -> Verdict:
        inputs, results = self.inputs(rng), []
        for one in inputs:
            try:
                results.append(_call(given, one))
            except Exception as error:
                why = f"{type(error).__name__}: {error}. It was called with {self._described(one)}."
                return Verdict(False, f"Not yet. Your function stops with {why}")
        if any(changed for _, changed in results):
            return _wrong("Your function changes its input: work on a copy.")
        outputs = [output for output, _ in results]
        if any(output is None for output in outputs):
            return Verdict(False, "No answer yet: your function returns nothing.")
        if not all(_is_numbers(output) for output in outputs):
            return Verdict(False, f"Not yet. Your function returns {type(outputs[0]).__name__}, not numbers.")
        for mistake, function in {"": self.twin, **self.mistakes}.items():
            if all(self._same(mine, function(*one)) for mine, one in zip(outputs, inputs, strict=True)):
                return _wrong(mistake) if mistake else Verdict(True, "Right.")
        return self._unnamed([np.asarray(output, float) for output in outputs], inputs)

    def inputs(self, rng: np.random.Generator) -> list[tuple[Any, ...]]:
        """Draw the inputs of one trial, anew until each mistake shows on some of them.

        Parameters
        ----------
        rng : numpy.random.Generator

        Returns
        -------
        list of tuple
        """
        while True:
            inputs = [self.draw(rng) for _ in range(_TRIALS)]
            if not any(self._agree(function, inputs) for function in self.mistakes.values()):
                return inputs

    def _agree(self, function: Callable[..., Any], inputs: list[tuple[Any, ...]]) -> bool:
        return all(self._same(function(*one), self.twin(*one)) for one in inputs)

    def _described(self, inputs: tuple[Any, ...]) -> str:
        """What a call got, by the names of the arguments."""
        names = inspect.signature(self.twin).parameters
        return "; ".join(f"{name} = {_size(value)}" for name, value in zip(names, inputs, strict=True))

    def _unnamed(self, outputs: list[Float64], inputs: list[tuple[Any, ...]]) -> Verdict:
        """Say of a wrong function which rule it breaks, or what it should have returned."""
        wanted = np.asarray(self.twin(*inputs[0]))
        if outputs[0].shape != wanted.shape:
            return Verdict(False, f"Not yet. The shape {wanted.shape} is asked for, yours is {outputs[0].shape}.")
        for rule, holds in self.rules.items():
            if not all(holds(mine, *one) for mine, one in zip(outputs, inputs, strict=True)):
                return Verdict(False, f"Not yet. {rule}")
        return Verdict(False, "Not yet, and it is none of the usual mistakes. Try it on a small input by hand.")

    def _same(self, mine: Any, wanted: Any) -> bool:
        ours, theirs = np.asarray(mine, float), np.asarray(wanted, float)
        if ours.shape != theirs.shape:
            return False
        size = np.abs(theirs[np.isfinite(theirs)]).max(initial=0.0)
        return bool(np.allclose(ours, theirs, rtol=0, atol=self.off * size, equal_nan=True))

    def right_answer(self) -> Callable[..., Any]:
        """Return a function that is right.

        Returns
        -------
        callable
        """
        return self.twin

    def wrong_answers(self) -> Iterator[tuple[str, Callable[..., Any]]]:
        """Yield mistakes and the functions that make them.

        Yields
        ------
        tuple of (str, callable)
        """
        yield from self.mistakes.items()


def _size(value: Any) -> str:
    """A number or a few as they are; of more the shape, and how many of them are NaN."""
    if np.size(value) < 6 or isinstance(value, bytes):
        return np.array2string(np.asarray(value), precision=4, separator=", ") if np.ndim(value) else repr(value)
    holes = np.count_nonzero(np.isnan(np.asarray(value, float)))
    return f"an array of shape {np.shape(value)}, {holes or 'none'} of it NaN"


def _is_numbers(output: Any) -> bool:
    try:
        return np.asarray(output, float) is not None
    except (TypeError, ValueError):
        return False


def _call(function: Callable[..., Any], inputs: tuple[Any, ...]) -> tuple[Any, bool]:
    """What a function returns, and whether it changed what it was given."""
    handed = copy.deepcopy(inputs)
    output = function(*handed)
    changed = any(not _is_equal(after, before) for after, before in zip(handed, inputs, strict=True))
    return output, changed


def _is_equal(after: Any, before: Any) -> bool:
    if isinstance(before, np.ndarray):
        return np.array_equal(after, before, equal_nan=True)
    return bool(after == before)
