"""What the virtual rig looks at: boxes, boards and a room, their surfaces, and the lights.

Everything solid is a box: the cube, the checkerboard (a thin one), and the room (one seen from inside).
World frame: x forward, y left, z up, millimetres, origin on the floor below the left camera.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from stereolib.base import Float64, set_frozen, turn_2d, turn_about_z
from stereolib.rig import rigid
from stereolib.virtual.texture import Tile

Triple: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True)
class Material:
    """How a surface looks.

    Parameters
    ----------
    color_bgr : three floats, 0..1
        Mean diffuse reflectance.
    contrast : float, 0..1
        Standard deviation of the texture relative to the mean; 0 is a plain surface.
    scale_mm : float
        Size of the texture's features (correlation length).
    seed : int
        Which texture.
    gloss : float, 0..1
        Strength of glare and mirror image; 0 is matt.
    roughness : float, 0..1
        Width of the glare (GGX alpha).
    checker : (inner columns, inner rows, square_mm) or None
        A checkerboard instead of the texture, on the +z face, centred.
    tile : Tile, optional
        A pattern of its own instead of the noise of `seed` and `scale_mm`.
    """

    color_bgr: Triple = (0.5, 0.5, 0.5)
    contrast: float = 0.0
    scale_mm: float = 6.0
    seed: int = 0
    gloss: float = 0.0
    roughness: float = 0.2
    checker: tuple[int, int, float] | None = None
    tile: Tile | None = None


@dataclass(frozen=True, eq=False)
class Box:
    """A box, or a room seen from inside.

    Parameters
    ----------
    size_mm : three floats, mm
    T_world_box : (4, 4) array
        Where its centre stands, and how it is turned.
    materials : tuple of Material
        One, or six for the faces -x +x -y +y -z +z.
    inside : bool
        It is a room.

    Raises
    ------
    ValueError
        If a size is not positive, or for another number of materials.
    """

    size_mm: Triple
    T_world_box: Float64
    materials: tuple[Material, ...]
    inside: bool = False

    def __post_init__(self) -> None:
        if not all(s > 0 for s in self.size_mm):
            raise ValueError(f"a box needs three positive sizes in mm, got {self.size_mm}")
        six = self.materials * 6 if len(self.materials) == 1 else self.materials
        if len(six) != 6:
            raise ValueError(f"a box takes 1 or 6 materials, got {len(self.materials)}")
        set_frozen(self, materials=six)


@dataclass(frozen=True)
class Light:
    """A square area light that shines towards the place where the objects stand.

    Parameters
    ----------
    position_mm : (x, y, z), mm
    size_mm : float
        Edge of the square: the larger, the softer the shadow.
    power : float
        Irradiance it gives to a surface that faces it at 2 m; white paper then sends 1 (the webcam's white).
    """

    position_mm: Triple
    size_mm: float = 600.0
    power: float = 0.7


@dataclass(frozen=True, eq=False)
class Scene:
    """Solid boxes and the light that falls on them.

    Parameters
    ----------
    boxes : tuple of Box
    lights : tuple of Light
    ambient : float
        Light from everywhere, in the unit of `Light.power`.
    names : tuple of str
        What the boxes are called.
    """

    boxes: tuple[Box, ...]
    lights: tuple[Light, ...] = (Light((300.0, 700.0, 2300.0)), Light((-300.0, -900.0, 2300.0)))
    ambient: float = 0.25
    names: tuple[str, ...] = ()

    def dimmed(self, level: float) -> Scene:
        """Scale all light.

        Parameters
        ----------
        level : float
            1 leaves it as it is.

        Returns
        -------
        Scene
        """
        lights = tuple(replace(light, power=light.power * level) for light in self.lights)
        return replace(self, lights=lights, ambient=self.ambient * level)


WOOD: Triple = (0.34, 0.46, 0.58)
FLOOR: Triple = (0.40, 0.42, 0.44)
WALL: Triple = (0.62, 0.64, 0.64)
#: Surfaces of the paper's scene.
CUBE_SURFACE = Material(WOOD, contrast=0.45, scale_mm=6.0, seed=1, roughness=0.25)
FLOOR_SURFACE = Material(FLOOR, contrast=0.35, scale_mm=9.0, seed=11, roughness=0.3)
WALL_SURFACE = Material(WALL, contrast=0.12, scale_mm=30.0, seed=12)
_RIM_SQUARES = 0.8  # white rim of a printed board beyond its squares, in squares
_BOARD_THICK_MM = 4.0


def box_on_floor(
    size_mm: Triple, x_mm: float, y_mm: float, yaw_rad: float, material: Material = Material(WOOD, 0.45)
) -> Box:
    """Stand a box on the floor.

    Parameters
    ----------
    size_mm : three floats, mm
    x_mm, y_mm : float
        The centre of its foot, mm.
    yaw_rad : float
        Its turn about the vertical, rad.
    material : Material

    Returns
    -------
    Box

    Examples
    --------
    >>> box_on_floor((300, 300, 200), 700, 0, 0.0).T_world_box[:3, 3]
    array([700.,   0., 100.])
    """
    return Box(size_mm, rigid(turn_about_z(yaw_rad), [x_mm, y_mm, size_mm[2] / 2]), (material,))


def room(
    floor: Material = FLOOR_SURFACE,
    wall: Material = WALL_SURFACE,
    x_mm: tuple[float, float] = (-1800.0, 2400.0),
    y_mm: tuple[float, float] = (-1700.0, 1900.0),
    height_mm: float = 2500.0,
) -> Box:
    """Build a rectangular room around the rig.

    Parameters
    ----------
    floor, wall : Material
    x_mm, y_mm : (low, high)
        Where its walls stand, mm.
    height_mm : float

    Returns
    -------
    Box
        Seen from inside.
    """
    size = (x_mm[1] - x_mm[0], y_mm[1] - y_mm[0], height_mm)
    centre = [sum(x_mm) / 2, sum(y_mm) / 2, height_mm / 2]
    return Box(size, rigid(np.eye(3), centre), (wall, wall, wall, wall, floor, wall), inside=True)


def cube_scene(
    distance_mm: float = 700.0,
    *,
    size_mm: Triple = (300.0, 300.0, 300.0),
    yaw_rad: float = np.pi / 4,
    lateral_mm: float = 0.0,
    cube: Material = CUBE_SURFACE,
    floor: Material = FLOOR_SURFACE,
) -> Scene:
    """Build the paper's scene: a cube on the floor, one vertical edge nearest to the camera.

    Parameters
    ----------
    distance_mm : float
        Horizontal distance from the camera to the object's nearest point, mm.
    size_mm : three floats, mm
    yaw_rad : float
        The object's turn about the vertical, rad.
    lateral_mm : float
        How far to the left its centre stands, mm.
    cube, floor : Material
        Their surfaces. Where there is gloss, a low lamp stands where its mirror image falls on the surface.

    Returns
    -------
    Scene
        Its boxes are ``"room"`` and ``"cube"``.

    Raises
    ------
    ValueError
        If the distance is not positive.

    References
    ----------
    The paper, section II.C.

    Examples
    --------
    >>> scene = cube_scene(700.0, yaw_rad=0.0)
    >>> scene.names, scene.boxes[1].T_world_box[:3, 3]
    (('room', 'cube'), array([850.,   0., 150.]))
    """
    if not distance_mm > 0:
        raise ValueError(f"the object's distance must be positive, got {distance_mm} mm")
    corners = np.array([[a * size_mm[0] / 2, b * size_mm[1] / 2] for a in (-1, 1) for b in (-1, 1)])
    near_mm = (corners @ turn_2d(yaw_rad)[0]).min()
    box = box_on_floor(size_mm, distance_mm - near_mm, lateral_mm, yaw_rad, cube)
    lights = Scene(()).lights
    if cube.gloss:
        lights += tuple(Light((distance_mm + 250.0, y, 280.0), 350.0, 4.0) for y in (-1300.0, 1300.0))
    if floor.gloss:
        lights += tuple(Light((2100.0, y, 330.0), 500.0, 0.5) for y in (-800.0, 900.0))
    return Scene((room(floor), box), lights, names=("room", "cube"))


def clutter_scene(seed: int, count: int = 16) -> Scene:
    """Build a disorderly bench: boxes, posts and boards of all textures, some plain, some glossy, before the wall.

    For settings that must hold beyond the cube: many depths, thin objects, occlusions. It fills the view of the
    set-up ``"bench"`` of `recordings.setup` (level, one metre up) from 0.7 to 2.4 m.

    Parameters
    ----------
    seed : int
        Another one is another scene.
    count : int
        Number of objects.

    Returns
    -------
    Scene
    """
    rng = np.random.default_rng([seed, 77])

    def material() -> Material:
        blue, green, red = (float(c) for c in rng.uniform(0.08, 0.75, 3))
        contrast = 0.0 if rng.random() < 0.12 else float(rng.uniform(0.04, 0.5))
        gloss = float(rng.uniform(0.1, 0.6)) if rng.random() < 0.2 else 0.0
        scale_mm = float(np.exp(rng.uniform(np.log(2.5), np.log(40))))
        return Material((blue, green, red), contrast, scale_mm, int(rng.integers(1000)), gloss, 0.3)

    def solid(kind: int) -> Box:
        x_mm = float(rng.uniform(750, 2000))
        y_mm, z_mm = float(rng.uniform(-0.48, 0.48)) * x_mm, 1000 + float(rng.uniform(-0.34, 0.3)) * x_mm
        long, wide, thin = float(rng.uniform(350, 900)), float(rng.uniform(120, 420)), float(rng.uniform(8, 45))
        size = ((wide, wide * 0.8, 0.7 * wide), (thin, thin, long), (thin, wide, 0.8 * wide))[kind]
        turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
        turn *= np.linalg.det(turn)
        tilt, _ = np.linalg.qr(np.eye(3) + 0.35 * rng.standard_normal((3, 3)))
        R = turn if kind == 1 else tilt * np.sign(np.diag(tilt))
        R *= np.linalg.det(R)  # a rotation, whatever the signs were
        return Box(size, rigid(R, [x_mm, y_mm, z_mm]), tuple(material() for _ in range(6)))

    solids = tuple(solid(k % 3) for k in range(count))
    around = room(Material(FLOOR, 0.3, 9.0, seed), Material(WALL, 0.15, 25.0, seed + 1), x_mm=(-1800.0, 2500.0))
    return Scene((around, *solids), names=("room", *(f"object {k + 1}" for k in range(count))))


def board_box(inner: tuple[int, int], square_mm: float, T_world_board: Float64) -> Box:
    """Make a printed checkerboard with a white rim.

    Parameters
    ----------
    inner : (columns, rows)
        Its inner corners.
    square_mm : float
    T_world_board : (4, 4) array
        Its frame is at the centre, z out of the print.

    Returns
    -------
    Box
        Thin, the print on its +z face.
    """
    margin = square_mm * _RIM_SQUARES
    width, height = ((n + 1) * square_mm + 2 * margin for n in inner)
    paper = Material((0.86, 0.87, 0.86))
    printed = replace(paper, checker=(inner[0], inner[1], square_mm))
    face = rigid(np.eye(3), [0.0, 0.0, -_BOARD_THICK_MM / 2])
    return Box((width, height, _BOARD_THICK_MM), T_world_board @ face, (paper,) * 5 + (printed,))
