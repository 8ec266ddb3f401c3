"""What both emulators look at: cameras and laser of one number are one rig before one scene."""

from __future__ import annotations

import numpy as np
import pytest

from stereolib.laser import LaserScan, points_mm
from stereolib.virtual import VirtualLidar, render_truth, stage, staged_laser, staged_rig

RIG = 7


@pytest.mark.parametrize(("name", "number"), [("box", 3), ("walk", 4)])
def test_what_the_laser_reads_stands_where_the_camera_sees_it(name: str, number: int) -> None:
    """Its readings, brought into the left camera by the pose that is told, lie on what that one's rays meet."""
    staged, rig = stage(name, number, rig=RIG), staged_rig(RIG).rectify()
    ranges = VirtualLidar(height_mm=staged.laser_height_mm).truth_mm(staged.scene, staged.laser_pose)
    flat = points_mm(LaserScan(ranges, np.ones(360)))
    in_left = np.column_stack([flat, np.zeros(len(flat)), np.ones(len(flat))]) @ staged.T_left_laser.T[:, :3]
    in_rectified = in_left @ rig.R1.T
    pixels = in_rectified @ rig.P1[:, :3].T
    columns, rows = np.rint(pixels[:, :2] / pixels[:, 2:]).astype(int).T
    depth_mm = render_truth(staged.scene, rig, staged.T_left_world).depth_mm
    height, width = depth_mm.shape
    is_seen = (pixels[:, 2] > 0) & (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    off_mm = np.abs(depth_mm[rows[is_seen], columns[is_seen]] - in_rectified[is_seen, 2])
    assert is_seen.sum() > 30
    assert (off_mm < 5).mean() > 0.9, "but where the camera's line of sight is blocked"


def test_each_rig_has_a_laser_in_a_place_of_its_own() -> None:
    places = np.array([staged_laser(number) for number in range(1, 40)])
    assert len(np.unique(places, axis=0)) == 39 and np.abs(places[:, :2]).max() <= 25
    assert np.ptp(places, axis=0).min() > 0.05
    usual, own = (stage("box", 2, rig=number) for number in (0, RIG))
    assert usual.sizes_mm == own.sizes_mm and usual.laser_pose != own.laser_pose == staged_laser(RIG)
