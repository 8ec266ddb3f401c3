"""The virtual rig's recordings: what each one shows, read back with its truth.

Every name, such as ``"conditions/glare"``, stands for one scene, one set-up and one seed, so that its truth can be
computed at any time and never has to be stored. `build_recordings` made them.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache, lru_cache

import numpy as np

from stereolib import laser, paper
from stereolib.base import Float64, UInt8, data_path, read_bytes
from stereolib.calibration import Checkerboard
from stereolib.matching import KnownView, near_edge_mask
from stereolib.rig import RectifiedRig, read_pair
from stereolib.virtual import walk
from stereolib.virtual.lidar import VirtualLidar
from stereolib.virtual.rendering import Truth, render_pair, render_truth
from stereolib.virtual.scene import CUBE_SURFACE, FLOOR_SURFACE, Light, Scene, board_box, cube_scene, room
from stereolib.virtual.stereo_boards import draw_board_poses
from stereolib.virtual.webcam import Webcam

BOARD = Checkerboard(9, 6, 25.0)
BOARD_PAIRS = 30
DISTANCES_MM = (500, 600, 700, 800, 900, 1000)
TEXTURES_MM = {"fine": 3.0, "medium": 6.0, "coarse": 18.0}
#: Reflectance of the range series' targets.
TARGETS = {"white": 0.85, "grey": 0.35, "dark": 0.06}
#: The laser stands below the left camera: (x_mm, y_mm, yaw_rad).
LASER_POSE = (0.0, 0.0, 0.0)
RANGES_MM = (150, 200, 300, 400, 500, 600, 700, 800, 1000, 1250, 1500, 1750, 2000, 2250, 2500, 2750, 3000, 3500, 4000,
             4500, 5000)  # fmt: skip
_BENCH_HEIGHT_MM = 1000.0
_POOR_LIGHT = 0.012  # of a well-lit room's
_GLARE = 0.9  # gloss of the cube and the floor


@cache
def rectified() -> RectifiedRig:
    """Rectify the true rig (Table I) with alpha = 0.

    Returns
    -------
    RectifiedRig
    """
    return paper.paper_rig().rectify(alpha=0.0)


@cache
def setup(name: str = "pitched") -> Float64:
    """Tell where the left camera stood.

    Parameters
    ----------
    name : str
        The set-up ``"pitched"``, ``"level"`` or ``"bench"``, or a station of the walk, ``"room/1"`` to ``"room/5"``.

    Returns
    -------
    (4, 4) float64
        ``T_left_world``.

    Raises
    ------
    ValueError
        For another name.

    Notes
    -----
    The first two are not typed in but solved so that the cube's foot at 0.70 m stands 53 rows above the bottom of the
    rectified image, as the paper measured (see `paper.solve_pitch`). The rectified camera is the one that stands
    upright. ``"bench"`` is where boards are shown to the rig: level, one metre above the floor. On the walk the rig is
    pitched.
    """
    if name in walk.POSES:
        return np.asarray(setup("pitched") @ np.linalg.inv(walk.T_map_station(name)))
    if name == "bench":
        return paper.rig_pose(rectified(), pitch_rad=0.0, camera_height_mm=_BENCH_HEIGHT_MM)
    solve = {"pitched": paper.solve_pitch, "level": paper.solve_camera_height}
    if name not in solve:
        raise ValueError(f'the set-up is "pitched", "level", "bench" or "room/1" to "room/5", got {name!r}')
    return solve[name](rectified(), paper.paper_setup()).T_left_world


@cache
def pairs() -> dict[str, tuple[str, Scene]]:
    """List every recorded stereo pair but the boards.

    Returns
    -------
    dict
        Set-up and scene by the pair's name.

    Examples
    --------
    >>> list(pairs())[:5]
    ['conditions/plain', 'conditions/poor_light', 'conditions/glare', 'conditions/texture', 'conditions/level']
    """
    glossy = cube_scene(cube=replace(CUBE_SURFACE, gloss=_GLARE), floor=replace(FLOOR_SURFACE, gloss=_GLARE))
    known = {
        "conditions/plain": ("pitched", cube_scene(cube=replace(CUBE_SURFACE, contrast=0.0))),
        "conditions/poor_light": ("pitched", cube_scene().dimmed(_POOR_LIGHT)),
        "conditions/glare": ("pitched", glossy),
        "conditions/texture": ("pitched", cube_scene()),
        "conditions/level": ("level", cube_scene()),
    }
    for kind, scale_mm in TEXTURES_MM.items():
        for distance in DISTANCES_MM:
            scene = cube_scene(float(distance), cube=replace(CUBE_SURFACE, scale_mm=scale_mm))
            known[f"series/{kind}_{distance}"] = ("pitched", scene)
    return known | {name: (name, walk.walk_scene()) for name in walk.POSES}


def cube_pairs() -> tuple[str, ...]:
    """List the names of the recorded pairs that show the paper's cube.

    Returns
    -------
    tuple of str

    Examples
    --------
    >>> len(cube_pairs())
    23
    """
    return tuple(name for name in pairs() if not name.startswith("room/"))


def load_pair(name: str) -> tuple[UInt8, UInt8]:
    """Read the recorded images of a pair, as the webcams sent them.

    Parameters
    ----------
    name : str
        One of `pairs`.

    Returns
    -------
    left, right : (480, 640, 3) uint8

    Raises
    ------
    ValueError
        If there is no such recording; the text lists the names.
    """
    _known(name)
    return _read_sides(name)


def load_truth(name: str) -> Truth:
    """Compute the true disparity and depth of a recorded pair.

    Parameters
    ----------
    name : str
        One of `pairs`.

    Returns
    -------
    Truth
        In the true rig's rectified left image; read-only.

    Raises
    ------
    ValueError
        As `load_pair`.
    """
    where, scene = _known(name)
    return _truth(scene, where)


def view(name: str) -> KnownView:
    """Rectify a recorded pair and put its truth beside it.

    Parameters
    ----------
    name : str
        One of `pairs` that show the cube.

    Returns
    -------
    KnownView
        Regions ``"cube"`` and ``"edge"`` (the near one), both visible.
    """
    left, right = rectified().rectify(*load_pair(name))
    return _view(name, left, right, load_truth(name))


def render_view(
    name: str, scene: Scene, *, light: float = 1.0, seed: int = 4, about: dict[str, float | str] | None = None
) -> KnownView:
    """Render a scene from the pitched set-up, one ray a pixel and some light, with the regions of `view`.

    The same scene in another light is not rendered again.

    Parameters
    ----------
    name : str
        What the view is called.
    scene : Scene
    light : float
        Level of all light.
    seed : int
        Of the webcams' noise.
    about : dict, optional
        What else the view tells of itself.

    Returns
    -------
    KnownView
    """
    webcam, rng = Webcam(), np.random.default_rng(seed)
    left, right = rectified().rectify(*(webcam.shoot(light * side, rng) for side in _lights(scene)))
    return _view(name, left, right, _truth(scene), about)


def scan(name: str, seed: int = 1) -> laser.AveragedScan:
    """Average what the laser sees in a recorded pair's scene.

    Parameters
    ----------
    name : str
        One of `pairs`.
    seed : int
        Of the laser's noise; on the walk the turns are recorded.

    Returns
    -------
    AveragedScan
        The median of five turns.
    """
    if name in walk.POSES:
        data = load_laser(f"{name}_scan")
    else:
        data = VirtualLidar().scan(_known(name)[1], LASER_POSE, np.random.default_rng(seed), turns=5)
    return laser.average(laser.turns(laser.decode(data)))


@lru_cache(maxsize=8)
def _lights(scene: Scene) -> tuple[Float64, Float64]:
    return render_pair(scene, paper.paper_rig(), setup(), samples=1, light_samples=2)


@lru_cache(maxsize=16)
def _truth(scene: Scene, where: str = "pitched") -> Truth:
    truth = render_truth(scene, rectified(), setup(where))
    for array in vars(truth).values():
        array.setflags(write=False)
    return truth


def _view(name: str, left: UInt8, right: UInt8, true: Truth, about: dict[str, float | str] | None = None) -> KnownView:
    cube = true.box == 1
    regions = {"cube": true.visible & cube, "edge": true.visible & near_edge_mask(true.disparity_px, cube)}
    return KnownView(name, left, right, true.disparity_px, true.visible, regions, about or {})


def load_boards() -> tuple[list[tuple[UInt8, UInt8]], list[str]]:
    """Read the checkerboard pairs.

    Returns
    -------
    pairs : list of (left, right)
        Each (480, 640, 3) uint8.
    names : list of str
        ``"boards/01"`` and so on.
    """
    names = [f"boards/{i + 1:02d}" for i in range(BOARD_PAIRS)]
    return [_read_sides(name) for name in names], names


@cache
def board_poses() -> tuple[Float64, ...]:
    """Give the poses of the recorded boards, in their order.

    Returns
    -------
    tuple of (4, 4) arrays
        ``T_left_board``, as `stereo_boards.draw_board_poses` draws them.
    """
    return tuple(draw_board_poses(BOARD_PAIRS, np.random.default_rng(30), BOARD))


def board_corners_mm() -> dict[str, Float64]:
    """Give the true corners of the recorded boards, by the names of `load_boards`.

    Returns
    -------
    dict of str to (54, 3) float64, mm
        In the left camera's frame, in the order of `Checkerboard.points_mm`.

    Examples
    --------
    >>> board_corners_mm()["boards/01"].shape
    (54, 3)
    """
    middle = (BOARD.points_mm - BOARD.points_mm.mean(axis=0)) * [1.0, -1.0, 1.0]  # of a board's frame y runs up
    return {f"boards/{i + 1:02d}": middle @ T[:3, :3].T + T[:3, 3] for i, T in enumerate(board_poses())}


def board_scene(T_left_board: Float64, target: Checkerboard = BOARD) -> Scene:
    """Hold a board in front of the rig.

    Parameters
    ----------
    T_left_board : (4, 4) array
    target : Checkerboard

    Returns
    -------
    Scene
        For the set-up ``"bench"``.
    """
    T_world_board = np.linalg.inv(setup("bench")) @ T_left_board
    lamp = Light((-500.0, 400.0, 1700.0), 800.0, 0.9)  # behind the rig, on the board
    held = board_box((target.columns, target.rows), target.square_mm, T_world_board)
    return Scene((room(), held), (*Scene(()).lights, lamp), names=("room", "board"))


def load_laser(name: str) -> bytes:
    """Read the raw bytes of a laser recording.

    Parameters
    ----------
    name : str
        ``"lrf/room"``, or for example ``"lrf/range/grey_0700"``, ``"room/1_scan"``.

    Returns
    -------
    bytes

    Raises
    ------
    ValueError
        If there is no such recording.
    """
    return read_bytes(data_path(f"virtual/{name}.bin"))


def load_range_series(target: str) -> list[Float64]:
    """Read the range series of a target.

    Parameters
    ----------
    target : str
        One of `TARGETS`.

    Returns
    -------
    list of (360,) float64
        Readings, mm, at each distance of `RANGES_MM`.

    Raises
    ------
    ValueError
        For another target.
    """
    if target not in TARGETS:
        raise ValueError(f"the targets are {', '.join(TARGETS)}; got {target!r}")
    return [laser.decode(load_laser(f"lrf/range/{target}_{mm:04d}")).distance_mm.ravel() for mm in RANGES_MM]


def _read_sides(name: str) -> tuple[UInt8, UInt8]:
    return read_pair(*(data_path(f"virtual/{name}_{side}.jpg") for side in ("left", "right")))


def _known(name: str) -> tuple[str, Scene]:
    if name not in pairs():
        raise ValueError(f"no virtual recording {name!r}; there are {', '.join(pairs())}")
    return pairs()[name]
