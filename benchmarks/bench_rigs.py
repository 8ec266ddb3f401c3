"""What real rigs do to the sizes: virtual boxes, each disturbance a row, refusals beside every accuracy.

Scenes are numbered. Limits and priors of `stereolib.measurement` were chosen while those from 0 on were looked at; the
figures are of those from 5,000 on, which took no part in that. ``--chosen-on`` measures the former.

About an hour on two cores. What was rendered and measured is kept in ``benchmarks/.cache``: a run that was
interrupted goes on, and so does one after single rows (``--row NAME``), while the code is the same. ``--quick``
measures 20 scenes of each row; only a whole run writes ``results/rigs.json``.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict
from multiprocessing import Pool
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from common import PAPER_RIG, RESULTS, chance_outside, loaded, save
from support.box_scenes import CACHE, NAMES
from support.disturbances import ROWS, SCENES, Told, case, tell
from tqdm.auto import tqdm

from stereolib.base import ROOT, write_atomic
from stereolib.reproduction import code_sha256

JUDGED = 5_000  # number of the first scene that no setting was chosen on
SCENES_A_ROW, QUICK = 160, 20  # of rows with `Row.times` so many times as many
ROOMS = ("base", "rig", "laser", "calibration", "matching", "measurement", *PAPER_RIG, "virtual")
INTERVAL_STDS = 1.96  # of a 95 % interval
Kept = dict[tuple[str, int], Told]  # by row and scene
Work = tuple[tuple[str, ...], int]  # rows, and the scene


def of_scene(rows: tuple[str, ...], number: int) -> tuple[dict[str, Told], set[str]]:
    """Measure one scene with each disturbance, and tell which modules that took."""
    cv2.setNumThreads(1)
    return {row: tell(*case(row, number), of_pair=ROWS[row].of_pair) for row in rows}, loaded(ROOMS)


def of_scenes(work: list[Work], jobs: int) -> Iterator[tuple[dict[str, Told], set[str]]]:
    """Measure scenes in processes that live as long as the run does: each makes its rigs and patterns once.

    joblib's would end again and again, since what they keep looks like a leak to it.
    """
    if jobs == 1:
        yield from (of_scene(*one) for one in work)
        return
    with Pool(jobs) as pool:
        yield from pool.imap(_of_scene, work)


def _of_scene(one: Work) -> tuple[dict[str, Told], set[str]]:
    return of_scene(*one)


def summary(told: list[Told], silent_pct: float) -> dict[str, Any]:
    """What a row of the bench says."""
    found = {name: np.array([t.off[name] for t in told if name in t.off]).reshape(-1, 2) for name in NAMES}
    everything = np.concatenate(list(found.values()))
    inside = int((np.abs(everything[:, 1]) < INTERVAL_STDS).sum())
    measurable = [t for t in told if t.measurable]
    lacking = [t for t in measurable if len(t.off) < len(NAMES)]
    silent = [max((abs(pct) for pct, _ in t.off.values()), default=0.0) > silent_pct for t in told]
    wide = [t for t in measurable if t.wide]
    return {
        "scenes": len(told),
        "sizes": len(everything),
        **_spread(everything),
        "binomial_p": float(f"{chance_outside(inside, len(everything)):.2g}") if len(everything) else None,
        "silent": int(sum(silent)),
        "silent_beyond_pct": silent_pct,
        "refused": sum(t.nothing for t in told),
        "lacking": sum(len(t.off) < len(NAMES) for t in told),
        "measurable": len(measurable),
        "measurable_lacking": len(lacking),
        "measurable_lacking_pct": round(100 * len(lacking) / len(measurable), 1) if measurable else None,
        "wide": len(wide),
        "wide_lacking": sum(len(t.off) < len(NAMES) for t in wide),
        "measurable_sizes_missing": sum(len(NAMES) - len(t.off) for t in measurable),
        "because": dict(Counter(t.why for t in told if t.why).most_common()),
        **{name: {"told": len(pairs), **_spread(pairs)} for name, pairs in found.items()},
    }


def _spread(pairs: np.ndarray) -> dict[str, float]:
    if not len(pairs):
        return {}
    pct, z = np.abs(pairs).T
    return {
        "median_pct": round(float(np.median(pct)), 3),
        "p95_pct": round(float(np.percentile(pct, 95)), 2),
        "within_1_sigma_pct": round(100 * float((z < 1).mean()), 1),
        "within_2_sigma_pct": round(100 * float((z < INTERVAL_STDS).mean()), 1),
        "rms_z": round(float(np.sqrt((z**2).mean())), 2),
    }


def run(rows: list[str], first: int, scenes: int, jobs: int) -> tuple[dict[str, dict[str, Any]], set[str]]:
    """Measure rows, those of the same scenes together, but for what was kept; and the modules that this took."""
    file = CACHE / f"rigs_{_code()}.jsonl"
    told, modules = kept(file)
    groups = [tuple(row for row in rows if ROWS[row].scenes == kind) for kind in SCENES]
    of = {row: range(first, first + scenes * ROWS[row].times) for row in rows}
    all_of = [(group, n) for group in groups if group for n in max((of[row] for row in group), key=len)]
    work = [(left, n) for group, n in all_of if (left := tuple(r for r in group if n in of[r] and (r, n) not in told))]
    file.parent.mkdir(exist_ok=True)
    with file.open("a", encoding="utf-8") as keep:
        bar = tqdm(of_scenes(work, jobs), "scenes", len(all_of), unit="scene", initial=len(all_of) - len(work))
        for (_, number), (of_rows, took) in zip(work, bar, strict=True):
            for row, one in of_rows.items():
                told[row, number] = one
                line = {"row": row, "number": number, "told": asdict(one), "modules": sorted(took - modules)}
                keep.write("\n" + json.dumps(line, default=float))  # on a line of its own, however the last run ended
                modules |= took
            keep.flush()
    found = {row: [told[row, number] for number in of[row]] for row in rows}
    return {row: {"about": ROWS[row].about, **summary(found[row], ROWS[row].silent_pct)} for row in rows}, modules


def kept(file: Path) -> tuple[Kept, set[str]]:
    """What earlier runs of the same code told, and the modules that took; a line that was cut short is left out."""
    told, modules = Kept(), set[str]()
    for text in file.read_text(encoding="utf-8").splitlines() if file.is_file() else ():
        try:
            line = json.loads(text)
        except json.JSONDecodeError:
            continue
        told[line["row"], line["number"]] = Told(**line["told"])
        modules |= set(line["modules"])
    return told, modules


def _code() -> str:
    """What the figures depend on: the library's rooms, and what stages and measures the scenes."""
    support = sorted((ROOT / "tests" / "support").glob("*.py"))
    return hashlib.sha256(
        b"".join([code_sha256(ROOMS).encode(), *(file.read_bytes() for file in support)])
    ).hexdigest()[:16]


def table(found: dict[str, dict[str, Any]]) -> str:
    """Lay the rows out, one a line: medians in %, then coverage, then what was not told."""
    head = f"{'row':<17}{'scenes':>7}{'sizes':>6}{'L':>7}{'W':>7}{'H':>7}{'V':>7}{'p95':>7}{'1s %':>6}{'2s %':>6}"
    lines = [head + f"{'rms z':>7}{'p':>9}{'silent':>7}{'refused':>8}{'lack of measurable, of wide':>28}"]
    for row, r in found.items():
        medians = "".join(f"{r[name].get('median_pct', np.nan):7.2f}" for name in NAMES)
        keys = (("p95_pct", "7.1f"), ("within_1_sigma_pct", "6.1f"), ("within_2_sigma_pct", "6.1f"), ("rms_z", "7.2f"))
        spread = "".join(f"{r.get(key, np.nan):{layout}}" for key, layout in keys)
        p = np.nan if r["binomial_p"] is None else r["binomial_p"]
        missing = f"{r['measurable_lacking']} of {r['measurable']}, {r['wide_lacking']} of {r['wide']}"
        lines.append(
            f"{row:<17}{r['scenes']:>7}{r['sizes']:>6}{medians}{spread}{p:9.1g}{r['silent']:>7}{r['refused']:>8}{missing:>28}"
        )
    return "\n".join(lines)


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=("accuracy", "time"), help="as of the other benchmarks; here is no time")
    parser.add_argument("--row", action="append", choices=list(ROWS), metavar="NAME", help=f"of {', '.join(ROWS)}")
    parser.add_argument("--scenes", type=int, default=SCENES_A_ROW, help=f"of each row (default {SCENES_A_ROW})")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} scenes of each row")
    parser.add_argument("--chosen-on", action="store_true", help="the scenes that settings were chosen on")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--out", type=Path, help="write the rows to this JSON file, whole run or not")
    return parser.parse_args()


def main() -> None:
    """Measure, print the table, write ``results/rigs.json`` if all of it was measured."""
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # of the processes to come
    asked = arguments()
    if asked.only == "time":
        return
    rows, scenes = asked.row or list(ROWS), QUICK if asked.quick else asked.scenes
    found, modules = run(rows, 0 if asked.chosen_on else JUDGED, scenes, asked.jobs)
    print(table(found))
    if asked.out:
        write_atomic(asked.out, json.dumps(found, indent=1) + "\n")
    if rows == list(ROWS) and not (asked.quick or asked.chosen_on):
        save("rigs", {"rows": found}, modules)
    else:
        print(f"{RESULTS / 'rigs.json'} stays: it is written when all rows are measured as they are judged")


if __name__ == "__main__":
    main()
