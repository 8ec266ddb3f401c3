"""Do stated intervals hold for few pairs? Calibrations of one rig from disjoint pictures, held against each other.

Boards as printers and hands make them, each set in its own way: rims of all widths, a sheet bent by 0.5 mm, blur,
noise, JPEG. About eight minutes on two cores, most of it for the pictures.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from common import PAPER_RIG, asked, chance_outside, save
from joblib import Parallel, delayed
from scipy.stats import binomtest
from support.board_pictures import Photo, Print, found_views
from support.corners import draw_rig
from tqdm.auto import tqdm

from stereolib.calibration import (
    INTERVAL_STDS,
    BoardViews,
    calibrate_stereo,
    rig_covariance,
    rig_difference,
    rig_parameter_names,
    rig_std,
)
from stereolib.calibration.bundle_adjustment import RigFit
from stereolib.paper import paper_rig
from stereolib.rig import StereoRig

Array = np.ndarray
ROOMS = ("base", "rig", "calibration", *PAPER_RIG, "virtual")
RIGS, PAIRS = 24, 60
SIZES = (5, 8, 10, 15, 30)
INTERVAL_SHARE, BY_CHANCE = 0.95, 0.01


def photographed_set(number: int) -> tuple[BoardViews, StereoRig]:
    """Draw a rig, print a board, and take pairs of it; nothing is shared between two sets."""
    cv2.setNumThreads(1)
    rng = np.random.default_rng([42, number])
    rig = draw_rig(rng)
    rim, margin, bent = (float(rng.choice(choices)) for choices in ((1, 0.5, 0.25), (1, 0.3, 0), (-0.5, 0.5)))
    photo = Photo(float(rng.uniform(0.4, 1.2)), float(rng.uniform(1, 5)), int(rng.integers(60, 96)))
    return found_views(rig, PAIRS, Print(rim=rim, margin=margin, bent_mm=bent), photo, rng)[0], rig


def halves(views: BoardViews, size: int) -> Iterator[tuple[RigFit, RigFit]]:
    """Calibrate on disjoint parts of a set, two by two."""
    order = np.random.default_rng(size).permutation(len(views)).tolist()
    for start in range(0, len(views) - 2 * size + 1, 2 * size):
        parts = order[start : start + size], order[start + size : start + 2 * size]
        first, second = (calibrate_stereo(views.only(sorted(part))).fit for part in parts)
        yield first, second


def of_set(views: BoardViews, rig: StereoRig, size: int) -> tuple[list[Array], list[Array]]:
    """Differences over half the width of their 95 % intervals: between halves, and of each half from the truth.

    Last stands the baseline, which the report states beside T.
    """
    between, from_truth = [], []
    for fits in halves(views, size):
        half_widths = [INTERVAL_STDS * stated(fit) for fit in fits]
        between.append(np.abs(difference(fits[0].rig, fits[1].rig)) / np.hypot(*half_widths))
        from_truth += [np.abs(difference(f.rig, rig)) / w for f, w in zip(fits, half_widths, strict=True)]
    return between, from_truth


def stated(fit: RigFit) -> Array:
    """Standard deviations of all parameters and of the baseline."""
    covariance = rig_covariance(fit)
    return np.append(np.sqrt(np.diag(covariance)), rig_std(fit.rig, covariance).baseline_mm)


def difference(one: StereoRig, other: StereoRig) -> Array:
    """By how much these differ between two rigs."""
    return np.append(rig_difference(one, other), one.baseline_mm - other.baseline_mm)


def row(between: Array, from_truth: Array) -> dict[str, Any]:
    """What the table says of one size; parameters of both cameras, and the axes of R and of T, by their own names."""
    names = np.array([name.split()[-1] for name in (*rig_parameter_names(paper_rig()), "baseline")])
    inside = {name: (between[:, names == name] < 1).ravel() for name in dict.fromkeys(names.tolist())}
    return {
        "halves": len(between),
        "all": round(100 * float((between < 1).mean()), 1),
        "lowest": round(100 * min(float(of.mean()) for of in inside.values()), 1),
        "highest": round(100 * max(float(of.mean()) for of in inside.values()), 1),
        "off": sum(chance_outside(int(of.sum()), len(of)) < BY_CHANCE for of in inside.values()),
        "not_95": sum(_chance(of, INTERVAL_SHARE) < BY_CHANCE for of in inside.values()),
        **{name: round(100 * float(of.mean()), 1) for name, of in inside.items()},
        "truth_all": round(100 * float((from_truth < 1).mean()), 1),
    }


def _chance(inside: Array, share: float) -> float:
    """How probable a count as far off as this one is where `share` holds."""
    return float(binomtest(int(inside.sum()), len(inside), share).pvalue)


def main() -> None:
    """Photograph, calibrate, print and save."""
    if "accuracy" not in asked(__doc__):
        return
    running = Parallel(n_jobs=2, return_as="generator")(delayed(photographed_set)(k) for k in range(RIGS))
    sets = list(tqdm(running, "photographing boards", RIGS, unit="rig"))
    result: dict[str, Any] = {"rigs": RIGS, "pairs": [min(len(v) for v, _ in sets), max(len(v) for v, _ in sets)]}
    for size in tqdm(SIZES, "calibrating", unit="size"):
        found = [of_set(views, rig, size) for views, rig in sets]
        result[f"pairs_{size}"] = row(*(np.concatenate([p for p in part if p]) for part in zip(*found, strict=True)))
        print(size, result[f"pairs_{size}"])
    save("halves", result, ROOMS)


if __name__ == "__main__":
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    main()
