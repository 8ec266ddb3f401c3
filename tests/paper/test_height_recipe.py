"""The paper's height method on perfect disparity: where it works, where it breaks, and the cure."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest

from stereolib import paper
from stereolib.matching import SGBMParams, compute_disparity
from stereolib.paper import height_by_maximum, height_from_depth, height_of_top, paper_rig, published
from stereolib.virtual import recordings

CONSTANT, SCALE = published()["height.constant_rows"].value, published()["scale.cm_per_px"].value


def perfect_disparity(rectified, view, side=300.0, distance=700.0):
    """Disparity of cube and floor by meeting every pixel's ray with three planes, in the world's frame."""
    columns, rows = np.meshgrid(np.arange(640.0), np.arange(480.0))
    f, (cx, cy) = rectified.f_px, rectified.P1[:2, 2]
    c, s = np.cos(view.pitch_rad), np.sin(view.pitch_rad)
    right, down = (columns - cx) / f, (rows - cy) / f
    forward, up, h = c + s * down, s - c * down, view.camera_height_mm  # per unit of depth; y (left) is -right
    depth = np.where(up < 0, h / -np.minimum(up, -1e-12), np.inf)  # floor
    for sign in (1, -1):  # the two faces: (x - distance) = sign * y, met where 0 < sign * y < side / sqrt 2
        t = distance / (forward + sign * right)
        y, z = -right * t * sign, h + up * t
        hit = (t > 0) & (y >= 0) & (y <= side / sqrt(2)) & (z >= 0) & (z <= side)
        depth = np.where(hit, np.minimum(depth, t), depth)
    disparity = f * rectified.baseline_mm / depth
    return np.where(disparity > 5, disparity, np.nan)


@pytest.fixture(scope="module")
def rectified():
    return paper_rig().rectify(alpha=0)


@pytest.fixture(scope="module", params=["pitched", "level"])
def case(request, rectified):
    solve = {"pitched": paper.solve_pitch, "level": paper.solve_camera_height}[request.param]
    view = solve(rectified, paper.paper_setup())
    return request.param, view, perfect_disparity(rectified, view)


def test_twin_agrees_with_the_projected_edge(case):
    _, view, disparity = case
    column = round(view.column)
    assert disparity[425, column] == pytest.approx(view.disparity_foot_px, abs=0.2)
    assert disparity[int(view.top_row) + 1, column] == pytest.approx(view.disparity_top_px, abs=0.2)
    assert not disparity[int(view.top_row) - 1, column] > 5


def test_recipe_reads_a_quarter_too_much_from_perfect_disparity(case):
    """facts: 37.7 cm, +26 %."""
    name, _, disparity = case
    result = height_by_maximum(disparity, SCALE, CONSTANT, tolerance_px=6.3)
    assert (result.foot_row, result.height_px) == (427, 325 if name == "pitched" else 327)
    assert result.height_mm / 10 == pytest.approx(37.7 if name == "pitched" else 37.9, abs=0.05)
    assert result.height_mm / 300 == pytest.approx(1.26, abs=0.01)


def test_strict_maximum_marks_the_edge_only_for_a_level_camera(case):
    name, view, disparity = case
    sixteenths = np.round(disparity * 16) / 16  # as SGBM gives them
    result = height_by_maximum(sixteenths, SCALE, CONSTANT)
    if name == "level":
        assert result.top_row == int(view.top_row) + 1
        assert abs(result.column - view.column) < 3
    else:
        assert result.height_px < 10  # the foot alone


@pytest.mark.parametrize(("tolerance", "whole"), [(6.0, False), (6.3, True)])
def test_pitched_camera_needs_a_tolerance_of_6_2(rectified, tolerance, whole):
    view = paper.solve_pitch(rectified, paper.paper_setup())
    disparity = perfect_disparity(rectified, view)
    result = height_by_maximum(disparity, SCALE, CONSTANT, tolerance_px=tolerance)
    assert (result.top_row == 102) is whole


def test_cure_gives_the_true_height(case, rectified):
    _, view, disparity = case
    result = height_by_maximum(disparity, SCALE, CONSTANT, tolerance_px=6.3)
    at_top = disparity[result.top_row, result.column]
    assert result.disparity_px == at_top
    height = height_from_depth(rectified, view.T_left_world, result.column, result.top_row - 0.5, at_top)
    assert height == pytest.approx(300, abs=1.5)
    assert height_of_top(rectified, view.T_left_world, result) == height


def test_both_heights_from_the_recorded_pair(rectified):
    """SGBM on the virtual rig's pictures: the recipe is a quarter too tall, the ray within 1 %."""
    view = paper.solve_pitch(rectified, paper.paper_setup())
    disparity = compute_disparity(*rectified.rectify(*recordings.load_pair("conditions/texture")), SGBMParams(128))
    fall = view.disparity_foot_px - view.disparity_top_px
    result = height_by_maximum(disparity, SCALE, CONSTANT, tolerance_px=fall + 1)
    assert result.top_row == pytest.approx(view.top_row, abs=2)
    assert result.height_mm / 300 == pytest.approx(1.26, abs=0.01)
    assert height_of_top(rectified, view.T_left_world, result) == pytest.approx(300, abs=3)


def test_own_truth_agrees_with_the_renderers(case):
    """Two independent makers of perfect disparity: planes here, ray casting there."""
    name, _, disparity = case
    truth = recordings.load_truth("conditions/texture" if name == "pitched" else "conditions/level")
    near = truth.disparity_px > 60  # cube and the floor before it; the wall is not in the twin
    wrong = np.abs(truth.disparity_px - disparity)[near] > 0.01
    assert wrong.mean() < 1e-3  # pixels on an outline may fall either side


def test_height_from_depth_of_exact_points(rectified):
    """Any point projected by the pose comes back at its height."""
    pose = paper.rig_pose(rectified, 0.11, 140.0)
    for point in ([700, 0, 300], [900, 150, 12.5], [1300, -200, 0]):
        rect = rectified.R1 @ (pose[:3, :3] @ point + pose[:3, 3])
        u, v, w = rectified.P1[:, :3] @ rect
        disparity = rectified.f_px * rectified.baseline_mm / w
        assert height_from_depth(rectified, pose, u / w, v / w, disparity) == pytest.approx(point[2], abs=1e-9)
    with pytest.raises(ValueError, match="no depth"):
        height_from_depth(rectified, pose, 300, 200, -4.0)
    assert np.isnan(height_from_depth(rectified, pose, 300, 200, np.nan))


def test_dilation_spreads_the_floor_into_the_crop(rectified):
    """9x9: the floor below the constant reaches four rows up, raises the maximum and marks floor only."""
    view = paper.solve_camera_height(rectified, paper.paper_setup())
    disparity = perfect_disparity(rectified, view)
    plain = height_by_maximum(disparity, SCALE, CONSTANT, tolerance_px=0.5)
    spread = height_by_maximum(disparity, SCALE, CONSTANT, tolerance_px=0.5, dilate_px=9)
    assert plain.height_px == 327
    assert spread.height_px <= 4
    assert spread.threshold_px > plain.threshold_px + 0.5


def small():
    disparity = np.full((8, 6), 10.0)
    disparity[2:6, 3] = 20.0  # an edge from row 2 to row 5
    disparity[6:] = 30.0  # floor
    return disparity


def test_known_small_map():
    result = height_by_maximum(small(), 0.1, 2)
    assert (result.top_row, result.column, result.foot_row, result.height_px) == (2, 3, 6, 4)
    assert result.height_mm == pytest.approx(4.0)
    assert np.argwhere(result.mask).tolist() == [[2, 3], [3, 3], [4, 3], [5, 3]]
    assert height_by_maximum(small(), 0.1, 2, dilate_px=3).height_px == 1  # the floor, one row up


def test_speckle_wins():
    speckled = small()
    speckled[0, 5] = 25.0
    result = height_by_maximum(speckled, 0.1, 2)
    assert (result.top_row, result.column, result.mask.sum()) == (0, 5, 1)


def test_holes_do_not_count():
    holed = small()
    holed[2, 3] = np.nan
    assert height_by_maximum(holed, 0.1, 2).top_row == 3
    assert height_by_maximum(holed.astype(np.float32), 0.1, 2, dilate_px=1).top_row == 3


@pytest.mark.parametrize(
    ("disparity", "options", "message"),
    [
        (np.full((8, 6), np.nan), {}, "empty"),
        (np.where(np.arange(8)[:, None] < 6, np.nan, small()), {}, "above the constant"),
        (np.empty((0, 6)), {}, "shape"),
        (np.ones((8, 6, 3)), {}, "shape"),
        (np.full((8, 6), 160, np.int16), {}, "16 times"),
        (-small(), {}, "exchange"),
        (small(), {"constant_rows": 8}, "0 to 7"),
        (small(), {"constant_rows": 1.5}, "whole"),
        (small(), {"cm_per_px": 0.0}, "scale > 0"),
        (small(), {"tolerance_px": -1.0}, "tolerance >= 0"),
        (small(), {"dilate_px": 0}, "odd"),
        (small(), {"dilate_px": 4}, "odd"),
    ],
)
def test_bad_input_is_refused(disparity, options, message):
    with pytest.raises(ValueError, match=message):
        height_by_maximum(**{"disparity_px": disparity, "cm_per_px": 0.1, "constant_rows": 2} | options)


def test_a_fixed_threshold():
    fixed = height_by_maximum(small(), 0.1, 2, threshold_px=15.0)
    assert (fixed.top_row, fixed.threshold_px) == (2, 15.0)
    with pytest.raises(ValueError, match="reaches 25 px: the largest is 20"):
        height_by_maximum(small(), 0.1, 2, threshold_px=25.0)


def test_many_tolerances_are_the_recipe_many_times(case):
    _, _, disparity = case
    tolerances = np.r_[0, np.geomspace(0.06, 100, 25)]
    many = paper.heights_over_tolerances(disparity, SCALE, CONSTANT, tolerances)
    one = [height_by_maximum(disparity, SCALE, CONSTANT, tolerance_px=t).height_mm for t in tolerances]
    np.testing.assert_allclose(many, one)
    with pytest.raises(ValueError, match=">= 0"):
        paper.heights_over_tolerances(disparity, SCALE, CONSTANT, [-1.0])


def test_recipe_reads_the_same_over_a_wide_range_of_thresholds(case):
    """From the fall of the edge on, until the mask takes in the wall: a quarter too much."""
    _, view, disparity = case
    fall = view.disparity_foot_px - view.disparity_top_px
    readings = paper.heights_over_tolerances(disparity, SCALE, CONSTANT, np.arange(fall + 0.1, 60, 0.5)) / 300
    assert readings == pytest.approx(1.26, abs=0.01)
