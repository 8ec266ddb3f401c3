"""Stations of the virtual walk with objects made from the truth, for tests: noise of known covariance on top."""

from __future__ import annotations

from functools import cache

import numpy as np

from stereolib import laser
from stereolib.mapping import Station
from stereolib.measurement import MeasuredObject, Reason, Source, Why
from stereolib.virtual import VirtualLidar, recordings, walk

#: Which boxes a station sees, and whether two of their faces.
SEEN = {1: {3: 1}, 2: {2: 0, 4: 1}, 3: {0: 1, 1: 1, 3: 1}, 4: {2: 1, 4: 1}, 5: {0: 1, 1: 1}}
STD_MM, STD_RAD = 2.0, 0.004


def truth(k):
    """Size (3,), centre (2,) and yaw of a box of the walk."""
    box = walk.objects()[k]
    c, s = box.T_world_box[:2, 0]
    return np.array(box.size_mm), box.T_world_box[:2, 3], float(np.arctan2(s, c))


def corners(size, centre, yaw):
    a, b = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    return centre + np.array(
        [i * size[0] / 2 * a + j * size[1] / 2 * b for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    )


def box(size, centre, yaw, rng, *, std=STD_MM):
    """A box seen by two faces, with noise, in the frame of `centre` and `yaw`."""
    size, centre = size + std * rng.normal(size=3), centre + std * rng.normal(size=2)
    yaw = (yaw + STD_RAD * rng.normal() + np.pi / 2) % np.pi - np.pi / 2
    return MeasuredObject(
        "box", size, np.eye(3) * std**2, centre, np.eye(2) * std**2, yaw, STD_RAD, corners(size, centre, yaw),
        {"lines": Source.BOTH, "height": Source.IMAGE}, {},
    )  # fmt: skip


def face(size, centre, yaw, rng, *, std=STD_MM):
    """The face of a box that looks at the frame's origin most squarely."""
    axes = {0: yaw, 1: yaw + np.pi / 2, 2: yaw + np.pi, 3: yaw - np.pi / 2}
    side = min(axes, key=lambda k: centre @ [np.cos(axes[k]), np.sin(axes[k])])
    depth, width = (size[0], size[1]) if side % 2 == 0 else (size[1], size[0])
    middle = centre + depth / 2 * np.array([np.cos(axes[side]), np.sin(axes[side])]) + std * rng.normal(size=2)
    width, height = width + std * rng.normal(), size[2] + std * rng.normal()
    along = axes[side] + np.pi / 2 + STD_RAD * rng.normal()
    half = width / 2 * np.array([np.cos(along), np.sin(along)])
    covariance = np.full((3, 3), np.nan)
    covariance[1:, 1:] = np.eye(2) * std**2
    return MeasuredObject(
        "face", np.array([np.nan, width, height]), covariance, middle, np.eye(2) * std**2,
        (along + np.pi / 2) % np.pi - np.pi / 2, STD_RAD, np.array([middle - half, middle + half]),
        {"lines": Source.BOTH, "height": Source.IMAGE}, {"length": Why(Reason.DEPTH_HIDDEN)},
    )  # fmt: skip


def into(pose, centre, yaw):
    """Centre and yaw of the map in a station's frame."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return (np.asarray(centre) - pose[:2]) @ np.array([[c, -s], [s, c]]), yaw - pose[2]


@cache
def scan_mm(k):
    return laser.points_mm(recordings.scan(f"room/{k}"))


def station(k, rng, *, only=None, **fields):
    """Station 1 to 5 of the walk at its true pose."""
    pose = np.array(walk.POSES[f"room/{k}"])
    things = []
    for index, two in SEEN[k].items():
        if only is None or index in only:
            size, centre, yaw = truth(index)
            things.append((box if two else face)(size, *into(pose, centre, yaw), rng))
    return Station(pose, tuple(things), **{"scan_mm": scan_mm(k), **fields})


def walked(rng):
    return [station(k, rng) for k in SEEN]


def more_scan_bytes(pose, seed=9):
    """What the walk's laser sends from another place in its room."""
    sensor = VirtualLidar(height_mm=walk.LASER_HEIGHT_MM)
    return sensor.scan(walk.walk_scene(), pose, np.random.default_rng(seed), turns=5)
