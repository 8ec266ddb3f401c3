"""From a state of the knobs to what it measures, step by step; only what depends on a turned knob is done again."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from stereolib import paper
from stereolib.base import Bools, Float32, Float64, Floats, UInt8, turn_about_z
from stereolib.laser import LaserScan, average, decode, turns
from stereolib.mapping import read_scan
from stereolib.matching import (
    RowOffset,
    Score,
    compute_disparity,
    compute_disparity_guided,
    dilate,
    expected_disparity,
    find_rows,
    motorcycle_view,
    score,
    smooth,
    stereo_pipeline,
)
from stereolib.measurement import (
    CannotMeasure,
    HeightAttempt,
    Instrument,
    Measurement,
    Standing,
    Views,
    attempt_standing,
    measure_standing,
    see_standing,
)
from stereolib.notebook.knobs import DILATION, FILTERS, MATCHERS, MOTORCYCLE, OWN, VIRTUAL, WINDOWS, State
from stereolib.notebook.steps import step
from stereolib.paper import HeightResult, height_by_maximum
from stereolib.rig import Camera, RectifiedRig, StereoRig, read_pair
from stereolib.virtual import (
    CUBE_SURFACE,
    FLOOR_SURFACE,
    Scene,
    VirtualLidar,
    Webcam,
    cube_scene,
    recordings,
    render_quickly,
    render_truth,
)

_MARGIN_PX = 8  # searched around what the laser predicts
_GAMMA = 2.2
#: Knobs that only the virtual rig has.
OF_SCENE = ("distance_mm", "width_mm", "depth_mm", "height_mm", "yaw_deg", "lateral_mm", "contrast", "grain_mm",
            "gloss", "light", "noise", "camera_height_mm", "pitch_deg", "baseline_mm", "focal_px")  # fmt: skip
#: Knobs of OpenCV's matcher, without its range.
OF_SGBM = ("min_disparity", "block_size", "p1", "p2", "mode", "uniqueness_ratio", "disp12_max_diff",
           "speckle_window_size", "speckle_range", "pre_filter_cap")  # fmt: skip
_SEED = 4


@dataclass(frozen=True, eq=False)
class Taken:
    """A pair as the cameras gave it, and what is known about it.

    Attributes
    ----------
    left, right : (H, W) or (H, W, 3) uint8
    rig : StereoRig or None
        None: the pair is rectified already, and nothing is known of its cameras.
    """

    left: UInt8
    right: UInt8
    rig: StereoRig | None


@dataclass(frozen=True, eq=False)
class Known:
    """What would be right: the true disparity of the rectified left picture, and which pixels both cameras see."""

    disparity_px: Floats
    visible: Bools
    region: Bools


@step("baseline_mm", "focal_px", "half")
def true_rig(state: State) -> StereoRig:
    """The paper's rig, its baseline and focal length as the knobs have them."""
    rig, usual = recordings.rectified().rig, recordings.rectified()
    longer = state.focal_px / usual.f_px
    left, right = (_scaled(_zoomed(camera, longer), state.half) for camera in (rig.left, rig.right))
    return StereoRig(left, right, rig.R, rig.T * (state.baseline_mm / usual.baseline_mm))


def _zoomed(camera: Camera, longer: float) -> Camera:
    return Camera(np.diag([longer, longer, 1.0]) @ camera.K + _centre(camera, longer), camera.dist, camera.size)


def _centre(camera: Camera, longer: float) -> Float64:
    """What keeps the principal point where it was."""
    shift = np.zeros((3, 3))
    shift[:2, 2] = (1 - longer) * camera.K[:2, 2]
    return shift


def _scaled(camera: Camera, half: bool) -> Camera:
    """The same camera with half as many columns and rows."""
    if not half:
        return camera
    K = np.diag([0.5, 0.5, 1.0]) @ camera.K
    K[:2, 2] -= 0.25  # pixel centres have integer coordinates
    return Camera(K, camera.dist, (camera.size[0] // 2, camera.size[1] // 2))


@step("distance_mm", "width_mm", "depth_mm", "height_mm", "yaw_deg", "lateral_mm", "contrast", "grain_mm", "gloss")
def scene(state: State) -> Scene:
    """The box on the floor of the room."""
    return cube_scene(
        state.distance_mm,
        size_mm=(state.width_mm, state.depth_mm, state.height_mm),
        yaw_rad=float(np.radians(state.yaw_deg)),
        lateral_mm=state.lateral_mm,
        cube=replace(CUBE_SURFACE, contrast=state.contrast, scale_mm=state.grain_mm, gloss=state.gloss),
        floor=replace(FLOOR_SURFACE, gloss=state.gloss),
    )


@step("source", after=(scene,))
def true_scene(state: State) -> Scene | None:
    """What stands before the rig, where anybody knows it."""
    if state.source == VIRTUAL:
        return scene(state)
    return recordings.pairs()[state.source][1] if state.source in recordings.pairs() else None


@step("source", "camera_height_mm", "pitch_deg", after=(true_rig,))
def pose(state: State) -> Float64:
    """Where the left camera stands: T_left_world."""
    if state.source in recordings.pairs():
        return recordings.setup(recordings.pairs()[state.source][0])
    pitch_rad = float(np.radians(state.pitch_deg))
    return paper.rig_pose(true_rig(state).rectify(), pitch_rad, state.camera_height_mm)


@step(after=(scene, pose))
def light(state: State) -> tuple[Floats, Floats]:
    """What falls into both cameras."""
    return render_quickly(scene(state), true_rig(state), pose(state))


@step("own", "light", "noise", "exposure_ev", after=(light,))
def taken(state: State) -> Taken:
    """The pair as the cameras give it."""
    if state.source == VIRTUAL:
        finer = 2.0 if state.half else 1.0  # four pixels in one: half the noise
        webcam = Webcam(full_well_e=6000 * (finer / state.noise) ** 2, read_noise_e=12 * finer / state.noise)
        rays = [state.light * side for side in light(state)]
        with ThreadPoolExecutor(2) as both:
            left, right = both.map(webcam.shoot, rays, map(deepcopy, _noise(rays[0].shape)))
        return Taken(left, _brighter(right, state.exposure_ev), true_rig(state))
    if state.source == MOTORCYCLE:
        view = motorcycle_view()
        return _smaller(Taken(view.left, view.right, None), state.half)
    if state.source == OWN:
        left_file, right_file, calibration, _ = state.own
        rig = Instrument.load(calibration).rectified.rig if calibration else None
        return _smaller(Taken(*read_pair(left_file, right_file), rig), state.half)
    left, right = recordings.load_pair(state.source)
    return _smaller(Taken(left, _brighter(right, state.exposure_ev), recordings.rectified().rig), state.half)


@lru_cache(maxsize=4)
def _noise(shape: tuple[int, ...]) -> tuple[np.random.Generator, np.random.Generator]:
    """What draws the noise of both cameras: the right one's begins where that of the left picture ends."""
    left, right = (np.random.default_rng(_SEED) for _ in range(2))
    right.standard_normal(shape, np.float32)
    return left, right


def _brighter(picture: UInt8, stops: float) -> UInt8:
    """A picture exposed longer."""
    if not stops:
        return picture
    table = np.clip((np.arange(256) / 255) ** _GAMMA * 2.0**stops, 0, 1) ** (1 / _GAMMA)
    return np.asarray(cv2.LUT(picture, np.rint(255 * table).astype(np.uint8)))


def _smaller(pair: Taken, half: bool) -> Taken:
    if not half:
        return pair
    size = (pair.left.shape[1] // 2, pair.left.shape[0] // 2)
    left, right = (cv2.resize(image, size, interpolation=cv2.INTER_AREA) for image in (pair.left, pair.right))
    rig = pair.rig and StereoRig(_scaled(pair.rig.left, half), _scaled(pair.rig.right, half), pair.rig.R, pair.rig.T)
    return Taken(np.asarray(left, np.uint8), np.asarray(right, np.uint8), rig)


@step("roll_deg", "row_px", "baseline_pct", after=(taken,))
def rectified_rig(state: State) -> RectifiedRig | None:
    """The rig as it is believed to be, rectified; None where nothing is known of the cameras."""
    rig = taken(state).rig
    if rig is None:
        return None
    turn = turn_about_z(float(np.radians(state.roll_deg)))
    K = rig.right.K.copy()
    K[1, 2] += state.row_px / (2 if state.half else 1)
    right = Camera(K, rig.right.dist, rig.right.size)
    return StereoRig(rig.left, right, turn @ rig.R, turn @ rig.T * (1 + state.baseline_pct / 100)).rectify()


@step(after=(rectified_rig,))
def pair(state: State) -> tuple[UInt8, UInt8]:
    """The pair, rectified with the calibration that is believed."""
    shot, rectified = taken(state), rectified_rig(state)
    return rectified.rectify(shot.left, shot.right) if rectified else (shot.left, shot.right)


@step(after=(pair,))
def rows(state: State) -> tuple[RowOffset, Float32]:
    """How far the pair's rows disagree, and a rough map in half size, which no knob of the matcher changes."""
    return find_rows(*pair(state))


@step(after=(rectified_rig, true_scene))
def known(state: State) -> Known | None:
    """The truth, seen through the calibration that is believed; None of an own pair."""
    rectified = rectified_rig(state)
    if state.source == MOTORCYCLE:
        view = motorcycle_view()
        if not state.half:
            return Known(view.truth_px, np.asarray(view.visible), np.asarray(view.visible))
        rows, columns = (slice(0, length // 2 * 2, 2) for length in view.truth_px.shape)
        seen = np.asarray(view.visible)[rows, columns]
        return Known(view.truth_px[rows, columns] / 2, seen, seen)
    shown = true_scene(state)
    if rectified is None or shown is None:
        return None
    truth = render_truth(shown, rectified, pose(state))
    return Known(truth.disparity_px, truth.visible, truth.visible & (truth.box > 0))


@step("source", "own", "laser", "turns", "laser_noise", "laser_yaw_deg", "laser_ahead_mm", after=(true_scene,))
def scan(state: State) -> LaserScan | None:
    """What the laser sees, from where it really stands."""
    if not state.laser or state.source == MOTORCYCLE:
        return None
    if state.source == OWN:
        return read_scan(Path(state.own[3])) if state.own[3] else None
    if state.source in recordings.pairs() and state.source.startswith("room/"):
        return recordings.scan(state.source)
    usual, (x_mm, y_mm, yaw) = VirtualLidar(), recordings.LASER_POSE
    stands = x_mm + state.laser_ahead_mm, y_mm, yaw + float(np.radians(state.laser_yaw_deg))
    sigmas = usual.sigma_mm * state.laser_noise, usual.sigma_per_mm * state.laser_noise
    lidar = replace(usual, sigma_mm=sigmas[0], sigma_per_mm=sigmas[1])
    shown = true_scene(state)
    assert shown is not None
    data = lidar.scan(shown, stands, np.random.default_rng(_SEED), turns=state.turns)
    return average(turns(decode(data)))


@step("matcher", "num_disparities", *OF_SGBM, after=(pair,))
def matched(state: State) -> Float32:
    """The map as the matcher gives it without the laser."""
    if state.matcher == MATCHERS[0]:
        return compute_disparity(*pair(state), state.sgbm)
    count = state.sgbm.num_disparities
    return stereo_pipeline(state.matcher, -(-count // 32) * 32)(*pair(state)).disparity_px


@step("window", after=(matched, scan, pose))
def disparity(state: State) -> Float32:
    """The map as the matcher gives it, where the laser narrows its window, or everywhere."""
    turn, rectified = scan(state), rectified_rig(state)
    if state.window == WINDOWS[0] or turn is None or rectified is None or state.source == OWN:
        return matched(state)
    expected = expected_disparity(turn, rectified, pose(state), recordings.LASER_POSE)
    return compute_disparity_guided(*pair(state), expected, state.sgbm, margin_px=_MARGIN_PX)


@step("filter", "kernel_px", "kernel_shape", after=(disparity,))
def filtered(state: State) -> Float32:
    """The map after the filter."""
    if state.filter == FILTERS[0]:
        return disparity(state)
    left, right = pair(state)
    size = state.kernel_px if not state.half else max(3, state.kernel_px // 4 * 2 + 1)
    if state.filter == DILATION:
        return dilate(disparity(state), size, shape=state.kernel_shape)
    mirrored = None
    if state.filter == "left_right":
        mirrored = compute_disparity(right[:, ::-1].copy(), left[:, ::-1].copy(), state.sgbm)[:, ::-1]
    return smooth(disparity(state), state.filter, size_px=size, image=left, right_px=mirrored)


@step(after=(filtered, known))
def quality(state: State) -> Score | None:
    """The filtered map against the truth, where both cameras see the object."""
    truth = known(state)
    if truth is None or not truth.region.any():
        return None
    return score(filtered(state), truth.disparity_px, truth.region)


@step("tolerance_px", "constant_rows", after=(filtered,))
def recipe(state: State) -> HeightResult | str:
    """The paper's reading of the filtered map, or why there is none."""
    scale = 2 if state.half else 1
    cm_per_px = scale * paper.printed_value("scale.cm_per_px")
    rows, tolerance = state.constant_rows // scale, state.tolerance_px / scale
    try:
        return height_by_maximum(filtered(state), cm_per_px, rows, tolerance_px=tolerance)
    except ValueError as error:
        return str(error)


@step("source", "own", after=(rectified_rig,))
def standing(state: State) -> Standing | None:
    """What stands on the floor in the pair; None where nothing is known of the cameras."""
    rectified, shot = rectified_rig(state), taken(state)
    if rectified is None:
        return None
    lidar = Instrument.load(state.own[2]).lidar if state.source == OWN else None
    return see_standing(Views.of(shot.left, shot.right, rectified), Instrument(rectified, lidar))


@step(after=(standing,))
def ground_plane(state: State) -> HeightAttempt | None:
    """The height from floor, faces and edges of the pair; None where nothing is known of the cameras."""
    seen = standing(state)
    return attempt_standing(seen) if seen else None


@step(after=(standing, scan))
def measured(state: State) -> Measurement | str:
    """All objects from the pair and the scan, or why there are none."""
    seen = standing(state)
    if seen is None:
        return "no calibration"
    try:
        return measure_standing(seen, scan(state))
    except CannotMeasure as error:
        return str(error)


def without_laser(state: State) -> Measurement | str:
    """All objects from the pair alone, or why there are none."""
    return measured(replace(state, laser=False))


_TWO = ThreadPoolExecutor(2, "chain")
_LOOK_UP_S = 0.02
#: Two are under way at a time: what others need comes first.
_LONG = (taken, scan, known, measured, quality, rows, ground_plane, without_laser)


def is_made(state: State, is_old: Callable[[], bool]) -> bool:
    """Take the long steps of a state, two at a time, and wait no longer where nobody wants it any more.

    Parameters
    ----------
    state : State
    is_old : callable
        Asked again and again; what is under way then ends unseen.

    Returns
    -------
    bool
        Whether all were taken.
    """
    made = [_TWO.submit(one, state) for one in _LONG]
    while wait(made, _LOOK_UP_S).not_done and not is_old():
        pass
    if is_old():
        for one in made:
            one.cancel()
        return False
    for one in made:
        one.result()
    return True
