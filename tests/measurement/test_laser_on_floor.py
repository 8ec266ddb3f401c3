"""The laser's pose on the floor: from its pose to the camera, and moved."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from support import box_scenes
from support.boxes import FLOOR

from stereolib.base import turn_2d, turn_about_z
from stereolib.laser import EMITTER_ANGLE_RAD, EMITTER_OFFSET_MM, LaserScan
from stereolib.measurement import LaserOnFloor, measure_objects
from stereolib.rig import rigid
from stereolib.virtual import recordings
from stereolib.virtual.ray_casting import cast_rays

TURN = np.array([[np.cos(0.1), -np.sin(0.1), 0], [np.sin(0.1), np.cos(0.1), 0], [0, 0, 1]])


def test_from_its_pose_to_the_camera():
    pose = recordings.setup() @ rigid(TURN, [-40, 25, 60])
    laser = LaserOnFloor.of(
        SimpleNamespace(T_left_lidar=pose, covariance=np.diag([0, 0, 1e-4, 4.0, 1.0, 9.0, 1e-6])), FLOOR
    )
    assert laser.yaw_rad == pytest.approx(0.1, abs=1e-6)
    np.testing.assert_allclose(laser.t, [-40, 25], atol=1e-6)
    np.testing.assert_allclose(np.linalg.eigvalsh(laser.covariance[:2, :2]), [1, 4])
    assert laser.covariance[2, 2] == pytest.approx(1e-4)


def test_moved_about_itself():
    laser = LaserOnFloor(turn_2d(0.2), np.array([10.0, 20.0]), np.eye(4)).moved(5.0, -5.0, 0.3)
    assert laser.yaw_rad == pytest.approx(0.5) and laser.t == pytest.approx([15, 15])
    assert laser.points_mm(np.array([[0.0, 0.0], [100.0, 0.0]])) == pytest.approx(
        np.array([[15, 15], [15 + 100 * np.cos(0.5), 15 + 100 * np.sin(0.5)]])
    )


def tilted_scan(scene, pose, height_mm, lean_rad):
    """What a laser reads whose plane falls ahead, without noise, and where it stands in the world."""
    place = rigid(turn_about_z(pose[2]) @ cv2.Rodrigues(np.array([0.0, lean_rad, 0.0]))[0], [*pose[:2], height_mm])
    angles = np.arange(360) * 2 * np.pi / 360
    flat = [np.column_stack([np.cos(a), np.sin(a), 0 * a]) for a in (angles, angles + EMITTER_ANGLE_RAD)]
    beam, beside = (each @ place[:3, :3].T for each in flat)
    hits = cast_rays(scene, place[:3, 3] + EMITTER_OFFSET_MM * beside, beam)
    return LaserScan(np.rint(hits.distance_mm), np.full(360, 100.0)), place


def test_a_laser_whose_nose_hangs_is_named_and_its_readings_of_the_floor_left_out():
    truth = box_scenes.plain_scene(2)
    shot, known = box_scenes.shoot(truth), box_scenes.instrument()
    standing = {}
    for lean in (0.0, 2.0):
        scan, place = tilted_scan(truth.scene, truth.laser_pose, 60.0, np.radians(lean))
        lidar = replace(known.lidar, T_left_lidar=truth.T_left_world @ place)
        standing[lean] = measure_objects(shot.left, shot.right, scan, replace(known, lidar=lidar)), scan
    (level, seen), (leaning, nose_down) = standing.values()
    assert not any("leans" in text for text in level.warnings) and len(level.scan_mm) == 360
    (said,) = (text for text in leaning.warnings if "leans" in text)
    degrees, floor_m = map(
        float, re.search(r"leans by ([\d.]+) degrees, down ahead: .* floor ([\d.]+) m", said).groups()
    )
    assert degrees == pytest.approx(2, abs=0.15) and floor_m == pytest.approx(1.72, abs=0.15)
    short = np.flatnonzero(nose_down.ranges_mm < seen.ranges_mm - 100)  # of the floor before the wall
    assert len(short) > 60 and len(leaning.scan_mm) <= 360 - len(short)
    assert len(leaning.scan_mm) > 360 - len(short) - 40  # what looks aside and back is kept
    box = box_scenes.the_box(leaning, truth)
    assert max(abs(pct) for pct, _ in box_scenes.errors(box, truth).values()) < 3
