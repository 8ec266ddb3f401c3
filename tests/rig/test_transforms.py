"""Rigid transforms: the cross product, and where a pitched camera sees the world."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib.rig import pose_left_world, rigid, skew


def test_skew_is_the_cross_product():
    a, b = np.random.default_rng(0).normal(size=(2, 3))
    np.testing.assert_allclose(skew(a) @ b, np.cross(a, b), atol=1e-15)


def test_pose_of_a_pitched_camera():
    pitch, height = np.radians(8.0), 85.0
    T = pose_left_world(pitch, height)
    ahead = np.array([np.cos(pitch), 0, np.sin(pitch)])  # a pitched-up axis rises

    def in_camera(world):
        return (T @ [*world, 1.0])[:3]

    np.testing.assert_allclose(in_camera([0, 0, height]), 0, atol=1e-12)
    np.testing.assert_allclose(in_camera([0, 0, height] + 500 * ahead), [0, 0, 500], atol=1e-12)
    np.testing.assert_allclose(in_camera([0, 100, height]), [-100, 0, 0], atol=1e-12)  # y left is -x
    assert in_camera([0, 0, height + 10])[1] < 0  # up is -y
    np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(rigid(T[:3, :3], T[:3, 3]), T)


@pytest.mark.parametrize(
    "R, t", [([0.1, 0.2, 0.3], np.zeros(3)), (1.0, np.zeros(3)), (np.ones((3, 1)), np.zeros(3)), (np.eye(3), 5.0)]
)
def test_a_transform_is_not_made_of_other_shapes(R, t):
    with pytest.raises(ValueError, match=r"R must be \(3, 3\) and t \(3,\), got shapes"):
        rigid(R, t)
    assert rigid(np.eye(3), [[1], [2], [3]])[:3, 3].tolist() == [1, 2, 3]
