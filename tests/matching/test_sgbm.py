"""Settings of the matcher: what is refused, and the window from depths."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from support.pairs import rectified_cube

from stereolib.matching import (
    SGBMParams,
    compute_disparity,
)
from stereolib.paper import paper_rig
from stereolib.virtual import recordings


@pytest.fixture(scope="module")
def cube():
    return rectified_cube()


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"num_disparities": 100}, "num_disparities must be a positive multiple of 16, got 100; near are 96, 112"),
        ({"num_disparities": 0}, "got 0; near are 16, 32"),
        ({"num_disparities": -16}, "got -16; near are 16, 32"),
        ({"block_size": 4}, "block_size must be odd and at least 1, got 4; near are 3, 5"),
        ({"block_size": 0}, "got 0; near are 1, 3"),
        ({"block_size": -3}, "got -3; near are 1, 3"),
        ({"p1": 100, "p2": 100}, "0 < p1 < p2, got p1=100, p2=100"),
        ({"p2": 100}, "got p1=200, p2=100"),
        ({"mode": "fast"}, "unknown mode 'fast'; choose one of sgbm, hh, 3way, hh4"),
        ({"uniqueness_ratio": 101}, "uniqueness_ratio is a percentage, got 101"),
        ({"pre_filter_cap": 0}, "pre_filter_cap must be 1 to 63, got 0"),
        ({"pre_filter_cap": 64}, "pre_filter_cap must be 1 to 63, got 64"),
        ({"speckle_window_size": -1}, r"0 \(no search for specks\) or more, got -1 and 2"),
        ({"speckle_range": -2}, r"or more, got 100 and -2"),
        ({"block_size": 5.0}, "block_size must be a whole number, got 5.0"),
        ({"p1": 10.5}, "p1 must be a whole number, got 10.5"),
        ({"num_disparities": None}, "num_disparities must be a whole number, got None"),
        ({"uniqueness_ratio": "10"}, "uniqueness_ratio must be a whole number, got '10'"),
        ({"speckle_window_size": 1.5}, "speckle_window_size must be a whole number"),
        ({"disp12_max_diff": 0.5}, "disp12_max_diff must be a whole number"),
    ],
)
def test_parameters_are_checked(change, text):
    with pytest.raises(ValueError, match=text):
        SGBMParams(**change)


def test_penalties_follow_the_block():
    assert SGBMParams(block_size=7).penalties == (8 * 49, 32 * 49)
    assert SGBMParams(p1=10, p2=20).penalties == (10, 20)


def test_window_from_depths_holds_them_and_no_more():
    rig = recordings.rectified()
    fB = rig.f_px * rig.baseline_mm
    for near, far in ((500, 520), (400, 3000), (700, 1200), (650, np.inf)):
        params = SGBMParams.for_range(rig, near, far, block_size=7)
        last = params.min_disparity + params.num_disparities - 1
        assert params.min_disparity <= fB / far - 1 + (far == np.inf) and last >= fB / near + 1
        assert params.block_size == 7
        fewest = fB / near - (fB / far if far < np.inf else 0) + 2
        assert params.num_disparities < fewest + 18
    with pytest.raises(ValueError, match="0 < near_mm < far_mm, got 900 and 700"):
        SGBMParams.for_range(rig, 900, 700)
    with pytest.raises(ValueError, match=r"near_mm=0.7 needs \d{5} disparities, more than 1024: depths are in mm"):
        SGBMParams.for_range(rig, 0.7, 1.2)
    with pytest.raises(ValueError, match=r"needs a RectifiedRig, got StereoRig: pass rig.rectify\(\)"):
        SGBMParams.for_range(paper_rig(), 600, 1200)


def test_both_ends_of_the_window_have_a_neighbour():
    """Also where the count of disparities is a multiple of 16, so that rounding up adds none."""
    rig = recordings.rectified()
    fB, exact = rig.f_px * rig.baseline_mm, 0
    for near in np.arange(300.0, 1500.0, 2.0):
        params = SGBMParams.for_range(rig, near, 3000.0)
        last = params.min_disparity + params.num_disparities - 1
        assert params.min_disparity <= fB / 3000.0 - 1 and last >= fB / near + 1
        exact += last < fB / near + 2
    assert exact > 10  # where one pixel fewer would be missed


def test_window_from_depths_matches_the_cube(cube):
    true = recordings.load_truth("conditions/texture")
    where = true.visible & (true.box == 1)
    depth = true.depth_mm[where]
    params = SGBMParams.for_range(recordings.rectified(), depth.min(), depth.max())
    assert params.num_disparities < 64
    found = compute_disparity(*cube, params)
    assert (np.abs(found - true.disparity_px)[where] <= 1).mean() > 0.995


def test_blocks_whose_costs_leave_16_bits_are_refused():
    with pytest.raises(ValueError, match=r"block_size 19 .* 16 bits, and 59 grey levels .* p2 up to 999 "):
        SGBMParams(block_size=19)
    SGBMParams(block_size=19, p1=200, p2=999)
    with pytest.raises(ValueError, match="runs over"):
        SGBMParams(block_size=19, p1=200, p2=1000)
    with pytest.raises(ValueError, match="runs over"):
        SGBMParams(p1=1, p2=32000)
    with pytest.raises(ValueError, match=r"are needed\. Take a block of at most 15"):
        SGBMParams(block_size=21, p1=2, p2=3)
    assert SGBMParams(block_size=15).room > 88 and SGBMParams(block_size=11).room > 189


def test_opencv_runs_over_where_it_is_refused_and_not_below():
    """The same block and the same images: only the penalties differ, and with them the room left in 16 bits."""
    view = recordings.view("series/coarse_700")
    grey = [cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) for image in (view.left, view.right)]
    bad = []
    for p2 in (800, 32 * 19**2):
        raw = cv2.StereoSGBM.create(0, 128, 19, p2 // 4, p2, 1, 63, 10, 100, 2).compute(*grey)
        bad.append((np.abs(raw / 16 - view.truth_px)[view.regions["cube"]] > 2).mean())
    assert bad[0] < 0.01 and bad[1] > 0.1
    SGBMParams(block_size=19, p1=200, p2=800)
    with pytest.raises(ValueError, match="runs over"):
        SGBMParams(block_size=19)


@pytest.mark.parametrize("window", [(16, -2048), (16, 2040), (1024, 1100)])
def test_disparities_that_opencv_cannot_write_down_are_refused(window):
    with pytest.raises(ValueError, match="OpenCV knows disparities from -2047 to 2047 px"):
        SGBMParams(window[0], min_disparity=window[1])


def test_the_farthest_disparities_that_are_taken_are_found():
    left = np.random.default_rng(0).integers(0, 256, (30, 2300), np.uint8)
    for by, first in ((2040, 2032), (-2040, -2047)):
        found = compute_disparity(left, np.roll(left, -by, axis=1), SGBMParams(16, min_disparity=first))
        assert np.nanmedian(found) == by


def test_numbers_of_numpy_do_not_run_over():
    assert SGBMParams(np.uint8(240), np.uint8(9), np.uint8(32)) == SGBMParams(240, 9, 32)


@pytest.mark.parametrize("mode", ["sgbm", "hh", "3way", "hh4"])
def test_a_left_right_check_below_zero_is_none(cube, mode):
    """OpenCV itself takes -1 and 0 as 1."""
    unchecked = SGBMParams(disp12_max_diff=-1, uniqueness_ratio=0, speckle_window_size=0, mode=mode)
    checked = [replace(unchecked, disp12_max_diff=px) for px in (0, 1, 8)]
    full, *others = (np.isfinite(compute_disparity(*cube, one)[:, 128:]).mean() for one in (unchecked, *checked))
    assert full > 0.999 and others[0] == others[1] < others[2] < full
