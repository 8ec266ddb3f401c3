"""What the emulated cameras and the emulated laser look at: one scene for both, chosen by name and number."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.base import Float64, turn_2d, turn_about_z
from stereolib.paper import paper_rig
from stereolib.rig import Camera, StereoRig, rigid
from stereolib.virtual import laser_boards, recordings, walk
from stereolib.virtual.scene import Material, Scene, cube_scene, room

#: Scenes by name: how many places there are of each.
SCENES = {"cube": 1, "box": 1000, "room": 1, "walk": 5, "laser-board": len(laser_boards.POSES)}
_RIGS = 60  # of the seeds with which rigs are drawn, and boxes
_LASER_MM = 60.0  # height of the laser's plane: below the lowest box's top
_BOARD_MM = 180.0  # of the laser's board: its centre above the floor


@dataclass(frozen=True, eq=False)
class Staged:
    """A scene, and where the rig stands in it.

    Attributes
    ----------
    scene : Scene
    T_left_world : (4, 4) float64
        Of the left camera.
    laser_pose : (x_mm, y_mm, yaw_rad)
    laser_height_mm : float
        Of the laser's plane above the floor.
    sizes_mm : tuple of (length, width, height)
        The true ones of the boxes.
    """

    scene: Scene
    T_left_world: Float64
    laser_pose: tuple[float, float, float]
    laser_height_mm: float = _LASER_MM
    sizes_mm: tuple[tuple[float, float, float], ...] = ()

    @property
    def T_left_laser(self) -> Float64:
        """Where the laser truly stands to the left camera, (4, 4)."""
        x, y, yaw = self.laser_pose
        return np.asarray(self.T_left_world @ rigid(turn_about_z(yaw), [x, y, self.laser_height_mm]))


def stage(name: str, number: int = 1, *, distance_mm: float = 700.0, rig: int = 0) -> Staged:
    """Set a scene before a rig, whose laser stands where `staged_laser` says.

    Parameters
    ----------
    name : str
        One of `SCENES`.
    number : int
        Which place, box or pose of it, from 1 on.
    distance_mm : float
        Of the cube.
    rig : int
        As `staged_rig` counts them.

    Returns
    -------
    Staged

    Raises
    ------
    ValueError
        For another name or number.

    Examples
    --------
    >>> stage("box", 3).sizes_mm == stage("box", 3).sizes_mm != stage("box", 4).sizes_mm
    True
    """
    if name not in SCENES:
        raise ValueError(f"unknown scene {name!r}; choose one of {', '.join(SCENES)}")
    most = SCENES[name]
    if not 1 <= number <= most:
        raise ValueError(f"{name} has the numbers 1 to {most}, got {number}" if most > 1 else f"there is one {name}")
    here, floor = recordings.setup(), (0.0, 0.0, 0.0)
    if name == "walk":
        station = f"room/{number}"
        here, floor = recordings.setup(station), walk.POSES[station]
        scene, sizes = walk.walk_scene(), tuple(_long_first(box.size_mm) for box in walk.objects())
    elif name == "laser-board":
        scene, sizes = laser_boards.board_scene(laser_boards.POSES[number - 1], _BOARD_MM), ()
    elif name == "room":
        scene, sizes = Scene((room(),)), ()
    else:
        scene = cube_scene(distance_mm) if name == "cube" else _box(np.random.default_rng([number, _RIGS]))
        sizes = (_long_first(scene.boxes[1].size_mm),)
    return Staged(scene, here, _after(floor, staged_laser(rig)), sizes_mm=sizes)


def staged_laser(number: int = 0) -> tuple[float, float, float]:
    """Give the place of a rig's laser: below the left camera for 0, the paper's; else up to 25 mm and 2 degrees off.

    Parameters
    ----------
    number : int
        As `staged_rig` counts them.

    Returns
    -------
    x_mm, y_mm, yaw_rad : float
        Ahead, to the left, and counter-clockwise from above.

    Examples
    --------
    >>> staged_laser(0), staged_laser(7) == staged_laser(7) != staged_laser(8)
    ((0.0, 0.0, 0.0), True)
    """
    if number == 0:
        return recordings.LASER_POSE
    x_mm, y_mm, yaw_deg = np.random.default_rng([number, _RIGS, 1]).uniform([-25, -25, -2], [25, 25, 2])
    return float(x_mm), float(y_mm), float(np.radians(yaw_deg))


def staged_rig(number: int = 0) -> StereoRig:
    """Give the rig of a number: 0 is the paper's, every other is drawn.

    Parameters
    ----------
    number : int
        0 or more.

    Returns
    -------
    StereoRig

    Examples
    --------
    >>> staged_rig(7).baseline_mm == staged_rig(7).baseline_mm != staged_rig(8).baseline_mm
    True
    """
    return paper_rig() if number == 0 else draw_rig(np.random.default_rng([number, _RIGS]))


def draw_rig(rng: np.random.Generator) -> StereoRig:
    """Draw a rig like the paper's, every parameter anew: cameras of 640 x 480, 60 to 100 mm apart.

    Focal lengths vary by 5 %, centres by 12 px, the coefficients stay within what webcams have and do not fold
    inside the image, the cameras are turned against each other by about a degree.

    Parameters
    ----------
    rng : numpy.random.Generator

    Returns
    -------
    StereoRig
    """
    cameras = []
    for _ in range(2):
        fx = 730 * rng.uniform(0.95, 1.05)
        cx, cy = rng.uniform([308, 228], [332, 252])
        K = np.array([[fx, 0, cx], [0, fx * rng.uniform(0.997, 1.003), cy], [0, 0, 1]])
        dist = rng.uniform([-0.15, -0.2, -0.003, -0.003, -0.3], [0.1, 0.3, 0.003, 0.003, 0.3])
        cameras.append(Camera(K, dist, (640, 480)))
    R = cv2.Rodrigues(rng.normal(0, np.radians(0.7), 3))[0]
    return StereoRig(cameras[0], cameras[1], R, rng.uniform([-100, -2, -2], [-60, 2, 2]))


def _box(rng: np.random.Generator) -> Scene:
    """A carton whole in both pictures, two of its sides in sight."""
    distance, yaw, lateral = rng.uniform([750, np.radians(25), -60], [950, np.radians(65), 60])
    length, width, height = np.round(rng.uniform([200, 140, 110], [380, 260, 0.33 * distance]))
    color = rng.uniform(0.3, 0.7, 3)
    carton = Material((color[0], color[1], color[2]), 0.4, float(rng.uniform(4, 9)), int(rng.integers(1000)))
    size = float(length), float(width), float(height)
    return cube_scene(float(distance), size_mm=size, yaw_rad=float(yaw), lateral_mm=float(lateral), cube=carton)


def _after(one: tuple[float, float, float], other: tuple[float, float, float]) -> tuple[float, float, float]:
    """A place on the floor that is told from another place on it."""
    x_mm, y_mm = one[:2] + turn_2d(one[2]) @ np.array(other[:2])
    return float(x_mm), float(y_mm), one[2] + other[2]


def _long_first(size_mm: tuple[float, float, float]) -> tuple[float, float, float]:
    one, other, height = size_mm
    return max(one, other), min(one, other), height
