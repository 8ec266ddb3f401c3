"""Block matching against bare OpenCV and known planes, and disparity to depth."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from support.pairs import rectified_cube, shifted

from stereolib.matching import (
    SGBMParams,
    check_rectified,
    compute_disparity,
    depth_to_disparity,
    disparity_to_depth,
    left_right_check,
)
from stereolib.paper import paper_rig
from stereolib.rig import Camera, StereoRig, pose_left_world, rigid
from stereolib.virtual import Box, Material, Scene, render_pair, render_truth


@pytest.fixture(scope="module")
def cube():
    return rectified_cube()


@pytest.mark.parametrize("disparity", [3, 17, 40])
def test_shift_comes_back(disparity):
    found = compute_disparity(*shifted(disparity), SGBMParams(num_disparities=48))
    assert found.dtype == np.float32
    assert np.isnan(found[:, :48]).all()
    assert np.isfinite(found[:, 48:]).mean() > 0.995
    error = np.abs(found[np.isfinite(found)] - disparity)
    assert np.percentile(error, 99) < 0.2
    assert error.max() < 2


def test_window_that_begins_later():
    params = SGBMParams(num_disparities=16, min_disparity=30)
    found = compute_disparity(*shifted(40), params)
    assert np.nanmedian(found) == pytest.approx(40, abs=0.1)
    assert np.nanmin(found) >= 30
    missed = compute_disparity(*shifted(20), params)
    assert np.nanmin(missed) >= 30  # whatever is matched by chance lies in the window
    assert np.isfinite(missed).mean() < 0.5 < 0.7 < np.isfinite(found).mean()


def test_negative_window():
    right, left = shifted(5)
    found = compute_disparity(left, right, SGBMParams(num_disparities=16, min_disparity=-16))
    assert np.nanmedian(found) == pytest.approx(-5, abs=0.1)


@pytest.mark.parametrize("mode", ["sgbm", "hh", "3way", "hh4"])
def test_bit_for_bit_as_bare_opencv(cube, mode):
    part = [image[200:330] for image in cube]
    bare = cv2.StereoSGBM.create(
        minDisparity=3, numDisparities=112, blockSize=7, P1=8 * 49, P2=32 * 49, disp12MaxDiff=1, preFilterCap=63,
        uniquenessRatio=10, speckleWindowSize=100, speckleRange=2,
        mode={"sgbm": cv2.STEREO_SGBM_MODE_SGBM, "hh": cv2.STEREO_SGBM_MODE_HH,
              "3way": cv2.STEREO_SGBM_MODE_SGBM_3WAY, "hh4": cv2.STEREO_SGBM_MODE_HH4}[mode],
    )  # fmt: skip
    raw = bare.compute(*(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) for image in part)).astype(float) / 16
    expected = np.where(raw < 3, np.nan, raw)
    found = compute_disparity(*part, SGBMParams(112, 7, 3, mode=mode))
    np.testing.assert_array_equal(found, expected.astype(np.float32))
    assert 0.3 < np.isfinite(found).mean() < 1


def test_colour_is_matched_as_grey(cube):
    part = [image[250:300] for image in cube]
    grey = [cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) for image in part]
    found = compute_disparity(*part)
    np.testing.assert_array_equal(found, compute_disparity(*grey))
    assert np.isfinite(found[:, 128:]).mean() > 0.8
    bright, dull = shifted(17), np.random.default_rng(1).integers(0, 256, (2, 120, 240), np.uint8)
    mixed = [np.stack([other, image, image], axis=-1) for image, other in zip(bright, dull, strict=True)]
    found = compute_disparity(*mixed, SGBMParams(48))  # blue, a ninth of the grey, is noise
    assert np.mean(np.abs(found[:, 48:] - 17) < 0.5) > 0.9


def test_whole_covers_the_left_columns():
    pair = shifted(20)
    params = SGBMParams(num_disparities=64)
    part, whole = compute_disparity(*pair, params), compute_disparity(*pair, params, whole=True)
    assert np.isnan(part[:, :64]).all()
    np.testing.assert_allclose(np.nanmedian(whole[:, 24:64], axis=0), 20, atol=0.1)
    assert np.isfinite(whole[:, 24:64]).mean() > 0.95
    # what lies outside the right image cannot be matched; nothing is made up from the border's copies
    column = np.broadcast_to(np.arange(whole.shape[1]), whole.shape)
    seen = np.isfinite(whole)
    assert (whole[seen] <= column[seen]).all()
    both = seen[:, 64:] & np.isfinite(part[:, 64:])
    assert (whole[:, 64:][both] == part[:, 64:][both]).mean() > 0.9
    np.testing.assert_allclose(whole[:, 64:][both], part[:, 64:][both], atol=0.5)


def test_slanted_plane_through_the_whole_path():
    """Rendered through Table I's lenses, rectified, matched, triangulated: the wall stands where it stood."""
    paper = paper_rig()
    left, right = (
        Camera(np.diag([0.5, 0.5, 1]) @ c.K - [[0, 0, 0.25], [0, 0, 0.25], [0, 0, 0]], c.dist, (320, 240))
        for c in (paper.left, paper.right)
    )
    rig = StereoRig(left, right, paper.R, paper.T)
    yaw = np.radians(20)
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    wall = Box((10.0, 3000.0, 3000.0), rigid(turn, [900.0, 0, 500.0]), (Material((0.5, 0.5, 0.5), 0.5, 10.0),))
    scene, pose = Scene((wall,), (), ambient=0.8), pose_left_world(0.0, 500.0)
    rectified = rig.rectify()
    pair = [np.rint(255 * np.clip(light, 0, 1)).astype(np.uint8) for light in render_pair(scene, rig, pose)]
    found = compute_disparity(*rectified.rectify(*pair), SGBMParams(num_disparities=80))
    true = render_truth(scene, rectified, pose)
    assert np.isfinite(found[:, 80:]).mean() > 0.95
    error = found - true.disparity_px
    assert abs(np.nanmedian(error)) < 0.05
    assert np.nanpercentile(np.abs(error), 95) < 0.35
    depth = disparity_to_depth(found, rectified.f_px, rectified.baseline_mm)
    # independently of `truth`: the points lie in the wall's front plane
    v, u = np.nonzero(np.isfinite(depth))
    rays = np.column_stack([u, v, np.ones(len(u))]) @ np.linalg.inv(rectified.P1[:, :3]).T
    world = np.linalg.inv(pose) @ np.vstack([(rays * depth[v, u][:, None] @ rectified.R1).T, np.ones(len(u))])
    beyond = (world[:3].T - [900.0, 0, 500.0]) @ turn[:, 0] + 5.0
    assert abs(np.median(beyond)) < 2
    assert np.percentile(np.abs(beyond), 90) < 12  # mm, at 0.9 m with half of the paper's resolution


def test_depth_by_hand():
    depth = disparity_to_depth(np.array([[100.0, 50, 0, -3, np.nan]]), 763.7, 93.1)
    np.testing.assert_allclose(depth, [[763.7 * 0.931, 763.7 * 1.862, np.nan, np.nan, np.nan]])
    back = depth_to_disparity(depth[0, :2], 763.7, 93.1)
    np.testing.assert_allclose(back, [100, 50])


@pytest.mark.parametrize("nothing", [np.full((4, 5), np.nan), np.zeros((4, 5)), np.zeros((0, 5))])
def test_empty_disparity(nothing):
    with pytest.raises(ValueError, match=r"disparity map of shape \(\d, 5\) is empty: no pixel was matched"):
        disparity_to_depth(nothing, 700, 93)


def test_left_right_check_against_loops():
    rng = np.random.default_rng(4)
    left = rng.uniform(0, 12, (9, 30))
    right = rng.uniform(0, 12, (9, 30))
    left[rng.random(left.shape) < 0.2] = right[rng.random(left.shape) < 0.2] = np.nan
    expected = np.full_like(left, np.nan)
    for v in range(9):
        for u in range(30):
            if np.isnan(left[v, u]):
                continue
            there = int(np.rint(u - left[v, u]))
            if there >= 0 and abs(right[v, there] - left[v, u]) <= 3:
                expected[v, u] = left[v, u]
    assert 20 < np.isfinite(expected).sum() < 200
    np.testing.assert_array_equal(left_right_check(left, right, 3.0), expected)


@pytest.mark.parametrize("width", [64, 65, 66])
def test_window_as_wide_as_the_image(width):
    with pytest.raises(ValueError, match=f"the search window ends at 64 px, the image is {width} px wide"):
        compute_disparity(*shifted(3, (40, width)), SGBMParams(num_disparities=64, block_size=5))


def test_narrow_images():
    """Three columns wider than the window: nothing lies within, and widened all of it is matched."""
    for pair, params in (
        (shifted(3, (40, 67)), SGBMParams(num_disparities=64, block_size=5)),
        (shifted(3, (40, 19)), SGBMParams(num_disparities=16, block_size=5)),
    ):
        found = compute_disparity(*pair, params)
        assert found.shape == pair[0].shape and np.isnan(found[:, : params.num_disparities]).all()
        whole = compute_disparity(*pair, params, whole=True)
        assert np.mean(np.abs(whole[:, 3:] - 3) < 0.5) > 0.85


def test_pair_that_does_not_fit():
    left, right = shifted(3)
    with pytest.raises(ValueError, match="left is 240x120, right is 239x120"):
        compute_disparity(left, right[:, 1:])
    with pytest.raises(ValueError, match="left is grey, right is colour"):
        compute_disparity(left, cv2.cvtColor(right, cv2.COLOR_GRAY2BGR))
    with pytest.raises(ValueError, match="uint8"):
        compute_disparity(left.astype(float), right.astype(float))


@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_images_of_another_kind_are_refused(dtype):
    left, right = (image.astype(dtype) for image in shifted(3))
    for function in (compute_disparity, check_rectified):
        with pytest.raises(ValueError, match=f"must be uint8 arrays, got {np.dtype(dtype)}; scale to 0..255"):
            function(left, right)


@pytest.mark.parametrize(("f_px", "baseline_mm"), [(0.0, 90.0), (700.0, 0.0), (-700.0, 90.0), (700.0, float("nan"))])
def test_depth_needs_a_lens_and_a_baseline(f_px, baseline_mm):
    with pytest.raises(ValueError, match="focal length and baseline must be positive"):
        disparity_to_depth(np.ones((2, 2)), f_px, baseline_mm)


@pytest.mark.parametrize("shapes", [((2, 4), (2, 7)), ((2, 4), (5, 4)), ((4,), (4,))])
def test_views_of_other_shapes_are_not_compared(shapes):
    with pytest.raises(ValueError, match=r"both views' maps must be \(H, W\)"):
        left_right_check(*(np.ones(shape) for shape in shapes))


def test_a_match_beyond_either_side_of_the_right_picture_is_none():
    for d in (-2.0, 2.0):
        assert np.isnan(left_right_check(np.full((1, 4), d), np.full((1, 4), d))).sum() == 2


def test_what_is_infinitely_near_or_behind_has_no_depth_and_no_disparity():
    np.testing.assert_array_equal(disparity_to_depth([np.inf, 1.0, -1.0], 700, 90), [np.nan, 63000, np.nan])
    np.testing.assert_array_equal(depth_to_disparity([0.0, -5.0, np.inf, 63000.0], 700, 90), [np.nan, np.nan, 0, 1])
