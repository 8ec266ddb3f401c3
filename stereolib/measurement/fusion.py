"""One object from both sensors: lines from laser and picture, their ends from the picture.

Everything stands in the floor's frame: origin on the floor below the left camera, x forward along the optical axis
laid flat, y left, z up, mm. What an object is made of: `stereolib.objects`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from stereolib.laser import Footprint
from stereolib.measurement.edges import vertical_edge
from stereolib.measurement.face_lines import (
    LaserOnFloor,
    Lines,
    combined,
    pictured_lines,
    scanned_lines,
    without,
    wrapped,
)
from stereolib.measurement.faces import Face
from stereolib.measurement.floor import Floor
from stereolib.measurement.object_height import Uncertainty

Array = np.ndarray
Seen = tuple[float, float] | None  # an edge in the picture: bearing and its deviation, rad
_MAP_END_PX = 4.0  # how well a disparity map shows where a face ends
_OVERHANG_PX = 6.5
_SCAN_END_PX = 1.5  # how far beyond the two beams it is looked for
_CORNER_SEARCH_PX = 5.0
_ALIKE = 0.7  # cosine between normals of the same face, as two sensors have it
_LEAST_SPAN_PX = 4.0  # less of a face is none
_SURE_SPAN_PX = 30.0  # so much of it must be seen if the scan does not show it
_NARROW_PX = 60.0  # a face up to so wide gives way to an edge where it should begin


@dataclass(frozen=True, eq=False)
class Fused:
    """Lines and ends of one object.

    Attributes
    ----------
    x : (5,) float64
        Of `Lines`, then the bearings (rad, left positive) of the outer end of the right and of the left face; of a
        single face its two ends.
    covariance : (5, 5) float64
    sources : dict
        ``"lines"``, ``"right end"``, ``"left end"`` -> which sensor.
    hidden : (right, left) bool
        Ends behind something nearer: the object may go on there.
    disagreement : str
        Empty, or in what laser and picture contradict each other.
    """

    x: Array
    covariance: Array
    sources: dict[str, str]
    hidden: tuple[bool, bool]
    disagreement: str

    @property
    def two(self) -> bool:
        """Two faces are seen."""
        return bool(np.isfinite(self.x[2]))

    def propagate(self, values: Callable[[Array], Array]) -> tuple[Array, Array]:
        """Functions (K, 5) -> (K, m) of x, (m,), and their covariance, by numerical derivatives."""
        known = np.flatnonzero(np.isfinite(self.x))
        steps = np.array([1e-5, 1e-3, 1e-3, 1e-6, 1e-6])
        at, *moved = values(np.vstack([self.x, self.x + np.diag(steps)[known]]))
        J = (np.array(moved) - at).T / steps[known]
        return at, J @ self.covariance[np.ix_(known, known)] @ J.T


def corners_mm(x: Array) -> Array:
    """Outer right end, corner and outer left end of two faces, (3, 2), or both ends of a single one, (2, 2), mm.

    Of `Fused.x`, (5,), or of many: (K, 5) gives (K, 3, 2) or (K, 2, 2).
    ``c r / (n . r)``, r the direction of an end's bearing; the corner is where the lines meet, ``c1 n1 + c2 n2``.
    """
    phi, c1, c2, right, left = x.T
    if not np.isfinite(c2).all():
        return np.stack([_meet(right, phi, c1), _meet(left, phi, c1)], axis=-2)
    away = _corner_bearing(x)
    corner = np.hypot(c1, c2)[..., None] * _direction(away)
    return np.stack([_meet(right, phi, c1), corner, _meet(left, phi - np.pi / 2, c2)], axis=-2)


def _direction(angle: Array | float) -> Array:
    """Unit vector, (..., 2)."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _meet(bearing: Array | float, angle: Array | float, c: Array | float) -> Array:
    """Where a bearing meets a line: ``c r / (n . r)``, the normal's angle given. (..., 2)."""
    return np.asarray(c / np.cos(bearing - angle))[..., None] * _direction(bearing)


def _corner_bearing(x: Array) -> Array:
    """Of the corner ``c1 n1 + c2 n2``, which is (c1, -c2) turned by phi."""
    return np.asarray(x[..., 0] - np.arctan2(x[..., 2], x[..., 1]))


def fuse(
    light: tuple[Array, Array],
    floor: Floor,
    *,
    footprint: Footprint | None = None,
    laser: LaserOnFloor | None = None,
    faces: tuple[Face, ...] = (),
    top_mm: float = np.nan,
    uncertainty: Uncertainty | None = None,
    bias_mm: float = 1.0,
) -> Fused | None:
    """Lines and ends of one object from what laser and pictures show of it.

    Parameters
    ----------
    light : (left, right), (H, W, 3) or (H, W) float32
        Rectified pictures as light.
    floor : Floor
    footprint, laser
        What the scan shows of it, and where the laser stands.
    faces : tuple of Face
        What the pair shows of it.
    top_mm : float
        Its height, or to what height it was seen: its upright edges are looked for below. NaN: ends from the scan.
    uncertainty : Uncertainty, optional
        Of the pair's calibration, and of errors common to a face.
    bias_mm : float
        Error that all readings of the laser on one face share.

    Returns
    -------
    Fused, or None where neither sensor shows a straight face

    Notes
    -----
    With x = (angle, c_right, c_left) both sensors give linear observations ``y = H x``: the fused lines are
    ``A^-1 sum H' C^-1 y`` with ``A = sum H' C^-1 H``. The corner's bearing in the picture is one more observation.
    """
    scanned = scanned_lines(footprint, laser, bias_mm)
    pictured = pictured_lines(faces, floor, uncertainty or Uncertainty())
    if scanned is None and pictured is None:
        return None
    lines, shares, disagreement = combined(scanned, pictured)
    if disagreement and shares == "image":
        footprint = None  # it is of another moment

    def edge(place: Array, normal: Array, prior_std_px: float, flat_px: float = 0.0, both: bool = True) -> Seen:
        if not np.isfinite(top_mm):
            return None
        found = vertical_edge(
            light if both else light[:1], floor, place, (0.1 * top_mm, 0.9 * top_mm), prior_std_px=prior_std_px,
            flat_px=flat_px, normal=normal,
        )  # fmt: skip
        return None if found is None else (found.position, found.std)

    f = floor.rectified.f_px
    roughly = _rough_ends(lines, footprint, laser, faces, floor)
    left_out: dict[int, _End] = {}
    if len(lines.seen) == 2:
        matched = [_matched_px(lines.normal(k), footprint, laser, faces, f) for k in (0, 1)]
        lines, left_out = _with_corner(lines, [end.bearing for end in roughly], matched, edge, f)
        roughly = _rough_ends(lines, footprint, laser, faces, floor)
    x, covariance = np.append(lines.x, [end.bearing for end in roughly]), np.zeros((5, 5))
    covariance[:3, :3] = lines.covariance
    sources = {"lines": shares}
    for side, (name, end) in enumerate(zip(("right end", "left end"), roughly, strict=True)):
        face = lines.seen[-side]
        normal, c = lines.normal(face), lines.x[1 + face]
        # A face that the right camera does not see ends there at another edge.
        both = bool(c + normal[1] * floor.rectified.baseline_mm > 0.05 * c)
        if side in left_out:  # at the corner, not where the face that was left out ends
            end, both = left_out[side], True
        seen = edge(_meet(end.bearing, lines.x[0] - face * np.pi / 2, c), normal, end.soft_px, end.flat_px, both)
        x[3 + side], std = seen or (end.bearing, end.std)
        if seen and len(lines.seen) == 1 and not left_out:
            std = max(std, _overhang_rad(side, x[3 + side], faces, floor))
        covariance[3 + side, 3 + side] = std**2
        sources[name] = "image" if seen else end.source
    return Fused(x, covariance, sources, (roughly[0].hidden, roughly[1].hidden), disagreement)


def _overhang_rad(side: int, bearing: float, faces: tuple[Face, ...], floor: Floor) -> float:
    """By how much a single face's edge lies beyond what was matched on it: there may stand a narrow second face.

    0 where that is no more than a disparity map leaves open, or where the right picture does not show it.
    """
    if not faces:
        return 0.0
    face, rectified = faces[-side], floor.rectified
    t = face.bearing[side]
    shift = rectified.f_px * rectified.baseline_mm * float(face.line @ [1.0, t])
    beyond = (bearing - np.arctan(t)) * (1 if side else -1)
    shown = rectified.P1[0, 2] - rectified.f_px * t - shift > 2 * _MAP_END_PX
    return float(beyond) if shown and beyond > _OVERHANG_PX / rectified.f_px else 0.0


def _matched_px(
    normal: Array, footprint: Footprint | None, laser: LaserOnFloor | None, faces: tuple[Face, ...], f_px: float
) -> float:
    """Width over which the disparity map shows a face of this direction, px; infinite if the scan shows it, too."""
    scanned = () if footprint is None or laser is None else footprint.faces
    if laser is not None and any(face.normal @ laser.R.T @ normal > _ALIKE for face in scanned):
        return np.inf
    like = [plane for plane in faces if plane.line @ normal > _ALIKE * np.linalg.norm(plane.line)]
    return f_px * max((plane.bearing[1] - plane.bearing[0] for plane in like), default=0.0)


def _with_corner(
    lines: Lines,
    ends: Sequence[float],
    matched: Sequence[float],
    edge: Callable[..., Seen],
    f_px: float,
) -> tuple[Lines, dict[int, _End]]:
    """The picture shows the corner between two faces: one more observation of the lines, or the judge over the smaller.

    A narrow face's own line may be far off. Where the corner's edge contradicts it, its line goes through that edge;
    where there is no room for it between corner and end it is left out; then the wide one ends at the corner (side ->
    where), or, where no edge shows there, somewhere on the narrow one.
    """
    (_, c1, c2), at = lines.x, wrapped(float(_corner_bearing(lines.x)))
    spans = f_px * np.array([at - ends[0], ends[1] - at])
    unsure = [k for k in (0, 1) if np.isfinite(matched[k])]
    seen_px = np.minimum(spans, matched)
    weak = unsure[0] if len(unsure) == 1 and seen_px.min() < _NARROW_PX else int(seen_px.argmin())
    if spans.min() < _LEAST_SPAN_PX or (weak in unsure and matched[weak] < 0.5 * min(spans[weak], _SURE_SPAN_PX)):
        return without(lines, weak), {}  # there is no room for it, or too little of it is there
    if weak in unsure and seen_px[weak] < _SURE_SPAN_PX:
        corner = _End(at, float(spans[weak]) / f_px, "image", False, _CORNER_SEARCH_PX, 0.0)
        return without(lines, weak), {weak: corner}
    distance = float(np.hypot(c1, c2))
    g = np.array([1.0, c2 / distance**2, -c1 / distance**2])  # derivative of the corner's bearing
    variance = float(g @ lines.covariance @ g)
    seen = edge(distance * _direction(at), lines.normal(1 - weak), max(f_px * np.sqrt(variance), _CORNER_SEARCH_PX))
    if seen is None:
        return lines, {}
    if (seen[0] - at) ** 2 < 9 * (variance + seen[1] ** 2):
        gain = lines.covariance @ g / (variance + seen[1] ** 2)
        return Lines(lines.x + gain * (seen[0] - at), lines.covariance - np.outer(gain, g @ lines.covariance)), {}
    if spans[weak] > _NARROW_PX:
        return lines, {}
    known = [0, 2 - weak]  # the angle and the wide face's line

    def through(y: Array) -> Array:
        x = lines.x.copy()
        x[known] = y[:2]
        corner = _meet(y[2], x[0] - (1 - weak) * np.pi / 2, x[known[1]])
        x[1 + weak] = Lines(x, lines.covariance).normal(weak) @ corner
        return x

    y = np.append(lines.x[known], seen[0])
    C = np.zeros((3, 3))
    C[:2, :2], C[2, 2] = lines.covariance[np.ix_(known, known)], seen[1] ** 2
    J = np.stack([(through(y + step) - through(y)) / step.sum() for step in np.diag([1e-5, 1e-3, 1e-6])], axis=1)
    return Lines(through(y), J @ C @ J.T), {}


@dataclass(frozen=True)
class _End:
    """Where a face ends, before the picture is asked: bearing and deviation, who says so, and how to search there."""

    bearing: float
    std: float
    source: str
    hidden: bool
    soft_px: float
    flat_px: float


def _rough_ends(
    lines: Lines, footprint: Footprint | None, laser: LaserOnFloor | None, faces: tuple[Face, ...], floor: Floor
) -> list[_End]:
    """Outer ends as scan and disparity map roughly have them: right, left."""
    rectified, ends = floor.rectified, []
    for side in (0, 1):
        normal, end = lines.normal(lines.seen[-side]), None
        for face in footprint.faces if footprint is not None and laser is not None else ():
            if laser is not None and face.normal @ laser.R.T @ normal > _ALIKE and face.ends[side] != "corner":
                x, y = laser.points_mm(face.ends_mm[side])
                distance = float(np.hypot(x, y))
                std = max(float(face.end_std_mm[side] * abs(normal @ [x, y])) / distance, 0.1) / distance
                # Between two beams every bearing is equally likely.
                flat_px = np.sqrt(3) * std * rectified.f_px
                end = _End(float(np.arctan2(y, x)), std, "scan", face.ends[side] == "hidden", _SCAN_END_PX, flat_px)
        for plane in faces if end is None else ():
            u = rectified.P1[0, 2] - rectified.f_px * plane.bearing[side]
            # Further left the right picture does not show what the left one does.
            first = 8 + side * rectified.f_px * rectified.baseline_mm * float(plane.line @ [1.0, plane.bearing[side]])
            if plane.line @ normal > _ALIKE * np.linalg.norm(plane.line) and first < u < rectified.size[0] - 8:
                bearing = float(np.arctan(plane.bearing[side]))
                end = _End(bearing, _MAP_END_PX / rectified.f_px, "image", False, _MAP_END_PX, 0.0)
        if end is None:  # cut by the frame, and not in the scan
            widest = max((plane.bearing[side] for plane in faces), key=abs, default=0.0)
            end = _End(float(np.arctan(widest)), 0.1, "image", True, _MAP_END_PX, 0.0)
        ends.append(end)
    return ends
