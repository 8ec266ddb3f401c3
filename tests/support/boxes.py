"""A box before the rig as the laser and the pair have it, and lines and ends without error."""

from __future__ import annotations

import numpy as np

from stereolib.laser import LaserScan, find_segments, fit_footprint
from stereolib.measurement import Face, LaserOnFloor, floor_from_pose
from stereolib.measurement.fusion import Fused
from stereolib.virtual import recordings

RECT = recordings.rectified()
FLOOR = floor_from_pose(RECT, recordings.setup())
HERE = LaserOnFloor(np.eye(2), np.zeros(2), np.diag([0.5**2, 0.5**2, 1e-6]), bias_mm=0.0)

#: Near corner at (700, 20), right side 300 mm under 40 degrees, left side 200 mm.
X = np.array(
    [np.radians(40), *(np.array([np.cos(np.radians(a)), np.sin(np.radians(a))]) @ [700, 20] for a in (40, -50))]
)


def drawn(rng, sigma_mm=1.5):
    """A scan of that box: the true ranges of the beams that meet it, with noise."""
    angles = np.radians(np.arange(360.0))
    beam = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    ranges = np.full(360, 2500.0)
    corner = np.array([700.0, 20.0])
    for k, length in ((0, 300.0), (1, 200.0)):
        a = X[0] - k * np.pi / 2
        n, along = np.array([np.cos(a), np.sin(a)]), np.array([-np.sin(a), np.cos(a)]) * (-1 if k == 0 else 1)
        r = X[1 + k] / np.maximum(beam @ n, 1e-9)
        s = (beam * r[:, None] - corner) @ along
        hit = (beam @ n > 0.05) & (s > 0) & (s < length)
        ranges = np.where(hit & (r < ranges), r, ranges)
    return LaserScan(np.rint(ranges + rng.normal(0, sigma_mm, 360)), np.full(360, 500.0))


def the_footprint(seed):
    parts = [part for part in find_segments(drawn(np.random.default_rng(seed)), max_mm=2000) if part.kind == "object"]
    return fit_footprint(parts[0], bias_mm=0.0)


def the_faces(rng, std=1e-8):
    lines = [np.array([np.cos(a), np.sin(a)]) / c for a, c in ((X[0], X[1]), (X[0] - np.pi / 2, X[2]))]
    spans = ((-0.30, 0.0286), (0.0286, 0.22))
    return tuple(
        Face(line + rng.normal(0, std, 2), np.diag([std**2, std**2]), span, 900)
        for line, span in zip(lines, spans, strict=True)
    )


def a_box(covariance=None):
    right, left = (
        np.array([700.0, 20.0]) + d
        for d in (300 * np.array([np.sin(X[0]), -np.cos(X[0])]), 200 * np.array([np.cos(X[0]), np.sin(X[0])]))
    )
    x = np.append(X, [np.arctan2(*right[::-1]), np.arctan2(*left[::-1])])
    return Fused(x, np.zeros((5, 5)) if covariance is None else covariance, {}, (False, False), "")
