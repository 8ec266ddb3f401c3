"""OpenCV's WLS filter on the motorcycle: what ``bench_pipeline.WLS`` records.

The filter is in ``opencv-contrib-python-headless``, which and ``opencv-python-headless`` stand in each other's way. So
this runs in an environment of its own, with the rest of the library from the usual one behind it::

    python -m venv contrib && contrib/bin/pip install opencv-contrib-python-headless
    PYTHONPATH=contrib/lib/python3.11/site-packages .venv/bin/python benchmarks/wls.py

Eight paths on the photographs in colour, as they came, the border widened as for ``compute_disparity(whole=True)``. Of
all settings in `GRID` the one that serves these photographs best counts, measure by measure: a gift from the truth.
"""

from __future__ import annotations

import itertools

import cv2
import numpy as np
from virtual_pairs import bad_pct

from stereolib.matching import KnownView, SGBMParams, motorcycle_view

NUM_DISPARITIES = 128
#: Edge of a block, `pre_filter_cap`, the filter's lambda and sigma of colour.
GRID = (1, 3, 5, 7), (15, 31, 63), (500, 1000, 2000, 8000), (0.5, 0.8, 1.0, 1.5)


def filtered(left: np.ndarray, right: np.ndarray, block: int, cap: int, weight: float, sigma: float) -> np.ndarray:
    """The left view's disparity, px."""
    every = {"disp12_max_diff": -1, "uniqueness_ratio": 0, "speckle_window_size": 0, "mode": "hh"}
    matcher = SGBMParams(NUM_DISPARITIES, block, pre_filter_cap=cap, **every).matcher()
    wide = [cv2.copyMakeBorder(side, 0, 0, NUM_DISPARITIES, 0, cv2.BORDER_REPLICATE) for side in (left, right)]
    back = cv2.ximgproc.createRightMatcher(matcher).compute(*wide[::-1])
    wls = cv2.ximgproc.createDisparityWLSFilter(matcher)
    wls.setLambda(weight)
    wls.setSigmaColor(sigma)
    found = wls.filter(matcher.compute(*wide), wide[0], None, back)
    return found[:, NUM_DISPARITIES:].astype(np.float32) / 16


def measures(disparity_px: np.ndarray, view: KnownView) -> dict[str, float]:
    """Bad-2 of all and bad-1 of what both cameras see, %."""
    return {
        "bad2_pct": bad_pct(disparity_px, view.truth_px, 2),
        "bad1_visible_pct": bad_pct(disparity_px, view.truth_px, 1, view.visible),
    }


if __name__ == "__main__":
    photographs = motorcycle_view()
    tried = {
        one: measures(filtered(photographs.left, photographs.right, *one), photographs)
        for one in itertools.product(*GRID)
    }
    for name in ("bad2_pct", "bad1_visible_pct"):
        best = min(tried, key=lambda one: tried[one][name])
        print(f"{name}: {tried[best][name]:.2f} with {best}")
