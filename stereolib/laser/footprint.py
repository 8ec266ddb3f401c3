"""Length, width and pose of an object from a scan: the rectangle whose corner two faces show.

A laser sees an outline only where its beams go. Lines are fitted to many readings and come out well; a face's end lies
somewhere between its last beam and the next, a degree on. What the scan does not show is NaN, with the reason.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from stereolib.base import Float64, direction, wrap_rad
from stereolib.laser._outline_fit import NO_CIRCLE, Circle, Lines, fit_circle, fit_corner, fit_lines
from stereolib.laser.points import Rays
from stereolib.laser.segmentation import Segment

_LEAST_ON_FACE = 2  # beams; from one alone nothing can be told of a face
_UNLIKE = 2.5  # residuals this many times the noise, in the root mean square, are another shape
_FLAT = 1.6  # a shallow bend up to so many times the noise is what the bias makes of a flat face
_UNDECIDED = 4.0  # scores nearer to each other than this do not tell a corner from a round outline
_BIAS_TILT = 0.3  # share of the bias by which a face's two ends differ
_BIAS_BY_DECADE = 2.5  # by so many times the bias readings differ whose light comes back ten times weaker
_LEAST_COSINE = 0.05  # of a beam that grazes a round outline
_REACH = 4.0  # standard deviations within which a reading still lies on a line


def _unknown() -> Float64:
    return np.full(2, np.nan)


@dataclass(frozen=True, eq=False)
class FaceLine:
    """A visible face: the stretch of the line ``normal @ p = offset_mm`` between two ends.

    Attributes
    ----------
    normal : (2,) float64
        Away from the sensor.
    offset_mm, offset_std_mm, angle_std_rad : float
        The line, and how well it is known.
    ends_mm : (2, 2) float64
        Right end, left end, mm.
    end_std_mm : (2,) float64
        Standard deviation of each end along the line, mm.
    ends : (right, left)
        ``"corner"`` (meets the other face), ``"free"`` (between two beams), ``"hidden"``.
    """

    normal: Float64
    offset_mm: float
    offset_std_mm: float
    angle_std_rad: float
    ends_mm: Float64
    end_std_mm: Float64
    ends: tuple[str, str]

    @property
    def along(self) -> Float64:
        """Unit vector along the face, to the left as the sensor sees it, (2,)."""
        return np.array([-self.normal[1], self.normal[0]])

    @property
    def size_mm(self) -> float:
        """Length of the stretch, mm; NaN if an end is hidden."""
        return float(np.linalg.norm(self.ends_mm[1] - self.ends_mm[0])) if "hidden" not in self.ends else np.nan

    @property
    def size_std_mm(self) -> float:
        """Standard deviation of `size_mm`, mm."""
        return float(np.hypot(*self.end_std_mm)) if "hidden" not in self.ends else np.nan


@dataclass(frozen=True, eq=False)
class Footprint:
    """What the scan tells of an object's outline; what it does not tell is NaN.

    Attributes
    ----------
    shape : str
        ``"rectangle"`` (two faces seen), ``"face"`` (one), ``"circle"``, ``"irregular"``.
    segment : Segment
        The readings.
    reason : str
        Why something is NaN, or the shape irregular; else empty.
    length_mm, width_mm : float
        Rectangle: longer and shorter side. Face: the depth (NaN), and the width of the face. Circle: both its diameter.
    yaw_rad : float
        Direction of the length, -pi/2 to pi/2.
    centre_mm : (2,) float64
        Centre of the outline; of a face, its middle.
    length_std_mm, width_std_mm, yaw_std_rad : float
        Standard deviations.
    centre_std_mm : (2,) float64
        Along x and y.
    faces : tuple of FaceLine
        From right to left.
    fit : Lines or None
        The lines of a rectangle or face as they were fitted.
    """

    shape: str
    segment: Segment
    reason: str = ""
    length_mm: float = np.nan
    width_mm: float = np.nan
    yaw_rad: float = np.nan
    centre_mm: Float64 = field(default_factory=_unknown)
    length_std_mm: float = np.nan
    width_std_mm: float = np.nan
    yaw_std_rad: float = np.nan
    centre_std_mm: Float64 = field(default_factory=_unknown)
    faces: tuple[FaceLine, ...] = ()
    fit: Lines | None = None

    @property
    def outline_mm(self) -> Float64:
        """Corners of the rectangle, counter-clockwise, (4, 2) mm; NaN if a side is unknown."""
        along = direction(self.yaw_rad) * self.length_mm / 2
        across = np.array([-np.sin(self.yaw_rad), np.cos(self.yaw_rad)]) * self.width_mm / 2
        corners: Float64 = np.array([a * along + b * across for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
        return self.centre_mm + corners


def fit_footprint(segment: Segment, *, bias_mm: float = 1.0) -> Footprint:
    """Fit the outline of one object: rectangle, single face, circle or none of these.

    Parameters
    ----------
    segment : Segment
    bias_mm : float
        Standard deviation of the error that all readings on one face share (the laser's bias changes with brightness
        and angle; no averaging removes it).

    Returns
    -------
    Footprint

    Notes
    -----
    Residuals are taken along the beams, ``(n . p - c) / (n . beam) / sigma``. The corner's two lines share one angle:
    for every split of the readings the angle is the smallest eigenvector of ``S1 + J' S2 J`` (S: scatter of either
    part, J: a quarter turn), then refined by Gauss-Newton. Line, corner and circle compete by chi square plus
    ``parameters ln N``; none of them fits where the residuals exceed the noise 2.5 times.
    """
    seen = segment.points_mm, segment.rays, segment.sigma_mm
    n = len(segment.beams)
    if n < 3:
        return _irregular(segment, f"{n} beams do not tell a shape")
    line, corner = fit_lines(*seen, n), fit_corner(*seen)
    flat = np.sqrt(line.chi2 / max(n - 2, 1)) < _FLAT
    circle = NO_CIRCLE if flat else fit_circle(*seen)
    chi2 = {"face": line.chi2, "rectangle": corner.chi2 if corner else np.inf, "circle": circle.chi2}
    scores = {name: chi2[name] + k * np.log(n) for name, k in (("face", 2), ("rectangle", 4), ("circle", 3))}
    shape = min(scores, key=scores.__getitem__)
    misfit = float(np.sqrt(chi2[shape] / max(n - 3, 1)))
    if misfit > _UNLIKE:
        kinds = "neither straight, nor a right-angled corner, nor round: the best of them misses by"
        return _irregular(segment, f"the outline is irregular, {kinds} {misfit:.1f} deviations")
    if shape != "face" and abs(scores["circle"] - scores["rectangle"]) < _UNDECIDED:
        return _irregular(segment, f"{n} beams do not tell a corner from a round outline")
    scale = max(misfit, 1.0)
    if shape == "circle":
        return _circle(segment, circle, scale, bias_mm)
    if shape == "rectangle" and corner is not None:
        tip = corner.parameters[1] * corner.normal(0) + corner.parameters[2] * corner.normal(1)
        faces = [_face(segment, corner, k, tip, scale, bias_mm) for k in (0, 1)]
        if min(corner.split, n - corner.split) < _LEAST_ON_FACE:
            return _larger_face(segment, corner, faces)
        return _rectangle(segment, corner, (faces[0], faces[1]))
    why = "only one face is seen, its depth is hidden: turn the object or move the laser to see a corner"
    return _single(segment, _face(segment, line, 0, None, scale, bias_mm), line, why)


def _face(segment: Segment, fit: Lines, face: int, corner: Float64 | None, scale: float, bias_mm: float) -> FaceLine:
    """One line with its ends; `face` 0 is the right one."""
    normal, offset = fit.normal(face), float(fit.parameters[1 + face])
    beams = segment.rays.directions[: fit.split], segment.rays.directions[fit.split :]
    facing = float(np.mean(beams[face] @ normal))
    if facing < 0:
        normal, offset, facing = -normal, -offset, -facing
    along = np.array([-normal[1], normal[0]])  # to the left, seen from the sensor

    def offset_std(k: int, cosine: float) -> float:
        return float(np.hypot(scale * np.sqrt(fit.covariance[1 + k, 1 + k]), bias_mm * cosine))

    std = offset_std(face, facing)
    ends = []
    for side in (0, 1):
        if corner is not None and side != face:
            other = float(np.mean(np.abs(beams[1 - face] @ along)))
            ends.append((float(corner @ along), offset_std(1 - face, other), "corner"))
            continue
        between = _end_between(segment, side, normal, offset, facing)
        met = between.meet(normal, offset) @ along
        aside, ahead = (met - between.origins_mm @ along).mean(), (offset - between.origins_mm @ normal).mean()
        slant = abs(aside) / max(ahead, 1.0)
        kind = "hidden" if segment.hidden[side] else "free"
        ends.append((float(met.mean()), float(np.hypot(np.ptp(met) / np.sqrt(12), std * slant)), kind))
    at, deviations, kinds = zip(*ends, strict=True)
    tilt = _BIAS_TILT * bias_mm / max(abs(at[1] - at[0]), 1.0)
    angle_std_rad = float(np.hypot(scale * np.sqrt(fit.covariance[0, 0]), tilt))
    ends_mm = offset * normal + np.array(at)[:, None] * along
    return FaceLine(normal, offset, std, angle_std_rad, ends_mm, np.array(deviations), (kinds[0], kinds[1]))


def _end_between(segment: Segment, side: int, normal: Float64, offset: float, facing: float) -> Rays:
    """The two beams between which a line ends: it goes on through readings beyond a jump that still lie on it."""
    beyond, outwards = segment.beyond_mm[side], segment.outwards[side]
    reach = _REACH * np.hypot(float(segment.sigma_mm.max()), 1.0) * max(facing, 0.5)
    off = np.append(np.abs(beyond @ normal - offset) > reach, True)
    last = min(int(off.argmax()), len(outwards) - 2)
    return outwards[last : last + 2]


def _rectangle(segment: Segment, fit: Lines, faces: tuple[FaceLine, FaceLine]) -> Footprint:
    long, short = sorted(faces, key=lambda face: -np.nan_to_num(face.size_mm, nan=np.inf))
    reason = _hidden(segment)
    variance = sum((0.5 * np.hypot(*face.end_std_mm) * face.along) ** 2 for face in faces)
    return Footprint(
        shape="rectangle",
        segment=segment,
        reason=reason,
        length_mm=long.size_mm,
        width_mm=short.size_mm,
        yaw_rad=_yaw_rad(long.along),
        centre_mm=_unknown() if reason else faces[0].ends_mm[0] / 2 + faces[1].ends_mm[1] / 2,
        length_std_mm=long.size_std_mm,
        width_std_mm=short.size_std_mm,
        yaw_std_rad=long.angle_std_rad,
        centre_std_mm=_unknown() if reason else np.sqrt(variance),
        faces=faces,
        fit=fit,
    )


def _larger_face(segment: Segment, fit: Lines, faces: list[FaceLine]) -> Footprint:
    """A corner of which one face has a single beam: the other face alone, which ends before that beam."""
    n = len(segment.beams)
    best = int(fit.split < n - fit.split)
    kept = [0, 1 + best]
    line = Lines(fit.parameters[kept] + [best * np.pi / 2, 0], fit.covariance[np.ix_(kept, kept)], fit.chi2, n - 1)
    right, left = ("free" if kind == "corner" else kind for kind in faces[best].ends)
    why = "a single beam meets its other face, whose depth is hidden: turn the object"
    shorter = segment.without_last(0 if best else 1)
    return _single(shorter, replace(faces[best], ends=(right, left)), line, why)


def _single(segment: Segment, face: FaceLine, fit: Lines, reason: str) -> Footprint:
    """One face alone."""
    spread = 0.5 * np.hypot(*face.end_std_mm) * np.abs(face.along)
    return Footprint(
        shape="face",
        segment=segment,
        reason=reason + (f"; {_hidden(segment)}" if "hidden" in face.ends else ""),
        width_mm=face.size_mm,
        yaw_rad=_yaw_rad(face.normal),
        centre_mm=face.ends_mm.mean(axis=0),
        width_std_mm=face.size_std_mm,
        yaw_std_rad=face.angle_std_rad,
        centre_std_mm=np.hypot(spread, face.offset_std_mm * np.abs(face.normal)),
        faces=(face,),
        fit=fit,
    )


def _yaw_rad(along: Float64) -> float:
    """Direction of a line, -pi/2 to pi/2."""
    return float(wrap_rad(float(np.arctan2(along[1], along[0])), np.pi))


def _hidden(segment: Segment) -> str:
    sides = [name for name, is_hidden in zip(("right", "left"), segment.hidden, strict=True) if is_hidden]
    return f"its {' and '.join(sides)} end is hidden by something nearer" if sides else ""


def _circle(segment: Segment, circle: Circle, scale: float, bias_mm: float) -> Footprint:
    """A round outline: a bias that all beams share moves it, one that grows towards its edges makes it look smaller."""
    grazing = -np.log10(np.maximum(circle.cosines, _LEAST_COSINE))
    shifts = bias_mm * circle.by_range @ np.column_stack([np.ones(len(grazing)), _BIAS_BY_DECADE * grazing])
    std = np.sqrt(scale**2 * np.diag(circle.covariance) + (shifts**2).sum(axis=1))
    (*centre, radius), (*centre_std, radius_std) = circle.parameters, std
    sizes: dict[str, Any] = dict.fromkeys(("length_mm", "width_mm"), 2 * float(radius))
    sizes |= dict.fromkeys(("length_std_mm", "width_std_mm"), 2 * float(radius_std))
    return Footprint("circle", segment, centre_mm=np.array(centre), centre_std_mm=np.array(centre_std), **sizes)


def _irregular(segment: Segment, reason: str) -> Footprint:
    return Footprint("irregular", segment, reason, centre_mm=segment.points_mm.mean(axis=0))
