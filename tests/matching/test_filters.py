"""Dilation and its rivals against loops."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib.matching import filters

RNG = np.random.default_rng(34)


def sparse(shape=(17, 23), share=0.6, seed=0):
    rng = np.random.default_rng(seed)
    return np.where(rng.random(shape) < share, np.nan, rng.uniform(0, 120, shape)).astype(np.float32)


def members(size, shape):
    """Offsets of a kernel, told without OpenCV."""
    r = size // 2
    for dy in range(-r, r + 1):
        widest = {"rect": r, "cross": r if dy == 0 else 0, "ellipse": round(np.sqrt(r * r - dy * dy))}[shape]
        yield from ((dy, dx) for dx in range(-widest, widest + 1))


def by_loops(disparity, size, shape, choose, *, outside):
    """`choose` over the valid values under the kernel; `outside` is whether NaN there makes NaN."""
    height, width = disparity.shape
    out = np.full_like(disparity, np.nan)
    for v in range(height):
        for u in range(width):
            under = [
                disparity[v + dy, u + dx]
                for dy, dx in members(size, shape)
                if 0 <= v + dy < height and 0 <= u + dx < width
            ]
            valid = [d for d in under if not np.isnan(d)]
            if valid and (len(valid) == len(under) or not outside):
                out[v, u] = choose(valid)
    return out


@pytest.mark.parametrize("shape", ["rect", "cross", "ellipse"])
@pytest.mark.parametrize("size", [1, 3, 5, 9])
def test_dilation(size, shape):
    disparity = sparse(share=0.8)
    expected = by_loops(disparity, size, shape, max, outside=False)
    np.testing.assert_array_equal(filters.dilate(disparity, size, shape=shape), expected)
    assert size == 1 or np.isfinite(expected).sum() > np.isfinite(disparity).sum()


@pytest.mark.parametrize("shape", ["rect", "cross", "ellipse"])
@pytest.mark.parametrize("size", [1, 3, 7])
def test_closing_is_dilation_then_erosion(size, shape):
    disparity = sparse(share=0.9, seed=1)
    dilated = by_loops(disparity, size, shape, max, outside=False)
    expected = by_loops(dilated, size, shape, min, outside=True)
    np.testing.assert_array_equal(filters.close(disparity, size, shape=shape), expected)
    # closing only ever fills: what was there stays or rises
    was = np.isfinite(disparity)
    assert (expected[was] >= disparity[was]).all()


@pytest.mark.parametrize("share", [0.0, 0.6, 0.97])
@pytest.mark.parametrize("size", [1, 3, 5])
def test_median(size, share):
    disparity = sparse(share=share, seed=2)
    expected = by_loops(disparity, size, "rect", np.median, outside=False)
    np.testing.assert_allclose(filters.median_filter(disparity, size), expected, rtol=1e-6)


def test_median_does_not_mix_in_what_was_never_there():
    disparity = np.full((5, 9), np.nan)
    disparity[2, 0] = 5
    assert np.nanmin(filters.median_filter(disparity, 3)) == 5


def test_dilation_grows_objects_by_the_radius_and_closing_does_not():
    """The paper's remedy, and its price."""
    disparity = np.full((41, 61), 20.0)
    disparity[15:26, 20:41] = 90
    disparity[20, 30] = np.nan
    grown, closed = filters.dilate(disparity, 9), filters.close(disparity, 9)
    assert (grown[11:30, 16:45] == 90).all()
    assert (grown == 90).sum() == 19 * 29
    assert (closed == 90).sum() == 11 * 21
    assert closed[20, 30] == 90


@pytest.mark.parametrize("shape", ["rect", "cross", "ellipse"])
@pytest.mark.parametrize("size", [1, 3, 7])
def test_set_dilation_is_the_grey_one_of_its_indicator(size, shape):
    """The paper's union of translates, against the definition by distance and against `dilate`."""
    pixels = np.random.default_rng(3).random((15, 21)) < 0.05
    expected = np.zeros_like(pixels)
    for v, u in np.argwhere(pixels):
        for dy, dx in members(size, shape):
            if 0 <= v + dy < 15 and 0 <= u + dx < 21:
                expected[v + dy, u + dx] = True
    found = filters.dilate_set(pixels, size, shape=shape)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(found, filters.dilate(pixels.astype(float), size, shape=shape) == 1)
    assert filters.dilate_set(np.zeros((4, 5), bool), size, shape=shape).sum() == 0


def test_set_dilation_needs_a_set():
    with pytest.raises(ValueError, match="needs a set: a mask"):
        filters.dilate_set(sparse(), 3)
    with pytest.raises(ValueError, match="odd whole number"):
        filters.dilate_set(np.zeros((4, 5), bool), 0)


def test_nothing_stays_nothing():
    nothing = np.full((6, 7), np.nan)
    for smooth in (filters.dilate, filters.close, filters.median_filter):
        assert np.isnan(smooth(nothing, 3)).all()
        assert smooth(nothing, 3).dtype == np.float32


def test_input_is_left_alone():
    disparity = sparse()
    before = disparity.copy()
    for smooth in (filters.dilate, filters.close, filters.median_filter):
        smooth(disparity, 5)
        np.testing.assert_array_equal(disparity, before)


@pytest.mark.parametrize("smooth", [filters.dilate, filters.close, filters.median_filter])
@pytest.mark.parametrize("size", [0, -3, 4, 2.5])
def test_refuses_kernels(smooth, size):
    with pytest.raises(ValueError, match=f"odd whole number of pixels from 1 on, got {size}"):
        smooth(sparse(), size)


def test_refuses_other_input():
    with pytest.raises(ValueError, match=r"disparity map of shape \(H, W\), got \(3, 4, 3\)"):
        filters.dilate(np.zeros((3, 4, 3)), 3)
    with pytest.raises(ValueError, match=r"got \(0, 4\)"):
        filters.median_filter(np.zeros((0, 4)), 3)
    with pytest.raises(ValueError, match="unknown kernel shape 'star'; choose one of rect, ellipse, cross"):
        filters.close(sparse(), 3, shape="star")


def scene_with_holes(seed=5):
    """A near square before a far wall, both seen clearly in the picture; a third of the map is missing."""
    rng = np.random.default_rng(seed)
    truth = np.full((60, 80), 20.0, np.float32)
    truth[15:45, 25:55] = 60
    image = np.where(truth > 40, 200, 60).astype(np.uint8)
    return np.where(rng.random(truth.shape) < 0.33, np.nan, truth).astype(np.float32), truth, image


@pytest.mark.parametrize("method", list(filters.SMOOTHING_METHODS))
def test_smooth_by_name(method):
    disparity, truth, image = scene_with_holes()
    out = filters.smooth(disparity, method, size_px=7, image=image, right_px=np.full_like(truth, np.nan))
    assert out.dtype == np.float32 and out.shape == truth.shape
    inner = np.zeros(truth.shape, bool)
    inner[22:38, 32:48] = True
    if method == "left_right":  # the right view agrees nowhere
        assert np.isnan(out).all()
    else:
        right = np.abs(out[inner] - truth[inner]) < (4 if method == "inpaint_telea" else 0.5)
        assert right[np.isfinite(out[inner])].all() and right.mean() > 0.6
    nothing = np.full_like(truth, np.nan)
    assert np.isnan(filters.smooth(nothing, method, image=image, right_px=nothing)).all()


@pytest.mark.parametrize("method", ["weighted_median", "least_squares"])
def test_guided_methods_keep_the_outline(method):
    disparity, truth, image = scene_with_holes()
    out = filters.smooth(disparity, method, size_px=9, image=image)
    assert np.abs(out - truth).max() < 1
    blind = filters.smooth(disparity, method, size_px=9, image=np.full_like(image, 90))
    assert (np.abs(blind - truth) > 2).mean() > 0.01  # without edges to see it does not


def test_least_squares_solves_its_equations():
    """One column system against a dense solver."""
    rng = np.random.default_rng(6)
    right, weight = rng.random((2, 8, 3)), rng.random((7, 3))
    from stereolib.matching.filling import _tridiagonal

    found = _tridiagonal(right, weight)
    for m in range(3):
        matrix = np.eye(8)
        for i, w in enumerate(weight[:, m]):
            matrix[i, i], matrix[i + 1, i + 1] = matrix[i, i] + w, matrix[i + 1, i + 1] + w
            matrix[i, i + 1] = matrix[i + 1, i] = -w
        np.testing.assert_allclose(found[:, :, m].T, np.linalg.solve(matrix, right[:, :, m].T), rtol=1e-10)


def test_background_by_hand():
    nan = np.nan
    rows = np.array([[nan, 5, nan, 3, nan], [nan, nan, nan, nan, nan], [9, nan, nan, nan, 2]], float)
    expected = [[5, 5, 3, 3, 3], [5, 2, 2, 2, 2], [9, 2, 2, 2, 2]]
    np.testing.assert_array_equal(filters.smooth(rows, "background"), expected)


def test_speckles_go_and_patches_stay():
    disparity = np.full((20, 20), 10.0)
    disparity[5, 5], disparity[10:14, 10:14] = 50, 30
    out = filters.smooth(disparity, "speckle", size_px=3)
    assert np.isnan(out[5, 5]) and np.isnan(out).sum() == 1


def test_opening_closing_removes_a_near_speck_and_closing_keeps_it():
    disparity = np.full((21, 21), 20.0)
    disparity[10, 10], disparity[3, 3] = 90, np.nan
    assert filters.smooth(disparity, "opening_closing", size_px=3)[10, 10] == 20
    assert filters.smooth(disparity, "closing", size_px=3)[10, 10] == 90
    assert filters.smooth(disparity, "opening_closing", size_px=3)[3, 3] == 20


def test_smooth_refuses():
    disparity, _, image = scene_with_holes()
    with pytest.raises(ValueError, match="unknown method 'blur'; choose one of dilation, closing"):
        filters.smooth(disparity, "blur")
    with pytest.raises(ValueError, match="pass image="):
        filters.smooth(disparity, "least_squares")
    with pytest.raises(ValueError, match="pass right_px="):
        filters.smooth(disparity, "left_right")
    with pytest.raises(ValueError, match=r"right view's map has shape \(3, 3\)"):
        filters.smooth(disparity, "left_right", right_px=np.zeros((3, 3)))
    with pytest.raises(ValueError, match=r"picture has shape \(59, 80\)"):
        filters.smooth(disparity, "weighted_median", image=image[1:])
    with pytest.raises(ValueError, match="odd whole number of pixels from 1 on, got 8"):
        filters.smooth(disparity, "median", size_px=8)
    with pytest.raises(ValueError, match=r"a kernel of 61 px is larger than the map \(60, 80\)"):
        filters.smooth(disparity, "dilation", size_px=61)
    assert np.isfinite(filters.smooth(disparity, "background", size_px=61)).all()  # has no kernel


@pytest.mark.parametrize("shape", ["rect", "ellipse", "cross"])
@pytest.mark.parametrize("size", [1, 3, 7])
def test_the_printed_union_level_by_level_is_the_grey_maximum(size: int, shape: str) -> None:
    levels = RNG.integers(0, 6, (23, 31))
    stacked = sum(filters.dilate_set(levels >= t, size, shape=shape).astype(int) for t in range(1, 6))
    np.testing.assert_array_equal(stacked, filters.dilate(levels, size, shape=shape))


def test_the_union_of_one_pixel_is_the_kernel() -> None:
    point = np.zeros((9, 9), bool)
    point[4, 4] = True
    assert np.argwhere(filters.dilate_set(point, 3, shape="cross")).tolist() == [
        [3, 4],
        [4, 3],
        [4, 4],
        [4, 5],
        [5, 4],
    ]


def test_a_union_needs_a_set() -> None:
    with pytest.raises(ValueError, match="mask"):
        filters.dilate_set(np.ones((4, 4)), 3)


def test_a_map_that_lies_otherwise_in_memory_is_filtered_alike():
    turned = np.random.default_rng(2).integers(8, 12, (40, 30)).astype(np.float32).T
    np.testing.assert_array_equal(
        filters.smooth(turned, "speckle", size_px=3), filters.smooth(turned.copy("C"), "speckle", size_px=3)
    )


def test_an_infinite_disparity_is_refused():
    with pytest.raises(ValueError, match="NaN is a hole"):
        filters.smooth([[1.0, np.inf], [2.0, 3.0]], "background")
