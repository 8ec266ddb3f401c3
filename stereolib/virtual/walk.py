"""A walk of the virtual rig through a room with five boxes: where it stood, and what it looked at.

Each box is seen by two of the five stations, from different sides; one station sees only one face of one of them. The
room's frame is the map's: every station's place in it is known, as `POSES`.
"""

from __future__ import annotations

import numpy as np

from stereolib.rig import rigid
from stereolib.virtual.lidar import VirtualLidar
from stereolib.virtual.scene import FLOOR, WALL, Box, Light, Material, Scene, box_on_floor, room

Array = np.ndarray
#: Height of the laser's plane above the floor, mm: all boxes are higher.
LASER_HEIGHT_MM = 60.0
#: Of each station's floor frame in the map: x_mm, y_mm, yaw_rad.
POSES: dict[str, tuple[float, float, float]] = {
    "room/1": (165.0, 840.0, float(np.radians(-29.0))),
    "room/2": (430.0, 1095.0, float(np.radians(-84.0))),
    "room/3": (1860.0, 1175.0, float(np.radians(-127.0))),
    "room/4": (-575.0, 785.0, float(np.radians(-40.5))),
    "room/5": (1470.0, -950.0, float(np.radians(145.5))),
}
ROOM_MM = ((-870.0, 2180.0), (-1220.0, 1480.0))
#: Length, width, height (mm); place of the foot's centre (mm) and direction of the length (degrees); colour; texture.
_BOXES = (
    ((400.0, 250.0, 300.0), (712.0, -217.0, 157.0), (0.34, 0.46, 0.58), 6.0),
    ((300.0, 200.0, 200.0), (250.0, -363.0, 172.0), (0.52, 0.42, 0.24), 8.0),
    ((130.0, 100.0, 150.0), (1080.0, 395.0, 26.5), (0.24, 0.30, 0.62), 5.0),
    ((200.0, 160.0, 100.0), (302.0, 193.0, 178.0), (0.30, 0.52, 0.32), 5.0),
    ((280.0, 180.0, 380.0), (1156.0, -8.0, 83.0), (0.30, 0.56, 0.62), 7.0),
)


def walk_scene() -> Scene:
    """The room and its boxes. Scene's box 0 is the room, the others are the objects."""
    boxes = [
        box_on_floor(size, x, y, float(np.radians(degrees)), Material(color, 0.4, scale_mm, 40 + k))
        for k, (size, (x, y, degrees), color, scale_mm) in enumerate(_BOXES)
    ]
    floor, wall = Material(FLOOR, 0.28, 14.0, 31), Material(WALL, 0.08, 60.0, 32)
    lamps = (Light((100.0, -900.0, 2400.0), 600.0, 0.75), Light((1300.0, 900.0, 2400.0), 600.0, 0.75))
    names = ("room", *(f"box {k + 1}" for k in range(len(boxes))))
    return Scene((room(floor, wall, *ROOM_MM), *boxes), lamps, ambient=0.3, names=names)


def objects() -> tuple[Box, ...]:
    """The boxes alone."""
    return walk_scene().boxes[1:]


def T_map_station(name: str) -> Array:
    """Pose (4, 4) of a station's floor frame in the map."""
    x, y, yaw = POSES[name]
    c, s = np.cos(yaw), np.sin(yaw)
    return rigid(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), [x, y, 0.0])


def scan_bytes(name: str, turns: int = 5) -> bytes:
    """What the laser of a station sends: whole turns, its noise drawn from the station's number."""
    rng = np.random.default_rng([8, int(name[-1])])
    return VirtualLidar(height_mm=LASER_HEIGHT_MM).scan(walk_scene(), POSES[name], rng, turns)
