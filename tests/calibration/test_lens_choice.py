"""The lens that took the pictures is the one that hold-out chooses."""

from __future__ import annotations

import numpy as np
import pytest
from support.corners import corner_set, draw_rig

from stereolib.calibration import HoldOut, calibrate_stereo, choose_lens_model, hold_out_errors, hold_out_splits
from stereolib.calibration.lens_choice import left_out_errors, left_out_rms_px, lengthened, neighbour_fits
from stereolib.rig import Camera, StereoRig


@pytest.fixture(scope="module")
def brown():
    return corner_set(np.random.default_rng(21), rig=draw_rig(np.random.default_rng(20)))


@pytest.mark.slow
def test_more_coefficients_fit_better_and_predict_no_better(brown):
    results = hold_out_errors(brown, ["pinhole", "brown3", "rational8", "thin_prism12"])
    train = [r.train_rms_px for r in results]
    assert all(np.diff(train) < 1e-6)  # nested lenses: never worse on what they were fitted to
    assert choose_lens_model(results) == "brown3"
    by = {r.model: r for r in results}
    assert by["pinhole"].hold_out_rms_px > 3 * by["brown3"].hold_out_rms_px
    assert by["brown3"].hold_out_rms_px == pytest.approx(0.034 * np.sqrt(2), rel=0.1)  # the noise put in


def test_splits_are_counted_in_whole_numbers():
    for pairs, count in ((10.5, 2), (10, 2.0)):
        with pytest.raises(ValueError, match="pairs and parts are counted in whole numbers"):
            hold_out_splits(pairs, count)


def test_fourteen_coefficients_overfit_few_pairs(brown):
    results = {r.model: r for r in hold_out_errors(brown, ["brown3", "tilted14"], hold_out_splits(30, 5, few=True))}
    assert results["tilted14"].train_rms_px < results["brown3"].train_rms_px
    assert results["tilted14"].hold_out_rms_px > 1.02 * results["brown3"].hold_out_rms_px


def test_a_lens_that_needs_more_gets_more():
    rig = draw_rig(np.random.default_rng(20))
    prism = np.array([0.05, -0.1, 1e-3, -1e-3, 0, 0, 0, 0, 0.02, -0.01, -0.02, 0.01])
    left, right = (Camera(c.K, prism, c.size) for c in (rig.left, rig.right))
    views = corner_set(np.random.default_rng(22), rig=StereoRig(left, right, rig.R, rig.T))
    assert (
        choose_lens_model(
            hold_out_errors(views, ["pinhole", "brown3", "rational8", "thin_prism12"], hold_out_splits(30, 3))
        )
        == "thin_prism12"
    )


def test_left_out_without_a_refit_is_what_refits_find(brown):
    """One fit and its linearisation against twelve fits."""
    some = brown.only(range(12))
    slow = hold_out_errors(some, ["brown3"], hold_out_splits(12, 12))[0]
    assert left_out_rms_px(calibrate_stereo(some).fit) == pytest.approx(slow.hold_out_rms_px, rel=2e-3)


def test_neighbours_reach_the_lens_that_took_the_pictures(brown):
    for model, asked in (("pinhole", ["pinhole", "brown2", "brown3"]), ("rational8", ["brown3", "rational8"])):
        results = left_out_errors(neighbour_fits(brown, calibrate_stereo(brown, model=model).fit, model))
        assert [r.model for r in results][: len(asked)] == asked
        assert choose_lens_model(results) in ("brown2", "brown3")  # this rig's k3 is hardly above its deviation


def test_folds_share_out_every_pair_once():
    for splits, left_out in ((hold_out_splits(11, 4), 1), (hold_out_splits(11, 3, few=True), 2)):
        counts = np.zeros(11, int)
        for train, test in splits:
            assert not set(train) & set(test)
            assert len(train) + len(test) == 11
            counts[test] += 1
        assert (counts == left_out).all()
    with pytest.raises(ValueError, match="5 pairs cannot be split into 3 parts of at least three"):
        hold_out_splits(5, 3, few=True)


def test_ties_go_to_the_shorter_lens():
    results = [HoldOut("a", 5, 0.1, 0.101), HoldOut("b", 8, 0.09, 0.1), HoldOut("c", 0, 0.2, 0.2)]
    assert choose_lens_model(results) == "a"


def test_a_lens_is_not_shortened():
    with pytest.raises(ValueError, match="a lens of 5 coefficients cannot be shortened to 0"):
        lengthened(draw_rig(np.random.default_rng(0)), 0)
