"""Patches that a second matching does not know: mistaken islands go, surfaces stay."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from stereolib.matching import find_rows, match_checked, stereo_pipeline
from stereolib.matching.islands import unsupported
from stereolib.virtual import recordings


def test_an_island_goes_and_a_surface_with_holes_in_the_rough_match_stays() -> None:
    map_px = np.tile(np.linspace(20, 30, 60, dtype=np.float32), (40, 1))
    rough = map_px[::2, ::2] / 2
    rough[:, 5:26] = np.nan  # most of it
    map_px[10:20, 30:40] += 25
    refused = unsupported(map_px, np.ones(map_px.shape, bool), rough)
    assert refused[10:20, 30:40].all() and refused.sum() == 100


def test_steps_part_surfaces_along_rows_and_columns() -> None:
    """Two islands that touch at a step: one is known, and stays."""
    map_px = np.full((30, 30), 10, np.float32)
    map_px[5:15, 5:15], map_px[15:25, 5:15] = 40, 45
    rough = np.full((15, 15), 5, np.float32)
    rough[2:7, 2:7] = 20
    refused = unsupported(map_px, map_px > 0, rough)
    assert refused[16:24, 6:14].all() and not refused[:15].any()


def test_where_nothing_was_matched_roughly_nothing_is_refused() -> None:
    map_px = np.full((8, 8), 5, np.float32)
    assert not unsupported(map_px, map_px > 0, np.full((4, 4), np.nan, np.float32)).any()


def test_occluded_wall_of_the_walk_loses_its_ghosts() -> None:
    """In the second pair of the walk a wall that the left camera alone sees is matched with a box before it."""
    pair, truth = recordings.rectified().rectify(*recordings.load_pair("room/2")), recordings.load_truth("room/2")
    before = stereo_pipeline("best", None)(*pair)
    after = match_checked(*pair).estimate
    off = np.abs(before.disparity_px - truth.disparity_px)
    ghost, good = before.matched & (off > 10), before.matched & (off < 1)
    assert ghost.sum() > 1400
    wide = cv2.morphologyEx(ghost.astype(np.uint8), cv2.MORPH_OPEN, np.ones((5, 5), np.uint8)) > 0
    assert wide.sum() > 150 and not (wide & after.matched).any()  # what stays are seams at the rims of things
    assert (ghost & after.matched).sum() < 0.55 * 1900
    surely = ghost & (off > 3 * before.std_px)
    assert (surely & after.matched).sum() < 0.5 * surely.sum()
    assert (good & after.matched).sum() > 0.99 * good.sum()
    np.testing.assert_array_equal(after.disparity_px[after.matched], before.disparity_px[after.matched])
    refused = before.matched & ~after.matched
    assert np.isnan(after.disparity_px[refused]).all()
    np.testing.assert_array_equal(refused, unsupported(before.disparity_px, before.matched, find_rows(*pair)[1]))


def test_noise_tells_nothing() -> None:
    left, right = np.random.default_rng(0).integers(0, 256, (2, 240, 320), np.uint8)
    with pytest.raises(ValueError, match=r"only 0\.\d % of the pixels were matched: nothing can be measured"):
        match_checked(left, right, "fast", 64)


def test_what_is_nearer_than_the_range_is_refused_and_the_rest_stays() -> None:
    """Boxes of the walk are up to 70 px near; 48 are searched."""
    pair, truth = recordings.rectified().rectify(*recordings.load_pair("room/3")), recordings.load_truth("room/3")
    found = match_checked(*pair, "best", 48)
    nearer, matched = truth.disparity_px > 50, found.estimate.matched
    plain = stereo_pipeline("best", 48)(*pair)
    assert (plain.matched & nearer).sum() > 10_000  # what would be told wrongly
    assert (matched & nearer).sum() < 0.01 * nearer.sum()
    np.testing.assert_array_equal(np.isnan(found.estimate.disparity_px[matched]), False)
    farther = plain.matched & (truth.disparity_px < 46) & (np.abs(plain.disparity_px - truth.disparity_px) < 1)
    assert (matched & farther).sum() > 0.97 * farther.sum()
    assert found.shares["refused"] > 0.9 * nearer.mean()
    assert "beyond num_disparities 48: they are refused" in " ".join(found.notes)
