"""Pairs of pictures that several tests match."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from stereolib.base import UInt8
from stereolib.virtual import recordings


def shifted(disparity: int, shape: tuple[int, int] = (120, 240), seed: int = 0) -> tuple[UInt8, UInt8]:
    """A textured pair whose right picture is the left one moved by a whole number of pixels."""
    rng = np.random.default_rng(seed)
    wide = cv2.GaussianBlur(rng.integers(0, 256, (shape[0], shape[1] + disparity), dtype=np.uint8), (0, 0), 0.8)
    return wide[:, : shape[1]].copy(), wide[:, disparity:].copy()


@cache
def rectified_cube() -> tuple[UInt8, UInt8]:
    """The recorded pair of the textured cube, rectified."""
    return recordings.rectified().rectify(*recordings.load_pair("conditions/texture"))
