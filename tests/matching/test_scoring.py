"""Scores of disparity maps against numbers made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib.matching import filters, scenes, scoring

NAN = np.nan


def test_score_by_hand():
    truth = np.array([[10.0, 10, 10, 10, 10], [10, 10, 10, 10, NAN]])
    found = np.array([[10.5, 8.5, 13, 15, NAN], [10, 10, 9.5, 11, 50]])
    where = np.ones((2, 5), bool)
    where[1, 3] = False
    # errors looked at: .5 -1.5 3 5 nan 0 0 -.5
    result = scoring.score(found, truth, where)
    assert (result.bad1_pct, result.bad2_pct, result.bad4_pct) == (50, 37.5, 25)
    assert result.density_pct == 87.5
    assert result.bias_px == pytest.approx(1.5 / 6)
    assert result.rms_px == pytest.approx(np.sqrt((0.25 + 2.25 + 9 + 0.25) / 6))
    assert scoring.score(found, truth).density_pct == pytest.approx(100 * 8 / 9)  # and the pixel left out counts
    assert scoring.score(found, truth).bad1_pct == pytest.approx(100 * 4 / 9)


def test_limits_are_not_bad():
    truth = np.zeros((1, 3))
    result = scoring.score(np.array([[1.0, 2.0, 4.0]]), truth)
    assert (result.bad1_pct, result.bad2_pct, result.bad4_pct) == pytest.approx((200 / 3, 100 / 3, 0))


def test_nothing_returned():
    result = scoring.score(np.full((2, 2), NAN), np.ones((2, 2)))
    assert (result.bad4_pct, result.density_pct) == (100, 0)
    assert np.isnan([result.bias_px, result.rms_px]).all()


def test_score_refuses():
    with pytest.raises(ValueError, match=r"one shape, got \[\(2, 2\), \(2, 3\)\]"):
        scoring.score(np.ones((2, 2)), np.ones((2, 3)))
    with pytest.raises(ValueError, match=r"mask \(2, 2\) of bool, got \(3, 3\) of bool"):
        scoring.score(np.ones((2, 2)), np.ones((2, 2)), np.ones((3, 3), bool))
    with pytest.raises(ValueError, match="no pixel with a known truth"):
        scoring.score(np.ones((2, 2)), np.full((2, 2), NAN))
    with pytest.raises(ValueError, match="no pixel with a known truth"):
        scoring.score(np.ones((2, 2)), np.ones((2, 2)), np.zeros((2, 2), bool))


def test_repair_by_hand():
    truth = np.full((1, 8), 20.0)
    before = np.array([[20, 21, 30, NAN, NAN, NAN, NAN, 20]])
    after = np.array([[21, 21, 30, 20, 22.5, 25, NAN, 99]])
    where = np.array([[True] * 7 + [False]])
    result = scoring.score_repair(before, after, truth, where)
    assert result.holes_pct == pytest.approx(400 / 7)
    assert result.filled_pct == 75
    assert result.wrong2_pct == pytest.approx(200 / 3)
    assert result.wrong3_pct == pytest.approx(100 / 3)
    assert result.shift_px == pytest.approx(0.5)  # of the two that were right
    whole = scoring.score_repair(after[:, :2], after[:, :2], truth[:, :2], where[:, :2])
    assert (whole.holes_pct, whole.shift_px) == (0, 0)
    assert np.isnan([whole.filled_pct, whole.wrong2_pct]).all()


def test_repair_refuses():
    one = np.ones((2, 2))
    with pytest.raises(ValueError, match="must have one shape"):
        scoring.score_repair(one, one[:, :1], one, np.ones((2, 2), bool))
    with pytest.raises(ValueError, match=r"mask \(2, 2\) of bool, got \(2, 3\)"):
        scoring.score_repair(one, one, one, np.ones((2, 3), bool))
    with pytest.raises(ValueError, match="no pixel with a known truth"):
        scoring.score_repair(one, one, one, np.zeros((2, 2), bool))


@pytest.mark.parametrize("mask", [np.array([[0, 255], [255, 0]], np.uint8), np.eye(2, dtype=int), [[0, 1], [1, 0]],
                                  np.eye(2)])  # fmt: skip
def test_a_mask_is_bool(mask):
    """Numbers would be looked up as indices or multiplied with the mask of what is known, and score nonsense."""
    one, picture = np.ones((2, 2)), np.ones((2, 2), np.uint8)
    calls = (lambda: scoring.score(one, one, mask), lambda: scoring.score_repair(one, one, one, mask),
             lambda: scoring.overreach_px(one, one, mask), lambda: scoring.fattening_px(one, one, mask),
             lambda: scenes.near_edge_mask(one, mask), lambda: scenes.correlation_length_px(picture, mask))  # fmt: skip
    for call in calls:
        with pytest.raises(ValueError, match=r"must be a mask \(2, 2\) of bool, got \(2, 2\) of (uint8|int64|float64)"):
            call()
    flags = [[False, True], [True, False]]  # a list of bools is one
    assert scoring.score(one, one, flags).density_pct == 100


def scene_with_a_border():
    truth, on_object = np.full((20, 40), 30.0), np.zeros((20, 40), bool)
    on_object[5:15, 10:20] = True
    truth[on_object] = 80
    return truth, on_object


@pytest.mark.parametrize("grown", [0, 1, 6])
def test_overreach_counts_the_pixels_beyond_the_border(grown):
    truth, on_object = scene_with_a_border()
    found = truth.copy()
    found[5:15, 20 : 20 + grown] = 80
    found[5:15, 30] = 80  # another thing, not joined to the object
    found[8, 28] = NAN
    assert scoring.overreach_px(found, truth, on_object) == grown


def test_overreach_looks_only_at_clear_borders():
    truth, on_object = scene_with_a_border()
    truth[5:10, 20:] = 75  # the floor beside its foot
    found = truth.copy()
    found[10:15, 20:24] = 80
    assert scoring.overreach_px(found, truth, on_object) == 4
    with pytest.raises(ValueError, match="no row where the object stands 100 px before"):
        scoring.overreach_px(found, truth, on_object, step_px=100)


def test_errors_of_all_returned_pixels_and_the_swing_by_hand():
    truth = np.array([[10.0, 10.25, 10.5, 10.75, 10.0]])
    found = truth + np.array([0.0, 0.1, 0.0, -0.1, 12.0])  # drawn towards 10.5
    result = scoring.score(found, truth)
    assert result.mean_all_px == pytest.approx(12.2 / 5)
    assert result.rms_all_px == pytest.approx(np.sqrt((0.02 + 144) / 5))
    assert result.locking_px == pytest.approx(0.1)  # 2/4 |0.1 i + (-0.1)(-i)|
    assert scoring.score(truth + 0.3, truth).locking_px == pytest.approx(0.3 * 2 / 5)


def test_matches_that_keep_to_whole_pixels_swing_as_known():
    """Rounding to whole pixels errs by a sawtooth, whose first harmonic is 1 / pi."""
    truth = np.linspace(20, 40, 20001)[None, :-1]
    assert scoring.score(np.rint(truth), truth).locking_px == pytest.approx(1 / np.pi, rel=1e-3)
    assert scoring.score(truth + 0.2, truth).locking_px == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("grown", [0, 1, 5])
def test_fattening_is_the_width_of_the_rim(grown):
    truth, _ = scene_with_a_border()
    visible = np.ones(truth.shape, bool)
    visible[5:15, :10] = False  # hidden from the right camera
    found = truth.copy()
    found[5:15, 20 : 20 + grown] = 80
    found[5:15, 19] = 30  # a rim that is too narrow is another error
    assert scoring.fattening_px(found, truth, visible) == pytest.approx(grown)
    assert np.isnan(scoring.fattening_px(found, np.full(truth.shape, 30.0), visible))
    found[5:15, 20:] = NAN  # nor are holes fattening
    assert scoring.fattening_px(found, truth, visible) == 0


def square(height: int = 40, width: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """A square of disparity 90 before a wall of 30, and the square's mask."""
    mask = np.zeros((height, width), bool)
    mask[10:30, 15:35] = True
    return np.where(mask, 90.0, 30.0), mask


def test_repair_counts_holes_wrong_fills_and_shift() -> None:
    truth, everywhere = np.full((1, 10), 50.0), np.ones((1, 10), bool)
    before, after = truth.copy(), truth + 0.5
    before[0, :4] = np.nan  # four holes: one is left, one filled right, one 2.5 px off, one 9 px off
    before[0, 9] = 70.0  # wrong before: no part of the shift
    after[0, :4] = [np.nan, 50.0, 52.5, 59.0]
    found = scoring.score_repair(before, after, truth, everywhere)
    assert (found.holes_pct, found.filled_pct, found.shift_px) == (40.0, 75.0, 0.5)
    assert found.wrong2_pct == pytest.approx(200 / 3) and found.wrong3_pct == pytest.approx(100 / 3)


def test_repair_without_holes_has_nothing_filled() -> None:
    truth, mask = square()
    found = scoring.score_repair(truth, truth, truth, mask)
    assert found.holes_pct == 0 and np.isnan(found.filled_pct) and found.shift_px == 0


def test_repair_refuses_other_shapes_and_an_empty_mask() -> None:
    truth, mask = square()
    with pytest.raises(ValueError, match="must be a mask"):
        scoring.score_repair(truth, truth, truth, mask[:-1])
    with pytest.raises(ValueError, match="no pixel"):
        scoring.score_repair(truth, truth, truth, np.zeros_like(mask))


@pytest.mark.parametrize("size", [1, 3, 9])
def test_dilation_lets_a_square_reach_half_the_kernel_over_its_border(size: int) -> None:
    truth, mask = square()
    assert scoring.overreach_px(truth, truth, mask) == 0
    assert scoring.overreach_px(filters.dilate(truth, size), truth, mask) == size // 2
    assert scoring.overreach_px(filters.close(truth, size), truth, mask) == 0


def test_a_hole_beside_the_border_is_no_overreach() -> None:
    truth, mask = square()
    assert scoring.overreach_px(np.where(mask, truth, np.nan), truth, mask) == 0


def test_overreach_skips_the_slanted_border_and_needs_a_step() -> None:
    truth, mask = square()
    for row in range(4):  # a roof that narrows by 5 px a row
        mask[9 - row, 15 : 30 - 5 * row] = True
    truth[mask] = 90.0
    assert scoring.overreach_px(filters.dilate(truth, 5), truth, mask) == 2
    with pytest.raises(ValueError, match="no row"):
        scoring.overreach_px(truth, truth, mask, step_px=61)


def test_scatter_is_what_the_errors_have_beside_their_mean():
    error = np.array([0.5, 1.5, -0.5, 3.0, 40.0, np.nan])  # the last two are not within 4 px
    quality = scoring.score(20 + error, np.full(6, 20.0))
    assert quality.scatter_px == pytest.approx(np.std(error[:4])) and quality.bias_px == pytest.approx(1.125)


def test_a_border_that_goes_to_and_fro_is_not_upright():
    on, truth = np.zeros((20, 120), bool), np.full((20, 120), 10.0)
    for row in range(20):
        on[row, : (60, 90)[row % 2]] = True
    truth[on] = 60.0
    with pytest.raises(ValueError, match="no row where the object stands"):
        scoring.overreach_px(truth, truth, on)
