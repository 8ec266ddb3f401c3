"""The sessions behind ``make test``, ``lint``, ``bench``, ``pins``; and the matrix of Pythons and OpenCV majors.

``make`` runs them with the nox of ``.venv``, and most run in ``.venv`` itself. Those that need another environment get
one below ``.venv/nox``, made once and made again with ``.venv``. By hand: ``.venv/bin/nox --list``.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import nox

ROOT = Path(__file__).resolve().parent
PINS = ROOT / "requirements.txt"
OPENCV4 = "opencv-python-headless==4.14.0.94"  # the oldest that pyproject.toml admits
OPENCV5 = next(pin for pin in PINS.read_text(encoding="utf-8").splitlines() if pin.startswith("opencv-"))
ADDITIONS = {  # pinned apart, on top of the rest
    "explore": ["notebooks", "explore"],
    "browser": ["browser"],
    "nbgrader": ["notebooks", "nbgrader"],
    "site": ["dev", "site"],
}
PYTHONS = ["3.11", "3.12", "3.13", "3.14"]

# Without nbval, whose import takes each worker a second: the notebooks alone need it. In the order of
# tests/conftest.py, which begins with slow files; xdist would begin with those that hold many tests.
PYTEST = ["-m", "pytest", "-p", "no:nbval", "-n", "2", "--dist", "loadfile", "--no-loadscope-reorder", "-q"]
UNIT_TESTS = [*PYTEST, "--doctest-modules", "tests", "stereolib"]
# With OpenCV 4 too: of each file that calls it, the tests of that file; the numbers from boards, pairs and boxes to
# their end; and a test for each statement that calls OpenCV and that none of these executes. Left out is what takes
# long and calls only what others do too: the session `matrix` runs all with each OpenCV.
OPENCV_LONG = [
    "calibration/test_capture_session.py",
    "calibration/test_refinement.py",
    "cli/test_calibrate_laser.py",
    "cli/test_disparity.py",
    "cli/test_map.py",
    "mapping/test_placing.py",
    "matching/test_pipelines.py",
    "measurement/test_edges_beyond.py",
    "notebook/test_baked.py",
    "notebook/test_chain.py",
    "notebook/test_python_code.py",
    "plotting/test_board_sheet.py",
    "plotting/test_output.py",
    "rig/test_formats.py",
]
OPENCV_NUMBERS = [
    "cli/test_map.py::test_files_of_the_map_agree",
    "matching/test_disparity.py",
    "matching/test_pipelines.py::test_best_beats_plain_matching_and_is_dense",
    "measurement/test_measure.py",
    "test_real_recordings.py",
    "test_untrusted.py",
]
OPENCV_ELSEWHERE = [
    "calibration/test_capture_session.py::test_each_place_is_taken_once_while_the_board_is_still",
    "calibration/test_faults.py::test_pairs_of_each_position_are_listed",
    "calibration/test_refinement.py::test_narrow_rims_in_a_blurred_noisy_picture",
    "calibration/test_wrong_corners.py",
    "cli/test_calibrate.py::test_report_escapes_names_and_does_without_pictures",
    "cli/test_calibrate.py::test_what_the_rim_costs_is_told_beside_what_is_covered",
    "cli/test_calibrate_laser.py::test_squares_counted_in_place_of_corners_are_among_the_causes",
    "cli/test_capture.py::test_bad_input_is_one_line_and_leaves_nothing",
    "cli/test_disparity.py::test_a_picture_of_another_moment_is_told",
    "cli/test_lrf_live.py::test_older_turns_are_pale_and_a_wrong_speed_is_said",
    "cli/test_measure.py::test_how_far_two_poses_lie_apart",
    "mapping/test_assemble.py::test_two_boxes_merge_as_the_slow_twin_does",
    "mapping/test_files.py",
    "mapping/test_placing.py::test_stations_without_a_scan",
    "measurement/test_camera_moves.py::test_a_right_camera_that_rose_is_told_and_corrected",
    "notebook/test_drawings.py::test_slider_of_a_wrong_calibration_says_what_it_does",
    "notebook/test_height_sliders.py",
    "notebook/test_live_page.py",
    "notebook/test_python_code.py::test_code_makes_the_same_map[virtual rig]",
    "notebook/test_python_code.py::test_files_to_take_away_hold_the_map",
    "plotting/test_board_sheet.py::test_corners_are_where_they_should_be",
    "plotting/test_output.py::test_a_photograph_with_axes_keeps_its_pixels_and_the_whole_text",
    "rig/test_formats.py::test_opencv_keeps_every_bit",
    "rig/test_live_pair.py::test_what_a_camera_refuses_is_said_and_the_rest_is_set",
    "rig/test_live_pair.py::test_wrong_sources_are_refused_by_name",
]


def opencv_tests() -> list[str]:
    """Tests to be run with OpenCV 4 too, as said above."""
    files = (ROOT / "stereolib").glob("*/*.py")
    calling = (file for file in files if re.search(r"\bcv2\.\w+\(", file.read_text(encoding="utf-8")))
    own = sorted(f"{file.parent.name}/test_{file.name}" for file in calling)
    there = [name for name in own if name not in OPENCV_LONG and (ROOT / "tests" / name).is_file()]
    return [f"tests/{name}" for name in there + OPENCV_NUMBERS + OPENCV_ELSEWHERE]


CHECKS = [
    "ruff check",
    "ruff format --check",
    "mypy",
    "lint-imports",
    "python tests/support/check_docstrings.py",
    "python tests/support/count_lines.py",
    "check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/ci.yml .github/workflows/pages.yml",
]

# Also where the user keeps none: every process would compile the library, every worker rewrite all tests' assertions.
KEEP_BYTECODE = {"PYTHONDONTWRITEBYTECODE": ""}

nox.options.sessions = ["tests", "test-opencv4", "test-nbgrader", "notebooks"]
nox.options.reuse_existing_virtualenvs = True
nox.options.envdir = str(ROOT / ".venv" / "nox")
nox.options.default_venv_backend = "uv" if shutil.which("uv") else "virtualenv"  # as bootstrap.py


def command(check: str) -> list[str]:
    """Words of a check, its program from the environment that runs nox."""
    program, *words = check.split()
    return [str(shutil.which(program, path=str(Path(sys.executable).parent))), *words]


def run(session: nox.Session, *arguments: str) -> None:
    """Run the Python that runs nox: that of ``.venv``."""
    session.run(sys.executable, *arguments, external=True, env=KEEP_BYTECODE)


def borrow(session: nox.Session) -> None:
    """Let a session's environment find what it lacks in ``.venv``: packages, and nbconvert's templates."""
    session.env["JUPYTER_PATH"] = str(Path(sys.prefix) / "share" / "jupyter")
    where = "import sysconfig; print(sysconfig.get_path('purelib'), end='')"
    own = Path(str(session.run("python", "-c", where, silent=True)))
    shared = subprocess.check_output([sys.executable, "-c", where], text=True)
    (own / "shared.pth").write_text(f"import site; site.addsitedir({shared!r})\n", encoding="utf-8")


@nox.session(venv_backend="none")
def tests(session: nox.Session) -> None:
    """Unit tests and the examples in docstrings, with the pinned OpenCV."""
    run(session, *UNIT_TESTS, *session.posargs)


@nox.session(name="test-opencv4")
def tests_opencv4(session: nox.Session) -> None:
    """Tests of what calls OpenCV, with the oldest OpenCV: `opencv_tests` says which; all else comes from ``.venv``."""
    session.install("--no-deps", OPENCV4)
    borrow(session)
    expected = {"STEREOLIB_EXPECT_OPENCV": OPENCV4.partition("==")[2]}
    session.run("python", *PYTEST, *opencv_tests(), *session.posargs, env=expected | KEEP_BYTECODE)


@nox.session(name="test-nbgrader")
def tests_nbgrader(session: nox.Session) -> None:
    """A course from its release to the points, with nbgrader; all else comes from ``.venv``."""
    session.install("--no-deps", "-r", "requirements-nbgrader.txt")
    borrow(session)
    session.run("python", "-c", "import nbgrader")  # without it, the tests would be skipped
    session.run("python", "-m", "pytest", "-q", "tests/exercises/test_nbgrader.py", *session.posargs, env=KEEP_BYTECODE)


@nox.session(venv_backend="none", default=False)
def browser(session: nox.Session) -> None:
    """The bench and the site's pages in Chromium, as ``make test-browser``, which installs what it needs first."""
    run(session, *PYTEST, "--browser", "tests/browser", *session.posargs)


@nox.session(venv_backend="none")
def notebooks(session: nox.Session) -> None:
    """Every notebook again, its checked outputs and tables compared with the committed ones."""
    run(session, "tests/run_notebooks.py")


@nox.session(python=PYTHONS, default=False)
@nox.parametrize("opencv", [nox.param(OPENCV4, id="opencv4"), nox.param(OPENCV5, id="opencv5")])
def matrix(session: nox.Session, opencv: str) -> None:
    """Unit tests in an environment of their own: each Python with each OpenCV."""
    pins = Path(session.create_tmp()) / "requirements.txt"
    pins.write_text(re.sub(r"^opencv-.*$", opencv, PINS.read_text(encoding="utf-8"), flags=re.MULTILINE))
    session.install("-r", str(pins))
    session.install("--no-deps", "--no-build-isolation", "-e", ".")
    session.run("python", *UNIT_TESTS, *session.posargs)


@nox.session(default=False, reuse_venv=False)
def wheel(session: nox.Session) -> None:
    """Install the package as a user does, with whatever versions come, and try it away from the repository."""
    session.install(".")
    session.run("python", str(ROOT / "tests" / "support" / "try_package.py"), session.create_tmp())


@nox.session(venv_backend="none", default=False)
def lint(session: nox.Session) -> None:
    """All checks, also those after one that failed."""
    failed = [check for check in CHECKS if subprocess.call(command(check), cwd=ROOT)]
    if failed:
        session.error(f"failed: {', '.join(failed)}")


@nox.session(default=False)
def audit(session: nox.Session) -> None:
    """Known vulnerabilities of everything that is pinned; it fails where the package index does not tell of them."""
    session.install("pip-audit")
    files = [PINS, *(ROOT / f"requirements-{name}.txt" for name in ADDITIONS)]
    pinned = [word for file in files for word in ("--requirement", str(file))]
    session.run(
        "pip-audit", "--strict", "--disable-pip", "--no-deps", "--progress-spinner=off", *pinned, *session.posargs
    )


@nox.session(name="format", venv_backend="none", default=False)
def format_(session: nox.Session) -> None:
    """Let ruff mend what it can and lay out the rest."""
    run(session, "-m", "ruff", "check", "--fix", "--exit-zero")
    run(session, "-m", "ruff", "format")


@nox.session(venv_backend="none", default=False)
def site(session: nox.Session) -> None:
    """The site, as ``make site``, which installs what it needs first."""
    run(session, "docs/build_site.py", *session.posargs)


@nox.session(venv_backend="none", default=False)
def bench(session: nox.Session) -> None:
    """Every ``benchmarks/bench_*.py``."""
    for script in sorted((ROOT / "benchmarks").glob("bench_*.py")):
        run(session, str(script), *session.posargs)


@nox.session(venv_backend="none", default=False)
def pins(session: nox.Session) -> None:
    """Compile ``requirements.txt``: one set for every platform and Python, the newest versions; then its additions."""
    one_set = ["--universal", "--python-version", "3.11", "--fork-strategy", "fewest"]
    names_only = ["--no-annotate", "--no-header", "--quiet"]
    compiled = ["-m", "uv", "pip", "compile", "pyproject.toml", *one_set, *names_only]
    versions = session.posargs or ["--upgrade"]  # or, of one package: --upgrade-package NAME
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    most = [f"--extra={name}" for name in project["optional-dependencies"] if name not in ADDITIONS]
    run(session, *compiled, *most, "--output-file", str(PINS), *versions)
    shared = {line.partition(" ;")[0] for line in PINS.read_text(encoding="utf-8").splitlines()}
    for name, extras in ADDITIONS.items():
        file = ROOT / f"requirements-{name}.txt"
        wanted = [f"--extra={extra}" for extra in extras]
        run(session, *compiled, *wanted, "--constraint", str(PINS), "--output-file", str(file), *versions)
        lines = [
            line for line in file.read_text(encoding="utf-8").splitlines() if line.partition(" ;")[0] not in shared
        ]
        file.write_text("\n".join([*lines, ""]), encoding="utf-8")
