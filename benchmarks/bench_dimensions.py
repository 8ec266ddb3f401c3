"""Sizes of 200 virtual boxes with error bars, the paper's recipe beside them, and what a measurement costs.

About five minutes; with ``--only time`` one.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from types import BuiltinFunctionType
from typing import Any
from unittest import mock

import cv2
import numpy as np
from common import PAPER_RIG, asked, loaded, save
from support.box_scenes import NAMES, Shot, box_scene, errors, instrument, measure, shoot, the_box
from tqdm.auto import tqdm

from stereolib import paper
from stereolib.matching import SGBMParams, compute_disparity
from stereolib.measurement import Instrument
from stereolib.paper import height_by_maximum
from stereolib.rig import RectifiedRig

Array = np.ndarray
SCENES = 200
ROOMS = (
    "base",
    "rig",
    "laser",
    "calibration",
    "matching",
    "measurement",
    *PAPER_RIG,
    "paper/height_recipe.py",
    "virtual",
)
#: Scenes that should be refused: how box, floor and light differ from the good ones.
HARD: tuple[dict[str, Any], ...] = (
    {"box": {"contrast": 0.0}},
    {"box": {"contrast": 0.0}, "floor": {"contrast": 0.0}},
    {"box": {"gloss": 0.9}, "floor": {"gloss": 0.9}},
    {"light": 0.012},
)
EACH_HARD = 15
TIMED = 40
#: The threshold with which notebook 06 applies the paper's recipe: the fall of the cube's near edge, and a pixel.
THRESHOLD_PX = 7.25
#: The paper's recipe is made for a cube 700 mm away: the boxes that stand so far, by so much, are counted apart.
NEAR_MM, NEAR_BY_MM = int(1000 * paper.printed_value("setup.distance")), 50


def shoot_all(jobs: list[tuple[int, dict[str, Any]]]) -> list[Shot]:
    """Render scenes, two at once."""
    from joblib import Parallel, delayed

    running = Parallel(n_jobs=2, prefer="threads", return_as="generator")(
        delayed(shoot)(box_scene(k, **how)) for k, how in jobs
    )
    return list(tqdm(running, "rendering scenes", len(jobs), unit="scene"))


def paper_error_pct(shot: Shot, rectified: RectifiedRig) -> float:
    """Error of the height that the paper's recipe reads, %: SGBM, 53 rows, 0.116 cm/px; NaN where it reads nothing."""
    rows, scale = int(paper.printed_value("height.constant_rows")), paper.printed_value("scale.cm_per_px")
    left, right = rectified.rectify(shot.left, shot.right)
    disparity = compute_disparity(left, right, SGBMParams(num_disparities=160, block_size=5))
    try:
        found = height_by_maximum(disparity, scale, rows, tolerance_px=THRESHOLD_PX)
    except ValueError:
        return np.nan
    return 100 * (found.height_mm / float(shot.truth.size_mm[2]) - 1)


@contextmanager
def inside_cv2(spent: list[float]) -> Iterator[None]:
    """Add to spent[0] the time inside cv2's functions and its matcher."""

    def timed(function: Any) -> Any:
        def call(*args: Any, **kwargs: Any) -> Any:
            start = time.thread_time()
            result = function(*args, **kwargs)
            spent[0] += time.thread_time() - start
            return result

        return call

    class Matcher:
        def __init__(self, params: SGBMParams) -> None:
            self.compute = timed(make(params).compute)

    make = SGBMParams.matcher
    functions = {
        name: timed(function) for name, function in vars(cv2).items() if isinstance(function, BuiltinFunctionType)
    }
    with (
        mock.patch.multiple(cv2, **functions),
        mock.patch.object(SGBMParams, "matcher", lambda params: Matcher(params)),
    ):
        yield


def speed(shots: list[Shot], known: Instrument) -> dict[str, float]:
    """Measurements a second on one core, their time over that of the cv2 calls inside, and over a plain pipeline's."""
    cv2.setNumThreads(1)
    measure(shots[0], known)
    totals, shares, plain = [], [], []
    for shot in shots:
        start = time.thread_time()
        measure(shot, known)
        totals.append(time.thread_time() - start)
        spent = [0.0]
        with inside_cv2(spent):
            start = time.thread_time()
            measure(shot, known)
            shares.append((time.thread_time() - start) / spent[0])
        maps, matcher = known.rectified.maps, SGBMParams(num_disparities=160, block_size=5).matcher()
        start = time.thread_time()
        pair = [cv2.remap(i, *m, cv2.INTER_LINEAR) for i, m in zip((shot.left, shot.right), maps, strict=True)]
        matcher.compute(*(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) for image in pair))
        plain.append(time.thread_time() - start)
    return {
        "per_second": round(1 / float(np.median(totals)), 1),
        "times_cv2_inside": round(float(np.median(shares)), 2),
        "times_plain_rectify_and_sgbm": round(float(np.median(np.array(totals) / plain)), 2),
    }


def accuracy(known: Instrument) -> dict[str, Any]:
    """Errors of the sizes that are told, what is refused, what is silently wrong; and the paper's recipe."""
    jobs: list[tuple[int, dict[str, Any]]] = [(k, {}) for k in range(SCENES)]
    jobs += [(1000 + k, how) for k in range(EACH_HARD * len(HARD)) for how in (HARD[k % len(HARD)],)]
    shots = shoot_all(jobs)
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in NAMES}
    reasons: Counter[str] = Counter()
    silent, refused, ours = [0, 0], 0, np.full(SCENES, np.nan)
    for k, shot in enumerate(tqdm(shots, "measuring", unit="scene")):
        thing = the_box(measure(shot, known), shot.truth)
        off = errors(thing, shot.truth)
        silent[k >= SCENES] += any(abs(pct) > 10 for pct, _ in off.values())
        if k >= SCENES:
            continue
        refused += "volume" not in off
        ours[k] = off.get("height", (np.nan,))[0]
        if thing is None:
            reasons["no object"] += 1
        elif "volume" not in off:
            reasons[" and ".join(sorted({str(why).split(":")[0] for why in thing.reasons.values()}))] += 1
        for name, pair in off.items():
            found[name].append(pair)
    hard = len(shots) - SCENES
    table: dict[str, dict[str, float]] = {}
    for name, pairs in found.items():
        pct, z = np.abs(np.array(pairs)).T
        table[name] = {
            "median_pct": round(float(np.median(pct)), 3), "p95_pct": round(float(np.percentile(pct, 95)), 2),
            "coverage95_pct": round(100 * float((z < 1.96).mean()), 1), "measured": len(pairs),
        }  # fmt: skip
    return {
        "scenes": SCENES,
        **table,
        "sizes": sum(map(len, found.values())),
        "coverage95_pct": round(100 * float(np.mean([abs(z) < 1.96 for p in found.values() for _, z in p])), 1),
        "refused": refused,
        "refused_pct": round(100 * refused / SCENES, 1),
        "refused_because": dict(reasons.most_common()),
        "silent_error_pct": round(100 * silent[0] / SCENES, 2),
        "hard_scenes": hard,
        "hard_silent_error_pct": round(100 * silent[1] / hard, 2),
        "paper": by_paper(shots[:SCENES], known.rectified, ours),
    }


def by_paper(shots: list[Shot], rectified: RectifiedRig, ours_pct: Array) -> dict[str, Any]:
    """Median size of the error that the paper's recipe makes, by where the box stands, and where ours tells a height.

    `ours_pct` is the error of our height, NaN where it tells none: ``told`` and ``near_told`` are the same boxes for
    both, and have our median too.
    """
    off = np.abs([paper_error_pct(shot, rectified) for shot in tqdm(shots, "the paper's recipe")])
    near = np.abs(np.array([shot.truth.distance_mm for shot in shots]) - NEAR_MM) <= NEAR_BY_MM
    told = np.isfinite(ours_pct)
    groups = {"all": np.ones_like(near), "near": near, "others": ~near, "told": told, "near_told": near & told}
    found = {
        name: {
            "boxes": int(which.sum()), "read": int(np.isfinite(off[which]).sum()),
            "median_pct": round(float(np.nanmedian(off[which])), 1), "within_5_pct": int((off[which] <= 5).sum()),
        }
        for name, which in groups.items()
    }  # fmt: skip
    for name in ("told", "near_told"):
        found[name]["ours_median_pct"] = round(float(np.median(np.abs(ours_pct[groups[name]]))), 3)
    found["near"] |= {"from_mm": NEAR_MM - NEAR_BY_MM, "to_mm": NEAR_MM + NEAR_BY_MM}
    return found


def main() -> None:
    """Write ``results/dimensions.json`` and ``results/dimensions_time.json``."""
    cv2.setNumThreads(1)
    wanted, known = asked(__doc__), instrument()
    if "accuracy" in wanted:
        found = accuracy(known)  # first: what it loads is told with it
        save("dimensions", found, loaded(ROOMS))
    if "time" in wanted:
        save("dimensions_time", speed(shoot_all([(k, {}) for k in range(TIMED)]), known), ROOMS)


if __name__ == "__main__":
    main()
