"""What the ground plane's method finds in a picture, kept with all it was found from: for tables, figures, sliders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolib.matching import SGBMParams, compute_disparity
from stereolib.measurement.edges import vertical_edge
from stereolib.measurement.floor import Floor, fit_floor
from stereolib.measurement.object_height import GroundHeight, Uncertainty, measure_height
from stereolib.measurement.plane_alignment import AlignedPair, CannotMeasure
from stereolib.measurement.regions import Region, find_objects
from stereolib.rig import RectifiedRig, to_light

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Attempt:
    """One pair, measured or refused.

    Attributes
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        Rectified.
    disparity_px : (H, W) float32
    floor : Floor or None
    region : Region or None
        The nearest object.
    found : GroundHeight or None
    refused : str
        Short name of the reason, as "no floor"; empty if measured.
    """

    left: Array
    right: Array
    disparity_px: Array
    floor: Floor | None = None
    region: Region | None = None
    found: GroundHeight | None = None
    refused: str = ""

    @property
    def height_mm(self) -> float:
        """NaN if refused."""
        return self.found.height_mm if self.found else np.nan

    @property
    def std_mm(self) -> float:
        """Standard deviation of the height; NaN if refused."""
        return self.found.height_std_mm if self.found else np.nan


def attempt_height(
    left: Array,
    right: Array,
    rectified: RectifiedRig,
    *,
    floor: Floor | None = None,
    uncertainty: Uncertainty | None = None,
    params: SGBMParams | None = None,
    worst_std: float = 0.05,
    seed: int = 0,
) -> Attempt:
    """Match, find floor and objects, and measure the nearest one: as `ground.height_of_nearest`, but never raises
    CannotMeasure and keeps every step.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        Rectified.
    rectified : RectifiedRig
    floor : Floor, optional
        Where it is known (`floor.floor_from_pose`); fitted to the disparities otherwise.
    uncertainty : Uncertainty, optional
    params : SGBMParams, optional
        By default 160 disparities in the mode "3way", which takes half of SGBM's time.
    worst_std : float
        See `ground.measure_height`.
    seed : int
        Of the pixels that `floor.fit_floor` draws.
    """
    disparity = compute_disparity(left, right, params or SGBMParams(160, mode="3way"), whole=True)
    pair, region = AlignedPair.of(left, right), None
    try:
        floor = floor or fit_floor(disparity, rectified, rng=np.random.default_rng(seed), pair=pair)
        objects = find_objects(disparity, floor)
        if not objects:
            raise CannotMeasure("no object", "nothing was found on the floor")
        region = objects[0]
        found = measure_height(left, right, floor, region, pair=pair, uncertainty=uncertainty, worst_std=worst_std)
    except CannotMeasure as error:
        return Attempt(left, right, disparity, floor, region, refused=error.reason)
    return Attempt(left, right, disparity, floor, region, found)


def corner_width_mm(attempt: Attempt, *, prior_std_px: float = 3.0) -> float:
    """Width of an object from its outermost left to its outermost right corner, on the floor. mm.

    Parameters
    ----------
    attempt : Attempt
        A measured one.
    prior_std_px : float
        How well the disparities tell where a face ends.

    Returns
    -------
    float
        NaN if the attempt was refused, or a corner does not stand out in the pictures, or lies outside of one.

    Notes
    -----
    The faces' lines (`faces.Face`) give the depth at every bearing; their ends are upright edges of the pictures
    (`edges.vertical_edge`). No scale and no known distance takes part.
    """
    if attempt.found is None or attempt.floor is None:
        return np.nan
    found, ends = attempt.found, []
    light = (to_light(attempt.left), to_light(attempt.right))
    for face, t in ((found.faces[0], found.faces[0].bearing[0]), (found.faces[-1], found.faces[-1].bearing[1])):
        rows_mm = (0.1 * found.height_mm, 0.9 * found.height_mm)
        normal = face.line / np.linalg.norm(face.line)
        edge = vertical_edge(light, attempt.floor, face.points_mm(t), rows_mm, prior_std_px=prior_std_px, normal=normal)
        if edge is None:
            return np.nan
        ends.append(face.points_mm(np.tan(edge.position)))
    return float(np.hypot(*(ends[1] - ends[0])))


def add_specks(disparity_px: Array, count: int, rng: np.random.Generator, *, highest_px: float = 160.0) -> Array:
    """A disparity map with wrong matches strewn over it: `count` pixels get any value from 1 to `highest_px`."""
    specked = np.array(disparity_px)
    rows, columns = (rng.integers(0, size, count) for size in specked.shape)
    specked[rows, columns] = rng.uniform(1.0, highest_px, count)
    return specked
