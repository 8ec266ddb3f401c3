"""Patterns of one's own on surfaces: where they lie, and how a pixel that covers much of one sees it."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib.virtual import Box, Material, Scene, Tile, cast_rays
from stereolib.virtual.texture import filtered


def half_white(n: int = 64) -> np.ndarray:
    values = np.zeros((n, n))
    values[: n // 2] = 1  # the rows of small v
    return values


def test_a_tile_lies_on_the_face_as_drawn_and_repeats() -> None:
    tile = Tile(half_white(), 2.0)  # 128 mm, then again
    u, v = np.full(4, 5.0), np.array([20.0, 100.0, 20.0 + 128, 100.0 - 128])
    seen = filtered(tile.levels, u, v, np.zeros(4), tile.mm_per_texel)
    np.testing.assert_allclose(seen, [1, -1, 1, -1], atol=1e-6)


def test_a_pixel_that_covers_the_tile_sees_its_mean() -> None:
    tile = Tile(np.indices((64, 64)).sum(axis=0) % 2, 1.0)  # a checkerboard of single texels
    near, far = (filtered(tile.levels, *np.full((3, 1), [[10.0], [10.0], [w]]), 1.0)[0] for w in (0.0, 30.0))
    assert abs(near) == pytest.approx(1) and abs(far) < 1e-6


def test_a_box_shows_its_tile() -> None:
    """Albedo along a vertical line of a face: two values, changing every 16 mm."""
    material = Material((0.5, 0.5, 0.5), contrast=0.2, tile=Tile(half_white(32), 1.0))
    box = Box((100.0, 100.0, 100.0), np.eye(4), (material,))
    heights = np.linspace(-40, 40, 200)
    origins = np.column_stack([np.full(200, -500.0), np.zeros(200), heights])
    albedo = cast_rays(Scene((box,)), origins, np.tile([1.0, 0.0, 0.0], (200, 1))).albedo
    expected = np.where(heights % 32 < 16, 0.6, 0.4)
    assert (np.abs(albedo - expected) < 1e-3).mean() > 0.9  # between two texels it is blended


@pytest.mark.parametrize(
    ("values", "why"),
    [(np.zeros((64, 32)), "square"), (np.eye(48), "power of two"), (np.eye(4), "8 or more"),
     (np.ones((64, 64)), "one value")],
)  # fmt: skip
def test_a_tile_that_cannot_repeat_is_refused(values: np.ndarray, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        Tile(values, 1.0)
