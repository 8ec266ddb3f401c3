"""Row offsets cell by cell: where a pair was compared, and as it was drawn."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from stereolib.matching import find_rows

SIZE, MIDDLE = (320, 240), np.array([159.5, 119.5])


def drawn(seed, per_px, offset_px=0.0):
    """A slanted textured plane, and what a right camera shows whose rows drift apart; noise in both."""
    rng, (width, height) = np.random.default_rng(seed), SIZE
    texture = gaussian_filter(rng.normal(0, 1, (300, 480)), 1.2)
    texture = 110 + 40 * texture / texture.std()
    v, u = np.indices((height, width), float)
    row = v - offset_px - per_px * (u - MIDDLE[0]) * (v - MIDDLE[1])
    column = (u + 30 + 0.01 * row - 0.02 * width / 2) / 0.98
    pair = texture[30 : 30 + height, 80 : 80 + width], map_coordinates(texture, [row + 30, column + 80])
    return [np.clip(p + rng.normal(0, 3, p.shape), 0, 255).astype(np.uint8) for p in pair]


@pytest.mark.parametrize(("per_px", "offset_px"), [(0.0, 0.0), (2e-5, 0.0), (-6e-5, 1.3)])
def test_each_cell_tells_the_rows_as_they_were_drawn(per_px, offset_px):
    for seed in range(4):
        cells = find_rows(*drawn(seed, per_px, offset_px))[0].cells
        u, v = (cells.right_px - MIDDLE).T
        off = cells.offset_px - per_px * u * v
        assert np.median(np.abs(off - np.median(off))) < 0.1 and len(off) > 80  # a plane is taken off already
        assert abs(np.median(off)) < 0.05
        assert np.polyfit(u * v, cells.offset_px, 1, w=cells.weight)[0] == pytest.approx(per_px, rel=0.15, abs=4e-6)


def test_cells_stand_where_they_are_in_both_pictures():
    cells = find_rows(*drawn(3, 0.0))[0].cells
    disparity = cells.left_u_px - cells.right_px[:, 0]
    u, v = cells.right_px.T
    column = (u + 30 + 0.01 * v - 0.02 * SIZE[0] / 2) / 0.98  # of the left picture that the right one shows there
    np.testing.assert_allclose(disparity, column - u, atol=2.5)
    assert np.median(np.abs(disparity - (column - u))) < 0.5
    blocks = {tuple((np.array(at) // 48).astype(int)) for at in np.stack([cells.left_u_px, v], axis=1)}
    assert len(np.unique(cells.block)) <= 1.5 * len(blocks)


def test_cells_of_a_larger_picture_are_farther_apart_and_off_by_more():
    cells = find_rows(*drawn(3, 2e-5))[0].cells
    twice = cells.doubled()
    np.testing.assert_allclose(twice.right_px, 2 * cells.right_px + 0.5)
    np.testing.assert_allclose(twice.left_u_px - twice.right_px[:, 0], 2 * (cells.left_u_px - cells.right_px[:, 0]))
    np.testing.assert_allclose(twice.offset_px, 2 * cells.offset_px)


def test_where_nothing_is_matched_there_are_none():
    grey = np.full((240, 320), 128, np.uint8)
    assert find_rows(grey, grey)[0].cells is None
