"""Stated deviations of heights: against derivatives, and the scatter of other calibrations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.corners import corner_set
from support.ground import PARAMS, RECT, nearest_height, recorded, rng

from stereolib.calibration import fit_rig, rectified_std, rig_covariance
from stereolib.matching import compute_disparity
from stereolib.measurement import (
    AlignedPair,
    Floor,
    SystematicUncertainty,
    find_objects,
    fit_floor,
    floor_from_pose,
    measure_height,
)
from stereolib.virtual import recordings


def test_what_makes_up_the_deviation():
    """A baseline known to 1 % makes heights known to 1 %; a camera height known to 2 mm adds 2 mm."""
    left, right, disparity = recorded("conditions/level")
    pair = AlignedPair.of(left, right)
    floor = fit_floor(disparity, RECT, rng=rng(), pair=pair)
    (cube,) = find_objects(disparity, floor)
    how = SystematicUncertainty(baseline_mm=0.01 * RECT.baseline_mm)
    found = measure_height(pair, floor, cube, uncertainty=how)
    assert found.parts_mm["calibration"] == pytest.approx(3.0, rel=0.01)
    assert found.height_std_mm == pytest.approx(np.sqrt(sum(part**2 for part in found.parts_mm.values())))
    given = floor_from_pose(RECT, recordings.setup("level"), height_std_mm=2.0)
    posed = measure_height(pair, given, cube)
    assert posed.height_mm == pytest.approx(300, abs=1.5)
    assert posed.parts_mm["floor"] == pytest.approx(2.0, rel=0.02)  # what the camera is lower, the top is lower


def test_deviation_is_the_derivative():
    """The floor's share against a numerical derivative of the whole measurement."""
    left, right, disparity = recorded("conditions/level")
    pair = AlignedPair.of(left, right)
    floor = floor_from_pose(RECT, recordings.setup("level"), pitch_std_rad=0.001)
    (cube,) = find_objects(disparity, floor)
    stated = measure_height(pair, floor, cube).parts_mm["floor"]
    turned = []
    for sign in (-1, 1):
        pitch = float(sign * 0.001)
        K, axes = RECT.P1[:, :3], floor.axes
        down = np.cos(pitch) * floor.down + np.sin(pitch) * axes[0]
        plane = RECT.f_px * RECT.baseline_mm * np.linalg.inv(K).T @ down / floor.camera_height_mm
        turned.append(measure_height(pair, Floor(RECT, plane, np.zeros((3, 3))), cube).height_mm)
    assert stated == pytest.approx(abs(turned[1] - turned[0]) / 2, rel=0.15)


@pytest.mark.parametrize("name", ["texture", "level"])
def test_a_wrong_focal_length_moves_the_object_and_hardly_its_height(name):
    """Measured again with all depths 1 % longer, against the calibration's share for 1 %."""
    left, right, disparity = recorded(f"conditions/{name}")
    pair = AlignedPair.of(left, right)
    (cube,) = find_objects(disparity, fit_floor(disparity, RECT, rng=rng(), pair=pair))
    longer = np.array([[1.01, 1, 1, 1.01], [1, 1.01, 1, 1], [1, 1, 1, 1]])
    found = []
    for rectified in (RECT, replace(RECT, P1=RECT.P1 * longer, P2=RECT.P2 * longer)):
        floor = fit_floor(disparity, rectified, rng=rng(), pair=pair)
        how = SystematicUncertainty(f_px=0.01 * RECT.f_px)
        found.append(measure_height(pair, floor, cube, uncertainty=how))
    assert found[1].near_mm[0] / found[0].near_mm[0] == pytest.approx(1.01, abs=0.0015)
    stated = found[0].parts_mm["calibration"]
    assert stated == pytest.approx(
        3.0 * np.sin(fit_floor(disparity, RECT, rng=rng(), pair=pair).pitch_rad) ** 2, rel=0.1
    )
    assert abs(found[1].height_mm - found[0].height_mm) < stated + 0.15


def test_a_calibration_s_errors_are_those_of_other_calibrations():
    """The cube measured by eight rigs, each calibrated from other corners: the scatter is what one of them states."""
    left, right = recordings.load_pair("conditions/level")
    heights, stated = [], []
    for k in range(8):
        fitted = fit_rig(corner_set(np.random.default_rng([k, 5]), rig=RECT.rig), RECT.rig)
        rectified = fitted.rig.rectify(0.0)
        pair = rectified.rectify(left, right)
        how = SystematicUncertainty(**rectified_std(rectified, rig_covariance(fitted)))
        disparity = compute_disparity(*pair, PARAMS, whole=True)
        found = nearest_height(*pair, disparity, rectified, rng=rng(), uncertainty=how)
        heights.append(found.height_mm)
        stated.append(found.parts_mm["calibration"])
    assert np.std(heights, ddof=1) == pytest.approx(np.mean(stated), rel=0.7)
    assert 0.02 < np.mean(stated) < 0.1
