"""Verdicts: what is right, what a wrong answer came from, and what is no answer at all."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

from stereolib.exercises import Array, Choice, Function, Number


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (70.0, "10 times too small. Is it in mm"),
        (0.7, "1000 times too small. Is it in mm"),
        (-700.0, "The sign is wrong"),
        (350.0, "half of the right one"),
        (1400.0, "twice the right one"),
        (793.0, "off by the baseline"),
        (123.0, "none of the usual mistakes"),
        (float("nan"), "not finite"),
        ("far", "A number is asked for, not str"),
        ([1, 2], "A number is asked for, not list"),
        (len, "A number is asked for"),
    ],
)
def test_a_wrong_number_is_told_what_it_came_from(given: Any, said: str) -> None:
    verdict = Number(700.0, "mm", mistakes={"It is off by the baseline.": 793.0}).judge(given)
    assert not verdict and said in verdict.text


@pytest.mark.parametrize("given", [700, 705.0, np.float32(698), np.array([[700.0]])[0, 0], np.array(700)])
def test_a_right_number_may_be_rounded_and_of_any_kind(given: Any) -> None:
    assert Number(700.0, "mm").judge(given)


def test_a_count_has_no_unit_to_mistake() -> None:
    assert "usual" in Number(16.0, "", 0.0, off=0.01).judge(160).text


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ([[0, 2], [1, 0]], "transposed"),
        ([[0, -1], [-2, 0]], "sign"),
        ([0, 1, 2, 0], r"shape (2, 2) is asked for, yours is (4,)"),
        ([[0, 1], [np.inf, 0]], "not finite"),
        ("E", "Numbers are asked for"),
        ([[5, 5], [5, 5]], "none of the usual"),
    ],
)
def test_a_wrong_matrix_is_told_what_it_came_from(given: Any, said: str) -> None:
    verdict = Array([[0.0, 1.0], [2.0, 0.0]]).judge(given)
    assert not verdict and said in verdict.text


def test_a_vector_may_be_reversed() -> None:
    answer = Array([3.0, 4.0, 5.0], "mm")
    assert answer.judge((3, 4, 5)) and "reversed" in answer.judge([5, 4, 3]).text


def test_a_word_that_is_no_choice_is_told_the_choices() -> None:
    answer = Choice("near", {"far": "Far things move less."})
    assert answer.judge(" Near ") and "Far things" in answer.judge("far").text
    assert answer.judge(3).text == "Answer with one of these words: far, near."


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
        (lambda values, by: None, "returns nothing"),
        (lambda values, by: {"a": 1}, "returns dict, not numbers"),
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


def test_both_mistakes_that_lead_to_one_answer_are_told() -> None:
    verdict = Number(9.0, "", mistakes={"First.": 4.0, "Second.": 4.0, "Third.": 5.0}).judge(4)
    assert verdict.text == "Not yet. First. Or: Second."


def test_inputs_are_drawn_again_until_a_mistake_shows() -> None:
    drawn: list[float] = []

    def seldom(rng: np.random.Generator) -> tuple[float]:
        drawn.append(float(len(drawn) >= 30))
        return (drawn[-1],)

    answer = Function(lambda x: 2 * x, seldom, mistakes={"It is the double.": lambda x: x})
    assert not answer.judge(lambda x: x) and len(drawn) == 36
