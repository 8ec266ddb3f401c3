"""Heights over the floor: against the virtual rig's truth."""

from __future__ import annotations

import numpy as np
import pytest
from support.ground import RECT, nearest_height, photographed, recorded, rng

from stereolib.measurement import (
    AlignedPair,
    CannotMeasure,
    find_objects,
    floor_from_pose,
    measure_height,
)
from stereolib.paper import rig_pose
from stereolib.virtual import cube_scene, recordings, render_truth

SERIES = [f"series/{kind}_{mm}" for kind in recordings.TEXTURES_MM for mm in recordings.DISTANCES_MM[::2]]


def test_heights_of_the_recorded_cubes():
    """Nine recordings of the 30 cm cube: each within 0.3 %, near edge where it stands, and 95 % intervals that hold."""
    scores = []
    for name in SERIES:
        found = nearest_height(*recorded(name), RECT, rng=rng())
        assert found.height_mm == pytest.approx(300, rel=0.003)
        assert found.near_mm == pytest.approx([float(name.split("_")[1]), 0], abs=1.5)
        assert len(found.faces) == 2 and 0.05 < found.height_std_mm < 1
        scores.append((found.height_mm - 300) / found.height_std_mm)
    assert np.abs(scores).max() < 2.6 and np.median(np.abs(scores)) < 1.96


def test_near_edge_in_the_picture():
    """Foot and top of the near edge, in pixels: as the cube projects."""
    left, right, disparity = recorded("conditions/level")
    found = nearest_height(left, right, disparity, RECT, rng=rng())
    pose = recordings.setup("level")
    ends = np.array([[700.0, 0, 0], [700, 0, 300]]) @ (RECT.R1 @ pose[:3, :3]).T + RECT.R1 @ pose[:3, 3]
    pixels = ends[:, :2] / ends[:, 2:] * RECT.f_px + RECT.P1[:2, 2]
    assert np.stack([found.foot_px, found.top_px]) == pytest.approx(pixels, abs=0.6)


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
    found = nearest_height(*photographed(scene, rig_pose(RECT, pitch, camera_height), 1), RECT, rng=rng())
    assert found.height_mm == pytest.approx(size[2], rel=0.01)
    assert abs(found.height_mm - size[2]) < 3 * found.height_std_mm < 0.02 * size[2]


@pytest.mark.parametrize(("name", "reason"), [("glare", "no floor"), ("poor_light", "no floor"), ("plain", "no")])
def test_scenes_that_cannot_be_measured_are_refused(name, reason):
    with pytest.raises(CannotMeasure, match=reason) as caught:
        nearest_height(*recorded(f"conditions/{name}"), RECT, rng=rng())
    assert caught.value.reason in {"no floor", "no texture", "no top edge", "no object"}


def test_a_top_outside_the_picture_is_refused():
    pose = recordings.setup("pitched")
    disparity = render_truth(cube_scene(560.0, size_mm=(300.0, 300.0, 400.0)), RECT, pose).disparity_px
    floor = floor_from_pose(RECT, pose)
    blank = np.zeros((480, 640), np.uint8)
    with pytest.raises(CannotMeasure, match="cut by the frame") as caught:
        measure_height(AlignedPair.of(blank, blank), floor, find_objects(disparity, floor)[0])
    assert caught.value.reason == "cut by the frame"
