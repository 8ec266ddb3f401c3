"""Scenes stand where they should, and their textures are filtered right."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
import pytest

from stereolib.rig import rigid
from stereolib.virtual import Box, Light, Material, Scene, board_box, box_on_floor, cube_scene, room, texture


def corners(box: Box) -> np.ndarray:
    signs = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    local = signs * np.array(box.size_mm) / 2
    return local @ box.T_world_box[:3, :3].T + box.T_world_box[:3, 3]


@pytest.mark.parametrize("yaw_deg", [0, 45, 17, -120])
@pytest.mark.parametrize("size", [(300, 300, 300), (420, 180, 250)])
def test_object_stands_on_the_floor_at_its_distance(yaw_deg, size):
    scene = cube_scene(650.0, size_mm=size, yaw_rad=np.radians(yaw_deg), lateral_mm=70.0)
    assert scene.names == ("room", "cube")
    at = corners(scene.boxes[1])
    assert at[:, 0].min() == pytest.approx(650)
    assert at[:, 2].min() == pytest.approx(0, abs=1e-9)
    assert at[:, 2].max() == pytest.approx(size[2])
    assert at[:, 1].mean() == pytest.approx(70)
    np.testing.assert_allclose(np.linalg.norm(at[[4, 2, 1]] - at[0], axis=1), size)


def test_papers_cube_shows_an_edge():
    at = corners(cube_scene().boxes[1])
    near = at[np.isclose(at[:, 0], at[:, 0].min())]
    assert len(near) == 2  # foot and top of one vertical edge
    np.testing.assert_allclose(near[:, 1], 0, atol=1e-9)
    assert np.ptp(at[:, 1]) == pytest.approx(300 * np.sqrt(2))


def test_room_has_its_walls():
    at = corners(room(x_mm=(-100.0, 900.0), y_mm=(-300.0, 200.0), height_mm=400.0))
    np.testing.assert_allclose([at.min(axis=0), at.max(axis=0)], [[-100, -300, 0], [900, 200, 400]])


def test_print_of_the_board_lies_in_its_frame():
    T = rigid(cv2.Rodrigues(np.array([0.3, -0.2, 0.5]))[0], [500.0, 20.0, 300.0])
    box = board_box((9, 6), 25.0, T)
    local = (corners(box) - T[:3, 3]) @ T[:3, :3]
    assert local[:, 2].max() == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(local[:, :2].max(axis=0), [10 * 25 / 2 + 20, 7 * 25 / 2 + 20])
    assert [m.checker for m in box.materials] == [None] * 5 + [(9, 6, 25.0)]


def test_dimming_scales_all_light():
    scene = Scene((), (Light((0, 0, 2000), power=0.6),), ambient=0.2).dimmed(0.5)
    assert (scene.lights[0].power, scene.ambient) == (0.3, 0.1)
    assert cube_scene().dimmed(0.1).ambient == pytest.approx(0.1 * cube_scene().ambient)


def test_gloss_brings_its_lamps():
    glossy = Material(gloss=0.9)
    assert len(cube_scene(cube=glossy, floor=glossy).lights) == len(cube_scene().lights) + 4
    assert cube_scene(cube=glossy).boxes[1].materials[0].gloss == 0.9


def test_box_refuses():
    with pytest.raises(ValueError, match=r"three positive sizes in mm, got \(1, 0, 1\)"):
        Box((1, 0, 1), np.eye(4), (Material(),))
    with pytest.raises(ValueError, match="1 or 6 materials, got 2"):
        Box((1, 1, 1), np.eye(4), (Material(), Material()))
    assert len(box_on_floor((1, 1, 1), 0, 0, 0).materials) == 6


@pytest.mark.parametrize("width", [0.01, 3.0, 17.0, 25.0, 60.0])
def test_checker_is_the_mean_over_the_footprint(width):
    """Against brute force: the hard pattern at many points of the footprint."""
    rng = np.random.default_rng(5)
    u, v = rng.uniform(-100, 100, (2, 200))
    wide = np.full(200, width), np.full(200, width / 2)
    found = texture.checker(u, v, wide, 25.0)
    at = (np.arange(400) + 0.5) / 400 - 0.5
    across = np.floor((u[:, None] + at * width) / 25).astype(int) % 2
    along = np.floor((v[:, None] + at * width / 2) / 25).astype(int) % 2
    white = (across[:, :, None] != along[:, None, :]).mean(axis=(1, 2))
    np.testing.assert_allclose(found, white, atol=4e-3)
    assert texture.checker(np.array([5.0]), np.array([5.0]), (np.array([0.1]),) * 2, 25.0)[0] == pytest.approx(0)


def test_noise_is_standard_periodic_and_of_its_seed():
    pyramid = texture.noise_pyramid(3)
    tile = pyramid[0][:-1, :-1].astype(float)
    assert [level.shape[0] - 1 for level in pyramid] == [1024, 512, 256, 128, 64, 32, 16, 8]
    assert tile.mean() == pytest.approx(0, abs=1e-5)
    assert tile.std() == pytest.approx(1, abs=1e-5)
    # the halvings are means of four, down to the coarsest
    for fine, coarse in pairwise(pyramid):
        n = fine.shape[0] - 1
        np.testing.assert_allclose(
            coarse[:-1, :-1], fine[:-1, :-1].reshape(n // 2, 2, n // 2, 2).mean((1, 3)), atol=1e-5
        )
    u, v = np.random.default_rng(0).uniform(0, 500, (2, 300))
    size = np.full(300, 0.1)
    one = texture.noise(u, v, size, 6.0, 3)
    period = 1024 * 6.0 / 4
    np.testing.assert_allclose(texture.noise(u + period, v - 2 * period, size, 6.0, 3), one, atol=2e-3)
    np.testing.assert_array_equal(texture.noise(u, v, size, 6.0, 3), one)
    assert abs(np.corrcoef(one, texture.noise(u, v, size, 6.0, 4))[0, 1]) < 0.2


def test_noise_has_features_of_its_size():
    """At a quarter of the feature's size it is still itself, a few features further on it is not."""
    u = np.linspace(0, 3000, 4001)
    zero, size = np.zeros_like(u), np.full_like(u, 0.1)
    for scale in (3.0, 12.0):
        here, near, far = (texture.noise(u + k * scale, zero, size, scale, 7) for k in (0, 0.25, 8))
        assert np.corrcoef(here, near)[0, 1] > 0.8
        assert abs(np.corrcoef(here, far)[0, 1]) < 0.35


@pytest.mark.parametrize("footprint", [1.5, 3.0, 6.0, 12.0])
def test_noise_is_blurred_to_the_footprint(footprint):
    """Against brute force: the mean of the sharp texture over the footprint, at the same place."""
    rng = np.random.default_rng(8)
    u, v = rng.uniform(0, 800, (2, 400))
    at = ((np.arange(16) + 0.5) / 16 - 0.5) * footprint
    du, dv = (grid.ravel() for grid in np.meshgrid(at, at))
    sharp = texture.noise(
        (u[:, None] + du).ravel(), (v[:, None] + dv).ravel(), np.full(400 * 256, 0.01), 6.0, 9
    ).reshape(400, 256)
    found = texture.noise(u, v, np.full(400, footprint), 6.0, 9)
    assert np.corrcoef(found, sharp.mean(axis=1))[0, 1] > (0.97 if footprint < 5 else 0.92)
    assert found.std() == pytest.approx(sharp.mean(axis=1).std(), rel=0.2)


def test_many_points_at_once_are_looked_up_in_their_order():
    u = np.linspace(0, 4000, 70001)
    size = np.linspace(0.1, 40, 70001)
    every = texture.noise(u, u / 3, size, 6.0, 1)
    few = np.random.default_rng(0).permutation(70001)[:500]
    np.testing.assert_array_equal(texture.noise(u[few], u[few] / 3, size[few], 6.0, 1), every[few])
    assert every[:1000].std() > 0.5
