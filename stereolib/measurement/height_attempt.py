"""What the ground plane's method finds in a picture, kept with all it was found from: for tables, figures, sliders."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stereolib.base import Float32, UInt8
from stereolib.matching import SGBMParams, compute_disparity
from stereolib.measurement.edges import vertical_edge
from stereolib.measurement.floor import Floor, fit_floor
from stereolib.measurement.object_height import GroundHeight, SystematicUncertainty, measure_height
from stereolib.measurement.plane_alignment import AlignedPair, CannotMeasure
from stereolib.measurement.regions import OBJECTS_WITHIN_MM, ObjectRegion, find_objects
from stereolib.rig import RectifiedRig, to_light

_PARAMS = SGBMParams(160, mode="3way")  # 160 disparities begin at 0.45 m; "3way" takes half of SGBM's time
_EDGE_HEIGHTS = (0.1, 0.9)  # shares of the height between which corners are looked for


@dataclass(frozen=True, eq=False)
class HeightAttempt:
    """One pair, measured or refused.

    Attributes
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        Rectified.
    disparity_px : (H, W) float32
    floor : Floor or None
    region : ObjectRegion or None
        The nearest object.
    measured : GroundHeight or None
    refused : str
        Short name of the reason, as "no floor"; empty if measured.
    """

    left: UInt8
    right: UInt8
    disparity_px: Float32
    floor: Floor | None = None
    region: ObjectRegion | None = None
    measured: GroundHeight | None = None
    refused: str = ""

    @property
    def height_mm(self) -> float:
        """NaN if refused."""
        return self.measured.height_mm if self.measured else np.nan

    @property
    def std_mm(self) -> float:
        """Standard deviation of the height; NaN if refused."""
        return self.measured.height_std_mm if self.measured else np.nan


def attempt_height(
    left: UInt8,
    right: UInt8,
    rectified: RectifiedRig,
    *,
    floor: Floor | None = None,
    uncertainty: SystematicUncertainty | None = None,
    seed: int = 0,
) -> HeightAttempt:
    """Match, find floor and objects, and measure the nearest one; never raise CannotMeasure, and keep every step.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        Rectified.
    rectified : RectifiedRig
    floor : Floor, optional
        Where it is known (`floor_from_pose`); fitted to the disparities otherwise.
    uncertainty : SystematicUncertainty, optional
        By default that of a perfect calibration.
    seed : int
        Of the pixels that `fit_floor` draws.

    Returns
    -------
    HeightAttempt

    Raises
    ------
    ValueError
        If pictures and rig do not fit together.
    """
    attempt = HeightAttempt(left, right, compute_disparity(left, right, _PARAMS, whole=True))
    pair = AlignedPair.of(left, right)
    try:
        floor = floor or fit_floor(attempt.disparity_px, rectified, rng=np.random.default_rng(seed), pair=pair)
        attempt = replace(attempt, floor=floor)
        objects = find_objects(attempt.disparity_px, floor)
        if not objects:
            text = f"nothing stands on the floor within {OBJECTS_WITHIN_MM / 1000:g} m; place the object nearer"
            raise CannotMeasure("no object", text)
        attempt = replace(attempt, region=objects[0])
        return replace(attempt, measured=measure_height(pair, floor, objects[0], uncertainty=uncertainty))
    except CannotMeasure as error:
        return replace(attempt, refused=error.reason)


def corner_width_mm(attempt: HeightAttempt, *, prior_std_px: float = 3.0) -> float:
    """Width of an object from its outermost left to its outermost right corner, on the floor.

    Parameters
    ----------
    attempt : HeightAttempt
        A measured one.
    prior_std_px : float
        How well the disparities tell where a face ends.

    Returns
    -------
    float, mm
        NaN if the attempt was refused, or a corner does not stand out in the pictures, or lies outside of one.

    Notes
    -----
    The faces' lines (`Face`) give the depth at every bearing; their ends are upright edges of the pictures. No scale
    and no known distance takes part.
    """
    height, floor = attempt.measured, attempt.floor
    if height is None or floor is None:
        return np.nan
    light, ends = (to_light(attempt.left), to_light(attempt.right)), []
    low, high = (share * height.height_mm for share in _EDGE_HEIGHTS)
    for face, t in ((height.faces[0], height.faces[0].bearing[0]), (height.faces[-1], height.faces[-1].bearing[1])):
        normal = face.line / np.linalg.norm(face.line)
        edge = vertical_edge(light, floor, face.points_mm(t), (low, high), (prior_std_px, 0.0), normal)
        if edge is None:
            return np.nan
        ends.append(face.points_mm(np.tan(edge.position)))
    return float(np.hypot(*(ends[1] - ends[0])))
