"""Make the environment ``.venv`` from ``requirements.txt``, and run the project's commands in it.

``make`` calls this file; anyone can, on Windows too: ``python bootstrap.py reproduce``. It needs the standard library
alone, and Pythons from 3.6 on must be able to read it, to say what they lack.
"""

import hashlib
import importlib.util
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

# Python 2 stops at the next line and shows it, so it has to say what is wrong.
NEEDS = f"stereolib needs Python 3.11 or newer; {sys.executable} is older"
ROOT = Path(__file__).resolve().parent
VENV = ROOT / ".venv"
PYTHON = VENV / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
STAMP = VENV / "stereolib.stamp"
ELSEWHERE = ("VIRTUAL_ENV", "CONDA_PREFIX", "PYTHONHOME", "PYTHONPATH")  # other environments, kept out
ENVIRON = dict({k: v for k, v in os.environ.items() if k not in ELSEWHERE}, PYTHONNOUSERSITE="1")

HELP = """\
stereolib: the paper's figures, tables and numbers again, each beside the printed value.
  make reproduce      run every notebook, redraw all figures, print the verdict table
  make test           unit tests with both OpenCV majors, then the notebooks' outputs compared
  make lab            open the notebooks in JupyterLab
  make explore        the whole measurement on one page in the browser; ARGS="LEFT RIGHT": your own pair
  make site           build the site of notebooks, figures and reference into build/site
  make bench          measure speed and accuracy into benchmarks/results/
  make handout        pack the exercises for a class without internet
  make data           render the virtual recordings in data/virtual again
For those who change the project:
  make test-opencv4   tests of what calls OpenCV, with OpenCV 4
  make test-nbgrader  a course graded with nbgrader, from the release to the points
  make test-browser   tests of the page that make explore opens, and of the site, in Chromium
  make same           prove that other processors' kernels give the same files
  make lint           ruff, mypy, the rooms' imports and sizes;  make format  lets ruff format
  make pins           compile requirements.txt from pyproject.toml again
  make setup          only make .venv, which each command makes if needed;  make clean  removes it and the caches
With make PYTHON=python3.12 reproduce ARGS="03 --check"; without make: python bootstrap.py reproduce 03 --check
"""
COMMAND = PYTHON.parent.relative_to(ROOT) / "stereolib"
NEXT = f"Ready. Try first: {COMMAND} report data/virtual --output demo_report (what the demo rig measures, on one page)"
COMMANDS = {  # what each hands to the environment's Python; nox's sessions stand in noxfile.py
    **{name: ["-m", "nox", "-s", name, "--"] for name in ("bench", "site", "lint", "format", "pins")},
    **{name: ["-m", "nox", "-s", name, "--"] for name in ("test-opencv4", "test-nbgrader")},
    "setup": ["-c", f"print({NEXT!r})"],
    "reproduce": ["-m", "stereolib", "reproduce"],
    "test": ["-m", "nox", "-s", "tests", "test-opencv4", "test-nbgrader", "notebooks", "--"],
    "data": ["-m", "stereolib", "data", "build"],
    "lab": ["-m", "jupyter", "lab", "notebooks/00_two_pictures.ipynb"],
    "same": ["benchmarks/same.py"],
    "handout": ["-m", "stereolib", "handout"],
    "explore": ["-m", "stereolib", "explore"],
    "test-browser": ["-m", "pytest", "--browser", "-n", "2", "--dist", "loadfile", "-q", "tests/browser"],
}
ROOM_MB = 900  # of .venv and of what is unpacked on the way
WHY = """the lines above say why. No network? The first run needs it once.
  Behind a mirror or a proxy, tell pip about it (pip config set ...), then run the same command again."""
WHY_WHEELS = """the lines above say why. Are this Python and system the ones that START.txt names?
  The packages in the folder wheels are for these alone. With a network: delete the folder, then run it again."""
ADDITIONS = {"explore": ["explore"], "test-browser": ["explore", "browser"], "site": ["site"]}  # pins of their own


def check_python() -> None:
    """Refuse a Python that cannot make the environment, and say what to install."""
    version = "{}.{}".format(*sys.version_info)
    if sys.version_info < (3, 11):  # noqa: UP036 (old Pythons read this too)
        raise SystemExit(
            f"{NEEDS}: {version}. Install a newer one (Debian:\n"
            "  sudo apt install python3 python3-venv; macOS: brew install python@3.13; Windows: winget install\n"
            "  Python.Python.3.13), then name it: make PYTHON=python3.13 reproduce, python3.13 bootstrap.py reproduce"
        )
    missing = [name for name in ("venv", "ensurepip") if importlib.util.find_spec(name) is None]
    if missing:
        fix = f"Debian: sudo apt install python{version}-venv; elsewhere install Python from python.org."
        raise SystemExit(f"stereolib: {sys.executable} has no {missing[0]} to make environments with.\n  {fix}")


def stamp() -> str:
    """Hash of what the environment is made from and of where it stands, and the Python that makes it."""
    parts = [str(ROOT).encode(), *((ROOT / name).read_bytes() for name in ("requirements.txt", "pyproject.toml"))]
    return "{} {}.{}".format(hashlib.sha256(b"".join(parts)).hexdigest(), *sys.version_info)


def is_fresh() -> bool:
    """Tell whether the environment is whole and of today's pins, made by any Python unless PYTHON names one."""
    made = STAMP.read_text() if STAMP.exists() and PYTHON.exists() else ""
    return made == stamp() or (not os.environ.get("PYTHON") and made.split(" ")[0] == stamp().split(" ")[0])


def why() -> str:
    """Tell the likeliest reason of a failed set-up: no right to write, no room, or no network."""
    for folder in (ROOT, VENV):
        if folder.exists() and not os.access(str(folder), os.W_OK):
            return f"{folder} cannot be written. Remove it if it is a .venv of somebody else, or copy the project."
    for folder in (Path(tempfile.gettempdir()), ROOT):
        if shutil.disk_usage(str(folder)).free < ROOM_MB * 1e6:
            return (
                f"{folder} has less than {ROOM_MB} MB free. Make room; for temporary files, TMPDIR names another place."
            )
    return WHY_WHEELS if (ROOT / "wheels").is_dir() else WHY


def setup() -> None:
    """Make the environment and write the stamp last, so that an interrupted set-up is taken up again."""
    check_python()
    print("Setting up .venv (the first time some minutes; 300 MB to load, 1.2 GB on the disk) ...", flush=True)
    base = getattr(sys, "_base_executable", sys.executable)  # not the Python inside another environment
    made = subprocess.call([base, "-m", "venv", "--clear", str(VENV)], env=ENVIRON) == 0
    if not (made and install("-r", "requirements.txt") and install("--no-deps", "--no-build-isolation", "-e", ".")):
        raise SystemExit("stereolib: .venv could not be made; " + why())
    if not shutil.which("uv"):  # which leaves compiling to who imports; pip would do it on one core, tests and all
        words = ["-m", "compileall", "-qq", "-x", r"[\\/]tests?[\\/]", "-j", "0", str(VENV / "lib")]
        subprocess.call([str(PYTHON), *words], env=ENVIRON)
    STAMP.write_text(stamp())


def install(*wanted: str) -> bool:
    """Install something into the environment: by uv, which is quicker; by pip where uv fails; a handout from itself."""
    if (ROOT / "wheels").is_dir():
        wanted = ("--no-index", "--find-links", "wheels", *wanted)
    pip = [str(PYTHON), "-m", "pip", "install", "--quiet", *([] if STAMP.exists() else ["--no-compile"])]
    uv = [shutil.which("uv") or "", "pip", "install", "--quiet", "--python", str(PYTHON)]
    return any(subprocess.call([*i, *wanted], cwd=str(ROOT), env=ENVIRON) == 0 for i in ([uv, pip] if uv[0] else [pip]))


def add(name: str) -> None:
    """Install what one command needs on top of the rest, unless its own stamp says that it is there."""
    pins, made = ROOT / f"requirements-{name}.txt", VENV / f"stereolib-{name}.stamp"
    if made.exists() and made.read_bytes() == pins.read_bytes():
        return
    print(f"Adding {pins.name} to .venv ...", flush=True)
    if not install("-r", pins.name):
        raise SystemExit(f"stereolib: {pins.name} could not be installed; " + why())
    made.write_bytes(pins.read_bytes())


def main(argv: "list[str]") -> int:
    """Run one command; return its exit code."""
    name, options = (argv or ["help"])[0], argv[1:]
    if name in ("help", "-h", "--help"):
        print(HELP)
        return 0
    if name == "clean":
        made = (ROOT / name for name in (".venv", ".staging", ".hypothesis", "build", "dist"))
        for folder in [*made, *ROOT.glob(".*_cache"), *ROOT.rglob("__pycache__"), *ROOT.rglob(".ipynb_checkpoints")]:
            shutil.rmtree(str(folder), ignore_errors=True)
        return 0
    if name not in COMMANDS:
        raise SystemExit(f"stereolib: no command {name!r}.\n\n{HELP}")
    try:
        if not is_fresh():
            setup()
        for addition in ADDITIONS.get(name, []):
            add(addition)
    except OSError as error:
        raise SystemExit(f"stereolib: .venv could not be made: {error}; {why().replace(WHY, 'is it yours?')}") from None
    command = ["-m", "pytest"] if name == "test" and options else COMMANDS[name]
    child = subprocess.Popen([str(PYTHON), *command, *options], cwd=str(ROOT), env=ENVIRON)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the child's, which cleans up
    return child.wait()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
