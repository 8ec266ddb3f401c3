"""Work for a finger that moves: nothing queues, the last value is shown, and a fault does not end it."""

from __future__ import annotations

import threading

import pytest

from stereolib.notebook.latest import Latest


def test_of_a_hundred_values_few_are_shown_and_the_last_is():
    quick, full, started = [], [], threading.Event()
    go_on = threading.Event()

    def show(value):
        quick.append(value)
        started.set()
        go_on.wait(5)

    worker = Latest(show, lambda value, is_old: full.append(value), rest_s=0.02)
    worker.ask(0)
    assert started.wait(5)
    for value in range(1, 100):  # while the first is still being drawn
        worker.ask(value)
    go_on.set()
    assert worker.settle(10)
    assert quick == [0, 99] and full == [99]


def test_full_work_is_told_that_it_is_old():
    told, begun = [], threading.Event()

    def full(value, is_old):
        told.append((value, is_old()))
        if value == 1:
            begun.set()
            assert asked.wait(5)
            told.append((value, is_old()))

    asked = threading.Event()
    worker = Latest(lambda value: None, full, rest_s=0.0)
    worker.ask(1)
    assert begun.wait(5)
    worker.ask(2)
    asked.set()
    assert worker.settle(10)
    assert told == [(1, False), (1, True), (2, False)]


def test_a_fault_is_printed_and_the_next_value_is_shown(capsys: pytest.CaptureFixture[str]):
    shown = []

    def show(value):
        if value == 1:
            raise RuntimeError("a broken picture")
        shown.append(value)

    worker = Latest(show, lambda value, is_old: show(value), rest_s=0.0)
    worker.ask(1)
    assert worker.settle(10)
    worker.ask(2)
    assert worker.settle(10)
    assert shown == [2, 2]
    assert capsys.readouterr().err.count("a broken picture") == 4  # twice, each with the line that raises it


def test_settling_is_given_up_after_its_time():
    release = threading.Event()
    worker = Latest(lambda value: release.wait(5), lambda value, is_old: None, rest_s=0.0)
    worker.ask(1)
    assert not worker.settle(0.05)
    release.set()
    assert worker.settle(10)
