"""Planes aligned over two pictures: against a pair made by an exact plane."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from support.ground import GRID

from stereolib.measurement.plane_alignment import AlignedPair, align


def test_alignment_finds_a_slanted_plane_to_a_hundredth():
    """A right picture made from the left by an exact plane, gain and noise; the start is 1.5 px off."""
    draw = np.random.default_rng(3)
    texture = cv2.GaussianBlur(draw.normal(0, 1, (480, 640)), (0, 0), 2.0)
    left = 128 + 40 * texture / texture.std()
    u, v = GRID
    plane = np.array([0.02, 0.30, 20.0])
    # Pixel x of the right picture shows column u with u - (a u + b v + c) = x.
    source = (u + plane[1] * v + plane[2]) / (1 - plane[0])
    right = 0.75 * cv2.remap(left, source.astype(np.float32), v.astype(np.float32), cv2.INTER_CUBIC)
    pair = [(image + draw.normal(0, 2, image.shape)).clip(0, 255).astype(np.uint8) for image in (left, right)]
    some = np.s_[250:450:2, 250:600:2]
    uu, vv = u[some].ravel(), v[some].ravel()
    x = np.stack([uu, vv, np.ones_like(uu)], axis=1)
    fit = align(AlignedPair.of(*pair), uu, vv, x, plane + np.array([0, 0, 1.5]))
    off = fit.parameters - plane
    assert np.abs(x @ off).max() < 0.05 and abs(np.mean(x @ off)) < 0.01
    assert 0.2 < np.sqrt(off @ np.linalg.solve(fit.covariance, off) / 3) < 2  # deviations
    blank = np.full((480, 640), 90, np.uint8)
    with pytest.raises(ValueError, match="no texture"):
        align(AlignedPair.of(blank, blank), uu, vv, x, plane)
