"""Pairs of the virtual rig, matched."""

from __future__ import annotations

from functools import cache

import numpy as np

from stereolib.matching import SGBMParams, compute_disparity
from stereolib.virtual import Webcam, recordings, render_pair

RECT = recordings.rectified()
PARAMS = SGBMParams(160, mode="3way")
GRID = np.meshgrid(np.arange(640.0), np.arange(480.0))


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
