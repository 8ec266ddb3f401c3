"""One object from both sensors: lines from laser and picture, their ends from the picture.

Everything stands in the floor's frame: origin on the floor below the left camera, x forward along the optical axis
laid flat, y left, z up, mm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stereolib.base import Float32, Float64, direction, wrap_rad
from stereolib.laser import Footprint
from stereolib.measurement.edges import vertical_edge
from stereolib.measurement.face_lines import FaceLines, LaserOnFloor, combined, pictured_lines, scanned_lines, without
from stereolib.measurement.faces import Face
from stereolib.measurement.floor import Floor
from stereolib.measurement.object_height import SystematicUncertainty

Bearing = tuple[float, float]  # of an edge in the picture, and its deviation, rad
_MAP_END_PX = 4.0  # how well a disparity map shows where a face ends
_OVERHANG_PX = 6.5
_SCAN_END_PX = 1.5  # how far beyond the two beams it is looked for
_CORNER_SEARCH_PX = 5.0
_ALIKE = 0.7  # cosine between normals of the same face, as two sensors have it
_LEAST_SPAN_PX = 4.0  # less of a face is none
_SURE_SPAN_PX = 30.0  # so much of it must be seen if the scan does not show it
_NARROW_PX = 60.0  # a face up to so wide gives way to an edge where it should begin
_EDGE_HEIGHTS = (0.1, 0.9)  # shares of the height between which upright edges are looked for
_GRAZING = 0.05  # share of a face's distance: the right camera sees no face whose plane it stands nearer to
_CONTRADICTION = 3.0  # standard deviations between a corner and its edge in the picture
_BORDER_PX = 8  # a face that ends nearer to the frame is cut by it
_CUT_STD_RAD = 0.1  # deviation of an end that nobody sees
_LEAST_END_MM = 0.1  # deviation of an end in the scan, at least
_STEPS = np.array([1e-5, 1e-3, 1e-3, 1e-6, 1e-6])  # of numerical derivatives by `Fused.x`


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the sensors show of one object.

    Attributes
    ----------
    footprint : Footprint or None
        What the scan shows.
    faces : tuple of Face
        What the pair shows, from right to left.
    top_mm : float
        Its height, or to what height it was seen: its upright edges are looked for below. NaN: ends from the scan.
    """

    footprint: Footprint | None = None
    faces: tuple[Face, ...] = ()
    top_mm: float = np.nan


@dataclass(frozen=True, eq=False)
class Fused:
    """Lines and ends of one object.

    Attributes
    ----------
    x : (5,) float64
        Of `FaceLines`, then the bearings (rad, left positive) of the outer end of the right and of the left face; of a
        single face its two ends.
    covariance : (5, 5) float64
    sources : dict
        ``"lines"``, ``"right end"``, ``"left end"`` -> which sensor.
    hidden : (right, left) bool
        Ends behind something nearer: the object may go on there.
    disagreement : str
        Empty, or in what laser and picture contradict each other.
    """

    x: Float64
    covariance: Float64
    sources: dict[str, str]
    hidden: tuple[bool, bool]
    disagreement: str

    @property
    def two(self) -> bool:
        """Two faces are seen."""
        return bool(np.isfinite(self.x[2]))

    def propagate(self, values: Callable[[Float64], Float64]) -> tuple[Float64, Float64]:
        """Carry the covariance through functions of x, by numerical derivatives.

        Parameters
        ----------
        values : callable
            Takes (K, 5) to (K, m).

        Returns
        -------
        values : (m,) float64
            At x.
        covariance : (m, m) float64
        """
        known = np.flatnonzero(np.isfinite(self.x))
        at, *moved = values(np.vstack([self.x, self.x + np.diag(_STEPS)[known]]))
        J = (np.array(moved) - at).T / _STEPS[known]
        return at, J @ self.covariance[np.ix_(known, known)] @ J.T


def corners_mm(x: Float64) -> Float64:
    """Corners of the visible outline on the floor, from right to left.

    Parameters
    ----------
    x : (5,) or (K, 5) float64
        As `Fused.x`.

    Returns
    -------
    (3, 2) or (2, 2) float64, mm, or K of them
        Outer right end, corner and outer left end of two faces, or both ends of a single one.

    Notes
    -----
    An end is ``c r / (n . r)``, r the direction of its bearing; the corner is where the lines meet, ``c1 n1 + c2 n2``.
    """
    phi, c1, c2, right, left = x.T
    if not np.isfinite(c2).all():
        return np.stack([_meet(right, phi, c1), _meet(left, phi, c1)], axis=-2)
    corner = np.hypot(c1, c2)[..., None] * direction(_corner_bearing(x))
    return np.stack([_meet(right, phi, c1), corner, _meet(left, phi - np.pi / 2, c2)], axis=-2)


def _meet(bearing: Float64 | float, angle: Float64 | float, c: Float64 | float) -> Float64:
    """Where a bearing meets a line: ``c r / (n . r)``, the normal's angle given. (..., 2)."""
    return np.asarray(np.asarray(c / np.cos(bearing - angle))[..., None] * direction(bearing))


def _corner_bearing(x: Float64) -> Float64:
    """Bearing of the corner ``c1 n1 + c2 n2``, which is (c1, -c2) turned by phi."""
    return np.asarray(x[..., 0] - np.arctan2(x[..., 2], x[..., 1]))


def fuse(
    light: tuple[Float32, Float32],
    floor: Floor,
    evidence: Evidence,
    *,
    laser: LaserOnFloor | None = None,
    uncertainty: SystematicUncertainty | None = None,
) -> Fused | None:
    """Find lines and ends of one object from what laser and pictures show of it.

    Parameters
    ----------
    light : (left, right), (H, W, 3) or (H, W) float32
        Rectified pictures as light (`stereolib.rig.to_light`).
    floor : Floor
    evidence : Evidence
    laser : LaserOnFloor, optional
        Where the laser stands; without it the pair alone speaks.
    uncertainty : SystematicUncertainty, optional
        Of the pair's calibration, and of errors common to a face.

    Returns
    -------
    Fused or None
        None where neither sensor shows a straight face.

    Notes
    -----
    With x = (angle, c_right, c_left) both sensors give linear observations ``y = H x``: the fused lines are
    ``A^-1 sum H' C^-1 y`` with ``A = sum H' C^-1 H``. The corner's bearing in the picture is one more observation.
    """
    scanned = scanned_lines(evidence.footprint, laser)
    pictured = pictured_lines(evidence.faces, floor, uncertainty or SystematicUncertainty())
    if scanned is None and pictured is None:
        return None
    lines, shares, disagreement = combined(scanned, pictured)
    if disagreement and shares == "image":
        evidence = replace(evidence, footprint=None)  # it is of another moment
    low, high = (share * evidence.top_mm for share in _EDGE_HEIGHTS)

    def _edge(place: Float64, normal: Float64, prior_px: tuple[float, float], both: bool = True) -> Bearing | None:
        if not np.isfinite(high):
            return None
        upright = vertical_edge(light if both else light[:1], floor, place, (low, high), prior_px, normal)
        return None if upright is None else (upright.position, upright.std)

    f = floor.rectified.f_px
    roughly = _rough_ends(lines, evidence, laser, floor)
    left_out: dict[int, _End] = {}
    if len(lines.visible) == 2:
        matched = [_matched_px(lines.normal(k), evidence, laser, f) for k in (0, 1)]
        lines, left_out = _with_corner(lines, [end.bearing for end in roughly], matched, _edge, f)
        roughly = _rough_ends(lines, evidence, laser, floor)
    x, covariance = np.append(lines.x, [end.bearing for end in roughly]), np.pad(lines.covariance, (0, 2))
    sources = {"lines": shares}
    for side, (name, end) in enumerate(zip(("right end", "left end"), roughly, strict=True)):
        face = lines.visible[-side]
        normal, c = lines.normal(face), lines.x[1 + face]
        # A face that the right camera does not see ends there at another edge.
        both = bool(c + normal[1] * floor.rectified.baseline_mm > _GRAZING * c)
        if side in left_out:  # at the corner, not where the face that was left out ends
            end, both = left_out[side], True
        upright = _edge(_meet(end.bearing, lines.x[0] - face * np.pi / 2, c), normal, end.prior_px, both)
        x[3 + side], std = upright or (end.bearing, end.std)
        if upright and len(lines.visible) == 1 and not left_out:
            std = max(std, _overhang_rad(side, x[3 + side], evidence.faces, floor))
        covariance[3 + side, 3 + side] = std**2
        sources[name] = "image" if upright else end.source
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


def _matched_px(normal: Float64, evidence: Evidence, laser: LaserOnFloor | None, f_px: float) -> float:
    """Width over which the disparity map shows a face of this direction, px; infinite if the scan shows it, too."""
    if _scanned_alike(normal, evidence.footprint, laser):
        return np.inf
    like = [plane for plane in evidence.faces if plane.line @ normal > _ALIKE * np.linalg.norm(plane.line)]
    return f_px * max((plane.bearing[1] - plane.bearing[0] for plane in like), default=0.0)


def _scanned_alike(normal: Float64, footprint: Footprint | None, laser: LaserOnFloor | None) -> list[Any]:
    """Faces of the scan with a normal like this one on the floor."""
    if footprint is None or laser is None:
        return []
    return [face for face in footprint.faces if face.normal @ laser.R.T @ normal > _ALIKE]


def _with_corner(
    lines: FaceLines, ends: Sequence[float], matched: Sequence[float], edge: Callable[..., Bearing | None], f_px: float
) -> tuple[FaceLines, dict[int, _End]]:
    """The picture shows the corner between two faces: one more observation of the lines, or the judge over the smaller.

    A narrow face's own line may be far off. Where the corner's edge contradicts it, its line goes through that edge;
    where there is no room for it between corner and end it is left out; then the wide one ends at the corner (side ->
    where), or, where no edge shows there, somewhere on the narrow one.
    """
    (_, c1, c2), at = lines.x, float(wrap_rad(_corner_bearing(lines.x)))
    spans = f_px * np.array([at - ends[0], ends[1] - at])
    unsure = [k for k in (0, 1) if np.isfinite(matched[k])]
    shown_px = np.minimum(spans, matched)
    weak = unsure[0] if len(unsure) == 1 and shown_px.min() < _NARROW_PX else int(shown_px.argmin())
    if spans.min() < _LEAST_SPAN_PX or (weak in unsure and matched[weak] < 0.5 * min(spans[weak], _SURE_SPAN_PX)):
        return without(lines, weak), {}  # there is no room for it, or too little of it is there
    if weak in unsure and shown_px[weak] < _SURE_SPAN_PX:
        corner = _End(at, float(spans[weak]) / f_px, "image", False, (_CORNER_SEARCH_PX, 0.0))
        return without(lines, weak), {weak: corner}
    distance = float(np.hypot(c1, c2))
    g = np.array([1.0, c2 / distance**2, -c1 / distance**2])  # derivative of the corner's bearing
    variance = float(g @ lines.covariance @ g)
    prior_px = (max(f_px * np.sqrt(variance), _CORNER_SEARCH_PX), 0.0)
    upright = edge(distance * direction(at), lines.normal(1 - weak), prior_px)
    if upright is None:
        return lines, {}
    bearing, std = upright
    if (bearing - at) ** 2 < _CONTRADICTION**2 * (variance + std**2):
        gain = lines.covariance @ g / (variance + std**2)
        return FaceLines(lines.x + gain * (bearing - at), lines.covariance - np.outer(gain, g @ lines.covariance)), {}
    if spans[weak] > _NARROW_PX:
        return lines, {}
    known = [0, 2 - weak]  # the angle and the wide face's line

    def through(y: Float64) -> Float64:
        x = lines.x.copy()
        x[known] = y[:2]
        corner = _meet(y[2], x[0] - (1 - weak) * np.pi / 2, x[known[1]])
        x[1 + weak] = FaceLines(x, lines.covariance).normal(weak) @ corner
        return x

    y, C = np.append(lines.x[known], bearing), np.pad(lines.covariance[np.ix_(known, known)], (0, 1))
    C[2, 2] = std**2
    J = np.stack([(through(y + step) - through(y)) / step.sum() for step in np.diag(_STEPS[[0, 1, 3]])], axis=1)
    return FaceLines(through(y), J @ C @ J.T), {}


@dataclass(frozen=True)
class _End:
    """Where a face ends before the picture is asked: bearing and deviation, who says so, and the prior of its edge."""

    bearing: float
    std: float
    source: str
    hidden: bool
    prior_px: tuple[float, float]


def _rough_ends(lines: FaceLines, evidence: Evidence, laser: LaserOnFloor | None, floor: Floor) -> list[_End]:
    """Outer ends as scan and disparity map roughly have them: right, left."""
    rectified, ends = floor.rectified, []
    for side in (0, 1):
        normal, end = lines.normal(lines.visible[-side]), None
        for face in _scanned_alike(normal, evidence.footprint, laser):
            if laser is not None and face.ends[side] != "corner":
                x, y = laser.points_mm(face.ends_mm[side])
                distance = float(np.hypot(x, y))
                std = max(float(face.end_std_mm[side] * abs(normal @ [x, y])) / distance, _LEAST_END_MM) / distance
                # Between two beams every bearing is equally likely.
                prior_px = (_SCAN_END_PX, np.sqrt(3) * std * rectified.f_px)
                end = _End(float(np.arctan2(y, x)), std, "scan", face.ends[side] == "hidden", prior_px)
        for plane in evidence.faces if end is None else ():
            u = rectified.P1[0, 2] - rectified.f_px * plane.bearing[side]
            # Further left the right picture does not show what the left one does.
            shift = rectified.f_px * rectified.baseline_mm * float(plane.line @ [1.0, plane.bearing[side]])
            within = _BORDER_PX + side * shift < u < rectified.size[0] - _BORDER_PX
            if within and plane.line @ normal > _ALIKE * np.linalg.norm(plane.line):
                bearing = float(np.arctan(plane.bearing[side]))
                end = _End(bearing, _MAP_END_PX / rectified.f_px, "image", False, (_MAP_END_PX, 0.0))
        if end is None:  # cut by the frame, and not in the scan
            widest = max((plane.bearing[side] for plane in evidence.faces), key=abs, default=0.0)
            end = _End(float(np.arctan(widest)), _CUT_STD_RAD, "image", True, (_MAP_END_PX, 0.0))
        ends.append(end)
    return ends
