"""Pairs of the virtual rig, matched, and the height of the nearest object in them."""

from __future__ import annotations

from functools import cache

import numpy as np

from stereolib.matching import SGBMParams, compute_disparity
from stereolib.measurement import AlignedPair, CannotMeasure, GroundHeight, find_objects, fit_floor, measure_height
from stereolib.virtual import Webcam, recordings, render_pair

RECT = recordings.rectified()
PARAMS = SGBMParams(160, mode="3way")
GRID = np.meshgrid(np.arange(640.0), np.arange(480.0))


def rng():
    return np.random.default_rng(0)


def matched(pair):
    left, right = RECT.rectify(*pair)
    return left, right, compute_disparity(left, right, PARAMS, whole=True)


@cache
def recorded(name):
    return matched(recordings.load_pair(name))


def photographed(scene, pose, seed):
    """What the webcams send of a scene: noise, blur, JPEG."""
    pictures = render_pair(scene, RECT.rig, pose, samples=1, light_samples=1)
    webcam = Webcam()
    return matched([webcam.shoot(p, np.random.default_rng([seed, k])) for k, p in enumerate(pictures)])


def nearest_height(left, right, disparity, rectified, *, rng, uncertainty=None) -> GroundHeight:
    """Floor, objects, and the height of the nearest one."""
    pair = AlignedPair.of(left, right)
    floor = fit_floor(disparity, rectified, rng=rng, pair=pair)
    objects = find_objects(disparity, floor)
    if not objects:
        raise CannotMeasure("no object", "nothing stands on the floor")
    return measure_height(pair, floor, objects[0], uncertainty=uncertainty)
