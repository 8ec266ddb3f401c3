"""The repository's own promises: notebooks as readers see them, pins, rooms, links, committed data and figures."""

from __future__ import annotations

import ast
import importlib
import os
import re
import subprocess
import sys
import tomllib
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import nbformat
import pytest
import yaml
from packaging.requirements import Requirement

import bootstrap
import noxfile
import stereolib
from stereolib.base import ROOT
from stereolib.cli import commands

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
MODULES = sorted((ROOT / "stereolib").rglob("*.py"))
ROOMS = sorted(path.parent.name for path in (ROOT / "stereolib").glob("*/__init__.py"))
PAGES = sorted(page for page in ROOT.glob("**/*.md") if not {".venv", ".staging", "build"} & set(page.parts))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = sorted({name for extra in PROJECT["optional-dependencies"].values() for name in extra})
APART = "nbgrader"  # in an environment of its own, for `make test-nbgrader` and for teachers
ADDED = {name: PROJECT["optional-dependencies"][name] for name in noxfile.ADDITIONS}

each_notebook = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def read(path: Path) -> nbformat.NotebookNode:
    return nbformat.read(path, as_version=4)


def code_cells(path: Path) -> list[nbformat.NotebookNode]:
    return [cell for cell in read(path).cells if cell.cell_type == "code" and cell.source.strip()]


def normal(requirement: str) -> tuple[str, str]:
    parsed = Requirement(requirement)
    return parsed.name.lower().replace("_", "-"), str(parsed.specifier)


# --- notebooks


def test_notebooks_are_numbered_from_the_start_on() -> None:
    stems = [path.stem for path in NOTEBOOKS]
    assert stems[0] == "00_two_pictures"
    assert all(re.fullmatch(r"\d\d_[a-z_]+", stem) for stem in stems)
    assert len({stem[:2] for stem in stems}) == len(stems)


@each_notebook
def test_every_code_cell_was_executed_in_order(path: Path) -> None:
    assert [cell.execution_count for cell in code_cells(path)] == list(range(1, len(code_cells(path)) + 1))


@each_notebook
def test_outputs_hold_no_error_no_stderr_no_address(path: Path) -> None:
    outputs = [output for cell in code_cells(path) for output in cell.outputs]
    assert not [output.evalue for output in outputs if output.output_type == "error"]
    assert not [output.text for output in outputs if output.get("name") == "stderr"]
    assert not re.findall(r" at 0x[0-9a-f]+", str(outputs))
    assert "widget-view" not in str(outputs) and "widgets" not in read(path).metadata


@each_notebook
def test_no_machine_path(path: Path) -> None:
    text = re.sub(r"\\[nrt]", " ", path.read_text(encoding="utf-8"))  # as JSON writes ends of lines
    assert str(ROOT) not in text
    assert not re.findall(r"(?<![\w.:/])/(?:home|root|Users|tmp|opt|mnt|usr|var|srv)/[\w.-]+", text)
    assert not re.findall(r"[A-Z]:\\\\+Users", text)


@each_notebook
def test_some_cell_is_compared(path: Path) -> None:
    checked = [cell for cell in code_cells(path) if "# NBVAL_CHECK_OUTPUT" in cell.source]
    assert any(cell.outputs for cell in checked)


@each_notebook
def test_notebook_is_small(path: Path) -> None:
    assert path.stat().st_size <= 1_500_000


@each_notebook
def test_cells_are_short_and_define_no_class(path: Path) -> None:
    for cell in code_cells(path):
        lines = [line for line in cell.source.splitlines() if line.strip()]
        assert len(lines) <= 15, cell.source
        assert not re.search(r"^\s*class ", cell.source, re.MULTILINE), cell.source


@each_notebook
def test_knobs_stand_in_a_parameters_cell(path: Path) -> None:
    tagged = [cell for cell in code_cells(path) if "parameters" in cell.metadata.get("tags", [])]
    assert len(tagged) == 1


@each_notebook
def test_there_is_something_to_play_with(path: Path) -> None:
    """A cell calls `explore` with a drawing and at least one control, and its picture of the first values is there."""
    calls = [
        (call, cell)
        for cell in code_cells(path)
        for call in ast.walk(ast.parse(cell.source))
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "explore"
    ]
    assert calls
    for call, cell in calls:
        assert len(call.args) == 1 and call.keywords
        assert any("image/jpeg" in output.get("data", {}) for output in cell.outputs)


# --- pages


def targets(text: str) -> list[str]:
    """Relative link and image targets of a page, without code and anchors."""
    prose = re.sub(r"```.*?```|`[^`\n]*`", "", text, flags=re.DOTALL)
    found = re.findall(r"\]\(([^)\s]+)[^)]*\)", prose) + re.findall(r"<img[^>]*src=\"([^\"]+)\"", prose)
    links = [link.split("#")[0] for link in found if not re.match(r"[a-z]+:", link)]
    return [link for link in links if link]


@pytest.mark.parametrize("page", [*PAGES, *NOTEBOOKS], ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    if page.suffix == ".ipynb":
        text = "\n".join(cell.source for cell in read(page).cells if cell.cell_type == "markdown")
    else:
        text = page.read_text(encoding="utf-8")
    assert not [link for link in targets(text) if not (page.parent / link).exists()]


def test_readme_names_the_two_commands_and_ci_runs_the_second() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert "make reproduce" in readme and "make test" in readme
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    # every session of `make test`, and what it leaves out
    ran = " ".join(re.findall(r"^ *nox -s ([\w -]+?) \|\| failed=1$", script, re.MULTILINE)).split()
    assert sorted(ran) == sorted(noxfile.nox.options.sessions) == sorted(bootstrap.COMMANDS["test"][3:-1])
    assert "\nmake setup\n" in script and "\n    wait\n    { make site && make test-browser; } || failed=1\n" in script
    assert 'beside >"$told" 2>&1 &\nother=$!' in script and 'wait "$other" || failed=1' in script
    assert os.name == "nt" or os.access(ROOT / ".ci" / "run", os.X_OK)


def jobs(workflow: str) -> dict[str, Any]:
    """The jobs of a workflow of GitHub; `lint` holds the files to its schema."""
    text = (ROOT / ".github" / "workflows" / f"{workflow}.yml").read_text(encoding="utf-8")
    return yaml.safe_load(text)["jobs"]


def test_workflows_call_only_pinned_actions_and_commands_that_are_there() -> None:
    steps = [step for name in ("ci", "pages") for job in jobs(name).values() for step in job["steps"]]
    actions = [step["uses"] for step in steps if "uses" in step]
    assert actions and all(re.fullmatch(r"actions/[a-z-]+@[0-9a-f]{40}", action) for action in actions)
    lines = [step["run"] for step in steps if "run" in step]
    called = [found[1] for line in lines if (found := re.match(r"(?:make|python bootstrap\.py) ([a-z-]+)", line))]
    assert set(called) <= set(bootstrap.COMMANDS) and "site" in called
    others = {line.split()[0] for line in lines if not re.match(r"make |python bootstrap\.py ", line)}
    assert others == {".ci/run", ".venv/bin/nox"}
    paths = [word for line in lines for word in line.split() if word.startswith("tests/")]
    assert paths and all((ROOT / path).exists() for path in paths)


def test_workflow_and_nox_try_the_same_pythons_and_opencvs() -> None:
    matrix = jobs("ci")["matrix"]["strategy"]["matrix"]
    assert matrix["python"] == noxfile.PYTHONS
    (step,) = [step for step in jobs("ci")["matrix"]["steps"] if "nox" in step.get("run", "")]
    sessions = subprocess.run([sys.executable, "-m", "nox", "--list"], cwd=ROOT, capture_output=True, text=True)
    for python in matrix["python"]:
        for opencv in matrix["opencv"]:
            name = f"matrix-{python}({opencv})"
            assert (
                step["run"]
                .replace("${{ matrix.python }}", python)
                .replace("${{ matrix.opencv }}", opencv)
                .endswith(f'"{name}"')
            )
            assert f"- {name} " in sessions.stdout


def test_binder_installs_what_notebooks_need_with_the_pinned_versions() -> None:
    lines = (ROOT / ".binder" / "requirements.txt").read_text(encoding="utf-8").splitlines()
    (editable,) = [line for line in lines if line.startswith("--editable ")]
    extras = Requirement("stereolib" + editable.removeprefix("--editable .")).extras
    assert extras == {"notebooks", "explore"} <= set(PROJECT["optional-dependencies"])
    constraints = [line.split()[1] for line in lines if line.startswith("--constraint ")]
    assert [(ROOT / ".binder" / path).resolve().name for path in constraints] == [
        "requirements.txt",
        "requirements-explore.txt",
    ]
    assert all((ROOT / ".binder" / path).is_file() for path in constraints)
    python = (ROOT / ".binder" / "runtime.txt").read_text(encoding="utf-8").strip()
    assert python.removeprefix("python-") in noxfile.PYTHONS


# --- environments


def pinned(name: str = "") -> list[str]:
    return (ROOT / f"requirements{name and '-'}{name}.txt").read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize("name", ["", *ADDED])
def test_requirements_are_pins_and_nothing_else(name: str) -> None:
    assert all(re.fullmatch(r"[a-z0-9-]+==[\w.]+(?: ; [\w. =!<>'()-]+)?", line) for line in pinned(name))


def test_requirements_pin_everything_in_pyproject() -> None:
    lines = {line for name in ("", *ADDED) for line in pinned(name)}  # what two additions need is the same in both
    pins = {Requirement(line).name: Requirement(line).specifier for line in lines}
    assert len(pins) == len(lines)
    for text in [*PROJECT["dependencies"], *EXTRAS]:
        wanted = Requirement(text)
        (pin,) = pins[wanted.name.lower()]
        assert wanted.specifier.contains(pin.version), text


def test_pins_of_one_command_are_apart_and_installed_for_it() -> None:
    import bootstrap

    assert {path.name for path in ROOT.glob("requirements-*.txt")} == {f"requirements-{name}.txt" for name in ADDED}
    in_environment = {name for names in bootstrap.ADDITIONS.values() for name in names}
    assert in_environment == set(ADDED) - {APART}
    for name, extra in ADDED.items():
        assert {Requirement(line).name for line in pinned(name)} >= {Requirement(text).name for text in extra}


def test_conda_environment_equals_pyproject() -> None:
    entries = yaml.safe_load((ROOT / "environment.yml").read_text(encoding="utf-8"))["dependencies"]
    from_pip = [name for entry in entries if isinstance(entry, dict) for name in entry["pip"]]
    from_conda = [entry for entry in entries if isinstance(entry, str)]
    python = f"python{PROJECT['requires-python']}"
    assert {python, "pip"} <= set(from_conda) and "-e ." in from_pip
    packages = [name for name in [*from_conda, *from_pip] if name not in {python, "pip", "-e ."}]
    wanted = [name for name in EXTRAS if name not in PROJECT["optional-dependencies"][APART]]
    assert sorted(map(normal, packages)) == sorted(map(normal, [*PROJECT["dependencies"], *wanted]))


def test_no_package_registry_is_named() -> None:
    # Written in two pieces, so that this file does not name them either.
    forbidden = ["index" + "-url", "py" + "pi.org", "python" + "hosted"]
    names = [
        "requirements.txt",
        *(f"requirements-{name}.txt" for name in ADDED),
        ".binder/requirements.txt",
        "environment.yml",
        "pyproject.toml",
        "Makefile",
        "bootstrap.py",
        "noxfile.py",
        ".ci/run",
    ]
    for path in [*(ROOT / name for name in names), *PAGES]:
        assert not [word for word in forbidden if word in path.read_text(encoding="utf-8")], path.name


def test_both_opencv_majors_are_tested() -> None:
    import noxfile

    admitted = {Requirement(text).name: Requirement(text) for text in PROJECT["dependencies"]}
    oldest = Requirement(noxfile.OPENCV4)
    (pin,) = oldest.specifier
    assert admitted[oldest.name].specifier.contains(pin.version) and pin.version.startswith("4.14.")
    assert f"\nopencv-python-headless=={5}" in (ROOT / "requirements.txt").read_text(encoding="utf-8")


def test_version_is_the_same_everywhere() -> None:
    version = PROJECT["version"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert stereolib.__version__ == version == citation["version"]
    assert f"## {version}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_makefile_and_bootstrap_know_the_same_commands() -> None:
    import bootstrap

    line = re.search(r"^COMMANDS := (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert line is not None
    assert set(line[1].split()) == {*bootstrap.COMMANDS, "clean"}
    assert all(f"make {name} " in bootstrap.HELP for name in line[1].split())


# --- library


def imported(path: Path) -> set[str]:
    """Names of the modules that a file imports, wherever in it."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    plain = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    return plain | {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}


@pytest.mark.parametrize("room", ROOMS)
def test_room_says_what_it_is_for_and_offers_its_public_names(room: str) -> None:
    module = importlib.import_module(f"stereolib.{room}")
    assert len((module.__doc__ or "").split("\n\n")) <= 3 and len(module.__doc__ or "") > 80
    for name in module.__all__:
        offered = getattr(module, name)
        assert getattr(offered, "__doc__", None), f"{room}.{name} says nothing"


def test_contributing_shows_every_room_with_its_floor_and_its_files() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    shown = re.findall(r"^\| (\d) \| `(\w+)` \| [^|]+ \| (.+) \|$", text, re.MULTILINE)
    assert sorted(room for _, room, _ in shown) == ROOMS
    for _, room, files in shown:
        there = {path.name for path in (ROOT / "stereolib" / room).glob("[!_]*.py")}
        assert set(re.findall(r"`(\w+\.py)`", files)) == there, room
    layers = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
    floors = [set(layer.split(" | ")) for layer in layers[0]["layers"][:0:-1]]
    assert [{room for floor, room, _ in shown if int(floor) == n} for n in range(1, 9)] == floors


def test_python_in_readme_imports_what_is_there() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    lines = re.findall(r"(?:from stereolib[\w.]* import [\w, ]+)", readme)
    assert lines
    for line in lines:
        exec(line, {})


def test_private_modules_stay_inside_their_room() -> None:
    for path in MODULES:
        room = path.relative_to(ROOT / "stereolib").parts[0]
        private = {name for name in imported(path) if re.match(r"stereolib\..*\._[a-z]", name)}
        assert all(name.startswith(f"stereolib.{room}.") for name in private), path.name


def test_only_the_plotting_room_draws() -> None:
    drawing = {path.parent.name for path in MODULES if {n.split(".")[0] for n in imported(path)} & {"matplotlib"}}
    assert drawing == {"plotting"}


def test_first_names_are_those_of_the_rooms() -> None:
    assert set(ROOMS) <= set(stereolib.__all__) and 40 <= len(set(stereolib.__all__) - set(ROOMS)) <= 50
    assert stereolib.StereoRig is stereolib.rig.StereoRig
    with pytest.raises(AttributeError, match="nonsense"):
        _ = stereolib.nonsense


@pytest.mark.parametrize("module", ["stereolib", "stereolib.cli"])
def test_import_loads_nothing_heavy(module: str) -> None:
    heavy = "cv2 numpy numba pandas scipy skimage matplotlib serial tqdm joblib IPython ipywidgets nbclient pooch"
    code = f"import sys, {module}; print([name for name in {heavy.split()} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize("check", noxfile.CHECKS)
def test_lint(check: str) -> None:
    command = noxfile.command(check)
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


# --- data and figures


def test_virtual_recordings_are_as_their_manifest_says(capsys: pytest.CaptureFixture[str]) -> None:
    assert commands.main(["data", "verify"]) == 0, capsys.readouterr().out
    folder = ROOT / "data" / "virtual"
    files = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}
    listed = {line.split(maxsplit=1)[1] for line in (folder / "SHA256SUMS").read_text().splitlines()}
    kept = {name for name in files if ".stereolib_corners/" in name}  # by who calibrated with the virtual boards
    assert set(files) - listed - kept <= {"SHA256SUMS", "README.md"}
    assert sum(path.stat().st_size for path in files.values()) <= 45e6


@pytest.mark.parametrize("number", range(1, 10))
def test_every_figure_of_the_paper_is_committed(number: int) -> None:
    assert (ROOT / "figures" / f"fig{number:02d}.png").read_bytes().startswith(b"\x89PNG")


class Loaded(HTMLParser):
    """What a page loads, and where its links lead."""

    def __init__(self) -> None:
        super().__init__()
        self.loaded, self.places, self.jumps = list[str](), set[str](), set[str]()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in {"src", "srcset", "poster", "data"} or (name == "href" and tag != "a"):
                self.loaded.append(value or "")
            elif name == "id":
                self.places.add(value or "")
            elif name == "href" and (value or "").startswith("#"):
                self.jumps.add((value or "")[1:])


def test_report_needs_no_other_file() -> None:
    report = (ROOT / "figures" / "report.html").read_text(encoding="utf-8")
    page = Loaded()
    page.feed(report)
    assert page.loaded and all(source.startswith("data:") for source in page.loaded)
    assert {f"fig{n:02d}" for n in range(1, 10)} <= page.places >= page.jumps
    assert not re.search(r"url\((?!['\"]?(?:data:|#))|@import|\bfetch\(", report)
    assert str(ROOT) not in report


def test_what_runs_with_opencv_4_exists() -> None:
    for listed in noxfile.OPENCV_LONG + noxfile.OPENCV_NUMBERS + noxfile.OPENCV_ELSEWHERE:
        file, _, name = listed.partition("::")
        place, function = ROOT / "tests" / file, name.partition("[")[0]
        assert place.exists() and (not name or f"def {function}(" in place.read_text(encoding="utf-8")), listed
    assert {f"tests/{room}" for room in ("calibration", "matching", "measurement", "rig")} <= {
        name.rpartition("/")[0] for name in noxfile.opencv_tests()
    }
