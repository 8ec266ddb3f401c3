"""One object from both sensors: lines from laser and picture, ends from the picture, height from the floor's plane.

Everything stands in the floor's frame: origin on the floor below the left camera, x forward along the optical axis
laid flat, y left, z up, mm.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

Array = np.ndarray
SIZES = ("length", "width", "height")


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
        What gave a quantity: ``"length" | "width" | "height" -> "image" | "scan" | "both"``.
    reasons : dict
        Why a quantity is unknown, or the whole object not measured (key ``"object"``).
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
