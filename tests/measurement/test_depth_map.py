"""Depth in millimetres: its formula, its deviation against draws, its points against the camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.corners import corner_set
from support.instruments import RECT

from stereolib.calibration import fit_rig, rig_covariance
from stereolib.matching import CheckedMatch, DisparityEstimate
from stereolib.measurement import DepthMap, Instrument, SystematicUncertainty, measure_depth, whole_mm
from stereolib.paper import paper_rig
from stereolib.virtual import recordings

KNOWN = SystematicUncertainty(4.0, 0.5, 0.3, (0.5, -0.4, 0.2))
SHAPE = RECT.size[::-1]


def depth_map(*, filled: bool = False, std_px: float | None = 0.2) -> DepthMap:
    """Disparities that grow with the row; the upper half was filled, the first column is unknown."""
    disparity_px = np.tile(np.linspace(2, 100, SHAPE[0], dtype=np.float32)[:, None], (1, SHAPE[1]))
    disparity_px[:, 0] = np.nan
    matched = np.isfinite(disparity_px)
    matched[: SHAPE[0] // 2] = False
    std = None if std_px is None else np.full(SHAPE, std_px, np.float32)
    left = np.arange(np.prod(SHAPE) * 3, dtype=np.uint64).astype(np.uint8).reshape(*SHAPE, 3)
    match = CheckedMatch(DisparityEstimate(disparity_px, matched, std), ())
    return DepthMap(match, left, Instrument(RECT, uncertainty=KNOWN), filled)


def test_depth_is_that_of_what_was_matched_unless_guesses_are_asked_for():
    found, filled = depth_map(), depth_map(filled=True)
    disparity_px = found.match.estimate.disparity_px
    np.testing.assert_array_equal(np.isfinite(found.depth_mm), found.match.estimate.matched)
    np.testing.assert_array_equal(np.isfinite(filled.depth_mm), np.isfinite(disparity_px))
    np.testing.assert_allclose((filled.depth_mm * disparity_px)[:, 1:], RECT.f_px * RECT.baseline_mm, rtol=1e-6)
    assert found.depth_mm.dtype == np.float32
    shares = found.match.shares
    assert list(shares) == ["matched", "filled", "refused"] and sum(shares.values()) == pytest.approx(1)
    assert shares["refused"] == pytest.approx(1 / SHAPE[1])


def test_its_deviation_is_that_of_draws():
    found, rng = depth_map(), np.random.default_rng(3)
    f, B, offset = rng.multivariate_normal([RECT.f_px, RECT.baseline_mm, 0], KNOWN.covariance, 100_000).T
    for row in (SHAPE[0] // 2, SHAPE[0] - 1):
        d = found.match.estimate.disparity_px[row, 1] + 0.2 * rng.standard_normal(f.size)
        assert found.std_mm[row, 1] == pytest.approx(np.std(f * B / (d - offset)), rel=0.02)
    assert depth_map(std_px=None).std_mm is None


def test_points_lie_on_the_rays_of_their_pixels_and_the_uncertain_are_left_out():
    found = depth_map(filled=True)
    points_mm, colors_rgb = found.points()
    pixels = RECT.left.project(points_mm)
    column, row = np.rint(pixels).astype(int).T
    np.testing.assert_allclose(pixels, np.column_stack([column, row]), atol=1e-3)
    np.testing.assert_array_equal(colors_rgb, found.left[row, column, ::-1])
    known = found.std_mm[row, column] / found.depth_mm[row, column]
    assert known.max() < 0.1 and len(points_mm) < np.isfinite(found.depth_mm).sum()
    assert len(depth_map(filled=True, std_px=None).points()[0]) == np.isfinite(found.depth_mm).sum()


def test_what_may_be_anywhere_has_no_depth():
    """A disparity that does not exceed its deviation, as of sky, is no 1e8 mm."""
    for filled in (False, True):
        unsure, sure = (depth_map(filled=filled, std_px=std_px) for std_px in (60.0, 0.2))
        disparity_px = unsure.match.estimate.disparity_px
        expected = np.isfinite(sure.depth_mm) & (disparity_px > 60.0)
        np.testing.assert_array_equal(np.isfinite(unsure.depth_mm), expected)
        np.testing.assert_array_equal(np.isfinite(unsure.std_mm), expected)
    far = replace(depth_map(std_px=0.2).match.estimate, disparity_px=np.full(SHAPE, 1e-4, np.float32))
    far.disparity_px[-1] = 50.0
    told = DepthMap(CheckedMatch(far, ()), depth_map().left, Instrument(RECT)).depth_mm
    assert np.nanmax(told) < 1e4


def test_sixteen_bits_end_at_65_m():
    assert whole_mm(np.array([65535.4, 65536.0, 0.4, np.nan, -5.0, -1e9])).tolist() == [65535, 0, 0, 0, 0, 0]


def test_a_pair_as_it_comes():
    pair = recordings.load_pair("conditions/texture")
    found, truth = measure_depth(*pair, Instrument(RECT), "fast"), recordings.load_truth("conditions/texture")
    assert not found.is_filled
    seen = truth.visible & np.isfinite(found.depth_mm) & (truth.box == 1)
    true_mm = RECT.f_px * RECT.baseline_mm / truth.disparity_px
    assert np.median(np.abs(found.depth_mm / true_mm - 1)[seen]) < 0.005
    with pytest.raises(ValueError, match="exchanged"):
        measure_depth(*pair[::-1], Instrument(RECT), "fast")


def test_what_a_calibration_leaves_open_is_told_where_the_pixel_is():
    """The errors of the corners of a picture, where boards hardly come, are many times those of its middle."""
    fit = fit_rig(corner_set(np.random.default_rng(5), rig=paper_rig(), noise_px=0.15), paper_rig())
    rectified, covariance = fit.rig.rectify(), rig_covariance(fit)
    known, plain = SystematicUncertainty.of(rectified, covariance), depth_map(filled=True, std_px=1e-6)
    found = replace(plain, instrument=Instrument(rectified, uncertainty=known))
    rows, columns = np.array([240, 60, 300, 470]), np.array([330, 400, 620, 600])
    d = found.match.estimate.disparity_px[rows, columns].astype(float)
    exact = np.linalg.norm(known.errors.of_points(columns.astype(float), rows.astype(float), d)[:, 2], axis=1)
    np.testing.assert_allclose(found.std_mm[rows, columns], exact, rtol=0.1)
    alike = replace(plain, instrument=Instrument(rectified, uncertainty=replace(known, errors=None)))
    assert found.std_mm[470, 600] > 2 * alike.std_mm[470, 600]


@pytest.mark.parametrize("pipeline", ["paper", "fast", "best"])
def test_pictures_that_show_nothing_have_no_depth(pipeline):
    blank = np.full((480, 640), 90, np.uint8)
    with pytest.raises(ValueError, match="nothing to match"):
        measure_depth(blank, blank, Instrument(recordings.rectified()), pipeline)


def test_rows_that_the_pipeline_corrects_may_be_off_by_more():
    left, right = recordings.load_pair("conditions/texture")
    lower, known = np.roll(right, 2, axis=0), Instrument(recordings.rectified())
    assert any("px too low, corrected" in note for note in measure_depth(left, lower, known).match.notes)
    with pytest.raises(ValueError, match="not rectified"):
        measure_depth(left, lower, known, "fast")
