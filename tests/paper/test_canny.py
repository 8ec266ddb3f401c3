"""Canny's edges and the rectangle around the cube."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from stereolib import paper
from stereolib.paper import canny, paper_rig
from stereolib.virtual import recordings


@pytest.fixture(scope="module")
def rectified():
    return paper_rig().rectify(alpha=0)


@pytest.fixture(scope="module")
def setup():
    return paper.paper_setup()


def picture(left=140, top=90, width=200, height=120, dtype=np.uint8):
    image = np.full((360, 480), 40, dtype)
    image[top : top + height, left : left + width] = 180
    return image


def test_canny_box_of_a_known_rectangle():
    box = paper.canny_bounding_box(picture())
    assert abs(box.left - 140) <= 1 and abs(box.top - 90) <= 1
    assert abs(box.left + box.width - 340) <= 1 and abs(box.top + box.height - 210) <= 1


def test_canny_box_of_a_tilted_cube_with_colour_and_noise():
    """A diamond's corners, through the noise of a webcam: two pixels each."""
    image = np.full((360, 480, 3), 60, np.uint8)
    corners = np.array([[240, 60], [400, 180], [240, 300], [80, 180]], np.int32)
    cv2.fillPoly(image, [corners], (200, 170, 150))
    image = np.clip(image + np.random.default_rng(1).normal(0, 4, image.shape), 0, 255).astype(np.uint8)
    box = paper.canny_bounding_box(image)
    assert (box.left, box.top) == pytest.approx((80, 60), abs=2)
    assert (box.width, box.height) == pytest.approx((321, 241), abs=4)


def test_saturation_sees_the_outline_through_a_pattern():
    """Light and dark blotches on object and floor: brightness is full of edges, saturation has one outline."""
    rng = np.random.default_rng(2)
    blotches = cv2.GaussianBlur(rng.normal(0, 1, (360, 480)).astype(np.float32), (0, 0), 4)
    shade = np.clip(0.6 + 2.5 * blotches, 0.2, 1.0)[..., None]
    colour = np.full((360, 480, 3), 200.0)
    colour[90:210, 140:340] = (110, 160, 210)
    image = (colour * shade).astype(np.uint8)
    box = paper.canny_bounding_box(image, channel="saturation")
    assert (box.left, box.top, box.width, box.height) == pytest.approx((140, 90, 200, 120), abs=3)
    assert abs(paper.canny_bounding_box(image).width - 200) > 50


def test_saturation_does_not_see_brightness():
    """One paint in light and shade has one saturation; twice the colour contrast gives it a step."""
    shades = np.arange(80, 256, 8)[None, :, None] / 255 * np.array([120.0, 150, 200])
    plane = canny._channel(np.rint(shades).astype(np.uint8).repeat(9, axis=0), "saturation")
    assert np.ptp(plane.astype(int)) <= 26  # 8-bit rounding of the darkest, times 4
    step = np.full((60, 80, 3), (150, 150, 160), np.uint8)
    step[:, 40:] = (110, 150, 160)
    columns = np.flatnonzero(paper.canny_edges(step, channel="saturation").any(axis=0))
    assert columns.tolist() in ([39], [40])


@pytest.mark.parametrize("distance", recordings.DISTANCES_MM)
def test_width_in_the_recordings(rectified, setup, distance):
    """The rectangle on the virtual rig's pictures against the projected corners: one pixel each end."""
    pitch = paper.solve_pitch(rectified, setup).pitch_rad
    view = paper.cube_view(rectified, replace(setup, distance_mm=distance), pitch_rad=pitch)
    left, _ = rectified.rectify(*recordings.load_pair(f"series/medium_{distance}"))
    box = paper.canny_bounding_box(left, channel="saturation", blur_px=13)
    assert box.width - 1 == pytest.approx(view.width_px, abs=2)
    assert box.top == pytest.approx(view.top_row, abs=2)
    assert box.top + box.height - 1 == pytest.approx(view.foot_row, abs=2)


@pytest.mark.parametrize(
    ("image", "options", "message"),
    [
        (picture(dtype=np.float32), {}, "uint8"),
        (picture(), {"blur_px": 4}, "blur_px must be odd"),
        (np.full((50, 50), 9, np.uint8), {}, "no edge"),
        (picture(), {"channel": "saturation"}, "colour image"),
        (picture(), {"channel": "blue"}, "channel must be"),
    ],
)
def test_canny_box_refuses(image, options, message):
    with pytest.raises(ValueError, match=message):
        paper.canny_bounding_box(image, **options)
