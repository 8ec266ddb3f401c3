"""No verdict on data is safe from the data: each has a test that turns it."""

from __future__ import annotations

from pathlib import Path

from support.verdicts import turned_ids

from stereolib.paper import published


def test_every_verdict_on_data_has_a_test_that_turns_it():
    tests = {id for id, item in published().items() if item.kind == "test"}
    assert tests - turned_ids(Path(__file__).parents[1]) == set()
