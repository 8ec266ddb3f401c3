"""Write these notebooks from what `stereolib.exercises` says, executed: ``python make_sheets.py [00 03 ...]``."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import nbformat

from stereolib.base import write_atomic
from stereolib.exercises import SHEETS, make_sheet
from stereolib.reproduction import execute_notebooks

HERE = Path(__file__).resolve().parent


def main(wanted: list[str]) -> None:
    """Make the sheets of some chapters, or of all."""
    with tempfile.TemporaryDirectory() as folder:
        plain = [Path(folder) / f"{name}.ipynb" for name in SHEETS.values() if not wanted or name[:2] in wanted]
        for path in plain:
            nbformat.write(make_sheet(int(path.stem[:2])), path)
        execute_notebooks(plain, HERE, Path(folder), jobs=1)
        for path in plain:
            clear_checks(HERE / path.name)


def clear_checks(path: Path) -> None:
    """Take away that nothing was answered yet, which each check says and a reader takes for an error."""
    sheet = nbformat.read(path, as_version=4)
    for cell in sheet.cells:
        if cell.metadata.get("nbgrader", {}).get("grade"):
            cell.outputs, cell.execution_count = [], None
    write_atomic(path, nbformat.writes(sheet) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
