from .answers import Array, Choice, Number, Verdict
from .asking import Exercise, WrongAnswer, exercise, exercise_numbers, handed_in_by
from .function_answers import Function
from .sheets import SHEETS, make_sheet
from .tampering import REFUSED_NAMES, refuse_tampering
from .tasks import Recipe, Task, task

__all__ = [
    "REFUSED_NAMES",
    "SHEETS",
    "Array",
    "Choice",
    "Exercise",
    "Function",
    "Number",
    "Recipe",
    "Task",
    "Verdict",
    "WrongAnswer",
    "exercise",
    "exercise_numbers",
    "handed_in_by",
    "make_sheet",
    "refuse_tampering",
    "task",
]
