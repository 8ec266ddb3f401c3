"""Pictures that are rectified as light: right in the mean, where those interpolated in grey levels are not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from support.ground import RECT

from stereolib.measurement import Views
from stereolib.measurement.edges import STEP_PX, ParallelLines, locate_edge
from stereolib.measurement.jpeg_blocks import without_blocks
from stereolib.measurement.light import RawPicture, grey_step, light_at
from stereolib.measurement.outline import _POWERS
from stereolib.rig import to_light
from stereolib.virtual import recordings

OFF = STEP_PX * np.arange(-40, 41)
PLACES = np.random.default_rng(3).uniform(100.0, 220.0, 20)
SHIFTS = np.random.default_rng(4).uniform(0.0, 1.0, 20)  # of the rectified picture
SIZE, LEAN = (320, 240), 7.3 / 120  # px for each row: all parts of a pixel are met


def moved(shift_px):
    """Maps that move a picture to the left."""
    K = np.array([[700.0, 0.0, 160.0], [0.0, 700.0, 120.0], [0.0, 0.0, 1.0]])
    to = K.copy()
    to[0, 2] -= shift_px
    return cv2.initUndistortRectifyMap(K, None, np.eye(3), to, SIZE, cv2.CV_16SC2)


def step(place, dark, bright, sigma_px):
    """Grey levels of a picture that gets brighter at a leaning line, as a webcam's lens blurs it."""
    row, column = np.mgrid[: SIZE[1], : SIZE[0]]
    covered = np.clip(column + 0.5 - place - LEAN * (row - 120), 0.0, 1.0)
    light = dark + (bright - dark) * covered
    light = cv2.GaussianBlur(light, (0, 0), sigma_px)
    return np.rint(255 * light ** (1 / 2.2)).astype(np.uint8)


def crossing_px(picture, place, middle):
    """How far to the right of its place a step's light passes a value, in the mean over all rows."""
    across, rows = np.arange(-6.0, 6.25, 0.25), np.linspace(20.0, 220.0, 96)
    x = place + across[:, None] + LEAN * (rows - 120)
    y = np.broadcast_to(rows, x.shape)
    return np.interp(middle, light_at(picture, x.astype(np.float32), y.astype(np.float32)).mean(axis=1), across)


def off_px(picture, place):
    """How far to the right of its place an edge is located, and its standard deviation."""
    ends = np.empty((len(OFF), 2, 2))
    ends[:, 0, 1], ends[:, 1, 1] = 20.0, 220.0
    ends[..., 0] = round(place) + OFF[:, None] + LEAN * (ends[..., 1] - 120)
    lines = ParallelLines(ends, np.zeros((len(OFF), 2)), OFF)
    peak = locate_edge((picture, None), lines, np.ones(len(OFF)), _POWERS)
    return peak.position_px + round(place) - place, peak.std_px


@pytest.mark.parametrize("dark", [0.08, 0.2])
def test_light_is_right_in_the_mean_and_interpolated_grey_levels_move_steps_to_the_bright_side(dark):
    light, grey = [], []
    for place, shift in zip(PLACES, SHIFTS, strict=True):
        raw, maps = step(place, dark, 0.6, 0.6), moved(shift)
        at = place - shift, (dark + 0.6) / 2
        light.append(crossing_px(RawPicture(raw, maps, np.eye(2, 3)), *at))
        grey.append(crossing_px(cv2.remap(raw, *maps, cv2.INTER_LINEAR), *at))
    assert abs(np.mean(light)) < 0.01 < 0.02 < np.mean(grey)


@pytest.mark.parametrize("dark", [0.08, 0.2])
def test_edges_are_within_their_deviation_and_interpolated_grey_levels_move_them_to_the_bright_side(dark):
    """All of the blur is the lens's here, and half of it is taken for the camera's: edges lie on the dark side."""
    light, grey = [], []
    for place, shift in zip(PLACES, SHIFTS, strict=True):
        raw, maps = step(place, dark, 0.6, 0.6), moved(shift)
        light.append(off_px(RawPicture(raw, maps, np.eye(2, 3)), place - shift))
        grey.append(off_px(cv2.remap(raw, *maps, cv2.INTER_LINEAR), place - shift))
    (off, std), (moved_off, _) = np.mean(light, axis=0), np.mean(grey, axis=0)
    assert -1.9 * std < off < 0 and moved_off - off > 0.02


def test_a_part_is_that_of_the_whole_picture_and_rows_are_those_of_the_corrected_one():
    raw, _ = recordings.load_pair("conditions/texture")
    maps, warp = RECT.maps[0], np.array([[1.0, -0.002, 0.4], [0.002, 1.0, 0.7]])
    y, x = np.mgrid[100.0:140.0:0.7, 300.0:360.0:0.9].astype(np.float32)
    whole = cv2.remap(to_light(raw), *maps, cv2.INTER_LINEAR)
    there = ((a * x + b * y + c).astype(np.float32) for a, b, c in warp)
    expected = cv2.remap(whole, *there, cv2.INTER_LINEAR)
    np.testing.assert_allclose(light_at(RawPicture(raw, maps, warp), x, y), expected, atol=2e-3)
    beyond = RawPicture(raw, maps, np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 900.0]]))
    assert light_at(beyond, x, y).shape == (*x.shape, 3)  # rows that are far off ask for no part outside


def test_views_of_raw_pictures_locate_edges_in_them():
    left, right = recordings.load_pair("conditions/texture")
    views = Views.of(left, right, RECT)
    for picture, raw in zip(views.pair.pictures, (left, right), strict=True):
        np.testing.assert_array_equal(picture.grey, without_blocks(raw))  # but for what JPEG added
    y, x = np.mgrid[200.0:230.0, 300.0:340.0].astype(np.float32)
    for picture, rectified in zip(views.pair.pictures, (views.left, views.right), strict=True):
        assert np.abs(light_at(picture, x, y) - light_at(rectified, x, y)).mean() < 0.01


def test_where_neither_picture_shows_an_edge_none_is_found():
    lines = ParallelLines(np.zeros((len(OFF), 2, 2)), np.zeros((len(OFF), 2)), OFF)
    assert locate_edge((None, None), lines, np.ones(len(OFF)), _POWERS) is None


def test_a_grey_level_s_step_is_that_of_the_table():
    """At a grey level it is the step to the next one; the darker, the less, and more than nothing for black."""
    light = to_light(np.arange(256, dtype=np.uint8)[None])[0]
    assert grey_step(float(light[128])) == pytest.approx(light[129] - light[128], rel=1e-6)
    assert 0 < grey_step(0.0) < grey_step(0.5) < grey_step(1.0)
