"""The laser's window against the full one, and what a sweep costs over bare OpenCV and gains from a second worker."""

from __future__ import annotations

import itertools
import math
import statistics
import time
from dataclasses import replace
from typing import Any
from unittest import mock

import cv2
import numpy as np
from common import PAPER_RIG, asked, ratio, save

from stereolib.matching import (
    KnownView,
    Score,
    SGBMParams,
    Workers,
    compute_disparity,
    compute_disparity_guided,
    expected_disparity,
    score,
    settings_grid,
    sweep,
)
from stereolib.virtual import recordings

ROOMS = ("base", "rig", "laser", "matching", *PAPER_RIG, "virtual")
MARGIN_PX = 8  # beyond the cube's true disparities, as the laser's window has it beyond what it expects
QUICK = SGBMParams(mode="3way", speckle_window_size=0)  # what the laser's window is matched with


def cut(view: KnownView, like: SGBMParams | None = None) -> SGBMParams:
    """The narrowest window that holds the cube's true disparities: a gift to the rival, who could not know them."""
    seen = view.truth_px[view.regions["cube"]]
    low = math.floor(np.nanmin(seen)) - MARGIN_PX
    count = 16 * math.ceil((np.nanmax(seen) + MARGIN_PX - low + 1) / 16)
    return replace(like or SGBMParams(), min_disparity=low, num_disparities=count)


class Case:
    """A recorded pair and its scan, matched in four ways: laser, 128 disparities, and two windows cut to the cube."""

    def __init__(self, kind: str, mm: int) -> None:
        name = f"series/{kind}_{mm}"
        self.view, self.scan = recordings.view(name), recordings.scan(name)

    def by_laser(self) -> np.ndarray:
        """What is timed begins with the scan."""
        expected = expected_disparity(self.scan, recordings.rectified(), recordings.setup())
        return compute_disparity_guided(self.view.left, self.view.right, expected)

    def by(self, params: SGBMParams) -> np.ndarray:
        return compute_disparity(self.view.left, self.view.right, params)


def quality() -> dict[str, Any]:
    """On the cube of the recorded series: bad pixels, rms error and pull towards whole pixels of the matched ones.

    Shares are means over the pairs, the two errors and their ratios medians: at 500 mm 128 disparities are too few.
    """
    scores: dict[str, list[Score]] = {"plain": [], "cut": [], "guided": []}
    false = []
    for kind, mm in itertools.product(recordings.TEXTURES_MM, recordings.DISTANCES_MM):
        case = Case(kind, mm)
        view, maps = case.view, (case.by(SGBMParams(128)), case.by(cut(case.view)), case.by_laser())
        for found, disparity in zip(scores.values(), maps, strict=True):
            found.append(score(disparity, view.truth_px, view.regions["cube"]))
        false.append([100 * (np.abs(d - view.truth_px)[view.visible] > 2).mean() for d in maps])
    bad = {name: np.array([each.bad2_pct for each in found]) for name, found in scores.items()}
    rms = {name: np.array([each.rms_px for each in found]) for name, found in scores.items()}
    locking = {name: np.array([each.locking_px for each in found]) for name, found in scores.items()}
    result = {f"cube_bad2_{name}_pct": values.mean() for name, values in bad.items()}
    result |= {f"cube_rms_{name}_px": np.median(values) for name, values in rms.items()}
    result |= {f"cube_locking_{name}_px": np.median(values) for name, values in locking.items()}
    result |= {f"false_matches_{name}_pct": v for name, v in zip(scores, np.mean(false, axis=0), strict=True)}
    result |= {
        "least_gain_bad2_points": (bad["plain"] - bad["guided"]).min(),
        "cut_least_gain_bad2_points": (bad["cut"] - bad["guided"]).min(),
        "rms_times": np.median(rms["guided"] / rms["plain"]),
        "locking_times": np.median(locking["guided"] / locking["plain"]),
    }
    return {name: round(float(value), 3) for name, value in result.items()}


def speed(threads: int) -> dict[str, Any]:
    """How many times faster the laser's window is than its rivals, distance by distance, medium texture."""
    cv2.setNumThreads(threads)
    faster: dict[str, list[float]] = {"": [], "cut_": [], "cut_alike_": []}
    for mm in recordings.DISTANCES_MM:
        case = Case("medium", mm)
        rivals = SGBMParams(128), cut(case.view), cut(case.view, QUICK)
        for found, params in zip(faster.values(), rivals, strict=True):
            found.append(round(1 / ratio(case.by_laser, lambda case=case, p=params: case.by(p), rounds=9)["ratio"], 2))
    result: dict[str, Any] = {"distances": len(recordings.DISTANCES_MM)}
    for name, values in faster.items():
        result |= {
            f"{name}times_faster_median": round(statistics.median(values), 2),
            f"{name}times_faster_least": min(values),
            f"{name}times_faster_most": max(values),
            f"{name}times_faster_by_distance": values,
        }
    return result


def sweeps(views: list[KnownView], rounds: int = 3) -> dict[str, float]:
    """What a sweep takes beyond the time inside OpenCV's matcher, in one run; and one worker against two."""
    settings = settings_grid(block_size=(3, 5, 7, 9), uniqueness_ratio=range(0, 24, 2), disp12_max_diff=(-1, 1))
    cv2.setNumThreads(1)
    inside = [0.0]
    make = SGBMParams.matcher

    class Timed:
        def __init__(self, params: SGBMParams) -> None:
            self.matcher = make(params)

        def compute(self, left: object, right: object) -> object:
            start = time.thread_time()
            found = self.matcher.compute(left, right)  # type: ignore[call-overload]
            inside[0] += time.thread_time() - start
            return found

    def clocked(function: object, *arguments: object, **keywords: object) -> tuple[float, float]:
        wall, spent = time.perf_counter(), time.process_time()
        function(*arguments, **keywords)  # type: ignore[operator]
        return time.perf_counter() - wall, time.process_time() - spent

    sweep(views, settings[:1], workers=Workers(2), progress=False)  # its imports are no part of a sweep
    costs, gains = [], []
    for _ in range(rounds):
        inside[0] = 0.0
        with mock.patch.object(SGBMParams, "matcher", lambda params: Timed(params)):
            _, spent = clocked(sweep, views, settings, workers=Workers(1), progress=False)
        costs.append(spent / inside[0])  # the processor's time: other programs do not count
        one, two = (clocked(sweep, views, settings, workers=Workers(n), progress=False) for n in (1, 2))
        gains.append(one[0] / two[0])
    return {
        "matches": len(views) * len(settings),
        "overhead_pct": round(100 * (statistics.median(costs) - 1), 2),
        "two_workers_times": round(statistics.median(gains), 2),
        "two_workers_times_best": round(max(gains), 2),
    }


if __name__ == "__main__":
    wanted = asked(__doc__)
    if "accuracy" in wanted:
        save("study", quality(), ROOMS)
    if "time" in wanted:
        alone, together = speed(1), speed(cv2.getNumberOfCPUs())
        together = {
            f"{name}_all_threads": value for name, value in together.items() if name.endswith(("median", "least"))
        }
        pairs = [recordings.view("conditions/texture"), recordings.view("series/coarse_800")]
        save("study_time", {**alone, **together, **sweeps(pairs)}, ROOMS)
