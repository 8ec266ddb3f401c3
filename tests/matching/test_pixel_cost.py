"""One pixel's costs against OpenCV, which shows only the disparity that it makes of them."""

import numpy as np
import pytest

from stereolib.matching import PixelCost, SGBMParams, pixel_cost
from stereolib.matching.sgbm import STEPS_PER_PX, match_in_steps
from stereolib.rig import to_grey
from stereolib.virtual import recordings

UNCHECKED = {"uniqueness_ratio": 0, "speckle_window_size": 0, "disp12_max_diff": 1000}


@pytest.fixture(scope="module")
def pair():
    return tuple(map(to_grey, recordings.rectified().rectify(*recordings.load_pair("conditions/texture"))))


def in_steps(cost: PixelCost) -> int:
    """What OpenCV makes of the sums: a parabola through the least and its neighbours, in sixteenths, rounded down."""
    k, d = int(cost.summed.argmin()), cost.disparities_px
    if not 0 < k < len(d) - 1:
        return STEPS_PER_PX * int(d[k])
    low, here, high = (int(s) for s in cost.summed[k - 1 : k + 2])
    curved = max(low + high - 2 * here, 1)
    return STEPS_PER_PX * int(d[k]) + int(((low - high) * STEPS_PER_PX + curved) / (2 * curved))


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"mode": "hh"},
        {"block_size": 1, "p1": 1, "p2": 2},
        {"pre_filter_cap": 10, "block_size": 3},
        {"min_disparity": -16, "block_size": 3},
        {"min_disparity": 20, "block_size": 7, "num_disparities": 112},
    ],
)
def test_same_disparity_as_opencv_to_a_sixteenth(pair, fields):
    params = SGBMParams(**UNCHECKED, **fields)
    steps, rng = match_in_steps(*pair, params), np.random.default_rng(1)
    drawn = np.column_stack([rng.integers(150, 619, 6), rng.integers(1, 479, 6)])
    for column, row in drawn[[0, 1, 4]]:  # these notice every wrong step that all six do
        around = [(int(column) + a, int(row) + b) for a in (-1, 0, 1) for b in (-1, 0, 1)]
        nine = [in_steps(pixel_cost(*pair, pixel, params)) for pixel in around]
        assert np.median(nine) == steps[row, column]  # OpenCV ends with a 3 x 3 median


def test_matching_cost_is_that_of_the_blocks_alone(pair):
    left = pair[0]
    cost = pixel_cost(left, np.roll(left, -37, axis=1), (320, 240), SGBMParams())
    assert cost.matching[37] == 0
    assert cost.best_px == 37
    assert np.partition(cost.matching, 1)[1] > 0


@pytest.mark.parametrize(
    ("pixel", "fields"), [((100, 5), {}), ((640, 5), {}), ((300, -1), {}), ((300, 5), {"mode": "3way"})]
)
def test_refuses(pair, pixel, fields):
    with pytest.raises(ValueError, match="choose"):
        pixel_cost(*pair, pixel, SGBMParams(**fields))
