"""Floor, objects on it and their heights: against the virtual rig's truth, and against planes computed here."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from support.corners import corner_set

from stereolib.calibration import fit_rig, rectified_std, rig_covariance
from stereolib.matching import SGBMParams, compute_disparity
from stereolib.measurement import (
    CannotMeasure,
    Floor,
    Uncertainty,
    find_objects,
    fit_floor,
    floor_from_pose,
    measure_height,
    scaled_pixels,
    vertical_edge,
)
from stereolib.measurement.object_height import height_of_nearest
from stereolib.measurement.plane_alignment import AlignedPair, align
from stereolib.paper import rig_pose
from stereolib.rig import to_light
from stereolib.virtual import Scene, Webcam, box_on_floor, cube_scene, recordings, render_pair, room, truth

RECT = recordings.rectified()
PARAMS = SGBMParams(160, mode="3way")
GRID = np.meshgrid(np.arange(640.0), np.arange(480.0))


def rng():
    return np.random.default_rng(0)


def matched(pair):
    left, right = RECT.rectify(*pair)
    return left, right, compute_disparity(left, right, PARAMS, whole=True)


@cache
def recorded(name):
    return matched(recordings.load_pair(name))


def photographed(scene, pose, seed):
    """What the webcams send of a scene: noise, blur, JPEG."""
    pictures = render_pair(scene, RECT.rig, pose, samples=1, light_samples=1)
    webcam = Webcam()
    return matched([webcam.shoot(p, np.random.default_rng([seed, k])) for k, p in enumerate(pictures)])


@pytest.mark.parametrize("name", ["pitched", "level"])
def test_floor_of_a_pose_is_the_truths_floor(name):
    pose, scene = recordings.setup(name), Scene((room(),))
    floor, seen = floor_from_pose(RECT, pose), truth(scene, RECT, pose)
    on = seen.disparity_px > 40  # the walls are farther
    assert on.sum() > 20_000
    assert np.abs(floor.disparity(*GRID) - seen.disparity_px)[on].max() < 1e-3
    assert floor.camera_height_mm == pytest.approx(np.linalg.inv(pose)[2, 3])
    assert floor.axes @ floor.axes.T == pytest.approx(np.eye(3))
    assert floor.axes[2] == pytest.approx(-floor.down)


def test_floor_angles_are_the_poses():
    floor = floor_from_pose(RECT, rig_pose(RECT, -0.2, 400.0))
    assert (floor.camera_height_mm, floor.pitch_rad, floor.roll_rad) == pytest.approx((400.0, -0.2, 0.0), abs=1e-9)
    lean = np.array([[np.cos(0.05), np.sin(0.05), 0], [-np.sin(0.05), np.cos(0.05), 0], [0, 0, 1]])
    K = RECT.P1[:, :3]
    plane = RECT.f_px * RECT.baseline_mm * np.linalg.inv(K).T @ lean @ [0, 1, 0] / 300.0
    assert Floor(RECT, plane, np.zeros((3, 3))).roll_rad == pytest.approx(0.05)


@pytest.mark.parametrize("name", ["pitched", "level"])
def test_floor_from_perfect_disparity(name):
    """Cube, walls and shadowed half of the map are not floor; noise averages out."""
    pose = recordings.setup(name)
    disparity = truth(cube_scene(), RECT, pose).disparity_px
    disparity = disparity + np.random.default_rng(1).normal(0, 0.2, disparity.shape)
    disparity[:, :150] = np.nan
    found, true = fit_floor(disparity, RECT, rng=rng()), floor_from_pose(RECT, pose)
    assert found.camera_height_mm == pytest.approx(true.camera_height_mm, rel=0.004)
    assert found.pitch_rad == pytest.approx(true.pitch_rad, abs=0.0008)
    again = fit_floor(disparity, RECT, rng=np.random.default_rng(99))
    assert np.abs(again.disparity(320.0, 470.0) - found.disparity(320.0, 470.0)) < 0.02


def test_covariance_of_the_floor_is_that_of_many_draws():
    """Blocks of 8 x 8 pixels err together, as matches do: the deviations stated are those found."""
    true = floor_from_pose(RECT, rig_pose(RECT, -0.2, 400.0))
    flat, draw = true.disparity(*GRID), np.random.default_rng(2)
    found = []
    for _ in range(60):
        error = np.kron(draw.normal(0, 0.3, (60, 80)), np.ones((8, 8)))
        found.append(fit_floor(np.where(flat > 20, flat + error, np.nan), RECT, rng=rng()))
    pixel = np.array([320.0, 400.0, 1.0])
    spread = np.std([pixel @ floor.plane for floor in found])
    stated = np.sqrt(np.mean([pixel @ floor.covariance @ pixel for floor in found]))
    assert stated == pytest.approx(spread, rel=0.35)


def test_alignment_finds_a_slanted_plane_to_a_hundredth():
    """A right picture made from the left by an exact plane, gain and noise; the start is 1.5 px off."""
    draw = np.random.default_rng(3)
    texture = cv2.GaussianBlur(draw.normal(0, 1, (480, 640)), (0, 0), 2.0)
    left = 128 + 40 * texture / texture.std()
    u, v = GRID
    plane = np.array([0.02, 0.30, 20.0])
    # Pixel x of the right picture shows column u with u - (a u + b v + c) = x.
    source = (u + plane[1] * v + plane[2]) / (1 - plane[0])
    right = 0.9 * cv2.remap(left, source.astype(np.float32), v.astype(np.float32), cv2.INTER_CUBIC)
    pair = [(image + draw.normal(0, 2, image.shape)).clip(0, 255).astype(np.uint8) for image in (left, right)]
    some = np.s_[250:450:2, 250:600:2]
    uu, vv = u[some].ravel(), v[some].ravel()
    x = np.stack([uu, vv, np.ones_like(uu)], axis=1)
    fit = align(AlignedPair.of(*pair), uu, vv, x, plane + np.array([0, 0, 1.5]))
    assert np.abs(x @ (fit.parameters - plane)).max() < 0.06
    assert abs(np.mean(x @ (fit.parameters - plane))) < 0.02
    assert fit.agreement > 0.9
    blank = np.full((480, 640), 90, np.uint8)
    with pytest.raises(ValueError, match="no texture"):
        align(AlignedPair.of(blank, blank), uu, vv, x, plane)


SERIES = [f"series/{kind}_{mm}" for kind in recordings.TEXTURES_MM for mm in recordings.DISTANCES_MM[::2]]


def test_heights_of_the_recorded_cubes():
    """Nine recordings of the 30 cm cube: each within 0.3 %, near edge where it stands, and 95 % intervals that hold."""
    scores = []
    for name in SERIES:
        found = height_of_nearest(*recorded(name), RECT, rng=rng())
        assert found.height_mm == pytest.approx(300, rel=0.003)
        assert found.near_mm == pytest.approx([float(name.split("_")[1]), 0], abs=1.5)
        assert len(found.faces) == 2 and 0.05 < found.height_std_mm < 1
        scores.append((found.height_mm - 300) / found.height_std_mm)
    assert np.abs(scores).max() < 2.6 and np.median(np.abs(scores)) < 1.96


def test_near_edge_in_the_picture():
    """Foot and top of the near edge, in pixels: as the cube projects."""
    left, right, disparity = recorded("conditions/level")
    found = height_of_nearest(left, right, disparity, RECT, rng=rng())
    pose = recordings.setup("level")
    ends = np.array([[700.0, 0, 0], [700, 0, 300]]) @ (RECT.R1 @ pose[:3, :3]).T + RECT.R1 @ pose[:3, 3]
    pixels = ends[:, :2] / ends[:, 2:] * RECT.f_px + RECT.P1[:2, 2]
    assert np.stack([found.foot_px, found.top_px]) == pytest.approx(pixels, abs=0.6)
    assert found.cut == ()


def test_from_disparity_alone_it_is_coarser_and_says_so():
    left, right, disparity = recorded("conditions/texture")
    floor = fit_floor(disparity, RECT, rng=rng())
    (cube,) = find_objects(disparity, floor)
    found = measure_height(left, right, floor, cube)
    aligned = height_of_nearest(left, right, disparity, RECT, rng=rng())
    assert found.height_mm == pytest.approx(300, rel=0.01)
    assert found.height_std_mm > 2 * aligned.height_std_mm
    assert abs(found.height_mm - 300) < 2.6 * found.height_std_mm


#: size, distance, yaw in degrees, lateral; camera
BOXES = (
    ((220.0, 330.0, 130.0), 620.0, 20.0, 60.0, (-0.25, 450.0)),  # seen from above, top face visible
    ((150.0, 250.0, 390.0), 1150.0, 65.0, -100.0, (0.12, 90.0)),
    ((380.0, 120.0, 105.0), 900.0, 2.0, 40.0, (0.0, 190.0)),  # one face
)


@pytest.mark.parametrize("case", BOXES, ids=["high", "far", "one-face"])
def test_heights_of_other_boxes_and_cameras(case):
    size, distance, yaw, lateral, (pitch, camera_height) = case
    scene = cube_scene(distance, size_mm=size, yaw_rad=np.radians(yaw), lateral_mm=lateral)
    found = height_of_nearest(*photographed(scene, rig_pose(RECT, pitch, camera_height), 1), RECT, rng=rng())
    assert found.height_mm == pytest.approx(size[2], rel=0.01)
    assert abs(found.height_mm - size[2]) < 3 * found.height_std_mm < 0.02 * size[2]


def test_what_makes_up_the_deviation():
    """A baseline known to 1 % makes heights known to 1 %; a camera height known to 2 mm adds 2 mm."""
    left, right, disparity = recorded("conditions/level")
    pair = AlignedPair.of(left, right)
    floor = fit_floor(disparity, RECT, rng=rng(), pair=pair)
    (cube,) = find_objects(disparity, floor)
    how = Uncertainty(baseline_mm=0.01 * RECT.baseline_mm)
    found = measure_height(left, right, floor, cube, pair=pair, uncertainty=how)
    assert found.parts_mm["calibration"] == pytest.approx(3.0, rel=0.01)
    assert found.height_std_mm == pytest.approx(np.sqrt(sum(part**2 for part in found.parts_mm.values())))
    given = floor_from_pose(RECT, recordings.setup("level"), height_std_mm=2.0)
    posed = measure_height(left, right, given, cube, pair=pair)
    assert posed.height_mm == pytest.approx(300, abs=1.5)
    assert posed.parts_mm["floor"] == pytest.approx(2.0, rel=0.02)  # what the camera is lower, the top is lower


def test_deviation_is_the_derivative():
    """The floor's share against a numerical derivative of the whole measurement."""
    left, right, disparity = recorded("conditions/level")
    pair = AlignedPair.of(left, right)
    floor = floor_from_pose(RECT, recordings.setup("level"), pitch_std_rad=0.001)
    (cube,) = find_objects(disparity, floor)
    stated = measure_height(left, right, floor, cube, pair=pair).parts_mm["floor"]
    turned = []
    for sign in (-1, 1):
        pitch = float(sign * 0.001)
        K, axes = RECT.P1[:, :3], floor.axes
        down = np.cos(pitch) * floor.down + np.sin(pitch) * axes[0]
        plane = RECT.f_px * RECT.baseline_mm * np.linalg.inv(K).T @ down / floor.camera_height_mm
        turned.append(measure_height(left, right, Floor(RECT, plane, np.zeros((3, 3))), cube, pair=pair).height_mm)
    assert stated == pytest.approx(abs(turned[1] - turned[0]) / 2, rel=0.15)


@pytest.mark.parametrize("name", ["texture", "level"])
def test_a_wrong_focal_length_moves_the_object_and_hardly_its_height(name):
    """Measured again with all depths 1 % longer, against the calibration's share for 1 %."""
    left, right, disparity = recorded(f"conditions/{name}")
    pair = AlignedPair.of(left, right)
    (cube,) = find_objects(disparity, fit_floor(disparity, RECT, rng=rng(), pair=pair))
    longer = np.array([[1.01, 1, 1, 1.01], [1, 1.01, 1, 1], [1, 1, 1, 1]])
    found = []
    for rectified in (RECT, replace(RECT, P1=RECT.P1 * longer, P2=RECT.P2 * longer)):
        floor = fit_floor(disparity, rectified, rng=rng(), pair=pair)
        how = Uncertainty(f_px=0.01 * RECT.f_px)
        found.append(measure_height(left, right, floor, cube, pair=pair, uncertainty=how))
    assert found[1].near_mm[0] / found[0].near_mm[0] == pytest.approx(1.01, abs=0.0015)
    stated = found[0].parts_mm["calibration"]
    assert stated == pytest.approx(
        3.0 * np.sin(fit_floor(disparity, RECT, rng=rng(), pair=pair).pitch_rad) ** 2, rel=0.1
    )
    assert abs(found[1].height_mm - found[0].height_mm) < stated + 0.15


def test_a_calibration_s_errors_are_those_of_other_calibrations():
    """The cube measured by eight rigs, each calibrated from other corners: the scatter is what one of them states."""
    left, right = recordings.load_pair("conditions/level")
    heights, stated = [], []
    for k in range(8):
        fitted = fit_rig(corner_set(np.random.default_rng([k, 5]), rig=RECT.rig), RECT.rig)
        rectified = fitted.rig.rectify(0.0)
        pair = rectified.rectify(left, right)
        how = Uncertainty(**rectified_std(rectified, rig_covariance(fitted)))
        disparity = compute_disparity(*pair, PARAMS, whole=True)
        found = height_of_nearest(*pair, disparity, rectified, rng=rng(), uncertainty=how)
        heights.append(found.height_mm)
        stated.append(found.parts_mm["calibration"])
    assert np.std(heights, ddof=1) == pytest.approx(np.mean(stated), rel=0.7)
    assert 0.02 < np.mean(stated) < 0.1


def test_a_small_floor_is_found_whatever_pixels_are_drawn():
    """At 0.5 m the cube leaves a strip of floor: one pixel in twelve."""
    left, right, disparity = recorded("series/medium_500")
    pair = AlignedPair.of(left, right)
    heights = [fit_floor(disparity, RECT, rng=np.random.default_rng(k), pair=pair).camera_height_mm for k in range(12)]
    assert heights == pytest.approx([85.0] * 12, abs=0.8)


def test_objects_are_separated_and_sorted():
    boxes = (
        box_on_floor((200.0, 200.0, 250.0), 1100.0, 200.0, 0.4),
        box_on_floor((200.0, 200.0, 150.0), 800.0, -150.0, 0.4),
    )
    pose = recordings.setup("level")
    seen = truth(Scene((room(), *boxes)), RECT, pose)
    found = find_objects(seen.disparity_px, floor_from_pose(RECT, pose))
    assert len(found) == 2  # not the walls, not the floor
    for region, box, height in zip(found, (2, 1), (150, 250), strict=True):
        assert (seen.box[region.v.astype(int), region.u.astype(int)] == box).all()
        assert region.height_mm.max() == pytest.approx(height, abs=3)
        mine = np.argwhere(seen.box == box)
        assert np.abs(np.array(region.bounds) - [*mine.min(0)[::-1], *mine.max(0)[::-1]])[[0, 1, 2]].max() <= 6
    assert [r.position_mm[1] > 0 for r in found] == [False, True]


def test_outer_edges_to_a_fraction_of_a_pixel():
    """The cube's side corners, looked for from 5 px outside: the picture finds them to 0.3 px."""
    left, right, disparity = recorded("conditions/level")
    floor = fit_floor(disparity, RECT, rng=rng(), pair=AlignedPair.of(left, right))
    half = 300 / np.sqrt(2)
    for side in (-1, 1):
        true = np.arctan2(side * half, 700 + half)
        beside = true + side * 5 / RECT.f_px
        place = np.hypot(half, 700 + half) * np.array([np.cos(beside), np.sin(beside)])
        edge = vertical_edge((to_light(left), to_light(right)), floor, place, (30.0, 270.0), prior_std_px=5.0)
        # The rectified camera looks along the world's x: bearings agree.
        assert (edge.position - true) * RECT.f_px == pytest.approx(0, abs=0.35)
        assert abs(edge.position - true) < 3 * edge.std < 3 / RECT.f_px
    light = (to_light(left), to_light(right))
    assert vertical_edge(light, floor, np.array([700.0, 900.0]), (30.0, 270.0), prior_std_px=5.0) is None


@pytest.mark.parametrize(("name", "reason"), [("glare", "no floor"), ("poor_light", "no floor"), ("plain", "no")])
def test_scenes_that_cannot_be_measured_are_refused(name, reason):
    with pytest.raises(CannotMeasure, match=reason) as caught:
        height_of_nearest(*recorded(f"conditions/{name}"), RECT, rng=rng())
    assert caught.value.reason in {"no floor", "no texture", "no top edge", "no object"}


def test_a_top_outside_the_picture_is_refused():
    pose = recordings.setup("pitched")
    disparity = truth(cube_scene(560.0, size_mm=(300.0, 300.0, 400.0)), RECT, pose).disparity_px
    floor = floor_from_pose(RECT, pose)
    blank = np.zeros((480, 640), np.uint8)
    with pytest.raises(CannotMeasure, match="cut by the frame") as caught:
        measure_height(blank, blank, floor, find_objects(disparity, floor)[0])
    assert caught.value.reason == "cut by the frame"


def test_an_object_without_matches_is_refused():
    pose = recordings.setup("level")
    seen = truth(cube_scene(), RECT, pose)
    disparity, floor = seen.disparity_px.copy(), floor_from_pose(RECT, pose)
    disparity[(seen.box == 1) & (np.random.default_rng(4).random((480, 640)) > 0.02)] = np.nan
    assert find_objects(disparity, floor) == []  # specks are no object
    blank = np.zeros((480, 640), np.uint8)
    empty = truth(Scene((room(),)), RECT, pose).disparity_px
    with pytest.raises(CannotMeasure, match=r"no object|no texture|no floor"):
        height_of_nearest(blank, blank, empty, RECT, rng=rng())


def test_a_wall_is_no_floor():
    """A camera that sees a wall and nothing else."""
    disparity = np.full((480, 640), 60.0) + np.random.default_rng(5).normal(0, 0.2, (480, 640))
    with pytest.raises(CannotMeasure, match="no floor"):
        fit_floor(disparity, RECT, rng=rng())


def test_bad_input():
    floor = floor_from_pose(RECT, recordings.setup("level"))
    with pytest.raises(ValueError, match=r"shape \(240, 320\)"):
        fit_floor(np.ones((240, 320)), RECT, rng=rng())
    with pytest.raises(ValueError, match="float pixels"):
        find_objects(np.ones((480, 640), np.int16), floor)
    with pytest.raises(CannotMeasure, match="no floor"):
        fit_floor(np.full((480, 640), np.nan), RECT, rng=rng())
    with pytest.raises(ValueError, match="below the camera"):
        Floor(RECT, -floor.plane, np.zeros((3, 3)))
    with pytest.raises(ValueError, match="above the floor"):
        floor_from_pose(RECT, rig_pose(RECT, 0.0, -10.0))
    assert scaled_pixels(RECT.P1[:1, 2], RECT.P1[1:2, 2], RECT).tolist() == [[0, 0, 1]]
