"""Prove that every processor writes the same bytes: reproduce the paper under other arithmetic, and compare.

Each variant clones the last commit into a folder of its own, executes all notebooks there with other kernels of
OpenBLAS, numpy, OpenCV or numba, and its `figures/` and `notebooks/` are held against the baseline's, byte by byte. A
variant replaces what `stereolib.reproduction.kernels` would pin. Only what this processor can do is tried.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from stereolib.base import ROOT
from stereolib.paper import Published, published

COMPARED = ("figures", "notebooks")
#: Files that may differ, each with its reason.
MAY_DIFFER = {
    "notebooks/01_calibration.ipynb": "lenses of eight and more coefficients end in a flat valley, somewhere else with "
    "other kernels: curves of two pictures move by a fraction of a pixel, no number does",
}
EXTRA_DIGITS = 8  # behind the printed ones, to see how far a number stands from where its rounding turns
LEAST_MARGIN = 10.0  # times its spread between processors
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])")
_TEXTS = {".csv", ".ipynb", ".yaml"}
_OURS = (
    "OPENBLAS_CORETYPE", "NPY_DISABLE_CPU_FEATURES", "OPENCV_CPU_DISABLE", "NUMBA_CPU_NAME", "STEREOLIB_FIGURES",
)  # fmt: skip
_CV_AVX2, _CV_AVX512_SKX = 11, 256  # OpenCV's numbers of them, for which Python has no names


def variants() -> dict[str, dict[str, str]]:
    """Name and environment of every variant that this processor can run, the baseline first."""
    made: dict[str, dict[str, str]] = {"baseline": {}, "folder": {}}
    if platform.machine().lower() not in ("x86_64", "amd64") or not cv2.checkHardwareSupport(_CV_AVX2):
        return made
    found = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    wide = [name for name in found if name.startswith(("X86_V4", "AVX512"))]
    made["blas-haswell"] = {"OPENBLAS_CORETYPE": "Haswell"}
    if wide:
        made |= {f"blas-{name.lower()}": {"OPENBLAS_CORETYPE": name} for name in ("SkylakeX", "Cooperlake")}
        made["numpy-avx512"] = {"NPY_DISABLE_CPU_FEATURES": ""}
        made["numpy-no-avx512"] = {"NPY_DISABLE_CPU_FEATURES": " ".join(wide)}
    made["numpy-no-avx2"] = {"NPY_DISABLE_CPU_FEATURES": " ".join(found)}
    skx = ",AVX512-SKX" if cv2.checkHardwareSupport(_CV_AVX512_SKX) else ""
    made["opencv-no-avx2"] = {"OPENCV_CPU_DISABLE": "AVX2" + skx}
    made["numba-generic"] = {"NUMBA_CPU_NAME": "generic"}
    made["all"] = (
        made["numpy-no-avx2"]
        | made["opencv-no-avx2"]
        | made["numba-generic"]
        | made.get("blas-skylakex", made["blas-haswell"])
    )
    return made


def reproduce(folder: Path, environment: dict[str, str], jobs: int) -> dict[str, str]:
    """Clone the last commit into a folder and execute it there; return the sha256 of each file compared."""
    subprocess.run(["git", "clone", "--quiet", str(ROOT), str(folder)], check=True)
    command = [sys.executable, "-m", "stereolib", "reproduce", "--accept", "--jobs", str(jobs)]
    inherited = {name: value for name, value in os.environ.items() if name not in _OURS}
    env = inherited | {"PYTHONPATH": str(folder)} | environment
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{folder.name}: reproduce failed\n{done.stderr}")
    return hashes(folder)


def hashes(folder: Path) -> dict[str, str]:
    """Sha256 of each file of `COMPARED`, by its path in a checkout."""
    files = (path for name in COMPARED for path in sorted((folder / name).rglob("*")) if path.is_file())
    return {path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def text_of(path: Path) -> str:
    """What a file prints: a notebook's text outputs, a table as it is, nothing of a picture."""
    if path.suffix not in _TEXTS or not path.is_file():
        return ""
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".ipynb":
        return text
    outputs = [output for cell in json.loads(text)["cells"] for output in cell.get("outputs", [])]
    shown = (output.get("text") or output.get("data", {}).get("text/plain", "") for output in outputs)
    return "\n".join("".join(part) for part in shown)


def moved(before: str, after: str) -> str:
    """Say how far the numbers of two texts are apart, or that words are."""
    if before == after:
        return "no number"
    a, b = (_NUMBER.findall(text) for text in (before, after))
    if _NUMBER.split(before) != _NUMBER.split(after):
        return "words"
    apart = [abs(float(x) - float(y)) / max(abs(float(x)), abs(float(y))) for x, y in zip(a, b, strict=True) if x != y]
    return f"{len(apart)} numbers, by up to {max(apart):.1e} of themselves"


def margins(one: Path, other: Path) -> list[tuple[float, str]]:
    """Distance of each of the ledger's numbers from the next rounding, in units of its spread, the least first."""
    found = []
    ledgers = [read_ledger(folder / "figures" / "ledger.csv") for folder in (one, other)]
    for row, again in zip(*ledgers, strict=True):
        if _NUMBER.split(row["ours"]) != _NUMBER.split(again["ours"]):
            found.append((0.0, f"{row['id']}: {row['ours']} against {again['ours']}"))
            continue
        for (a, digits), (b, _) in zip(
            *(numbers(published()[row["id"]], r["ours"]) for r in (row, again)), strict=True
        ):
            unit = 10.0**-digits
            spread = max(abs(float(a) - float(b)), unit * 10.0**-EXTRA_DIGITS)
            distance = unit * abs(abs(float(a)) / unit % 1 - 0.5)
            found.append((distance / spread, f"{row['id']}: {a} ± {spread:.0e}"))
    return sorted(found)


def numbers(item: Published, ours: str) -> list[tuple[str, int]]:
    """The computed numbers of a row's text, each with the decimals that the ledger shows of it."""
    if item.numeric:
        places = np.broadcast_to(item.places, np.shape(item.value)).ravel()
        return list(zip(_NUMBER.findall(ours), places.tolist(), strict=True))
    found = []
    for condition in item.conditions.values():
        before, after = map(re.escape, condition.says.split("{}"))
        number = re.search(f"{before}({_NUMBER.pattern}){after}: (?:yes|no)", ours)
        found += [(number[1], condition.digits)] if number else []  # NaN and infinity have no digits
    return found


def read_ledger(path: Path) -> list[dict[str, str]]:
    """Rows of a ``ledger.csv``."""
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def look_behind_the_rounding(root: Path, everything: dict[str, str], jobs: int) -> int:
    """Reproduce twice with more digits, as pinned and with all kernels exchanged; count numbers with little margin."""
    extra = {"STEREOLIB_EXTRA_DIGITS": str(EXTRA_DIGITS)}
    for name, environment in (("digits", {}), ("digits-all", everything)):
        print(f"[margins] {name}: {environment or 'as pinned'} ...", flush=True)
        reproduce(root / name, environment | extra, jobs)
    found = margins(root / "digits", root / "digits-all")
    near = [text for margin, text in found if margin < LEAST_MARGIN]
    print(f"{len(found)} numbers of the ledger; the least margin is {found[0][0]:.3g} times the spread ({found[0][1]})")
    for text in near:
        print(f"  less than {LEAST_MARGIN:g} times: {text}")
    return len(near)


def main() -> int:
    """Run the variants asked for; exit code 1 if a file differs that `MAY_DIFFER` does not name."""
    known = variants()
    parser = argparse.ArgumentParser(
        description=__doc__,
        epilog="example:\n  python benchmarks/same.py --only blas-haswell numpy-no-avx2",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    names = ", ".join(list(known)[1:])
    parser.add_argument("--only", nargs="+", metavar="VARIANT", choices=[*known], help=f"of {names}; default: all")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="notebooks at once (default: 2)")
    parser.add_argument("--no-margins", action="store_true", help="do not look behind the rounding of the ledger")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="clone into this empty folder and leave it there")
    arguments = parser.parse_args()
    chosen = ["baseline", *(name for name in arguments.only or known if name != "baseline")]
    differ: dict[str, list[str]] = {}
    near = 0
    with tempfile.TemporaryDirectory(prefix="same-") as temporary:
        root = (arguments.keep or Path(temporary)).resolve()
        for number, name in enumerate(chosen, start=1):
            print(f"[{number}/{len(chosen)}] {name}: {known[name] or 'as pinned'} ...", flush=True)
            began = time.perf_counter()
            found = reproduce(root / name, known[name], arguments.jobs)
            if name == "baseline":
                baseline, committed = found, hashes(ROOT)
                differ["committed"] = [
                    file for file in baseline | committed if baseline.get(file) != committed.get(file)
                ]
            else:
                differ[name] = [file for file in baseline | found if baseline.get(file) != found.get(file)]
            files = differ["committed" if name == "baseline" else name]
            print(f"    {time.perf_counter() - began:.0f} s, {len(files)} of {len(found)} files differ", flush=True)
            for file in files:
                gap = moved(
                    text_of(root / "baseline" / file), text_of((ROOT if name == "baseline" else root / name) / file)
                )
                print(f"    {file}: {gap} moved; {MAY_DIFFER.get(file, '')}".rstrip("; "), flush=True)
        if not arguments.no_margins and "all" in known:
            near = look_behind_the_rounding(root, known["all"], arguments.jobs)
    unnamed = {file for files in differ.values() for file in files} - MAY_DIFFER.keys()
    print("\nfiles that differ from the baseline")
    print(*(f"  {name:16} {len(files)}" for name, files in differ.items()), sep="\n")
    print(f"{len(unnamed)} files differ without a reason" if unnamed else "the same bytes everywhere")
    return 1 if unnamed or near else 0


if __name__ == "__main__":
    sys.exit(main())
