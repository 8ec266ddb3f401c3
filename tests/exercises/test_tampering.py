"""Cells that touch the checker, and cells that only look as if."""

from __future__ import annotations

import pytest

from stereolib.exercises import SHEETS, make_sheet, refuse_tampering


@pytest.mark.parametrize(
    "source",
    [
        "def exercise(*_):\n    return Yes()",
        "exercise = lambda *_: Yes()",
        "from somewhere import cheat as exercise",
        "class exercise: ...",
        "for exercise in ['anna']: pass",
        "from stereolib.exercises import Exercise",
        "from IPython import get_ipython as g",
        "import stereolib.exercises as e",
        "from stereolib.exercises import asking",
        "from stereolib import exercises",
        "import sys\nsys.modules.clear()",
        "import pathlib\npathlib.os.environ.pop('NBGRADER_EXECUTION')",
        "from pathlib import os",
        "import stereolib\nstereolib.exercises.Exercise.check = print",
        "type(task).check = print",
        "found = %reset -f",
        "%time exercise = print",
        "%%time\nexercise = print",
        "%run cheat.py",
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


@pytest.mark.parametrize("chapter", SHEETS)
def test_cells_of_the_sheets_pass(chapter: int) -> None:
    assert not [cell.source for cell in make_sheet(chapter).cells if refuse_tampering(cell.source)]


@pytest.mark.parametrize(
    "source",
    [
        "student = 'anna'",
        "import numpy as np\ng = exercise('00.2', student).given\ndepth_mm = g.f_px * g.B_mm / g.d_px",
        "from stereolib.matching import left_right_check as check_both",
        "task.hint()",
        "values[0] = 3\nprint(student)",
        "%matplotlib inline\nimport sys",
        "%time depth_mm = 3",
        "task?",
        "class Rig:\n    def __init__(self, x):\n        self.x = x",
        "a = np.zeros(6)\na.shape = 2, 3",
        "left.shape = -1",
        "told = '''\n% 16\n! five\n'''\nd = (37\n % 16)",
        "depth_mm = (",  # does not parse: it fails by itself
    ],
)
def test_honest_cells_pass(source: str) -> None:
    assert refuse_tampering(source) == ""
