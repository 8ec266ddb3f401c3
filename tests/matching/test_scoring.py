"""Scores of disparity maps against numbers made by hand."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from stereolib.matching import sweeps

NAN = np.nan


def test_score_by_hand():
    truth = np.array([[10.0, 10, 10, 10, 10], [10, 10, 10, 10, NAN]])
    found = np.array([[10.5, 8.5, 13, 15, NAN], [10, 10, 9.5, 11, 50]])
    where = np.ones((2, 5), bool)
    where[1, 3] = False
    # errors looked at: .5 -1.5 3 5 nan 0 0 -.5
    result = sweeps.score(found, truth, where)
    assert (result.bad1_pct, result.bad2_pct, result.bad4_pct) == (50, 37.5, 25)
    assert result.density_pct == 87.5
    assert result.bias_px == pytest.approx(1.5 / 6)
    assert result.rms_px == pytest.approx(np.sqrt((0.25 + 2.25 + 9 + 0.25) / 6))
    assert sweeps.score(found, truth).density_pct == pytest.approx(100 * 8 / 9)  # and the pixel left out counts
    assert sweeps.score(found, truth).bad1_pct == pytest.approx(100 * 4 / 9)


def test_limits_are_not_bad():
    truth = np.zeros((1, 3))
    result = sweeps.score(np.array([[1.0, 2.0, 4.0]]), truth)
    assert (result.bad1_pct, result.bad2_pct, result.bad4_pct) == pytest.approx((200 / 3, 100 / 3, 0))


def test_nothing_returned():
    result = sweeps.score(np.full((2, 2), NAN), np.ones((2, 2)))
    assert (result.bad4_pct, result.density_pct) == (100, 0)
    assert np.isnan([result.bias_px, result.rms_px]).all()


def test_score_refuses():
    with pytest.raises(ValueError, match=r"one shape, got \[\(2, 2\), \(2, 3\)\]"):
        sweeps.score(np.ones((2, 2)), np.ones((2, 3)))
    with pytest.raises(ValueError, match=r"mask \(2, 2\) of bool, got \(3, 3\) of bool"):
        sweeps.score(np.ones((2, 2)), np.ones((2, 2)), np.ones((3, 3), bool))
    with pytest.raises(ValueError, match="no pixel with a known truth"):
        sweeps.score(np.ones((2, 2)), np.full((2, 2), NAN))
    with pytest.raises(ValueError, match="no pixel with a known truth"):
        sweeps.score(np.ones((2, 2)), np.ones((2, 2)), np.zeros((2, 2), bool))


def test_repair_by_hand():
    truth = np.full((1, 8), 20.0)
    before = np.array([[20, 21, 30, NAN, NAN, NAN, NAN, 20]])
    after = np.array([[21, 21, 30, 20, 22.5, 25, NAN, 99]])
    where = np.array([[True] * 7 + [False]])
    result = sweeps.repair(before, after, truth, where)
    assert result.holes_pct == pytest.approx(400 / 7)
    assert result.filled_pct == 75
    assert result.wrong2_pct == pytest.approx(200 / 3)
    assert result.wrong3_pct == pytest.approx(100 / 3)
    assert result.shift_px == pytest.approx(0.5)  # of the two that were right
    whole = sweeps.repair(after[:, :2], after[:, :2], truth[:, :2], where[:, :2])
    assert (whole.holes_pct, whole.shift_px) == (0, 0)
    assert np.isnan([whole.filled_pct, whole.wrong2_pct]).all()


def test_repair_refuses():
    one = np.ones((2, 2))
    with pytest.raises(ValueError, match="must have one shape"):
        sweeps.repair(one, one[:, :1], one, np.ones((2, 2), bool))
    with pytest.raises(ValueError, match=r"mask \(2, 2\) of bool, got \(2, 3\)"):
        sweeps.repair(one, one, one, np.ones((2, 3), bool))
    with pytest.raises(ValueError, match="no pixel with a known truth"):
        sweeps.repair(one, one, one, np.zeros((2, 2), bool))


@pytest.mark.parametrize("mask", [np.array([[0, 255], [255, 0]], np.uint8), np.eye(2, dtype=int), [[0, 1], [1, 0]],
                                  np.eye(2)])  # fmt: skip
def test_a_mask_is_bool(mask):
    """Numbers would be looked up as indices or multiplied with the mask of what is known, and score nonsense."""
    one, picture = np.ones((2, 2)), np.ones((2, 2), np.uint8)
    calls = (lambda: sweeps.score(one, one, mask), lambda: sweeps.repair(one, one, one, mask),
             lambda: sweeps.overreach_px(one, one, mask), lambda: sweeps.fattening_px(one, one, mask),
             lambda: sweeps.near_edge(one, mask), lambda: sweeps.correlation_length_px(picture, mask))  # fmt: skip
    for call in calls:
        with pytest.raises(ValueError, match=r"must be a mask \(2, 2\) of bool, got \(2, 2\) of (uint8|int64|float64)"):
            call()
    flags = [[False, True], [True, False]]  # a list of bools is one
    assert sweeps.score(one, one, flags).density_pct == 100


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
    assert sweeps.overreach_px(found, truth, on_object) == grown


def test_overreach_looks_only_at_clear_borders():
    truth, on_object = scene_with_a_border()
    truth[5:10, 20:] = 75  # the floor beside its foot
    found = truth.copy()
    found[10:15, 20:24] = 80
    assert sweeps.overreach_px(found, truth, on_object) == 4
    with pytest.raises(ValueError, match="no row where the object stands 100 px before"):
        sweeps.overreach_px(found, truth, on_object, step_px=100)


def test_near_edge_follows_the_nearest_column():
    truth, on_object = np.full((6, 30), NAN), np.zeros((6, 30), bool)
    on_object[2:5, 4:26] = True
    for v in range(2, 5):
        truth[v, 4:26] = 60 - np.abs(np.arange(4, 26) - (14 + v))
    edge = sweeps.near_edge(truth, on_object, half_width_px=2)
    for v in range(6):
        expected = [14 + v + d for d in (-2, -1, 0, 1, 2)] if 2 <= v < 5 else []
        assert np.flatnonzero(edge[v]).tolist() == expected


def test_smallest_window_reaches_just_over_the_disparity():
    rng = np.random.default_rng(0)
    wide = cv2.GaussianBlur(rng.integers(0, 256, (60, 260), dtype=np.uint8), (0, 0), 0.8)
    left, right = wide[:, :220].copy(), wide[:, 40:].copy()
    truth, where = np.full((60, 220), 40.0), np.zeros((60, 220), bool)
    where[:, 90:] = True
    assert sweeps.smallest_window(left, right, truth, where, widest=96) == 48
    with pytest.raises(ValueError, match="even 32 disparities leave more than 5 % bad pixels"):
        sweeps.smallest_window(left, right, truth, where, widest=32)


@pytest.mark.parametrize("sigma", [1.5, 3.0, 6.0])
def test_correlation_length_of_blurred_noise(sigma):
    """Noise blurred by s has the correlation exp(-x^2 / 4 s^2): it falls to 1/e at 2 s."""
    rng = np.random.default_rng(1)
    noise = cv2.GaussianBlur(rng.normal(size=(400, 400)), (0, 0), sigma)
    image = np.clip(128 + 40 * noise / noise.std(), 0, 255).astype(np.uint8)
    where = np.zeros(image.shape, bool)
    where[50:350, 60:330] = True
    assert sweeps.correlation_length_px(image, where) == pytest.approx(2 * sigma, rel=0.1)
    image[~where] = 255  # what lies outside does not count
    assert sweeps.correlation_length_px(image, where) == pytest.approx(2 * sigma, rel=0.1)


def test_correlation_length_refuses():
    with pytest.raises(ValueError, match="no texture to measure"):
        sweeps.correlation_length_px(np.full((9, 9), 7, np.uint8), np.ones((9, 9), bool))
    with pytest.raises(ValueError, match="no texture to measure"):
        sweeps.correlation_length_px(np.eye(9).astype(np.uint8), np.zeros((9, 9), bool))


def test_errors_of_all_returned_pixels_and_the_swing_by_hand():
    truth = np.array([[10.0, 10.25, 10.5, 10.75, 10.0]])
    found = truth + np.array([0.0, 0.1, 0.0, -0.1, 12.0])  # drawn towards 10.5
    result = sweeps.score(found, truth)
    assert result.mean_all_px == pytest.approx(12.2 / 5)
    assert result.rms_all_px == pytest.approx(np.sqrt((0.02 + 144) / 5))
    assert result.locking_px == pytest.approx(0.1)  # 2/4 |0.1 i + (-0.1)(-i)|
    assert sweeps.score(truth + 0.3, truth).locking_px == pytest.approx(0.3 * 2 / 5)


def test_matches_that_keep_to_whole_pixels_swing_as_known():
    """Rounding to whole pixels errs by a sawtooth, whose first harmonic is 1 / pi."""
    truth = np.linspace(20, 40, 20001)[None, :-1]
    assert sweeps.score(np.rint(truth), truth).locking_px == pytest.approx(1 / np.pi, rel=1e-3)
    assert sweeps.score(truth + 0.2, truth).locking_px == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("grown", [0, 1, 5])
def test_fattening_is_the_width_of_the_rim(grown):
    truth, _ = scene_with_a_border()
    visible = np.ones(truth.shape, bool)
    visible[5:15, :10] = False  # hidden from the right camera
    found = truth.copy()
    found[5:15, 20 : 20 + grown] = 80
    found[5:15, 19] = 30  # a rim that is too narrow is another error
    assert sweeps.fattening_px(found, truth, visible) == pytest.approx(grown)
    assert np.isnan(sweeps.fattening_px(found, np.full(truth.shape, 30.0), visible))
    found[5:15, 20:] = NAN  # nor are holes fattening
    assert sweeps.fattening_px(found, truth, visible) == 0
