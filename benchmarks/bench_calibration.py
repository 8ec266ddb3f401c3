"""Calibration: do stated uncertainties hold, are faults named, how right is the result, and what does it cost?

About eight minutes, half of them for the rendered board sets; with ``--only time`` half a minute.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import cv2
import numpy as np
from common import PAPER_RIG, asked, save
from joblib import Parallel, delayed
from support.corners import corner_set, draw_poses, draw_rig, project_boards
from support.faults import bad_sets
from tqdm.auto import tqdm

from stereolib.base import datasets
from stereolib.calibration import (
    INTERVAL_STDS,
    BoardViews,
    Checkerboard,
    calibrate_stereo,
    compare_calibrations,
    diagnose,
    find_in_pairs,
    rig_covariance,
    rig_difference,
    rig_parameter_names,
)
from stereolib.paper import paper_rig
from stereolib.rig import StereoRig, read_pair, rigid, to_grey
from stereolib.virtual import Webcam, recordings, render

Array = np.ndarray
ROOMS = ("base", "rig", "calibration", *PAPER_RIG, "virtual")
DRAWS, DIAGNOSED = 160, 40
#: Board sets that are rendered and detected, and pairs in each: three minutes on two cores.
RENDERED, RENDERED_PAIRS = 20, 20


def held() -> dict[str, Any]:
    """Share of draws whose true value lies in the stated 95 % interval, by kind of parameter.

    Virtual corner sets: poses projected through drawn rigs, with the detector's measured noise, which is independent
    from corner to corner. The pictures of `rendered` have what a detector really leaves.
    """
    inside, verdicts, sizes = [], [], []
    for k in tqdm(range(DRAWS), "corner sets", unit="set"):
        rng = np.random.default_rng([40, k])
        rig = draw_rig(rng)
        views = corner_set(rng, rig=rig)
        inside.append(inside_intervals(views, rig))
        if k < DIAGNOSED:
            found = diagnose(views)
            verdicts.append(found.verdict)
            sizes.append(found.square_error_pct)
    counts = {word: verdicts.count(word) for word in ("good", "usable", "bad")}
    return {
        "held_pct": {"corners": {"draws": DRAWS, **shares(inside)}},
        "good_sets_called": counts,
        "worst_square_error_pct": round(max(sizes), 4),
    }


def inside_intervals(views: BoardViews, rig: StereoRig) -> list[Array]:
    """Which of the 24 parameters lie inside their 95 % intervals, by two ways of estimating these."""
    fit = calibrate_stereo(views).fit
    off = np.abs(rig_difference(fit.rig, rig))
    return [off < INTERVAL_STDS * np.sqrt(np.diag(rig_covariance(fit, method=m))) for m in ("auto", "corners")]


def shares(inside: list[list[Array]]) -> dict[str, float]:
    """Shares inside, %, of all parameters and by kind; ``lowest`` and ``highest`` are of the 24 one by one.

    Both cameras, and the three axes of R and of T, are counted together.
    """
    share = 100 * np.mean(inside, axis=0)
    names = np.array([n.split()[-1] if n[0] not in "RT" else n[0] for n in rig_parameter_names(paper_rig())])
    kinds = {kind: round(float(share[0, names == kind].mean()), 1) for kind in dict.fromkeys(names.tolist())}
    by_set = 100 * np.mean(inside, axis=2)[:, 0]
    return kinds | {
        "all": round(float(share[0].mean()), 1),
        "all_std": round(float(by_set.std(ddof=1) / np.sqrt(len(by_set))), 1),
        "lowest_one": round(float(share[0].min()), 1),
        "highest_one": round(float(share[0].max()), 1),
        "all_if_corners_independent": round(float(share[1].mean()), 1),
    }


def rendered() -> dict[str, Any]:
    """The same from pictures: boards rendered through drawn rigs, photographed by the virtual webcam and detected."""
    cv2.setNumThreads(1)
    running = Parallel(n_jobs=2, prefer="threads", return_as="generator")(
        delayed(_rendered_set)(k) for k in range(RENDERED)
    )
    found = list(tqdm(running, "rendering board sets", RENDERED, unit="set"))
    inside = [inside_intervals(views, rig) for views, rig in found]
    pairs = [len(views) for views, _ in found]
    return {"sets": RENDERED, "pairs_each": [min(pairs), max(pairs)], **shares(inside)}


def _rendered_set(seed: int) -> tuple[BoardViews, StereoRig]:
    rng = np.random.default_rng([41, seed])
    rig = draw_rig(rng)
    pairs = [_shot(rig, pose, rng, samples=1) for pose in draw_poses(rig, RENDERED_PAIRS, rng)]
    return find_in_pairs(pairs, recordings.BOARD, [f"{k:02d}" for k in range(len(pairs))], progress=False), rig


def rendered_noise() -> dict[str, float]:
    """Corners found minus true, sd of a coordinate: on the committed boards, and on boards of three drawn rigs."""
    found = find_in_pairs(*recordings.load_boards()[:1], recordings.BOARD, recordings.load_boards()[1], progress=False)
    poses = [recordings.board_poses()[int(name[-2:]) - 1] for name in found.names]
    result = {"committed_px": _noise(found, paper_rig(), poses)}
    drawn = []
    for k in range(3):
        rng = np.random.default_rng([3, k])
        rig = draw_rig(rng)
        poses = draw_poses(rig, 2, rng)
        pairs = [_shot(rig, pose, rng) for pose in poses]
        names = [str(i) for i in range(len(poses))]
        views = find_in_pairs(pairs, recordings.BOARD, names, progress=False)
        drawn.append(_noise(views, rig, [poses[int(name)] for name in views.names]) ** 2)
    return {**result, "drawn_rigs_px": round(float(np.sqrt(np.mean(drawn))), 4)}


def _shot(rig: StereoRig, pose: Array, rng: np.random.Generator, samples: int = 3) -> tuple[Array, Array]:
    scene, bench = recordings.board_scene(pose), recordings.setup("bench")
    moves = (rig.left, bench), (rig.right, rigid(rig.R, rig.T) @ bench)
    soft = {"samples": samples, "light_samples": 4 if samples > 1 else 1}
    left, right = (Webcam().shoot(render(scene, camera, T, **soft), rng) for camera, T in moves)
    return left, right


def _noise(views: BoardViews, rig: StereoRig, poses: list[Array]) -> float:
    off = []
    for found, true in zip((views.left_px, views.right_px), project_boards(rig, poses), strict=True):
        for a, b in zip(found, true, strict=True):
            off.append(min((a - b, a - b[::-1]), key=lambda e: np.abs(e).sum()))
    return round(float(np.std(np.array(off))), 4)


def virtual() -> dict[str, Any]:
    """The committed boards against the rig that rendered them; two halves against each other."""
    pairs, names = recordings.load_boards()
    views = find_in_pairs(pairs, recordings.BOARD, names, progress=False)
    found = diagnose(views)
    return {
        "pairs": len(views),
        "verdict": found.verdict,
        "rms_px": round(found.rms_px, 4),
        "baseline_error_mm": round(abs(found.rig.baseline_mm - paper_rig().baseline_mm), 4),
        "baseline_std_mm": round(found.std.baseline_mm, 4),
        "square_error_pct": round(found.square_error_pct, 4),
        "epipolar_rms_px": round(found.epipolar_rms_px, 4),
        "judged_at_mm": found.error_map.at_mm,
        "depth_std_mm": round(found.depth_mm, 3),
        "halves_rms_z": halves(views),
    }


def halves(views: BoardViews) -> float:
    """Differences of two calibrations from disjoint halves over their predicted standard deviations, rms."""
    first, second = (calibrate_stereo(views.only(range(k, len(views), 2))).fit for k in (0, 1))
    return round(compare_calibrations(first, second).rms_z, 2)


def minoru() -> dict[str, Any]:
    """A real webcam pair, its board taken as square, and with the aspect that the diagnosis names."""
    files = [datasets.real_recordings(f"minoru3d/{side}") for side in ("left", "right")]
    pairs, names = [read_pair(*pair) for pair in zip(*files, strict=True)], [file.name for file in files[0]]
    result: dict[str, Any] = {}
    for name, aspect in (("as_stated", 1.0), ("aspect_1.014", 1.014)):
        views = find_in_pairs(pairs, Checkerboard(8, 6, 30.0, aspect), names, progress=False)
        found = diagnose(views)
        result[name] = {
            "pairs_used": len(found.views),
            "verdict": found.verdict,
            "rms_px": round(found.rms_px, 4),
            "square_error_pct": round(found.square_error_pct, 3),
            "baseline_mm": round(found.rig.baseline_mm, 2),
            "baseline_std_mm": round(found.std.baseline_mm, 2),
            "halves_rms_z": halves(views),
        }
    return result


def faults(seeds: int = 2) -> dict[str, Any]:
    """Sets with one known fault each: how many were named, and which were not."""
    named, missed = 0, []
    for seed in range(seeds):
        for fault in bad_sets(seed):
            try:
                found = diagnose(fault.views, model=fault.model, ruler_mm=fault.ruler_mm)
                right = not fault.refused and any(fault.says in text for text in found.warnings)
                right &= found.verdict in (fault.verdict or found.verdict,) and set(found.pairs_refused) == set(
                    fault.pairs
                )
            except ValueError as error:
                right = fault.refused and fault.says in str(error)
            named += right
            missed += [] if right else [f"{fault.name} ({seed})"]
    return {"sets": named + len(missed), "named": named, "missed": missed}


def cost(cores: int, rounds: int = 5) -> dict[str, float]:
    """Ours over the bare calls for the same detection and calibration; what the diagnosis adds, beside them.

    The fastest of some rounds in turn: other work on the machine only ever slows a round down.
    """
    pairs, names = recordings.load_boards()
    board = recordings.BOARD
    times: dict[str, list[float]] = {"bare": [], "ours": [], "diagnosis": []}
    with _cores(cores):
        for _ in range(rounds):
            start = time.perf_counter()
            bare(pairs, board)
            times["bare"].append(time.perf_counter() - start)
            start = time.perf_counter()
            views = find_in_pairs(pairs, board, names, progress=False)
            calibrate_stereo(views)
            times["ours"].append(time.perf_counter() - start)
            start = time.perf_counter()
            diagnose(views)
            times["diagnosis"].append(time.perf_counter() - start)
    best = {name: min(spent) for name, spent in times.items()}
    result = {f"{name}_ms": round(1000 * spent, 1) for name, spent in best.items()}
    return {"ratio": round(best["ours"] / best["bare"], 4), **result}


def bare(pairs: list[tuple[Array, Array]], board: Checkerboard) -> None:
    """What one writes first: detect, refine, calibrate each camera, calibrate the pair."""
    inner, points = (board.columns, board.rows), []
    found: tuple[list[Array], list[Array]] = ([], [])
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-7)
    for pair in pairs:
        seen = []
        for image in pair:
            grey = to_grey(image)
            ok, corners = cv2.findChessboardCornersSB(grey, inner, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
            if not ok:
                flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
                ok, corners = cv2.findChessboardCorners(grey, inner, flags=flags)
            if ok:
                seen.append(cv2.cornerSubPix(grey, corners, (9, 9), (-1, -1), criteria))
        if len(seen) == 2:
            points.append(board.points_mm)
            for side, corners in zip(found, seen, strict=True):
                side.append(corners)
    size = pairs[0][0].shape[1::-1]
    lenses: list[Array] = []
    for side in found:
        lenses += cv2.calibrateCamera(points, side, size, None, None)[1:3]
    cv2.stereoCalibrate(points, *found, *lenses, size, flags=cv2.CALIB_USE_INTRINSIC_GUESS)


@contextmanager
def _cores(count: int) -> Iterator[None]:
    """Run on so many cores, OpenCV's own threads included."""
    mine, threads = os.sched_getaffinity(0), cv2.getNumThreads()
    os.sched_setaffinity(0, set(sorted(mine)[:count]))
    cv2.setNumThreads(count)
    try:
        yield
    finally:
        os.sched_setaffinity(0, mine)
        cv2.setNumThreads(threads)


def accuracy() -> dict[str, Any]:
    """All that is no time; what the README quotes stands first."""
    result: dict[str, Any] = held() | {"rendered": rendered(), "noise": rendered_noise()}
    result |= {"virtual": virtual(), "faults": faults()}
    try:
        result["minoru"] = minoru()
    except datasets.NotAvailable as error:
        print(error)
    quoted = {
        "faults_missed": len(result["faults"]["missed"]),
        "square_error_pct": result["virtual"]["square_error_pct"],
    }
    return quoted | result


def times() -> dict[str, Any]:
    """What a calibration costs over the bare calls."""
    one, two = cost(1), cost(2)
    return {"one_core_ratio": one["ratio"], "two_cores_ratio": two["ratio"], "one_core": one, "two_cores": two}


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    wanted = asked(__doc__)
    if "accuracy" in wanted:
        save("calibration", accuracy(), ROOMS)
    if "time" in wanted:
        save("calibration_time", times(), ROOMS)
