"""Pictures disturbed by a known amount: exposure, rows, noise."""

from __future__ import annotations

import cv2
import numpy as np


def exposed(picture, gain, gamma=1.0):
    levels = 255 * gain * (np.arange(256) / 255) ** gamma
    return cv2.LUT(picture, levels.clip(0, 255).round().astype(np.uint8))


def rows_moved(picture, offset_px, roll_rad=0.0):
    """The picture's middle moved down, and turned about it row by row: by ``offset + roll (u - middle)``."""
    height, width = picture.shape[:2]
    warp = np.array([[1.0, 0.0, 0.0], [-roll_rad, 1.0, roll_rad * (width - 1) / 2 - offset_px]])
    flags = cv2.INTER_LANCZOS4 | cv2.WARP_INVERSE_MAP
    return cv2.warpAffine(picture, warp, (width, height), flags=flags, borderMode=cv2.BORDER_REFLECT)


def noisy(picture, grey_levels, seed):
    noise = np.random.default_rng(seed).normal(0, grey_levels, picture.shape)
    return (picture + noise).clip(0, 255).astype(np.uint8)
