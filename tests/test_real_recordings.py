"""Recordings made by others, through the same functions. Without them and without a network: skipped."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from skimage.data import stereo_motorcycle

from stereolib import laser
from stereolib.base import datasets
from stereolib.calibration import (
    BoardViews,
    Checkerboard,
    calibrate_stereo,
    diagnose,
    epipolar_errors_px,
    rig_covariance,
)
from stereolib.matching import SGBMParams, compute_disparity, score
from stereolib.measurement import Instrument, SystematicUncertainty, moved_back
from stereolib.rig import read_pair


@pytest.fixture(scope="module")
def xv11_file() -> Path:
    try:
        return datasets.real_recording("xv11/hand_in_box.txt")
    except datasets.NotAvailable as error:
        pytest.skip(str(error))


def test_xv11_recording_holds_its_known_packets_and_turns(xv11_file: Path) -> None:
    facts = laser.recording_info(xv11_file)
    assert facts["packets"] == 11451
    assert facts["turns"] == 120


def test_xv11_walls_get_straighter_by_the_geometry_correction(xv11_file: Path) -> None:
    scans = [scan for scan in laser.turns(laser.read_recording(xv11_file)) if scan.complete]
    still, rms = laser.average(scans), {}
    for corrected in (False, True):
        points = laser.points_mm(still if corrected else replace(still, emitter_offset_mm=0.0))
        walls = laser.fit_walls(points, threshold_mm=6.0, rng=np.random.default_rng(0))
        residuals = np.concatenate([wall.residuals_mm[wall.inliers] for wall in walls])
        assert len(residuals) > 350
        rms[corrected] = np.sqrt((residuals**2).mean())
    assert rms[True] <= 1.85
    assert rms[True] < 0.8 * rms[False]


@pytest.mark.slow
def test_minoru_webcams_calibrate(minoru_views: BoardViews) -> None:
    found = calibrate_stereo(minoru_views)
    assert len(minoru_views) == 30
    assert found.rms_px <= 0.262
    assert found.rig.baseline_mm == pytest.approx(63.94, abs=0.3)
    assert np.sqrt((epipolar_errors_px(found.rig.rectify(), minoru_views) ** 2).mean()) < 0.2


@pytest.mark.slow
def test_minoru_webcams_are_usable_and_better_with_the_board_measured(minoru_views: BoardViews) -> None:
    """The promises: rms at most 0.262 px with all 30 pairs, squares of boards left out within 0.5 %."""
    found = diagnose(minoru_views)
    assert len(found.views) == 30
    assert found.rms_px <= 0.262
    assert found.square_error_pct <= 0.5
    assert found.verdict == "usable"
    assert any("1.4 % higher than they are wide" in warning for warning in found.warnings)
    mended = diagnose(replace(minoru_views, board=Checkerboard(8, 6, 30.0, 1.0142)))
    assert mended.rms_px < 0.65 * found.rms_px
    assert mended.square_error_pct < 0.7 * found.square_error_pct


def test_motorcycle_is_matched_as_well_as_plain_sgbm_can() -> None:
    left, right, truth = stereo_motorcycle()
    found = compute_disparity(left, right, SGBMParams(num_disparities=80), whole=True)
    quality = score(found, np.where(np.isfinite(truth), truth, np.nan))
    assert 12 < quality.bad2_pct < 15.5


@pytest.mark.slow
def test_minoru_webcams_are_not_taken_for_moved_by_a_calibration_from_other_pairs(minoru_views: BoardViews) -> None:
    """Their lenses obey the model less well than any deviation says, and rows drift apart by it."""
    files = [datasets.real_recordings(f"minoru3d/{side}") for side in ("left", "right")]
    pairs = {left.name: (left, right) for left, right in zip(*files, strict=True)}
    for first in (0, 1):
        found = calibrate_stereo(minoru_views.only(range(first, len(minoru_views), 2)))
        rectified = found.rig.rectify()
        known = Instrument(rectified, None, SystematicUncertainty.of(rectified, rig_covariance(found.fit)))
        for name in minoru_views.names[1 - first :: 6]:
            moves = moved_back(*read_pair(*pairs[name]), known).moves
            assert moves is not None and moves.chance == moves.rise_mm == 0 and moves.seen_px > 10
