"""What the virtual rig looks at: boxes, boards and a room, their surfaces, and the lights.

Everything solid is a box: the cube, the checkerboard (a thin one), and the room (one seen from inside).
World frame: x forward, y left, z up, millimetres, origin on the floor below the left camera.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from stereolib.rig import rigid

Array = np.ndarray
Triple = tuple[float, float, float]


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
    """

    color_bgr: Triple = (0.5, 0.5, 0.5)
    contrast: float = 0.0
    scale_mm: float = 6.0
    seed: int = 0
    gloss: float = 0.0
    roughness: float = 0.2
    checker: tuple[int, int, float] | None = None


@dataclass(frozen=True, eq=False)
class Box:
    """A box of size (3,) mm whose centre frame stands at ``T_world_box`` (4, 4).

    `inside` turns it into a room. `materials` is one material, or six for the faces -x +x -y +y -z +z.
    """

    size_mm: Triple
    T_world_box: Array
    materials: tuple[Material, ...]
    inside: bool = False

    def __post_init__(self) -> None:
        if not all(s > 0 for s in self.size_mm):
            raise ValueError(f"a box needs three positive sizes in mm, got {self.size_mm}")
        six = self.materials * 6 if len(self.materials) == 1 else self.materials
        if len(six) != 6:
            raise ValueError(f"a box takes 1 or 6 materials, got {len(self.materials)}")
        object.__setattr__(self, "materials", six)


@dataclass(frozen=True)
class Light:
    """A square area light that shines towards the place where the objects stand.

    Parameters
    ----------
    position_mm : (x, y, z)
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
    """Solid boxes, lights, and light from everywhere (`ambient`, same unit as `Light.power`)."""

    boxes: tuple[Box, ...]
    lights: tuple[Light, ...] = (Light((300.0, 700.0, 2300.0)), Light((-300.0, -900.0, 2300.0)))
    ambient: float = 0.25
    names: tuple[str, ...] = field(default=())

    def dimmed(self, level: float) -> Scene:
        """The same scene with all light scaled by `level`."""
        lights = tuple(replace(light, power=light.power * level) for light in self.lights)
        return replace(self, lights=lights, ambient=self.ambient * level)


WOOD: Triple = (0.34, 0.46, 0.58)
FLOOR: Triple = (0.40, 0.42, 0.44)
WALL: Triple = (0.62, 0.64, 0.64)


def box_on_floor(
    size_mm: Triple, x_mm: float, y_mm: float, yaw_rad: float, material: Material = Material(WOOD, 0.45)
) -> Box:
    """A box standing on the floor: the centre of its foot at (x, y), turned about the vertical."""
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return Box(size_mm, rigid(R, [x_mm, y_mm, size_mm[2] / 2]), (material,))


def room(
    floor: Material = Material(FLOOR, 0.35, 9.0, 11),
    wall: Material = Material(WALL, 0.12, 30.0, 12),
    x_mm: tuple[float, float] = (-1800.0, 2400.0),
    y_mm: tuple[float, float] = (-1700.0, 1900.0),
    height_mm: float = 2500.0,
) -> Box:
    """A rectangular room around the rig."""
    size = (x_mm[1] - x_mm[0], y_mm[1] - y_mm[0], height_mm)
    centre = [sum(x_mm) / 2, sum(y_mm) / 2, height_mm / 2]
    return Box(size, rigid(np.eye(3), centre), (wall, wall, wall, wall, floor, wall), inside=True)


def cube_scene(
    distance_mm: float = 700.0,
    *,
    size_mm: Triple = (300.0, 300.0, 300.0),
    yaw_rad: float = np.pi / 4,
    lateral_mm: float = 0.0,
    texture: float = 0.45,
    texture_scale_mm: float = 6.0,
    floor_texture: float = 0.35,
    object_gloss: float = 0.0,
    floor_gloss: float = 0.0,
    light: float = 1.0,
    seed: int = 1,
) -> Scene:
    """The paper's scene (section II.C): a cube on the floor, one vertical edge nearest to the camera.

    Parameters
    ----------
    distance_mm : float
        Horizontal distance from the camera to the object's nearest point.
    texture, floor_texture : float
        Contrast of the surfaces, 0 is plain.
    object_gloss, floor_gloss : float
        0 is matt. Where there is gloss, a low lamp stands where its mirror image falls on the surface.
    light : float
        Level of all light; 1 is a well-lit room.
    """
    if not distance_mm > 0:
        raise ValueError(f"the object's distance must be positive, got {distance_mm} mm")
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    corners = np.array([[a * size_mm[0] / 2, b * size_mm[1] / 2] for a in (-1, 1) for b in (-1, 1)])
    near_mm = (corners @ [c, -s]).min()
    material = Material(WOOD, texture, texture_scale_mm, seed, object_gloss, 0.25)
    box = box_on_floor(size_mm, distance_mm - near_mm, lateral_mm, yaw_rad, material)
    ground = Material(FLOOR, floor_texture, 9.0, seed + 10, floor_gloss, 0.3)
    lights = Scene(()).lights
    if object_gloss:
        lights += tuple(Light((distance_mm + 250.0, y, 280.0), 350.0, 4.0) for y in (-1300.0, 1300.0))
    if floor_gloss:
        lights += tuple(Light((2100.0, y, 330.0), 500.0, 0.5) for y in (-800.0, 900.0))
    return Scene((room(ground), box), lights, names=("room", "cube")).dimmed(light)


def clutter_scene(seed: int, count: int = 16) -> Scene:
    """A disorderly bench: boxes, posts and boards of all textures, some plain, some glossy, before the wall.

    For settings that must hold beyond the cube: many depths, thin objects, occlusions. It fills the view of the
    set-up ``"bench"`` of `virtual.dataset` (level, one metre up) from 0.7 to 2.4 m.
    """
    rng = np.random.default_rng([seed, 77])

    def material() -> Material:
        color = tuple(float(c) for c in rng.uniform(0.08, 0.75, 3))
        contrast = 0.0 if rng.random() < 0.12 else float(rng.uniform(0.04, 0.5))
        gloss = float(rng.uniform(0.1, 0.6)) if rng.random() < 0.2 else 0.0
        scale_mm = float(np.exp(rng.uniform(np.log(2.5), np.log(40))))
        return Material(color, contrast, scale_mm, int(rng.integers(1000)), gloss, 0.3)  # type: ignore[arg-type]

    def thing(kind: int) -> Box:
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

    things = tuple(thing(k % 3) for k in range(count))
    around = room(Material(FLOOR, 0.3, 9.0, seed), Material(WALL, 0.15, 25.0, seed + 1), x_mm=(-1800.0, 2500.0))
    return Scene((around, *things), names=("room", *(f"thing {k + 1}" for k in range(count))))


def board(inner: tuple[int, int], square_mm: float, T_world_board: Array, margin_mm: float | None = None) -> Box:
    """A checkerboard of `inner` = (columns, rows) inner corners; its frame is at the centre, z out of the print."""
    margin = square_mm * 0.8 if margin_mm is None else margin_mm
    width, height = ((n + 1) * square_mm + 2 * margin for n in inner)
    paper = Material((0.86, 0.87, 0.86))
    printed = replace(paper, checker=(inner[0], inner[1], square_mm))
    thick = 4.0
    face = rigid(np.eye(3), [0.0, 0.0, -thick / 2])
    return Box((width, height, thick), T_world_board @ face, (paper,) * 5 + (printed,))
