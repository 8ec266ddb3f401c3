"""Build stereolib's environment and run its commands, with the standard library alone.

``make`` calls this file, and so can anyone without make, on Windows too::

    python bootstrap.py reproduce

The environment stands in ``.venv`` and holds exactly the pins of ``requirements.txt``. It is built when it is missing
or stale (the pins, ``pyproject.toml`` or the place of this folder changed) and left alone otherwise. This file
must stay readable for old Pythons (no syntax newer than 3.6), so that these can say what they lack.
"""

import ast
import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent
VENV = ROOT / ".venv"
STAMP = VENV / "stereolib.stamp"
OPENCV4 = "opencv-python-headless==4.14.0.94"  # the oldest major that pyproject.toml admits
OPENCV4_DIR = VENV / "opencv4"
TESTS_TIMEOUT_S = 2700  # for one step; longer than two stalled notebook runs with their retries
UNIT_TESTS = ["-m", "pytest", "tests", "-n", "2", "--dist", "loadfile", "-q"]
# The tests of the repository itself do not depend on OpenCV: once is enough.
OPENCV4_TESTS = [
    *UNIT_TESTS,
    "--ignore=tests/test_repository.py",
    "--ignore=tests/test_notebooks.py",
    "--ignore=tests/test_cli.py",
]
PINS = ["--universal", "--python-version", "3.11", "--fork-strategy", "fewest"]

HELP = """\
stereolib: the paper's figures, tables and numbers again, each beside the printed value.

  make reproduce      run every notebook, redraw all figures, print the verdict table
  make test           unit tests with both OpenCV majors, then the notebooks' outputs compared
  make lab            open the notebooks in JupyterLab
  make bench          measure speed and accuracy into benchmarks/results/
  make data           render the virtual recordings in data/virtual again
  make clean          remove the environment, caches and half-finished work

For those who change the project:
  make setup          only build or refresh .venv
  make test-opencv4   unit tests with OpenCV 4
  make lint           ruff and mypy;  make format  lets ruff format
  make pins           compile requirements.txt from pyproject.toml again

Each command builds .venv itself when needed. Choose the Python with make PYTHON=python3.12 reproduce, and hand
options on with make reproduce ARGS="03 --check".
Without make: python bootstrap.py reproduce 03 --check      (Windows: py bootstrap.py reproduce)
"""


class SetupError(Exception):
    """Something the machine lacks; the text names it and the fix."""


def check_python() -> None:
    """Refuse a Python that cannot build the environment, and say what to install."""
    version = ".".join(str(part) for part in sys.version_info[:2])
    if sys.version_info < (3, 11):  # noqa: UP036 (this file is also read by old Pythons)
        raise SetupError(
            f"stereolib needs Python 3.11 or newer; {sys.executable} is {version}.\n"
            "  Install a newer one (Debian/Ubuntu: sudo apt install python3 python3-venv; macOS: brew install\n"
            "  python@3.13; Windows: winget install Python.Python.3.13), then name it:\n"
            "  make PYTHON=python3.13 reproduce   or   python3.13 bootstrap.py reproduce"
        )
    try:
        import ensurepip  # noqa: F401
        import venv  # noqa: F401
    except ImportError as error:
        raise SetupError(
            f"Python {version} ({sys.executable}) has no {error.name} module, which makes environments.\n"
            f"  Debian/Ubuntu: sudo apt install python{version}-venv; Fedora ships it with python3; elsewhere install\n"
            "  Python from python.org. Then run the same command again."
        ) from None


def clean_environ() -> dict:
    """Return the environment for children, without what another active environment would mix in."""
    environ = dict(os.environ)
    for name in ("VIRTUAL_ENV", "CONDA_PREFIX", "PYTHONHOME", "PYTHONPATH"):
        environ.pop(name, None)
    environ["PYTHONNOUSERSITE"] = "1"
    return environ


def venv_python() -> Path:
    return VENV / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def run(arguments: list, environ: "dict | None" = None, timeout_s: "float | None" = None) -> int:
    """Run the environment's Python; a child that is interrupted may finish its own clean-up."""
    command = [str(venv_python()), *arguments]
    child = subprocess.Popen(command, cwd=str(ROOT), env=environ or clean_environ())
    try:
        return child.wait(timeout_s)
    except subprocess.TimeoutExpired:
        child.kill()
        child.wait()
        print(f"stopped after {timeout_s:.0f} s: {' '.join(arguments)}", file=sys.stderr)
        return 124
    except KeyboardInterrupt:
        try:
            child.wait(20)
        except (subprocess.TimeoutExpired, KeyboardInterrupt):
            child.kill()
        return 130


def pip_settings(listing: str) -> dict:
    """Read ``pip config list``: what the command line of ``pip install`` would use, by option name."""
    ranks = {"global": 0, "install": 1, ":env:": 2}
    found = {}  # type: dict
    for line in listing.splitlines():
        key, _, text = line.partition("=")
        section, _, name = key.rpartition(".")
        try:
            value = ast.literal_eval(text)
        except (SyntaxError, ValueError):
            continue
        if section in ranks and (name not in found or ranks[section] > found[name][0]):
            found[name] = (ranks[section], str(value))
    return {name: " ".join(value.split()) for name, (_, value) in found.items()}


def uv_environ(listing: str, environ: dict) -> dict:
    """Say pip's own configuration (mirror, certificate, time-out) in uv's variables.

    uv does not read pip's files. A variable that is set already wins, and nothing is printed or stored.
    """
    settings = pip_settings(listing)
    result = dict(environ)
    translation = [
        ("index-url", "UV_DEFAULT_INDEX", " "),
        ("extra-index-url", "UV_INDEX", " "),
        ("find-links", "UV_FIND_LINKS", ","),
        ("no-index", "UV_NO_INDEX", " "),
        ("trusted-host", "UV_INSECURE_HOST", " "),
        ("cert", "SSL_CERT_FILE", " "),
        ("proxy", "ALL_PROXY", " "),
        ("default-timeout", "UV_HTTP_TIMEOUT", " "),
        ("timeout", "UV_HTTP_TIMEOUT", " "),
    ]
    for option, variable, separator in translation:
        if settings.get(option):
            result.setdefault(variable, separator.join(settings[option].split()))
    # pip takes the best version of all its indexes; uv would stop at the first that knows the name.
    result.setdefault("UV_INDEX_STRATEGY", "unsafe-best-match")
    return result


def install(arguments: list) -> None:
    """Install with uv, and with pip where uv fails."""
    python = str(venv_python())
    environ = clean_environ()
    listing = subprocess.run(
        [python, "-m", "pip", "config", "list"],
        env=environ,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ).stdout
    if run(["-m", "uv", "pip", "install", "--python", python, *arguments], uv_environ(listing, environ)) == 0:
        return
    print("uv could not install the packages; trying pip.", flush=True)
    if run(["-m", "pip", "install", "--disable-pip-version-check", *arguments]) != 0:
        raise SetupError(
            "the packages could not be installed; the lines above say why.\n"
            "  No network? The first run needs it once, for about 200 MB. Behind a mirror or a proxy, tell pip\n"
            "  about it (pip config set ...): this set-up follows pip. Then run the same command again."
        )


def fingerprint() -> str:
    """Return the hash of all that the environment is made from, and of where it stands."""
    digest = hashlib.sha256(str(ROOT).encode())
    for name in ("requirements.txt", "pyproject.toml"):
        digest.update((ROOT / name).read_bytes())
    return digest.hexdigest()


def is_fresh() -> bool:
    """Tell whether the environment is whole and belongs to the pins, and to the Python asked for."""
    try:
        recorded = STAMP.read_text().split()
    except OSError:
        return False
    asked = "{}.{}".format(*sys.version_info[:2])
    other_python = bool(os.environ.get("PYTHON")) and recorded[1:] != [asked]
    return recorded[:1] == [fingerprint()] and venv_python().exists() and not other_python


def setup() -> None:
    """Build or refresh ``.venv``; do nothing when it is fresh."""
    if is_fresh():
        return
    check_python()
    base = getattr(sys, "_base_executable", "") or sys.executable  # not the Python inside another environment
    asked = "{}.{}".format(*sys.version_info[:2])
    probe = "import sys, pip; print('%d.%d' % sys.version_info[:2])"
    try:
        have = subprocess.run(
            [str(venv_python()), "-c", probe],
            env=clean_environ(),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        ).stdout.strip()
    except OSError:
        have = ""
    if not have or (os.environ.get("PYTHON") and have != asked):
        print(f"Building .venv with Python {asked} ...", flush=True)
        if subprocess.call([base, "-m", "venv", "--clear", str(VENV)], env=clean_environ()) != 0:
            raise SetupError(f"{base} could not make {VENV}, as said above. Is the folder writable, the disk full?")
        have = asked
    else:
        print("Refreshing .venv ...", flush=True)
    if STAMP.exists():
        STAMP.unlink()
    shutil.rmtree(str(OPENCV4_DIR), ignore_errors=True)
    pins = (ROOT / "requirements.txt").read_text().splitlines()
    uv = next(pin for pin in pins if pin.startswith("uv=="))
    if run(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", uv]) != 0:
        print("uv itself could not be installed.", flush=True)
    install(["-r", "requirements.txt"])
    install(["--no-deps", "--no-build-isolation", "-e", "."])
    # Written last: an interrupted set-up is stale and is taken up again.
    STAMP.write_text(f"{fingerprint()} {have}\n")


def opencv4_environ() -> dict:
    """Put OpenCV 4 before the pinned OpenCV, in a folder of its own inside the environment."""
    if not OPENCV4_DIR.is_dir():
        unfinished = OPENCV4_DIR.with_suffix(".new")
        shutil.rmtree(str(unfinished), ignore_errors=True)
        install(["--no-deps", "--target", str(unfinished), OPENCV4])
        unfinished.rename(OPENCV4_DIR)
    environ = clean_environ()
    environ["PYTHONPATH"] = str(OPENCV4_DIR)
    environ["STEREOLIB_EXPECT_OPENCV"] = OPENCV4.partition("==")[2]
    return environ


def test(arguments: list) -> int:
    """Run all tests; every step runs even when one before it failed."""
    if arguments:
        return run(["-m", "pytest", *arguments], timeout_s=TESTS_TIMEOUT_S)
    steps = [
        ("unit tests", UNIT_TESTS, None),
        ("unit tests with OpenCV 4", OPENCV4_TESTS, opencv4_environ()),
        ("notebooks", ["tests/run_notebooks.py"], None),
    ]
    codes = []
    for title, step, environ in steps:
        print(f"== {title}", flush=True)
        codes.append(run(step, environ, TESTS_TIMEOUT_S))
        if codes[-1] == 130:
            return 130
    for (title, _, _), code in zip(steps, codes):  # noqa: B905 (old Pythons read this)
        print(f"{title}: {'ok' if code == 0 else 'FAILED'}")
    return max(codes)


def bench(arguments: list) -> int:
    scripts = sorted((ROOT / "benchmarks").glob("bench_*.py"))
    return max([run([str(script), *arguments]) for script in scripts], default=0)


def lint() -> int:
    checks = [["ruff", "check"], ["ruff", "format", "--check"], ["mypy"]]
    return max([run(["-m", *check]) for check in checks])


def pins() -> int:
    arguments = ["pyproject.toml", "--extra", "dev", *PINS, "--no-annotate", "--no-header", "--upgrade"]
    return run(["-m", "uv", "pip", "compile", *arguments, "--quiet", "-o", "requirements.txt"])


def clean() -> int:
    names = [".venv", ".staging", ".pytest_cache", ".mypy_cache", ".ruff_cache", ".hypothesis", "build", "dist"]
    folders = [ROOT / name for name in names]
    for name in ("stereolib", "tests", "benchmarks", "notebooks"):
        folders += [*(ROOT / name).rglob("__pycache__"), *(ROOT / name).rglob(".ipynb_checkpoints")]
    for folder in folders:
        shutil.rmtree(str(folder), ignore_errors=True)
    return 0


COMMANDS = {
    "setup": lambda rest: 0,
    "reproduce": lambda rest: run(["-m", "stereolib", "reproduce", *rest]),
    "test": test,
    "test-opencv4": lambda rest: run([*OPENCV4_TESTS, *rest], opencv4_environ(), TESTS_TIMEOUT_S),
    "bench": bench,
    "data": lambda rest: run(["-m", "stereolib", "data", *(rest or ["build"])]),
    "lab": lambda rest: run(["-m", "jupyter", "lab", "notebooks/00_index.ipynb", *rest]),
    "lint": lambda rest: lint(),
    "format": lambda rest: max(run(["-m", "ruff", "check", "--fix"]), run(["-m", "ruff", "format"])),
    "pins": lambda rest: pins(),
}


def main(argv: list) -> int:
    """Run one command; return its exit code."""
    name = argv[0] if argv else "help"
    if name in ("help", "-h", "--help"):
        print(HELP)
        return 0
    if name == "clean":
        return clean()
    if name not in COMMANDS:
        print(f"bootstrap.py: no command {name!r}.\n\n{HELP}", file=sys.stderr)
        return 2
    try:
        setup()
        return COMMANDS[name](argv[1:])
    except SetupError as error:
        print(f"\nstereolib: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
