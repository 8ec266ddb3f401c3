"""A slow twin of the ray caster: one ray at a time."""

from __future__ import annotations

import math

import numpy as np


def cast_one(scene, origin, direction):
    """Distance, surface, normal of one ray, face by face in plain arithmetic."""
    best = (math.inf, -1, None)
    for index, box in enumerate(scene.boxes):
        axes, centre = box.T_world_box[:3, :3].T, box.T_world_box[:3, 3]
        for face in range(6):
            axis, sign = face // 2, 1 if face % 2 else -1
            outward = sign * axes[axis]
            towards = float(np.dot(outward, direction))
            if towards == 0 or (towards > 0) != box.inside:  # only faces that look at the eye
                continue
            t = float(np.dot(outward, centre + outward * box.size_mm[axis] / 2 - origin)) / towards
            hit = origin + t * direction - centre
            others = [a for a in range(3) if a != axis]
            if t > 1e-2 and t < best[0] and all(abs(np.dot(hit, axes[a])) <= box.size_mm[a] / 2 for a in others):
                best = (t, 6 * index + face, -outward if box.inside else outward)
    return best


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
