"""Cells that touch the checker, and cells that only look as if."""

from __future__ import annotations

import pytest

from stereolib.exercises import exercise_numbers, refuse_tampering
from stereolib.exercises.asking import recipe_of


@pytest.mark.parametrize(
    "source",
    [
        "def exercise(*_):\n    return Yes()",
        "exercise = lambda *_: Yes()",
        "from somewhere import cheat as exercise",
        "class exercise: ...",
        "for student in ['anna']: pass",
        "import stereolib.exercises as e",
        "from stereolib.exercises import asking",
        "from stereolib import exercises",
        "import sys",
        "import os.path",
        "import numpy as np\nnp.abs = print",
        "depth_mm = exercise('00.2', 'anna')._task.answer.right",
        "exec('x = 1')",
        "getattr(exercise('00.2'), '_' + 'task')",
        "__import__('sys').modules.clear()",
        "%reset -f",
        "!rm -rf .",
    ],
)
def test_what_touches_the_checker_is_named(source: str) -> None:
    assert refuse_tampering(source).startswith("it ")


@pytest.mark.parametrize(
    "source",
    [
        "import numpy as np\ng = exercise('00.2', student).given\ndepth_mm = g.f_px * g.B_mm / g.d_px",
        "from stereolib.matching import left_right_check as check_both",
        "task.hint()",
        "values[0] = 3\nprint(student)",
        "depth_mm = (",  # does not parse: it fails by itself
        *(recipe_of(number).start for number in exercise_numbers()),
    ],
)
def test_honest_cells_pass(source: str) -> None:
    assert refuse_tampering(source) == ""
