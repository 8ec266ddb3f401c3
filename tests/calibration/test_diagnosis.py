"""Good sets are called good, and what a diagnosis says of them is so."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.corners import corner_set, draw_rig

from stereolib.calibration import Charuco, Checkerboard, diagnose, findings, triangulate
from stereolib.paper import paper_rig
from stereolib.rig import StereoRig
from stereolib.virtual import recordings


@pytest.mark.parametrize("seed", range(6))
def test_good_sets_are_good(seed):
    rng = np.random.default_rng([31, seed])
    rig = draw_rig(rng)
    found = diagnose(corner_set(rng, rig=rig), ruler_mm=round(rig.baseline_mm))
    assert (found.verdict, found.warnings, found.advice, found.pairs_refused) == ("good", (), (), {})
    assert found.square_error_pct < 0.1
    assert abs(found.rig.baseline_mm - rig.baseline_mm) < 4 * found.std.baseline_mm
    assert found.pairs_used == found.groups[0]


@pytest.fixture(scope="module")
def recorded(recorded_views):
    return diagnose(recorded_views, ruler_mm=93)


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


def test_a_lens_too_short_is_named_with_the_one_to_use(recorded):
    """Table I's lenses as pinholes: rms 0.12 px, yet the principal point is eleven sigma off. That is in the errors."""
    short = diagnose(recorded.views, model="pinhole")
    assert "use --model brown3" in [*short.reasons, *short.advice][0]
    assert 0.2 < short.lens_error_pct <= max(short.depth_pct, short.length_pct)
    points = np.array([[x, y, 1000.0] for x in (-200.0, 0.0, 200.0) for y in (-100.0, 100.0)])
    true = paper_rig()
    seen = triangulate(short.rig, true.left.project(points), true.right.project(points @ true.R.T + true.T))
    assert np.median(np.abs(seen - points)[:, 2]) < 3 * short.depth_mm  # which is far above what the corners leave open
    assert short.depth_mm > 3 * recorded.depth_mm
    assert abs(short.rig.right.K[1, 2] - paper_rig().right.K[1, 2]) > 10 * short.std.right_K[3]
    assert [lens.model for lens in short.lenses] == ["pinhole", "brown2", "brown3"]


def test_errors_are_judged_where_one_works(recorded):
    """A larger board is the same set farther away; in per cent nothing changes."""
    views, ruler_mm = replace(recorded.views, board=replace(recordings.BOARD, square_mm=250.0)), 930.0
    large = diagnose(views, at_mm=10000, ruler_mm=ruler_mm)
    assert (large.verdict, recorded.error_map.at_mm) == ("good", 1000)
    assert large.depth_pct == pytest.approx(recorded.depth_pct, rel=0.1)
    beyond = diagnose(recorded.views, at_mm=40)
    assert beyond.verdict == "bad" and "at 40 mm the two views do not overlap" in beyond.reasons[0]
    far = diagnose(recorded.views, at_mm=40_000)
    assert far.verdict != "good" and "lengths at 40000 mm are sure to" in far.reasons[0]


def test_what_is_no_error_of_sizes_is_advice_and_its_limits_grow_with_the_image():
    noisy = corner_set(np.random.default_rng(3), noise_px=0.5)
    found = diagnose(noisy)
    assert found.verdict == "good" and any("corners fit to 0.69" in text for text in found.advice)
    twice = replace(noisy, size=(1280, 960), left_px=2 * noisy.left_px, right_px=2 * noisy.right_px)
    levels = [{c.name: c.level for c in diagnose(views).checks}["corners fit to"] for views in (noisy, twice)]
    assert levels == [1, 1]


@pytest.mark.parametrize(("error_pct", "verdict"), [(0.4, "good"), (0.6, "usable"), (2.1, "bad")])
def test_verdict_follows_the_error(recorded, error_pct, verdict):
    errors = replace(recorded.error_map, depth_mm=np.full_like(recorded.error_map.depth_mm, 10 * error_pct))
    changed = replace(recorded, error_map=errors)
    changed = replace(changed, checks=findings.checks_of(changed))
    found = findings.with_verdict(changed, findings.check_findings(changed))
    assert found.verdict == verdict and len(found.reasons) == (verdict != "good")


def test_a_fit_that_did_not_settle_is_said(recorded):
    away = replace(recorded.fit, gradient=recorded.fit.gradient + 1e6)
    said = findings._settling_findings(replace(recorded, fit=away))
    assert "did not settle" in said[0].text and not findings._settling_findings(recorded)


def turned(views):
    """Both pictures a quarter to the right."""
    (width, height), sides = views.size, (views.left_px, views.right_px)
    left, right = (np.stack([height - 1 - at[..., 1], at[..., 0]], axis=-1) for at in sides)
    return replace(views, size=(height, width), left_px=left, right_px=right)


@pytest.mark.parametrize("at_mm", [1.0, 0.0, np.nan])
def test_refuses_a_distance_in_metres(at_mm):
    with pytest.raises(
        ValueError, match=r"the distance to judge depths at (was given as 1, but mill|must be a positive)"
    ):
        diagnose(corner_set(np.random.default_rng(4), pairs=3), at_mm=at_mm)


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


@pytest.mark.parametrize("square_mm", [2.5, 250.0])
def test_squares_that_no_pair_of_webcams_has_are_bad_unless_a_ruler_says_so(square_mm):
    good = corner_set(np.random.default_rng(4))
    views = replace(good, board=replace(good.board, square_mm=square_mm))
    found = diagnose(views, at_mm=40 * square_mm)
    assert found.verdict == "bad" and len(found.reasons) == 1
    assert f"squares of {square_mm:g} mm make the lenses stand" in found.reasons[0] and "ruler" in found.reasons[0]
    # the limits lie far from where webcams stand
    assert "make the lenses stand" not in " ".join(diagnose(good, at_mm=1000).warnings)
    known = diagnose(views, at_mm=40 * square_mm, ruler_mm=found.rig.baseline_mm)
    assert known.verdict == "good" and not known.reasons
    assert any("given in millimetres?" in text for text in known.advice) == (square_mm < 5)


def test_metres_are_refused():
    for board in (lambda: Checkerboard(9, 6, 0.025), lambda: Charuco(9, 6, 0.025, 0.018)):
        with pytest.raises(ValueError, match=r"millimetres are expected: for 0\.025 m that is 25"):
            board()


def test_cameras_that_see_nothing_in_common_where_rigs_measure():
    """Turned in by 30 degrees each, axes that meet nearer than rigs are asked to measure: no error of nobody's."""
    rng = np.random.default_rng([5, 0])
    rig, half = draw_rig(rng), cv2.Rodrigues(np.array([0.0, np.radians(30), 0.0]))[0]
    apart = np.array([1300 * np.tan(np.radians(30)), 0.0, 0.0])
    found = diagnose(
        corner_set(rng, rig=StereoRig(rig.left, rig.right, rig.R @ half @ half, -rig.R @ half @ apart), pairs=15)
    )
    assert found.rectified_std == {} and found.verdict == "bad"
    assert "no direction that both pictures show" in found.reasons[0]


@pytest.mark.parametrize("ruler", [0.0, -93.0, float("nan")])
def test_refuses_a_senseless_ruler(ruler):
    with pytest.raises(ValueError, match="ruler's reading must be a positive number"):
        diagnose(corner_set(np.random.default_rng(4), pairs=3), ruler_mm=ruler)
