"""How far the faces of a box go on, as both pictures agree about them: from the part that the disparity map shows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from stereolib.base import Float64
from stereolib.measurement.agreement import Agreement, Look, Past, Reach, Samples, agreement
from stereolib.measurement.box import Box, Own, Side, World
from stereolib.measurement.faces import Face
from stereolib.measurement.plane_alignment import CannotMeasure
from stereolib.measurement.sideways import heights_aside, reach_aside, upright
from stereolib.measurement.upright_line import UprightLine, face_line, upright_line
from stereolib.measurement.views import Views

_SAMPLES = 16  # of each line
_BEYOND_PX = 160  # a face is followed so far beyond where the disparity map has it
_CORNER_PX = np.arange(-4.0, 4.5, 0.5)  # a corner is tried at so many places about where a face ends
_NARROWEST_PX = 1.0  # of a first face
_LEAST_SECOND_PX = 4  # a second face must be followed so far
_FIRST_PX = 16  # the corner's place is told by so much of the second face
_WIDEST_PX = 300
_FIRST = (1.5, 2.5)  # px by which a first face goes on beyond where it was followed to, and the deviation
_SECOND = (-5.0, 4.5)  # a second one, whose place was only predicted, ends before that
_MOST_INSIDE = 0.4  # share of what was followed that an end may lie inside of
_WINDOW_PX = 3.0  # over which an end is spread
_BAND = 4  # samples of the lowest and of the highest part, whose ends tell a lean
_LEAST_RISE_PX = 30.0  # between both parts
_UPWARDS = (0.1, 0.9)  # shares of its width between which it is followed upwards
_FARTHEST_MM = 1200.0
#: The camera must stand so far above a top to look down on it.
LEAST_ABOVE_MM = 15.0
_TRIED_PX, _TRIED_STDS, _MOST_TRIED = 0.3, 2.5, 10  # of disparity, heights of a top that are tried, either way
_TRIED_FARTHER = (1, 2, 4)  # times as far, where the last one gains most
_AWAY = 0.1  # rows' correlation that a standard deviation away from the known height, squared, has to gain
_AGREES = 0.5  # correlation that speaks neither for nor against a top
_LEVEL = 1e-3  # fall of a ray that meets no top any more
_HIGHEST_MM, _PAST_RIM = 1000.0, 1.05
_FLOOR_SHARE = 0.4  # of a gap below a face: nearer to the floor all are alike
_FARTHER_PX = 1.0  # of disparity: what stands before a gap
_AT_FLOOR, _AT_FLOOR_PX = 0.03, 2.0  # of disparity, share and px: the floor that lies so little behind a face may be it
_DOWNWARDS = 0.5  # of the noise: the floor in the shadow of what hangs is nearly plain, and no face
_REACHED = 8  # lines: so near to there, it goes down to the floor
_PLAIN_PX = 6  # lines up to the picture's upper rim that show nothing: a face may end anywhere among more
_BELOW_PX = 10  # a face is followed so far below the floor, to see that it ends there


@dataclass(frozen=True)
class End:
    """Where a surface was followed to.

    Attributes
    ----------
    at : float
        Where it ends, likely: the tangent of a bearing, or a height or depth in mm.
    past : Past
    inside_px, outside_px : float
        It may end by so much before that, or beyond.
    std_px : float
        How well it is known.
    may_be_cut : bool
        All is plain from there to the picture's rim.
    """

    at: float
    past: Past
    inside_px: float = 0.0
    outside_px: float = 0.0
    std_px: float = 0.0
    may_be_cut: bool = False

    @property
    def is_sure(self) -> bool:
        """It ends there, and is not cut."""
        return self.past is Past.OPEN and not self.may_be_cut

    @property
    def spread_px(self) -> float:
        """Standard deviation of a place anywhere from so far inside to so far outside."""
        return (self.inside_px + self.outside_px) / 12**0.5

    @classmethod
    def of(cls, reach: Reach, where: Float64, *, aside: bool = False, second: bool = False) -> End:
        """Where a surface ends of which a reach tells.

        Parameters
        ----------
        reach : Reach
        where : (lines,) float64
            Places of its lines, which stand a pixel from each other.
        aside : bool
            It was followed along a row: what lies beyond the right picture's rim there, the left one shows.
        second : bool
            Its place was only predicted.

        Returns
        -------
        End
        """
        may_be_cut = reach.past is Past.CUT
        if may_be_cut and not aside and reach.stop - reach.last <= _PLAIN_PX:
            return cls(float(where[max(reach.stop - 1, 0)]), reach.past)
        lean, spread = _SECOND if second else _FIRST
        plain = max(float(reach.stop - reach.last) - _WINDOW_PX, 0.0)
        at = int(np.clip(round(reach.last + max(lean, -0.5 * reach.last)), 0, len(where) - 1))
        inside = min(2 * spread + reach.last - reach.sure, _MOST_INSIDE * max(reach.last + lean, 1.0))
        std = float(np.hypot(spread, plain / 12**0.5))
        past = Past.OPEN if may_be_cut else reach.past
        return cls(float(where[at]), past, inside, 2 * spread + plain, std, may_be_cut)

    def overlaps(self, other: End, per_unit_px: float) -> bool:
        """Whether the same edge may be meant.

        Parameters
        ----------
        other : End
        per_unit_px : float
            Pixels to a unit of `at`.

        Returns
        -------
        bool
        """
        reach = max(self.inside_px, self.outside_px) + max(other.inside_px, other.outside_px)
        return abs(self.at - other.at) * per_unit_px < reach


@dataclass(frozen=True, eq=False)
class Stretch:
    """The part of an upright plane that both pictures show.

    Attributes
    ----------
    line : UprightLine
    right, left : End
    low_mm : float
        Height down to which it was followed.
    foot_mm : float
        Height below which the pictures disagree about it, other than for something nearer that hides it.
    is_cut_below : bool
        The pictures end between there and the floor.
    high : End
    mm_per_px : float
    lean_rad, lean_std_rad : float
        How far its ends lean to the left, seen from the camera; NaN where that cannot be told.
    """

    line: UprightLine
    right: End
    left: End
    low_mm: float
    foot_mm: float
    is_cut_below: bool
    high: End
    mm_per_px: float
    lean_rad: float = np.nan
    lean_std_rad: float = np.nan

    @property
    def heights_mm(self) -> Float64:
        """Where it is compared sideways."""
        return heights_aside(self.low_mm, self.high.at)


def follow_face(views: Views, world: World, face: Face, top_mm: float) -> Stretch:
    """Follow a face to its ends, up and down.

    Parameters
    ----------
    views : Views
    world : World
    face : Face
    top_mm : float
        Its height, roughly.

    Returns
    -------
    Stretch

    Raises
    ------
    CannotMeasure
        "no texture", if what was matched lies on no upright plane before the camera.
    """
    stretch, f = _upwards(views, world, face, top_mm), float(world.focal)
    line, (a, b) = stretch.line, face.bearing

    shown, ends = stretch.heights_mm, dict[int, list[End]]()
    for outwards, seen in ((-1, a), (1, b)):
        inside = round(f * (b - a) / 2)
        t = seen + outwards * np.arange(-inside, _BEYOND_PX) / f
        points = upright(line.at(t), shown)
        samples = Samples.of(views, world, points)
        bands = (samples.part(part).agreement().reach(inside) for part in (slice(None, _BAND), slice(-_BAND, None)))
        reaches = [reach_aside(views, world, points, samples.agreement(), inside), *bands]
        ends[outwards] = [End.of(reach, t, aside=True) for reach in reaches]
    stretch = replace(stretch, right=ends[-1][0], left=ends[1][0])
    rise_px = (shown[-_BAND:].mean() - shown[:_BAND].mean()) / stretch.mm_per_px
    sure = [(foot, top) for _, foot, top in ends.values() if not (foot.may_be_cut or top.may_be_cut)]
    both = [(foot, top) for foot, top in sure if foot.past is top.past is Past.OPEN]
    if not both or rise_px < _LEAST_RISE_PX:
        return stretch
    shift = float(np.mean([f * (top.at - foot.at) for foot, top in both]))
    std = float(np.mean([foot.std_px for foot, _ in both]))
    return replace(stretch, lean_rad=float(np.arctan(shift / rise_px)), lean_std_rad=std / rise_px)


def _upwards(views: Views, world: World, face: Face, top_mm: float) -> Stretch:
    """Follow a face down and up from its middle; its ends are left as the disparity map has them."""
    line, *_ = upright_line(world, face, 0.5 * top_mm)
    a, b = face.bearing
    ground = line.at(a + (b - a) * np.linspace(*_UPWARDS, _SAMPLES))
    if not (np.isfinite(ground).all() and (ground[:, 0] > 0).all()):
        raise CannotMeasure("no texture", "what was matched of the object is no upright face; light or texture it")
    per_px = float(ground[:, 0].mean()) / float(world.focal)
    heights = np.arange(-_BELOW_PX * per_px, _height_at_rim(world, ground.mean(axis=0)), per_px)
    middle = int(np.argmin(np.abs(heights - 0.5 * top_mm)))
    level = np.swapaxes(upright(ground, heights), 0, 1)
    along, known = agreement(views, world, level), round(0.4 * top_mm / per_px)
    above, below = along.part(slice(middle, None)), along.part(slice(middle, None, -1))
    down = replace(below, noise=_DOWNWARDS * below.noise).reach(known)
    up = above.carried_on(above.reach(known))  # not aside: there the other face is as far away
    low, foot = (float(heights[max(middle - max(k, 0), 0)]) for k in (down.last, down.stop))
    foot = _carried_down(along, heights, middle, down, float(world.camera_height)) if foot > 0 else foot
    foot = 0.0 if down.past is Past.HIDDEN and foot > 0 and _nearer_below(along, heights, foot) else foot
    is_cut = bool(np.isnan(along.fine[(heights >= 0.0) & (heights < foot)]).any())
    high = End.of(up, heights[middle:])
    return Stretch(line, End(a, Past.OPEN), End(b, Past.OPEN), low, foot, is_cut, high, per_px)


def _carried_down(along: Agreement, heights: Float64, middle: int, down: Reach, camera_mm: float) -> float:
    """Height down to which the disparity map has a face going on, as far as the floor is behind it: mm."""
    behind = heights > camera_mm * (_AT_FLOOR + _AT_FLOOR_PX / np.maximum(along.predicted_px, 1.0))
    lowest = max(int(behind.argmax()), 1)
    stop = along.part(slice(middle, lowest - 1, -1)).carried_on(down).stop if lowest < middle - down.stop else down.stop
    if stop > down.stop and stop > middle - lowest - _REACHED:
        return 0.0
    return float(heights[max(middle - max(stop, 0), 0)])


def _nearer_below(along: Agreement, heights: Float64, foot_mm: float) -> bool:
    """Between a face's foot and the floor something nearer shows."""
    gap = (heights > _FLOOR_SHARE * foot_mm) & (heights < foot_mm)
    nearer = along.matched_px[gap] > along.predicted_px[gap] + _FARTHER_PX
    return int(np.count_nonzero(nearer)) > 0.5 * max(int(np.count_nonzero(gap)), 1)


@dataclass(frozen=True)
class Corner:
    """A second face, round a corner.

    Attributes
    ----------
    t : float
        Tangent of the corner's bearing.
    depth_mm : float
        How far it goes back.
    end : End
        Where it ends.
    width_px : float
        0: it was not followed, only its end was found.
    plain_px : float
        Where the first face ends in a plain part, the corner may stand so much farther out.
    """

    t: float
    depth_mm: float
    end: End
    width_px: float
    plain_px: float = 0.0


def look_round(views: Views, world: World, stretch: Stretch, outwards: int) -> Corner | None:
    """Look for a second face round an end of one: at a right angle to it, so that its place is predicted.

    Parameters
    ----------
    views : Views
    world : World
    stretch : Stretch
        The first face.
    outwards : int
        -1: round its right end; 1: round its left one.

    Returns
    -------
    Corner or None
        None where the end is not seen, or all is plain there, or the pictures agree about no second face, or no more
        than about the first one going on.
    """
    end, other = (stretch.left, stretch.right) if outwards > 0 else (stretch.right, stretch.left)
    f = float(world.focal)
    tried = end.at - outwards * _FIRST[0] / f + _CORNER_PX / f
    tried = tried[outwards * (tried - other.at) * f > _NARROWEST_PX]
    if not (end.is_sure and len(tried)):  # what is plain to the rim is no second face
        return None
    _, ground = _second(stretch.line, tried, outwards, np.arange(1.0, _FIRST_PX) / f)
    alike = Samples.of(views, world, upright(ground, stretch.heights_mm)).correlations.mean(axis=-1)
    far = np.count_nonzero(np.isfinite(ground[..., 0]), axis=1) <= _LEAST_SECOND_PX
    scores = np.where(far, 0.0, np.nansum(alike, axis=1))
    if not scores.max() > 0:
        return None
    best = tried[[scores.argmax()]]
    t, ground = _second(stretch.line, best, outwards, np.arange(1.0, _WIDEST_PX) / f)
    seen = np.isfinite(ground[0, :, 0])
    t, ground = t[0, seen], ground[0, seen]
    points = upright(ground, stretch.heights_mm)
    along = agreement(views, world, points)
    reach = reach_aside(views, world, points, along, _FIRST_PX, Look.SECOND)
    if reach.last < _LEAST_SECOND_PX or _goes_on_as_well(views, world, stretch, t, along.whole[: reach.last + 1]):
        return None
    edge, corner = End.of(reach, t, aside=True, second=True), float(best[0])
    far_mm = stretch.line.round_corner(corner, outwards).at(edge.at)
    depth_mm = float(np.linalg.norm(far_mm - stretch.line.at(corner)))
    return Corner(corner, depth_mm, edge, float(reach.last + 1), end.outside_px - 2 * _FIRST[1])


def _goes_on_as_well(views: Views, world: World, stretch: Stretch, t: Float64, second: Float64) -> bool:
    """Whether both pictures are as alike where a second face was followed if it is the first one that goes on.

    And show it there by texture of its own: noise on a plain part tells of neither.
    """
    known, count = _FIRST_PX, len(second)
    before = t[0] + (t[0] - t[1]) * np.arange(known, 0, -1)
    along = agreement(views, world, upright(stretch.line.at(np.append(before, t[:count])), stretch.heights_mm))
    is_shown = np.count_nonzero(along.shows(known)[known:]) > count / 2
    return bool(is_shown and np.nansum(along.whole[known:]) >= np.nansum(second))


def _second(line: UprightLine, t0: Float64, outwards: int, beyond: Float64) -> tuple[Float64, Float64]:
    """Tangents (k, N) beyond corners (k,), and the second faces that they would have: (k, N, 2), NaN where none is."""
    second, t = line.round_corner(t0[:, None], outwards), t0[:, None] + outwards * beyond
    ground = second.at(t)
    near = (np.linalg.norm(ground - line.at(t0[:, None]), axis=-1) < _FARTHEST_MM) & (second.distance_mm > 0)
    ground[~np.logical_and.accumulate(near, axis=1)] = np.nan
    return t, ground


def follow_again(views: Views, world: World, own: Float64, side: Side) -> End | None:
    """Follow a face of a box from the corner to its end, now that its place is known.

    Parameters
    ----------
    views : Views
    world : World
    own : (8,) float64
        The box, in the order of `Own`.
    side : Side

    Returns
    -------
    End or None
        At a tangent of a bearing; None where it cannot be followed, or where it would end before the box has it and
        the pictures, all in all, show it alike in between.
    """
    outwards, corner = -1 if side is Side.RIGHT else 1, np.array([own[Own.Y] / own[Own.X]])
    beyond = np.arange(1.0, _WIDEST_PX) / float(world.focal)
    t, ground = (each[0] for each in _second(face_line(Box(own), side.other), corner, outwards, beyond))
    seen = np.isfinite(ground[:, 0])
    if np.count_nonzero(seen) <= _LEAST_SECOND_PX:
        return None
    points = upright(ground[seen], heights_aside(0.0, float(own[Own.HEIGHT])))
    along = agreement(views, world, points)
    reach = reach_aside(views, world, points, along, _FIRST_PX, Look.AGAIN)
    x, y = Box(own).edge(side.end)[0, :2]
    known = int(np.count_nonzero(outwards * t[seen] < outwards * y / x))
    if reach.last < _LEAST_SECOND_PX or along.evidence()[reach.stop : known].sum() > 0:
        return None
    return End.of(reach, t[seen], aside=True)


def width_mm(own: Float64, side: Side, end: float) -> float:
    """How wide a face of a box (8,) is, to where the tangent of a bearing meets it, mm."""
    x, y = float(own[Own.X]), float(own[Own.Y])
    line = face_line(Box(own), side)
    return float(np.linalg.norm(line.at(end) - line.at(y / x)))


def follow_top(views: Views, world: World, own: Float64, front: Side, height_std_mm: float) -> tuple[float, End] | None:
    """Follow the top of a box from the upper edge of a face backwards; None where the camera does not look down on it.

    Parameters
    ----------
    views : Views
    world : World
    own : (8,) float64
        The box, in the order of `Own`; how far it goes back is not used.
    front : Side
    height_std_mm : float
        How well its height is known.

    Returns
    -------
    (height_mm, End) or None
        The height at which both pictures agree best about the top's first rows, and how far back it goes, in mm.

    Notes
    -----
    Seen at a slant, a top a little higher or lower has quite another disparity: heights that change it by 0.3 px are
    tried, to 2.5 standard deviations, or 3 px, and twice and four times as far where the last one gains most: the known
    height may be that of a line. Each gains the most that its rows' correlations, over 0.5, add up to, less Cauchy's
    ``C^2 log(1 + z^2 / C^2) / 10``, C = 2.5; the known one stays where none gains.
    """
    height = _height_of_top(views, world, own, front, height_std_mm)
    if height is None:
        return None
    depth, points = _top(world, own, front, height, _WIDEST_PX)
    depth, points = depth[np.isfinite(depth)], points[np.isfinite(depth)]
    if len(depth) <= _LEAST_SECOND_PX:
        return None
    reach = agreement(views, world, points).reach(_FIRST_PX, Look.SECOND)
    return (height, End.of(reach, depth)) if reach.last >= _LEAST_SECOND_PX else None


def _height_of_top(views: Views, world: World, own: Float64, front: Side, height_std_mm: float) -> float | None:
    """The height at which both pictures agree best about the first rows of a top; None where none is looked down on."""
    known_mm, camera_mm = float(own[Own.HEIGHT]), float(world.camera_height)
    if not camera_mm - known_mm > LEAST_ABOVE_MM:
        return None
    middle = Box(own).edge(front.top).mean(axis=0) - [0.0, 0.0, camera_mm]
    step_mm = _TRIED_PX / float(world.scale) * (middle @ world.axes[:, 2]) * (camera_mm - known_mm)
    most, height = round(min(_MOST_TRIED, _TRIED_STDS * height_std_mm / step_mm)), known_mm
    for reach in (most * times for times in _TRIED_FARTHER):
        steps = np.array(sorted(range(-reach, reach + 1), key=abs))  # of equal ones the first is taken: the nearest
        tried = known_mm + step_mm * steps
        is_below = (tried > 0.0) & (tried < camera_mm - LEAST_ABOVE_MM)
        if not is_below.any():  # the known one is none of a top either
            return None
        steps, tried = steps[is_below], tried[is_below]
        first = np.stack([_top(world, own, front, each, _FIRST_PX)[1] for each in tried])
        alike = Samples.of(views, world, first).correlations.mean(axis=-1) - _AGREES
        gained = np.cumsum(np.nan_to_num(alike, nan=-_AGREES), axis=1).max(axis=1).clip(0.0, None)
        away = np.log1p(((tried - known_mm) / max(height_std_mm, step_mm) / _TRIED_STDS) ** 2)
        best = int((gained - _AWAY * _TRIED_STDS**2 * away).argmax())
        height = float(tried[best])
        if abs(steps[best]) < max(reach, 1):
            break
    return height


def _top(world: World, own: Float64, front: Side, height_mm: float, most_px: int) -> tuple[Float64, Float64]:
    """Rows of a top at a height behind a face's upper edge, a pixel apart: depths (N,), points (N, samples, 3).

    NaN from the first one on that lies too far behind.
    """
    own, f = own.copy(), float(world.focal)
    own[Own.HEIGHT] = height_mm
    a, b = Box(own).edge(front.top)
    back, above = np.append(Box(own).normal(front), 0.0), float(world.camera_height) - height_mm
    u, v = world.pixels(((a + b) / 2)[None])[0]
    rows = v - np.arange(1.0, most_px)
    rays = np.stack([np.full_like(rows, (u - world.centre_px[0]) / f), (rows - world.centre_px[1]) / f], axis=-1)
    rays = np.column_stack([rays, np.ones_like(rows)]) @ world.axes.T
    depth = ((above / np.maximum(-rays[:, 2], _LEVEL))[:, None] * rays[:, :2] - ((a + b) / 2)[:2]) @ back[:2]
    depth[~np.logical_and.accumulate(depth < _FARTHEST_MM)] = np.nan
    along = a + (b - a) * np.linspace(0.0, 1.0, _SAMPLES)[:, None]
    return depth, along[None] + depth[:, None, None] * back


def _height_at_rim(world: World, place_mm: Float64) -> float:
    """Height above a place on the floor beyond which no picture shows it, mm."""
    (u, _), _ = world.pixels(np.array([[*place_mm, 0.0], [*place_mm, 1.0]]))
    ray = world.axes @ [(u - world.centre_px[0]) / world.focal, -world.centre_px[1] / world.focal, 1.0]
    height = float(world.camera_height) + ray[2] / np.hypot(*ray[:2]) * np.hypot(*place_mm)
    return float(np.clip(_PAST_RIM * height, 0.0, _HIGHEST_MM))
