"""The height of objects over the floor they stand on: no constant, no scale, and a standard deviation.

Floor and upright faces are planes, so their disparities are linear in the pixel; the top is an edge of the picture. A
pixel on that edge has ``height = h (1 - d_floor / d_face)``, h being the camera's own height over the floor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolib.measurement.edges import locate_edge
from stereolib.measurement.faces import Face, find_faces
from stereolib.measurement.floor import Floor, fit_floor
from stereolib.measurement.plane_alignment import AlignedPair, CannotMeasure, median
from stereolib.measurement.regions import STEP, Region, find_objects, rays
from stereolib.rig import RectifiedRig, to_light

Array = np.ndarray
_LEAST_CONTRAST = 1.15  # an edge against the lines around it
_CUT = "the object's top lies above the picture or on its border: step back or tilt the camera up"


@dataclass(frozen=True)
class Uncertainty:
    """What is not seen in the scatter of one pair, as standard deviations.

    Parameters
    ----------
    floor_px, floor_rows : float
        Error that all disparities of the floor have in common: px, and px for each px by which the floor's disparity
        grows from row to row (a floor seen at a grazing angle is harder).
    face_px : float
        The same of a face.
    f_px, baseline_mm : float
        Of the calibration.
    offset_px : float
        Error of the calibration that shifts every disparity of the picture alike.
    """

    floor_px: float = 0.02
    floor_rows: float = 0.18
    face_px: float = 0.02
    f_px: float = 0.0
    baseline_mm: float = 0.0
    offset_px: float = 0.0


#: Common errors of planes fitted to block matching's disparities alone.
MATCHED = Uncertainty(floor_px=0.15, floor_rows=0.4, face_px=0.15)


@dataclass(frozen=True, eq=False)
class GroundHeight:
    """A height with its standard deviation, and what it was measured from.

    Attributes
    ----------
    height_mm, height_std_mm : float
    faces : one or two Face
        From right to left.
    near_mm : (2,) float64
        The near vertical edge on the floor (or the nearest point of a single face): forward, left.
    foot_px, top_px : (2,) float64
        Its lower and upper end in the rectified left image; may lie outside.
    edge_std_px : float
        How well the upper outline was located.
    parts_mm : dict
        Standard deviations that make up the whole: ``edge, floor, face, common, calibration``.
    cut : tuple of str
        Sides of the frame that the object touches: "left", "right", "bottom".
    """

    height_mm: float
    height_std_mm: float
    faces: tuple[Face, ...]
    near_mm: Array
    foot_px: Array
    top_px: Array
    edge_std_px: float
    parts_mm: dict[str, float]
    cut: tuple[str, ...]


def measure_height(
    left: Array,
    right: Array,
    floor: Floor,
    region: Region,
    *,
    pair: AlignedPair | None = None,
    uncertainty: Uncertainty | None = None,
    least_pixels: int = 60,
    least_share: float = 1 / 3,
    worst_std: float = 0.05,
) -> GroundHeight:
    """Height of an object with upright faces.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        Rectified; the top edge is looked for in both.
    floor : Floor
    region : Region
        From `find_objects`.
    pair : AlignedPair, optional
        Aligns the faces to a few hundredths of a pixel; without it they are as good as the disparity map.
    uncertainty : Uncertainty, optional
        By default `Uncertainty()` with a pair, `MATCHED` without.
    least_pixels : int
        Matched pixels that a face needs.
    least_share : float
        Share of the faces' pixels that must have been matched: what is left of a plain or shining face is chance.
    worst_std : float
        Standard deviation above which nothing is returned, as a share of the height.

    Raises
    ------
    CannotMeasure
        "cut by the frame", "no texture", "no top edge", "too uncertain".

    Notes
    -----
    The standard deviation adds, in squares: the edge's, that of the floor's and the faces' planes, of errors common to
    all their disparities, and of the calibration, each through the derivative of ``h (1 - d_floor / d_face)``.
    """
    rectified = floor.rectified
    uncertainty = uncertainty or (MATCHED if pair is None else Uncertainty())
    if region.bounds[1] <= 3 * STEP:
        raise CannotMeasure("cut by the frame", _CUT)
    faces = find_faces(floor, region, pair, least=least_pixels)
    top = _rough_top(floor, region, faces)
    step_px, reach_px = 0.25, 7.0
    per_px = min(float(face.points_mm(t)[0]) for face in faces for t in face.bearing) / rectified.f_px
    heights = top + per_px * np.arange(-reach_px, reach_px + step_px, step_px)
    lines = np.stack([_level_lines_mm(floor, face, heights) for face in faces])
    middle = lines[:, len(heights) // 2]
    if np.mean(middle[..., 1] / middle[..., 2]) * rectified.f_px + rectified.P1[1, 2] < reach_px:
        raise CannotMeasure("cut by the frame", _CUT)
    area = np.ptp([_row(floor, faces, height) for height in (0.0, top)]) * rectified.f_px
    area *= sum(face.bearing[1] - face.bearing[0] for face in faces)
    share = STEP**2 * sum(face.pixels for face in faces) / area
    if share < least_share:
        raise CannotMeasure("no texture", f"only {100 * share:.0f} % of its faces were matched; light or texture it")
    light = (to_light(left), to_light(right)) if pair is None else pair.light
    edge = locate_edge(light, rectified, lines, heights, (top, 3.0 * per_px), step_px, samples=160)
    if edge is None or edge.contrast < _LEAST_CONTRAST:
        raise CannotMeasure("no top edge", "the object's upper outline does not stand out; change light or background")
    parts = _parts(floor, faces, edge.position, edge.std, uncertainty)
    near = _near(faces)
    ends_px = floor.pixels(np.array([[*near, 0.0], [*near, edge.position]]))
    width, height = rectified.size
    x0, _, x1, y1 = region.bounds
    touched = {"left": x0 <= STEP, "right": x1 >= width - 1 - STEP, "bottom": y1 >= height - 1 - STEP}
    total = float(np.sqrt(sum(part**2 for part in parts.values())))
    if total > worst_std * edge.position:
        text = f"{edge.position:.0f} ± {total:.0f} mm; light or texture the object"
        raise CannotMeasure("too uncertain", text)
    return GroundHeight(
        edge.position, total, faces, near, ends_px[0], ends_px[1], edge.std / per_px, parts,
        tuple(side for side, is_cut in touched.items() if is_cut),
    )  # fmt: skip


def height_of_nearest(
    left: Array,
    right: Array,
    disparity_px: Array,
    rectified: RectifiedRig,
    *,
    rng: np.random.Generator,
    uncertainty: Uncertainty | None = None,
) -> GroundHeight:
    """Floor, objects, and the height of the nearest one, in one call.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        Rectified.
    disparity_px : (H, W) float, px
        Matched from them, NaN where invalid.
    rectified : RectifiedRig
    rng : numpy.random.Generator
    uncertainty : Uncertainty, optional

    Raises
    ------
    CannotMeasure
        "no floor", "no object", or as `measure_height`.
    """
    pair = AlignedPair.of(left, right)
    floor = fit_floor(disparity_px, rectified, rng=rng, pair=pair)
    objects = find_objects(disparity_px, floor)
    if not objects:
        raise CannotMeasure(
            "no object", "nothing stands on the floor within 1.8 m; place the object nearer, or texture it"
        )
    return measure_height(left, right, floor, objects[0], pair=pair, uncertainty=uncertainty)


def _rough_top(floor: Floor, region: Region, faces: tuple[Face, ...]) -> float:
    """Height to which the disparities follow the faces, column by column. mm."""
    scale = floor.rectified.f_px * floor.rectified.baseline_mm
    ray = rays(floor, region.u, region.v)
    t = ray[1] / ray[0]
    tops = []
    for face in faces:
        low, high = face.bearing
        on = (t > low) & (t < high) & (np.abs(region.disparity_px - scale * (face.line @ ray)) < 1.2)
        index = region.u[on].astype(int) // STEP
        highest = np.full(int(index.max(initial=0)) + 1, -np.inf)
        np.maximum.at(highest, index, region.height_mm[on])
        tops.append(highest[np.isfinite(highest)])
    return median(np.concatenate(tops))


def _level_lines_mm(floor: Floor, face: Face, heights: Array) -> Array:
    """Both ends of level lines on a face, (heights, 2, 3) mm, in the rectified left camera's frame."""
    low, high = face.bearing
    trim = 0.04 * (high - low)
    ground = face.points_mm(np.array([low + trim, high - trim])) @ floor.axes[:2]
    return np.asarray(ground + (heights - floor.camera_height_mm)[:, None, None] * floor.axes[2])


def _row(floor: Floor, faces: tuple[Face, ...], height_mm: float) -> float:
    """Row of the near edge at a height, px."""
    return float(floor.pixels(np.array([[*_near(faces), height_mm]]))[0, 1])


def _near(faces: tuple[Face, ...]) -> Array:
    if len(faces) == 2:
        (a, b), (c, d) = faces[0].line, faces[1].line
        return faces[0].points_mm(np.array((c - a) / (b - d)))
    ends = faces[0].points_mm(np.array(faces[0].bearing))
    return ends[ends[:, 0].argmin()]


def _parts(
    floor: Floor, faces: tuple[Face, ...], height: float, edge_mm: float, given: Uncertainty
) -> dict[str, float]:
    """Standard deviations of the height, part by part, mm; averaged over the faces by their widths."""
    rectified = floor.rectified
    h, scale = floor.camera_height_mm, rectified.f_px * rectified.baseline_mm
    widths = np.array([face.bearing[1] - face.bearing[0] for face in faces])
    shares = widths / widths.sum()
    by_floor, face_var, by_face = np.zeros(3), 0.0, 0.0
    K = rectified.P1[:, :3]
    plane_to_h = -(h**3) * (K @ (K.T @ floor.plane)) / scale**2  # derivative of 1 / |n|
    for face, share in zip(faces, shares, strict=True):
        t = sum(face.bearing) / 2
        ground = face.points_mm(t)
        point = np.array([*ground, height - h]) @ floor.axes
        pixel = K @ point / point[2]
        d = scale / point[2]
        ratio = float(floor.plane @ pixel) / d
        by_floor += share * ((1 - ratio) * plane_to_h - h / d * pixel)
        to_line = h * ratio / d * scale * (floor.along @ pixel)
        face_var += float((share * to_line) @ face.covariance @ (share * to_line))
        by_face += share * h * ratio / d
    common_floor = float(by_floor[2])
    floor_px = float(np.hypot(given.floor_px, given.floor_rows * floor.plane[1]))
    by_f = height * float(floor.down[2]) ** 2 / rectified.f_px  # it tilts the floor, and a level one not at all
    calibration = (height * given.baseline_mm / rectified.baseline_mm, by_f * given.f_px)
    return {
        "edge": edge_mm,
        "floor": float(np.sqrt(by_floor @ floor.covariance @ by_floor)),
        "face": float(np.sqrt(face_var)),
        "common": float(np.hypot(common_floor * floor_px, by_face * given.face_px)),
        "calibration": float(np.hypot(np.hypot(*calibration), (common_floor + by_face) * given.offset_px)),
    }
