"""Dilation and its rivals against loops."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib import smoothing


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
    np.testing.assert_array_equal(smoothing.dilate(disparity, size, shape=shape), expected)
    assert size == 1 or np.isfinite(expected).sum() > np.isfinite(disparity).sum()


@pytest.mark.parametrize("shape", ["rect", "cross", "ellipse"])
@pytest.mark.parametrize("size", [1, 3, 7])
def test_closing_is_dilation_then_erosion(size, shape):
    disparity = sparse(share=0.9, seed=1)
    dilated = by_loops(disparity, size, shape, max, outside=False)
    expected = by_loops(dilated, size, shape, min, outside=True)
    np.testing.assert_array_equal(smoothing.close(disparity, size, shape=shape), expected)
    # closing only ever fills: what was there stays or rises
    was = np.isfinite(disparity)
    assert (expected[was] >= disparity[was]).all()


@pytest.mark.parametrize("share", [0.0, 0.6, 0.97])
@pytest.mark.parametrize("size", [1, 3, 5])
def test_median(size, share):
    disparity = sparse(share=share, seed=2)
    expected = by_loops(disparity, size, "rect", np.median, outside=False)
    np.testing.assert_allclose(smoothing.median(disparity, size), expected, rtol=1e-6)


def test_median_does_not_mix_in_what_was_never_there():
    disparity = np.full((5, 9), np.nan)
    disparity[2, 0] = 5
    assert np.nanmin(smoothing.median(disparity, 3)) == 5


def test_dilation_grows_objects_by_the_radius_and_closing_does_not():
    """The paper's remedy, and its price."""
    disparity = np.full((41, 61), 20.0)
    disparity[15:26, 20:41] = 90
    disparity[20, 30] = np.nan
    grown, closed = smoothing.dilate(disparity, 9), smoothing.close(disparity, 9)
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
    found = smoothing.dilate_set(pixels, size, shape=shape)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(found, smoothing.dilate(pixels.astype(float), size, shape=shape) == 1)
    assert smoothing.dilate_set(np.zeros((4, 5), bool), size, shape=shape).sum() == 0


def test_set_dilation_needs_a_set():
    with pytest.raises(ValueError, match="needs a set: a mask"):
        smoothing.dilate_set(sparse(), 3)
    with pytest.raises(ValueError, match="odd whole number"):
        smoothing.dilate_set(np.zeros((4, 5), bool), 0)


def test_nothing_stays_nothing():
    nothing = np.full((6, 7), np.nan)
    for smooth in (smoothing.dilate, smoothing.close, smoothing.median):
        assert np.isnan(smooth(nothing, 3)).all()
        assert smooth(nothing, 3).dtype == np.float32


def test_input_is_left_alone():
    disparity = sparse()
    before = disparity.copy()
    for smooth in (smoothing.dilate, smoothing.close, smoothing.median):
        smooth(disparity, 5)
        np.testing.assert_array_equal(disparity, before)


@pytest.mark.parametrize("smooth", [smoothing.dilate, smoothing.close, smoothing.median])
@pytest.mark.parametrize("size", [0, -3, 4, 2.5])
def test_refuses_kernels(smooth, size):
    with pytest.raises(ValueError, match=f"odd whole number of pixels from 1 on, got {size}"):
        smooth(sparse(), size)


def test_refuses_other_input():
    with pytest.raises(ValueError, match=r"disparity map of shape \(H, W\), got \(3, 4, 3\)"):
        smoothing.dilate(np.zeros((3, 4, 3)), 3)
    with pytest.raises(ValueError, match=r"got \(0, 4\)"):
        smoothing.median(np.zeros((0, 4)), 3)
    with pytest.raises(ValueError, match="unknown kernel shape 'star'; choose one of rect, ellipse, cross"):
        smoothing.close(sparse(), 3, shape="star")
