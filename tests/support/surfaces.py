"""Surfaces unlike the virtual rig's noise: printed cartons, bricks, planks and terrazzo, drawn from a seed."""

from __future__ import annotations

import cv2
import numpy as np

from stereolib.base import Float64
from stereolib.virtual import Material, Tile

_SIDE = 1024  # texels


def carton(rng: np.random.Generator) -> Material:
    """Corrugated board with lines of print, boxes, a bar code and a strip of tape; 0.5 mm a texel."""
    flutes = 158 + 5 * np.sin(np.arange(_SIDE) * 2 * np.pi / 8)  # they show through
    picture = np.tile(flutes, (_SIDE, 1)).astype(np.uint8)
    for _ in range(60):
        x, y = (int(v) for v in rng.integers(0, _SIDE, 2))
        ink, size = int(rng.integers(12, 100)), float(rng.uniform(0.5, 2.2))
        word = "".join(chr(int(c)) for c in rng.integers(48, 91, int(rng.integers(3, 12))))
        font, thick = cv2.FONT_HERSHEY_SIMPLEX, max(1, round(2 * size))
        cv2.putText(picture, word, (x - 60, y), font, size, ink, thick, cv2.LINE_AA)
    for _ in range(12):
        x, y, w, h = (int(v) for v in rng.integers([0, 0, 30, 20], [_SIDE, _SIDE, 160, 90]))
        cv2.rectangle(picture, (x, y), (x + w, y + h), int(rng.integers(25, 230)), int(rng.choice([-1, 3, 6])))
    for x in range(200, 500, 9):
        picture[700:800, x : x + int(rng.integers(2, 7))] = 25
    row = int(rng.integers(0, _SIDE - 90))
    picture[row : row + 90] = picture[row : row + 90] // 2 + 97
    return _material((0.36, 0.50, 0.62), 0.3, picture / 255 + _grain(rng, 1.5, 0.03), 0.5)


def bricks(rng: np.random.Generator) -> Material:
    """Bricks of different burns in mortar, in running bond; 0.6 mm a texel."""
    picture = np.full((_SIDE, _SIDE), 0.75)
    high, long, joint = 64, 128, 8
    for course in range(_SIDE // high):
        for brick in range(_SIDE // long):
            x = brick * long + (course % 2) * long // 2
            columns = np.arange(x + joint, x + long) % _SIDE
            dents = rng.uniform(-3, 4, 2).round().astype(int)
            rows = slice(course * high + joint + abs(dents[0]), (course + 1) * high - abs(dents[1]))
            picture[rows, columns] = rng.uniform(0.2, 0.6)
    picture = picture + _grain(rng, 2.0, 0.08) + _grain(rng, 14.0, 0.04)
    return _material((0.28, 0.34, 0.52), 0.38, picture, 0.6)


def planks(rng: np.random.Generator) -> Material:
    """Floor boards with drawn-out grain, knots and dark joints; 1 mm a texel."""
    picture, wide = np.empty((_SIDE, _SIDE)), 128
    rows, columns = np.mgrid[:_SIDE, :wide].astype(float)
    for board in range(_SIDE // wide):
        bend = 10 * np.sin(2 * np.pi * (rows / _SIDE + rng.uniform())) + 5 * np.sin(
            2 * np.pi * (2 * rows / _SIDE + rng.uniform())
        )
        spacing = rng.uniform(5, 14)
        grain = 0.07 * np.sin(2 * np.pi * (columns + bend) / spacing)
        for _ in range(int(rng.integers(1, 4))):
            y, x = rng.uniform(0, _SIDE), rng.uniform(15, wide - 15)
            off = np.hypot((rows - y) / 2.5, columns - x)
            grain -= 0.25 * np.exp(-((off / 9) ** 2)) * (1 + 0.4 * np.cos(off))
        cell = grain + rng.uniform(0.35, 0.65)
        end = int(rng.integers(0, _SIDE))
        cell[:, :3] = cell[end : end + 3] = 0.08
        picture[:, board * wide : (board + 1) * wide] = cell
    fibre = cv2.GaussianBlur(rng.standard_normal((_SIDE, _SIDE)), (0, 0), sigmaX=0.8, sigmaY=8)
    return _material((0.30, 0.42, 0.54), 0.35, picture + 0.06 * fibre / fibre.std(), 1.0)


def terrazzo(rng: np.random.Generator) -> Material:
    """Chips of stone of 3 to 25 mm in cement; 0.8 mm a texel."""
    picture = np.full((_SIDE, _SIDE), 140, np.uint8)
    for _ in range(2600):
        centre, size = rng.uniform(0, _SIDE, 2), float(np.exp(rng.uniform(np.log(2), np.log(15))))
        angles = np.sort(rng.uniform(0, 2 * np.pi, int(rng.integers(4, 8))))
        chip = centre + size * rng.uniform(0.6, 1.0, (len(angles), 1)) * np.stack([np.cos(angles), np.sin(angles)], 1)
        cv2.fillPoly(picture, [np.rint(8 * chip).astype(np.int32)], int(rng.integers(40, 240)), cv2.LINE_AA, 3)
    return _material((0.46, 0.48, 0.50), 0.35, picture / 255 + _grain(rng, 1.0, 0.02), 0.8)


def _grain(rng: np.random.Generator, size: float, strength: float) -> Float64:
    grain = cv2.GaussianBlur(rng.standard_normal((_SIDE, _SIDE)), (0, 0), size)
    return np.asarray(strength * grain / grain.std())


def _material(color_bgr: tuple[float, float, float], contrast: float, picture: Float64, mm: float) -> Material:
    upright = np.asarray(picture[::-1], float)  # a face's rows count upwards
    return Material(color_bgr, contrast, roughness=0.3, tile=Tile(upright, mm))
