"""The executor, on throw-away notebooks in real kernels."""

from __future__ import annotations

import sys
from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook
from support.notebooks import write_notebook

from stereolib.reproduction import NotebookError, execute_notebooks, execution
from stereolib.reproduction.execution import Limits

# Dies or stalls when it runs for the first time only.
ONCE = "import os, time\nfirst = not os.path.exists('tried')\nopen('tried', 'a').write('x')\n"


def execute(tmp_path: Path, *cells: str, limits: Limits | None = None) -> nbformat.NotebookNode:
    source = write_notebook(tmp_path / "notebooks", "01_one", *cells)
    execute_notebooks([source], tmp_path / "out", tmp_path / "figures", jobs=1, limits=limits)
    return nbformat.read(tmp_path / "out" / source.name, as_version=4)


def test_two_executions_are_the_same_bytes(tmp_path: Path) -> None:
    cells = [
        "import ipywidgets\nipywidgets.IntSlider(3)",
        "import IPython.display as d\nd.HTML('<b>x</b>')",
        "import os, sys\nprint(os.path.basename(os.getcwd()), sys.executable)",
    ]
    source = write_notebook(tmp_path / "notebooks", "01_one", *cells)
    for target in ("a", "b"):
        execute_notebooks([source], tmp_path / target, tmp_path / "figures")
    written = (tmp_path / "a" / source.name).read_bytes()
    assert written == (tmp_path / "b" / source.name).read_bytes()
    assert b"widget-view" not in written and b"widget-state" not in written
    assert b"execution" not in written.replace(b"execution_count", b"")
    result = nbformat.reads(written.decode(), as_version=4)
    assert [cell.execution_count for cell in result.cells] == [1, 2, 3]
    assert "IntSlider" in result.cells[0].outputs[0].data["text/plain"]
    # The kernel is this interpreter, and works in the notebook's folder.
    assert result.cells[2].outputs[0].text == f"notebooks {sys.executable}\n"


def test_normalise_keeps_the_picture_beside_a_widget() -> None:
    view = {"application/vnd.jupyter.widget-view+json": {"model_id": "1"}}
    outputs = [
        nbformat.v4.new_output("display_data", data=view | {"image/png": "AA==", "text/plain": "Image()"}),
        nbformat.v4.new_output("display_data", data=view),
    ]
    notebook = new_notebook(cells=[new_code_cell("x", outputs=outputs)], metadata={"widgets": {}})
    cleaned = execution.normalise(notebook)
    assert [sorted(output.data) for output in cleaned.cells[0].outputs] == [["image/png", "text/plain"]]
    assert sorted(cleaned.metadata) == ["kernelspec", "language_info"]
    assert "version" not in cleaned.metadata.language_info


def test_failing_cell_is_named(tmp_path: Path) -> None:
    with pytest.raises(NotebookError, match=r"01_one\.ipynb, cell 2 \(In \[2\]\): ZeroDivisionError: division"):
        execute(tmp_path, "x = 0", "1 / x", "print('never')")


def test_stderr_is_a_failure(tmp_path: Path) -> None:
    with pytest.raises(NotebookError, match=r"cell 1 .* wrote to stderr: .*UserWarning: careful"):
        execute(tmp_path, "import warnings\nwarnings.warn('careful')")


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


def test_no_jobs_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="jobs is 0"):
        execute_notebooks([], tmp_path, tmp_path, jobs=0)
