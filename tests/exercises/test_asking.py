"""Every exercise, with the numbers of several students: right answers, the usual wrong ones, hints, names."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support.solved_exercises import SOLVED, cheapest_ways
from test_course import GRADES, grade

from stereolib import laser
from stereolib.exercises import SHEETS, Choice, Function, WrongAnswer, asking, exercise, exercise_numbers, handed_in_by
from stereolib.exercises.answers import OR
from stereolib.exercises.asking import CHAPTERS, recipe_of, recipes
from stereolib.exercises.chapter_05 import decoding
from stereolib.matching import disparity_to_depth
from stereolib.paper import printed_value
from stereolib.virtual import recordings

READ_OFF = {"05.1", "06.1", "07.1"}  # some of their numbers stand in the picture alone
STUDENTS = ["", "anna", "Ben", "çelik", "d. e."]
CLASS = [f"student {k}" for k in range(60)]

each_exercise = pytest.mark.parametrize("number", exercise_numbers())


def answer_of(number: str, student: str = "") -> Any:
    """What judges an exercise."""
    return exercise(number, student)._task.answer


def said(one: Any, answer: Any) -> str:
    """What a student reads."""
    try:
        return str(one.check(answer))
    except WrongAnswer as wrong:
        return "\n".join(wrong._render_traceback_())  # what a notebook shows of it


def test_each_chapter_has_five_or_more() -> None:
    assert list(SHEETS) == CHAPTERS
    assert all(len(recipes(chapter)) >= 5 for chapter in CHAPTERS)


@each_exercise
def test_right_and_wrong_answers_of_several_students(number: str) -> None:
    told: set[str] = set()
    own: set[str] = set()
    for student in STUDENTS:
        one, answer = exercise(number, student), answer_of(number, student)
        assert one.check(answer.right_answer()).text == "Right."
        for mistake, wrong in answer.wrong_answers():
            text = said(one, wrong)
            assert text.startswith("Not yet. "), mistake
            told |= set(text.removeprefix("Not yet. ").split(OR))
        own |= set(answer.wrong.values() if isinstance(answer, Choice) else answer.mistakes)
        if isinstance(answer, Function):  # their mistakes do not depend on the student
            break
    assert len(own) >= 2
    assert own <= told  # each is recognised as what it is


@each_exercise
def test_no_usual_mistake_is_right_for_anyone_in_a_class(number: str) -> None:
    for k, student in enumerate(CLASS):
        answer = answer_of(number, student)
        if isinstance(answer, Function):
            inputs = answer.inputs(np.random.default_rng(k))
            passed = [why for why, wrong in answer.wrong_answers() if answer._agree(wrong, inputs)]
        else:
            passed = [why for why, wrong in answer.wrong_answers() if answer.judge(wrong)]
        assert not passed, (student, passed)


def place(g: Any, left: Any, right: Any) -> Any:
    Z = g.f_px * g.B_mm / (left[0] - right[0])
    return np.array([*(np.subtract(left, g.centre_px) * Z / g.f_px), Z])


def darker(square: Any, middle: int) -> Any:
    return np.delete(square, 4) < middle


# Slips of students who tried the exercises, computed from what is given and not from the exercise's own mistakes.
SLIPS = {
    "00.3": lambda g: float(
        np.linalg.norm(np.subtract(place(g, g.top_left, g.top_right), place(g, g.foot_left, g.foot_right))[1:])
    ),
    "03.3": lambda g: abs(int(darker(g.left, g.left[1, 1]).sum()) - int(darker(g.right, g.right[1, 1]).sum())),
    "03.4": lambda g: cheapest_ways(SimpleNamespace(**vars(g) | {"P1": g.P2})),  # a step then costs as much as a jump
    "01.1": lambda g: float(np.sqrt((len(g.moves_px) - 1) / len(g.moves_px) * np.sum(g.moves_px**2))),
    "03.2": lambda g: g.f_px * g.B_mm / g.Z_mm,
    "06.5": lambda g: 2 * float(np.linalg.norm(g.parts_mm)),
    "08.4": lambda g: float(np.hypot(*g.stds_mm)) / 2,
    "06.3": lambda g: g.B_mm / abs(np.linalg.solve(np.column_stack([g.places_px, np.ones(3)]), g.d_px)[1]),
}


@pytest.mark.parametrize("number", SLIPS)
def test_slips_of_students_are_wrong_for_a_whole_class(number: str) -> None:
    for student in CLASS:
        one = exercise(number, student)
        text = said(one, SLIPS[number](one.given))
        assert text.startswith("Not yet. ") and "none of the usual" not in text, (student, text)


def test_the_nearest_thing_is_no_nearer_than_the_last_disparity_tried() -> None:
    for k in range(400):
        g, count = exercise("03.2", f"s{k}").given, answer_of("03.2", f"s{k}").right_answer()
        assert count - 17 < g.f_px * g.B_mm / g.Z_mm <= count - 1


@each_exercise
def test_students_get_other_numbers(number: str) -> None:
    questions = {repr(exercise(number, student)) + str(exercise(number, student).given) for student in STUDENTS}
    answers = {str(answer_of(number, student).right_answer()) for student in STUDENTS}
    assert len(questions | answers) > 2 or isinstance(answer_of(number), Function)


def test_a_whole_class_gets_numbers_that_can_be() -> None:
    """Of 05.5 the least whole number, also where the ratio is one; of 07.4 a foot that is inside the picture."""
    for k in range(400):
        turns = exercise("05.5", f"turns {k}")
        one, wanted = (round(10 * mm) for mm in (turns.given.one_mm, turns.given.wanted_mm))
        assert turns.check(-(-one * one // (wanted * wanted)))
        assert answer_of("07.4", f"foot {k}").right_answer() > 0


def test_paper_distance_is_not_asked_for() -> None:
    """There the chapter prints what is to be read."""
    for student in CLASS:
        assert abs(answer_of("07.1", student).right_answer() / printed_value("scale.cm_per_px") - 1) > 0.03, student


def test_way_by_two_depths_is_right_too() -> None:
    """The worth of a pixel by two disparities a pixel apart, and not by the slope."""
    for student in CLASS:
        one, far = exercise("00.4", student), exercise("02.3", student)
        Z_mm, worth_mm = 1000 * one.given.Z_m, one.given.worth_mm
        assert one.check(Z_mm * (Z_mm + worth_mm) / (one.given.f_px * worth_mm))
        f_B, off_mm, off_px = far.given.f_px * far.given.B_mm, far.given.off_mm, far.given.off_px
        assert far.check((off_mm + np.sqrt(off_mm**2 + 4 * off_mm * f_B / off_px)) / 2000)


def test_what_is_given_cannot_be_spoilt() -> None:
    one = exercise("03.4", "spoiler")
    one.given.costs[:] = 0
    assert one.given.costs.any() and exercise("03.4", "spoiler").given.costs.any()


def test_each_answer_of_a_sheet_has_its_own_name() -> None:
    for chapter in CHAPTERS:
        names = [recipe.answer_name for recipe in recipes(chapter)]
        assert len(names) == len(set(names)), names


@each_exercise
def test_what_it_says_is_plain_and_whole(number: str) -> None:
    recipe, one = recipe_of(number), exercise(number, "anna")
    assert 2 <= recipe.minutes <= 40 and 1 <= recipe.points <= 3
    assert recipe.goal[0].islower() and not recipe.goal.endswith(".")
    assert len(recipe.hints) == 2 and recipe.hints[0] != recipe.hints[1]
    assert "**" in one._repr_markdown_()  # what is asked for stands out
    assert recipe.start.startswith(("def ", f"{recipe.answer_name} = None  # "))
    assert recipe.start.startswith("def ") == isinstance(answer_of(number), Function)
    assert recipe.has_picture == (one._task.draw is not None)


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_sentences_are_for_readers_at_school(chapter: int) -> None:
    numbers = exercise_numbers(chapter)
    said = [recipe_of(number).goal + ". " + " ".join(recipe_of(number).hints) for number in numbers]
    said += [exercise(number)._task.question.split("\n\n")[0] for number in numbers]
    said += [mistake for number in numbers for mistake, _ in answer_of(number).wrong_answers()]
    assert grade(" ".join(said)) <= GRADES[1]


def test_answers_differ_between_neighbours_and_repeat_for_the_same_name() -> None:
    right = answer_of("00.2", "André").right_answer()
    assert right == answer_of("00.2", " Andre\N{COMBINING ACUTE ACCENT} ").right_answer()
    assert right != answer_of("00.2", "andré").right_answer()
    assert said(exercise("00.2", "ben"), right).startswith("Not yet")


def test_a_name_that_was_left_in_is_told_at_once() -> None:
    assert "Write your own name" in exercise("00.2", " reader")._repr_markdown_()
    assert "Write your own name" not in exercise("00.2", "anna")._repr_markdown_()


def test_hints_come_in_two_steps() -> None:
    one = exercise("00.4", "hints")
    first, second = one.hint(), one.hint()
    assert first != second
    assert one.hint() == one.hint() == "There are only two hints."


@pytest.mark.parametrize("number", ["9.1", "00.99", "", "left", "00.0", "00.-1"])
def test_an_unknown_number_is_refused(number: str) -> None:
    with pytest.raises(ValueError, match=rf"no exercise '{number}'; they run from 00\.1 to 08\.\d"):
        exercise(number)


@pytest.mark.parametrize("number", [number for number in exercise_numbers() if recipe_of(number).has_picture])
def test_figure_of_another_student_is_another_one(number: str) -> None:
    figures = [exercise(number, student)._task.draw() for student in ("anna", "dora")]
    assert all(len(alt) > 40 and figure.axes for figure, alt in figures)
    drawn = [[line.get_xydata().tolist() for line in figure.axes[0].lines] for figure, _ in figures]
    shown = [[image.get_array().mean() for image in figure.axes[0].images] for figure, _ in figures]
    assert drawn[0] != drawn[1] or shown[0] != shown[1]


def test_picture_says_what_there_is_to_see() -> None:
    picture = exercise("02.1", "anna").picture()
    assert picture.data.startswith(b"\x89PNG") and "tilted line" in picture.alt


def test_a_missing_picture_is_refused() -> None:
    with pytest.raises(ValueError, match=r"00\.2 has no picture"):
        exercise("00.2").picture()


@pytest.mark.parametrize("empty", [None, ...])
def test_no_answer_is_said_to_be_none(empty: Any) -> None:
    assert said(exercise("00.2"), empty) == "No answer yet."


def test_a_wrong_answer_raises_without_nbgrader_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NBGRADER_EXECUTION", raising=False)
    right = answer_of("00.2", "anna").right_answer()
    assert exercise("00.2", "anna").check(right)
    with pytest.raises(WrongAnswer, match="10 times too large"):
        exercise("00.2", "anna").check(10 * right)


def test_numbers_of_another_student_are_refused_when_graded() -> None:
    with pytest.raises(WrongAnswer, match="numbers of 'anna', and 'ben' handed them in"):
        handed_in_by("ben", "anna")
    assert handed_in_by("ben", " ben ") == "ben"


def test_a_notebook_says_at_once_which_cell_will_not_be_run(monkeypatch: pytest.MonkeyPatch) -> None:
    from IPython.core.interactiveshell import InteractiveShell
    from IPython.utils.capture import capture_output

    shell = InteractiveShell()
    monkeypatch.setattr("IPython.get_ipython", lambda: shell)
    asking._watch.cache_clear()
    try:
        exercise("00.2", "anna")
        with capture_output() as honest:
            shell.run_cell("import sys\ndepth_mm = 3")
        with capture_output() as cheating:
            shell.run_cell("exercise = print")
    finally:
        shell.history_manager.end_session()
        asking._watch.cache_clear()
    assert honest.stdout == ""
    assert "will not run this cell, because it gives the name exercise a new meaning" in cheating.stdout


@pytest.mark.parametrize("number", SOLVED)
def test_given_numbers_lead_to_the_answer(number: str) -> None:
    """What the student's code gets is enough, and another way of computing it comes to the same."""
    for student in STUDENTS:
        one = exercise(number, student)
        assert one.check(SOLVED[number](one.given)), student


def test_every_exercise_with_given_numbers_is_solved() -> None:
    assert {number for number in exercise_numbers() if vars(exercise(number).given)} - set(SOLVED) == READ_OFF


def test_right_functions_obey_the_rules_that_are_told() -> None:
    functions = {number: answer for number in exercise_numbers() if isinstance(answer := answer_of(number), Function)}
    for number, answer in functions.items():
        rng = np.random.default_rng(19)
        for inputs in (answer.draw(rng) for _ in range(20)):
            result = np.asarray(answer.twin(*inputs), float)
            broken = [rule for rule, holds in answer.rules.items() if not holds(result, *inputs)]
            assert not broken, (number, broken)
    assert len(functions) > 1


def test_wall_and_place_are_the_librarys() -> None:
    rng = np.random.default_rng(8)
    line, place = answer_of("08.5"), answer_of("00.6")
    for _ in range(20):
        (points,) = line.draw(rng)
        wall = laser.fit_line(points)
        np.testing.assert_allclose(line.twin(points), [*wall.normal, wall.offset_mm], atol=1e-6)
        left, right, f_px, B_mm, centre = place.draw(rng)
        Z = disparity_to_depth(np.array([[left[0] - right[0]]]), f_px, B_mm)[0, 0]
        np.testing.assert_allclose(place.twin(left, right, f_px, B_mm, centre), [*(left - centre) * Z / f_px, Z], 1e-5)


def test_decoding_twin_is_the_librarys() -> None:
    """The exercise's own decoding of bytes agrees with the library's on a recording, its flags included."""
    data = laser.encode(laser.decode(recordings.load_laser("lrf/room")))
    packets = [data[k : k + 22] for k in range(0, len(data), 22)]
    found = decoding()(b"".join(packet[4:20] for packet in packets))
    known = laser.decode(data).distance_mm.ravel()
    assert np.isnan(known).any()
    np.testing.assert_array_equal(found, known)


def test_census_costs_have_their_dip_at_the_truth() -> None:
    read = exercise("03.1", "anna")
    best = answer_of("03.1", "anna").right_answer()
    assert said(read, best + 1.9) == "Right." != said(read, best + 2.1)
