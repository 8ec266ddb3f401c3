"""One measured object: its sizes with their covariance, and why a size is unknown.

Everything stands in the floor's frame: origin on the floor below the left camera, x forward along the optical axis
laid flat, y left, z up, mm.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from stereolib.laser import Footprint
from stereolib.measurement.face_lines import LaserOnFloor
from stereolib.measurement.fusion import Fused, corners_mm
from stereolib.measurement.regions import Region

Array = np.ndarray
SIZES = ("length", "width", "height")
_TOO_FLAT = np.radians(8)  # a side that is seen under a flatter angle is not reported
_ONE_FACE = "only one face is seen, its depth is hidden: turn the object or move the rig to see a corner"


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
    size_mm: Array
    covariance: Array
    position_mm: Array
    position_covariance: Array
    yaw_rad: float
    yaw_std_rad: float
    outline_mm: Array
    sources: dict[str, str] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)

    @property
    def std_mm(self) -> Array:
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

    def _std(self, gradient: Array) -> float:
        return float(np.sqrt(gradient @ self.covariance @ gradient))


def from_faces(
    fused: Fused, height: tuple[float, float], reasons: dict[str, str], scale_std: float, *, worst_std: float = 0.05
) -> MeasuredObject:
    """A box or a face from its lines and ends, through their covariance.

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
    """
    n = 2 if fused.two else 1

    def values(x: Array) -> Array:
        p = corners_mm(x)
        sides = np.hypot(*(p[:, 1:] - p[:, :-1]).T).T
        middles = (p[:, 1:] + p[:, :-1]) / 2
        return np.hstack([sides, (p[:, 0] + p[:, -1]) / 2, middles.reshape(len(x), -1), x[:, :1]])

    at, C = fused.propagate(values)
    C[:n, :n] += scale_std**2 * np.outer(at[:n], at[:n])
    std, flat = np.sqrt(np.diag(C)), np.arcsin(np.cos(fused.x[3 : 3 + n] - fused.x[0] + np.arange(n) * np.pi / 2))
    refused = {}
    for k in range(n):
        if any(fused.hidden if n == 1 else fused.hidden[k : k + 1]):
            refused[k] = "an end is hidden by something nearer or lies outside the picture"
        elif flat[k] < _TOO_FLAT or std[k] > worst_std * at[k]:
            seen = (
                f"seen too flat, at {np.degrees(flat[k]):.0f} degrees" if flat[k] < 2 * _TOO_FLAT else "too uncertain"
            )
            refused[k] = f"{seen}: {at[k]:.0f} ± {std[k]:.0f} mm; turn the object or move the rig"
    kept = [k for k in range(n) if k not in refused]
    kept.sort(key=lambda k: -at[k])
    p, whole = corners_mm(fused.x), n == 2 and len(kept) == 2
    if n == 1:
        reasons = {**reasons, "length": _ONE_FACE}
    for k, why in refused.items():
        reasons = {**reasons, ("length" if n == 2 and len(refused) < 2 else ("width", "length")[k]): why}
    slots = (0, 1) if whole else (1,)
    size, covariance = np.array([np.nan, np.nan, height[0]]), np.full((3, 3), np.nan)
    known = list(slots[: len(kept)])
    size[known] = at[kept]
    covariance[np.ix_(known, known)] = C[np.ix_(kept, kept)]
    covariance[2, 2] = height[1] ** 2
    covariance[2, known] = covariance[known, 2] = 0.0 * height[1]
    side = kept[0] if kept else 0
    place = slice(n, n + 2) if whole else slice(n + 2 + 2 * side, n + 4 + 2 * side)
    yaw = (fused.x[0] + (1 - side) * np.pi / 2 + np.pi / 2) % np.pi - np.pi / 2
    outline = np.array([p[1], p[0], p[0] + p[2] - p[1], p[2]]) if whole else p[side : side + 2]
    return MeasuredObject(
        "box" if whole else "face", size, covariance, at[place], C[place, place], float(yaw), float(std[-1]), outline,
        {**fused.sources, **({"height": "image"} if np.isfinite(height[0]) else {})}, reasons,
    )  # fmt: skip


def from_scan(
    footprint: Footprint | None, region: Region | None, laser: LaserOnFloor, height: tuple[float, float],
    reasons: dict[str, str], *, worst_std: float = 0.05,
) -> MeasuredObject:  # fmt: skip
    """Round and irregular outlines, and what shows no straight face: as the scan has it; `height` is (mm, std)."""
    covariance, size = np.full((3, 3), np.nan), np.array([np.nan, np.nan, height[0]])
    covariance[2, 2] = height[1] ** 2
    if footprint is None:
        assert region is not None
        why = "no straight face was found"
        place = np.array(region.position_mm)
        reasons = {**reasons, "length": why, "width": why}
        return MeasuredObject(
            "irregular", size, covariance, place, np.full((2, 2), np.nan), np.nan, np.nan, place[None], {}, reasons
        )
    centre, spread = laser.points_mm(footprint.centre_mm), np.full((2, 2), np.nan)
    outline = laser.points_mm(footprint.segment.points_mm)
    round_std = footprint.length_std_mm if footprint.shape == "circle" else np.nan
    if round_std < worst_std * footprint.length_mm:
        size[:2] = footprint.length_mm
        covariance[:2, :2] = footprint.length_std_mm**2
        covariance[2, :2] = covariance[:2, 2] = 0.0 if np.isfinite(height[0]) else np.nan
        spread = laser.R @ np.diag(footprint.centre_std_mm**2) @ laser.R.T + laser.covariance[:2, :2]
        angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
        outline = centre + footprint.length_mm / 2 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    else:
        why = footprint.reason or f"too uncertain: round, {footprint.length_mm:.0f} ± {round_std:.0f} mm"
        reasons = {**reasons, "length": why, "width": why}
    sources = {"lines": "scan", **({"height": "image"} if np.isfinite(height[0]) else {})}
    shape = "circle" if np.isfinite(size[0]) else "irregular"
    return MeasuredObject(shape, size, covariance, centre, spread, np.nan, np.nan, outline, sources, reasons)
