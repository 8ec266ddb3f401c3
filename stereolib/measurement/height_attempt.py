"""What the ground plane's method finds in a picture, kept with all it was found from: for tables, figures, sliders."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stereolib.base import Float32, Float64, UInt8
from stereolib.measurement.box import Box, Edge, Own, Shared
from stereolib.measurement.floor import Floor
from stereolib.measurement.instrument import Instrument, SystematicUncertainty
from stereolib.measurement.measure import scene_priors
from stereolib.measurement.missing_floor import find_floor
from stereolib.measurement.pictured import Pictured, see_box
from stereolib.measurement.plane_alignment import CannotMeasure
from stereolib.measurement.regions import OBJECTS_WITHIN_MM, ObjectRegion, find_objects
from stereolib.measurement.views import Views
from stereolib.rig import RectifiedRig

_HEIGHT = len(Shared) + Own.HEIGHT
_WORST_STD = 0.05  # share of the height above which it is refused
#: Kinds of observations as tables call them.
_PARTS = {"EdgeSeen": "edges", "PlaneSeen": "faces", "floor": "floor", "cameras": "calibration"}


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
        The nearest object, in the disparity map.
    box : Pictured or None
        The same, as a box.
    refused : str
        Short name of the reason, as "no floor"; empty if measured.
    """

    left: UInt8
    right: UInt8
    disparity_px: Float32
    floor: Floor | None = None
    region: ObjectRegion | None = None
    box: Pictured | None = None
    refused: str = ""

    @property
    def height_mm(self) -> float:
        """NaN if refused."""
        return float(self.box.own[Own.HEIGHT]) if self.box and not self.refused else np.nan

    @property
    def std_mm(self) -> float:
        """Standard deviation of the height; NaN if refused."""
        if self.box is None or self.refused:
            return np.nan
        return float(np.sqrt(self.box.solution.covariance[_HEIGHT, _HEIGHT]))

    @property
    def parts_mm(self) -> dict[str, float]:
        """Standard deviations that make up the whole: ``edges, faces, floor, calibration``; empty if refused."""
        given = self.box.solution.given if self.box and not self.refused else {}
        return {name: float(np.sqrt(given[kind][_HEIGHT])) for kind, name in _PARTS.items() if kind in given}

    @property
    def near_mm(self) -> Float64:
        """Where the near upright edge stands on the floor: forward, left; NaN if refused. (2,)."""
        return np.asarray(Box(self.box.own).corner) if self.box and not self.refused else np.full(2, np.nan)

    @property
    def edge_px(self) -> Float64:
        """Lower and upper end of the near upright edge in the left picture; NaN if refused. (2, 2)."""
        if self.box is None or self.floor is None or self.refused:
            return np.full((2, 2), np.nan)
        return self.floor.pixels(Box(self.box.own).points(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])))


def attempt_height(
    left: UInt8,
    right: UInt8,
    rectified: RectifiedRig,
    *,
    floor: Floor | None = None,
    uncertainty: SystematicUncertainty | None = None,
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

    Returns
    -------
    HeightAttempt

    Raises
    ------
    ValueError
        If pictures and rig do not fit together.
    """
    return attempt_in(Views.of_rectified(left, right), rectified, floor=floor, uncertainty=uncertainty)


def attempt_in(
    views: Views,
    rectified: RectifiedRig,
    *,
    floor: Floor | None = None,
    uncertainty: SystematicUncertainty | None = None,
) -> HeightAttempt:
    """Attempt what `attempt_height` does in a pair that is prepared already.

    Parameters
    ----------
    views : Views
    rectified, floor, uncertainty
        As for `attempt_height`.

    Returns
    -------
    HeightAttempt
    """
    attempt = HeightAttempt(views.left, views.right, views.disparity_px)
    try:
        floor = floor or find_floor(views, rectified)
        attempt = replace(attempt, floor=floor)
        objects = find_objects(views.disparity_px, floor)
        if not objects:
            text = f"nothing stands on the floor within {OBJECTS_WITHIN_MM / 1000:g} m; place the object nearer"
            raise CannotMeasure("no object", text)
        instrument = Instrument(rectified, uncertainty=uncertainty or SystematicUncertainty())
        attempt = replace(attempt, region=objects[0])
        attempt = replace(attempt, box=see_box(views, scene_priors(views, instrument, floor), objects[0]))
    except CannotMeasure as error:
        return replace(attempt, refused=error.reason)
    return replace(attempt, refused=_refused(attempt))


def _refused(attempt: HeightAttempt) -> str:
    """Short name of the reason why a box has no height; empty if it has."""
    assert attempt.box is not None
    if attempt.box.refused:
        return attempt.box.refused.reason.short
    if not any(edge in attempt.box.edges for edge in (Edge.TOP_RIGHT, Edge.TOP_LEFT)):
        is_cut = not any(past is past.OPEN for edge, past in attempt.box.past.items() if edge.is_top)
        return "cut by the frame" if is_cut else "no top edge"
    return "too uncertain" if attempt.std_mm > _WORST_STD * attempt.height_mm else ""


def corner_width_mm(attempt: HeightAttempt) -> float:
    """Width of an object from its outermost left to its outermost right corner, on the floor.

    Parameters
    ----------
    attempt : HeightAttempt
        A measured one.

    Returns
    -------
    float, mm
        NaN if the attempt was refused, or a corner does not stand out in the pictures, or lies outside of one.

    Notes
    -----
    The faces' planes give the depth at every bearing; their ends are upright edges of the pictures. No scale and no
    known distance takes part.
    """
    box = attempt.box
    ends = [edge for edge in (Edge.RIGHT_END, Edge.CORNER, Edge.LEFT_END) if box is not None and edge in box.past]
    if box is None or attempt.refused or not all(edge in box.edges for edge in (ends[0], ends[-1])):
        return np.nan
    right, left = (Box(box.own).edge(edge)[0, :2] for edge in (ends[0], ends[-1]))
    return float(np.hypot(*(left - right)))
