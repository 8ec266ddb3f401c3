"""A small view whose truth is known."""

from __future__ import annotations

import cv2
import numpy as np

from stereolib.matching import (
    KnownView,
)


def small_view(name: str = "plane", disparity: int = 12, seed: int = 0, **changes: object) -> KnownView:
    """A patch that stands 10 px before a background, both textured; the truth has an unknown corner."""
    rng = np.random.default_rng(seed)
    wide = cv2.GaussianBlur(rng.integers(0, 256, (100, 260), dtype=np.uint8), (0, 0), 1.0)
    left, right = wide[:, 20:240].copy(), wide[:, 20 + disparity :][:, :220].copy()
    near = wide[30:70, 100:160]
    left[30:70, 110:170] = near
    right[30:70, 110 - disparity - 10 : 170 - disparity - 10] = near
    right = np.clip(right + rng.normal(0, 3, right.shape), 0, 255).astype(np.uint8)
    truth = np.full(left.shape, float(disparity) + 0.25)
    truth[30:70, 110:170] += 10
    truth[:10, :10] = np.nan
    visible = np.ones(left.shape, bool)
    visible[30:70, 100:110] = False
    patch = truth > disparity + 5
    values = dict(truth_px=truth, visible=visible, regions={"patch": patch}, about={"disparity_px": disparity})
    return KnownView(name, left, right, **(values | changes))
