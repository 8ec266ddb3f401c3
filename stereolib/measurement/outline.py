"""Edges of a box in both pictures, looked for where the model has them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from stereolib.base import Bools, Float64
from stereolib.measurement.agreement import agreement
from stereolib.measurement.box import Box, Edge, Own, Shared, Side, World, derivatives
from stereolib.measurement.edges import STEP_PX, ParallelLines, Peak, Powers, locate_edge, rivals
from stereolib.measurement.light import Light
from stereolib.measurement.observations import EdgeSeen
from stereolib.measurement.scene_solver import Priors
from stereolib.measurement.views import Views

#: How well an edge is expected beyond the stretch in which an end may lie, px.
END_PX = 1.5
_CLEAR = 1.33  # least contrast of an edge that is looked for afar, against the lines around it
_STILL_CLEAR = 1.13  # and of one whose place is known
_AFAR_PX = 12.0  # the least stretch in which an edge is looked for afar
_CLEAR_ALONE = 2.0  # and of one that ends a face about which nothing else is known
_NEARER_PX = 20.0  # by so much nearer edges are e times as likely, where a surface ends in a plain part
_BEFORE = 0.2  # how likely an edge is where it was located, if its face was followed elsewhere since
_LEAST_PX_PER_MM = 1e-3
_LEAST_REACH_PX, _MOST_REACH_PX = 4.0, 120.0
_FARTHER_PX = 8.0  # beyond, where the likeliest place is the last one
_FAR_MM, _EARLY = np.arange(0.0, 1000.0, 2.0), 10  # depths that are tried; a tenth of them is a likely one
_LEAST_SLIVER_PX, _WIDEST_SLIVER_PX = 3.0, 60.0
_LEAST_AHEAD_MM = 1.0  # of the camera
_WIDER = 1.5  # the right picture measures an end where it shows the face by so much wider
_LEAST_LINES = 16  # 4 px: less tells no edge from what is beside it
_LINES, _SAMPLES = 4, 16  # every fourth line is compared between both pictures, at so many points
_SHOWN = 0.3  # a picture that shows a face by less than this share of the other's width tells nothing of its end
_APART_PX = 3.0  # an upper edge that lies so far from the height of both is a line
_POWERS = Powers(strength=12.0, step=3.0)
_BACK_POWERS = Powers(strength=4.0, step=3.0)  # it ends a top, whose streaks lie along it: they stand out as much
_BACK_ENDS = 2.0  # power of the odds that the top ends there: what both pictures agree on tells more
_MOVED_BY = {
    Edge.RIGHT_END: Own.RIGHT,
    Edge.LEFT_END: Own.LEFT,
    Edge.TOP_RIGHT: Own.HEIGHT,
    Edge.TOP_LEFT: Own.HEIGHT,
    Edge.BACK_RIGHT: Own.LEFT,
    Edge.BACK_LEFT: Own.RIGHT,
}


def edge_direction(edge: Edge, own: Float64, first: Side) -> Float64:
    """The change of a box's parameters that moves an edge by 1 mm, over the surface that it ends.

    Parameters
    ----------
    edge : Edge
    own : (8,) float64
    first : Side
        The face along which the corner moves.

    Returns
    -------
    (8,) float64
    """
    step = np.zeros(len(Own))
    if edge is Edge.CORNER:
        step[[Own.X, Own.Y]], step[first.extent] = Box(own).normal(first.other), -1.0
    else:
        step[_MOVED_BY[edge]] = 1.0
    return step


def predicted(edge: Edge, world: World, own: Float64) -> EdgeSeen:
    """Where the model has an edge in the left picture.

    Parameters
    ----------
    edge : Edge
    world : World
        One, real.
    own : (8,) float64
        The box, in the order of `Own`.

    Returns
    -------
    EdgeSeen
        Its middle in the picture, with a standard deviation of 1 px.
    """
    return EdgeSeen.through(edge, *world.pixels(Box(own).edge(edge)))


def predicted_stds_px(
    edges: Sequence[Edge], first: Side, priors: Priors, x: Float64, covariance: Float64
) -> dict[Edge, float]:
    """How well a solution knows where edges are, across them, in the picture that measures them.

    Parameters
    ----------
    edges : sequence of Edge
    first : Side
    priors : Priors
    x : (19,) float64
        Shared parameters, then the box's own.
    covariance : (19, 19) float64

    Returns
    -------
    dict
        Standard deviations in px; empty where the pictures show no edge.
    """
    if not edges:
        return {}
    n = len(Shared)
    world = priors.world(x[:n])
    at = [_Eye.of(world, edge, x[n:], edge_direction(edge, x[n:], first)).at for edge in edges]
    residuals = EdgeSeen.together(at)
    _, J = derivatives(lambda y: residuals(priors.world(y[..., :n]), Box(y[..., n:])), x)
    return dict(zip(edges, np.sqrt(np.einsum("ij,jk,ik->i", J, covariance, J)).tolist(), strict=True))


@dataclass(frozen=True)
class Expected:
    """Where an edge is expected.

    Attributes
    ----------
    std_px : float
        How well that is known.
    low_px, high_px : float
        It lies in between, outwards of where the model has it, in the left picture, in which faces are followed.
    plain_px : float
        Where a plain part begins, over which the surface could not be followed: there nearer edges are likelier.
    was_located : bool
        It was located where the model has it, before it was expected elsewhere.
    farther_px : float
        It is looked for so much farther, either way, than is likely.
    """

    std_px: float
    low_px: float = 0.0
    high_px: float = 0.0
    plain_px: float = 0.0
    was_located: bool = False
    farther_px: float = 0.0

    @property
    def is_wide(self) -> bool:
        """It is looked for afar."""
        return self.high_px > self.low_px + _AFAR_PX

    def belief(self, outwards_px: Float64) -> Float64:
        """How likely it is at places, as a share of where it is likeliest.

        Parameters
        ----------
        outwards_px : (N,) float64

        Returns
        -------
        (N,) float64
            ``exp(-o / 20 px) / (1 + (b / std)^2)``: o is how far it lies in the plain part, b how far beyond the
            stretch. Where it was located before, a fifth at least.
        """
        beyond = np.maximum(np.maximum(outwards_px - self.high_px, self.low_px - outwards_px), 0.0)
        lean = np.exp(-np.maximum(outwards_px - self.plain_px, 0.0) / _NEARER_PX)
        likely = lean / (1 + (beyond / self.std_px) ** 2)
        if self.was_located:
            likely = np.maximum(likely, _BEFORE / (1 + (outwards_px / self.std_px) ** 2))
        return np.asarray(likely)

    def zoomed(self, zoom: float) -> Expected:
        """The same stretch, in a picture that shows the face by so much wider.

        Parameters
        ----------
        zoom : float

        Returns
        -------
        Expected
        """
        low, high, plain = (zoom * at for at in (self.low_px, self.high_px, self.plain_px))
        return replace(self, low_px=low, high_px=high, plain_px=plain)

    def places(self) -> Float64:
        """Where it is looked for, outwards, `STEP_PX` apart. (N,)."""
        reach = max(3.0 * self.std_px, _LEAST_REACH_PX) + self.farther_px
        low, high = min(self.low_px, 0.0), max(min(self.high_px, _MOST_REACH_PX), 0.0)
        first, last = -round((reach - low) / STEP_PX), round((reach + high) / STEP_PX)
        return np.asarray(STEP_PX * np.arange(first, last + 1), np.float64)


@dataclass(frozen=True, eq=False)
class Found:
    """An edge that was found.

    Attributes
    ----------
    seen : EdgeSeen
    peak : Peak
    move : (8,) float64
        By what the box's parameters change to meet it, about.
    along_mm : (lines,) float64
        How far it moves to each of the lines of which ``peak.log_odds`` tells.
    """

    seen: EdgeSeen
    peak: Peak
    move: Float64
    along_mm: Float64 = field(default_factory=lambda: np.zeros(0), repr=False, compare=False)

    @property
    def mm_per_px(self) -> float:
        """By how much its parameter changes from one pixel to the next."""
        return float(np.abs(self.along_mm[-1] - self.along_mm[0]) / (STEP_PX * (len(self.along_mm) - 1)))

    def besides(self, rivals_px: float) -> Found:
        """The same, as well known as it is besides such rivals, seen in a wider search or along another edge.

        Parameters
        ----------
        rivals_px : float
            As `Peak.rivals_px`.

        Returns
        -------
        Found
        """
        peak = self.peak
        std = float(np.sqrt(peak.std_px**2 - peak.rivals_px**2 + rivals_px**2))
        return replace(self, seen=replace(self.seen, std_px=std), peak=replace(peak, std_px=std, rivals_px=rivals_px))


def find_edge(
    views: Views,
    world: World,
    own: Float64,
    edge: Edge,
    first: Side,
    expected: Expected,
) -> Found | None:
    """Look for an edge near where the model has it.

    Parameters
    ----------
    views : Views
    world : World
    own : (8,) float64
        The box, in the order of `Own`.
    edge : Edge
    first : Side
        The face that is known best: the corner is looked for along it.
    expected : Expected

    Returns
    -------
    Found or None
        None where no edge stands out.

    Notes
    -----
    Each place is as likely as it was expected, times the odds that the pictures agree about the surface up to there and
    no farther: a line printed on a face is no end of it. Where the last of them is the likeliest, it is looked for 8
    px farther, either way; what is still the last is no edge.
    """
    found = _find_among(views, world, own, edge, first, expected)
    if found is not None and found.peak.is_outermost:
        found = _find_among(views, world, own, edge, first, replace(expected, farther_px=_FARTHER_PX))
    return None if found is None or found.peak.is_outermost else found


def _find_among(views: Views, world: World, own: Float64, edge: Edge, first: Side, expected: Expected) -> Found | None:
    """The likeliest of the places where an edge is expected."""
    eye = _Eye.of(world, edge, own, edge_direction(edge, own, first))
    if not abs(eye.per_mm) > _LEAST_PX_PER_MM:
        return None
    at, step, per_mm, expected = eye.at, eye.step, eye.per_mm, expected.zoomed(eye.zoom)
    outwards = 1 if (per_mm > 0) != (edge is Edge.CORNER) else -1
    places = outwards * expected.places()[::outwards]
    moved = own + (places / per_mm)[:, None] * step
    lines = _lines(world, edge, moved, places)
    if lines is None:
        return None
    inside = _in_picture(lines, views.left.shape[:2], right=at.right)
    if not inside.all():  # it is looked for up to the rim
        places, moved, lines = places[inside], moved[inside], lines.some(inside)
    if len(places) < _LEAST_LINES:
        return None
    belief, powers = expected.belief(outwards * places), _POWERS
    if edge is not Edge.CORNER:  # beyond which the other face is almost where this one would be
        ends = _ends_surface(views, world, Box(moved[::outwards]).edge(edge))[::outwards]
        belief, powers = (belief * ends**_BACK_ENDS, _BACK_POWERS) if edge.is_back else (belief * ends, powers)
    peak = locate_edge(eye.looks_at(views.pair.pictures), lines, belief, powers)
    if peak is None or peak.contrast < (_CLEAR if expected.is_wide else _STILL_CLEAR):
        return None
    seen = replace(at, point_px=at.point_px + peak.position_px * at.across, std_px=peak.std_px)
    return Found(seen, peak, peak.position_px / per_mm * step, places / per_mm)


def level_tops(
    views: Views, world: World, own: Float64, first: Side, found: dict[Edge, Found], rivals_px: dict[Edge, float]
) -> dict[Edge, Found]:
    """Upper edges of both faces at one height: what lies elsewhere is a line, and what may be one edge may be both.

    Parameters
    ----------
    views : Views
    world : World
    own : (8,) float64
        The box, in the order of `Own`.
    first : Side
        The face that is known best.
    found : dict
        Edges as each was found for itself, with their odds.
    rivals_px : dict
        As `Peak.rivals_px`, of a wider search before.

    Returns
    -------
    dict
        The same where not both upper edges were found; else one that lies 3 px from their height is looked for there
        again, and both have the rivals of that height.
    """
    tops = [edge for edge in found if edge in (Edge.TOP_RIGHT, Edge.TOP_LEFT)]
    if len(tops) < 2:
        return found
    higher_mm, rivals_mm = of_one_height([found[edge] for edge in tops])
    remembered = [found[edge].mm_per_px * rivals_px[edge] for edge in tops if edge in rivals_px]
    rivals_mm, level, moved = max([rivals_mm, *remembered]), dict(found), np.zeros(len(Own))
    moved[Own.HEIGHT] = higher_mm
    for edge in tops:
        top = level.pop(edge)
        is_line = abs(top.move[Own.HEIGHT] - higher_mm) > _APART_PX * top.mm_per_px
        there = find_edge(views, world, own + moved, edge, first, Expected(END_PX)) if is_line else top
        if there is not None:
            move = there.move + (moved if is_line else 0.0)
            level[edge] = replace(there.besides(rivals_mm / there.mm_per_px), move=move)
    return level


def of_one_height(tops: Sequence[Found]) -> tuple[float, float]:
    """By how much a box is likeliest higher, along whose upper edges odds were found, each for itself.

    Parameters
    ----------
    tops : sequence of Found

    Returns
    -------
    higher_mm, rivals_mm : float
        And how far other heights lie that it may have as well.

    Notes
    -----
    The sum of their logarithms of odds is highest there; a height at which an edge was not looked for is as likely for
    it as the nearest at which it was: where one stands out, another cannot outvote it unseen. As a rival it is as
    likely as the likeliest: nobody looked.
    """
    mm = np.unique(np.concatenate([top.along_mm for top in tops]))
    likely, at_best = np.zeros(len(mm)), np.zeros(len(mm))
    for top in tops:
        at = top.along_mm.argsort()
        likely += np.interp(mm, top.along_mm[at], top.peak.log_odds[at])
        at_best += np.interp(mm, top.along_mm[at], top.peak.log_odds[at], left=0.0, right=0.0)
    best = int(likely.argmax())
    return float(mm[best]), rivals(at_best - at_best[best], mm - mm[best], at_best)


def _in_picture(lines: ParallelLines, shape: tuple[int, int], *, right: bool) -> Bools:
    """Which lines have their middle in a picture. (lines,)."""
    u, v = lines.ends_px.mean(axis=1).T - np.outer([float(right), 0.0], lines.shift_px.mean(axis=1))
    return np.asarray((u > 1) & (v > 1) & (u < shape[1] - 2) & (v < shape[0] - 2))


def _ends_surface(views: Views, world: World, ends_mm: Float64) -> Float64:
    """How likely a surface ends at neighbouring lines (N, 2, 3), outwards, against the likeliest of them. (N,)."""
    some = ends_mm[::_LINES]
    share = (np.arange(_SAMPLES)[:, None] + 0.5) / _SAMPLES
    along = agreement(views, world, some[:, :1] + share * (some[:, 1:] - some[:, :1]))
    up_to = np.cumsum(along.evidence())
    odds = np.interp(np.arange(len(ends_mm)), _LINES * np.arange(len(some)), up_to)
    return np.asarray(np.exp(odds - odds.max()))


def find_far_end(light: Light, world: World, own: Float64, first: Side) -> tuple[float, Peak] | None:
    """Look for the upright edge that ends the face round the corner, be it in one picture alone.

    Parameters
    ----------
    light : (left, right), each (H, W, 3) or (H, W) uint8 or float32, or RawPicture
        Rectified pictures, or their light.
    world : World
    own : (8,) float64
        The box, in the order of `Own`; how far it goes back is not used.
    first : Side
        The face that was followed.

    Returns
    -------
    (depth_mm, Peak) or None
        How far that face goes back, and its end, across from the corner; None where no camera shows the face, or no
        edge stands out clearly.

    Notes
    -----
    A sliver that one camera sees cannot be followed, but its place is known: it goes back from the corner at a right
    angle. Nearer edges are likelier, as ``exp(-x / 20 px)``.
    """
    side = first.other
    boxes = np.repeat(own[None], len(_FAR_MM), axis=0)
    boxes[:, side.extent] = _FAR_MM
    eye = _Eye.of(world, side.end, boxes[len(boxes) // _EARLY], edge_direction(side.end, own, first))
    u = world.pixels(Box(boxes).edge(side.end).mean(axis=1), eye.at.right)[:, 0]
    width = (u - u[0]) * (1 if side is Side.RIGHT else -1)
    if not width[-1] > 2 * _LEAST_REACH_PX:
        return None
    off = np.arange(_LEAST_SLIVER_PX, min(float(width[-1]), _WIDEST_SLIVER_PX), STEP_PX)
    lines = _lines(world, side.end, np.column_stack(
        [np.interp(off, width, _FAR_MM) if k == side.extent else np.full(len(off), own[k]) for k in Own]
    ), off)  # fmt: skip
    peak = None if lines is None else locate_edge(eye.looks_at(light), lines, np.exp(-off / _NEARER_PX), _POWERS)
    if peak is None or peak.is_outermost or peak.contrast < _CLEAR_ALONE:
        return None
    return float(np.interp(peak.position_px, width, _FAR_MM)), peak


@dataclass(frozen=True, eq=False)
class _Eye:
    """How the pictures show an edge: which of them measures it, and which show it at all.

    Attributes
    ----------
    at : EdgeSeen
        Where it is predicted, in the picture in which it moves most.
    step : (8,) float64
        The change of the box's parameters that moves it.
    per_mm : float
        By how much that does across it, px.
    zoom : float
        How much more than in the left picture; 1 where that does not show it.
    shown : (2,) bool
        Left, right: an outer end shows where it moves outwards, and not much less than in the other picture; there the
        face itself is hidden, and another edge shows. So does the upper edge of a face that is seen from below.
    """

    at: EdgeSeen
    step: Float64
    per_mm: float
    zoom: float
    shown: tuple[bool, bool]

    @classmethod
    def of(cls, world: World, edge: Edge, own: Float64, step: Float64) -> _Eye:
        """How the pictures show an edge of a box."""
        ends = Box(np.stack([own, own + step])).edge(edge).reshape(-1, 3)
        pixels = world.pixels(np.concatenate([ends, ends]), np.arange(2 * len(ends)) >= len(ends))
        here, moved = np.moveaxis(pixels.reshape(2, 2, 2, 2), 1, 0)  # (left and right picture, both ends, 2)
        both = [EdgeSeen.through(edge, *line, right=right) for line, right in zip(here, (False, True), strict=True)]
        left, right = (float((b.mean(axis=0) - a.point_px) @ a.across) for a, b in zip(both, moved, strict=True))
        if edge.is_top and not float(world.camera_height) > own[Own.HEIGHT]:  # it is hidden where its face is
            in_left, in_right = (1 if edge is Edge.TOP_RIGHT else -1) * (here[:, 1, 0] - here[:, 0, 0])
            shown = (in_left > _SHOWN * in_right, in_right > _SHOWN * in_left)
            return cls(both[1], step, right, 1.0, shown) if not shown[0] else cls(both[0], step, left, 1.0, shown)
        if edge not in (Edge.RIGHT_END, Edge.LEFT_END):
            return cls(both[0], step, left, 1.0, (True, True))
        outwards = 1 if (edge is Edge.RIGHT_END) == (both[0].across[0] > 0) else -1
        in_left, in_right = outwards * left, outwards * right
        if in_right > _WIDER * max(in_left, 0.0):
            in_both = in_left > _SHOWN * in_right
            return cls(both[1], step, right, in_right / in_left if in_both else 1.0, (in_both, True))
        return cls(both[0], step, left, 1.0, (True, in_right > _SHOWN * in_left))

    def looks_at(self, light: Light) -> Light:
        """The pictures, None for one that does not show it."""
        left, right = light
        return left if self.shown[0] else None, right if self.shown[1] else None


def _lines(world: World, edge: Edge, moved: Float64, off_px: Float64) -> ParallelLines | None:
    """An edge as boxes (lines, 8) in the order of `Own` have it; None where one has it behind the camera."""
    ends = Box(moved).edge(edge)
    ahead = (ends - [0.0, 0.0, float(world.camera_height)]) @ world.axes[:, 2]
    if not (ahead > _LEAST_AHEAD_MM).all():
        return None
    pixels = world.pixels(ends.reshape(-1, 3)).reshape(*ends.shape[:2], 2)
    return ParallelLines(pixels, world.scale / ahead + world.offset, off_px)
