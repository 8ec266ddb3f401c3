"""The model: projections and disparities against the virtual rig's own, faces and edges against each other."""

from __future__ import annotations

import numpy as np
import pytest
from support.boxes import FLOOR, HERE, OWN, PRIORS, RECT, STILL, shared
from support.ground import GRID

from stereolib.measurement import floor_from_pose
from stereolib.measurement.box import Box, Edge, Own, Side, World, derivatives
from stereolib.rig import rigid
from stereolib.virtual import cube_scene, recordings, render_truth

BOX = Box(OWN)
WORLD = PRIORS.world(STILL)


def test_corners_stand_where_the_sides_lead():
    corners = BOX.points(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1]]))
    right, left = (corners[k, :2] - corners[0, :2] for k in (1, 2))
    assert corners[0] == pytest.approx([700, 20, 0]) and corners[3, 2] == 250
    assert (np.linalg.norm(right), np.linalg.norm(left), right @ left) == pytest.approx((300, 200, 0), abs=1e-9)
    assert right[1] < 0 < left[1]  # as the camera sees them
    for side, far in ((Side.RIGHT, corners[1]), (Side.LEFT, corners[2])):
        normal = BOX.normal(side)
        assert normal @ corners[[0], :2].T == pytest.approx(BOX.distance(side))
        assert normal @ far[:2] == pytest.approx(BOX.distance(side)) and normal[0] > 0  # away from the camera


def test_edges_end_the_faces_they_are_named_after():
    for side in Side:
        for edge in (side.end, side.top):
            assert BOX.edge(edge)[:, :2] @ BOX.normal(side) == pytest.approx(BOX.distance(side))
        depth = BOX.own[side.other.extent]
        assert BOX.edge(side.back)[:, :2] @ BOX.normal(side) == pytest.approx(BOX.distance(side) + depth)
        assert side.other.other is side and side.end.upright and side.top.is_top and not side.back.is_top
    assert sum(edge.upright for edge in Edge) == 3


@pytest.mark.parametrize("name", ["pitched", "level"])
def test_points_project_as_the_cameras_show_them(name):
    pose = recordings.setup(name)
    world = World.of(floor_from_pose(RECT, pose), HERE.t, 0.0, STILL)
    points = BOX.points(np.random.default_rng(0).random((20, 3)))
    camera = (rigid(RECT.R1, np.zeros(3)) @ pose @ np.c_[points, np.ones(20)].T)[:3].T
    assert world.pixels(points) == pytest.approx(camera[:, :2] / camera[:, 2:] * RECT.f_px + RECT.P1[:2, 2], abs=1e-6)


def test_the_right_picture_shows_points_farther_left_by_their_disparity():
    world, points = PRIORS.world(shared(offset=0.25)), BOX.points(np.random.default_rng(1).random((6, 3)))
    right = np.arange(6) % 2 == 1
    left_px, px = world.pixels(points), world.pixels(points, right)
    ahead = (points - [0.0, 0.0, float(world.camera_height)]) @ world.axes[:, 2]
    shift = float(world.scale) / ahead + 0.25
    assert px == pytest.approx(left_px - np.outer(shift * right, [1.0, 0.0])) and (shift > 20).all()


@pytest.mark.parametrize("first", Side)
def test_a_box_from_the_other_end_of_a_face_is_the_same_box(first):
    other = BOX.from_other_end(first)
    corners = [[a, b, c] for a in (0.0, 1.0) for b in (0.0, 1.0) for c in (0.0, 1.0)]
    mine, theirs = (np.array(sorted(map(tuple, b.points(np.array(corners)).round(6)))) for b in (BOX, other))
    assert mine == pytest.approx(theirs, abs=1e-5)
    assert other.normal(first.other) == pytest.approx(BOX.normal(first))  # the face is the other side's now
    assert other.corner == pytest.approx(BOX.edge(first.end)[0, :2])
    assert other.from_other_end(first.other).own == pytest.approx(BOX.own)


def test_disparities_of_faces_and_floor_are_the_virtual_rig_s():
    """The cube at 45 degrees, 700 mm ahead: each pixel of its faces, and of the floor."""
    seen = render_truth(cube_scene(700.0), RECT, recordings.setup())
    own = np.array([700.0, 0.0, np.radians(45), 300.0, 300.0, 300.0, 0.0, 0.0])
    u, v = GRID
    best = np.full(u.shape, np.nan)
    for side in Side:
        plane = WORLD.disparity_plane(np.append(Box(own).normal(side), 0.0), Box(own).distance(side))
        mine = (u < 320) == (side is Side.LEFT)
        best[mine] = (plane[0] * u + plane[1] * v + plane[2])[mine]
    sides = (seen.box == 1) & (np.abs(u - 320) > 12)
    top = WORLD.pixels(Box(own).edge(Edge.TOP_LEFT))[:, 1].max()
    sides &= v > top + 5
    assert sides.sum() > 20_000 and np.abs(best - seen.disparity_px)[sides].max() < 2e-3
    a, b, c = WORLD.disparity_plane(np.array([0.0, 0.0, 1.0]), np.array(0.0))
    floor = (seen.box == 0) & (seen.disparity_px > 45)
    assert np.abs(a * u + b * v + c - seen.disparity_px)[floor].max() < 1e-3


def test_what_shared_parameters_mean():
    plane = (np.array([0.6, 0.8, 0.0]), np.array(600.0))
    before = WORLD.disparity_plane(*plane)
    moved = PRIORS.world(shared(offset=0.25)).disparity_plane(*plane)
    assert moved - before == pytest.approx([0, 0, 0.25])
    assert PRIORS.world(shared(baseline=0.01)).disparity_plane(*plane) == pytest.approx(1.01 * before)
    higher = PRIORS.world(shared(camera_height=0.01))
    assert higher.camera_height == pytest.approx(1.01 * FLOOR.camera_height_mm)
    turned = PRIORS.world(shared(pitch=0.01))
    assert WORLD.axes[0] @ turned.axes[0] == pytest.approx(np.cos(0.01)) and turned.axes[1] == pytest.approx(
        WORLD.axes[1], abs=1e-4
    )
    laser = PRIORS.world(shared(laser_x=5.0, laser_yaw=np.pi / 2))
    assert laser.laser_place == pytest.approx([5, 0]) and laser.from_laser(np.array([[1.0, 0.0]])) == pytest.approx(
        np.array([[0.0, 1.0]])
    )


def test_many_boxes_at_once_are_each_by_itself():
    both = np.stack([OWN, OWN + 3.0])
    world = PRIORS.world(np.stack([STILL, shared(focal=0.01)]))
    together = world.pixels(Box(both).edge(Edge.RIGHT_END))
    for k, x in enumerate((STILL, shared(focal=0.01))):
        assert together[k] == pytest.approx(PRIORS.world(x).pixels(Box(both[k]).edge(Edge.RIGHT_END)))


def test_derivatives_are_exact():
    values, J = derivatives(lambda x: np.stack([np.sin(x[..., 0]) * x[..., 1], x[..., 1] ** 3], -1), np.array([0.3, 2]))
    assert values == pytest.approx([2 * np.sin(0.3), 8])
    assert pytest.approx(np.array([[2 * np.cos(0.3), np.sin(0.3)], [0, 12]]), rel=1e-14) == J
    assert len(Own) == len(OWN)
