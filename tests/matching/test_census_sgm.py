"""Semi-global matching against loops."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from stereolib.matching import census_sgm, paths


def small_pair(shape=(7, 12), seed=0):
    rng = np.random.default_rng(seed)
    return (rng.integers(0, 256, (*shape, 3), dtype=np.uint8) for _ in range(2))


def test_aggregation_is_hirschmuellers():
    """Eight paths by recursion, pixel by pixel, straight from the equation."""
    rng = np.random.default_rng(1)
    cost = rng.integers(0, 60, (6, 5, 9)).astype(np.uint8)
    grey = rng.integers(0, 256, (6, 9), dtype=np.uint8)
    height, count, width = cost.shape
    expected = np.zeros(cost.shape, int)
    for dy, dx in [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if (a, b) != (0, 0)]:
        path = {}
        for y in range(height) if dy >= 0 else range(height - 1, -1, -1):
            for x in range(width) if dx >= 0 else range(width - 1, -1, -1):
                q = (y - dy, x - dx)
                if q not in path:
                    path[y, x] = cost[y, :, x].astype(int)
                    continue
                before, p2 = path[q], max(40 / (1 + abs(int(grey[y, x]) - int(grey[q])) / 30), 8)
                path[y, x] = np.array([
                    cost[y, d, x] - before.min()
                    + min([before[d], before.min() + int(p2),
                           *(before[e] + 7 for e in (d - 1, d + 1) if 0 <= e < count)])
                    for d in range(count)
                ])  # fmt: skip
        for (y, x), values in path.items():
            expected[y, :, x] += values
    np.testing.assert_array_equal(paths.aggregate(cost, grey, 7, 40, 30.0), expected)


def test_census_tells_darker_neighbours():
    grey = np.array([[5, 1, 9], [2, 5, 7], [5, 8, 0]], np.uint8)
    assert (
        bin(int(census_sgm.census_transform(grey, (3, 3))[1, 1])) == "0b1010001"
    )  # row by row: 5<5 no, 1 yes, 9 no, 2 yes, ... 0 yes
    np.testing.assert_array_equal(
        census_sgm.census_transform(grey, (3, 3)), census_sgm.census_transform(20 + 3 * grey, (3, 3))
    )


def test_both_views_of_a_shifted_picture():
    rng = np.random.default_rng(2)
    wide = rng.integers(0, 256, (30, 90, 3), dtype=np.uint8)
    found = census_sgm.match_census_sgm(wide[:, :80], wide[:, 6:86], census_sgm.CensusSGM(16))
    assert np.abs(found.left_px[:, 12:] - 6).max() < 0.5
    assert np.abs(found.right_px[:, :60] - 6).max() < 0.5
    assert found.margin[:, 12:].min() > 0


@pytest.mark.parametrize("shift", [5, 6])
def test_the_half_size_costs_what_the_moved_picture_does(shift):
    """Odd disparities as well as even ones: a picture that is moved by d costs nothing at d."""
    rng = np.random.default_rng(4)
    wide = rng.integers(0, 256, (31, 181, 3), dtype=np.uint8)
    cost = census_sgm._coarse_cost(wide[:, :161], wide[:, shift : shift + 161], 16)
    assert cost.shape == (16, 16, 81)
    assert (cost[:, shift, 8:-6] == 0).all()
    assert (np.delete(cost, shift, axis=1)[:, :, 8:-6] > 0).mean() > 0.99


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


@pytest.mark.parametrize(("census_px", "p2"), [((7, 9), 153), ((9, 7), 153), ((5, 5), 187)])
def test_costs_that_8_bits_do_not_hold_are_refused(census_px, p2):
    """The census' bits or, if they are more, the half size's, the colours' 20, and both penalties: up to 255."""
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
    """Both views' least sums, refined, and the margin; among equals the smallest disparity."""
    rng = np.random.default_rng(3)
    total = rng.integers(0, 500, (4, depth, depth + 5)).astype(np.int16)
    total[0, 2:4, -1] = -1
    left, right, margin = paths.read_off(total)
    for y, x in np.ndindex(left.shape):
        here = total[y, :, x]
        seen = [total[y, d, x + d] for d in range(depth) if x + d < total.shape[2]]
        for sums, found in ((here, left[y, x]), (np.array(seen), right[y, x])):
            best = int(sums.argmin())
            assert abs(found - best) <= 0.5
            if 0 < best < len(sums) - 1:
                low, least, high = (int(value) for value in sums[best - 1 : best + 2])
                expected = best + (low - high) / (2 * max(low - least, high - least, 1))
                assert found == pytest.approx(expected, abs=1e-4)
        far = [int(value) for d, value in enumerate(here) if abs(d - here.argmin()) > 1]
        assert margin[y, x] == min(far) - here.min()
