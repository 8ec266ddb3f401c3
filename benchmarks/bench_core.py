"""How exact the rendered rig comes back, what the library costs over bare OpenCV, and how long the commands take."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

import cv2
import numpy as np
from common import PAPER_RIG, asked, ratio, save

from stereolib import paper
from stereolib.base import ROOT
from stereolib.calibration import calibrate_stereo, epipolar_errors_px, find_in_pairs
from stereolib.matching import SGBMParams, compute_disparity
from stereolib.virtual import recordings


def accuracy() -> dict[str, float]:
    """The committed boards, calibrated, against the rig that rendered them."""
    pairs, names = recordings.load_boards()
    views = find_in_pairs(pairs, recordings.BOARD, names, progress=False)
    rig, true = calibrate_stereo(views).rig, paper.paper_rig()
    sides = [(getattr(rig, side), getattr(true, side)) for side in ("left", "right")]
    return {
        "focal_error_pct": max(100 * np.abs(a.K[i, i] / b.K[i, i] - 1) for a, b in sides for i in (0, 1)),
        "principal_point_error_px": max(np.abs(a.K[:2, 2] - b.K[:2, 2]).max() for a, b in sides),
        "baseline_error_mm": abs(rig.baseline_mm - true.baseline_mm),
        "epipolar_rms_px": float(np.sqrt((epipolar_errors_px(rig.rectify(), views) ** 2).mean())),
    }


def overhead() -> dict[str, float]:
    """Rectify and match one pair: the library against the cv2 calls inside it."""
    cv2.setNumThreads(1)
    rectified, params = recordings.rectified(), SGBMParams()
    left, right = recordings.load_pair("conditions/texture")
    maps = rectified.maps

    def ours() -> object:
        return compute_disparity(*rectified.rectify(left, right), params)

    def bare() -> object:
        pair = [cv2.remap(i, *m, cv2.INTER_LINEAR) for i, m in zip((left, right), maps, strict=True)]
        grey = [cv2.cvtColor(i, cv2.COLOR_BGR2GRAY) for i in pair]
        matcher = cv2.StereoSGBM.create(0, 128, 5, 200, 800, 1, 63, 10, 100, 2)
        raw = matcher.compute(*grey).astype(np.float32) / 16
        raw[raw < 0] = np.nan
        return raw

    np.testing.assert_array_equal(ours(), bare())
    return ratio(ours, bare)


def import_s() -> float:
    """`import stereolib` in a fresh process, less the process itself; median of five."""

    def once(code: str) -> float:
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True)
        return time.perf_counter() - start

    return statistics.median(once("import stereolib") for _ in range(5)) - statistics.median(
        once("pass") for _ in range(5)
    )


def reproduce_s() -> float:
    """All notebooks, the report and the comparison with the committed numbers."""
    start = time.perf_counter()
    subprocess.run([sys.executable, "-m", "stereolib", "reproduce", "--check"], check=True, capture_output=True)
    return time.perf_counter() - start


if __name__ == "__main__":
    wanted = asked(__doc__)
    if "accuracy" in wanted:
        found = {name: round(float(value), 4) for name, value in accuracy().items()}
        save("accuracy", found, ("base", "rig", "calibration", *PAPER_RIG, "virtual"))
    if "time" in wanted:
        save("overhead", overhead(), ("base", "rig", "matching"))
        whole = sorted(path.name for path in (ROOT / "stereolib").iterdir() if any(path.glob("*.py")))
        save("time", {"import_s": round(import_s(), 3), "reproduce_s": round(reproduce_s(), 1)}, whole)
