"""A function as an answer: tried on inputs drawn anew each time, beside its twin and the usual mistakes."""

from __future__ import annotations

import copy
import inspect
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from stereolib.base import Float64
from stereolib.exercises.answers import Mistakes, Verdict, misshapen, mistaken

_TRIALS = 12  # random inputs on which a function is tried


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
            return mistaken("Your function changes its input: work on a copy.")
        outputs = [output for output, _ in results]
        if any(output is None for output in outputs):
            return Verdict(False, "No answer yet: your function returns nothing.")
        if not all(_is_numbers(output) for output in outputs):
            return Verdict(False, f"Not yet. Your function returns {type(outputs[0]).__name__}, not numbers.")
        numbers = [_as_number(output, self.twin(*one)) for output, one in zip(outputs, inputs, strict=True)]
        for mistake, function in {"": self.twin, **self.mistakes}.items():
            if all(self._same(mine, function(*one)) for mine, one in zip(numbers, inputs, strict=True)):
                return mistaken(mistake) if mistake else Verdict(True, "Right.")
        return self._unnamed(numbers, inputs)

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
        for mine, one in zip(outputs, inputs, strict=True):
            if mine.shape != (wanted := np.shape(self.twin(*one))):
                return misshapen(wanted, mine.shape)
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
    except (TypeError, ValueError, OverflowError):
        return False


def _as_number(mine: Any, wanted: Any) -> Float64:
    """An output as an array; where one number is asked for, an array of one is that number."""
    output = np.asarray(mine, float)
    return output.reshape(()) if output.size == 1 and not np.ndim(wanted) else output


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
