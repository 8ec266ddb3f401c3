"""Virtual boxes of known size, photographed and scanned by rigs that were calibrated: what measured sizes are held to.

A `BoxScene` says what stands where and what sees it; `shoot` records it, `recorded` keeps the pictures on disk, since
they take longer than measuring them; `instrument` and its like are the rigs as their owner knows them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from stereolib import laser, paper
from stereolib.base import ROOT, Float64, UInt8, write_atomic
from stereolib.calibration import (
    LaserBoardView,
    StereoCalibration,
    board_pose,
    calibrate_lidar_to_camera,
    calibrate_stereo,
    find_board_in_scan,
    find_in_pairs,
    rig_covariance,
)
from stereolib.measurement import (
    Instrument,
    MeasuredObject,
    Measurement,
    Source,
    SystematicUncertainty,
    measure_objects,
)
from stereolib.reproduction import code_sha256
from stereolib.rig import Camera, StereoRig, read_pair, rigid
from stereolib.virtual import VirtualLidar, Webcam, cube_scene, laser_boards, recordings, render_pair
from stereolib.virtual.scene import CUBE_SURFACE, FLOOR_SURFACE, Box, Material, Scene
from support import surfaces
from support.corners import corner_set, draw_rig

NAMES = ("length", "width", "height", "volume")
SENSOR = VirtualLidar(height_mm=60.0)  # below the lowest box's top
HIGH_MM, HIGH_PITCH_RAD = 450.0, np.radians(-20.0)
CACHE = ROOT / "benchmarks" / ".cache"
_BORDER_PX = 3.0  # a corner so near the border of the picture is not in it: a point's blur ends there
SEEN_PX = 2.0  # a face that is narrower in both pictures is no face: its two edges are one
WIDE_PX = 12.0  # an edge that is known to half a pixel tells the width of a face so wide to 4 %
_NEIGHBOURS = 10**8  # seeds of the boxes beside others
_MISTAKEN_MM = 450.0  # what stands farther from the box than any of its corners is something else
#: What the pictures depend on: others are rendered when it changes.
_RENDERER = (
    "rig/camera.py",
    *(f"virtual/{name}.py" for name in ("scene", "texture", "ray_casting", "rendering", "webcam")),
)


Surface = Callable[[np.random.Generator], Material]


@dataclass(frozen=True, eq=False)
class BoxScene:
    """A box before a rig, and the truth of both.

    Attributes
    ----------
    seed : int
        Of the noise of cameras and laser; no two scenes have the same.
    scene : Scene
        ``"room"`` and ``"cube"``.
    distance_mm : float
        Horizontal distance of the box's nearest point.
    T_left_world : (4, 4) float64
    rig : StereoRig
        The true one.
    sensor : VirtualLidar
    laser_pose : (x_mm, y_mm, yaw_rad)
        The true one, in the world.
    samples, light_samples : int
        As for `stereolib.virtual.render`.
    """

    seed: int
    scene: Scene
    distance_mm: float
    T_left_world: Float64
    rig: StereoRig
    sensor: VirtualLidar = SENSOR
    laser_pose: tuple[float, float, float] = recordings.LASER_POSE
    samples: int = 1
    light_samples: int = 4

    @property
    def box(self) -> Box:
        """The box itself."""
        return self.scene.boxes[1]

    @property
    def size_mm(self) -> Float64:
        """Sizes along the box's own x, y and z, (3,)."""
        return np.array(self.box.size_mm)

    @property
    def yaw_rad(self) -> float:
        """Turn of the box's x about the vertical."""
        x, y = self.box.T_world_box[:2, 0]
        return float(np.arctan2(y, x))

    def sides_mm(self) -> Float64:
        """Length, width and height as they are told: the longer side first, (3,)."""
        a, b, height = self.size_mm
        return np.array([max(a, b), min(a, b), height])


@dataclass(frozen=True, eq=False)
class Shot:
    """One scene as recorded: pictures as the webcams sent them, and the average of five turns of the laser."""

    left: UInt8
    right: UInt8
    scan: laser.LaserScan | None
    truth: BoxScene


def box_scene(
    seed: int, *, box: Mapping[str, Any] = {}, floor: Mapping[str, Any] = {}, light: float = 1.0, light_samples: int = 4
) -> BoxScene:
    """Stand a box of 10 to 40 cm in each direction, 0.5 to 1.2 m away, at any yaw, before the recordings' rig."""
    rng = np.random.default_rng([601, seed])
    size, distance = rng.uniform(100, 400, 3), float(rng.uniform(500, 1200))
    yaw, lateral = float(rng.uniform(0, np.pi)), float(rng.uniform(-0.12, 0.12) * distance)
    contrast, scale, texture = rng.uniform(0.35, 0.5), rng.uniform(4, 9), int(rng.integers(1, 10**6))
    surface = replace(CUBE_SURFACE, contrast=contrast, scale_mm=scale, seed=texture)
    scene = cube_scene(
        distance, size_mm=tuple(size), yaw_rad=yaw, lateral_mm=lateral, cube=replace(surface, **box),
        floor=replace(FLOOR_SURFACE, **{"seed": texture + 10, **floor}),
    ).dimmed(light)  # fmt: skip
    return BoxScene(seed, scene, distance, recordings.setup(), paper.paper_rig(), light_samples=light_samples)


def plain_scene(seed: int) -> BoxScene:
    """A `box_scene` that renders sooner: shadows of fewer points."""
    return box_scene(seed, light_samples=2)


def faint_scene(seed: int) -> BoxScene:
    """Surfaces of little contrast, as linoleum and cartons without print have it."""
    box, floor = (float(c) for c in np.random.default_rng([617, seed]).uniform([0.1, 0.05], [0.2, 0.1]))
    return box_scene(seed, box={"contrast": box}, floor={"contrast": floor}, light_samples=2)


def high_scene(seed: int) -> BoxScene:
    """The same rig, 450 mm above the floor, looking down by 20 degrees."""
    pose = paper.rig_pose(recordings.rectified(), pitch_rad=HIGH_PITCH_RAD, camera_height_mm=HIGH_MM)
    return replace(plain_scene(seed), T_left_world=pose)


def own_scene(seed: int) -> BoxScene:
    """A scene that shares nothing with another: rig, its height and pitch, laser's place, box, surfaces, light."""
    rng = np.random.default_rng([611, seed])
    rig = draw_rig(rng)
    size, distance = rng.uniform(100, 400, 3), float(rng.uniform(500, 1200))

    def surface(like: Material, scale_mm: tuple[float, float], contrast: tuple[float, float]) -> Material:
        color = tuple(np.array(like.color_bgr) * rng.uniform(0.75, 1.25))
        return replace(like, color_bgr=color, contrast=float(rng.uniform(*contrast)),
                       scale_mm=float(rng.uniform(*scale_mm)), seed=int(rng.integers(1, 10**6)))  # fmt: skip

    scene = cube_scene(
        distance, size_mm=tuple(size), yaw_rad=float(rng.uniform(0, np.pi)),
        lateral_mm=float(rng.uniform(-0.12, 0.12) * distance), cube=surface(CUBE_SURFACE, (4, 9), (0.3, 0.5)),
        floor=surface(FLOOR_SURFACE, (5, 14), (0.25, 0.45)),
    )  # fmt: skip
    height = float(rng.uniform(60, 300))
    pitch = float(np.arctan2(rng.uniform(0.3, 0.7) * size[2] - height, distance))  # towards the box
    pose = paper.rig_pose(rig.rectify(), pitch_rad=pitch, camera_height_mm=height)
    sensor = replace(SENSOR, height_mm=float(rng.uniform(40, 90)))
    x, y, yaw = (float(v) for v in rng.uniform(-1, 1, 3) * [30.0, 30.0, np.radians(3.0)])
    return BoxScene(seed, scene, distance, pose, rig, sensor, (x, y, yaw), light_samples=2)


def tripod_scene(seed: int) -> BoxScene:
    """An own scene before cameras on a tripod, at most 950 mm high, that look down on the box by 20 to 45 degrees."""
    scene, rng = own_scene(seed), np.random.default_rng([618, seed])
    ahead, middle = scene.distance_mm + 100.0, scene.size_mm[2] / 2
    height = min(middle + ahead * float(np.tan(np.radians(rng.uniform(20, 45)))), 950.0)
    pitch = float(np.arctan2(middle - height, ahead))
    pose = paper.rig_pose(scene.rig.rectify(), pitch_rad=pitch, camera_height_mm=height)
    return replace(scene, T_left_world=pose)


def turned_scene(seed: int) -> BoxScene:
    """An own scene before cameras of which one was turned sideways by up to 0.8 degrees since their calibration."""
    scene, rng = own_scene(seed), np.random.default_rng([616, seed])
    Y = Rotation.from_euler("y", float(rng.uniform(-0.8, 0.8)), degrees=True).as_matrix()
    rig = scene.rig
    if rng.choice(["left", "right"]) == "right":
        return replace(scene, rig=replace(rig, R=Y @ rig.R, T=Y @ rig.T))
    pose = rigid(Y, np.zeros(3)) @ scene.T_left_world
    return replace(scene, rig=replace(rig, R=rig.R @ Y.T), T_left_world=pose)


def risen_scene(seed: int) -> BoxScene:
    """A plain scene before cameras of which the right one rose or sank by up to 2 mm since their calibration."""
    scene, rng = plain_scene(seed), np.random.default_rng([617, seed])
    return replace(scene, rig=replace(scene.rig, T=scene.rig.T + np.array([0.0, rng.uniform(-2, 2), 0.0])))


def refocused_scene(seed: int) -> BoxScene:
    """A plain scene before cameras whose lenses were focused otherwise since their calibration: k1 is off by 0.01."""
    scene, sign = plain_scene(seed), np.random.default_rng([618, seed]).choice([-1, 1])

    def refocused(lens: Camera) -> Camera:
        return replace(lens, dist=lens.dist + np.r_[0.01 * sign, np.zeros(lens.dist.size - 1)])

    return replace(scene, rig=replace(scene.rig, left=refocused(scene.rig.left), right=refocused(scene.rig.right)))


def before_turning(scene: BoxScene) -> Instrument:
    """Rig of a `turned_scene` as its owner knows it: as it was calibrated."""
    return own_instrument(own_scene(scene.seed))


def carton_scene(seed: int) -> BoxScene:
    """A printed carton on terrazzo, four rays a pixel, hard shadows."""
    return _of(seed, surfaces.carton, surfaces.terrazzo)


def brick_scene(seed: int) -> BoxScene:
    """A box of bricks on planks, rendered likewise."""
    return _of(seed, surfaces.bricks, surfaces.planks)


def _of(seed: int, box: Surface, floor: Surface) -> BoxScene:
    rng = np.random.default_rng([616, seed])
    plain = plain_scene(seed)
    around, solid = plain.scene.boxes
    walls, wood = around.materials, replace(solid, materials=(box(rng),) * 6)
    boxes = (replace(around, materials=(*walls[:4], floor(rng), walls[5])), wood)
    return replace(plain, scene=replace(plain.scene, boxes=boxes), samples=2, light_samples=1)


def white_wall_scene(seed: int) -> BoxScene:
    """A `plain_scene` before walls that show nothing."""
    return _before_white_walls(plain_scene(seed))


def carton_at_white_wall_scene(seed: int) -> BoxScene:
    """A `carton_scene` before walls that show nothing."""
    return _before_white_walls(carton_scene(seed))


def _before_white_walls(scene: BoxScene) -> BoxScene:
    around, *boxes = scene.scene.boxes
    walls, (floor, ceiling) = around.materials[:4], around.materials[4:]
    blank = tuple(replace(wall, contrast=0.0) for wall in walls)
    boxes = (replace(around, materials=(*blank, floor, ceiling)), *boxes)
    return replace(scene, scene=replace(scene.scene, boxes=boxes))


def neighbour_scene(seed: int) -> BoxScene:
    """A `plain_scene` with a second box beside the first one."""
    return _beside(plain_scene(seed), plain_scene(_NEIGHBOURS + seed))


def neighbour_carton_scene(seed: int) -> BoxScene:
    """A `carton_scene` with a second carton beside the first one."""
    return _beside(carton_scene(seed), carton_scene(_NEIGHBOURS + seed))


def neighbour_at_white_wall_scene(seed: int) -> BoxScene:
    """A `neighbour_carton_scene` before walls that show nothing."""
    return _before_white_walls(neighbour_carton_scene(seed))


def _beside(scene: BoxScene, other: BoxScene) -> BoxScene:
    """Stand another scene's box beside the one, up to 150 mm from it, where it hides nothing of it."""
    around, box = scene.scene.boxes
    rng = np.random.default_rng([618, scene.seed])
    T, half_mm = (
        other.box.T_world_box.copy(),
        [np.abs(b.T_world_box[1, :2]) @ b.size_mm[:2] / 2 for b in (box, other.box)],
    )
    while True:
        side, gap, behind = rng.choice([-1, 1]), rng.uniform(10, 150), rng.uniform(-150, 250)
        T[:2, 3] = box.T_world_box[:2, 3] + [behind, side * (sum(half_mm) + gap)]
        second = replace(other.box, T_world_box=T)
        both = replace(scene, scene=replace(scene.scene, boxes=(around, box, second)))
        if not _may_hide(both):
            return both


def _may_hide(scene: BoxScene) -> bool:
    """Whether the second box may hide something of the first one from a camera."""
    for R, t in _into_rectified(scene):
        (first, ahead), (second, ahead_of_second) = (
            (scene.rig.rectify().left.project(points)[:, 0], points[:, 2])
            for points in (corners_mm(box) @ R.T + t for box in scene.scene.boxes[1:])
        )
        if ahead_of_second.min() < ahead.max() and second.min() < first.max() and first.min() < second.max():
            return True
    return False


def held_scene(seed: int) -> BoxScene:
    """A carton held 20 to 150 mm above the floor."""
    up = float(np.random.default_rng([612, seed]).uniform(20, 150))
    return _moved(plain_scene(seed), lambda T: rigid(np.eye(3), [0.0, 0.0, up]) @ T)


def leaning_scene(seed: int) -> BoxScene:
    """A carton that leans by 5 to 20 degrees, on one of its lower edges."""
    rng = np.random.default_rng([613, seed])
    lean, axis = np.radians(rng.uniform(5, 20)) * rng.choice([-1, 1]), int(rng.integers(2))
    turn = cv2.Rodrigues(lean * np.eye(3)[axis])[0]

    def leant(T: Float64) -> Float64:
        return np.asarray(T @ rigid(turn, np.zeros(3)))

    scene = _moved(plain_scene(seed), leant)
    lowest = float(corners_mm(scene.box)[:, 2].min())
    return _moved(scene, lambda T: rigid(np.eye(3), [0.0, 0.0, -lowest]) @ T)


def _moved(scene: BoxScene, move: Callable[[Float64], Float64]) -> BoxScene:
    around, box = scene.scene.boxes
    moved = replace(box, T_world_box=np.asarray(move(box.T_world_box)))
    return replace(scene, scene=replace(scene.scene, boxes=(around, moved)))


def corners_mm(box: Box) -> Float64:
    """The eight corners in the world, (8, 3)."""
    signs = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    return np.asarray((signs * box.size_mm / 2) @ box.T_world_box[:3, :3].T + box.T_world_box[:3, 3])


def is_measurable(scene: BoxScene, least_px: float = SEEN_PX) -> bool:
    """Whether all sizes of a box can be told in principle: it is whole in both pictures, and no size is hidden.

    A size is hidden when neither camera sees the top or a second upright face, as wide as `least_px`.
    """
    pinhole, corners = scene.rig.rectify().left, corners_mm(scene.box)  # the same for both rectified pictures
    last_px = np.array(pinhole.size) - 1 - _BORDER_PX
    upright, top = np.zeros(4, bool), False
    for R, t in _into_rectified(scene):
        points = corners @ R.T + t
        pixels = pinhole.project(points)
        if not ((points[:, 2] > 0) & ((pixels > _BORDER_PX) & (pixels < last_px)).all(axis=1)).all():
            return False
        upright |= [_face_px(scene.box, -R.T @ t, pixels, face) > least_px for face in range(4)]
        top |= _face_px(scene.box, -R.T @ t, pixels, 5) > least_px
    return bool(top or upright.sum() > 1)


def _into_rectified(scene: BoxScene) -> list[tuple[Float64, Float64]]:
    """Turn and shift that take points of the world into the left and the right rectified camera."""
    rectified = scene.rig.rectify()
    left = rigid(rectified.R1, np.zeros(3)) @ scene.T_left_world
    right = rigid(np.eye(3), [-rectified.baseline_mm, 0.0, 0.0]) @ left
    return [(T[:3, :3], T[:3, 3]) for T in (left, right)]


def _face_px(box: Box, eye_mm: Float64, corners_px: Float64, face: int) -> float:
    """Width in the picture of a face (-x +x -y +y -z +z), of the top its height; 0 where it is turned away."""
    axis, sign = face // 2, 1 if face % 2 else -1
    if sign * float((eye_mm - box.T_world_box[:3, 3]) @ box.T_world_box[:3, axis]) <= box.size_mm[axis] / 2:
        return 0.0
    signs = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    return float(np.ptp(corners_px[signs[:, axis] == sign, 1 if axis == 2 else 0]))


def shoot(scene: BoxScene) -> Shot:
    """Record a scene: two pictures, and five turns of the laser."""
    seen, webcam = _lights(scene), Webcam()
    left, right = (webcam.shoot(side, np.random.default_rng([602, scene.seed, k])) for k, side in enumerate(seen))
    return Shot(left, right, scan(scene, np.random.default_rng([603, scene.seed])), scene)


def _lights(scene: BoxScene) -> tuple[Float64, Float64]:
    how = {"samples": scene.samples, "light_samples": scene.light_samples}
    return render_pair(scene.scene, scene.rig, scene.T_left_world, **how)


def scan(scene: BoxScene, rng: np.random.Generator) -> laser.AveragedScan:
    """Turn the laser five times in a scene."""
    packets = scene.sensor.scan(scene.scene, scene.laser_pose, rng, turns=5)
    return laser.average(laser.turns(laser.decode(packets)))


def recorded(scene: BoxScene, cache_dir: Path = CACHE) -> Shot:
    """`shoot` a scene, or read its pictures as they were rendered before: the same scene by the same code."""
    shown = repr((scene.scene, scene.rig, scene.T_left_world, scene.samples, scene.light_samples, scene.seed))
    name = hashlib.sha256((shown + code_sha256(_RENDERER)).encode()).hexdigest()[:24]
    files = [cache_dir / f"{name}_{side}.jpg" for side in ("left", "right")]
    if not all(file.is_file() for file in files):
        webcam = Webcam()
        for k, (file, light) in enumerate(zip(files, _lights(scene), strict=True)):
            write_atomic(file, webcam.encode(webcam.expose(light, np.random.default_rng([602, scene.seed, k]))))
    left, right = read_pair(*files)
    return Shot(left, right, scan(scene, np.random.default_rng([603, scene.seed])), scene)


@cache
def _recorded_boards() -> StereoCalibration:
    boards, names = recordings.load_boards()
    return calibrate_stereo(find_in_pairs(boards, recordings.BOARD, names=names, progress=False))


def _instrument(found: StereoCalibration, views: list[LaserBoardView]) -> Instrument:
    rectified = found.rig.rectify()
    how_well = SystematicUncertainty.of(rectified, rig_covariance(found.fit))
    return Instrument(rectified, calibrate_lidar_to_camera(views) if views else None, how_well)


def reading_too_far(sensor: VirtualLidar, pct: float) -> VirtualLidar:
    """A laser that reads so much farther than another."""
    first, second, third = sensor.bias_mm
    return replace(sensor, bias_mm=(first, second + 10 * pct, third))  # mm at 1 m


@cache
def instrument(*, laser_too_far_pct: float = 0.0) -> Instrument:
    """Rig and laser as calibrated from the recorded boards and from ten boards that the laser sees too."""
    found, sensor = _recorded_boards(), reading_too_far(SENSOR, laser_too_far_pct)
    views = laser_boards.laser_board_views(
        sensor, paper.paper_rig().left, np.random.default_rng(604), believed_left=found.rig.left, height_mm=150.0
    )
    return _instrument(found, views)


@cache
def high_instrument() -> Instrument:
    """The same rig with the laser where it stands to the high camera."""
    scene = high_scene(0)
    return _instrument(_recorded_boards(), laser_views(scene, _recorded_boards().rig.left, np.random.default_rng(605)))


def own_instrument(scene: BoxScene) -> Instrument:
    """Calibrate a scene's own rig and laser, from boards of their own with 0.1 to 0.2 px of noise at a corner.

    A camera that sees too few boards whole where the laser sees them stays without its laser's pose.
    """
    rng = np.random.default_rng([614, scene.seed])
    found = calibrate_stereo(corner_set(rng, rig=scene.rig, noise_px=float(rng.uniform(0.1, 0.2))))
    try:
        return _instrument(found, laser_views(scene, found.rig.left, rng))
    except ValueError:  # the laser sees none of its boards, or they leave open where it stands
        return _instrument(found, [])


def laser_views(scene: BoxScene, believed_left: Camera, rng: np.random.Generator) -> list[LaserBoardView]:
    """Show a board to the left camera and the laser of any set-up, in poses near those of `laser_boards`."""
    board, true_left = laser_boards.BOARD, scene.rig.left
    points = board.points_mm - board.points_mm.mean(axis=0)
    diagonal_mm = float(np.hypot(*np.ptp(points, axis=0)[:2]) + 3 * board.square_mm)
    views = []
    for pose in laser_boards.POSES:
        for _ in range(50):  # until the camera sees it whole
            near = np.array(pose) + rng.uniform(-1, 1, 4) * [40.0, 40.0, 5.0, 3.0]
            height = scene.sensor.height_mm + float(rng.uniform(30, 110))
            shown = laser_boards.board_scene(tuple(near), height)
            sheet = shown.boxes[1]
            T = scene.T_left_world @ sheet.T_world_box @ rigid(np.eye(3), [0.0, 0.0, sheet.size_mm[2] / 2])
            pixels = true_left.project(points @ T[:3, :3].T + T[:3, 3])
            if ((pixels > 0) & (pixels < np.array(true_left.size) - 1)).all():
                break
        else:
            continue
        turn, t = board_pose(points, pixels + rng.normal(0, 0.1, pixels.shape), believed_left)
        seen = scan(replace(scene, scene=shown), rng)
        views.append(find_board_in_scan(seen, rigid(cv2.Rodrigues(turn)[0], t), diagonal_mm=diagonal_mm))
    return views


def measure(shot: Shot, known: Instrument) -> Measurement:
    """What is timed: rectify, match, height, footprint, fuse."""
    return measure_objects(shot.left, shot.right, shot.scan, known)


def the_box(measured: Measurement, truth: BoxScene, *, of_pair: bool = False) -> MeasuredObject | None:
    """The object that stands where the box does; with `of_pair` not one that the scan alone shows."""
    at, *others = (box.T_world_box[:2, 3] for box in truth.scene.boxes[1:])

    def off_mm(thing: MeasuredObject, place: Float64 = at) -> float:
        return float(np.hypot(*(thing.position_mm - place)))

    things = [each for each in measured.objects if not (of_pair and each.sources.get("lines") is Source.SCAN)]
    things = [each for each in things if off_mm(each) < min([_MISTAKEN_MM, *(off_mm(each, other) for other in others)])]
    return min(things, key=off_mm, default=None)


def errors(thing: MeasuredObject | None, truth: BoxScene) -> dict[str, tuple[float, float]]:
    """Error in % and in standard deviations of each size that is told."""
    if thing is None:
        return {}
    true = truth.sides_mm()
    if thing.shape in ("box", "face"):  # each side with itself: of two that are nearly equal either may come out longer
        is_own_x = np.cos(thing.yaw_rad - truth.yaw_rad) ** 2 > 0.5
        true[:2] = truth.size_mm[[0, 1] if is_own_x == (thing.shape == "box") else [1, 0]]
    off = thing.size_mm - true
    found = {n: (100 * off[k] / true[k], off[k] / thing.std_mm[k]) for k, n in enumerate(NAMES[:3])}
    volume, std = thing.volume_l
    true_l = float(true.prod()) / 1e6
    found["volume"] = (100 * (volume - true_l) / true_l, (volume - true_l) / std)
    return {name: (float(pct), float(z)) for name, (pct, z) in found.items() if np.isfinite(pct)}
