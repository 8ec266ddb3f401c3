from .execution import NotebookError, execute
from .regenerate import REPEAT_RTOL, compare_tables, reproduce
from .report import build, tally, update_readme

__all__ = ["REPEAT_RTOL", "NotebookError", "build", "compare_tables", "execute", "reproduce", "tally", "update_readme"]
