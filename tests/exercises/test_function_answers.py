"""Verdicts on functions: what is right, what is wrong with a wrong one, and on what it was tried."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

from stereolib.exercises import Function


def larger(values: Any, by: float) -> Any:
    return values + by


ANSWER = Function(
    larger,
    lambda rng: (rng.uniform(1, 2, (3, 3)), float(rng.uniform(1, 2))),
    rules={"All must be larger.": lambda out, values, by: bool((out > values).all())},
    mistakes={"The sign is wrong.": lambda values, by: values - by},
)


def in_place(values: Any, by: float) -> Any:
    values += by
    return values


def breaks(values: Any, by: float) -> Any:
    raise KeyError("depth")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (lambda values, by: values - by, "The sign is wrong"),
        (lambda values, by: values * 0, "All must be larger"),
        (lambda values, by: values + by + 1, "none of the usual"),
        (lambda values, by: values.ravel() + by, "The shape (3, 3) is asked for, yours is (9,)"),
        (
            lambda values, by: values + by if by < 1.5 else 3.0,
            "The shape (3, 3) is asked for, yours is a single number",
        ),
        (lambda values, by: None, "returns nothing"),
        (lambda values, by: {"a": 1}, "returns dict, not numbers"),
        (lambda values, by: 10**400, "returns int, not numbers"),
        (lambda values: values, "stops with TypeError"),
        (in_place, "changes its input"),
        (breaks, "stops with KeyError: 'depth'. It was called with values = an array of shape (3, 3), none of it NaN"),
        (3.0, "A function is asked for"),
    ],
)
def test_a_wrong_function_is_told_what_is_wrong_with_it(given: Any, said: str) -> None:
    verdict = ANSWER.judge(given)
    assert not verdict and said in verdict.text


def test_a_right_function_may_warn_and_answer_in_lists() -> None:
    def mine(values: Any, by: float) -> Any:
        warnings.warn("slow", stacklevel=1)
        _ = np.zeros(1) / 0
        return (values + by).tolist()

    assert ANSWER.judge(mine)


def test_one_number_may_come_in_an_array() -> None:
    answer = Function(lambda x: x / 2, lambda rng: (rng.uniform(1, 2),))
    assert answer.judge(lambda x: np.array([x / 2]))
    assert answer.judge(lambda x: [x]).text.startswith("Not yet, and it is none")
    assert "A single number is asked for, yours is (2,)" in answer.judge(lambda x: [x, x]).text


def test_a_function_that_knows_only_some_inputs_is_found_out() -> None:
    """Inputs are new each time: results of an earlier check are worth nothing."""
    seen: list[Any] = []

    def remembers(values: Any, by: float) -> Any:
        seen.append(values)
        return values + by

    assert ANSWER.judge(remembers) and ANSWER.judge(remembers)
    assert len({array.tobytes() for array in seen}) == len(seen)


def test_the_input_on_which_a_function_stops_is_described() -> None:
    answer = Function(
        lambda depth_mm, f_px, data: 0.0, lambda rng: (np.array([[np.nan] * 4 + [2.0] * 4]), 700.0, b"ab")
    )
    text = answer.judge(breaks_on_holes).text
    assert "depth_mm = an array of shape (1, 8), 4 of it NaN; f_px = 700.0; data = b'ab'" in text


def breaks_on_holes(depth_mm: Any, f_px: float, data: bytes) -> float:
    return [1.0][int(np.isnan(depth_mm).sum())]


def test_inputs_are_drawn_again_until_a_mistake_shows() -> None:
    drawn: list[float] = []

    def seldom(rng: np.random.Generator) -> tuple[float]:
        drawn.append(float(len(drawn) >= 30))
        return (drawn[-1],)

    answer = Function(lambda x: 2 * x, seldom, mistakes={"It is the double.": lambda x: x})
    assert not answer.judge(lambda x: x) and len(drawn) == 36
