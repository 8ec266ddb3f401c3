"""Walls of a map: how well they are known, held against many scans of a room whose walls are known."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib.base import direction, turn_2d
from stereolib.laser import XV11_SIGMA
from stereolib.mapping import Station
from stereolib.mapping.stations import XV11_BIAS
from stereolib.mapping.walls import find_walls
from stereolib.virtual import Scene, cast_rays, room, walk

POSES = np.array(list(walk.POSES.values()))[:3]
SCENE = Scene((room(x_mm=(-1400.0, 2000.0), y_mm=(-1300.0, 1500.0)),))
ANGLES = np.radians(np.arange(360))


def views():
    """Of each station: true ranges, the wall that each beam meets, the cosine it meets it at, and where."""
    for x, y, yaw in POSES:
        beams = np.column_stack([direction(yaw + ANGLES), np.zeros(360)])
        hits = cast_rays(SCENE, np.array([x, y, 100.0]), beams)
        normals, side = np.unique(hits.normal.round(6), axis=0, return_inverse=True)
        at = np.array([x, y]) + hits.distance_mm[:, None] * beams[:, :2]
        yield hits.distance_mm, side.ravel(), np.abs((beams * hits.normal).sum(axis=1)), normals[:, :2], at


@pytest.mark.parametrize(
    "known, poses, bias_mm",
    [
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0)),
        ((1.5, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0)),
        ((0.0, 0.003, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0)),
        ((0.0, 0.0, 0.002), (0.0, 0.0, 0.0), (0.0, 0.0)),
        ((0.0, 0.0, 0.0), (2.0, 2.0, 0.002), (0.0, 0.0)),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), XV11_BIAS),
    ],
    ids=["noise", "place", "turn", "scale", "poses", "bias"],
)
def test_walls_are_known_as_well_as_is_said(known, poses, bias_mm):
    """Five turns in whole millimetres; with a laser, poses or a bias that are off by what is stated of them."""
    rng, seen, (by_bit, by_range) = np.random.default_rng(3), list(views()), bias_mm
    covariance = np.diag(np.square([known[0], *known]))
    normals, sides, points = seen[0][3], np.concatenate([v[1] for v in seen]), np.concatenate([v[4] for v in seen])
    scores = []
    for _ in range(40):
        off, longer = np.sqrt(np.diag(covariance)) * rng.normal(size=4), by_range * rng.normal()
        stations = []
        for pose, (r, side, cosine, _, _) in zip(POSES, seen, strict=True):
            true = r + longer * r**2 + by_bit * rng.normal(size=len(normals))[side] / cosine
            read = np.rint(true + XV11_SIGMA(r) * rng.normal(size=(5, 360))).mean(axis=0)
            scan = (1 + off[3]) * read[:, None] * direction(ANGLES) @ turn_2d(off[2]) - off[:2]
            errs = {"laser_covariance": covariance, "laser_common": np.sqrt(covariance)}
            told = pose + np.array(poses) * rng.normal(size=3)
            stations.append(Station(told, (), scan, covariance=np.diag(np.square(poses)), **errs))
        walls = find_walls(stations, rng=np.random.default_rng(0), bias_mm=bias_mm)
        assert len(walls) >= 4  # a fifth is a second line through the noise of one
        for wall in walls[:4]:
            normal = normals[k := int((normals @ wall.normal).argmax())]
            off_mm = wall.normal @ points[sides == k].mean(axis=0) - wall.offset_mm
            turned = wall.normal @ [-normal[1], normal[0]]
            scores.append((off_mm / wall.offset_std_mm, turned / wall.angle_std_rad))
    assert np.sqrt(np.mean(np.square(scores), axis=0)) == pytest.approx([1, 1], abs=0.25)
