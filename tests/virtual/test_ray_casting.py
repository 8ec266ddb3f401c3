"""The ray caster against a scalar twin."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from support.scalar_rays import cast_one, unit

from stereolib.rig import pose_left_world, rigid
from stereolib.virtual import Box, Material, Scene, box_on_floor, cast_rays, cube_scene, recordings, render_truth, room


def crowd(seed=3):
    """A room with boxes turned every way, some in each other."""
    rng = np.random.default_rng(seed)
    boxes = [room()]
    for k in range(5):
        turn = cv2.Rodrigues(rng.normal(size=3))[0]
        place = rng.uniform([300, -900, 100], [1500, 900, 900])
        boxes.append(Box(tuple(rng.uniform(60, 500, 3)), rigid(turn, place), (Material(contrast=0.3, seed=k),)))
    return Scene(tuple(boxes))


def test_cast_against_a_scalar_twin():
    scene, rng = crowd(), np.random.default_rng(0)
    directions = unit(rng.normal(size=(400, 3)))
    for origin in (np.array([0.0, 0.0, 85.0]), np.array([1000.0, -600, 1800])):
        hits = cast_rays(scene, origin, directions)
        for k, direction in enumerate(directions):
            distance, surface, normal = cast_one(scene, origin, direction)
            assert hits.surface[k] == surface
            assert hits.distance_mm[k] == pytest.approx(distance, rel=1e-9)
            np.testing.assert_allclose(hits.normal[k], normal, atol=1e-12)
            assert np.dot(hits.normal[k], direction) < 0
        assert len(set(hits.surface // 6)) >= 4


def test_rays_with_origins_of_their_own():
    scene, rng = crowd(), np.random.default_rng(1)
    directions, origins = unit(rng.normal(size=(50, 3))), rng.uniform([-500, -500, 1200], [500, 500, 2000], (50, 3))
    together = cast_rays(scene, origins, directions)
    for k in range(50):
        alone = cast_rays(scene, origins[k], directions[k : k + 1])
        assert together.distance_mm[k] == alone.distance_mm[0]
        assert together.surface[k] == alone.surface[0]


def test_rays_along_the_axes():
    """What a level laser sends: directions with zeros, along walls and floor."""
    scene, origin = cube_scene(), np.array([0.0, 0.0, 85.0])
    axes = np.vstack([np.eye(3), -np.eye(3)])
    hits = cast_rays(scene, origin, axes)
    np.testing.assert_allclose(hits.distance_mm, [700, 1900, 2415, 1800, 1700, 85])
    np.testing.assert_array_equal(hits.surface // 6, [1, 0, 0, 0, 0, 0])
    turns = np.radians(np.arange(0, 360, 15))
    level = np.stack([np.cos(turns), np.sin(turns), np.zeros_like(turns)], axis=1)
    for k, distance in enumerate(cast_rays(scene, origin, level).distance_mm):
        assert distance == pytest.approx(cast_one(scene, origin, level[k])[0])


def test_nothing_to_hit():
    scene = Scene((box_on_floor((100, 100, 100), 500, 0, 0),))
    hits = cast_rays(scene, np.array([0.0, 0, 50]), unit(np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0.1]])))
    np.testing.assert_allclose(hits.distance_mm, [450, np.nan, np.nan])
    assert hits.surface.tolist() == [6 * 0 + 0, -1, -1]
    assert np.isnan(hits.normal[1:]).all() and np.isnan(hits.albedo[1:]).all()
    true = render_truth(scene, recordings.rectified(), pose_left_world(0.0, 50.0))
    empty = true.box < 0
    assert 0.1 < empty.mean() < 0.99
    assert np.isnan(true.depth_mm[empty]).all() and np.isnan(true.disparity_px[empty]).all()
    assert not true.visible[empty].any()


def test_albedo_and_gloss():
    plain = Material((0.2, 0.5, 0.8), gloss=0.7)
    hits = cast_rays(Scene((box_on_floor((100, 100, 100), 500, 0, 0, plain),)), np.array([0.0, 0, 50]), np.eye(3)[:1])
    assert hits.albedo[0] == pytest.approx(0.114 * 0.2 + 0.587 * 0.5 + 0.299 * 0.8)
    assert hits.gloss[0] == 0.7
    hits = cast_rays(cube_scene(), np.array([0.0, 0, 85]), unit(np.random.default_rng(0).normal(size=(5000, 3))))
    assert 0.03 < hits.albedo.min() < hits.albedo.max() < 1
    assert hits.albedo.std() > 0.1
