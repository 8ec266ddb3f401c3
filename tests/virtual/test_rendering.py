"""The truth of a scene against explicit projection, its light against the formula."""

from __future__ import annotations

import numpy as np
import pytest
from support.scalar_rays import cast_one, unit

from stereolib.paper import paper_rig
from stereolib.rig import Camera, pose_left_world, rigid
from stereolib.virtual import (
    Box,
    Light,
    Material,
    Scene,
    box_on_floor,
    cast_rays,
    cube_scene,
    recordings,
    render,
    render_pair,
    render_truth,
)

PLAIN = Material()
SMALL = Camera([[60.0, 0, 31.5], [0, 60.0, 23.5], [0, 0, 1]], [], (64, 48))


@pytest.mark.parametrize("name", ["pitched", "level"])
def test_truth_against_projection_into_both_rectified_cameras(name):
    """One world point per pixel, by `cast`; where do both rectified cameras see it?"""
    scene, rectified, pose = cube_scene(), recordings.rectified(), recordings.setup(name)
    true = render_truth(scene, rectified, pose)
    v, u = (grid.ravel() for grid in np.meshgrid(np.arange(0, 480, 17), np.arange(0, 640, 17), indexing="ij"))
    rays = (np.column_stack([u, v, np.ones(len(u))]) @ np.linalg.inv(rectified.P1[:, :3]).T) @ rectified.R1
    eye = -pose[:3, :3].T @ pose[:3, 3]
    directions = unit(rays @ pose[:3, :3])
    hits = cast_rays(scene, eye, directions)
    world = eye + hits.distance_mm[:, None] * directions
    in_left = world @ pose[:3, :3].T + pose[:3, 3]
    in_right = in_left @ rectified.rig.R.T + rectified.rig.T

    def seen(points, R, P):
        uvw = np.column_stack([points @ R.T, np.ones(len(points))]) @ np.column_stack([P[:, :3], np.zeros(3)]).T
        return uvw[:, :2] / uvw[:, 2:]

    left, right = seen(in_left, rectified.R1, rectified.P1), seen(in_right, rectified.R2, rectified.P2)
    np.testing.assert_allclose(left, np.column_stack([u, v]), atol=1e-6)
    np.testing.assert_allclose(right[:, 1], v, atol=1e-6)
    np.testing.assert_allclose(true.disparity_px[v, u], left[:, 0] - right[:, 0], atol=1e-6)
    np.testing.assert_allclose(true.depth_mm[v, u], (in_left @ rectified.R1.T)[:, 2], rtol=1e-9)
    np.testing.assert_array_equal(true.box[v, u], hits.surface // 6)


def test_visibility_by_brute_force():
    """From every looked-at point, a ray of its own to the right camera."""
    scene, rectified, pose = cube_scene(), recordings.rectified(), recordings.setup()
    true = render_truth(scene, rectified, pose)
    T = rigid(rectified.R1, np.zeros(3)) @ pose
    eye = -T[:3, :3].T @ T[:3, 3]
    right_eye = eye + T[:3, :3].T @ [rectified.baseline_mm, 0, 0]
    rng, seen = np.random.default_rng(4), []
    # pixels all over, and some around the cube's left border, where the right camera sees past it
    first = (true.box == 1).argmax(axis=1)
    border = [(v, first[v] + d) for v in range(120, 420, 20) for d in (-40, -20, -5, -2, 1, 5)]
    for v, u in [*border, *zip(rng.integers(0, 480, 80), rng.integers(0, 640, 80), strict=True)]:
        ray = np.linalg.inv(rectified.P1[:, :3]) @ [u, v, 1.0]
        point = eye + T[:3, :3].T @ ray * true.depth_mm[v, u]
        way = point - right_eye
        distance, *_ = cast_one(scene, right_eye, way / np.linalg.norm(way))
        inside = u - true.disparity_px[v, u] >= 0
        seen.append(bool(inside and abs(distance - np.linalg.norm(way)) < 0.1))
        assert true.visible[v, u] == seen[-1], (v, u)
    assert 20 < seen.count(False) < len(seen) - 40


def test_occluded_strip_is_as_wide_as_the_step_in_disparity():
    true = render_truth(cube_scene(), recordings.rectified(), recordings.setup())
    row = 150
    first = np.flatnonzero(true.box[row] == 1)[0]
    step = true.disparity_px[row, first] - true.disparity_px[row, first - 1]
    strip = first - 1 - np.flatnonzero(true.visible[row, :first])[-1]
    assert step > 20
    assert strip == pytest.approx(step, abs=2)


def test_matt_light_is_the_formula():
    """Lambert: colour times (ambient + power, falling with the square, with both cosines)."""
    lamp = Light((900.0, 800.0, 1500.0), 1e-3, 0.6)
    floor = Material((0.3, 0.5, 0.7))
    scene = Scene((Box((4000.0, 4000.0, 10.0), rigid(np.eye(3), [0, 0, -5.0]), (floor,)),), (lamp,), ambient=0.1)
    pose = pose_left_world(-0.6, 500.0)
    picture = render(scene, SMALL, pose, samples=1)
    rays = SMALL.rays(np.array([[u, v] for v in range(48) for u in range(64)])) @ pose[:3, :3]
    axis = np.array([700.0, 0, 150]) - lamp.position_mm
    axis /= np.linalg.norm(axis)
    checked = 0
    for k in range(0, len(rays), 37):
        if rays[k, 2] >= 0:
            continue
        point = np.array([0, 0, 500.0]) - rays[k] * 500 / rays[k, 2]
        if np.abs(point[:2]).max() > 1900:
            continue
        to_lamp = np.array(lamp.position_mm) - point
        reach = np.linalg.norm(to_lamp)
        light = 0.1 + 0.6 * (2000 / reach) ** 2 * (to_lamp[2] / reach) * max(0, -to_lamp @ axis / reach)
        np.testing.assert_allclose(picture[k // 64, k % 64], np.array(floor.color_bgr) * light, rtol=2e-4)
        checked += 1
    assert checked > 30


def test_shadow_is_dark_in_its_core_and_soft_at_its_border():
    floor = Material((1.0, 1.0, 1.0))
    ground = Box((4000.0, 4000.0, 10.0), rigid(np.eye(3), [0, 0, -5.0]), (floor,))
    block = Box((200.0, 200.0, 10.0), rigid(np.eye(3), [700, 0, 400.0]), (floor,))
    pose = np.array([[0.0, -1, 0, 0], [-1, 0, 0, 700], [0, 0, -1, 390], [0, 0, 0, 1]])  # under the block, looking down
    shares = []
    for size in (1.0, 500.0):
        lamp = Light((700.0, 0.0, 2000.0), size, 0.5)
        lit, dark = (
            render(Scene((ground, *b), (lamp,), ambient=0.1), SMALL, pose, samples=1)[24] for b in ((), (block,))
        )
        share = ((dark - 0.1) / (lit - 0.1))[:, 0]
        assert share[32] == 0
        assert share[[0, -1]].min() > 0.999
        shares.append(((share > 0.02) & (share < 0.98)).sum())
    assert shares[0] == 0  # a point of light: a hard shadow
    assert shares[1] >= 6
    # The half shadow is 500 * 400 / 1600 = 125 mm wide, on both sides; a pixel is 6.5 mm.
    assert shares[1] == pytest.approx(2 * 125 / 6.5, rel=0.25)


def test_glare_lies_where_the_mirror_would_show_the_lamp():
    glossy = Material((0.0, 0.0, 0.0), gloss=1.0, roughness=0.15)
    ground = Box((8000.0, 8000.0, 10.0), rigid(np.eye(3), [0, 0, -5.0]), (glossy,))
    lamp = Light((2000.0, 200.0, 500.0), 20.0, 1.0)
    pose = pose_left_world(-0.4, 400.0)
    picture = render(Scene((ground,), (lamp,), ambient=0.0), SMALL, pose, samples=2)[..., 1]
    mirrored = np.array([2000.0, 200.0, -500.0, 1.0])
    expected = SMALL.project((pose @ mirrored)[None, :3])[0]
    v, u = np.unravel_index(picture.argmax(), picture.shape)
    assert np.hypot(u - expected[0], v - expected[1]) < 4
    matt = render(Scene((Box(ground.size_mm, ground.T_world_box, (Material((0.0,) * 3),)),), (lamp,), 0.0), SMALL, pose)
    assert matt.max() == 0


def test_gloss_mirrors_the_scene():
    """A glossy black floor shows a white box upside down below its foot, as bright as Fresnel's law says."""
    black = Material((0.0, 0.0, 0.0), gloss=1.0, roughness=0.1)
    ground = Box((8000.0, 8000.0, 10.0), rigid(np.eye(3), [0, 0, -5.0]), (black,))
    box = box_on_floor((100.0, 100.0, 200.0), 1000.0, 0.0, 0.0, Material((1.0, 1.0, 1.0)))
    pose = pose_left_world(-0.2, 200.0)
    picture = render(Scene((ground, box), (), ambient=1.0), SMALL, pose, samples=2)[..., 1]
    mirror_mm = np.array([[950.0, 0, -100, 1], [950.0, 0, -240, 1], [950.0, 0, 100, 1]])  # it reaches down to -200
    within, below, box_itself = (
        picture[v, u] for u, v in SMALL.project((mirror_mm @ pose.T)[:, :3]).round().astype(int)
    )
    assert box_itself == pytest.approx(1)
    cos = 300 / np.hypot(300, 950)  # of the ray that meets the floor on its way to the image at -100
    assert within == pytest.approx(0.9 * (0.04 + 0.96 * (1 - cos) ** 5), rel=0.1)
    assert below == 0


def test_samples_are_the_mean_of_a_finer_picture():
    scene, pose = cube_scene(cube=PLAIN, floor=PLAIN), recordings.setup()
    fine = Camera(np.array([[180.0, 0, 95.5], [0, 180, 71.5], [0, 0, 1]]), [], (192, 144))
    small = Camera(np.array([[60.0, 0, 31.5], [0, 60, 23.5], [0, 0, 1]]), [], (64, 48))  # pixel centres at 1, 4, 7, ...
    shifted = Camera(np.array([[60.0, 0, (95.5 - 1) / 3], [0, 60, (71.5 - 1) / 3], [0, 0, 1]]), [], (64, 48))
    np.testing.assert_allclose(shifted.K, small.K)
    means = render(scene, fine, pose, samples=1).reshape(48, 3, 64, 3, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(render(scene, small, pose, samples=3), means, atol=1e-5)


def test_pair_is_each_camera_where_it_stands():
    rig, pose, scene = paper_rig(), recordings.setup(), cube_scene(cube=PLAIN, floor=PLAIN)
    tiny = [Camera(np.diag([0.1, 0.1, 1]) @ c.K, c.dist, (64, 48)) for c in (rig.left, rig.right)]
    pair = render_pair(scene, type(rig)(*tiny, rig.R, rig.T), pose, samples=1, light_samples=1)
    np.testing.assert_array_equal(pair[0], render(scene, tiny[0], pose, samples=1, light_samples=1))
    # the cube's near edge moves by the disparity: some 10 px of a picture of a tenth of the size
    foot = np.array([700.0, 0, 0, 1])
    uv = [
        c.project((M @ pose @ foot)[None, :3])[0] for c, M in zip(tiny, (np.eye(4), rigid(rig.R, rig.T)), strict=True)
    ]
    assert uv[0][0] - uv[1][0] == pytest.approx(10, abs=2)
    assert not np.array_equal(*pair)


def test_picture_is_the_same_each_time():
    one, two = (
        render(cube_scene(cube=Material(contrast=0.4, seed=4)), SMALL, recordings.setup(), samples=2) for _ in "12"
    )
    np.testing.assert_array_equal(one, two)
    assert (
        np.abs(
            one - render(cube_scene(cube=Material(contrast=0.4, seed=5)), SMALL, recordings.setup(), samples=2)
        ).max()
        > 0.02
    )
    assert one.dtype == np.float64
    assert np.isfinite(one).all() and one.min() >= 0


def test_refuses():
    with pytest.raises(ValueError, match="samples and light_samples must be at least 1, got 0 and 4"):
        render(cube_scene(), SMALL, np.eye(4), samples=0)
