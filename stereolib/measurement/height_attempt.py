"""What the ground plane's method finds in a picture, kept with all it was found from: for tables, figures, sliders."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stereolib.base import Float32, Float64, UInt8
from stereolib.measurement.box import Box, Edge, Own, Shared
from stereolib.measurement.floor import Floor
from stereolib.measurement.instrument import Instrument, SystematicUncertainty
from stereolib.measurement.pictured import Pictured
from stereolib.measurement.plane_alignment import CannotMeasure
from stereolib.measurement.reasons import Reason
from stereolib.measurement.regions import OBJECTS_WITHIN_MM, ObjectRegion
from stereolib.measurement.standing import Standing, see_standing
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
    why : str
        The reason in words, with what to do.
    """

    left: UInt8
    right: UInt8
    disparity_px: Float32
    floor: Floor | None = None
    region: ObjectRegion | None = None
    box: Pictured | None = None
    refused: str = ""
    why: str = ""

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
    for side, image in (("left", left), ("right", right)):
        rectified.check_size(image, side)
    instrument = Instrument(rectified, uncertainty=uncertainty or SystematicUncertainty())
    return attempt_standing(see_standing(Views.of_rectified(left, right), instrument, floor=floor))


def attempt_standing(standing: Standing) -> HeightAttempt:
    """Attempt what `attempt_height` does in a pair in which all that stands is seen already.

    Parameters
    ----------
    standing : Standing

    Returns
    -------
    HeightAttempt
    """
    views, floor = standing.views, standing.floor
    attempt = HeightAttempt(views.left, views.right, views.disparity_px, floor)
    if standing.no_floor is not None:
        return _said(attempt, standing.no_floor)
    if not standing.regions:
        text = f"nothing stands on the floor within {OBJECTS_WITHIN_MM / 1000:g} m; place the object nearer"
        return _said(attempt, CannotMeasure("no object", text))
    attempt, box = replace(attempt, region=standing.regions[0]), standing.boxes[0]
    if isinstance(box, CannotMeasure):
        return _said(attempt, box)
    attempt = replace(attempt, box=box)
    refused, why = _refused(attempt, box)
    return replace(attempt, refused=refused, why=why)


def _said(attempt: HeightAttempt, error: CannotMeasure) -> HeightAttempt:
    return replace(attempt, refused=error.reason, why=error.text)


def _refused(attempt: HeightAttempt, box: Pictured) -> tuple[str, str]:
    """Short name of the reason why a box has no height, and the reason; both empty if it has."""
    if box.refused:
        return box.refused.reason.short, str(box.refused)
    if not any(edge in box.edges for edge in (Edge.TOP_RIGHT, Edge.TOP_LEFT)):
        is_cut = not any(past is past.OPEN for edge, past in box.past.items() if edge.is_top)
        return ("cut by the frame", Reason.TOP_CUT.value) if is_cut else ("no top edge", Reason.NO_EDGE.value)
    if attempt.std_mm > _WORST_STD * attempt.height_mm:
        return "too uncertain", f"{attempt.height_mm:.0f} ± {attempt.std_mm:.0f} mm: {Reason.TOO_UNCERTAIN.value}"
    return "", ""


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
