"""The laser's window against the full one, and what a sweep costs over bare OpenCV and gains from a second worker."""

from __future__ import annotations

import statistics
import time
from unittest import mock

import cv2
import numpy as np
from common import ratio, save

from stereolib.matching import (
    KnownView,
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


def guided(threads: int) -> dict[str, float]:
    """The recorded series: expectation and match from laser and pair, distance by distance.

    Against 128 disparities, and against a window cut to the laser's two depths of what stands free. The rival is given
    that window for nothing, is timed without its left columns and scored with them; ours has to work out its
    expectation in its time.
    """
    cv2.setNumThreads(threads)
    rectified, pose = recordings.rectified(), recordings.setup()
    fB = rectified.f_px * rectified.baseline_mm
    faster, than_cut, better, bad, false = [], [], [], [], []
    for kind in recordings.TEXTURES_MM:
        for mm in recordings.DISTANCES_MM:
            view, scan = recordings.view(f"series/{kind}_{mm}"), recordings.scan(f"series/{kind}_{mm}")
            pair = view.left, view.right

            def ours(pair: tuple = pair, scan: object = scan) -> np.ndarray:
                return compute_disparity_guided(*pair, expected_disparity(scan, rectified, pose))

            def plain(pair: tuple = pair) -> np.ndarray:
                return compute_disparity(*pair, SGBMParams(128))

            one = expected_disparity(scan, rectified, pose)
            near = one.near_px[2::4, 2::4]
            free = near[near > one.room_px + 1]
            window = SGBMParams.for_range(rectified, fB / free.max(), fB / free.min())

            def cut(pair: tuple = pair, window: SGBMParams = window) -> np.ndarray:
                return compute_disparity(*pair, window)

            maps = plain(), ours(), compute_disparity(*pair, window, whole=True)
            on_cube = [score(d, view.truth_px, view.regions["cube"]).bad2_pct for d in maps]
            bad.append(on_cube)
            better.append(on_cube[0] - on_cube[1])
            false.append([100 * (np.abs(d - view.truth_px)[view.visible] > 2).mean() for d in maps])
            if kind == "medium":
                faster.append(1 / ratio(ours, plain, rounds=9)["ratio"])
                than_cut.append(1 / ratio(ours, cut, rounds=9)["ratio"])
    plain_bad, guided_bad, cut_bad = np.mean(bad, axis=0)
    return {
        "times_faster_median": round(statistics.median(faster), 2),
        "times_faster_least": round(min(faster), 2),
        "times_faster_by_distance": [round(x, 2) for x in faster],
        "times_faster_than_cut_median": round(statistics.median(than_cut), 2),
        "times_faster_than_cut_by_distance": [round(x, 2) for x in than_cut],
        "cube_bad2_plain_pct": round(plain_bad, 2),
        "cube_bad2_guided_pct": round(guided_bad, 2),
        "cube_bad2_cut_pct": round(cut_bad, 2),
        "least_gain_bad2_points": round(min(better), 3),
        "false_matches_plain_pct": round(np.mean(false, axis=0)[0], 2),
        "false_matches_guided_pct": round(np.mean(false, axis=0)[1], 2),
        "false_matches_cut_pct": round(np.mean(false, axis=0)[2], 2),
    }


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
    alone, together = guided(1), guided(cv2.getNumberOfCPUs())
    together = {f"{name}_all_threads": together[name] for name in ("times_faster_median", "times_faster_least")}
    pairs = [recordings.view("conditions/texture"), recordings.view("series/coarse_800")]
    save("study", {**alone, **together, **sweeps(pairs)})
