"""Throw-away notebooks: written, and executed without a kernel where only what they leave behind matters."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from unittest import mock

import nbformat
from nbformat.v4 import new_code_cell, new_notebook, new_output

from stereolib.reproduction import NotebookError
from stereolib.reproduction.execution import INDEX, normalise


def write_notebook(folder: Path, name: str, *cells: str) -> Path:
    folder.mkdir(exist_ok=True)
    path = folder / f"{name}.ipynb"
    nbformat.write(new_notebook(cells=[new_code_cell(cell) for cell in cells]), path)
    return path


def execute_without_kernels(sources: Sequence[Path], target_dir: Path, figures_dir: Path, jobs: int = 2) -> None:
    """What `stereolib.reproduction.execute_notebooks` does, in this process: a hundredth of a kernel's time."""
    target_dir.mkdir(parents=True, exist_ok=True)
    for source in sorted(sources, key=lambda path: path.stem == INDEX):
        notebook, names = nbformat.read(source, as_version=4), dict[str, object]()
        for number, cell in enumerate((cell for cell in notebook.cells if cell.cell_type == "code"), 1):
            printed = StringIO()
            with redirect_stdout(printed), mock.patch.dict(os.environ, STEREOLIB_FIGURES=str(figures_dir)):
                try:
                    exec(cell.source, names)
                except Exception as error:
                    raise NotebookError(f"{source.name}, cell {number}: {error}") from error
            cell.execution_count = number
            text = printed.getvalue()
            cell.outputs = [new_output("stream", name="stdout", text=text)] if text else []
        nbformat.write(normalise(notebook), target_dir / source.name)
