"""The executor and ``reproduce``, on throw-away notebooks."""

from __future__ import annotations

import csv
import platform
import subprocess
import sys
import time
from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook

from stereolib.reproduction import NotebookError, execution, regenerate
from stereolib.reproduction.execution import Limits

SAVE = """\
import os, pathlib
tables = pathlib.Path(os.environ["STEREOLIB_FIGURES"]) / "tables"
tables.mkdir(parents=True, exist_ok=True)
"""
# Dies or stalls when it runs for the first time only.
ONCE = "import os, time\nfirst = not os.path.exists('tried')\nopen('tried', 'a').write('x')\n"


def write(folder: Path, name: str, *cells: str) -> Path:
    folder.mkdir(exist_ok=True)
    path = folder / f"{name}.ipynb"
    nbformat.write(new_notebook(cells=[new_code_cell(cell) for cell in cells]), path)
    return path


def execute(tmp_path: Path, *cells: str, limits: Limits | None = None) -> nbformat.NotebookNode:
    source = write(tmp_path / "notebooks", "01_one", *cells)
    execution.execute([source], tmp_path / "out", tmp_path / "figures", jobs=1, limits=limits)
    return nbformat.read(tmp_path / "out" / source.name, as_version=4)


def report(figures_dir: Path) -> None:
    """Ledger of whatever the notebooks recorded, in place of the real one."""
    rows = [["id", "paper", "ours", "difference", "unit", "verdict"]]
    for table in sorted((figures_dir / "tables").glob("*.csv")):
        rows += list(csv.reader(table.read_text().splitlines()))[1:]
    (figures_dir / "ledger.csv").write_text("\n".join(",".join(row) for row in rows) + "\n")


def record(ours: str) -> str:
    row = f"x,1,{ours},0,px,agrees"
    return f'{SAVE}(tables / "ledger_01.csv").write_text("id,paper,ours,difference,unit,verdict\\n{row}\\n");'


def run(tmp_path: Path, **options: object) -> list[str]:
    return regenerate.reproduce(
        tmp_path / "notebooks",
        tmp_path / "figures",
        build_report=report,
        **options,  # type: ignore[arg-type]
    )


def test_two_executions_are_the_same_bytes(tmp_path: Path) -> None:
    cells = [
        "import ipywidgets\nipywidgets.IntSlider(3)",
        "import IPython.display as d\nd.HTML('<b>x</b>')",
        "import os, sys\nprint(os.path.basename(os.getcwd()), sys.executable)",
    ]
    source = write(tmp_path / "notebooks", "01_one", *cells)
    for target in ("a", "b"):
        execution.execute([source], tmp_path / target, tmp_path / "figures")
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


def test_index_runs_last_and_numbers_repeat(tmp_path: Path) -> None:
    folder = tmp_path / "notebooks"
    write(folder, "01_one", "import time; time.sleep(1)", record("1.25"))
    write(folder, "00_index", SAVE + "print(sorted(path.name for path in tables.iterdir()))")
    assert run(tmp_path) == []
    index = nbformat.read(folder / "00_index.ipynb", as_version=4)
    assert index.cells[0].outputs[0].text == "['ledger_01.csv']\n"
    assert "1.25" in (tmp_path / "figures" / "ledger.csv").read_text()
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.*") if path.suffix in {".csv", ".ipynb"}}
    assert run(tmp_path) == []
    assert {path: path.stat().st_mtime_ns for path in before} == before  # equal files are not touched


def test_changed_number_keeps_the_committed_files(tmp_path: Path) -> None:
    folder, ledger = tmp_path / "notebooks", tmp_path / "figures" / "ledger.csv"
    write(folder, "01_one", record("1.25"))
    assert run(tmp_path) == []
    source = write(folder, "01_one", record("1.29"))
    unexecuted = source.read_bytes()
    changed = run(tmp_path)
    assert changed == [
        "ledger.csv, row x, ours: 1.25 before, 1.29 now",
        "ledger_01.csv, row x, ours: 1.25 before, 1.29 now",
    ]
    assert "1.25" in ledger.read_text() and source.read_bytes() == unexecuted
    assert "1.29" in (tmp_path / ".staging" / "figures" / "ledger.csv").read_text()
    assert run(tmp_path, accept=True) == changed
    assert "1.29" in ledger.read_text() and source.read_bytes() != unexecuted
    assert not (tmp_path / ".staging").exists()


def test_check_replaces_nothing_and_a_failure_neither(tmp_path: Path) -> None:
    folder = tmp_path / "notebooks"
    sources = [write(folder, "01_one", record("1.25")), write(folder, "02_two", "print(1)")]
    untouched = [source.read_bytes() for source in sources]
    assert run(tmp_path, check=True) == []
    write(folder, "02_two", "1 / 0")
    untouched[1] = sources[1].read_bytes()
    with pytest.raises(NotebookError, match="02_two"):
        run(tmp_path)
    assert [source.read_bytes() for source in sources] == untouched
    assert not (tmp_path / "figures" / "ledger.csv").exists()


def test_outputs_stay_where_a_recording_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "notebooks"
    notebook = write(folder, "01_one", record("1.25") + "\nprint('30 pairs')")
    assert run(tmp_path) == []
    executed = nbformat.read(notebook, as_version=4)
    executed.cells[0].source = record("1.25") + "\nprint('skipped: boards are not available here')"
    nbformat.write(executed, notebook)
    assert run(tmp_path) == []
    assert "committed outputs are kept" in capsys.readouterr().out
    assert nbformat.read(notebook, as_version=4).cells[0].outputs[-1].text == "30 pairs\n"


def test_one_notebook_keeps_the_others_rows(tmp_path: Path) -> None:
    folder = tmp_path / "notebooks"
    write(folder, "01_one", record("1.25"))
    write(folder, "02_two", "print(1)")
    assert run(tmp_path) == []
    assert run(tmp_path, names=["02"]) == []
    assert "1.25" in (tmp_path / "figures" / "ledger.csv").read_text()


def test_killed_run_leaves_the_figures_whole(tmp_path: Path) -> None:
    folder, ledger = tmp_path / "notebooks", tmp_path / "figures" / "ledger.csv"
    write(folder, "01_one", record("1.25"))
    assert run(tmp_path) == []
    committed = ledger.read_bytes()
    source = write(folder, "01_one", record("9.99"), "import time\ntime.sleep(600)")
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
    write(folder, source.stem, record("1.25"))
    assert run(tmp_path) == []
    assert ledger.read_bytes() == committed and not staged.exists()


@pytest.mark.parametrize(
    ("committed", "fresh", "same"),
    [
        ("1.234", "1.235", True),  # one unit of the last digit
        ("1.234", "1.2", True),  # printed with fewer digits
        ("1.234", "1.249", False),
        ("12345", "12400", True),  # within 1 %
        ("12345", "12500", False),
        ("0.0012", "0.0014", False),
        ("1.2e-13", "5e-11", True),  # rounding noise around zero
        ("[1.00 -2.00] px", "[1.01 -2.01] px", True),
        ("[1.00 -2.00] px", "[1.00 2.00] px", False),
        ("agrees", "differs", False),
        ("fig04", "fig05", False),  # a name, not a number
        ("3.0", "nan", False),
    ],
)
def test_repeat_tolerance(committed: str, fresh: str, same: bool) -> None:
    assert regenerate.same_text(committed, fresh) is same


def test_tables_that_vanish_or_change_shape_are_named(tmp_path: Path) -> None:
    for name, text in {"old/tables/a.csv": "id,v\nx,1\n", "old/tables/b.csv": "id,v\nx,1\n"}.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "new" / "tables").mkdir(parents=True)
    (tmp_path / "new" / "tables" / "b.csv").write_text("id,v\nx,1\ny,2\n")
    changed = regenerate.compare_tables(tmp_path / "old", tmp_path / "new")
    assert changed == ["a.csv: no notebook makes it any more", "b.csv: 1 rows before, 2 now"]


def test_names_select_notebooks(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no notebooks in"):
        regenerate.find_notebooks(tmp_path)
    for name in ("01_calibration", "02_rectification", "02_second"):
        write(tmp_path, name, "1")
    found = regenerate.find_notebooks(tmp_path, ["02_second.ipynb", "01"])
    assert [path.stem for path in found] == ["01_calibration", "02_second"]
    with pytest.raises(ValueError, match="2 notebooks fit '02'; there are 01_calibration, 02_rectification"):
        regenerate.find_notebooks(tmp_path, ["02"])
    with pytest.raises(ValueError, match="0 notebooks fit '09'"):
        regenerate.find_notebooks(tmp_path, ["09"])
    with pytest.raises(ValueError, match="jobs is 0"):
        execution.execute([], tmp_path, tmp_path, jobs=0)


def test_kernels_add_up_as_every_processor_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On x86-64 with AVX2, wider kernels are off; what the user set stays; nothing is printed by what is set."""
    import cv2
    import numpy as np

    for name in ("OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES"):
        monkeypatch.delenv(name, raising=False)
    pinned = execution.kernel_environment(tmp_path)
    if platform.machine().lower() in ("x86_64", "amd64") and cv2.checkHardwareSupport(11):  # AVX2
        assert pinned["OPENBLAS_CORETYPE"] == "Haswell"
        found = np.show_config(mode="dicts")["SIMD Extensions"].get("found", ())
        wide = {name for name in found if name.startswith(("X86_V4", "AVX512"))}
        assert set(pinned.get("NPY_DISABLE_CPU_FEATURES", "").split()) == wide
    else:
        assert not {"OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES"} & pinned.keys()
    command = [sys.executable, "-W", "error", "-c", "import numpy, cv2; numpy.eye(3) @ numpy.eye(3)"]
    done = subprocess.run(command, env=pinned, capture_output=True, text=True, check=True)
    assert done.stdout == done.stderr == ""
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Sandybridge")
    monkeypatch.setenv("NPY_DISABLE_CPU_FEATURES", "")
    own = execution.kernel_environment(tmp_path)
    assert (own["OPENBLAS_CORETYPE"], own["NPY_DISABLE_CPU_FEATURES"]) == ("Sandybridge", "")
