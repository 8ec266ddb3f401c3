"""The printed scale and set-up against each other, and the rectangle around the cube."""

from __future__ import annotations

from dataclasses import replace
from math import atan, cos, degrees, radians, sin, sqrt

import cv2
import numpy as np
import pytest

from stereolib import paper
from stereolib.paper import paper_rig, pixel_cm, published
from stereolib.rig import pose_left_world
from stereolib.virtual import recordings


@pytest.fixture(scope="module")
def rectified():
    return paper_rig().rectify(alpha=0)


@pytest.fixture(scope="module")
def setup():
    return paper.paper_setup()


def test_setup_in_millimetres(setup):
    assert setup == paper.Setup(side_mm=300, distance_mm=700, camera_height_mm=85, constant_rows=53)


def test_the_printed_constant():
    width_px, width_cm = published()["scale.width_px"].value, published()["scale.width_cm"].value
    assert paper.cm_per_px(width_cm, width_px) == pytest.approx(0.1160, abs=5e-5)
    assert paper.cm_per_px(30 * sqrt(2), width_px) == pytest.approx(0.1172, abs=5e-5)


def test_the_constant_belongs_to_another_depth_than_the_near_edge():
    """facts: 84.7 cm at f = 730 px, where the near edge at 0.70 m has 0.096 cm/px."""
    assert paper.depth_of_scale_mm(0.116, 730) == pytest.approx(847, abs=0.5)
    assert paper.cm_per_px_at(700, 730) == pytest.approx(0.096, abs=5e-4)
    assert paper.cm_per_px_at(847, 730) == pytest.approx(0.116, abs=5e-5)


def test_parametric_relation_keeps_invalid_ones():
    np.testing.assert_allclose(paper.cm_per_px_at(np.array([1000, np.nan]), 500), [0.2, np.nan])


def test_fit_finds_the_focal_length_and_weighs_by_depth():
    depth = np.array([400.0, 700.0, 1500.0])
    assert paper.fit_scale(depth, depth / 7637) == pytest.approx(763.7)
    noisy = depth / 10 / np.array([760.0, 750.0, 764.0])
    best = min(np.arange(740, 780, 0.01), key=lambda f: sum((noisy - depth / (10 * f)) ** 2))  # by trying
    # the inverse is what is fitted, so the sum of squares has its least value there
    assert paper.fit_scale(depth, noisy) == pytest.approx(best, abs=0.01)


@pytest.mark.parametrize(
    ("depth", "scales"), [([700], [0.1, 0.2]), ([], []), ([700, np.nan], [0.1, 0.1]), ([700, 800], [0.1, 0])]
)
def test_fit_refuses(depth, scales):
    with pytest.raises(ValueError):
        paper.fit_scale(np.array(depth), np.array(scales))


@pytest.mark.parametrize("values", [(42, 0), (-42, 362), (float("nan"), 362)])
def test_constant_refuses(values):
    with pytest.raises(ValueError, match="positive"):
        paper.cm_per_px(*values)


# ---- where the camera was


def slow_view(rectified, distance, height, pitch, x=0.0, y=0.0, z=0.0):
    """Column, row and disparity of a point by plain trigonometry: baseline level, optical axis pitched up."""
    ahead, up = distance + x, z - height
    depth = ahead * cos(pitch) + up * sin(pitch)
    rise = up * cos(pitch) - ahead * sin(pitch)
    K, f = rectified.P1, rectified.f_px
    return K[0, 2] - f * y / depth, K[1, 2] - f * rise / depth, f * rectified.baseline_mm / depth


def test_pitched_setup_of_the_facts(rectified, setup):
    view = paper.solve_pitch(rectified, setup)
    assert degrees(view.pitch_rad) == pytest.approx(8.27, abs=0.005)
    assert view.constant_rows == pytest.approx(53, abs=1e-6)
    assert view.width_px == pytest.approx(363.9, abs=0.05)
    assert view.disparity_foot_px == pytest.approx(104.5, abs=0.05)
    assert view.disparity_top_px == pytest.approx(98.3, abs=0.05)
    assert view.disparity_foot_px - view.disparity_top_px == pytest.approx(6.2, abs=0.05)
    closed = atan((480 - 53 - rectified.P1[1, 2]) / rectified.f_px) - atan(85 / 700)
    assert view.pitch_rad == pytest.approx(closed, abs=1e-9)


def test_level_setup_of_the_facts(rectified, setup):
    view = paper.solve_camera_height(rectified, setup)
    assert view.camera_height_mm == pytest.approx(190, abs=0.5)
    assert view.width_px == pytest.approx(355, abs=0.5)
    assert view.disparity_foot_px == pytest.approx(view.disparity_top_px, abs=1e-9)
    closed = 700 * (480 - 53 - rectified.P1[1, 2]) / rectified.f_px
    assert view.camera_height_mm == pytest.approx(closed, abs=1e-6)


def test_the_printed_setup_cannot_be_right(rectified, setup):
    """facts: level at 8.5 cm, raw image: 340 px wide, foot at row 315; rectified: the top leaves the image."""
    half = 150 * sqrt(2)
    ground = [[700 + half, half, 0], [700 + half, -half, 0], [700, 0, 0]]
    points = np.c_[ground, np.ones(3)] @ pose_left_world(0, 85).T
    K = paper_rig().left.K
    raw = points[:, :3] @ K.T / points[:, 2:3]
    assert raw[1, 0] - raw[0, 0] == pytest.approx(340, abs=0.6)
    assert raw[2, 1] == pytest.approx(315, abs=0.5)
    printed = paper.cube_view(rectified, setup)
    assert printed.top_row < 0
    assert printed.constant_rows > 160
    assert printed.width_px == pytest.approx(355, abs=0.5)


def test_disparity_at_half_a_metre_needs_more_than_112(rectified, setup):
    """facts: 147 px at 0.5 m with the solved pitch."""
    pitch = paper.solve_pitch(rectified, setup).pitch_rad
    near = paper.cube_view(rectified, replace(setup, distance_mm=500), pitch_rad=pitch)
    assert near.disparity_foot_px == pytest.approx(147, abs=0.5)


def test_below_half_a_metre_the_cube_no_longer_fits(rectified, setup):
    """facts: its near edge then spans more rows than the image has."""
    views = [paper.cube_view(rectified, replace(setup, distance_mm=d), camera_height_mm=150) for d in (500, 470)]
    spans = [view.foot_row - view.top_row for view in views]
    assert spans[0] < rectified.size[1] < spans[1]


@pytest.mark.parametrize(("pitch", "height", "distance"), [(0.1, 85, 700), (-0.2, 300, 900), (0.0, 150, 520)])
def test_cube_view_against_trigonometry(rectified, setup, pitch, height, distance):
    view = paper.cube_view(rectified, replace(setup, distance_mm=distance), pitch_rad=pitch, camera_height_mm=height)
    column, row, disparity = slow_view(rectified, distance, height, pitch)
    assert (view.column, view.foot_row, view.disparity_foot_px) == pytest.approx((column, row, disparity))
    _, row, disparity = slow_view(rectified, distance, height, pitch, z=300)
    assert (view.top_row, view.disparity_top_px) == pytest.approx((row, disparity))
    half = 150 * sqrt(2)
    widths = []
    for z in (0, 300):
        left, right = (slow_view(rectified, distance, height, pitch, half, y, z)[0] for y in (half, -half))
        widths.append(right - left)
    assert view.width_px == pytest.approx(max(widths))
    depths = [(distance + half) * cos(pitch) + (z - height) * sin(pitch) for z in (0, 300)]
    assert view.depth_side_mm == pytest.approx(min(depths))  # the wider of the two is the nearer
    assert view.width_px == pytest.approx(
        10 * sqrt(2) * 30 / (10 * paper.cm_per_px_at(view.depth_side_mm, rectified.f_px))
    )


def test_pose_turns_world_points_into_the_left_camera(rectified):
    """Through the rectification they land where plain trigonometry says."""
    pitch, height = 0.13, 120.0
    point = np.array([800.0, 90.0, 40.0])
    pose = paper.rig_pose(rectified, pitch, height)
    left = pose[:3, :3] @ point + pose[:3, 3]
    u, v, w = rectified.P1[:, :3] @ rectified.R1 @ left
    expected = slow_view(rectified, 800, height, pitch, y=90.0, z=40.0)[:2]
    assert (u / w, v / w) == pytest.approx(expected)
    np.testing.assert_allclose(np.linalg.inv(pose)[:3, 3], [0, 0, height], atol=1e-9)
    np.testing.assert_array_equal(paper.rig_pose(rectified, pitch, height, "left"), pose_left_world(pitch, height))


def test_level_left_camera_gives_a_pose_next_to_it(rectified, setup):
    """The rectification turns the left camera by less than a degree; so much may the answers differ."""
    rig, left = (paper.solve_pitch(rectified, setup, frame) for frame in ("rectified", "left"))
    assert degrees(left.pitch_rad) == pytest.approx(degrees(rig.pitch_rad), abs=0.1)
    assert left.constant_rows == pytest.approx(53, abs=1e-6)
    assert left.pitch_rad != rig.pitch_rad


def test_solvers_refuse_the_impossible(rectified, setup):
    with pytest.raises(ValueError, match="no pitch"):
        paper.solve_pitch(rectified, replace(setup, constant_rows=5000))
    with pytest.raises(ValueError, match="no height"):
        paper.solve_camera_height(rectified, replace(setup, constant_rows=400))
    with pytest.raises(ValueError, match="behind"):
        paper.cube_view(rectified, setup, pitch_rad=radians(100))
    with pytest.raises(ValueError, match="frame"):
        paper.solve_pitch(rectified, setup, "right")


# ---- Canny and the rectangle


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
    plane = pixel_cm._channel(np.rint(shades).astype(np.uint8).repeat(9, axis=0), "saturation")
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


def test_canny_box_looks_only_in_its_region():
    image = picture()
    image[290:355, 10:470:6] = 255  # a textured floor, wider than the object
    assert paper.canny_bounding_box(image).width > 400
    box = paper.canny_bounding_box(image, region=(100, 60, 300, 200))
    assert (box.left, box.width) == pytest.approx((140, 200), abs=2)
    assert paper.canny_bounding_box(image, region=(-20, -20, 500, 280)).left == box.left


@pytest.mark.parametrize(
    ("image", "options", "message"),
    [
        (picture(dtype=np.float32), {}, "uint8"),
        (picture(), {"blur_px": 4}, "blur_px must be odd"),
        (picture(), {"close_px": 0}, "close_px must be odd"),
        (picture(), {"region": (600, 0, 10, 10)}, "region"),
        (np.full((50, 50), 9, np.uint8), {}, "no edge"),
        (picture(), {"channel": "saturation"}, "colour image"),
        (picture(), {"channel": "blue"}, "channel must be"),
    ],
)
def test_canny_box_refuses(image, options, message):
    with pytest.raises(ValueError, match=message):
        paper.canny_bounding_box(image, **options)
