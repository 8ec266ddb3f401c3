"""Verdicts: what is right, what a wrong answer came from, and what is no answer at all."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from stereolib.exercises import Array, Choice, Number


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
        (710.0, "none of the usual mistakes"),
        ("far", "A number is asked for, not str"),
        ("700", "A number is asked for, not str"),
        (10**400, "A number is asked for, not int"),
        ([1, 2], "A number is asked for, not list"),
        (len, "A number is asked for"),
    ],
)
def test_a_wrong_number_is_told_what_it_came_from(given: Any, said: str) -> None:
    verdict = Number(700.0, "mm", mistakes={"It is off by the baseline.": 793.0}).judge(given)
    assert not verdict and said in verdict.text


@pytest.mark.parametrize("given", [700, 705.0, np.float32(698), np.array([[700.0]])[0, 0], np.array(700), [700]])
def test_a_right_number_may_be_rounded_and_of_any_kind(given: Any) -> None:
    assert Number(700.0, "mm").judge(given)


@pytest.mark.parametrize("given", [0.14, 0.145])
def test_too_few_digits_are_told_from_a_mistake(given: float) -> None:
    assert "Give four digits" in Number(0.14459, "mm", 0.002).judge(given).text
    assert "Give four digits" not in Number(0.14459, "mm", 0.002, {"The half.": given}).judge(given).text
    assert Number(0.14459, "mm", 0.002).judge(0.1446)


def test_a_count_is_not_rounded() -> None:
    assert "usual" in Number(112.0, "", 0.0, off=0.01).judge(110).text


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
        (["0", "1"], "Numbers are asked for"),
        (1.0, "yours is a single number"),
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


def test_both_mistakes_that_lead_to_one_answer_are_told() -> None:
    verdict = Number(9.0, "", mistakes={"First.": 4.0, "Second.": 4.0, "Third.": 5.0}).judge(4)
    assert verdict.text == "Not yet. First. Or: Second."
