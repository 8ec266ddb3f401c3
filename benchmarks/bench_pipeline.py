"""The pipelines against plain SGBM on the virtual rig, their honesty, and the real pair as the test.

The settings of "best" come from ``choose_best.py``; its standard deviations are found here, on the same scenes.
About ten minutes; with ``--only time`` two.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from common import PAPER_RIG, asked, ratio, save
from scipy.optimize import isotonic_regression
from tqdm import tqdm
from virtual_pairs import CHECKED_ON, CHOSEN_ON, Pair, bad2_pct, cluttered, recorded

from stereolib import paper
from stereolib.matching import FilterCase, compare_filters, compute_disparity, motorcycle_view, pipelines
from stereolib.virtual import recordings

Array = np.ndarray
ROOMS = ("base", "rig", "laser", "matching", *PAPER_RIG, "virtual")


def calibrate(pairs: list[Pair]) -> dict[str, list]:
    """`pipelines.MARGINS` and `pipelines.BEST_SIGMA_PX` anew."""
    matches = [
        pipelines.match_best(p.left, p.right, p.num_disparities) for p in tqdm(pairs, "calibrating", unit="pair")
    ]
    matched = [m.margin[pipelines.fill_and_classify(m)[1] < 2] for m in matches]
    margins = [round(float(x)) for x in np.percentile(np.concatenate(matched), (10, 25, 45, 65, 85))]
    errors: dict[tuple[int, int], list[Array]] = {}
    for pair, match in zip(pairs, matches, strict=True):
        disparity, kind, level = pipelines.fill_and_classify(match, margins=tuple(margins))
        off = np.abs(disparity - pair.truth_px)
        for k in range(3):
            for n in range(6):
                errors.setdefault((k, n), []).append(off[(kind == k) & (level == n)])
    pooled = {key: np.concatenate(parts) for key, parts in errors.items()}
    found = [[round(float(np.percentile(pooled[k, n], 68)), 2) for n in range(6)] for k in range(2)]
    found.append(filled_std_px([pooled[2, n] for n in range(6)]))
    return {"margins": margins, "sigma_px": dict(zip(pipelines.BEST_SIGMA_PX, found, strict=True))}


def filled_std_px(errors: list[Array]) -> list[float]:
    """Root mean square error of each class of filled pixels; classes are put together until it does not fall."""
    squares = [float(np.mean(np.square(off, dtype=np.float64))) for off in errors]
    rising = isotonic_regression(squares, weights=[len(off) for off in errors]).x
    return [round(float(x), 2) for x in np.sqrt(rising)]


def honesty(pairs: list[Pair]) -> tuple[float, float]:
    """Share of errors inside one standard deviation, and bad-2 of "best", means over the pairs, %."""
    inside, bad = [], []
    for pair in tqdm(pairs, "best", unit="pair"):
        found = pipelines.stereo_pipeline("best", pair.num_disparities)(pair.left, pair.right)
        off, known = np.abs(found.disparity_px - pair.truth_px), np.isfinite(pair.truth_px)
        inside.append(100 * float((off <= found.std_px)[known].mean()))
        bad.append(bad2_pct(found.disparity_px, pair.truth_px))
    return round(float(np.mean(inside)), 1), round(float(np.mean(bad)), 2)


RIVALS = {"plain": False, "whole": True}  # SGBM as it is, which leaves 128 columns out, and on the columns of "fast"


def fast_against_sgbm(pairs: list[Pair]) -> dict[str, Any]:
    """Mean bad-2 of "fast" and of SGBM with block 5 and 128 disparities, without and with the left columns."""
    fast = pipelines.stereo_pipeline("fast")
    ours = float(np.mean([bad2_pct(fast(p.left, p.right).disparity_px, p.truth_px) for p in pairs]))
    bad = {
        name: float(np.mean([bad2_pct(compute_disparity(p.left, p.right, whole=whole), p.truth_px) for p in pairs]))
        for name, whole in RIVALS.items()
    }
    return {
        "pairs": len(pairs),
        "fast_bad2_pct": round(ours, 2),
        **{f"{name}_bad2_pct": round(value, 2) for name, value in bad.items()},
        "fast_less_bad2_points": round(bad["plain"] - ours, 2),
        "fast_less_bad2_than_whole_points": round(bad["whole"] - ours, 2),
    }


def speed(pairs: list[Pair]) -> dict[str, float]:
    """How many times faster "fast" is than the same two rivals."""
    fast = pipelines.stereo_pipeline("fast")
    found = {}
    for name, whole in RIVALS.items():
        taken = ratio(
            lambda: [fast(pair.left, pair.right) for pair in pairs],
            lambda whole=whole: [compute_disparity(pair.left, pair.right, whole=whole) for pair in pairs],
            rounds=5,
        )
        found[f"fast_times_{name}"] = round(1 / taken["ratio"], 2)
    return found


def on_photographs() -> dict[str, float]:
    """The motorcycle: bad-2 over all pixels of known truth with 128 disparities, and honesty."""
    view = motorcycle_view()
    best = pipelines.stereo_pipeline("best")(view.left, view.right)
    known = np.isfinite(view.truth_px)
    inside = (np.abs(best.disparity_px - view.truth_px) <= best.std_px)[known].mean()
    fast, plain = pipelines.stereo_pipeline("fast")(view.left, view.right), compute_disparity(view.left, view.right)
    maps = {"best": best.disparity_px, "fast": fast.disparity_px, "plain": plain}
    found = {f"motorcycle_{name}_bad2_pct": round(bad2_pct(d, view.truth_px), 2) for name, d in maps.items()}
    density = 100 * float(np.isfinite(best.disparity_px).mean())
    return found | {"motorcycle_best_density_pct": density, "motorcycle_inside_pct": round(100 * float(inside), 1)}


def filters_ms() -> dict[str, float]:
    """Each filter on the map of poor light, best of three, with a kernel of 9 px."""
    true = recordings.load_truth("conditions/poor_light")
    pair = recordings.rectified().rectify(*recordings.load_pair("conditions/poor_light"))
    one = {"poor_light": FilterCase.from_pair(pair, true.disparity_px, true.visible & (true.box == 1), true.box == 1)}
    tables = [compare_filters(one, cm_per_px=paper.printed_value("scale.cm_per_px")) for _ in range(3)]
    return {m: round(min(t["time_ms"][k] for t in tables), 1) for k, m in enumerate(tables[0]["method"])}


def main() -> None:
    """Write ``results/pipeline.json``; and the times, ``pipeline_time.json`` and ``smoothing.json``."""
    cv2.setNumThreads(1)
    wanted = asked(__doc__)
    cubes = [recorded(name) for name in recordings.cube_pairs()]
    if "time" in wanted:
        save("smoothing", {"ms": filters_ms()}, ROOMS)
        save("pipeline_time", speed(cubes), ROOMS)
    if "accuracy" in wanted:
        seen, checked = ([pair for seed in seeds for pair in cluttered(seed)] for seeds, _ in (CHOSEN_ON, CHECKED_ON))
        calibrated = calibrate(seen)
        inside, bad = honesty(checked + [recorded(name) for name in CHECKED_ON[1]])
        found = {**on_photographs(), "virtual_best_bad2_pct": bad, "virtual_inside_pct": inside}
        save("pipeline", {**found, **fast_against_sgbm(cubes), **calibrated}, ROOMS)


if __name__ == "__main__":
    main()
