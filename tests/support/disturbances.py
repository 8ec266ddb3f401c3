"""What real rigs do to a recording: each a function of a shot, the rig as its owner knows it, and a random generator.

``ROWS`` names them with the scenes they are tried on; `benchmarks/bench_rigs.py` measures each row.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np

from stereolib.base import Float64, UInt8
from stereolib.measurement import Instrument
from stereolib.rig import to_light
from support import box_scenes
from support.box_scenes import BoxScene, Shot

Case = tuple[Shot, Instrument]
Disturbance = Callable[[Shot, Instrument, np.random.Generator], Case]
Picture = Callable[[UInt8], UInt8]
Recorder = Callable[[BoxScene], Shot]

_MOST_CLIPPED_PCT = 5.0  # of the pixels, where the light is chosen well
_FWHM_PER_SIGMA = float(np.sqrt(8 * np.log(2)))


@dataclass(frozen=True)
class Row:
    """One row of the bench.

    Attributes
    ----------
    about : str
        What is wrong, for the table.
    disturb : callable
    scenes : str
        Key of `SCENES`.
    silent_pct : float
        An error beyond it is silent: it is told, and nobody could know. Where nothing may be told as if it stood,
        less than 10.
    of_pair : bool
        What the scan alone shows is of another scene, and not held against this one.
    times : int
        So many times as many scenes as of other rows.
    """

    about: str
    disturb: Disturbance
    scenes: str = "plain"
    silent_pct: float = 10.0
    of_pair: bool = False
    times: int = 1


def untouched(shot: Shot, known: Instrument, rng: np.random.Generator) -> Case:
    """Leave all as it is."""
    return shot, known


# the laser


def laser_moved(
    *, yaw_deg: float = 0.0, sideways_mm: float = 0.0, any_way_mm: float = 0.0, up_to: bool = False
) -> Disturbance:
    """Move the laser after its calibration: turned to either side, shifted to either side or in any direction.

    With `up_to` the amounts are the largest ones.
    """

    def disturb(shot: Shot, known: Instrument, rng: np.random.Generator) -> Case:
        x, y, yaw = shot.truth.laser_pose
        share = rng.uniform(0, 1, 2) if up_to else np.ones(2)
        side, turn, way = rng.choice([-1, 1]), rng.choice([-1, 1]), rng.uniform(0, 2 * np.pi)
        x += share[0] * any_way_mm * float(np.cos(way))
        y += share[0] * (any_way_mm * float(np.sin(way)) + sideways_mm * side)
        pose = (x, y, yaw + share[1] * float(np.radians(yaw_deg)) * turn)
        return _scanned_again(shot, replace(shot.truth, laser_pose=pose), rng), known

    return disturb


def laser_pose_unknown(shot: Shot, known: Instrument, rng: np.random.Generator) -> Case:
    """Nobody calibrated the laser, which stands up to 50 mm and 5 degrees from straight below the camera."""
    below = replace(shot.truth, laser_pose=(0.0, 0.0, 0.0))
    moved, _ = laser_moved(yaw_deg=5.0, any_way_mm=50.0, up_to=True)(replace(shot, truth=below), known, rng)
    return replace(moved, truth=shot.truth), replace(known, lidar=None)


def other_scan(shot: Shot, known: Instrument, rng: np.random.Generator) -> Case:
    """The scan was taken at another moment: another box stands there."""
    other = box_scenes.plain_scene(int(rng.integers(10**6, 10**7)))
    return _scanned_again(shot, replace(shot.truth, scene=other.scene), rng), known


def no_scan(shot: Shot, known: Instrument, rng: np.random.Generator) -> Case:
    """The pair alone."""
    return replace(shot, scan=None), known


def emitter_beside_axis(shot: Shot, known: Instrument, rng: np.random.Generator) -> Case:
    """The laser's light leaves it 25 mm beside its axis, as in the real one."""
    sensor = replace(shot.truth.sensor, emitter_offset_mm=25.0)
    return _scanned_again(shot, replace(shot.truth, sensor=sensor), rng), known


def laser_too_far(pct: float) -> Disturbance:
    """The laser reads so much too far, or too near, here and when it was calibrated."""

    def disturb(shot: Shot, known: Instrument, rng: np.random.Generator) -> Case:
        off_pct = float(rng.choice([-1, 1])) * pct
        sensor = box_scenes.reading_too_far(shot.truth.sensor, off_pct)
        known = replace(known, lidar=box_scenes.instrument(laser_too_far_pct=off_pct).lidar)
        return _scanned_again(shot, replace(shot.truth, sensor=sensor), rng), known

    return disturb


def _scanned_again(shot: Shot, seen: BoxScene, rng: np.random.Generator) -> Shot:
    return replace(shot, scan=box_scenes.scan(seen, rng))


# the exposure


def _pictures(shot: Shot, left: Picture, right: Picture) -> Shot:
    return replace(shot, left=left(shot.left), right=right(shot.right))


def _to_8_bits(picture: Float64) -> UInt8:
    return np.asarray(np.clip(np.rint(picture), 0, 255), np.uint8)


def _brightest(picture: UInt8, clipped_pct: float) -> float:
    """Grey value that so many pixels reach in some channel."""
    return float(np.percentile(picture.max(axis=2), 100 - clipped_pct))


def scaled(gain: float) -> Picture:
    """Multiply a picture."""
    return lambda picture: _to_8_bits(gain * picture.astype(float))


def right_gain(gain: float) -> Disturbance:
    """Expose the right picture otherwise, in light that clips at most 5 % of the pixels of either."""

    def disturb(shot: Shot, known: Instrument, rng: np.random.Generator) -> Case:
        brightest = max(_brightest(p, _MOST_CLIPPED_PCT) * g for p, g in ((shot.left, 1.0), (shot.right, gain)))
        light = min(1.0, 254.0 / brightest)
        return _pictures(shot, scaled(light), scaled(light * gain)), known

    return disturb


def right_gamma(gamma: float) -> Disturbance:
    """Give the right picture another gamma, up or down."""

    def disturb(shot: Shot, known: Instrument, rng: np.random.Generator) -> Case:
        power = gamma ** rng.choice([-1, 1])
        return _pictures(shot, lambda left: left, lambda right: _to_8_bits(255 * (right / 255.0) ** power)), known

    return disturb


def over_exposed(clipped_pct: float) -> Disturbance:
    """Expose both pictures so long that a share of their pixels clips."""

    def disturb(shot: Shot, known: Instrument, rng: np.random.Generator) -> Case:
        left, right = (scaled(255.0 / _brightest(picture, clipped_pct)) for picture in (shot.left, shot.right))
        return _pictures(shot, left, right), known

    return disturb


def noisy(sigma: float) -> Disturbance:
    """Add normal noise of so many grey levels to both pictures."""

    def disturb(shot: Shot, known: Instrument, rng: np.random.Generator) -> Case:
        def add(picture: UInt8) -> UInt8:
            return _to_8_bits(picture + sigma * rng.standard_normal(picture.shape))

        return _pictures(shot, add, add), known

    return disturb


# the lenses


def right_moved(
    *, rows_px: float = 0.0, columns_px: float = 0.0, roll_deg: float = 0.0, zoom_pct: float = 0.0
) -> Disturbance:
    """Move the right picture, either way: its camera was turned, or focused otherwise, after the calibration."""

    def disturb(shot: Shot, known: Instrument, rng: np.random.Generator) -> Case:
        height, width = shot.right.shape[:2]
        sign = rng.choice([-1, 1], 4 if zoom_pct else 3)
        larger = 1 + float(sign[-1]) * zoom_pct / 100
        axis = known.rectified.rig.right.K[:2, 2].tolist()  # about which a camera rolls, and a lens zooms
        M = cv2.getRotationMatrix2D(axis, float(sign[0] * roll_deg), larger)
        M[:, 2] += [sign[1] * columns_px, sign[2] * rows_px]

        def warp(picture: UInt8) -> UInt8:
            how = {"flags": cv2.INTER_LANCZOS4, "borderMode": cv2.BORDER_REPLICATE}
            return np.asarray(cv2.warpAffine(picture, M, (width, height), **how), np.uint8)

        return _pictures(shot, lambda left: left, warp), known

    return disturb


def blurred(fwhm_px: float, *, by_lens: bool = False) -> Disturbance:
    """Blur both pictures by a normal spread of that full width at half maximum: grey levels, or, by a lens, light."""
    sigma_px = fwhm_px / _FWHM_PER_SIGMA

    def disturb(shot: Shot, known: Instrument, rng: np.random.Generator) -> Case:
        def blur(picture: UInt8) -> UInt8:
            if by_lens:
                return _to_8_bits(255 * cv2.GaussianBlur(to_light(picture), (0, 0), sigma_px) ** (1 / 2.2))
            return np.asarray(cv2.GaussianBlur(picture, (0, 0), sigma_px))

        return _pictures(shot, blur, blur), known

    return disturb


def compressed(quality: int) -> Disturbance:
    """Send both pictures as JPEG of that quality."""

    def disturb(shot: Shot, known: Instrument, rng: np.random.Generator) -> Case:
        def send(picture: UInt8) -> UInt8:
            data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
            return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR))

        return _pictures(shot, send, send), known

    return disturb


def one_after_another(*disturbances: Disturbance) -> Disturbance:
    """Disturb by each in turn."""

    def disturb(shot: Shot, known: Instrument, rng: np.random.Generator) -> Case:
        for one in disturbances:
            shot, known = one(shot, known, rng)
        return shot, known

    return disturb


#: Scenes by name: what stages one, and the rig as its owner knows it.
SCENES: dict[str, tuple[Callable[[int], BoxScene], Callable[[BoxScene], Instrument]]] = {
    "plain": (box_scenes.plain_scene, lambda _: box_scenes.instrument()),
    "own": (box_scenes.own_scene, box_scenes.own_instrument),
    "high": (box_scenes.high_scene, lambda _: box_scenes.high_instrument()),
    "cartons": (box_scenes.carton_scene, lambda _: box_scenes.instrument()),
    "bricks": (box_scenes.brick_scene, lambda _: box_scenes.instrument()),
    "held": (box_scenes.held_scene, lambda _: box_scenes.instrument()),
    "leaning": (box_scenes.leaning_scene, lambda _: box_scenes.instrument()),
    "faint": (box_scenes.faint_scene, lambda _: box_scenes.instrument()),
    "white": (box_scenes.white_wall_scene, lambda _: box_scenes.instrument()),
    "white_cartons": (box_scenes.carton_at_white_wall_scene, lambda _: box_scenes.instrument()),
    "neighbour": (box_scenes.neighbour_scene, lambda _: box_scenes.instrument()),
    "neighbour_cartons": (box_scenes.neighbour_carton_scene, lambda _: box_scenes.instrument()),
    "neighbour_white": (box_scenes.neighbour_at_white_wall_scene, lambda _: box_scenes.instrument()),
    "turned": (box_scenes.turned_scene, box_scenes.before_turning),
    "risen": (box_scenes.risen_scene, lambda _: box_scenes.instrument()),
    "refocused": (box_scenes.refocused_scene, lambda _: box_scenes.instrument()),
    "tripod": (box_scenes.tripod_scene, box_scenes.own_instrument),
}  # fmt: skip
_CHEAP_WEBCAM = one_after_another(
    laser_moved(yaw_deg=1.0, any_way_mm=10.0, up_to=True), blurred(1.5),
    right_moved(rows_px=0.3, roll_deg=0.1), right_gain(0.85), noisy(3.0), compressed(60),
)  # fmt: skip

ROWS: dict[str, Row] = {
    "undisturbed": Row("nothing is wrong", untouched),
    "own": Row(
        "nothing is wrong; each recording has a rig, calibration, floor and camera place of its own",
        untouched,
        "own",
        times=4,  # in the other rows sizes err together; here a share of intervals means something
    ),
    "laser_yaw_2": Row("laser turned by 2 degrees since its calibration", laser_moved(yaw_deg=2.0)),
    "laser_yaw_5": Row("laser turned by 5 degrees since its calibration", laser_moved(yaw_deg=5.0)),
    "laser_side_30": Row("laser shifted by 30 mm to one side since its calibration", laser_moved(sideways_mm=30.0)),
    "laser_any_50": Row("laser shifted by 50 mm in any direction since its calibration", laser_moved(any_way_mm=50.0)),
    "laser_unknown": Row("laser never calibrated, up to 50 mm and 5 degrees from below the camera", laser_pose_unknown),
    "other_scan": Row("scan taken of another scene than the pictures", other_scan, of_pair=True),
    "no_scan": Row("no scan: the two pictures alone", no_scan),
    "emitter": Row("laser whose light starts 25 mm beside its axis, as a real XV-11's does", emitter_beside_axis),
    "laser_far_2": Row("laser that reads 2 % too far or too near, at its calibration too", laser_too_far(2.0)),
    "gain_0.5": Row("right picture half as bright as the left one", right_gain(0.5)),
    "gain_0.7": Row("right picture 0.7 times as bright as the left one", right_gain(0.7)),
    "gain_1.4": Row("right picture 1.4 times as bright as the left one", right_gain(1.4)),
    "gain_2": Row("right picture twice as bright as the left one", right_gain(2.0)),
    "gamma_1.5": Row("right picture's grey levels bent: gamma 1.5 or its inverse", right_gamma(1.5)),
    "noise_10": Row("noise of 10 grey levels in both pictures", noisy(10.0)),
    "clipped_15": Row("both pictures overexposed: 15 % of the pixels white", over_exposed(15.0)),
    "rows_0.5": Row("right camera tilted since the calibration: picture 0.5 px up or down", right_moved(rows_px=0.5)),
    "rows_1": Row("right camera tilted since the calibration: picture 1 px up or down", right_moved(rows_px=1.0)),
    "rows_2": Row("right camera tilted since the calibration: picture 2 px up or down", right_moved(rows_px=2.0)),
    "roll_0.3": Row("right camera rolled by 0.3 degrees since the calibration", right_moved(roll_deg=0.3)),
    "roll_1": Row("right camera rolled by 1 degree since the calibration", right_moved(roll_deg=1.0)),
    "zoom_0.5": Row(
        "right lens focused otherwise than when calibrated: its picture 0.5 % larger or smaller",
        right_moved(zoom_pct=0.5),
    ),
    "zoom_2": Row(
        "right lens focused otherwise than when calibrated: its picture 2 % larger or smaller",
        right_moved(zoom_pct=2.0),
    ),
    "columns_1": Row(
        "right picture shifted since the calibration, as by a lens: 1 px left or right", right_moved(columns_px=1.0)
    ),
    "columns_1_no_scan": Row(
        "right picture shifted since the calibration, as by a lens, no scan: 1 px left or right",
        one_after_another(right_moved(columns_px=1.0), no_scan),
    ),
    "risen": Row("right camera raised or lowered by up to 2 mm since the calibration", untouched, "risen"),
    "refocused": Row(
        "both lenses focused otherwise than when calibrated: k1 larger or smaller by 0.01", untouched, "refocused"
    ),
    "turned": Row(
        "either camera of a rig of its own turned sideways by up to 0.8 degrees since its calibration",
        untouched,
        "turned",
    ),
    "turned_no_scan": Row(
        "either camera of a rig of its own turned sideways by up to 0.8 degrees since its calibration, no scan",
        no_scan,
        "turned",
    ),
    "blur_3": Row("grey levels of both pictures blurred by 3 px (full width at half maximum)", blurred(3.0)),
    "lens_blur_3": Row("both lenses out of focus: light blurred by 3 px", blurred(3.0, by_lens=True)),
    "jpeg_20": Row("both pictures as JPEG of quality 20", compressed(20)),
    "cheap_webcam": Row(
        "a cheap webcam: laser and right camera moved, gain, noise, blur and JPEG, each mildly", _CHEAP_WEBCAM
    ),
    "high": Row("nothing is wrong, the camera 450 mm high and looking down by 20 degrees", untouched, "high"),
    "tripod": Row(
        "nothing is wrong, rigs of their own on a tripod, up to 0.95 m high, look down by 20 to 45 degrees; no scan",
        no_scan,
        "tripod",
    ),
    "cartons": Row("nothing is wrong, with printed cartons on a terrazzo floor", untouched, "cartons"),
    "bricks": Row("nothing is wrong, with boxes of brick pattern on a floor of planks", untouched, "bricks"),
    "cartons_gain_0.7": Row(
        "printed cartons on terrazzo, right picture 0.7 times as bright", right_gain(0.7), "cartons"
    ),
    "cartons_rows_1": Row(
        "printed cartons on terrazzo, right camera tilted: picture 1 px up or down", right_moved(rows_px=1.0), "cartons"
    ),
    "cartons_jpeg_20": Row(
        "printed cartons on terrazzo, both pictures as JPEG of quality 20", compressed(20), "cartons"
    ),
    "cartons_webcam": Row("printed cartons on terrazzo, a cheap webcam as above", _CHEAP_WEBCAM, "cartons"),
    "faint": Row("nothing is wrong, with surfaces of little contrast", untouched, "faint"),
    "faint_gain_0.7": Row("surfaces of little contrast, right picture 0.7 times as bright", right_gain(0.7), "faint"),
    "faint_gain_1.4": Row("surfaces of little contrast, right picture 1.4 times as bright", right_gain(1.4), "faint"),
    "faint_rows_1": Row(
        "surfaces of little contrast, right camera tilted: picture 1 px up or down", right_moved(rows_px=1.0), "faint"
    ),
    "white": Row("nothing is wrong, before walls that show nothing", untouched, "white"),
    "white_webcam": Row("before walls that show nothing, a cheap webcam as above", _CHEAP_WEBCAM, "white"),
    "white_cartons": Row("printed cartons on terrazzo, before walls that show nothing", untouched, "white_cartons"),
    "neighbour": Row("a second box stands up to 150 mm beside the first one", untouched, "neighbour"),
    "neighbour_cartons": Row("a second printed carton beside the first one", untouched, "neighbour_cartons"),
    "neighbour_white": Row(
        "a second printed carton beside the first one, before walls that show nothing", untouched, "neighbour_white"
    ),
    "held": Row("a carton held 20 to 150 mm in the air, which has to be refused", untouched, "held", silent_pct=3.0),
    "leaning": Row(
        "a carton that leans by 5 to 20 degrees, which has to be refused", untouched, "leaning", silent_pct=3.0
    ),
}
_FIRST_SEED = 10_000  # none of `benchmarks/bench_dimensions.py`


def case(row: str, number: int, record: Recorder = box_scenes.recorded) -> Case:
    """Record one scene, disturb it, and say how its owner knows the rig: the same for the same number."""
    (shot, known), change = shot_of(ROWS[row].scenes, number, record), ROWS[row].disturb
    return change(shot, known, np.random.default_rng([615, *row.encode(), number]))


@lru_cache(maxsize=32)
def shot_of(scenes: str, number: int, record: Recorder = box_scenes.recorded) -> Case:
    """Record one scene of `SCENES` as it is."""
    stage, known = SCENES[scenes]
    scene = stage(_FIRST_SEED * (1 + list(SCENES).index(scenes)) + number)
    return record(scene), known(scene)


@dataclass(frozen=True)
class Told:
    """What a measurement told of one box.

    Attributes
    ----------
    off : dict
        Error in % and in standard deviations, by size.
    measurable : bool
        All sizes can be told in principle.
    wide : bool
        Also if a second face counts only where it is `box_scenes.WIDE_PX` wide.
    why : str
        Why a size is missing; "" if none is.
    nothing : bool
        No size at all: the scene was refused.
    """

    off: dict[str, tuple[float, float]]
    measurable: bool
    wide: bool
    why: str
    nothing: bool


def tell(shot: Shot, known: Instrument, *, of_pair: bool = False) -> Told:
    """Measure a case."""
    measurable, wide = (box_scenes.is_measurable(shot.truth, px) for px in (box_scenes.SEEN_PX, box_scenes.WIDE_PX))
    try:
        thing = box_scenes.the_box(box_scenes.measure(shot, known), shot.truth, of_pair=of_pair)
    except ValueError as error:
        return Told({}, measurable, wide, _in_short(str(error)), True)
    except Exception as error:  # a row of a bench goes on, and says so
        return Told({}, measurable, wide, f"crashed: {type(error).__name__}", True)
    off = box_scenes.errors(thing, shot.truth)
    why = "no object" if thing is None else " and ".join(sorted({_in_short(str(v)) for v in thing.reasons.values()}))
    return Told(off, measurable, wide, "" if "volume" in off else why, not off)


def _in_short(text: str) -> str:
    return text.split(":")[0]
