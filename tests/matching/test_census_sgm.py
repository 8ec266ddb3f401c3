"""Semi-global matching against loops."""

from __future__ import annotations

import itertools

import cv2
import numpy as np
import pytest

from stereolib.matching import census_sgm, paths


def small_pair(shape=(7, 12), seed=0):
    rng = np.random.default_rng(seed)
    return (rng.integers(0, 256, (*shape, 3), dtype=np.uint8) for _ in range(2))


@pytest.mark.parametrize(("channels", "rows"), [((), 6), ((), 5), ((3,), 6), ((3,), 5)])
def test_aggregation_is_hirschmuellers(channels, rows, monkeypatch):
    """Four paths by recursion, pixel by pixel, from the equation; whatever rows are turned at once."""
    monkeypatch.setattr(paths, "_BAND_ROWS", 2)
    rng = np.random.default_rng(1)
    cost = rng.integers(0, 60, (rows, 5, 9)).astype(np.uint8)
    image = rng.integers(0, 256, (rows, 9, *channels), dtype=np.uint8)
    height, count, width = cost.shape
    expected = np.zeros(cost.shape, int)
    for dy, dx in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        path = {}
        for y in range(height) if dy >= 0 else range(height - 1, -1, -1):
            for x in range(width) if dx >= 0 else range(width - 1, -1, -1):
                q = (y - dy, x - dx)
                if q not in path:
                    path[y, x] = cost[y, :, x].astype(int)
                    continue
                step = np.abs(image[y, x].astype(int) - image[q]).max()
                before, p2 = path[q], max(40 / (1 + step / 30), 8)
                path[y, x] = np.array([
                    cost[y, d, x] - before.min()
                    + min([before[d], before.min() + int(p2),
                           *(before[e] + 7 for e in (d - 1, d + 1) if 0 <= e < count)])
                    for d in range(count)
                ])  # fmt: skip
        for (y, x), values in path.items():
            expected[y, :, x] += values
    np.testing.assert_array_equal(paths.aggregate(cost, image, 7, 40, 30.0), expected)


def test_census_tells_darker_neighbours():
    grey = np.array([[5, 1, 9], [2, 5, 7], [5, 8, 0]], np.uint8)
    bits = census_sgm.census_transform(grey, (3, 3))
    assert f"{bits[0, 1, 1]:08b}" == "01010001"  # row by row: 5 < 5 no, 1 yes, 9 no, 2 yes, ... 0 yes
    np.testing.assert_array_equal(bits, census_sgm.census_transform(20 + 3 * grey, (3, 3)))
    np.testing.assert_array_equal(bits, census_sgm.census_transform(grey.astype(np.uint16), (3, 3)))


@pytest.mark.parametrize("size_px", [(5, 5), (7, 7), (3, 9)])
def test_differing_bits_are_counted(size_px):
    """Against neighbours that are compared one by one."""
    rng = np.random.default_rng(9)
    pair = rng.integers(0, 256, (2, 12, 15), dtype=np.uint8)
    height, width, (above, before) = 12, 15, (size_px[0] // 2, size_px[1] // 2)
    roomy = np.pad(pair, ((0, 0), (above, above), (before, before)), mode="edge")
    darker = [
        roomy[:, v : v + height, u : u + width] < pair for v, u in np.ndindex(size_px) if (v, u) != (above, before)
    ]
    cost = np.full((height, 4, width), 255, np.uint8)
    for d in range(4):
        census_sgm._count_differing(*(census_sgm.census_transform(one, size_px) for one in pair), d, d, cost)
        expected = sum((left != right) for left, right in ((bit[0][:, d:], bit[1][:, : width - d]) for bit in darker))
        np.testing.assert_array_equal(cost[:, d, d:], expected)
        assert (cost[:, d, :d] == 255).all()


@pytest.mark.parametrize("channels", [(), (3,)])
@pytest.mark.parametrize("times", [2, 4, 8])
def test_a_smaller_picture_is_sums_of_squares(times, channels):
    rng = np.random.default_rng(0)
    image = rng.integers(0, 256, (16, 32, *channels), dtype=np.uint8)
    grey = image.sum(axis=2, dtype=int) if channels else image.astype(int)
    found = census_sgm._block_sums(image, times)
    for k in range(times):
        moved = np.pad(grey[:, k:], ((0, 0), (0, k)), mode="edge")
        expected = moved.reshape(16 // times, times, 32 // times, times).sum(axis=(1, 3))
        np.testing.assert_array_equal(found[k], expected)
    odd = census_sgm._block_sums(image[:15, :31], times)[0]
    assert odd.shape == found[0].shape
    np.testing.assert_array_equal(odd[:-1, :-1], found[0][:-1, :-1])
    assert census_sgm._block_sums(np.full((8, 8, *channels), 255, np.uint8), 8)[7].max() == 255 * 64 * 3 ** len(
        channels
    )


@pytest.mark.parametrize(("block_size", "color_weight"), [(1, 1.0), (1, 0.7), (3, 1.0)])
def test_the_fine_cost_is_census_and_colour(block_size, color_weight):
    """Means of blocks of what each pixel costs, to the rounding."""
    left, right = small_pair((9, 14))
    params = census_sgm.CensusSGM(3, block_size=block_size, color_weight=color_weight)
    cost = census_sgm._fine_cost(left, right, params)
    bits = [
        np.unpackbits(census_sgm.census_transform(census_sgm.to_grey(i), params.census_px), axis=0)
        for i in (left, right)
    ]
    for d in range(3):
        distance = (bits[0][..., d:] != bits[1][..., : 14 - d]).sum(axis=0)
        unlike = np.abs(left[:, d:].astype(float) - right[:, : 14 - d]).mean(axis=2)
        pixel = distance + color_weight * np.minimum(unlike, params.color_cap)
        expected = cv2.blur(pixel, (block_size, block_size))
        assert np.abs(cost[:, d, d:] - expected).max() <= (0.51 if block_size == 1 else 0.85)


def test_both_views_of_a_shifted_picture():
    rng = np.random.default_rng(2)
    wide = rng.integers(0, 256, (30, 90, 3), dtype=np.uint8)
    found = census_sgm.match_census_sgm(wide[:, :80], wide[:, 6:86], census_sgm.CensusSGM(16))
    assert np.abs(found.left_px[:, 12:] - 6).max() < 0.5
    assert np.abs(found.right_px[:, :60] - 6).max() < 0.5
    assert found.margin[:, 12:].min() > 0


@pytest.mark.parametrize(("halvings", "shift"), [(1, 5), (1, 6), (2, 5), (2, 6), (2, 7), (2, 8), (3, 9), (3, 16)])
def test_a_smaller_size_costs_what_the_moved_picture_does(halvings, shift):
    """Disparities that its pixels do not divide as well as others: a picture that is moved by d costs nothing at d."""
    rng = np.random.default_rng(4)
    wide, params = rng.integers(0, 256, (61, 261, 3), dtype=np.uint8), census_sgm.CensusSGM(17, halvings=halvings)
    cost = census_sgm._coarse_cost(wide[:, :241], wide[:, shift : shift + 241], params, halvings)
    times = 2**halvings
    assert cost.shape == (-(-61 // times), 17, -(-241 // times))
    inside = slice(shift // times + 4, -6)
    assert (cost[:, shift, inside] == 0).all()
    others = np.abs(np.arange(17) - shift) >= times / 4  # a pixel is little of the smallest size's
    assert (cost[:, others, inside] > 0).mean() > (0.98 if halvings == 3 else 0.99)


def test_narrow_pictures_have_smaller_sizes_too():
    """Where the last disparities reach over the rim of the smallest size."""
    rng = np.random.default_rng(5)
    for width in range(9, 19):
        wide = rng.integers(0, 256, (9, width + 3), dtype=np.uint8)
        found = census_sgm.match_census_sgm(wide[:, :-3], wide[:, 3:], census_sgm.CensusSGM(width - 1, halvings=3))
        assert (np.abs(found.left_px[:, 4:-1] - 3) < 1).mean() > 0.5


def test_the_share_of_the_smaller_size_falls_with_contrast_beyond_noise():
    """By the formula: all of it where there is only noise, half of it where contrast is as many times as asked."""
    rng = np.random.default_rng(7)
    params = census_sgm.CensusSGM(noise_grey=2.0, coarse_share=0.8, contrast=4.0)
    noise = rng.normal(100, 2, (200, 200)).astype(np.float32)
    stripes = np.tile(np.float32([92.0, 108.0]), (200, 100))  # deviation 8, a little less in windows of 11 columns
    assert census_sgm._coarse_share(noise, params, 0).mean() == pytest.approx(0.8, rel=0.02)
    assert census_sgm._coarse_share(stripes + noise - 100, params, 0)[9:-9, 9:-9].mean() == pytest.approx(0.4, rel=0.05)
    assert census_sgm._coarse_share(stripes / 2, params, 1)[9:-9, 9:-9].mean() == pytest.approx(0.4, rel=0.05)
    constant = census_sgm.CensusSGM(coarse_share=0.5, contrast=np.inf)
    np.testing.assert_array_equal(census_sgm._coarse_share(stripes, constant, 0), 0.5)


@pytest.mark.parametrize("noise", [0.0, 2.0, 5.0])
def test_a_little_more_noise_moves_the_map_a_little(noise):
    """No cliff: what hangs on the estimated noise does so smoothly."""
    rng = np.random.default_rng(8)
    wide = cv2.GaussianBlur(rng.integers(0, 256, (90, 170, 3), dtype=np.uint8), (0, 0), 1.2) + rng.normal(
        0, noise, (90, 170, 3)
    )
    sides = [wide[:, k : k + 150].clip(0, 255).astype(np.uint8) for k in (0, 9)]
    maps = [
        census_sgm.match_census_sgm(*sides, census_sgm.CensusSGM(16, noise_grey=grey)).left_px
        for grey in np.arange(0.5, 6.1, 0.5)
    ]
    for one, other in itertools.pairwise(maps):
        assert (np.abs(one - other) > 1).mean() < 0.01


def test_strips_tell_the_same_as_one_piece(monkeypatch):
    rng = np.random.default_rng(6)
    wide = cv2.GaussianBlur(rng.integers(0, 256, (401, 140, 3), dtype=np.uint8), (0, 0), 1.0)
    pair, params = (wide[:, :120], wide[:, 7:127]), census_sgm.CensusSGM(16)
    whole = census_sgm.match_census_sgm(*pair, params)
    monkeypatch.setattr(census_sgm, "_STRIP_BYTES", 200 * 120 * 16 * census_sgm._CELL_BYTES)
    strips = census_sgm.match_census_sgm(*pair, params)
    for one, other in zip(vars(whole).values(), vars(strips).values(), strict=True):
        assert one.shape == other.shape == (401, 120)
    assert (np.abs(whole.left_px - strips.left_px) < 0.1).mean() > 0.99


@pytest.mark.parametrize(("census_px", "p2"), [((7, 9), 159), ((9, 7), 159), ((5, 5), 187)])
def test_costs_that_8_bits_do_not_hold_are_refused(census_px, p2):
    """The census' bits or, if they are more, a smaller size's, the colours' 14, and both penalties: up to 255."""
    census_sgm.CensusSGM(census_px=census_px, p2=p2)
    with pytest.raises(ValueError, match="the costs add up to 256, more than 8 bits hold"):
        census_sgm.CensusSGM(census_px=census_px, p2=p2 + 1)


def test_too_little_memory_is_told_with_what_would_fit(monkeypatch):
    monkeypatch.setattr(census_sgm, "_free_bytes", lambda: 1e8)
    pair = [np.zeros((480, 640), np.uint8)] * 2  # 1.5 MB a disparity
    with pytest.raises(
        ValueError, match=r"128 disparities needs 0\.18 GiB of memory, 0\.09 GiB are free: reduce .* to 64"
    ):
        census_sgm.match_census_sgm(*pair)
    monkeypatch.setattr(census_sgm, "_free_bytes", lambda: 1e6)
    with pytest.raises(ValueError, match="take smaller pictures"):
        census_sgm.match_census_sgm(*pair)


@pytest.mark.parametrize("depth", [7, 300])
def test_what_is_read_off_by_loops(depth):
    """Least sums, refined, and the margin; among equals the smallest disparity."""
    rng = np.random.default_rng(3)
    total = rng.integers(0, 500, (4, depth, depth + 5)).astype(np.int16)
    total[0, 2:4, -1] = -1
    before = total.copy()
    disparity, margin = paths.read_off(total)
    np.testing.assert_array_equal(total, before)
    for y, x in np.ndindex(disparity.shape):
        here = total[y, :, x]
        best = int(here.argmin())
        assert abs(disparity[y, x] - best) <= 0.5
        if 0 < best < depth - 1:
            low, least, high = (int(value) for value in here[best - 1 : best + 2])
            expected = best + (low - high) / (2 * max(low - least, high - least, 1))
            assert disparity[y, x] == pytest.approx(expected, abs=1e-4)
        far = [int(value) for d, value in enumerate(here) if abs(d - here.argmin()) > 1]
        assert margin[y, x] == min(far) - here.min()


def test_the_right_view_is_matched_as_a_left_one_would_be():
    """In a mirror the right picture is a left one: its disparities are those of that pair."""
    rng = np.random.default_rng(12)
    wide = cv2.GaussianBlur(rng.integers(0, 256, (40, 90, 3), dtype=np.uint8), (0, 0), 1.0)
    left, right = wide[:, :70].copy(), wide[:, 5:75].copy()
    right[12:28, 20:40] = wide[12:28, 31:51]  # a near thing
    params = census_sgm.CensusSGM(16, halvings=0)  # shares are of the left picture alone
    found = census_sgm.match_census_sgm(left, right, params)
    mirrored = [np.ascontiguousarray(side[:, ::-1]) for side in (right, left)]
    cost = census_sgm._cost(*mirrored, params)
    expected, _ = census_sgm._least(cost, mirrored[0], params, slice(None))
    np.testing.assert_array_equal(found.right_px, expected[:, ::-1])


def test_two_sizes_are_mixed_by_their_shares():
    """Odd sizes too: each pixel of the smaller size is two by two of the larger one's."""
    rng = np.random.default_rng(10)
    cost, coarser = (rng.integers(0, 80, shape).astype(np.uint8) for shape in ((5, 3, 7), (3, 3, 4)))
    share = rng.uniform(0, 0.75, (5, 7)).astype(np.float32)
    whole = coarser.repeat(2, axis=0)[:5].repeat(2, axis=2)[..., :7].astype(int)
    part = np.rint(64 * share).astype(int)[:, None]
    expected = ((64 - part) * cost + part * whole) // 64
    census_sgm._mix(coarser, share, cost)
    np.testing.assert_array_equal(cost, expected)


def test_a_cap_between_two_grey_levels_is_no_more_than_it_says():
    """What is checked to fit into 8 bits fits."""
    left, right = (np.full((6, 9), grey, np.uint8) for grey in (0, 255))
    params = census_sgm.CensusSGM(2, block_size=3, color_cap=1.5, color_weight=40.0)
    assert (census_sgm._fine_cost(left, right, params)[:, 0] == 40).all()


def test_nothing_is_read_beyond_a_picture_of_another_shape():
    with pytest.raises(ValueError, match=r"the picture has shape \(2, 5\), the costs \(H, D, W\) are \(3, 5, 7\)"):
        paths.aggregate(np.zeros((3, 5, 7), np.uint8), np.zeros((2, 5), np.uint8), 20, 90, 5.0)


@pytest.mark.parametrize("wrong", [{"num_disparities": 16.5}, {"p1": 2.5}, {"halvings": 1.0}])
def test_numbers_that_are_not_whole_are_refused(wrong):
    with pytest.raises(ValueError, match="must be a whole number"):
        census_sgm.CensusSGM(**wrong)


def test_numbers_of_numpy_do_not_run_over():
    assert census_sgm.CensusSGM(num_disparities=np.uint8(240)).num_disparities * 2 == 480
