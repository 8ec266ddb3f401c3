"""The height of objects over the floor they stand on: no constant, no scale, and a standard deviation.

Floor and upright faces are planes, so their disparities are linear in the pixel; the top is an edge of the picture. A
pixel on that edge has ``height = h (1 - d_floor / d_face)``, h being the camera's own height over the floor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolib.base import Float64
from stereolib.measurement.edges import STEP_PX, EdgePrior, ParallelLines, locate_edge
from stereolib.measurement.faces import Face, find_faces
from stereolib.measurement.floor import Floor
from stereolib.measurement.plane_alignment import AlignedPair, CannotMeasure, median
from stereolib.measurement.regions import STEP, ObjectRegion

_LEAST_CONTRAST = 1.15  # an edge against the lines around it
_LEAST_SHARE = 1 / 3  # of the faces' pixels that must be matched: what is left of a plain or shining face is chance
_REACH_PX = 7.0  # the top is looked for so far from where the disparities end
_PRIOR_PX = 3.0  # standard deviation of where they end: half of SGBM's block
_ON_FACE_PX = 1.2  # a disparity so near a face's plane is of the face
_TRIM = 0.04  # share of a face at either end where the top edge is not looked for: corners blur
_SAMPLES = 160  # points on the top edge
_CUT = "the object's top lies above the picture or on its border: step back or tilt the camera up"


@dataclass(frozen=True)
class SystematicUncertainty:
    """Errors that the scatter within one pair does not show, as standard deviations.

    Attributes
    ----------
    floor_px, floor_rows : float
        Error that all disparities of the floor have in common: px, and px for each px by which the floor's disparity
        grows from row to row (a floor seen at a grazing angle is harder).
    face_px : float
        Error that all disparities of a face have in common, px.
    f_px, baseline_mm : float
        Of the calibration: of the focal length after rectification, and of the baseline.
    offset_px : float
        Error of the calibration that shifts every disparity of the picture alike.
    """

    floor_px: float = 0.02
    floor_rows: float = 0.18
    face_px: float = 0.02
    f_px: float = 0.0
    baseline_mm: float = 0.0
    offset_px: float = 0.0


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
    parts_mm : dict
        Standard deviations that make up the whole: ``edge, floor, face, common, calibration``.
    """

    height_mm: float
    height_std_mm: float
    faces: tuple[Face, ...]
    near_mm: Float64
    foot_px: Float64
    top_px: Float64
    parts_mm: dict[str, float]


def measure_height(
    pair: AlignedPair,
    floor: Floor,
    region: ObjectRegion,
    *,
    uncertainty: SystematicUncertainty | None = None,
    worst_std: float = 0.05,
) -> GroundHeight:
    """Measure the height of an object with upright faces.

    Parameters
    ----------
    pair : AlignedPair
        The rectified pictures: the faces are aligned over both, and the top edge is looked for in both.
    floor : Floor
    region : ObjectRegion
        From `find_objects`.
    uncertainty : SystematicUncertainty, optional
        By default that of a perfect calibration.
    worst_std : float
        Standard deviation above which nothing is returned, as a share of the height.

    Returns
    -------
    GroundHeight

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
    if region.bounds[1] <= 3 * STEP:
        raise CannotMeasure("cut by the frame", _CUT)
    faces = find_faces(floor, region, pair)
    top = _rough_top(floor, region, faces)
    per_px = min(float(face.points_mm(t)[0]) for face in faces for t in face.bearing) / rectified.f_px
    heights = top + per_px * np.arange(-_REACH_PX, _REACH_PX + STEP_PX, STEP_PX)
    lines = np.stack([_level_lines_mm(floor, face, heights) for face in faces])
    middle = lines[:, len(heights) // 2]
    if np.mean(middle[..., 1] / middle[..., 2]) * rectified.f_px + rectified.P1[1, 2] < _REACH_PX:
        raise CannotMeasure("cut by the frame", _CUT)
    near = _near(faces)
    area = np.ptp(floor.pixels(np.array([[*near, 0.0], [*near, top]]))[:, 1]) * rectified.f_px
    area *= sum(face.bearing[1] - face.bearing[0] for face in faces)
    share = STEP**2 * sum(face.pixels for face in faces) / area
    if share < _LEAST_SHARE:
        raise CannotMeasure("no texture", f"only {100 * share:.0f} % of its faces were matched; light or texture it")
    outlines, prior = ParallelLines(lines, heights, STEP_PX), EdgePrior(top, _PRIOR_PX * per_px)
    edge = locate_edge(pair.light, rectified, outlines, prior, samples=_SAMPLES)
    if edge is None or edge.contrast < _LEAST_CONTRAST:
        raise CannotMeasure("no top edge", "the object's upper outline does not stand out; change light or background")
    parts = _parts(floor, faces, edge.position, edge.std, uncertainty or SystematicUncertainty())
    foot_px, top_px = floor.pixels(np.array([[*near, 0.0], [*near, edge.position]]))
    total = float(np.sqrt(sum(part**2 for part in parts.values())))
    if total > worst_std * edge.position:
        raise CannotMeasure("too uncertain", f"{edge.position:.0f} ± {total:.0f} mm; light or texture the object")
    return GroundHeight(edge.position, total, faces, near, foot_px, top_px, parts)


def _rough_top(floor: Floor, region: ObjectRegion, faces: tuple[Face, ...]) -> float:
    """Height to which the disparities follow the faces, column by column. mm."""
    scale = floor.rectified.f_px * floor.rectified.baseline_mm
    ray = floor.rays(region.u, region.v)
    t = ray[1] / ray[0]
    tops = []
    for face in faces:
        low, high = face.bearing
        on = (t > low) & (t < high) & (np.abs(region.disparity_px - scale * (face.line @ ray)) < _ON_FACE_PX)
        index = region.u[on].astype(int) // STEP
        highest = np.full(int(index.max(initial=0)) + 1, -np.inf)
        np.maximum.at(highest, index, region.height_mm[on])
        tops.append(highest[np.isfinite(highest)])
    return median(np.concatenate(tops))


def _level_lines_mm(floor: Floor, face: Face, heights: Float64) -> Float64:
    """Both ends of level lines on a face, (heights, 2, 3) mm, in the rectified left camera's frame."""
    low, high = face.bearing
    trim = _TRIM * (high - low)
    ground = face.points_mm(np.array([low + trim, high - trim])) @ floor.axes[:2]
    return np.asarray(ground + (heights - floor.camera_height_mm)[:, None, None] * floor.axes[2])


def _near(faces: tuple[Face, ...]) -> Float64:
    """Where the near vertical edge stands on the floor, or the nearest end of a single face. (2,) mm."""
    if len(faces) == 2:
        (a, b), (c, d) = faces[0].line, faces[1].line
        return faces[0].points_mm(np.array((c - a) / (b - d)))
    ends = faces[0].points_mm(np.array(faces[0].bearing))
    return np.asarray(ends[ends[:, 0].argmin()])


def _parts(
    floor: Floor, faces: tuple[Face, ...], height: float, edge_mm: float, given: SystematicUncertainty
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
