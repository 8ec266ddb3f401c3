"""The executor, on throw-away notebooks in real kernels."""

from __future__ import annotations

import sys
from pathlib import Path

import nbformat
import pytest
import tqdm
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook
from support.notebooks import write_notebook

from stereolib.reproduction import execute_notebooks, execution


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


def test_the_bar_ends_with_the_last_cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Text and empty cells are not executed, and count for nothing."""
    source = write_notebook(tmp_path / "notebooks", "01_one", "1", "", "2")
    notebook = nbformat.read(source, as_version=4)
    notebook.cells.insert(1, new_markdown_cell("words"))
    nbformat.write(notebook, source)
    seen: list[tuple[float, float]] = []

    class Bar(tqdm.tqdm):
        def close(self) -> None:
            if not self.disable:
                seen.append((self.n, self.total))
            super().close()

    monkeypatch.setattr(tqdm, "tqdm", Bar)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    execute_notebooks([source], tmp_path / "out", tmp_path / "figures")
    assert seen == [(2, 2)]


def test_normalise_keeps_the_picture_beside_a_widget() -> None:
    view = {"application/vnd.jupyter.widget-view+json": {"model_id": "1"}}
    outputs = [
        nbformat.v4.new_output("display_data", data=view | {"image/png": "AA==", "text/plain": "1 < 2"}),
        nbformat.v4.new_output("display_data", data=view),
    ]
    notebook = new_notebook(cells=[new_code_cell("x", outputs=outputs)], metadata={"widgets": {}})
    cleaned = execution.normalise(notebook)
    said, picture = cleaned.cells[0].outputs
    assert sorted(picture.data) == ["image/png", "text/plain"]
    assert said.data["text/html"].startswith("<p>1 &lt; 2</p>") and "Run this cell to move" in said.data["text/html"]
    assert said.data["text/plain"].startswith("1 < 2\n")
    assert sorted(cleaned.metadata) == ["kernelspec", "language_info"]
    assert "version" not in cleaned.metadata.language_info


def test_index_runs_last_and_sees_what_the_others_wrote(tmp_path: Path) -> None:
    folder = "import os, pathlib, time\nfigures = pathlib.Path(os.environ['STEREOLIB_FIGURES'])\n"
    index = write_notebook(
        tmp_path / "notebooks", "00_two_pictures", folder + "print(*(p.name for p in figures.iterdir()))"
    )
    one = write_notebook(
        tmp_path / "notebooks", "01_one", folder + "time.sleep(1)\nfigures.mkdir()\n(figures / 'fig').touch()"
    )
    execute_notebooks([index, one], tmp_path / "out", tmp_path / "figures")
    assert nbformat.read(tmp_path / "out" / index.name, as_version=4).cells[0].outputs[0].text == "fig\n"


def test_no_jobs_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="jobs is 0"):
        execute_notebooks([], tmp_path, tmp_path, jobs=0)


def test_without_a_terminal_a_notebook_is_a_line_when_it_begins_and_when_it_ends(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = write_notebook(tmp_path / "notebooks", "01_one", "1 + 1")
    execute_notebooks([source], tmp_path / "out", tmp_path / "figures")
    began, ended = capsys.readouterr().err.splitlines()
    assert began.split() == ["01_one", "begins"] and ended.split()[::2] == ["01_one", "s"]
