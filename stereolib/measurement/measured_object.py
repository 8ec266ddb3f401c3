"""One measured object: its sizes with their covariance, and why a size is unknown.

Everything stands in the floor's frame: origin on the floor below the left camera, x forward along the optical axis
laid flat, y left, z up, mm.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from stereolib.base import Float64, Ints, direction, wrap_rad
from stereolib.laser import Footprint
from stereolib.measurement.agreement import Past
from stereolib.measurement.box import Box, Edge, Numbers, Own, Shared, Side, derivatives
from stereolib.measurement.laser_on_floor import LaserOnFloor
from stereolib.measurement.reasons import UNSURE, Reason, Source, Why
from stereolib.measurement.regions import ObjectRegion
from stereolib.measurement.scene_solver import COMMON_ERRORS, Solution

Height = tuple[float, float]  # and its standard deviation, mm
#: What `MeasuredObject.size_mm` holds, in its order.
SIZE_NAMES = ("length", "width", "height")
#: Share of a side: one whose standard deviation is larger is not told.
WORST_STD = 0.04
#: A size that is known no better is told with what makes it so.
UNSURE_MM = 5.0
_UNSURE_SHARE = 0.5  # of its variance, which one kind of observation must give to be named
_BY_CHANCE = 1.4  # standard deviations by which what was seen of a box misses it: more, and these are too small
_CIRCLE_CORNERS = 24
_TOPS = (Edge.TOP_RIGHT, Edge.TOP_LEFT)
_SIDES = (Side.RIGHT, Side.LEFT)
_CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])  # of the outline, counter-clockwise


@dataclass(frozen=True, eq=False)
class MeasuredObject:
    """An object on the floor, with standard deviations; what is not known is NaN, with a reason.

    Attributes
    ----------
    shape : str
        ``"box"`` (two faces seen), ``"face"`` (one; the depth is unknown), ``"circle"`` (a cylinder), ``"irregular"``.
    size_mm : (3,) float64
        Length (the longer side; where both are equal within their deviations, either may be), width, height. Of a face
        the width is that of the face; a circle's length and width are its diameter.
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
        What gave what: ``"lines"`` (of the faces), ``"right end"``, ``"left end"`` and ``"height"`` -> `Source`.
    reasons : dict of Why
        Why ``"length"``, ``"width"`` or ``"height"`` is unknown, or the whole ``"object"`` not measured.
    common_mm : (3, 7) float64
        What `size_mm` is off for one standard deviation of each error that other pairs of the same calibration share;
        ``common_mm @ common_mm.T`` is a part of `covariance`. 0 where that is unknown.
    unsure : dict of str
        Of ``"length"``, ``"width"`` and ``"height"`` those that are known to 5 mm only, or worse: what makes most of
        that, and what helps; missing where no one thing does.
    disagrees : bool
        Scan and pair disagree about it: what is told of it comes from the pair.
    """

    shape: str
    size_mm: Float64
    covariance: Float64
    position_mm: Float64
    position_covariance: Float64
    yaw_rad: float
    yaw_std_rad: float
    outline_mm: Float64
    sources: dict[str, Source] = field(default_factory=dict)
    reasons: dict[str, Why] = field(default_factory=dict)
    common_mm: Float64 = field(default_factory=lambda: np.zeros((len(SIZE_NAMES), COMMON_ERRORS)))
    unsure: dict[str, str] = field(default_factory=dict)
    disagrees: bool = False

    @property
    def std_mm(self) -> Float64:
        """Standard deviations of `size_mm`, (3,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def volume_l(self) -> tuple[float, float]:
        """Volume and its standard deviation, litres; NaN if a size is unknown."""
        volume, slope = self.volume_slope
        return volume, self._std(slope)

    @property
    def volume_slope(self) -> tuple[float, Float64]:
        """Volume, litres, and its derivatives with `size_mm`, (3,)."""
        length, width, height = self.size_mm
        base = (np.pi / 4 if self.shape == "circle" else 1.0) / 1e6
        gradient = base * np.array([width * height, length * height, length * width])
        return base * float(length * width * height), gradient

    @property
    def surface_m2(self) -> tuple[float, float]:
        """Area of the sides and the top, and its standard deviation, m^2; NaN if a size is unknown."""
        area, slope = self.surface_slope
        return area, self._std(slope)

    @property
    def surface_slope(self) -> tuple[float, Float64]:
        """Area of the sides and the top, m^2, and its derivatives with `size_mm`, (3,)."""
        length, width, height = self.size_mm
        if self.shape == "circle":
            area = np.pi * (length * height + length * width / 4)
            gradient = np.pi * np.array([height + width / 4, length / 4, length])
        else:
            area = 2 * (length + width) * height + length * width
            gradient = np.array([2 * height + width, 2 * height + length, 2 * (length + width)])
        return float(area) / 1e6, gradient / 1e6

    def without(self, name: str, why: Why) -> MeasuredObject:
        """The same, one of its sizes unknown; outline and place stay as they were found.

        Parameters
        ----------
        name : {"length", "width", "height"}
        why : Why

        Returns
        -------
        MeasuredObject
        """
        k = SIZE_NAMES.index(name)
        size, covariance, common = self.size_mm.copy(), self.covariance.copy(), self.common_mm.copy()
        size[k] = covariance[k] = covariance[:, k] = np.nan
        common[k] = 0.0
        unsure = {other: text for other, text in self.unsure.items() if other != name}
        reasons = {name: why} | self.reasons
        return replace(self, size_mm=size, covariance=covariance, common_mm=common, reasons=reasons, unsure=unsure)

    def without_outline(self, why: Why) -> MeasuredObject:
        """The same, of no shape: length and width unknown, and the direction, where one of them was told.

        Parameters
        ----------
        why : Why

        Returns
        -------
        MeasuredObject
        """
        told, found = [name for name in SIZE_NAMES[:2] if name not in self.reasons], self
        for name in told:
            found = found.without(name, why)
        return replace(found, shape="irregular", yaw_rad=np.nan, yaw_std_rad=np.nan) if told else self

    def _std(self, gradient: Float64) -> float:
        return float(np.sqrt(gradient @ self.covariance @ gradient))


@dataclass(frozen=True, eq=False)
class BoxFacts:
    """What is told of a box besides its parameters.

    Attributes
    ----------
    past : dict
        What the pictures show where its faces end, by edge; what is not in it they do not show.
    sources : dict
        As `MeasuredObject.sources`.
    reasons : dict
        Why something is unknown, so far.
    doubtful : frozenset of Edge
        Edges that contradict the others.
    doubt : (8, 8) float64
        Covariance of its parameters besides the solution's.
    """

    past: dict[Edge, Past] = field(default_factory=dict)
    sources: dict[str, Source] = field(default_factory=dict)
    reasons: dict[str, Why] = field(default_factory=dict)
    doubtful: frozenset[Edge] = frozenset()
    doubt: Float64 = field(default_factory=lambda: np.zeros((len(Own), len(Own))))


def from_box(solution: Solution, box: int, facts: BoxFacts) -> MeasuredObject:
    """Make a measured object of one box of a solution.

    Parameters
    ----------
    solution : Solution
    box : int
        Its number.
    facts : BoxFacts

    Returns
    -------
    MeasuredObject

    Notes
    -----
    Where something that was seen of the box misses it by more than chance, 1.4 of its own standard deviations as
    `Solution.misfits` counts, the model or the deviations are wrong, nobody knows which: all are widened by as much
    (Birge's ratio, of the worst observation).

    References
    ----------
    Birge: The calculation of errors by the method of least squares. Phys. Rev. 40 (1932).
    """
    x, C = solution.of_box(box)
    C = C * max(float(solution.misfits[box].max(initial=0.0)) / _BY_CHANCE, 1.0) ** 2
    C[len(Shared) :, len(Shared) :] += facts.doubt
    at, J = derivatives(_sizes_and_places, x)
    spread = J @ C @ J.T
    sizes, std = at[:3], np.sqrt(np.diag(spread)[:3])
    reasons = {k: why for k in range(3) if (why := _why(k, facts, sizes[k], std[k]))}
    sides = sorted({0, 1} - set(reasons), key=lambda k: -sizes[k])
    whole, named = len(sides) == 2, _named(sides)
    known = [name for name, k in enumerate(named) if k not in reasons]
    size, covariance = np.full(3, np.nan), np.full((3, 3), np.nan)
    size[known] = sizes[named[known]]
    covariance[np.ix_(known, known)] = spread[np.ix_(named[known], named[known])]
    common = np.zeros((3, COMMON_ERRORS))
    common[known] = (J[:3] @ solution.common_of_box(box))[named[known]]
    longest = sides[0] if sides else int(np.argmin(std[:2] / sizes[:2]))
    place = slice(3, 5) if whole else slice(5 + 2 * longest, 7 + 2 * longest)
    turn, is_right = len(Shared) + Own.TURN, _SIDES[longest] is Side.RIGHT
    corners = Box(x[len(Shared) :]).points(_CORNERS)[:, :2]
    return MeasuredObject(
        shape="box" if whole else "face",
        size_mm=size,
        covariance=covariance,
        position_mm=at[place],
        position_covariance=spread[place, place],
        yaw_rad=float(wrap_rad(x[turn] - (np.pi / 2 if is_right else 0.0), np.pi)),
        yaw_std_rad=float(np.sqrt(C[turn, turn])),
        outline_mm=corners if whole else corners[[1, 0] if is_right else [0, 3]],
        sources=facts.sources,
        reasons={SIZE_NAMES[name]: reasons[k] for name, k in enumerate(named) if k in reasons} | facts.reasons,
        common_mm=common,
        unsure={SIZE_NAMES[name]: text for name in known if (text := _why_unsure(solution, box, named[name]))},
    )


def _named(sides: list[int]) -> Ints:
    """Which side (0 right, 1 left) is the length, and which the width; 2 is the height."""
    first, second = sides if len(sides) == 2 else (1 - sides[0], sides[0]) if sides else (1, 0)
    return np.array([first, second, 2])


def _why(size: int, facts: BoxFacts, value: float, std: float) -> Why | None:
    """Why a size (0 right side, 1 left side, 2 height) is not told; None if it is."""
    past, whole = facts.past, facts.reasons.get("object")
    if facts.doubtful:
        return Why(Reason.CONTRADICTION, f"{value:.0f} mm")
    if std < WORST_STD * value and (whole is None or whole.reason.leaves_the_pair):
        return None
    side = None if size == len(_SIDES) else _SIDES[size]
    ends = {side.end, side.other.back} & set(past) if side else set()
    shown = {past.get(Edge.CORNER), *map(past.get, ends)} if side else {p for e, p in past.items() if e in _TOPS}
    if not past or (side and not ends):
        return Why(Reason.DEPTH_HIDDEN)
    if Past.CUT in shown:
        return Why(Reason.CUT if side else Reason.TOP_CUT)
    if Past.HIDDEN in shown:
        return Why(Reason.HIDDEN)
    return Why(Reason.TOO_UNCERTAIN, f"{max(value, 0.0):.0f} ± {std:.0f} mm")


def _why_unsure(solution: Solution, box: int, size: int) -> str:
    """What makes most of the variance of a size (0 right side, 1 left side, 2 height); "" where it is small."""
    at = len(Shared) + len(Own) * box + (Own.RIGHT, Own.LEFT, Own.HEIGHT)[size]
    variance = float(solution.covariance[at, at])
    if variance < UNSURE_MM**2:
        return ""
    kind, most = max(((kind, float(parts[at])) for kind, parts in solution.given.items()), key=lambda part: part[1])
    if most < _UNSURE_SHARE * variance:
        return ""
    return UNSURE.get(kind, "")


def _sizes_and_places(x: Numbers) -> Numbers:
    """Right and left side, height; middle of the outline, of the right and of the left face: (..., 9)."""
    box = Box(x[..., len(Shared) :])
    sizes = box.own[..., [Own.RIGHT, Own.LEFT, Own.HEIGHT]]
    places = box.points(np.array([[0.5, 0.5, 0], [0.5, 0, 0], [0, 0.5, 0]]))[..., :2]
    return np.concatenate([sizes, places.reshape(*sizes.shape[:-1], 6)], axis=-1)


def from_scan(footprint: Footprint, laser: LaserOnFloor, height: Height, reasons: dict[str, Why]) -> MeasuredObject:
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
    outline, common = laser.points_mm(footprint.segment.points_mm), np.zeros((len(SIZE_NAMES), COMMON_ERRORS))
    round_std = footprint.length_std_mm if footprint.shape == "circle" else np.nan
    is_circle = bool(round_std < WORST_STD * footprint.length_mm)
    if is_circle:
        share = 1 - laser.scale
        size[:2] = share * footprint.length_mm
        covariance[:2, :2] = (share * footprint.length_std_mm) ** 2 + footprint.length_mm**2 * laser.covariance[3, 3]
        covariance[2, :2] = covariance[:2, 2] = 0.0 if np.isfinite(height[0]) else np.nan
        common[:2, : laser.common.shape[1]] = -footprint.length_mm * laser.common[3]
        x, y = lever = centre - laser.t
        J = np.column_stack([np.eye(2), [-y, x], -lever / share])  # of the centre, by the laser's place, yaw and scale
        own = share * laser.R * footprint.centre_std_mm
        spread = own @ own.T + J @ laser.covariance @ J.T
        angles = np.linspace(0, 2 * np.pi, _CIRCLE_CORNERS, endpoint=False)
        outline = centre + size[0] / 2 * direction(angles)
    else:
        uncertain = Why(Reason.ROUND, f"{footprint.length_mm:.0f} ± {round_std:.0f} mm")
        why = Why(Reason.IRREGULAR, footprint.reason) if footprint.reason else uncertain
        reasons = {**reasons, "length": why, "width": why}
    shape, sources = "circle" if is_circle else "irregular", {"lines": Source.SCAN, **_height_source(height)}
    return MeasuredObject(
        shape, size, covariance, centre, spread, np.nan, np.nan, outline, sources, reasons, common_mm=common
    )


def from_region(region: ObjectRegion, reasons: dict[str, Why]) -> MeasuredObject:
    """Make an object of what the picture shows without a straight face: its place.

    Parameters
    ----------
    region : ObjectRegion
    reasons : dict
        Why something is unknown, so far.

    Returns
    -------
    MeasuredObject
    """
    size, covariance = np.full(3, np.nan), np.full((3, 3), np.nan)
    place, why = np.array(region.position_mm), Why(Reason.NO_FACE)
    reasons, spread = {**reasons, "length": why, "width": why}, np.full((2, 2), np.nan)
    return MeasuredObject(
        "irregular", size, covariance, place, spread, np.nan, np.nan, outline_mm=place[None], reasons=reasons
    )


def _with_height(height: Height) -> tuple[Float64, Float64]:
    """Sizes (3,) and their covariance (3, 3) with the height alone known."""
    covariance = np.full((3, 3), np.nan)
    covariance[2, 2] = height[1] ** 2
    return np.array([np.nan, np.nan, height[0]]), covariance


def _height_source(height: Height) -> dict[str, Source]:
    return {"height": Source.IMAGE} if np.isfinite(height[0]) else {}
