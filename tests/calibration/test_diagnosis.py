"""Seventeen sets with one known fault each are named; good sets are called good."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.corners import corner_set, draw_rig
from support.faults import bad_sets

from stereolib.base import datasets
from stereolib.calibration import Checkerboard, boards_per_cell, bundle_adjustment, diagnose, find_in_pairs
from stereolib.calibration.coverage import judge_coverage
from stereolib.paper import paper_rig
from stereolib.rig import read_pair
from stereolib.virtual import recordings

FAULTS = list(bad_sets())


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_fault_is_named(fault):
    if fault.refused:
        with pytest.raises(ValueError) as caught:
            diagnose(fault.views, model=fault.model, ruler_mm=fault.ruler_mm)
        assert fault.says in str(caught.value)
        return
    found = diagnose(fault.views, model=fault.model, ruler_mm=fault.ruler_mm)
    assert any(fault.says in warning for warning in found.warnings)
    assert found.verdict != "good"
    assert set(found.pairs_refused) == set(fault.pairs)
    assert found.reasons


def fault(name):
    return next(fault for fault in FAULTS if fault.name == name)


def test_pairs_of_each_position_are_listed():
    found = diagnose(fault("two positions of the rig").views)
    assert found.verdict == "bad"
    assert [len(group) for group in found.groups] == [20, 10]
    assert found.groups[1] == tuple(f"pair {k}" for k in range(21, 31))
    assert "2.0 mm shifted and 0.49 degrees" in found.warnings[0]
    assert found.rig.baseline_mm == pytest.approx(paper_rig().baseline_mm, abs=0.1)  # of the larger group alone


def test_what_a_bad_pair_would_have_done():
    """Left in, three pairs whose boards moved spoil the baseline; refused, they do not."""
    bad = fault("three pairs whose boards moved")
    true = paper_rig().baseline_mm
    spoilt = bundle_adjustment.fit_rig(bad.views, paper_rig()).rig.baseline_mm
    assert abs(diagnose(bad.views).rig.baseline_mm - true) < 0.05 < abs(spoilt - true)


@pytest.mark.parametrize("seed", range(6))
def test_good_sets_are_good(seed):
    rng = np.random.default_rng([31, seed])
    rig = draw_rig(rng)
    found = diagnose(corner_set(rng, rig=rig), ruler_mm=round(rig.baseline_mm))
    assert (found.verdict, found.warnings, found.pairs_refused) == ("good", (), {})
    assert found.square_error_pct < 0.1
    assert abs(found.rig.baseline_mm - rig.baseline_mm) < 4 * found.std.baseline_mm
    assert found.pairs_used == found.groups[0]


@pytest.fixture(scope="module")
def recorded():
    pairs, names = recordings.load_boards()
    return diagnose(find_in_pairs(pairs, recordings.BOARD, names, progress=False), ruler_mm=93)


def test_recorded_boards_make_a_good_calibration(recorded):
    """The promises: baseline within 0.05 mm, squares of boards left out within 0.1 %."""
    assert recorded.verdict == "good"
    assert recorded.rig.baseline_mm == pytest.approx(paper_rig().baseline_mm, abs=0.05)
    assert recorded.square_error_pct < 0.1
    assert recorded.epipolar_rms_px < 0.1
    assert recorded.worst_pair_px >= recorded.epipolar_rms_px
    assert "right lens folds over in the lower right corner" in recorded.folds[0]  # as Table I's does


def test_residuals_are_found_minus_predicted(recorded):
    views, residuals = recorded.views, recorded.residuals_px
    assert residuals.shape == (2, len(views), 54, 2)
    np.testing.assert_allclose(np.sqrt((residuals**2).sum(axis=3).mean(axis=2)).T, recorded.pair_rms_px)
    assert recorded.rms_px == pytest.approx(np.sqrt((residuals**2).sum(axis=3).mean()))
    predicted = views.left_px[0] - residuals[0, 0]
    _, turn, shift = cv2.solvePnP(views.board.points_mm, predicted, recorded.rig.left.K, recorded.rig.left.dist)
    again = cv2.projectPoints(views.board.points_mm, turn, shift, recorded.rig.left.K, recorded.rig.left.dist)[0]
    np.testing.assert_allclose(again[:, 0], predicted, atol=0.01)  # the predicted corners are a board's, exactly


def test_real_webcams():
    """The promises: rms at most 0.262 px with all 30 pairs, squares of boards left out within 0.5 %."""
    try:
        left, right = (datasets.real_recordings(f"minoru3d/{side}") for side in ("left", "right"))
    except datasets.NotAvailable as error:
        pytest.skip(str(error))
    pairs = [read_pair(*files) for files in zip(left, right, strict=True)]
    views = find_in_pairs(pairs, Checkerboard(8, 6, 30.0), [file.name for file in left], progress=False)
    found = diagnose(views)
    assert len(found.views) == 30
    assert found.rms_px <= 0.262
    assert found.square_error_pct <= 0.5
    assert found.verdict == "usable"
    assert any("1.4 % higher than they are wide" in warning for warning in found.warnings)
    mended = diagnose(replace(views, board=Checkerboard(8, 6, 30.0, 1.0142)))
    assert mended.rms_px < 0.65 * found.rms_px
    assert mended.square_error_pct < 0.7 * found.square_error_pct


def test_a_lens_too_short_is_named_with_the_one_to_use(recorded):
    """Table I's lenses as pinholes: rms 0.12 px and every limit kept, yet the principal point is eleven sigma off."""
    short = diagnose(recorded.views, model="pinhole")
    assert short.verdict == "usable"
    assert all(check.level == 0 for check in short.checks)
    assert "use --model brown3" in short.reasons[0]
    assert abs(short.rig.right.K[1, 2] - paper_rig().right.K[1, 2]) > 10 * short.std.right_K[3]
    assert [lens.model for lens in short.lenses] == ["pinhole", "brown2", "brown3"]


def test_depths_are_judged_where_the_boards_stood(recorded):
    """A larger board is the same set farther away; in per cent nothing changes."""
    large = diagnose(replace(recorded.views, board=replace(recordings.BOARD, square_mm=250.0)))
    assert (large.verdict, large.error_map.at_mm) == ("good", pytest.approx(10 * recorded.error_map.at_mm, rel=0.1))
    assert large.checks[-1].value == pytest.approx(recorded.checks[-1].value, rel=0.1)
    beyond = diagnose(recorded.views, at_mm=40)
    assert "at 40 mm the two views do not overlap" in beyond.reasons[0]


def test_limits_of_pixels_grow_with_the_image():
    noisy = corner_set(np.random.default_rng(3), noise_px=0.5)
    assert "corners fit to 0.69" in diagnose(noisy).reasons[0]
    twice = replace(noisy, size=(1280, 960), left_px=2 * noisy.left_px, right_px=2 * noisy.right_px)
    assert diagnose(twice).checks[0].level == diagnose(noisy).checks[0].level == 1


def turned(views):
    """Both pictures a quarter to the right."""
    (width, height), sides = views.size, (views.left_px, views.right_px)
    left, right = (np.stack([height - 1 - at[..., 1], at[..., 0]], axis=-1) for at in sides)
    return replace(views, size=(height, width), left_px=left, right_px=right)


def test_cameras_above_each_other_are_said_to_be():
    good = corner_set(np.random.default_rng(4), pairs=12)
    found = diagnose(turned(good))
    assert found.verdict == "bad"
    assert "cannot be rectified" in found.reasons[0] and "turn all pictures by a quarter" in found.reasons[0]
    with pytest.raises(ValueError, match="or both cameras hang upside down"):
        diagnose(turned(turned(good)))


def test_one_folder_twice_is_said():
    good = corner_set(np.random.default_rng(4), pairs=12)
    with pytest.raises(ValueError, match="left and right are the same pictures"):
        diagnose(replace(good, right_px=good.left_px))


@pytest.mark.parametrize("square_mm", [0.025, 2500.0])
def test_units_that_cannot_be_millimetres_are_asked_about(square_mm):
    good = corner_set(np.random.default_rng(4))
    found = diagnose(replace(good, board=replace(good.board, square_mm=square_mm)))
    assert found.verdict == "good"
    assert "given in millimetres?" in found.warnings[0]


@pytest.mark.parametrize("ruler", [0.0, -93.0, float("nan")])
def test_refuses_a_senseless_ruler(ruler):
    with pytest.raises(ValueError, match="ruler's reading must be a positive number"):
        diagnose(fault("too few pairs").views, ruler_mm=ruler)


def test_coverage_counts_boards_over_cells():
    square = np.array([[[100, 100], [300, 100], [300, 200], [100, 200]]], float)
    count = boards_per_cell(np.concatenate([square, square]), (640, 480))
    assert count.shape == (24, 32)
    assert set(np.unique(count)) == {0, 2}
    assert (count > 0).sum() * 400 == pytest.approx(200 * 100, rel=0.02)
    assert count[7, 10] == 2 and count[2, 2] == 0


def test_coverage_names_a_third_that_one_camera_never_saw():
    wide = corner_set(np.random.default_rng(0), pairs=60)
    some = wide.only(np.flatnonzero(wide.right_px[..., 0].max(axis=1) < 424).tolist())
    fitted = bundle_adjustment.fit_rig(some, paper_rig())
    found = judge_coverage(some, fitted.turns, fitted.shifts)
    assert found.missing == ("no views in the right third of the right image",)
    assert str(found).endswith(found.missing[0])


def test_coverage_of_a_wide_set_is_high():
    rng = np.random.default_rng(0)
    rig = draw_rig(rng)
    fitted = bundle_adjustment.fit_rig(views := corner_set(rng, rig=rig), rig)
    found = judge_coverage(views, fitted.turns, fitted.shifts)
    assert found.missing == ()
    assert found.distance == found.tilt == 1.0
    assert 0.7 < found.score <= 1
