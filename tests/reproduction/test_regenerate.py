"""``reproduce``: what it replaces, what it keeps, and what a failure or a kill leaves behind."""

from __future__ import annotations

import csv
import subprocess
import sys
import time
from pathlib import Path

import nbformat
import pytest
from support.notebooks import execute_without_kernels, write_notebook

from stereolib.reproduction import NotebookError, regenerate, reproduce
from stereolib.reproduction.regenerate import find_notebooks

SAVE = """\
import os, pathlib
tables = pathlib.Path(os.environ["STEREOLIB_FIGURES"]) / "tables"
tables.mkdir(parents=True, exist_ok=True)
"""


def report(figures_dir: Path, notebooks_dir: Path) -> None:
    """Ledger of whatever the notebooks recorded, in place of the real one."""
    rows = [["id", "paper", "ours", "difference", "unit", "verdict"]]
    for table in sorted((figures_dir / "tables").glob("*.csv")):
        rows += list(csv.reader(table.read_text().splitlines()))[1:]
    (figures_dir / "ledger.csv").write_text("\n".join(",".join(row) for row in rows) + "\n")


def record(ours: str) -> str:
    row = f"x,1,{ours},0,px,agrees"
    return f'{SAVE}(tables / "ledger_01.csv").write_text("id,paper,ours,difference,unit,verdict\\n{row}\\n");'


def run(tmp_path: Path, **options: object) -> list[str]:
    return reproduce(tmp_path / "notebooks", tmp_path / "figures", **options)  # type: ignore[arg-type]


@pytest.fixture(autouse=True)
def short_report(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(regenerate, "build_report", report)


@pytest.fixture
def no_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of notebooks that only leave tables behind; test_execution.py looks at the kernels."""
    monkeypatch.setattr(regenerate, "execute_notebooks", execute_without_kernels)


@pytest.mark.usefixtures("no_kernels")
def test_numbers_repeat_and_equal_files_are_not_touched(tmp_path: Path) -> None:
    write_notebook(tmp_path / "notebooks", "01_one", record("1.25"))
    assert run(tmp_path) == []
    assert "1.25" in (tmp_path / "figures" / "ledger.csv").read_text()
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.*") if path.suffix in {".csv", ".ipynb"}}
    assert len(before) == 3
    assert run(tmp_path) == []
    assert {path: path.stat().st_mtime_ns for path in before} == before


@pytest.mark.usefixtures("no_kernels")
def test_changed_number_keeps_the_committed_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, ledger = tmp_path / "notebooks", tmp_path / "figures" / "ledger.csv"
    write_notebook(folder, "01_one", record("1.25"))
    assert run(tmp_path) == []
    source = write_notebook(folder, "01_one", record("1.29"))
    unexecuted = source.read_bytes()
    changed = run(tmp_path)
    assert changed == [
        "ledger.csv, row x, ours: 1.25 before, 1.29 now",
        "ledger_01.csv, row x, ours: 1.25 before, 1.29 now",
    ]
    assert "1.25" in ledger.read_text() and source.read_bytes() == unexecuted
    assert "1.29" in (tmp_path / ".staging" / "figures" / "ledger.csv").read_text()
    capsys.readouterr()
    assert run(tmp_path, accept=True) == changed
    *_, said, first, second, third = capsys.readouterr().out.splitlines()
    assert said.endswith("new: 3 files; the others came out the same")
    new = ["figures/ledger.csv", "figures/tables/ledger_01.csv", "notebooks/01_one.ipynb"]
    assert [first, second, third] == [f"  {name}" for name in new]
    assert "1.29" in ledger.read_text() and source.read_bytes() != unexecuted
    assert not (tmp_path / ".staging").exists()


@pytest.mark.usefixtures("no_kernels")
def test_check_replaces_nothing_and_a_failure_neither(tmp_path: Path) -> None:
    folder = tmp_path / "notebooks"
    sources = [write_notebook(folder, "01_one", record("1.25")), write_notebook(folder, "02_two", "print(1)")]
    untouched = [source.read_bytes() for source in sources]
    assert run(tmp_path, check=True) == []
    write_notebook(folder, "02_two", "1 / 0")
    untouched[1] = sources[1].read_bytes()
    with pytest.raises(NotebookError, match="02_two"):
        run(tmp_path)
    assert [source.read_bytes() for source in sources] == untouched
    assert not (tmp_path / "figures" / "ledger.csv").exists()


@pytest.mark.usefixtures("no_kernels")
def test_outputs_stay_where_a_recording_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "notebooks"
    notebook = write_notebook(folder, "01_one", record("1.25") + "\nprint('30 pairs')")
    assert run(tmp_path) == []
    executed = nbformat.read(notebook, as_version=4)
    executed.cells[0].source = record("1.25") + "\nprint('skipped: boards are not available here')"
    nbformat.write(executed, notebook)
    assert run(tmp_path) == []
    assert "committed outputs are kept" in capsys.readouterr().out
    assert nbformat.read(notebook, as_version=4).cells[0].outputs[-1].text == "30 pairs\n"


@pytest.mark.usefixtures("no_kernels")
def test_one_notebook_keeps_the_others_rows(tmp_path: Path) -> None:
    folder = tmp_path / "notebooks"
    write_notebook(folder, "01_one", record("1.25"))
    write_notebook(folder, "02_two", "print(1)")
    assert run(tmp_path) == []
    assert run(tmp_path, names=["02"]) == []
    assert "1.25" in (tmp_path / "figures" / "ledger.csv").read_text()


@pytest.mark.usefixtures("no_kernels")  # but the child that is killed has one
def test_killed_run_leaves_the_figures_whole(tmp_path: Path) -> None:
    folder, ledger = tmp_path / "notebooks", tmp_path / "figures" / "ledger.csv"
    write_notebook(folder, "01_one", record("1.25"))
    assert run(tmp_path) == []
    committed = ledger.read_bytes()
    source = write_notebook(folder, "01_one", record("9.99"), "import time\ntime.sleep(600)")
    code = (
        "import pathlib, sys; from stereolib.reproduction import reproduce; "
        "reproduce(pathlib.Path('notebooks'), pathlib.Path('figures'))"
    )
    child = subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path)
    staged = tmp_path / ".staging" / "figures" / "tables" / "ledger_01.csv"
    deadline = time.monotonic() + 60
    while not staged.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert staged.exists()
    with pytest.raises(ValueError, match="another reproduce is at work"):
        run(tmp_path)
    child.kill()
    child.wait()
    assert ledger.read_bytes() == committed
    write_notebook(folder, source.stem, record("1.25"))
    assert run(tmp_path) == []
    assert ledger.read_bytes() == committed and not staged.exists()


def test_names_select_notebooks(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no notebooks in"):
        find_notebooks(tmp_path)
    for name in ("01_calibration", "02_rectification", "02_second"):
        write_notebook(tmp_path, name, "1")
    chosen = find_notebooks(tmp_path, ["02_second.ipynb", "01"])
    assert [path.stem for path in chosen] == ["01_calibration", "02_second"]
    with pytest.raises(ValueError, match="2 notebooks fit '02'; there are 01_calibration, 02_rectification"):
        find_notebooks(tmp_path, ["02"])
    with pytest.raises(ValueError, match="0 notebooks fit '09'"):
        find_notebooks(tmp_path, ["09"])
