"""One box in both pictures: its faces followed, its edges located, and all that was seen of it."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, replace

import numpy as np

from stereolib.base import Float64
from stereolib.measurement.agreement import Past
from stereolib.measurement.box import Box, Edge, Level, Own, Shared, Side, World
from stereolib.measurement.contradictions import weigh_contradictions
from stereolib.measurement.edges import Peak
from stereolib.measurement.edges_beyond import (
    is_matched_otherwise,
    is_other_beyond,
    matched_beyond,
    other_inside_mm,
    shown_beyond,
    upper_edge_beyond,
    uprights_beyond,
)
from stereolib.measurement.faces import Face, align_surface, find_face
from stereolib.measurement.follow import (
    LEAST_ABOVE_MM,
    Corner,
    End,
    Stretch,
    follow_again,
    follow_face,
    follow_top,
    look_round,
    width_mm,
)
from stereolib.measurement.observations import EdgeSeen, PlaneSeen, weak_priors
from stereolib.measurement.outline import (
    END_PX,
    Expected,
    Found,
    edge_direction,
    find_edge,
    find_far_end,
    level_tops,
    predicted,
    predicted_stds_px,
)
from stereolib.measurement.reasons import Why
from stereolib.measurement.refusals import why_it_is_no_box, why_it_stands_not
from stereolib.measurement.regions import ObjectRegion
from stereolib.measurement.scene_solver import Priors, Seen, Solution, solve
from stereolib.measurement.upright_line import upright_line
from stereolib.measurement.views import Views

_LEAST_MM = 1.0  # of a width
_HIDDEN_MM = 100.0  # what an extent is taken as that nobody sees
_UNLOCATED_PX = 6.0  # how well an edge is known that was not located, at best
_LEAST_PLANE_PX = 20.0  # a second face must be so wide to have a plane of its own, a top so high
_TOP = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 1.0, 1.0]])  # its corners
_ROUGHLY = 1e-2  # tolerance of the first least squares, which only predicts
_ROUNDS = 3  # of edges and least squares: the last one only where the second met a sliver
_PRIOR_PX = (1.0, 4.0)  # how well an edge is taken to be known beforehand, at least and at most
_CORNER_PX = 2.5  # how well a corner is known from looking round it
_LEAST_TOP_PX = 8.0
_MOST_CHANGE = 3.0  # factor between a face's width as it was followed and as its edges have it
_SLANTED = 2.0  # a top, whose rows the picture crowds, is aligned so much worse than its alignment says
_KNOWN = 0.05  # of a face's width: what is known so well is not asked of the top
_FAR_END_PX = 2.0  # how well the end of a sliver is known, at best
_GOES_ON = 6.0  # logarithm of the odds that an upper edge goes on beyond an end, from which on it is none
_GOES_ON_PX = (2.0, 4.0)  # so far beyond an upper edge, or an upright one, what was matched of a face may go on
_GOES_ON_LINES = 7.0  # and lines that both pictures show alike there, from which on it does
_ANYWHERE = 0.25  # of a height that nobody saw end
_AT_MATCHED = Expected(3.0, low_px=-6.0)  # where what was matched ends: SGBM spills over outlines
_TOP_END_PX = 3.0  # how well its end tells that of the face


@dataclass(frozen=True, eq=False)
class Pictured:
    """A box as the pair sees it.

    Attributes
    ----------
    seen : Seen
        What goes into the least squares of the whole scene.
    solution : Solution
        Of this pair's pictures alone, with this box alone.
    past : dict
        What is where its faces end, by edge; edges that nobody sees are not in it.
    first : Side
        The face that is known best.
    faces : tuple of Face
        That one, and the other if it was aligned too.
    refused : Why or None
        Why it is no upright box on the floor.
    doubtful : frozenset of Edge
        Edges that contradict the others, whichever is left out.
    doubt : (8, 8) float64
        Covariance of its parameters besides the solution's: nobody knows which of two edges is mistaken.
    """

    seen: Seen
    solution: Solution
    past: dict[Edge, Past]
    first: Side
    faces: tuple[Face, ...]
    refused: Why | None
    doubtful: frozenset[Edge]
    doubt: Float64

    @property
    def own(self) -> Float64:
        """Its parameters, in the order of `Own`. (8,)."""
        return self.solution.boxes[0]

    @property
    def edges(self) -> dict[Edge, EdgeSeen]:
        """Those that were located in the pictures."""
        return {o.edge: o for o in self.seen.observations if isinstance(o, EdgeSeen) and o.located}


def see_box(views: Views, priors: Priors, region: ObjectRegion) -> Pictured:
    """Find one box in both pictures.

    Parameters
    ----------
    views : Views
    priors : Priors
    region : ObjectRegion
        Where the disparity map shows it.

    Returns
    -------
    Pictured

    Raises
    ------
    CannotMeasure
        "no texture", if no face was matched.

    Notes
    -----
    The best face is aligned, and followed over both pictures to its ends, up and down. Round either end a second face
    at a right angle is looked for: its place is predicted, so that a sliver is enough. Then its edges are located in
    turn with the least squares that says how well each is known beforehand: before the second turn the second face is
    followed again from where it is now known to stand, or, if only one camera sees it, looked for by its far edge; a
    third turn is for that one. A face ends no nearer than its upper edge, which goes straight on beyond printed lines,
    nor than where disparity map and pictures show it beyond them; both upper edges have one height. Where all is plain
    from a face to the picture's rim, it ends where another colour begins, else it is cut there.
    """
    world = priors.world(np.zeros(len(Shared)))
    face = find_face(priors.floor, region, views.pair)
    stretch = follow_face(views, world, face, region.top_mm)
    rough = _rough_box(stretch, *(look_round(views, world, stretch, outwards) for outwards in (1, -1)))
    faces = [face]
    if rough.second_px >= _LEAST_PLANE_PX:
        faces += align_surface(views.pair, world, rough.own, rough.first.other)
    tops = list[PlaneSeen]()
    peaks, solution, stds, anew = dict[Edge, Peak](), None, dict[Edge, float](), dict[Edge, Expected]()
    followed, before = {at.edge: at for at in rough.edges(world, (), {})}, set[Edge]()
    for turn in range(_ROUNDS):
        if turn == _ROUNDS - 1 and not any(edge.is_top for edge in set(rough.open) - before):
            break
        before = set(rough.open)
        if solution is not None:  # the height is known now
            world = priors.world(solution.shared)
            rough, anew = _seen_again(views, world, stretch, rough.solved(solution.boxes[0]), peaks)
            rough, matched = _as_far_as_matched(views, world, region, rough)
            rough, higher = _as_high_as_its_ends(views, world, rough)
            rough, raised = _with_top(views, world, rough, np.sqrt(np.diag(solution.covariance))[len(Shared) :])
            tops = _top_plane(views, world, rough)
            rough, farther = _as_far_as_its_top(views, world, rough)
            anew = anew | matched | higher | raised | farther
            peaks = {edge: peak for edge, peak in peaks.items() if edge not in anew}
            stds = predicted_stds_px(rough.open, rough.first, priors, *solution.at(rough.own).of_box(0))
        found = _located(views, world, rough, peaks, rough.expected(peaks, stds) | anew)
        rough, found = _cut_without_outline(views, world, rough, found)
        lost, located = rough.edges(world, found, peaks), [each.seen for each in found.values()]
        peaks = {edge: each.peak for edge, each in found.items()}
        known = [*rough.planes(faces), *tops, *weak_priors(rough.own, priors.laser.bias_mm), *lost]
        seen = Seen(rough.own + _move(found), (*known, *located))
        if solution is None:
            solution = solve(priors, [seen], tolerance=_ROUGHLY)
        else:
            solution = solve(priors, [replace(seen, shared=solution.shared)])
    assert solution is not None
    seen = replace(seen, start=solution.boxes[0], shared=solution.shared)  # near what all boxes together will have
    tilts = [upright_line(world, face, 0.0)[1:] for face in faces]
    refused = why_it_stands_not(views, world, stretch, solution.boxes[0], rough.open)
    refused = refused or why_it_is_no_box(stretch, tilts, rough.open, peaks, solution)
    doubtful, doubt = weigh_contradictions(priors, seen, solution, followed)
    doubt = doubt + _doubt_of_lines(views, priors.world(solution.shared), region, rough, solution.boxes[0])
    doubtful |= {side.end for side in Side if solution.boxes[0][side.extent] < _LEAST_MM}  # none is narrower
    return Pictured(seen, solution, rough.past, rough.first, tuple(faces), refused, doubtful, doubt)


@dataclass(frozen=True, eq=False)
class _Rough:
    """A box as its faces were followed."""

    own: Float64
    first: Side
    ends: dict[Edge, End]
    second_px: float

    def solved(self, own: Float64) -> _Rough:
        """With a solution's parameters, but for extents that are nowhere near those that were followed."""
        extents = [side.extent for side in Side]
        share = own[extents] / self.own[extents]
        kept = own.copy()
        kept[extents] = np.where((share > 1 / _MOST_CHANGE) & (share < _MOST_CHANGE), own[extents], self.own[extents])
        return replace(self, own=kept)

    def expected(self, before: Container[Edge], stds_px: dict[Edge, float]) -> dict[Edge, Expected]:
        """Where its edges are expected: near where they were located before, else where following ended."""
        found = dict[Edge, Expected]()
        for edge in self.open:
            std, end = float(np.clip(stds_px.get(edge, _CORNER_PX), *_PRIOR_PX)), self.ends[edge]
            is_new = edge not in before and end.inside_px > 0
            found[edge] = _expected(end) if is_new else Expected(std)
        return found

    def planes(self, faces: list[Face]) -> list[PlaneSeen]:
        """Its faces as they were aligned."""
        return [PlaneSeen.of(face, side) for face, side in zip(faces, (self.first, self.first.other), strict=False)]

    @property
    def past(self) -> dict[Edge, Past]:
        """What is where its faces end."""
        return {edge: end.past for edge, end in self.ends.items()}

    @property
    def open(self) -> list[Edge]:
        """Edges that the pictures show."""
        return [edge for edge, end in self.ends.items() if end.past is Past.OPEN]

    def edges(self, world: World, found: Container[Edge], before: dict[Edge, Peak]) -> list[EdgeSeen]:
        """Edges that were not found, as they are known from the following alone, or from where they were before."""
        seen = list[EdgeSeen]()
        for edge in (edge for edge in self.open if edge not in found):
            end, was = self.ends[edge], before.get(edge)
            std = max(end.std_px, end.spread_px, _UNLOCATED_PX, was.std_px if was else 0.0)
            seen.append(EdgeSeen.near(predicted(edge, world, self.own), std))
        return seen


def _rough_box(stretch: Stretch, left: Corner | None, right: Corner | None) -> _Rough:
    """Put the corner where the wider second face is; without one, where the face's end is seen."""
    line = stretch.line
    at_left = left is not None and (right is None or left.width_px > right.width_px)
    corner = left if at_left else right
    if corner is None:
        at_left = stretch.left.is_sure or not stretch.right.is_sure
    inner, outer = (stretch.left, stretch.right) if at_left else (stretch.right, stretch.left)
    first = Side.RIGHT if at_left else Side.LEFT
    t = corner.t if corner else inner.at
    place, own = line.at(t), np.zeros(len(Own))
    turn = float(np.arctan2(line.normal[1], line.normal[0])) + (0.0 if first is Side.RIGHT else np.pi / 2)
    own[[Own.X, Own.Y, Own.TURN, Own.HEIGHT]] = *place, turn, stretch.high.at
    width = max(float(np.linalg.norm(line.at(outer.at) - place)), _LEAST_MM)
    own[[first.extent, first.other.extent]] = width, _HIDDEN_MM
    ends = {first.end: outer, Edge.CORNER: inner, first.top: stretch.high}
    if corner:
        own[first.other.extent] = corner.depth_mm
        at = End(t, Past.OPEN, _CORNER_PX, _CORNER_PX + corner.plain_px)
        ends |= {first.other.end: corner.end, Edge.CORNER: at, first.other.top: stretch.high}
    return _Rough(own, first, ends, corner.width_px if corner else 0.0)


def _seen_again(
    views: Views, world: World, stretch: Stretch, rough: _Rough, located: Container[Edge]
) -> tuple[_Rough, dict[Edge, Expected]]:
    """Look at the second face again, now that its place is known; and which edges are to be located anew."""
    side = rough.first.other
    if side.end not in rough.ends:
        from_above = _top_px(world, rough.own) > _LEAST_TOP_PX  # its back edge tells more than a sliver's end
        return (rough, {}) if from_above else _with_far_end(views, world, stretch, rough)
    end = follow_again(views, world, rough.own, side) if side.end in rough.open else None
    if end is None or end.past is not Past.OPEN:
        return rough, {}
    beyond_px = _beyond_px(world, rough.own, side.end, end)
    if not end.overlaps(rough.ends[side.end], float(world.focal)):
        if beyond_px < 0:
            return rough, {}
        own = rough.own.copy()
        own[side.extent] = max(width_mm(rough.own, side, end.at), _LEAST_MM)
        return replace(rough, own=own, ends=rough.ends | {side.end: end}), {side.end: _expected(end)}
    return rough, {side.end: _expected(end, beyond_px, was_located=side.end in located)}


def _expected(end: End, beyond_px: float = 0.0, *, was_located: bool = False) -> Expected:
    """Where an edge is expected, of a face that was followed to an end, if the model has it so far beyond that."""
    low, high = -end.inside_px - beyond_px, end.outside_px - beyond_px
    return Expected(END_PX, low, high, end.inside_px - beyond_px, was_located)


def _beyond_px(world: World, own: Float64, edge: Edge, end: End) -> float:
    """How far a box has an edge beyond where its face was followed to."""
    place = Box(own).edge(edge)
    if not edge.is_top:
        x, y = place[0, :2]
        return float((y / x - end.at) * world.focal * (1 if edge is Edge.LEFT_END else -1))
    x, y, high_mm = place.mean(axis=0)
    (_, followed), (_, at) = world.pixels(np.array([[x, y, end.at], [x, y, high_mm]]))
    return float(followed - at)


def _top_px(world: World, own: Float64) -> float:
    """Height in the picture of a top that goes back by 100 mm; 0 where the camera stands below it."""
    ahead = own[[Own.X, Own.Y]] * np.array([[1.0], [1.0 + _HIDDEN_MM / np.hypot(*own[[Own.X, Own.Y]])]])
    (_, front), (_, back) = world.pixels(np.column_stack([ahead, np.full(2, own[Own.HEIGHT])]))
    return max(float(front - back), 0.0)


def _with_far_end(views: Views, world: World, stretch: Stretch, rough: _Rough) -> tuple[_Rough, dict[Edge, Expected]]:
    """Look round either end of the first face for the end of a second one that could not be followed."""
    box, first = Box(rough.own), rough.first
    rooted = {first: box, first.other: box.from_other_end(first)}
    ends = {Side.RIGHT: stretch.left, Side.LEFT: stretch.right}
    found = {
        side: got
        for side, at in rooted.items()
        if (Edge.CORNER if side is first else first.end) in rough.open
        and (got := find_far_end(views.pair.pictures, world, at.own, side))
    }
    if not found:
        return rough, {}
    side = max(found, key=lambda side: found[side][1].contrast)
    own = rooted[side].own.copy()
    own[side.other.extent] = found[side][0]
    if side is not first:  # what was the corner is an end, and looked for anew from where the face was followed to
        followed_to = stretch.line.at(ends[side.other].at)
        own[side.extent] = max(float(np.linalg.norm(followed_to - own[[Own.X, Own.Y]])), _LEAST_MM)
    shown = {side.end: ends[side.other], Edge.CORNER: ends[side], side.top: stretch.high}
    far_px = max(_FAR_END_PX, found[side][1].std_px)
    shown[side.other.end] = End(np.nan, Past.OPEN, far_px, far_px, far_px)
    # Its slope tells how far a sliver goes back better than its width; where nobody sees a top, none is looked for.
    shown[side.other.top] = End(np.nan, stretch.high.past)
    again = replace(rough, own=own, first=side, ends=shown)
    return again, {} if side is first else again.expected((), {})


def _with_top(views: Views, world: World, rough: _Rough, own_std: Float64) -> tuple[_Rough, dict[Edge, Expected]]:
    """Add the back edges of a top face that the camera looks down on; they tell a depth that no face shows.

    Where a top was followed, its height is that at which the pictures agree about it: there its edges are looked for.
    """
    own, ends, raised = rough.own.copy(), dict(rough.ends), dict[Edge, Expected]()
    is_open = any(end.past is Past.OPEN for edge, end in ends.items() if edge.is_top)
    if not is_open or float(world.camera_height) - own[Own.HEIGHT] < LEAST_ABOVE_MM:
        return rough, raised
    std = float(own_std[Own.HEIGHT])
    for side in Side:
        depth = side.other
        if depth.end in rough.open and own_std[depth.extent] < _KNOWN * own[depth.extent]:
            ends[side.back] = End(0.0, Past.OPEN)
        elif side.end in ends and (top := follow_top(views, world, own, side, std)) is not None:
            if top[0] != own[Own.HEIGHT]:
                raised |= {edge: Expected(END_PX) for edge in rough.open if edge.is_top}
            own[Own.HEIGHT], ends[side.back] = top
            own[depth.extent], std = ends[side.back].at, 0.0  # from the other face it has the same height
    return replace(rough, own=own, ends=ends), raised


def _top_plane(views: Views, world: World, rough: _Rough) -> list[PlaneSeen]:
    """The top as both pictures show it, where the camera looks down on it and its ends were seen."""
    is_known = all(side.end in rough.open or side.other.back in rough.open for side in Side)
    is_seen = any(edge.is_back for edge in rough.open)
    if not (is_known and is_seen) or np.ptp(world.pixels(Box(rough.own).points(_TOP))[:, 1]) < _LEAST_PLANE_PX:
        return []
    tops = align_surface(views.pair, world, rough.own, Level.TOP)
    return [PlaneSeen.of(replace(top, plane_covariance=_SLANTED**2 * top.plane_covariance), Level.TOP) for top in tops]


def _goes_on(
    views: Views, world: World, region: ObjectRegion, rough: _Rough, own: Float64
) -> list[tuple[Side, Edge, float]]:
    """Edges beyond which both disparity map and pictures go on with their face, and by how much it is larger so, mm."""
    found = list[tuple[Side, Edge, float]]()
    for side in (each for each in Side if each.end in rough.ends):
        edges = [edge for edge in (Edge.CORNER, side.end, side.top) if edge in rough.open]
        beyond = matched_beyond(region, world, own, side, edges)
        matched = [(edge, more_mm) for edge, (px, more_mm) in beyond.items() if px > _GOES_ON_PX[edge.upright]]
        for edge, more_mm in matched:
            is_face = not is_other_beyond(views, world, own, side, edge)  # what stands beside it may be as far away
            if is_face and shown_beyond(views, world, own, side, edge, more_mm) >= _GOES_ON_LINES:
                found.append((side, edge, more_mm))
    return found


def _as_far_as_matched(
    views: Views, world: World, region: ObjectRegion, rough: _Rough
) -> tuple[_Rough, dict[Edge, Expected]]:
    """Faces that were matched beyond their edges: those were lines on them, they end where what was matched does.

    Or in what is left of a plain part, over which they could not be followed: it shows no match either.
    """
    own, expected = rough.own.copy(), dict[Edge, Expected]()
    for side, edge, more_mm in _goes_on(views, world, region, rough, rough.own):
        if edge is side.end:
            own[side.extent] = rough.own[side.extent] + more_mm
            expected[edge] = _AT_MATCHED
        elif edge.is_top:
            own[Own.HEIGHT] = max(own[Own.HEIGHT], rough.own[Own.HEIGHT] + more_mm)
            expected |= {top: _AT_MATCHED for top in rough.open if top.is_top}
    for edge, at in expected.items():
        plain_px = rough.ends[edge].outside_px - _beyond_px(world, own, edge, rough.ends[edge])
        expected[edge] = replace(at, high_px=max(0.0, plain_px))  # 0 where it was not followed: NaN is no maximum
    return replace(rough, own=own), expected


def _doubt_of_lines(views: Views, world: World, region: ObjectRegion, rough: _Rough, own: Float64) -> Float64:
    """Covariance of a box's parameters for edges that may be lines on it, or on what stands beside it: (8, 8).

    Its faces may go on to where they were matched, and end where, before their end, another colour begins. And they may
    go on to anywhere above upper edges that have their own colour there, where that is not the top's, on which the
    camera looks down.
    """
    beyond = _goes_on(views, world, region, rough, own)
    inside = [(side, side.end, other_inside_mm(views, world, own, side)) for side in Side if side.end in rough.open]
    moves = [mm * edge_direction(edge, own, side) for side, edge, mm in (*beyond, *inside) if mm > 0]
    tops = [side for side in Side if side.top in rough.open and not _looks_down(world, own)]
    if tops and not any(is_other_beyond(views, world, own, side, side.top) for side in tops):
        moves.append(_ANYWHERE * own[Own.HEIGHT] * edge_direction(tops[0].top, own, tops[0]))
    return np.sum([np.outer(move, move) for move in moves], axis=0) if moves else np.zeros((len(Own), len(Own)))


def _cut_without_outline(
    views: Views, world: World, rough: _Rough, found: dict[Edge, Found]
) -> tuple[_Rough, dict[Edge, Found]]:
    """A face that is plain up to the picture's rim is cut there, unless the colour beyond an edge is another."""
    ends = dict(rough.ends)
    for edges in ([Edge.TOP_RIGHT, Edge.TOP_LEFT], [Edge.CORNER], [Edge.RIGHT_END], [Edge.LEFT_END]):
        shown = [edge for edge in edges if edge in rough.open]
        unsure = [edge for edge in shown if ends[edge].may_be_cut]
        is_cut = any(ends[edge].past is Past.CUT for edge in edges if edge in ends)  # both have one height
        is_seen = any(_is_outline(views, world, rough, found[edge], edge) for edge in unsure if edge in found)
        if shown and (is_cut or (unsure and not is_seen)):
            ends |= {edge: replace(ends[edge], past=Past.CUT) for edge in shown}
    rough = replace(rough, ends=ends)
    return rough, {edge: each for edge, each in found.items() if edge in rough.open}


def _is_outline(views: Views, world: World, rough: _Rough, found: Found, edge: Edge) -> bool:
    """Beyond an edge, where it was found, is another colour than on its face, or the top."""
    sides, own = {side.top: side for side in Side} | {side.end: side for side in Side}, rough.own + found.move
    if edge.is_top and _looks_down(world, own):
        return True
    return is_other_beyond(views, world, own, sides.get(edge, rough.first), edge)


def _looks_down(world: World, own: Float64) -> bool:
    """The camera sees the top: that is what lies above an upper edge in the picture, of the same colour."""
    return float(world.camera_height) > float(own[Own.HEIGHT])


def _as_high_as_its_ends(views: Views, world: World, rough: _Rough) -> tuple[_Rough, dict[Edge, Expected]]:
    """A box whose upright ends go straight on beyond its upper edge: that was a line on it, it ends where they do.

    So do the edges of a top that the camera looks down on: there the faces themselves must go on.
    """
    tops = [side for side in Side if side.top in rough.open]
    ends = [side.end for side in Side if side.end in rough.open]
    found = uprights_beyond(views.pair.pictures, world, rough.own, ends) if tops else None
    if found is None or found[1] < _GOES_ON:
        return rough, {}
    more_mm = found[0] - float(rough.own[Own.HEIGHT])
    if sum(shown_beyond(views, world, rough.own, side, side.top, more_mm) for side in tops) < 0:
        return rough, {}
    own = rough.own.copy()
    own[Own.HEIGHT] = found[0]
    return replace(rough, own=own), {side.top: Expected(_TOP_END_PX) for side in tops}


def _as_far_as_its_top(views: Views, world: World, rough: _Rough) -> tuple[_Rough, dict[Edge, Expected]]:
    """Faces whose upper edge goes straight on beyond their end: that was a line on them, they end where it does."""
    own, expected = rough.own.copy(), dict[Edge, Expected]()
    for side in Side:
        if side.end in rough.open:
            found = upper_edge_beyond(views.pair.pictures, world, rough.own, side)
            if found is None or found[1] < _GOES_ON or is_matched_otherwise(views, world, own, side, found[0]):
                continue
            own[side.extent], expected[side.end] = found[0], Expected(_TOP_END_PX)
    return replace(rough, own=own), expected


def _move(found: dict[Edge, Found]) -> Float64:
    """By what a box's parameters change to meet the edges that were found, about."""
    total, counts = np.zeros(len(Own)), np.zeros(len(Own))
    for each in found.values():
        total += each.move
        counts += each.move != 0
    return total / np.maximum(np.where(np.isin(np.arange(len(Own)), (Own.X, Own.Y)), 1, counts), 1)


def _located(
    views: Views, world: World, rough: _Rough, before: dict[Edge, Peak], expected: dict[Edge, Expected]
) -> dict[Edge, Found]:
    """Edges found in the pictures where they are expected; the rivals that some had before remain."""
    found = dict[Edge, Found]()
    for edge in rough.open:
        got = find_edge(views, world, rough.own, edge, rough.first, expected[edge])
        if got is not None:
            wider = before[edge].rivals_px if edge in before else 0.0
            found[edge] = got.besides(max(got.peak.rivals_px, wider))
    before_px = {edge: peak.rivals_px for edge, peak in before.items()}
    return level_tops(views, world, rough.own, rough.first, found, before_px)
