"""Notebooks that fail, and kernels that die or stall."""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
import pytest
from support.notebooks import write_notebook

from stereolib.reproduction import NotebookError, execute_notebooks
from stereolib.reproduction.execution import Limits

# Dies or stalls when it runs for the first time only.
ONCE = "import os, time\nfirst = not os.path.exists('tried')\nopen('tried', 'a').write('x')\n"


def execute(tmp_path: Path, *cells: str, limits: Limits | None = None) -> nbformat.NotebookNode:
    source = write_notebook(tmp_path / "notebooks", "01_one", *cells)
    execute_notebooks([source], tmp_path / "out", tmp_path / "figures", jobs=1, limits=limits)
    return nbformat.read(tmp_path / "out" / source.name, as_version=4)


def test_cells_that_raise_or_write_to_stderr_are_named(tmp_path: Path) -> None:
    with pytest.raises(NotebookError) as caught:
        execute(tmp_path, "import warnings\nwarnings.warn('careful')\nx = 0", "1 / x", "print('never')")
    warned, raised = str(caught.value).split("\n", 1)
    assert re.search(r"01_one\.ipynb, cell 1 .* wrote to stderr: .*UserWarning: careful", warned)
    assert re.search(r"01_one\.ipynb, cell 2 \(In \[2\]\): ZeroDivisionError: division", raised)
    assert "cell 3" not in raised


def test_an_error_that_its_cell_expects_is_no_failure(tmp_path: Path) -> None:
    source = write_notebook(tmp_path / "notebooks", "01_one", "1 / 0", "print('goes on')")
    notebook = nbformat.read(source, as_version=4)
    notebook.cells[0].metadata["tags"] = ["raises-exception"]
    nbformat.write(notebook, source)
    execute_notebooks([source], tmp_path / "out", tmp_path / "figures", jobs=1)
    raised, went_on = nbformat.read(tmp_path / "out" / source.name, as_version=4).cells
    assert raised.outputs[0].ename == "ZeroDivisionError" and went_on.outputs[0].text == "goes on\n"


@pytest.mark.parametrize("fault", ["if first: os._exit(1)", "if first: time.sleep(600)"])
def test_dead_or_stalled_kernel_gets_one_more_try(tmp_path: Path, fault: str) -> None:
    result = execute(tmp_path, ONCE + fault, "print('done')", limits=Limits(cell_s=3))
    assert result.cells[1].outputs[0].text == "done\n"
    assert (tmp_path / "notebooks" / "tried").read_text() == "xx"


def test_kernel_that_dies_twice_fails(tmp_path: Path) -> None:
    with pytest.raises(NotebookError, match=r"01_one\.ipynb: the kernel died or stalled twice"):
        execute(tmp_path, ONCE + "os._exit(1)")
    assert (tmp_path / "notebooks" / "tried").read_text() == "xx"


def test_whole_notebook_has_a_limit(tmp_path: Path) -> None:
    with pytest.raises(NotebookError, match="stalled twice"):
        execute(tmp_path, "import time\ntime.sleep(600)", limits=Limits(cell_s=600, notebook_s=2))
