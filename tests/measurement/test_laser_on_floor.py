"""The laser's pose on the floor: from its pose to the camera, and moved."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from support.boxes import FLOOR

from stereolib.base import turn_2d
from stereolib.measurement import LaserOnFloor
from stereolib.rig import rigid
from stereolib.virtual import recordings

TURN = np.array([[np.cos(0.1), -np.sin(0.1), 0], [np.sin(0.1), np.cos(0.1), 0], [0, 0, 1]])


def test_from_its_pose_to_the_camera():
    pose = recordings.setup() @ rigid(TURN, [-40, 25, 60])
    laser = LaserOnFloor.of(SimpleNamespace(T_left_lidar=pose, covariance=np.diag([0, 0, 1e-4, 4.0, 1.0, 9.0])), FLOOR)
    assert laser.yaw_rad == pytest.approx(0.1, abs=1e-6)
    np.testing.assert_allclose(laser.t, [-40, 25], atol=1e-6)
    np.testing.assert_allclose(np.linalg.eigvalsh(laser.covariance[:2, :2]), [1, 4])
    assert laser.covariance[2, 2] == pytest.approx(1e-4)


def test_moved_about_itself():
    laser = LaserOnFloor(turn_2d(0.2), np.array([10.0, 20.0]), np.eye(3)).moved(5.0, -5.0, 0.3)
    assert laser.yaw_rad == pytest.approx(0.5) and laser.t == pytest.approx([15, 15])
    assert laser.points_mm(np.array([[0.0, 0.0], [100.0, 0.0]])) == pytest.approx(
        np.array([[15, 15], [15 + 100 * np.cos(0.5), 15 + 100 * np.sin(0.5)]])
    )
