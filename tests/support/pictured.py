"""Boxes of the virtual rig as both cameras show them, and their faces followed; each rendered once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import cv2
import numpy as np

from stereolib.base import Float64
from stereolib.measurement import Instrument, Views, find_floor, find_objects
from stereolib.measurement.box import Box, Own, Shared, World
from stereolib.measurement.faces import find_face
from stereolib.measurement.follow import Stretch, follow_face
from stereolib.measurement.pictured import Pictured, see_box
from stereolib.measurement.scene_solver import Priors
from stereolib.measurement.standing import scene_priors
from stereolib.paper import rig_pose
from stereolib.rig import rigid
from stereolib.virtual import CUBE_SURFACE, Webcam, box_on_floor, cube_scene, recordings, render_pair
from support.boxes import RECT

HIGH = (np.radians(-20), 450.0)  # pitch and height of the camera


@dataclass(frozen=True, eq=False)
class Shown:
    """A box, seen."""

    views: Views
    priors: Priors
    world: World
    regions: list

    def stretch(self) -> Stretch:
        face = find_face(self.priors.floor, self.regions[0], self.views.pair)
        return follow_face(self.views, self.world, face, self.regions[0].top_mm)

    def box(self) -> Pictured:
        return see_box(self.views, self.priors, self.regions[0])


def of_pair(left, right):
    views = Views.of_rectified(left, right)
    floor = find_floor(views, RECT)
    priors = scene_priors(views, Instrument(RECT), floor)
    return Shown(views, priors, priors.world(np.zeros(len(Shared))), find_objects(views.disparity_px, floor))


@cache
def recorded(name):
    return of_pair(*RECT.rectify(*recordings.load_pair(name)))


@cache
def rendered(distance, size_mm, yaw_deg, *, lateral=0.0, camera=None, up_mm=0.0, lean_deg=0.0, before_mm=None):
    """A box on the floor; or held above it; or leaning forwards, on its lower edge.

    `before_mm` is the height of a board that lies before it, 60 mm deep and half a metre wide.
    """
    scene = cube_scene(distance, size_mm=size_mm, yaw_rad=np.radians(yaw_deg), lateral_mm=lateral)
    around, box = scene.boxes
    c, s = np.cos(np.radians(lean_deg)), np.sin(np.radians(lean_deg))
    T = box.T_world_box @ rigid([[c, 0, s], [0, 1, 0], [-s, 0, c]], np.zeros(3))
    signs = np.array([[a, b, c, 2] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]) / 2
    lowest = (T @ (signs * [*size_mm, 1]).T)[2].min()
    box = replace(box, T_world_box=rigid(np.eye(3), [0.0, 0.0, up_mm - lowest]) @ T)
    pose = recordings.setup("level") if camera is None else rig_pose(RECT, *camera)
    boxes, names = (around, box), scene.names
    if before_mm is not None:
        other = replace(CUBE_SURFACE, seed=77)
        boxes, names = (*boxes, box_on_floor((60, 500, before_mm), distance - 150, 0.0, 0.0, other)), (*names, "board")
    pictures = render_pair(replace(scene, boxes=boxes, names=names), RECT.rig, pose, samples=1, light_samples=1)
    shots = [Webcam().shoot(p, np.random.default_rng([9, k])) for k, p in enumerate(pictures)]
    return of_pair(*RECT.rectify(*shots))


def true_box(distance, size_mm, yaw_deg, lateral=0.0) -> Float64:
    """Parameters of a box that is turned by less than a quarter, its near corner first."""
    x, y, height = size_mm
    yaw = np.radians(yaw_deg)
    scene = cube_scene(distance, size_mm=size_mm, yaw_rad=yaw, lateral_mm=lateral)
    T = scene.boxes[1].T_world_box
    own = np.zeros(len(Own))
    # The face with the normal -x is right of the corner, the one with +y or -y left of it.
    corners = (T @ np.array([[-x / 2, s * y / 2, -height / 2, 1.0] for s in (-1, 1)]).T)[:2].T
    own[[Own.X, Own.Y]] = corners[1] if yaw > 0 else corners[0]
    own[[Own.TURN, Own.RIGHT, Own.LEFT]] = (yaw, y, x) if yaw > 0 else (yaw + np.pi / 2, x, y)
    own[Own.HEIGHT] = height
    return own


def masks(shown: Shown, own: Float64) -> list[np.ndarray]:
    """Where a box is in either picture: bool."""
    corners, found = np.array([[a, b, c] for a in (0, 1) for b in (0, 1) for c in (0.0, 1.0)]), []
    for right, picture in enumerate(shown.views.pair.pictures):
        hull = cv2.convexHull(np.rint(shown.world.pixels(Box(own).points(corners), bool(right))).astype(np.int32))
        found.append(cv2.fillConvexPoly(np.zeros(picture.shape[:2], np.uint8), hull, 1) == 1)
    return found
