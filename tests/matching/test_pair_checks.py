"""Pairs that are exchanged or not rectified are told, and no good pair is."""

from __future__ import annotations

import re

import cv2
import numpy as np
import pytest
from support.pairs import rectified_cube, shifted

from stereolib.matching import (
    SGBMParams,
    check_matchable,
    check_rectified,
    check_sides,
    compute_disparity,
    moved_between,
)
from stereolib.rig import to_grey
from stereolib.virtual import recordings


@pytest.fixture(scope="module")
def cube():
    return rectified_cube()


def test_exchanged_pair_is_told(cube):
    with pytest.raises(ValueError, match=r"left and right are exchanged: .* swap the images"):
        compute_disparity(cube[1], cube[0])
    with pytest.raises(ValueError, match="left and right are exchanged"):
        compute_disparity(*shifted(30, (240, 320))[::-1])


@pytest.mark.parametrize("name", [n for n in recordings.pairs() if "conditions" in n or n.endswith(("500", "1000"))])
@pytest.mark.parametrize("num", [16, 112])
def test_good_pairs_never_pass_for_exchanged(name, num):
    """Not even when the search window misses the scene and hardly anything is matched."""
    pair = recordings.rectified().rectify(*recordings.load_pair(name))
    assert compute_disparity(*pair, SGBMParams(num)).shape == (480, 640)


@pytest.mark.parametrize("sigma", [0, 0.5, 3, 20])
def test_noise_never_passes_for_exchanged(sigma):
    rng = np.random.default_rng(16)
    pair = [np.clip(128 + sigma * rng.standard_normal((240, 320)), 0, 255).astype(np.uint8) for _ in "lr"]
    found = compute_disparity(*pair)
    if sigma:
        assert np.isnan(found[:, 128:]).mean() > 0.6  # so that the sides are looked at
    else:
        assert (found[:, 128:] == 0).all()  # one grey matches itself where it is


@pytest.mark.parametrize("name", ["conditions/texture", "conditions/glare", "series/coarse_1000", "series/fine_500"])
def test_rows_that_do_not_agree_are_refused_with_their_rms(name):
    pair = recordings.rectified().rectify(*recordings.load_pair(name))
    assert check_rectified(*pair) < 0.6
    lower = cv2.warpAffine(pair[1], np.float32([[1, 0, 0], [0, 1, 3]]), (640, 480))
    with pytest.raises(ValueError, match=r"by 3\.\d px rms \(median \+(2\.9|3\.0|3\.1) px\), at most 1 px"):
        check_rectified(pair[0], lower)
    with pytest.raises(ValueError, match=r"not rectified: .* by 2\.\d px rms"):
        check_rectified(*recordings.load_pair(name))
    with pytest.raises(ValueError, match="exchanged"):
        check_rectified(*pair[::-1])


def test_half_a_pixel_of_offset_is_measured_and_allowed():
    pair = recordings.rectified().rectify(*recordings.load_pair("series/fine_700"))
    lower = cv2.warpAffine(pair[1], np.float32([[1, 0, 0], [0, 1, 0.6]]), (640, 480))
    assert 0.5 < check_rectified(pair[0], lower) < 0.9


@pytest.mark.parametrize("sigma", [0, 1, 20, 60])
def test_where_nothing_matches_nothing_is_said_of_the_rows(sigma):
    rng = np.random.default_rng(3)
    pair = [np.clip(128 + sigma * rng.standard_normal((240, 320)), 0, 255).astype(np.uint8) for _ in "lr"]
    assert np.isnan(check_rectified(*pair))


def test_pictures_that_show_nothing_are_named_and_dim_ones_are_not(cube):
    rng, left = np.random.default_rng(4), cube[0]
    dark, white = (np.clip(rng.integers(low, low + 5, left.shape), 0, 255).astype(np.uint8) for low in (0, 251))
    for bad, said in ((dark, r"dark\.png has grey values from 0 to 4 alone"), (white, r"from 25\d to 255 alone")):
        with pytest.raises(ValueError, match=said + ": there is nothing to match; take it again"):
            check_matchable(left, bad, ("left.png", "dark.png"))
    with pytest.raises(ValueError, match=r"^a has one grey value, 0 and b has one grey value, 0: "):
        check_matchable(left * 0, left * 0, ("a", "b"))
    check_matchable(*(np.asarray(image // 8) for image in cube))


def test_an_exchanged_pair_of_unlike_lenses_is_told_by_its_own_rectification():
    """Rectified as the other camera's, rows differ by 7 px, so that neither way round matches."""
    raw = [to_grey(image) for image in recordings.load_pair("room/3")]
    wrong, right = recordings.rectified().rectify(*raw[::-1]), recordings.rectified().rectify(*raw)
    with pytest.raises(ValueError, match="left and right are exchanged"):
        check_sides(*wrong, right)
    check_sides(*right, wrong)
    with pytest.raises(ValueError, match=r"not rectified.*as if left and right were exchanged"):
        check_rectified(*wrong)


@pytest.mark.parametrize("name", [name for name in recordings.pairs() if name.endswith(("e", "700", "3"))])
def test_pairs_of_one_moment_say_nothing(name):
    assert moved_between(*recordings.rectified().rectify(*recordings.load_pair(name))) == ""


@pytest.mark.parametrize(("down_px", "which"), [(5, "low"), (-12, "high")])
def test_a_part_that_moved_is_found_where_it_is(cube, down_px, which):
    later = cube[1].copy()
    later[200 + down_px : 330 + down_px, 200:330] = cube[1][200:330, 200:330]
    said = moved_between(cube[0], later)
    assert f"lie {abs(down_px)} px too {which} in right" in said
    column, row = map(int, re.search(r"column (\d+) and row (\d+)", said).groups())
    assert 200 < column < 330 + 180 and 200 < row < 330  # in the left picture, so up to a disparity farther right


def test_exchanged_pictures_are_told_from_a_moved_rig_by_what_they_were_before():
    """Exchanged, each picture is rectified as the other camera's: then not even the rows agree."""
    rig, raw = recordings.rectified(), recordings.load_pair("conditions/texture")
    wrong = rig.rectify(*raw[::-1])
    lower = cv2.warpAffine(wrong[1], np.float32([[1, 0, 0], [0, 1, 4]]), (640, 480))
    with pytest.raises(ValueError, match=r"not rectified: .*as if left and right were exchanged"):
        check_rectified(wrong[0], lower)
    with pytest.raises(ValueError, match="left and right are exchanged"):
        check_rectified(wrong[0], lower, exchanged=lambda: rig.rectify(*raw))
