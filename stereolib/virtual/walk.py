"""A walk of the virtual rig through a room with five boxes: where it stood, and what it looked at.

Four boxes are in the pictures of two of the five stations, from different sides; the fourth box is in those of one, and
another's laser sees two of its faces. The room's frame is the map's: every station's place in it is known, as `POSES`.
"""

from __future__ import annotations

import numpy as np

from stereolib.base import Float64, turn_about_z
from stereolib.rig import rigid
from stereolib.virtual.lidar import VirtualLidar
from stereolib.virtual.scene import FLOOR, WALL, Box, Light, Material, Scene, box_on_floor, room

#: Height of the laser's plane above the floor, mm: all boxes are higher.
LASER_HEIGHT_MM = 60.0
#: Of each station's floor frame in the map: x_mm, y_mm, yaw_rad.
POSES: dict[str, tuple[float, float, float]] = {
    "room/1": (-675.0, -200.0, float(np.radians(50.0))),
    "room/2": (1520.0, -660.0, float(np.radians(123.5))),
    "room/3": (-530.0, -15.0, float(np.radians(-21.0))),
    "room/4": (95.0, 1140.0, float(np.radians(-37.0))),
    "room/5": (1975.0, -495.0, float(np.radians(-178.5))),
}
ROOM_MM = ((-970.0, 2280.0), (-1060.0, 1440.0))
#: Length, width, height (mm); place of the foot's centre (mm) and direction of the length (degrees); colour; texture.
_BOXES = (
    ((400.0, 250.0, 300.0), (772.0, -336.0, 18.0), (0.34, 0.46, 0.58), 6.0),
    ((300.0, 200.0, 200.0), (597.0, -759.0, 171.0), (0.52, 0.42, 0.24), 8.0),
    ((130.0, 100.0, 150.0), (1159.0, 633.0, 87.0), (0.24, 0.30, 0.62), 5.0),
    ((200.0, 160.0, 100.0), (-48.0, 360.0, 71.0), (0.30, 0.52, 0.32), 5.0),
    ((280.0, 180.0, 380.0), (1041.0, 119.0, 80.5), (0.30, 0.56, 0.62), 7.0),
)


def walk_scene() -> Scene:
    """Build the room and its boxes.

    Returns
    -------
    Scene
        Its box 0 is the room, the others are the objects.
    """
    boxes = [
        box_on_floor(size, x, y, float(np.radians(degrees)), Material(color, 0.4, scale_mm, 40 + k))
        for k, (size, (x, y, degrees), color, scale_mm) in enumerate(_BOXES)
    ]
    floor, wall = Material(FLOOR, 0.28, 14.0, 31), Material(WALL, 0.08, 60.0, 32)
    lamps = (Light((100.0, -900.0, 2400.0), 600.0, 0.75), Light((1300.0, 900.0, 2400.0), 600.0, 0.75))
    names = ("room", *(f"box {k + 1}" for k in range(len(boxes))))
    return Scene((room(floor, wall, *ROOM_MM), *boxes), lamps, ambient=0.3, names=names)


def objects() -> tuple[Box, ...]:
    """List the boxes alone.

    Returns
    -------
    tuple of Box
    """
    return walk_scene().boxes[1:]


def nearest_box(place_mm: Float64) -> Box:
    """Find the box that a measured object is: the one whose foot's centre lies nearest to its place.

    Parameters
    ----------
    place_mm : (2,) array
        On the floor, in the map, mm.

    Returns
    -------
    Box

    Examples
    --------
    >>> nearest_box(np.array([1150.0, 630.0])).size_mm
    (130.0, 100.0, 150.0)
    """
    return min(objects(), key=lambda box: float(np.linalg.norm(box.T_world_box[:2, 3] - place_mm)))


def outline_mm(box: Box) -> Float64:
    """Give the corners of a box's foot.

    Parameters
    ----------
    box : Box

    Returns
    -------
    (4, 2) float64, mm
    """
    half = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * np.array(box.size_mm) / 2
    return np.asarray((half @ box.T_world_box[:3, :3].T + box.T_world_box[:3, 3])[:, :2])


def wall_error_mm(ends_mm: Float64) -> float:
    """Tell how far the middle of a wall lies off the room's nearest true one.

    Parameters
    ----------
    ends_mm : (2, 2) array, mm

    Returns
    -------
    float, mm
        Positive outside the room.

    Examples
    --------
    >>> wall_error_mm(np.array([[2285.0, -500.0], [2285.0, 800.0]]))
    5.0
    """
    x, y = np.mean(ends_mm, axis=0)
    (x0, x1), (y0, y1) = ROOM_MM
    return float(min((x0 - x, x - x1, y0 - y, y - y1), key=abs))


def T_map_station(name: str) -> Float64:
    """Give the pose of a station's floor frame in the map.

    Parameters
    ----------
    name : str
        ``"room/1"`` to ``"room/5"``.

    Returns
    -------
    (4, 4) float64
    """
    x, y, yaw = POSES[name]
    return rigid(turn_about_z(yaw), [x, y, 0.0])


def scan_bytes(name: str) -> bytes:
    """Make what the laser of a station sends: five turns, its noise drawn from the station's number.

    Parameters
    ----------
    name : str
        ``"room/1"`` to ``"room/5"``.

    Returns
    -------
    bytes
    """
    rng = np.random.default_rng([8, int(name[-1])])
    return VirtualLidar(height_mm=LASER_HEIGHT_MM).scan(walk_scene(), POSES[name], rng, turns=5)
