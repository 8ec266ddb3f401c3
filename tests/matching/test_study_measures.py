"""The measures of notebooks 03 and 04: each against a case whose answer is known by construction."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib.matching import filters, sweeps

RNG = np.random.default_rng(34)


def square(height: int = 40, width: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """A square of disparity 90 before a wall of 30, and the square's mask."""
    mask = np.zeros((height, width), bool)
    mask[10:30, 15:35] = True
    return np.where(mask, 90.0, 30.0), mask


@pytest.mark.parametrize("shape", ["rect", "ellipse", "cross"])
@pytest.mark.parametrize("size", [1, 3, 7])
def test_the_printed_union_level_by_level_is_the_grey_maximum(size: int, shape: str) -> None:
    levels = RNG.integers(0, 6, (23, 31))
    stacked = sum(filters.dilate_set(levels >= t, size, shape=shape).astype(int) for t in range(1, 6))
    np.testing.assert_array_equal(stacked, filters.dilate(levels, size, shape=shape))


def test_the_union_of_one_pixel_is_the_kernel() -> None:
    point = np.zeros((9, 9), bool)
    point[4, 4] = True
    assert np.argwhere(filters.dilate_set(point, 3, shape="cross")).tolist() == [
        [3, 4],
        [4, 3],
        [4, 4],
        [4, 5],
        [5, 4],
    ]


def test_a_union_needs_a_set() -> None:
    with pytest.raises(ValueError, match="mask"):
        filters.dilate_set(np.ones((4, 4)), 3)


def test_repair_counts_holes_wrong_fills_and_shift() -> None:
    truth, everywhere = np.full((1, 10), 50.0), np.ones((1, 10), bool)
    before, after = truth.copy(), truth + 0.5
    before[0, :4] = np.nan  # four holes: one is left, one filled right, one 2.5 px off, one 9 px off
    before[0, 9] = 70.0  # wrong before: no part of the shift
    after[0, :4] = [np.nan, 50.0, 52.5, 59.0]
    found = sweeps.repair(before, after, truth, everywhere)
    assert (found.holes_pct, found.filled_pct, found.shift_px) == (40.0, 75.0, 0.5)
    assert found.wrong2_pct == pytest.approx(200 / 3) and found.wrong3_pct == pytest.approx(100 / 3)


def test_repair_without_holes_has_nothing_filled() -> None:
    truth, mask = square()
    found = sweeps.repair(truth, truth, truth, mask)
    assert found.holes_pct == 0 and np.isnan(found.filled_pct) and found.shift_px == 0


def test_repair_refuses_other_shapes_and_an_empty_mask() -> None:
    truth, mask = square()
    with pytest.raises(ValueError, match="must be a mask"):
        sweeps.repair(truth, truth, truth, mask[:-1])
    with pytest.raises(ValueError, match="no pixel"):
        sweeps.repair(truth, truth, truth, np.zeros_like(mask))


@pytest.mark.parametrize("size", [1, 3, 9])
def test_dilation_lets_a_square_reach_half_the_kernel_over_its_border(size: int) -> None:
    truth, mask = square()
    assert sweeps.overreach_px(truth, truth, mask) == 0
    assert sweeps.overreach_px(filters.dilate(truth, size), truth, mask) == size // 2
    assert sweeps.overreach_px(filters.close(truth, size), truth, mask) == 0


def test_a_hole_beside_the_border_is_no_overreach() -> None:
    truth, mask = square()
    assert sweeps.overreach_px(np.where(mask, truth, np.nan), truth, mask) == 0


def test_overreach_skips_the_slanted_border_and_needs_a_step() -> None:
    truth, mask = square()
    for row in range(4):  # a roof that narrows by 5 px a row
        mask[9 - row, 15 : 30 - 5 * row] = True
    truth[mask] = 90.0
    assert sweeps.overreach_px(filters.dilate(truth, 5), truth, mask) == 2
    with pytest.raises(ValueError, match="no row"):
        sweeps.overreach_px(truth, truth, mask, step_px=61)


def test_the_near_edge_is_where_the_disparity_peaks() -> None:
    column = np.arange(50)
    truth = np.tile(100.0 - np.abs(column - 22), (6, 1))
    mask = np.tile((column > 5) & (column < 40), (6, 1))
    found = sweeps.near_edge(truth, mask, half_width_px=2)
    assert np.flatnonzero(found.all(axis=0)).tolist() == [20, 21, 22, 23, 24]
    assert not sweeps.near_edge(truth, mask & (np.arange(6) < 3)[:, None])[3:].any()


@pytest.mark.parametrize(("disparity", "window"), [(10, 16), (30, 32), (40, 48)])
def test_the_smallest_window_is_the_next_16_above_the_disparity(disparity: int, window: int) -> None:
    left = RNG.integers(0, 256, (60, 200), np.uint8)
    right = np.roll(left, -disparity, axis=1)
    truth, where = np.full(left.shape, float(disparity)), np.zeros(left.shape, bool)
    where[10:50, 60:180] = True
    assert sweeps.smallest_window(left, right, truth, where) == window
    with pytest.raises(ValueError, match="not the window"):
        sweeps.smallest_window(left, right, truth + 7, where, widest=64)


def test_the_correlation_length_of_a_cosine_is_known() -> None:
    period, column = 40.0, np.arange(1600)
    image = np.tile(np.rint(128 + 100 * np.cos(2 * np.pi * column / period)), (8, 1)).astype(np.uint8)
    expected = period / (2 * np.pi) * np.arccos(np.exp(-1))
    assert sweeps.correlation_length_px(image, np.ones(image.shape, bool)) == pytest.approx(expected, abs=0.05)
    with pytest.raises(ValueError, match="texture"):
        sweeps.correlation_length_px(np.full_like(image, 9), np.ones(image.shape, bool))


@pytest.mark.parametrize("condition", ["poor_light", "texture"])
def test_sliders_say_what_the_library_measures(condition: str) -> None:
    from stereolib.matching import SGBMParams, compute_disparity
    from stereolib.notebook import drawings
    from stereolib.virtual import recordings

    truth = recordings.load_truth(f"conditions/{condition}")
    cube = truth.visible & (truth.box == 1)
    pair = recordings.rectified().rectify(*recordings.load_pair(f"conditions/{condition}"))
    before = compute_disparity(*pair, SGBMParams(128, 5))
    quality = sweeps.score(before, truth.disparity_px, cube)
    picture, text = drawings.draw_sgbm(condition, 128, 5, 10)
    assert picture.shape == (480, 1280, 3) and f"{quality.bad2_pct:.1f} %" in text
    picture, text = drawings.draw_dilation(condition, "closing", 9)
    done = sweeps.repair(before, filters.close(before, 9), truth.disparity_px, cube)
    assert picture.shape == (480, 1280, 3) and f"{done.shift_px:+.2f} px" in text
    with pytest.raises(ValueError, match="multiple of 16"):
        drawings.draw_sgbm(condition, 100, 5, 10)
