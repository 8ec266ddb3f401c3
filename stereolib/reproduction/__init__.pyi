from .code_hash import code_sha256
from .execution import NotebookError, execute_notebooks
from .kernels import ONE_THREAD
from .own_rig import report_rig
from .readme_tables import update_readme_tables
from .regenerate import reproduce
from .report import build_report, by_cause, count_kinds, count_verdicts, sort_out
from .same_numbers import REPEAT_RTOL, compare_tables

__all__ = [
    "ONE_THREAD",
    "REPEAT_RTOL",
    "NotebookError",
    "build_report",
    "by_cause",
    "code_sha256",
    "compare_tables",
    "count_kinds",
    "count_verdicts",
    "execute_notebooks",
    "report_rig",
    "reproduce",
    "sort_out",
    "update_readme_tables",
]
