"""Pairs of the virtual rig, matched."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from stereolib.base import Float64, UInt8
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


def textured(draw: np.random.Generator, contrast: float, size_px: tuple[float, float]) -> Float64:
    """A picture of spots of such a width and height."""
    texture = cv2.GaussianBlur(draw.normal(0, 1, GRID[0].shape), (0, 0), size_px[0], sigmaY=size_px[1])
    return np.asarray(128 + contrast * texture / texture.std())


def pictures_of_plane(plane: Float64, left: Float64, draw: np.random.Generator, *, noise: float) -> tuple[UInt8, UInt8]:
    """What both cameras see of the plane ``disparity = plane . (u, v, 1)``, the right one darker, with noise."""
    u, v = GRID
    # Pixel x of the right picture shows column u with u - (a u + b v + c) = x.
    source = (u + plane[1] * v + plane[2]) / (1 - plane[0])
    right = 0.75 * cv2.remap(left, source.astype(np.float32), v.astype(np.float32), cv2.INTER_CUBIC)
    first, second = ((seen + draw.normal(0, noise, seen.shape)).clip(0, 255) for seen in (left, right))
    return first.astype(np.uint8), second.astype(np.uint8)
