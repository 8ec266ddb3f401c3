"""A box before the rig, and what cameras and laser see of it by the model itself: exact, or drawn with its errors."""

from __future__ import annotations

import numpy as np

from stereolib.measurement import LaserOnFloor, floor_from_pose
from stereolib.measurement.box import Box, Edge, Own, Shared, Side
from stereolib.measurement.observations import EdgeSeen, EndBetweenBeams, PlaneSeen, RangesSeen, weak_priors, whitening
from stereolib.measurement.outline import predicted
from stereolib.measurement.scene_solver import Priors
from stereolib.virtual import recordings

RECT = recordings.rectified()
FLOOR = floor_from_pose(
    RECT, recordings.setup(), height_std_mm=0.5, pitch_std_rad=np.radians(0.03), roll_std_rad=np.radians(0.03)
)
HERE = LaserOnFloor(np.eye(2), np.zeros(2), np.diag([1.0, 1.0, np.radians(0.2) ** 2, 2e-3**2]), bias_mm=0.5)
PRIORS = Priors(FLOOR, HERE, np.diag([0.03, 0.03, 2e-4, 2e-4]) ** 2)
STILL = np.zeros(len(Shared))
#: Near corner at (700, 20), right side 300 mm, left side 200 mm, height 250 mm.
OWN = np.array([700.0, 20.0, np.radians(40), 300.0, 200.0, 250.0, 0.0, 0.0])
OTHER = np.array([950.0, -180.0, np.radians(15), 150.0, 260.0, 180.0, 0.0, 0.0])
PLANE_STD = np.array([2e-4, 2e-4, 0.02])
EDGE_PX, SIGMA_MM, GAP_MM = 0.15, 3.0, 12.0
EDGES = (Edge.CORNER, Edge.RIGHT_END, Edge.LEFT_END, Edge.TOP_RIGHT, Edge.TOP_LEFT)


def shared(**values):
    """Shared parameters by name, others 0."""
    x = STILL.copy()
    for name, value in values.items():
        x[Shared[name.upper()]] = value
    return x


def planes(world, own, rng=None, sides=Side):
    found = []
    for side in sides:
        box = Box(own)
        shares = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1.0]])
        centre = world.pixels(box.points(shares if side is Side.RIGHT else shares[:, [1, 0, 2]])).mean(axis=0)
        plane = world.disparity_plane(np.append(box.normal(side), 0.0), box.distance(side))
        coefficients = np.array([*plane[:2], plane[:2] @ centre + plane[2]])
        coefficients = coefficients + (0 if rng is None else rng.normal(0, PLANE_STD))
        found.append(PlaneSeen(centre, coefficients, whitening(np.diag(PLANE_STD**2)), side))
    return found


def edges(world, own, rng=None, some=EDGES):
    found = []
    for edge in some:
        at = predicted(edge, world, own)
        off = 0.0 if rng is None else rng.normal(0, EDGE_PX)
        found.append(EdgeSeen(edge, at.point_px + off * at.across, at.across, EDGE_PX))
    return found


def _in_laser_frame(world, points):
    c, s = np.cos(float(world.laser_yaw)), np.sin(float(world.laser_yaw))
    return (points - world.laser_place) @ np.array([[c, -s], [s, c]])


def readings(world, own, rng=None, sides=Side):
    """Fifteen readings on each face."""
    found = []
    for side in sides:
        shares = np.zeros((15, 3))
        shares[:, 0 if side is Side.RIGHT else 1] = np.linspace(0.05, 0.95, 15)
        points = _in_laser_frame(world, Box(own).points(shares)[:, :2])
        ranges = np.linalg.norm(points, axis=1)
        error = 0.0 if rng is None else rng.normal(0, SIGMA_MM, 15)
        beams, sigma = points / ranges[:, None], np.full(15, SIGMA_MM)
        told = (ranges + own[side.bias] + error) / (1 - world.laser_scale)
        found.append(RangesSeen(side, np.zeros((15, 2)), beams, told, sigma))
    return found


def ends(world, own, rng=None, some=((Side.RIGHT, False), (Side.LEFT, False))):
    """Two beams, 12 mm apart on the face's line, between which it ends."""
    found = []
    for side, at_corner in some:
        middle = 0.0 if rng is None else rng.uniform(-0.5, 0.5) * GAP_MM
        along = middle + np.array([-0.5, 0.5]) * GAP_MM
        extent = own[side.extent]
        shares = np.zeros((2, 3))
        shares[:, 0 if side is Side.RIGHT else 1] = ((0.0 if at_corner else extent) + along) / extent
        points = _in_laser_frame(world, Box(own).points(shares)[:, :2])
        beams = points / np.linalg.norm(points, axis=1)[:, None]
        found.append(EndBetweenBeams(side, at_corner, np.zeros((2, 2)), beams))
    return found


def start(own=OWN):
    """About where a box is looked for."""
    x = own + np.array([4.0, -3.0, 0.01, 5.0, -5.0, 4.0, 0.0, 0.0])
    x[[Own.RIGHT_BIAS, Own.LEFT_BIAS]] = 0.0
    return x


def pictured(world, own=OWN, rng=None):
    return [*weak_priors(start(own), HERE.bias_mm), *planes(world, own, rng), *edges(world, own, rng)]


def everything(world, own=OWN, rng=None):
    return [*pictured(world, own, rng), *readings(world, own, rng), *ends(world, own, rng)]
