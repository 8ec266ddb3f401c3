"""Rows that drift apart towards the corners: found as they were drawn, with honest deviations."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates
from support.pairs import rectified_cube

from stereolib.matching import find_rows
from stereolib.rig import to_grey

SIZE, MIDDLE = (320, 240), np.array([159.5, 119.5])
TURNS_PX = [-6.0, -1.5, 0.0, 1.5, 6.0]
F_PX = 764.0  # about that of the recorded pair


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


def turned(picture, turn_px):
    """What a pinhole shows that was turned about its upright axis, so that its middle moves by so much.

    By splines: OpenCV's looks are rounded to 1/32 px, and so much adds up over rows that differ by a tenth.
    """
    height, width = picture.shape
    K = np.array([[F_PX, 0, (width - 1) / 2], [0, F_PX, (height - 1) / 2], [0, 0, 1]])
    H = K @ cv2.Rodrigues(np.array([0.0, -turn_px / F_PX, 0.0]))[0] @ np.linalg.inv(K)
    v, u = np.indices((height, width), float)
    x, y, z = np.einsum("ij,jvu->ivu", H, np.stack([u, v, np.ones_like(u)]))
    shown = map_coordinates(picture.astype(float), [y / z, x / z], mode="nearest")
    return np.rint(shown).clip(0, 255).astype(np.uint8)


@pytest.mark.parametrize("per_px", [-6e-5, 0.0, 2e-5])
@pytest.mark.parametrize("offset_px", [0.0, 1.3])
def test_it_is_found_as_it_was_drawn_with_an_honest_deviation(per_px, offset_px):
    found = [find_rows(*drawn(seed, per_px, offset_px))[0].keystone for seed in range(12)]
    off = np.array([k.per_px - per_px for k in found])
    std = np.hypot([k.std_per_px for k in found], 0.08 * per_px)  # it comes out some hundredths too large
    assert np.sqrt(((off / std) ** 2).mean()) < 1.7  # beyond which chance leaves one in a thousand of twelve
    assert max(k.std_per_px for k in found) < 2e-5


@pytest.mark.parametrize("turn_px", TURNS_PX)
def test_a_recorded_pair_tells_how_far_its_right_camera_was_turned(turn_px):
    left, right = map(to_grey, rectified_cube())
    before, after = (find_rows(left, picture)[0].keystone for picture in (right, turned(right, turn_px)))
    more_px = F_PX**2 * (after.per_px - before.per_px)
    std_px = F_PX**2 * after.std_per_px
    assert abs(more_px - turn_px) < 3 * std_px + 0.1 * abs(turn_px)  # large ones fall short, as their rows curve
    assert 0.05 < std_px < 0.5


def test_rows_that_were_moved_and_rolled_change_it_by_no_more_than_it_is_sure_of():
    left, right = rectified_cube()
    height, width = right.shape[:2]
    warp = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), 0.5, 1)
    warp[1, 2] += 2.0
    other = cv2.warpAffine(right, warp, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    one, two = (find_rows(left, picture)[0].keystone for picture in (right, other))
    assert abs(one.per_px - two.per_px) < 2 * one.std_per_px


def test_the_gains_make_it_of_the_cells_offsets_in_any_size():
    """Offsets that are a keystone themselves come out as one; those of a plane as none."""
    keystone = find_rows(*drawn(3, 2e-5))[0].keystone
    for each, middle in ((keystone, MIDDLE), (keystone.doubled(), 2 * MIDDLE + 0.5)):
        u, v = (each.right_px - middle).T
        np.testing.assert_allclose(each.gain @ (u * v), 1.0, rtol=1e-6)
        np.testing.assert_allclose(each.gain @ (0.3 + 0.01 * u - 0.02 * v), 0.0, atol=1e-9)
        assert (each.left_u_px > each.right_px[:, 0]).all()
    assert keystone.doubled().per_px == keystone.per_px / 2


def test_where_nothing_is_matched_nothing_is_told():
    grey = np.full((240, 320), 128, np.uint8)
    assert find_rows(grey, grey)[0].keystone is None
