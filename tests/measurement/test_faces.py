"""Which part of an object's disparities is a face: one line, two that meet, and steps beside them."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib.measurement.faces import _hinge

T = np.linspace(-0.2, 0.2, 161)
FULL = np.full(T.size, 40)


def drawn(w, seed=1):
    return w + 0.1 * np.random.default_rng(seed).standard_normal(T.size)


def test_one_face_is_one_line_and_two_that_meet_in_front_are_two():
    ((ends, line),) = _hinge(T, drawn(80 + 20 * T), FULL)
    assert ends == (T[0], T[-1]) and line == pytest.approx([80, 20], abs=0.5)
    pieces = _hinge(T, drawn(80 + np.minimum(30 * T, -60 * T)), FULL)
    assert [line[1] for _, line in pieces] == pytest.approx([30, -60], abs=2)
    assert pieces[0][0][1] == pieces[1][0][0] == pytest.approx(0.0, abs=0.01)
    assert len(_hinge(T, drawn(80 + np.maximum(30 * T, -60 * T)), FULL)) == 1  # two that meet behind are no box's


@pytest.mark.parametrize("step", [-18.0, -12.0, 15.0])
@pytest.mark.parametrize("share", [0.1, 0.3])
def test_what_lies_behind_or_before_a_step_is_left_out(step, share):
    """As matches beside an outline and neighbours do; the rest is split as if it were alone."""
    beside = int(share * T.size)
    w = 80 + np.minimum(30 * (T - 0.08), -60 * (T - 0.08))
    w[:beside] = w[beside] + step - 5 * (T[:beside] - T[beside])
    pieces = _hinge(T, drawn(w), FULL)
    assert [line[1] for _, line in pieces] == pytest.approx([30, -60], abs=2.5)
    assert pieces[0][0][0] == pytest.approx(T[beside], abs=0.01) and pieces[1][0][1] == T[-1]


def test_of_both_sides_of_a_step_the_one_with_more_pixels_is_taken():
    w, few = np.where(T < 0, 60.0, 90.0), np.where(T < 0, 40, 3)
    ((ends, line),) = _hinge(T, drawn(w), few)
    assert line[0] == pytest.approx(60, abs=0.5) and ends[1] < 0
    ((ends, line),) = _hinge(T, drawn(w), 43 - few)
    assert line[0] == pytest.approx(90, abs=0.5) and ends[0] >= 0
