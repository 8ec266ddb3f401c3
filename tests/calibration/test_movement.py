"""Movements that are named must have happened: none of a rig that stands as it was calibrated."""

from __future__ import annotations

import numpy as np
import pytest
from support.corners import corner_set, draw_rig
from support.knocks import calibrated, knocked

from stereolib.calibration import check_calibration
from stereolib.calibration.movement import estimate_movement
from stereolib.paper import paper_rig


@pytest.mark.slow
def test_an_unmoved_rig_is_still_good():
    """At least 38 of 40 draws, each with a rig, a calibration and boards of its own, one or three; nothing is named."""
    good, quiet, scores = 0, 0, []
    for k in range(40):
        rng = np.random.default_rng([17, k])
        rig = draw_rig(rng)
        found, record, _ = calibrated(rig, rng, pairs=15)
        result = check_calibration(found, corner_set(rng, rig=rig, pairs=1 + 2 * (k % 2)), record=record)
        good += result.verdict == "still good"
        quiet += not result.movement.named
        scores.append([e.value / e.std for e in (result.square_pct, result.board_pct, result.row_offset_px)])
    assert good >= 38 and quiet >= 38
    assert 0.6 < np.sqrt(np.mean(np.square(scores))) < 1.5  # the stated deviations are those that happen


def test_what_two_knocks_did_is_told_apart():
    """A tilt and a turn about the vertical axis at once, seen by four pairs; values within their deviations."""
    rng = np.random.default_rng(1)
    rig, record, _ = calibrated(paper_rig(), rng)
    found = estimate_movement(corner_set(rng, rig=knocked(paper_rig(), (0.2, -0.3, 0)), pairs=4), rig, record)
    assert {one.what for one in found.named} == {"tilt", "yaw"}
    for one, true in zip(sorted(found.named), np.radians([0.2, -0.3]), strict=True):
        assert one.value == pytest.approx(true, abs=4 * one.std + 1e-5)
    off = found.values - [*np.radians([0.2, -0.3, 0]), 0, 0, 0, 0, 0]
    assert (np.abs(off) < 4 * found.std).all()
