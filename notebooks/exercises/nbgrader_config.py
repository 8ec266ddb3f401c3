"""The course for nbgrader; docs/teaching.md says how to use it. Copy it into the course's folder."""

from __future__ import annotations

from typing import Any

from nbgrader.converters import Autograde, GenerateAssignment
from nbgrader.preprocessors import ClearSolutions, NbGraderPreprocessor

from stereolib.exercises import refuse_tampering

c = get_config()  # type: ignore[name-defined]  # noqa: F821 (nbgrader gives it)


class KeepChecksHonest(NbGraderPreprocessor):
    """Stop a cell that touches the checker before it runs, and check with the numbers of who handed the sheet in."""

    def preprocess_cell(self, cell: Any, resources: Any, index: int) -> tuple[Any, Any]:
        """Put lines before the code of such a cell, and of a check, that raise; the feedback says why."""
        if cell.cell_type != "code":
            return cell, resources
        if why := refuse_tampering(cell.source):
            told = f"This cell was not run, because {why}."
            cell.source = f"raise PermissionError({told!r})  # added while grading\n{cell.source}"
        elif cell.metadata.get("nbgrader", {}).get("grade"):
            owner = resources["nbgrader"]["student"]
            cell.source = (
                "from stereolib.exercises import handed_in_by  # this and the next line were added while grading\n"
                f"student = handed_in_by({owner!r}, student)\n{cell.source}"
            )
        return cell, resources


c.CourseDirectory.course_id = "stereo"

# The notebooks come without solutions, and their empty cells are to stay as they are.
c.GenerateAssignment.preprocessors = [
    each for each in GenerateAssignment.preprocessors.default() if each is not ClearSolutions
]
c.Autograde.autograde_preprocessors = [KeepChecksHonest, *Autograde.autograde_preprocessors.default()]

c.Execute.extra_arguments = ["--InteractiveShell.automagic=False"]  # a command begins with %, so it is seen
c.Execute.timeout = 60  # seconds a cell, after which an endless loop is stopped
c.LimitOutput.max_lines = 200
