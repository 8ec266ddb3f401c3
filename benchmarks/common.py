"""What every benchmark shares: timing two ways of doing the same in turn, and writing the result.

A script measures accuracy, which any machine repeats, and times, which want a machine that does nothing else. They are
written to files of their own (``dimensions.json``, ``dimensions_time.json``), so that either can be measured alone:
``--only accuracy`` or ``--only time``.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import sys
import time
from collections.abc import Callable, Iterable
from importlib.metadata import version
from pathlib import Path
from typing import Any

from scipy.stats import binomtest

import stereolib
from stereolib.base import ROOT, figures_dir, write_atomic
from stereolib.reproduction import code_sha256, update_readme_tables

PAPER_RIG = ("paper/printed_rig.py", "paper/camera_place.py")  # what the virtual rig is made of
COVERAGE = (0.90, 0.99)  # goal: how many of the 95 % intervals hold the truth
RESULTS = Path(__file__).parent / "results"
PACKAGE = Path(stereolib.__file__).resolve().parent
sys.path.append(str(ROOT / "tests"))  # after this module, a benchmark imports `support` as the tests do


def ratio(ours: Callable[[], object], bare: Callable[[], object], rounds: int = 25) -> dict[str, float]:
    """Time two functions in turn and compare.

    The ratio is the median of the rounds' ratios, so that a machine that slows down during the run slows both down.
    """
    ours(), bare()
    times: list[tuple[float, float]] = []
    for k in range(rounds):
        order = (ours, bare) if k % 2 else (bare, ours)
        spent = {}
        for function in order:
            start = time.perf_counter()
            function()
            spent[function] = time.perf_counter() - start
        times.append((spent[ours], spent[bare]))
    return {
        "ours_ms": round(1000 * statistics.median(a for a, _ in times), 3),
        "bare_ms": round(1000 * statistics.median(b for _, b in times), 3),
        "ratio": round(statistics.median(a / b for a, b in times), 4),
    }


def chance_outside(inside: int, count: int) -> float:
    """How probable a share of intervals so far outside the goal is, were it at the goal's nearest end; 1 within."""
    share = inside / count
    end = min(max(share, COVERAGE[0]), COVERAGE[1])
    return 1.0 if share == end else float(binomtest(inside, count, end).pvalue)


def asked(what: str | None) -> set[str]:
    """Read the command line: which of ``"accuracy"`` and ``"time"`` to measure.

    `what` is the script's docstring.
    """
    parser = argparse.ArgumentParser(description=what)
    parser.add_argument("--only", choices=("accuracy", "time"), help="default: both")
    only = parser.parse_args().only
    return {only} if only else {"accuracy", "time"}


def loaded(rooms: Iterable[str]) -> set[str]:
    """Those modules of some rooms that this process has loaded, by name as `code_sha256` takes them.

    What a measurement has loaded is what can have changed it.
    """
    files = (getattr(module, "__file__", None) for module in tuple(sys.modules.values()))
    paths = [Path(file).resolve() for file in files if file]
    names = {path.relative_to(PACKAGE).as_posix() for path in paths if path.is_relative_to(PACKAGE)}
    return {name for name in names if name in rooms or name.partition("/")[0] in rooms}


def save(name: str, result: dict[str, Any], rooms: Iterable[str]) -> None:
    """Write ``results/<name>.json``, print it, quote it in the README.

    With it go the machine, the versions, and the hash of the rooms of the library that were measured, or of single
    modules: the README says at a row when they have changed since.
    """
    packages = ("stereolib", "numpy", "opencv-python-headless", "scipy")
    machine = {"system": platform.system(), "processor": _processor(), "cores": os.cpu_count()}
    versions = {"python": platform.python_version()} | {p: version(p) for p in packages}
    code = {"rooms": sorted(rooms), "sha256": code_sha256(rooms)}
    text = json.dumps({**result, "code": code, "machine": machine, "versions": versions}, indent=1)
    write_atomic(RESULTS / f"{name}.json", text + "\n")
    print(f"{name}: {json.dumps(result)}")
    update_readme_tables(ROOT / "README.md", figures_dir(), RESULTS)


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()
