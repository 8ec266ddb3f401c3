"""One measured object: its sizes with their covariance, and why a size is unknown.

Everything stands in the floor's frame: origin on the floor below the left camera, x forward along the optical axis
laid flat, y left, z up, mm.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from stereolib.base import Float64, direction, wrap_rad
from stereolib.laser import Footprint
from stereolib.measurement.face_lines import LaserOnFloor
from stereolib.measurement.fusion import Fused, corners_mm
from stereolib.measurement.regions import ObjectRegion

Height = tuple[float, float]  # and its standard deviation, mm
#: What `MeasuredObject.size_mm` holds, in its order.
SIZE_NAMES = ("length", "width", "height")
_WORST_STD = 0.05  # share of a side: one whose standard deviation is larger is not reported
_TOO_FLAT = np.radians(8)  # a side that is seen under a flatter angle is not reported
_CIRCLE_CORNERS = 24
_ONE_FACE = "only one face is seen, its depth is hidden: turn the object or move the rig to see a corner"
_HIDDEN = "an end is hidden by something nearer or lies outside the picture"


@dataclass(frozen=True, eq=False)
class MeasuredObject:
    """An object on the floor, with standard deviations; what is not known is NaN, with a reason.

    Attributes
    ----------
    shape : str
        ``"box"`` (two faces seen), ``"face"`` (one; the depth is unknown), ``"circle"`` (a cylinder), ``"irregular"``.
    size_mm : (3,) float64
        Length (the longer side), width, height. Of a face the width is that of the face; a circle's length and width
        are its diameter.
    covariance : (3, 3) float64
        Of `size_mm`, mm^2; NaN where a size is unknown.
    position_mm : (2,) float64
        Centre of the outline on the floor; of a face, its middle.
    position_covariance : (2, 2) float64
    yaw_rad, yaw_std_rad : float
        Direction of the length (of a face: of the face), -pi/2 to pi/2; NaN for a circle.
    outline_mm : (N, 2) float64
        Corners on the floor, counter-clockwise: 4 of a box, the 2 ends of a face, 24 of a circle, the readings of an
        irregular outline.
    sources : dict
        What gave what: ``"lines"`` (shares of what is known of the faces' lines: "scan 24 %, image 76 %"),
        ``"right end"``, ``"left end"`` and ``"height"`` ("image" or "scan").
    reasons : dict
        Why ``"length"``, ``"width"`` or ``"height"`` is unknown, or the whole ``"object"`` not measured.
    """

    shape: str
    size_mm: Float64
    covariance: Float64
    position_mm: Float64
    position_covariance: Float64
    yaw_rad: float
    yaw_std_rad: float
    outline_mm: Float64
    sources: dict[str, str] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)

    @property
    def std_mm(self) -> Float64:
        """Standard deviations of `size_mm`, (3,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def volume_l(self) -> tuple[float, float]:
        """Volume and its standard deviation, litres; NaN if a size is unknown."""
        length, width, height = self.size_mm
        base = np.pi / 4 if self.shape == "circle" else 1.0
        gradient = base * np.array([width * height, length * height, length * width])
        return base * float(length * width * height) / 1e6, self._std(gradient) / 1e6

    @property
    def surface_m2(self) -> tuple[float, float]:
        """Area of the sides and the top, and its standard deviation, m^2; NaN if a size is unknown."""
        length, width, height = self.size_mm
        if self.shape == "circle":
            area = np.pi * (length * height + length * width / 4)
            gradient = np.pi * np.array([height + width / 4, length / 4, length])
        else:
            area = 2 * (length + width) * height + length * width
            gradient = np.array([2 * height + width, 2 * height + length, 2 * (length + width)])
        return float(area) / 1e6, self._std(gradient) / 1e6

    def _std(self, gradient: Float64) -> float:
        return float(np.sqrt(gradient @ self.covariance @ gradient))


def from_faces(
    fused: Fused, height: Height, reasons: dict[str, str], scale_std: float, *, worst_std: float = _WORST_STD
) -> MeasuredObject:
    """Make a box or a face of its lines and ends, through their covariance.

    Parameters
    ----------
    fused : Fused
    height : (mm, standard deviation)
        NaN if unknown.
    reasons : dict
        Why something is unknown, so far.
    scale_std : float
        Relative standard deviation that all lengths of the calibration share.
    worst_std : float
        A side whose standard deviation is a larger share of it is not reported.

    Returns
    -------
    MeasuredObject
    """
    n = 2 if fused.two else 1
    at, C = fused.propagate(_sides_and_places)
    C[:n, :n] += scale_std**2 * np.outer(at[:n], at[:n])
    std, flat = np.sqrt(np.diag(C)), np.arcsin(np.cos(fused.x[3 : 3 + n] - fused.x[0] + np.arange(n) * np.pi / 2))
    refused = {}
    for k in range(n):
        if any(fused.hidden if n == 1 else fused.hidden[k : k + 1]):
            refused[k] = _HIDDEN
        elif flat[k] < _TOO_FLAT or std[k] > worst_std * at[k]:
            is_flat = flat[k] < 2 * _TOO_FLAT
            why = f"seen too flat, at {np.degrees(flat[k]):.0f} degrees" if is_flat else "too uncertain"
            refused[k] = f"{why}: {at[k]:.0f} ± {std[k]:.0f} mm; turn the object or move the rig"
    kept = sorted((k for k in range(n) if k not in refused), key=lambda k: -at[k])
    p, whole = corners_mm(fused.x), n == 2 and len(kept) == 2
    reasons = {**reasons, "length": _ONE_FACE} if n == 1 else dict(reasons)
    for k, why in refused.items():
        reasons["length" if n == 2 and len(refused) < 2 else ("width", "length")[k]] = why
    size, covariance = _with_height(height)
    known = [0, 1] if whole else [1][: len(kept)]
    size[known] = at[kept]
    covariance[np.ix_(known, known)] = C[np.ix_(kept, kept)]
    covariance[2, known] = covariance[known, 2] = 0.0 * height[1]
    side = kept[0] if kept else 0
    place = slice(n, n + 2) if whole else slice(n + 2 + 2 * side, n + 4 + 2 * side)
    yaw_rad = float(wrap_rad(fused.x[0] + (1 - side) * np.pi / 2, np.pi))
    outline = np.array([p[1], p[0], p[0] + p[2] - p[1], p[2]]) if whole else p[side : side + 2]
    where, turned = (at[place], C[place, place]), (yaw_rad, float(std[-1]))
    sources = {**fused.sources, **_height_source(height)}
    return MeasuredObject("box" if whole else "face", size, covariance, *where, *turned, outline, sources, reasons)


def _sides_and_places(x: Float64) -> Float64:
    """Of `Fused.x` (K, 5): lengths of n sides, the outline's middle, each side's middle, the angle. (K, 3 + 3 n)."""
    p = corners_mm(x)
    sides = np.hypot(*(p[:, 1:] - p[:, :-1]).T).T
    middles = (p[:, 1:] + p[:, :-1]) / 2
    return np.hstack([sides, (p[:, 0] + p[:, -1]) / 2, middles.reshape(len(x), -1), x[:, :1]])


def from_scan(footprint: Footprint, laser: LaserOnFloor, height: Height, reasons: dict[str, str]) -> MeasuredObject:
    """Make an object of what has no straight face in the scan: a circle where it is one, else an irregular outline.

    Parameters
    ----------
    footprint : Footprint
    laser : LaserOnFloor
    height : (mm, standard deviation)
        NaN if unknown.
    reasons : dict
        Why something is unknown, so far.

    Returns
    -------
    MeasuredObject
    """
    size, covariance = _with_height(height)
    centre, spread = laser.points_mm(footprint.centre_mm), np.full((2, 2), np.nan)
    outline = laser.points_mm(footprint.segment.points_mm)
    round_std = footprint.length_std_mm if footprint.shape == "circle" else np.nan
    is_circle = bool(round_std < _WORST_STD * footprint.length_mm)
    if is_circle:
        size[:2] = footprint.length_mm
        covariance[:2, :2] = footprint.length_std_mm**2
        covariance[2, :2] = covariance[:2, 2] = 0.0 if np.isfinite(height[0]) else np.nan
        spread = laser.R @ np.diag(footprint.centre_std_mm**2) @ laser.R.T + laser.covariance[:2, :2]
        angles = np.linspace(0, 2 * np.pi, _CIRCLE_CORNERS, endpoint=False)
        outline = centre + footprint.length_mm / 2 * direction(angles)
    else:
        why = footprint.reason or f"too uncertain: round, {footprint.length_mm:.0f} ± {round_std:.0f} mm"
        reasons = {**reasons, "length": why, "width": why}
    shape, sources = "circle" if is_circle else "irregular", {"lines": "scan", **_height_source(height)}
    return MeasuredObject(shape, size, covariance, centre, spread, np.nan, np.nan, outline, sources, reasons)


def from_region(region: ObjectRegion, height: Height, reasons: dict[str, str]) -> MeasuredObject:
    """Make an object of what the picture shows without a straight face: its place, and a height where there is one.

    Parameters
    ----------
    region : ObjectRegion
    height : (mm, standard deviation)
        NaN if unknown.
    reasons : dict
        Why something is unknown, so far.

    Returns
    -------
    MeasuredObject
    """
    size, covariance = _with_height(height)
    place, why = np.array(region.position_mm), "no straight face was found"
    reasons, spread = {**reasons, "length": why, "width": why}, np.full((2, 2), np.nan)
    return MeasuredObject(
        "irregular", size, covariance, place, spread, np.nan, np.nan, outline_mm=place[None], reasons=reasons
    )


def _with_height(height: Height) -> tuple[Float64, Float64]:
    """Sizes (3,) and their covariance (3, 3) with the height alone known."""
    covariance = np.full((3, 3), np.nan)
    covariance[2, 2] = height[1] ** 2
    return np.array([np.nan, np.nan, height[0]]), covariance


def _height_source(height: Height) -> dict[str, str]:
    return {"height": "image"} if np.isfinite(height[0]) else {}
