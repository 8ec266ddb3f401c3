"""The virtual rig's recordings: what each one shows, how it is made, and how it is read back.

Every name, such as ``"conditions/glare"``, stands for one scene, one set-up and one seed, so that its truth can be
computed at any time and never has to be stored.
"""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Iterable
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from stereolib import laser, paper
from stereolib.base import datasets, write_atomic
from stereolib.calibration import Checkerboard
from stereolib.matching import KnownView, near_edge_mask
from stereolib.rig import Camera, RectifiedRig, read_pair, rigid
from stereolib.virtual import lidar, walk
from stereolib.virtual.ray_casting import Truth, render_pair, truth
from stereolib.virtual.scene import Light, Scene, board, cube_scene, room
from stereolib.virtual.webcam import Webcam

Array = np.ndarray

BOARD = Checkerboard(9, 6, 25.0)
BOARD_PAIRS = 30
DISTANCES_MM = (500, 600, 700, 800, 900, 1000)
TEXTURES_MM = {"fine": 3.0, "medium": 6.0, "coarse": 18.0}
CONDITIONS: dict[str, dict[str, Any]] = {
    "plain": {"texture": 0.0},
    "poor_light": {"light": 0.012},
    "glare": {"object_gloss": 0.9, "floor_gloss": 0.9},
    "texture": {},
}
TARGETS = {"white": 0.85, "grey": 0.35, "dark": 0.06}
#: The laser stands below the left camera: (x_mm, y_mm, yaw_rad).
LASER_POSE = (0.0, 0.0, 0.0)
RANGES_MM = (150, 200, 300, 400, 500, 600, 700, 800, 1000, 1250, 1500, 1750, 2000, 2250, 2500, 2750, 3000, 3500, 4000,
             4500, 5000)  # fmt: skip


@cache
def rectified() -> RectifiedRig:
    """The true rig (Table I), rectified with alpha = 0."""
    return paper.paper_rig().rectify(alpha=0.0)


@cache
def setup(name: str = "pitched") -> Array:
    """Where the left camera stood: ``T_left_world`` (4, 4) of the set-up ``"pitched"``, ``"level"`` or ``"bench"``,
    or of a station of the walk, ``"room/1"`` to ``"room/5"``.

    The first two are not typed in but solved so that the cube's foot at 0.70 m stands 53 rows above the bottom of the
    rectified image, as the paper measured (see `scale`). The rectified camera is the one that stands upright.
    ``"bench"`` is where boards are shown to the rig: level, one metre above the floor. On the walk the rig is pitched.
    """
    if name in walk.POSES:
        return setup("pitched") @ np.linalg.inv(walk.T_map_station(name))
    if name == "bench":
        return paper.rig_pose(rectified(), pitch_rad=0.0, camera_height_mm=1000.0)
    solve = {"pitched": paper.solve_pitch, "level": paper.solve_camera_height}
    if name not in solve:
        raise ValueError(f'the set-up is "pitched", "level", "bench" or "room/1" to "room/5", got {name!r}')
    return solve[name](rectified(), paper.paper_setup()).T_left_world


@cache
def pairs() -> dict[str, tuple[str, Scene]]:
    """Every recorded stereo pair but the boards: name -> (set-up, scene)."""
    found = {f"conditions/{name}": ("pitched", cube_scene(**how)) for name, how in CONDITIONS.items()}
    found["conditions/level"] = ("level", cube_scene())
    for kind, scale_mm in TEXTURES_MM.items():
        for distance in DISTANCES_MM:
            scene = cube_scene(float(distance), texture_scale_mm=scale_mm)
            found[f"series/{kind}_{distance}"] = ("pitched", scene)
    return found | {name: (name, walk.walk_scene()) for name in walk.POSES}


def cube_pairs() -> tuple[str, ...]:
    """Names of the recorded pairs that show the paper's cube."""
    return tuple(name for name in pairs() if not name.startswith("room/"))


def load_pair(name: str) -> tuple[Array, Array]:
    """The recorded images of a pair, as the webcams sent them: two (480, 640, 3) uint8.

    Raises
    ------
    ValueError
        If there is no such recording; the text lists the names.
    """
    _known(name)
    return read_pair(*(datasets.data_path(f"virtual/{name}_{side}.jpg") for side in ("left", "right")))


def load_truth(name: str) -> Truth:
    """True disparity and depth of a recorded pair, in the true rig's rectified left image; read-only."""
    where, scene = _known(name)
    return _truth(scene, where)


def view(name: str) -> KnownView:
    """A recorded pair, rectified, with its truth: regions ``"cube"`` and ``"edge"`` (the near one), both visible."""
    left, right = rectified().rectify(*load_pair(name))
    return _view(name, left, right, load_truth(name))


def render_view(
    name: str, scene: Scene, *, light: float = 1.0, seed: int = 4, about: dict[str, float | str] | None = None
) -> KnownView:
    """A scene seen from the pitched set-up, one ray a pixel and some light, with the regions of `view`.

    The same scene in another light is not rendered again.
    """
    webcam, rng = Webcam(), np.random.default_rng(seed)
    left, right = rectified().rectify(*(webcam.shoot(light * side, rng) for side in _lights(scene)))
    return _view(name, left, right, _truth(scene), about)


def scan(name: str, seed: int = 1) -> laser.AveragedScan:
    """What the laser sees in a recorded pair's scene: the median of five turns, on the walk the recorded ones."""
    if name in walk.POSES:
        return laser.average(laser.turns(laser.decode(load_laser(f"{name}_scan"))))
    data = lidar.VirtualLidar().scan(_known(name)[1], LASER_POSE, np.random.default_rng(seed), turns=5)
    return laser.average(laser.turns(laser.decode(data)))


@lru_cache(maxsize=8)
def _lights(scene: Scene) -> tuple[Array, Array]:
    return render_pair(scene, paper.paper_rig(), setup(), samples=1, light_samples=2)


@lru_cache(maxsize=16)
def _truth(scene: Scene, where: str = "pitched") -> Truth:
    found = truth(scene, rectified(), setup(where))
    for array in vars(found).values():
        array.setflags(write=False)
    return found


def _view(name: str, left: Array, right: Array, true: Truth, about: dict[str, float | str] | None = None) -> KnownView:
    cube = true.box == 1
    regions = {"cube": true.visible & cube, "edge": true.visible & near_edge_mask(true.disparity_px, cube)}
    return KnownView(name, left, right, true.disparity_px, true.visible, regions, about or {})


def load_boards() -> tuple[list[tuple[Array, Array]], list[str]]:
    """The checkerboard pairs and their names."""
    names = [f"boards/{i + 1:02d}" for i in range(BOARD_PAIRS)]
    files = [[datasets.data_path(f"virtual/{name}_{side}.jpg") for side in ("left", "right")] for name in names]
    return [read_pair(left, right) for left, right in files], names


def draw_board_poses(count: int, rng: np.random.Generator, target: Checkerboard = BOARD) -> list[Array]:
    """Poses of a hand-held board with good coverage: all image regions, 0.45 to 0.95 m, tilts up to 40 degrees.

    Returns
    -------
    list of (4, 4) arrays
        ``T_left_board``; the board's frame is at its centre, x right, y up, z towards the camera. Every corner and
        the white rim lie inside both images.
    """
    rig = paper.paper_rig()
    half = np.array([(n + 1) * target.square_mm / 2 + 0.5 * target.square_mm for n in (target.columns, target.rows)])
    rim = np.array([[a * half[0], b * half[1], 0.0, 1.0] for a in (-1, 0, 1) for b in (-1, 0, 1)]).T
    distances = np.array([480.0, 600.0, 740.0, 900.0])
    poses: list[Array] = []
    for attempt in range(2000 * count):
        k = len(poses)
        cell = np.array([k % 3, k // 3 % 3]) if attempt % 40 else rng.integers(0, 3, 2)  # a 3 x 3 grid of regions
        ray = rig.left.rays((cell + rng.uniform(0, 1, 2)) / 3 * rig.left.size, clamp=True)[0]
        tilt_x, tilt_y, turn = rng.uniform([-0.7, -0.7, -0.35], [0.7, 0.7, 0.35])
        facing = _euler(tilt_x, tilt_y, turn) @ np.diag([1.0, -1.0, -1.0])
        T = rigid(facing, ray * distances[k % 4] * rng.uniform(0.92, 1.08))
        views = (c.project((M @ rim)[:3].T) for c, M in ((rig.left, T), (rig.right, rigid(rig.R, rig.T) @ T)))
        if all(_inside(pixels, rig.left) for pixels in views):
            poses.append(T)
        if len(poses) == count:
            return poses
    raise ValueError(f"only {len(poses)} of {count} poses keep the {target} inside both images: use a smaller board")


@cache
def board_poses() -> tuple[Array, ...]:
    """Poses ``T_left_board`` of the recorded boards, in their order."""
    return tuple(draw_board_poses(BOARD_PAIRS, np.random.default_rng(30)))


def board_scene(T_left_board: Array, target: Checkerboard = BOARD) -> Scene:
    """A board held in front of the rig."""
    T_world_board = np.linalg.inv(setup("bench")) @ T_left_board
    lamp = Light((-500.0, 400.0, 1700.0), 800.0, 0.9)  # behind the rig, on the board
    held = board((target.columns, target.rows), target.square_mm, T_world_board)
    return Scene((room(), held), (*Scene(()).lights, lamp), names=("room", "board"))


def laser_recordings() -> Iterable[tuple[str, bytes]]:
    """The laser's byte streams: five turns in the room (Fig. 6), the range series (Fig. 5), and those of the walk."""
    sensor = lidar.VirtualLidar()
    yield "lrf/room", sensor.scan(cube_scene(), LASER_POSE, np.random.default_rng(6), turns=5)
    for k, (target, albedo) in enumerate(TARGETS.items()):
        rng = np.random.default_rng([5, k])
        for distance, data in zip(RANGES_MM, sensor.range_series(RANGES_MM, albedo, rng), strict=True):
            yield f"lrf/range/{target}_{distance:04d}", data
    for name in walk.POSES:
        yield f"{name}_scan", walk.scan_bytes(name)


def load_laser(name: str) -> bytes:
    """Raw bytes of a laser recording: ``"lrf/room"``, or for example ``"lrf/range/grey_0700"``, ``"room/1_scan"``."""
    return datasets.data_path(f"virtual/{name}.bin").read_bytes()


def load_range_series(target: str) -> list[Array]:
    """Readings (360,) mm at each distance of `RANGES_MM`, of a ``"white"``, ``"grey"`` or ``"dark"`` target."""
    if target not in TARGETS:
        raise ValueError(f"the targets are {', '.join(TARGETS)}; got {target!r}")
    return [laser.decode(load_laser(f"lrf/range/{target}_{mm:04d}")).distance_mm.ravel() for mm in RANGES_MM]


def build(output: Path, *, only: str = "", progress: bool = True) -> None:
    """Make the recordings again: some minutes. Each file is replaced when it is done; the sums are written last.

    Parameters
    ----------
    output : Path
    only : str
        Make only the pairs whose names begin so, for example ``"conditions/"``.
    """
    from joblib import Parallel, cpu_count, delayed
    from tqdm.auto import tqdm

    rig = paper.paper_rig()
    jobs = [(name, scene, setup(where), 3) for name, (where, scene) in pairs().items()]
    jobs += [(f"boards/{i + 1:02d}", board_scene(pose), setup("bench"), 3) for i, pose in enumerate(board_poses())]

    def make(name: str, scene: Scene, T_left_world: Array, samples: int) -> None:
        for side, image in zip(("left", "right"), render_pair(scene, rig, T_left_world, samples=samples), strict=True):
            rng = np.random.default_rng([zlib.crc32(name.encode()), side == "right"])
            webcam = Webcam()
            write_atomic(output / f"{name}_{side}.jpg", webcam.encode(webcam.expose(image, rng)))

    jobs = [job for job in jobs if job[0].startswith(only)]
    running = Parallel(n_jobs=cpu_count(), prefer="threads", return_as="generator_unordered")(
        delayed(make)(*job) for job in jobs
    )
    list(tqdm(running, "rendering pairs", len(jobs), unit="pair", disable=not progress))
    for name, data in laser_recordings():
        write_atomic(output / f"{name}.bin", data)
    write_sums(output)


def write_sums(folder: Path) -> None:
    """Write SHA256SUMS of all files below a folder, in `sha256sum`'s format."""
    files = sorted(p for p in folder.rglob("*") if p.is_file() and p.suffix in {".jpg", ".bin"})
    lines = [f"{hashlib.sha256(p.read_bytes()).hexdigest()}  {p.relative_to(folder).as_posix()}\n" for p in files]
    write_atomic(folder / "SHA256SUMS", "".join(lines))


def _euler(x: float, y: float, z: float) -> Array:
    cx, cy, cz = np.cos([x, y, z])
    sx, sy, sz = np.sin([x, y, z])
    turn_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    turn_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    turn_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return turn_z @ turn_y @ turn_x


def _inside(pixels: Array, camera: Camera, rim_px: float = 6.0) -> bool:
    size = np.array(camera.size)
    return bool(((pixels > rim_px) & (pixels < size - 1 - rim_px)).all())


def _known(name: str) -> tuple[str, Scene]:
    if name not in pairs():
        raise ValueError(f"no virtual recording {name!r}; there are {', '.join(pairs())}")
    return pairs()[name]
