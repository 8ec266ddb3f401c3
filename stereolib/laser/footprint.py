"""Length, width and pose of an object from a scan: the rectangle whose corner two faces show.

A laser sees an outline only where its beams go. Lines are fitted to many readings and come out well; a face's end lies
somewhere between its last beam and the next, a degree on. What the scan does not show is NaN, with the reason.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from stereolib.laser._outline_fit import Lines, fit_circle, fit_corner, fit_lines
from stereolib.laser.scans import LaserScan
from stereolib.laser.segmentation import XV11_SIGMA, Segment, segments

Array = np.ndarray
_LEAST_ON_FACE = 2  # beams; from one alone nothing can be told of a face
_UNLIKE = 2.5  # residuals this many times the noise, in the root mean square, are another shape


@dataclass(frozen=True, eq=False)
class FaceLine:
    """A visible face: the stretch of the line ``normal . p = offset_mm`` between two ends.

    Attributes
    ----------
    normal : (2,) float64
        Away from the sensor.
    offset_mm, offset_std_mm, angle_std_rad : float
        The line, and how well it is known.
    ends_mm : (2, 2) float64
        Right end, left end.
    end_std_mm : (2,) float64
        Of each end along the line.
    ends : (right, left)
        ``"corner"`` (meets the other face), ``"free"`` (between two beams), ``"hidden"``.
    """

    normal: Array
    offset_mm: float
    offset_std_mm: float
    angle_std_rad: float
    ends_mm: Array
    end_std_mm: Array
    ends: tuple[str, str]

    @property
    def size_mm(self) -> float:
        """Length of the stretch; NaN if an end is hidden."""
        return float(np.linalg.norm(self.ends_mm[1] - self.ends_mm[0])) if "hidden" not in self.ends else np.nan

    @property
    def size_std_mm(self) -> float:
        """Standard deviation of `size_mm`."""
        return float(np.hypot(*self.end_std_mm)) if "hidden" not in self.ends else np.nan


@dataclass(frozen=True, eq=False)
class Footprint:
    """What the scan tells of an object's outline; what it does not tell is NaN.

    Attributes
    ----------
    shape : str
        ``"rectangle"`` (two faces seen), ``"face"`` (one), ``"circle"``, ``"irregular"``.
    length_mm, width_mm : float
        Rectangle: longer and shorter side. Face: the depth (NaN), and the width of the face. Circle: both its diameter.
    yaw_rad : float
        Direction of the length, -pi/2 to pi/2.
    centre_mm : (2,) float64
        Centre of the outline; of a face, its middle.
    length_std_mm, width_std_mm, yaw_std_rad : float
    centre_std_mm : (2,) float64
        Along x and y.
    corner_mm : (2,) float64
        The corner between the two visible faces, NaN if there is none.
    faces : tuple of FaceLine
        From right to left.
    misfit : float
        Root mean square residual in standard deviations; about 1 where the shape is right.
    reason : str
        Why something is NaN, or the shape irregular; else empty.
    segment : Segment
    fit : Lines or None
        The lines of a rectangle or face as they were fitted.
    """

    shape: str
    length_mm: float
    width_mm: float
    yaw_rad: float
    centre_mm: Array
    length_std_mm: float
    width_std_mm: float
    yaw_std_rad: float
    centre_std_mm: Array
    corner_mm: Array
    faces: tuple[FaceLine, ...]
    misfit: float
    reason: str
    segment: Segment
    fit: Lines | None = None

    @property
    def sides_mm(self) -> tuple[float, float]:
        """Length and width."""
        return self.length_mm, self.width_mm

    @property
    def outline_mm(self) -> Array:
        """Corners of the rectangle, counter-clockwise, (4, 2) mm; NaN if a side is unknown."""
        along = np.array([np.cos(self.yaw_rad), np.sin(self.yaw_rad)]) * self.length_mm / 2
        across = np.array([-np.sin(self.yaw_rad), np.cos(self.yaw_rad)]) * self.width_mm / 2
        return self.centre_mm + np.array([a * along + b * across for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])


def footprints(
    scan: LaserScan, *, sigma: Callable[[Array], Array] = XV11_SIGMA, bias_mm: float = 1.0, **how: object
) -> list[Footprint]:
    """Footprints of all objects of a scan, nearest first.

    Parameters
    ----------
    scan, sigma
        See `segments`, which also takes what else is given.
    bias_mm : float
        See `fit_footprint`.

    Raises
    ------
    ValueError
        If there is no object; the text says what there is instead.
    """
    parts = segments(scan, sigma=sigma, **how)  # type: ignore[arg-type]
    objects = [part for part in parts if part.kind == "object"]
    if not objects:
        counted = ", ".join(f"{sum(p.kind == k for p in parts)} {k}" for k in ("wall", "small"))
        raise ValueError(
            f"the scan shows no object within its range (segments: {counted}). Put it nearer, on the height of the "
            f"laser's plane, away from walls, or allow fewer beams (least_beams)"
        )
    return [fit_footprint(part, bias_mm=bias_mm) for part in sorted(objects, key=lambda part: part.distance_mm)]


def fit_footprint(segment: Segment, *, bias_mm: float = 1.0) -> Footprint:
    """Outline of one object: rectangle, single face, circle or none of these.

    Parameters
    ----------
    segment : Segment
    bias_mm : float
        Standard deviation of the error that all readings on one face share (the laser's bias changes with brightness
        and angle; no averaging removes it).

    Notes
    -----
    Residuals are taken along the beams, ``(n . p - c) / (n . beam) / sigma``. The corner's two lines share one angle:
    for every split of the readings the angle is the smallest eigenvector of ``S1 + J' S2 J`` (S: scatter of either
    part, J: a quarter turn), then refined by Gauss-Newton. Line, corner and circle compete by chi square plus
    ``parameters ln N``; none of them fits where the residuals exceed the noise 2.5 times.
    """
    p, sigma = segment.points_mm, segment.sigma_mm
    n = len(p)
    if n < 3:
        return _irregular(segment, np.nan, f"{n} beams do not tell a shape")
    line, corner = fit_lines(p, sigma, n), fit_corner(p, sigma)
    # A shallow bend is what the bias makes of a flat face.
    flat = np.sqrt(line.chi2 / max(n - 2, 1)) < 1.6
    circle = (np.zeros(3), np.inf, np.eye(3)) if flat else fit_circle(p, sigma)
    chi2 = {"face": line.chi2, "rectangle": corner.chi2 if corner else np.inf, "circle": circle[1]}
    scores = {name: chi2[name] + k * np.log(n) for name, k in (("face", 2), ("rectangle", 4), ("circle", 3))}
    shape = min(scores, key=scores.__getitem__)
    misfit = {name: float(np.sqrt(value / max(n - 3, 1))) for name, value in chi2.items()}
    if misfit[shape] > _UNLIKE:
        kinds = "neither straight, nor a right-angled corner, nor round"
        return _irregular(segment, misfit[shape], f"{kinds}: the best of them misses by {misfit[shape]:.1f} deviations")
    if shape == "circle" or (shape == "rectangle" and abs(scores["circle"] - scores["rectangle"]) < 4):
        if abs(scores["circle"] - scores.get("rectangle", np.inf)) < 4:
            return _irregular(segment, misfit[shape], f"{n} beams do not tell a corner from a round outline")
        return _circle(segment, circle[0], circle[2], misfit["circle"], bias_mm)
    found = corner if shape == "rectangle" and corner is not None else line
    return _rectangle(segment, found, misfit[shape], bias_mm)


def _face(segment: Segment, fit: Lines, face: int, corner: Array | None, scale: float, bias_mm: float) -> FaceLine:
    """One line with its ends; `face` 0 is the right one."""
    normal, offset = fit.normal(face), float(fit.parameters[1 + face])
    if offset < 0:
        normal, offset = -normal, -offset
    along = np.array([-normal[1], normal[0]])  # to the left, seen from the sensor
    middle = offset * normal
    members = segment.points_mm[: fit.split] if face == 0 else segment.points_mm[fit.split :]
    facing = float(np.mean(members @ normal / np.linalg.norm(members, axis=1)))
    offset_std = float(np.hypot(scale * np.sqrt(fit.covariance[1 + face, 1 + face]), bias_mm * facing))
    ends, deviations, kinds = [], [], []
    for side in (0, 1):
        if corner is not None and side != face:
            other = 1 - face
            seen = segment.points_mm[: fit.split] if other == 0 else segment.points_mm[fit.split :]
            tilt = float(np.mean(np.abs(seen @ along) / np.linalg.norm(seen, axis=1)))
            ends.append(float(corner @ along))
            deviations.append(float(np.hypot(scale * np.sqrt(fit.covariance[1 + other, 1 + other]), bias_mm * tilt)))
            kinds.append("corner")
            continue
        angles = _end_between(segment, side, normal, offset, facing)
        beams = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        met = offset * (beams @ along) / np.maximum(beams @ normal, 0.02)
        slant = abs(met.mean()) / max(offset, 1.0)
        ends.append(float(met.mean()))
        deviations.append(float(np.hypot(np.ptp(met) / np.sqrt(12), offset_std * slant)))
        kinds.append("hidden" if segment.hidden[side] else "free")
    length = max(abs(ends[1] - ends[0]), 1.0)
    angle_std = float(np.hypot(scale * np.sqrt(fit.covariance[0, 0]), 0.3 * bias_mm / length))
    points = middle + np.array(ends)[:, None] * along
    return FaceLine(normal, offset, offset_std, angle_std, points, np.array(deviations), (kinds[0], kinds[1]))


def _end_between(segment: Segment, side: int, normal: Array, offset: float, facing: float) -> Array:
    """Angles between which a line ends: it goes on through readings beyond a jump that still lie on it. (2,) rad."""
    own, other = segment.gaps_rad[side] if side else segment.gaps_rad[side][::-1]
    beyond = segment.beyond_mm[side]
    angles = np.arctan2(beyond[:, 1], beyond[:, 0])
    angles = own + np.mod(angles - own + np.pi, 2 * np.pi) - np.pi
    reach = 4.0 * np.hypot(float(segment.sigma_mm.max()), 1.0) * max(facing, 0.5)
    for k in range(len(beyond) - 1):
        if abs(beyond[k] @ normal - offset) > reach:
            break
        own, other = float(angles[k]), float(angles[k + 1])
    return np.array([own, other])


def _rectangle(segment: Segment, fit: Lines, misfit: float, bias_mm: float) -> Footprint:
    scale, nothing = max(misfit, 1.0), np.full(2, np.nan)
    if len(fit.parameters) == 2:
        why = "only one face is seen, its depth is hidden: turn the object or move the laser to see a corner"
        return _single(segment, _face(segment, fit, 0, None, scale, bias_mm), fit, misfit, why)
    corner = fit.parameters[1] * fit.normal(0) + fit.parameters[2] * fit.normal(1)
    faces = tuple(_face(segment, fit, k, corner, scale, bias_mm) for k in (0, 1))
    if min(fit.split, len(segment.beams) - fit.split) < _LEAST_ON_FACE:
        best = int(fit.split < len(segment.beams) - fit.split)
        kept = np.array([0, 1 + best])
        line = Lines(
            fit.parameters[kept] + [best * np.pi / 2, 0],
            fit.covariance[np.ix_(kept, kept)],
            fit.chi2,
            len(segment.beams),
        )
        right, left = ("free" if kind == "corner" else kind for kind in faces[best].ends)
        face = replace(faces[best], ends=(right, left))
        return _single(
            segment, face, line, misfit, "a single beam meets its other face, whose depth is hidden: turn the object"
        )
    long, short = sorted(faces, key=lambda face: -np.nan_to_num(face.size_mm, nan=np.inf))
    direction = np.array([-long.normal[1], long.normal[0]])
    yaw = (np.arctan2(direction[1], direction[0]) + np.pi / 2) % np.pi - np.pi / 2
    centre = faces[0].ends_mm[0] / 2 + faces[1].ends_mm[1] / 2
    variance = np.zeros(2)
    for face in faces:
        tangent = np.array([-face.normal[1], face.normal[0]])
        variance += (0.5 * np.hypot(*face.end_std_mm) * tangent) ** 2
    centre_std = np.sqrt(variance)
    reason = _hidden(segment)
    if reason:
        centre, centre_std = nothing, nothing
    return Footprint(
        "rectangle", long.size_mm, short.size_mm, float(yaw), centre, long.size_std_mm, short.size_std_mm,
        long.angle_std_rad, centre_std, corner, faces, misfit, reason, segment, fit,
    )  # fmt: skip


def _single(segment: Segment, face: FaceLine, fit: Lines, misfit: float, reason: str) -> Footprint:
    """One face alone."""
    if "hidden" in face.ends:
        reason += f"; {_hidden(segment)}"
    yaw = (np.arctan2(face.normal[1], face.normal[0]) + np.pi / 2) % np.pi - np.pi / 2
    along = np.abs([-face.normal[1], face.normal[0]])
    spread = np.hypot(0.5 * np.hypot(*face.end_std_mm) * along, face.offset_std_mm * np.abs(face.normal))
    return Footprint(
        "face", np.nan, face.size_mm, float(yaw), face.ends_mm.mean(axis=0), np.nan, face.size_std_mm,
        face.angle_std_rad, spread, np.full(2, np.nan), (face,), misfit, reason, segment, fit,
    )  # fmt: skip


def _hidden(segment: Segment) -> str:
    sides = [name for name, is_hidden in zip(("right", "left"), segment.hidden, strict=True) if is_hidden]
    return f"its {' and '.join(sides)} end is hidden by something nearer" if sides else ""


def _circle(segment: Segment, q: Array, covariance: Array, misfit: float, bias_mm: float) -> Footprint:
    std = max(misfit, 1.0) * np.sqrt(np.diag(covariance))
    diameter, diameter_std = 2 * float(q[2]), 2 * float(np.hypot(std[2], bias_mm))
    centre_std = np.hypot(std[:2], bias_mm)
    return Footprint(
        "circle", diameter, diameter, np.nan, q[:2], diameter_std, diameter_std, np.nan, centre_std,
        np.full(2, np.nan), (), misfit, "", segment,
    )  # fmt: skip


def _irregular(segment: Segment, misfit: float, reason: str) -> Footprint:
    nothing = np.full(2, np.nan)
    return Footprint(
        "irregular", np.nan, np.nan, np.nan, segment.points_mm.mean(axis=0), np.nan, np.nan, np.nan, nothing,
        nothing, (), misfit, f"the outline is irregular, {reason}" if "beams" not in reason else reason, segment,
    )  # fmt: skip
