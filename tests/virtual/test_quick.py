"""The quick pictures against the exact ones, of scenes that show each thing that the quick way does differently."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stereolib.paper import paper_rig
from stereolib.rig import Camera, StereoRig, pose_left_world, rigid
from stereolib.virtual import (
    CUBE_SURFACE,
    Box,
    Light,
    Material,
    Scene,
    Tile,
    board_box,
    box_on_floor,
    cube_scene,
    recordings,
    render_pair,
    render_quickly,
    render_truth,
    room,
)


def smaller(camera: Camera, longer: float = 1.0) -> Camera:
    """The lens of a camera before a quarter of its columns and rows."""
    K = np.diag([0.25, 0.25, 1.0]) @ camera.K
    K[:2, 2] -= 0.375
    K[[0, 1], [0, 1]] *= longer
    return Camera(K, camera.dist, (160, 120))


def small_rig(longer: float = 1.0) -> StereoRig:
    rig = paper_rig()
    return StereoRig(smaller(rig.left, longer), smaller(rig.right, longer), rig.R, rig.T)


UPRIGHT = np.array([[0.0, 0, -1, 600], [-1, 0, 0, 20], [0, 1, 0, 150], [0, 0, 0, 1]])
STRIPES = Tile(np.tile(np.repeat([0.0, 1.0], 8)[:, None], (4, 64)), 1.5)
SCENES = {
    "cube": cube_scene(),
    "near": cube_scene(450.0, yaw_rad=0.3, lateral_mm=120.0),
    "far": cube_scene(1400.0, yaw_rad=1.2, size_mm=(120.0, 400.0, 60.0)),
    "fine": cube_scene(500.0, yaw_rad=0.0, cube=replace(CUBE_SURFACE, contrast=0.6, scale_mm=2.0, seed=5)),
    "coarse": cube_scene(cube=replace(CUBE_SURFACE, contrast=0.6, scale_mm=40.0)),
    "plain": cube_scene(cube=Material()),
    "tile": cube_scene(cube=Material(contrast=0.5, tile=STRIPES)),
    "board": Scene((room(), board_box((9, 6), 25.0, UPRIGHT))),
    "no room": Scene((box_on_floor((100.0, 100.0, 100.0), 500.0, 0.0, 0.4),)),
    "many": Scene(
        (
            box_on_floor((100.0, 200.0, 300.0), 600.0, 50.0, 0.4),
            room(),
            box_on_floor((300.0, 300.0, 40.0), 800.0, -200.0, 1.0),
            Box((500.0, 60.0, 60.0), rigid(np.eye(3), [900.0, -100.0, 330.0]), (Material(contrast=0.3),)),
            Box((200.0, 200.0, 30.0), rigid(np.eye(3), [-100.0, 0.0, 60.0]), (Material(),)),  # the cameras see past it
        ),
    ),
}


def share_apart(scene: Scene, rig: StereoRig, pose: np.ndarray) -> float:
    """Share of pixels in which quick and exact pictures differ by more than 1/255 of white."""
    quick = np.stack(render_quickly(scene, rig, pose))
    assert quick.dtype == np.float32
    exact = np.stack(render_pair(scene, rig, pose, samples=1, light_samples=1))
    assert exact.std() > 0.02
    return float((np.abs(quick - exact).max(axis=-1) > 1 / 255).mean())


@pytest.mark.parametrize("name", SCENES)
def test_agrees_with_the_exact_pictures(name: str) -> None:
    assert share_apart(SCENES[name], small_rig(), recordings.setup()) < 0.01


@pytest.mark.parametrize("pitch_deg", [-25, 15])
@pytest.mark.parametrize("longer", [0.6, 1.6])
def test_agrees_for_other_cameras(longer: float, pitch_deg: float) -> None:
    """With 0.6 of its focal length a camera sees past the fold of its lens."""
    rig = small_rig(longer)
    corner = rig.right.rays([[0.0, 0.0]])
    assert np.isnan(corner).any() == (longer < 1)
    assert share_apart(cube_scene(), rig, pose_left_world(np.radians(pitch_deg), 300.0)) < 0.01


def test_shadows_fall_where_they_do() -> None:
    """Of a lamp as low as the box, whose shadow has no end, and of one above it: dark at the same pixels."""
    pose, scene = recordings.setup(), cube_scene(cube=Material(), floor=Material())
    for height_mm in (200.0, 1200.0):
        lit = replace(scene, lights=(Light((900.0, 900.0, height_mm), power=0.7),), ambient=0.0)
        quick, exact = render_quickly(lit, small_rig(), pose)[0], render_pair(
            lit, small_rig(), pose, samples=1, light_samples=1
        )[0]  # fmt: skip
        dark = exact.max(axis=-1) == 0
        assert 0.1 < dark.mean() < 0.9
        assert ((quick.max(axis=-1) == 0) != dark).mean() < 0.005


@pytest.mark.parametrize(("gloss", "roughness"), [(0.95, 0.1), (0.4, 0.4)])
@pytest.mark.parametrize("name", SCENES)
def test_glare_and_mirror_images_agree_with_the_exact_ones(name: str, gloss: float, roughness: float) -> None:
    """Everything glossy: a box mirrors the others and the walls, a wall all of them and the other walls."""
    matt, rig, pose = SCENES[name], small_rig(), recordings.setup()
    boxes = [
        replace(box, materials=tuple(replace(one, gloss=gloss, roughness=roughness) for one in box.materials))
        for box in matt.boxes
    ]
    scene = replace(matt, boxes=tuple(boxes))
    assert share_apart(scene, rig, pose) < 0.01
    shining, dull = (render_quickly(one, rig, pose)[0] for one in (scene, matt))
    shines = (np.abs(shining - dull).max(axis=-1) > 1 / 255).mean()
    assert shines > 0.3 or name == "no room"  # where nothing is to be mirrored


def test_outside_the_room_it_is_drawn_exactly() -> None:
    rig, pose = small_rig(), pose_left_world(0.0, 3000.0)
    exact = render_pair(cube_scene(), rig, pose, samples=1, light_samples=1)
    np.testing.assert_array_equal(render_quickly(cube_scene(), rig, pose)[0], exact[0])


def test_a_moved_rig_sees_with_the_rays_of_its_lenses() -> None:
    """Cameras are told apart by their lens, not by what object they are: other lenses are other pictures."""
    one, same, other = (render_quickly(cube_scene(), small_rig(k), recordings.setup())[0] for k in (1.0, 1.0, 1.1))
    np.testing.assert_array_equal(one, same)
    assert np.abs(one - other).max() > 0.1


def test_truth_is_that_of_each_ray() -> None:
    """Boxes that a band of rows cannot meet are left out, and none that it can: against all rays, one by one."""
    scene, rectified, pose = SCENES["many"], small_rig().rectify(), recordings.setup()
    true = render_truth(scene, rectified, pose)
    assert set(np.unique(true.box)) == {0, 1, 2, 3}
    for row, column in np.random.default_rng(3).integers(0, (120, 160), (150, 2)):
        alone = Camera(rectified.P1[:, :3] - [[0, 0, column], [0, 0, row], [0, 0, 0]], [], (1, 1))
        T = rigid(rectified.R1, np.zeros(3)) @ pose
        depth, box = first_met(scene, T, alone.rays([[0.0, 0.0]])[0])
        assert true.box[row, column] == box
        assert true.depth_mm[row, column] == pytest.approx(depth, rel=1e-9)


def first_met(scene: Scene, T_camera_world: np.ndarray, ray: np.ndarray) -> tuple[float, int]:
    """Depth and box of the first plane met within its face, for one ray (x/z, y/z, 1)."""
    R, eye = T_camera_world[:3, :3], -T_camera_world[:3, :3].T @ T_camera_world[:3, 3]
    best = (np.inf, -1)
    for index, box in enumerate(scene.boxes):
        axes, half = box.T_world_box[:3, :3], np.array(box.size_mm) / 2
        o, d = (eye - box.T_world_box[:3, 3]) @ axes, ray @ R @ axes
        for axis in range(3):
            for side in (-1, 1):
                if (side * d[axis] > 0) == box.inside and d[axis]:
                    depth = (side * half[axis] - o[axis]) / d[axis]
                    others = [a for a in range(3) if a != axis]
                    if 0 < depth < best[0] and (np.abs(o + depth * d)[others] <= half[others]).all():
                        best = (float(depth), index)
    return best
