"""Single wrong corners: named with picture and place, left out, and nothing else with them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.corners import corner_set, draw_rig

from stereolib.calibration import calibrate_stereo, diagnose
from stereolib.calibration.wrong_corners import without_wrong_corners


def drawn(seed: int, pairs: int = 15):
    rng = np.random.default_rng([77, seed])
    rig = draw_rig(rng)
    return corner_set(rng, rig=rig, pairs=pairs), rig


@pytest.mark.parametrize("off_px", [1.0, 3.0, 10.0])
def test_wrong_corners_are_named_and_left_out(off_px):
    views, _ = drawn(0)
    right = views.right_px.copy()
    right[4, 17] += [off_px, 0]
    right[9, 0] += [0, -off_px]
    cleaned, wrong = without_wrong_corners(replace(views, right_px=right))
    assert {w[:4] for w in wrong} == {("pair 05", "right", 9, 2), ("pair 10", "right", 1, 1)}
    for corner in wrong:
        assert corner.off_px == pytest.approx(off_px, abs=0.3)
    assert str(wrong[0]).startswith(wrong[0].pair + " right (column ")
    assert np.isnan(cleaned.right_px[..., 0]).sum() == 2
    np.testing.assert_array_equal(cleaned.left_px, views.left_px)


def test_the_rig_is_as_if_they_had_been_right():
    views, rig = drawn(1)
    left = views.left_px.copy()
    left[[2, 7, 11], [0, 8, 53]] += [[-8, 5], [6, 6], [0, 9]]
    cleaned, wrong = without_wrong_corners(replace(views, left_px=left))
    assert len(wrong) == 3
    clean, mended = (calibrate_stereo(v).rig for v in (views, cleaned))
    assert mended.baseline_mm == pytest.approx(clean.baseline_mm, abs=0.02)
    np.testing.assert_allclose(mended.left.K, clean.left.K, atol=0.2)
    assert abs(calibrate_stereo(replace(views, left_px=left)).rig.left.K - rig.left.K).max() > 1.0


@pytest.mark.parametrize("seed", range(4))
def test_honest_corners_stay(seed):
    views, _ = drawn(seed, pairs=8)
    cleaned, wrong = without_wrong_corners(views)
    assert wrong == ()
    np.testing.assert_array_equal(cleaned.right_px, views.right_px)


def test_a_view_that_is_wrong_as_a_whole_is_left_to_others():
    views, _ = drawn(2)
    left = views.left_px.copy().reshape(len(views), 6, 9, 2)
    left[3, 2] = left[3, 3]
    cleaned, _ = without_wrong_corners(replace(views, left_px=left.reshape(views.left_px.shape)))
    assert np.isfinite(cleaned.left_px[3]).mean() > 0.8


def test_a_diagnosis_names_them_and_stands_on_the_others():
    views, _ = drawn(3)
    right = views.right_px.copy()
    right[4, 17] += [4.0, 0]
    found, clean = diagnose(replace(views, right_px=right)), diagnose(views)
    (wrong,) = found.wrong_corners
    assert (wrong.pair, wrong.side, wrong.column, wrong.row) == ("pair 05", "right", 9, 2)
    assert any(
        "1 corner left out, off by up to" in text and "pair 05 right (column 9, row 2" in text
        for text in found.warnings
    )
    assert found.pairs_used == clean.pairs_used and found.rms_px == pytest.approx(clean.rms_px, rel=0.02)
    worst = found.worst_corners
    assert worst[0] == wrong
    assert [c.off_px for c in worst[1:]] == sorted((c.off_px for c in worst[1:]), reverse=True)
    assert worst[1].off_px < 0.3
