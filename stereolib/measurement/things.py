"""Objects as pictures and scan show them, paired: before and after the least squares of the whole scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from stereolib.base import Float64, direction
from stereolib.laser import Footprint, LaserScan, find_segments, fit_footprint
from stereolib.measurement.agreement import Past
from stereolib.measurement.box import Box, Edge, Own, Shared, Side
from stereolib.measurement.contradictions import sharp_edges, weigh_ends
from stereolib.measurement.floor import Floor
from stereolib.measurement.hypotheses import Judged, judge
from stereolib.measurement.measured_object import BoxFacts, MeasuredObject, from_box, from_region, from_scan
from stereolib.measurement.one_place import without_shared_places
from stereolib.measurement.pairing import Place, pair_up
from stereolib.measurement.pictured import Pictured
from stereolib.measurement.plane_alignment import CannotMeasure
from stereolib.measurement.reasons import NOT_STANDING, Reason, ScanFit, Source, Why
from stereolib.measurement.regions import OBJECTS_WITHIN_MM, ObjectRegion
from stereolib.measurement.scanned import is_seen_through, is_wall, reads_otherwise, scan_observations, scanned_box
from stereolib.measurement.scene_solver import COMMON_ERRORS, Priors, Seen, Solution
from stereolib.measurement.standing import Standing

#: No reading of a scan. (0, 2).
NOWHERE = np.zeros((0, 2))
#: How far the laser tells objects (`stereolib.laser.find_segments`), m.
SCAN_REACH_M = 3
_FEW_BEAMS = 6  # so few tell no round or irregular outline from faces
_SHOWN = 0.5  # share of a footprint that the right camera must show
_LEAST_BEAMS = 2  # in the left picture: one may be a neighbour's
_MOST_TURNED_PX = 3.0  # of what a turn of the cameras shifts: beyond it, scan and pair have two scales
_CONTRADICTION = 2.2  # standard deviations, as `Solution.misfits` counts: an end lies within 1.6 of its two beams
_FAR_WIDER = 1.5  # times as wide, as seen from the rig
_FOLLOWED = 0.9  # share of what was followed of a face that is surely its own


def scanned_parts(scan: LaserScan, bias_mm: float) -> tuple[list[Footprint], Float64, str]:
    """Tell the objects in a scan from all else.

    Parameters
    ----------
    scan : LaserScan
    bias_mm : float
        Standard deviation of the error that all readings on one face share.

    Returns
    -------
    objects : list of Footprint
    others_mm : (N, 2) float64
        Its other readings.
    warning : str
        What to say if there is no object.
    """
    try:
        parts = find_segments(scan)
    except ValueError as error:
        return [], NOWHERE, f"the scan tells nothing, sizes come from the pair alone: {error}"
    found = [fit_footprint(part, bias_mm=bias_mm) for part in parts if part.kind == "object"]
    walls = [part.points_mm for part in parts if part.kind != "object"]
    none = f"the scan shows no object within {SCAN_REACH_M} m: sizes come from the pair alone"
    return found, np.concatenate([NOWHERE, *walls]), "" if found else none


@dataclass(frozen=True, eq=False)
class Thing:
    """One object before the least squares: what pictures and scan show of it, and why the pictures show no box.

    Where both disagree, the scan is left out; it may show something else where the box stands. Pieces are what the
    pictures show within its outline in the scan.
    """

    pictured: Pictured | None = None
    region: ObjectRegion | None = None
    footprint: Footprint | None = None
    why: Why | None = None
    seen: Seen | None = None
    scanned: bool = False
    disagrees: bool = False
    otherwise: bool = False
    pieces: tuple[Thing, ...] = ()

    @property
    def is_box(self) -> bool:
        """The pictures alone show a box."""
        return self.pictured is not None and self.seen is not None

    @property
    def is_round(self) -> bool:
        """Its outline in the scan is no box's: round, or of no shape where the pictures show none either."""
        if self.footprint is None or len(self.footprint.segment.points_mm) <= _FEW_BEAMS:
            return False
        shows_box = self.seen is not None and self.pictured is not None
        return self.footprint.shape == "circle" or (self.footprint.shape == "irregular" and not shows_box)


@dataclass(frozen=True, eq=False)
class Scene:
    """What all objects of one pair and one scan share."""

    standing: Standing
    scan_has_objects: bool
    walls_mm: Float64
    readings_mm: Float64

    @property
    def priors(self) -> Priors:
        return self.standing.priors

    def things(self, footprints: list[Footprint]) -> tuple[list[Thing], Sequence[str]]:
        """Objects as pictures and scan show them, paired; and what does not fit together."""
        every = [_pictured(*seen) for seen in zip(self.standing.regions, self.standing.boxes, strict=True)]
        objects_mm = [self.priors.laser.points_mm(each.segment.points_mm) for each in footprints]
        alone = [thing for thing in every if not self._of_a_wall(thing, np.concatenate([NOWHERE, *objects_mm]))]
        places, boxes = [_place(thing, self.priors.floor) for thing in alone], [thing.is_box for thing in alone]
        pairs = pair_up(places, footprints, self.priors.laser, boxes=boxes)
        pieces = {j: tuple(alone[i] for i, whole in pairs.pieces if whole == j) for _, j in pairs.both}
        both = [self._with_scan(replace(alone[i], pieces=pieces[j]), footprints[j]) for i, j in pairs.both]
        rest = [self._scanned(Thing(footprint=footprints[j])) for j in pairs.scanned]
        return [*both, *(self._without_scan(alone[i]) for i in pairs.pictured), *rest], pairs.warnings

    def _without_scan(self, thing: Thing) -> Thing:
        """One that the pictures alone show, and whether the scan shows something else there."""
        if not thing.is_box or thing.pictured is None:
            return thing
        return replace(thing, otherwise=self._reads_otherwise(thing.pictured))

    def _reads_otherwise(self, pictured: Pictured) -> bool:
        height_mm = float(pictured.own[Own.HEIGHT])
        return reads_otherwise(_ends_mm(pictured), height_mm, self.priors.laser, self.readings_mm)

    def _of_a_wall(self, thing: Thing, objects_mm: Float64) -> bool:
        """Whether the scan has a wall where the pictures show nothing that surely stands."""
        unclear = thing.why is not None and thing.why.reason in (Reason.NO_TEXTURE, Reason.NO_EDGE, *NOT_STANDING)
        return (
            unclear and thing.region is not None and is_wall(thing.region, self.priors.floor, self.walls_mm, objects_mm)
        )

    def _with_scan(self, thing: Thing, footprint: Footprint) -> Thing:
        thing = replace(thing, footprint=footprint)
        if thing.seen is None or thing.pictured is None:
            return thing if thing.why and thing.why.reason in NOT_STANDING else self._scanned(thing)
        if thing.is_round:
            return thing
        readings = scan_observations(footprint, self.priors.laser, float(thing.pictured.own[Own.TURN]))
        seen = replace(thing.seen, observations=(*thing.seen.observations, *readings))
        return replace(thing, seen=seen, scanned=bool(readings))

    def _scanned(self, thing: Thing) -> Thing:
        assert thing.footprint is not None
        seen = None if thing.is_round else scanned_box(thing.footprint, self.priors.laser)
        why = thing.why or _why_unseen(thing.footprint, self.standing)
        return replace(thing, seen=seen, why=why, scanned=seen is not None, pictured=None)

    def solved(self, things: list[Thing]) -> tuple[Judged, list[Thing]]:
        """The least squares, without the scan of what contradicts the pair; what were its pieces stand alone then."""
        judged, kept = self._judged(things), list[Thing]()
        numbers = _numbers(things)
        for thing in things:
            k = numbers.get(id(thing))
            if k is None or thing.seen is None or thing.pictured is None or not thing.scanned:
                kept.append(thing)
                continue
            scanned = not _contradicts(thing.pictured, thing.seen, judged.solution, k)
            agree = tuple(o for o in thing.seen.observations if scanned or not o.of_scan)
            start = judged.solution.at(judged.solution.boxes[k]) if scanned else thing.pictured.solution
            seen = Seen(start.boxes[0], agree, start.shared)  # not from where a scan of another place led it
            pictured = thing.pictured if scanned else _doubted(self.priors, thing.pictured, thing.seen)
            kept.append(replace(thing, pictured=pictured, seen=seen, scanned=scanned, disagrees=not scanned))
        count = [len(t.seen.observations) if t.seen else 0 for t in things]
        changed = count != [len(t.seen.observations) if t.seen else 0 for t in kept]
        alone = [self._without_scan(piece) for t in kept if not (t.scanned or t.is_round) for piece in t.pieces]
        if alone:
            return self._judged([*kept, *alone]), [*kept, *alone]
        return (self._judged(kept) if changed else judged), kept if changed else things

    def without_phantoms(self, judged: Judged, things: list[Thing], fit: ScanFit) -> tuple[Judged, list[Thing]]:
        """Leave out what the scan alone shows where it opposes the pictures: it is of another place.

        Of a laser that was calibrated it must disagree about several things, show something else where one stands, or
        one that both cameras should see and do not: one thing may have been moved.
        """
        kept = [thing for thing in things if thing.region is not None]
        elsewhere = any(thing.otherwise or _should_be_seen(thing) for thing in things)
        is_placed = self.standing.instrument.lidar is not None
        moved_one = is_placed and sum(thing.disagrees for thing in things) == 1 and not elsewhere
        if fit is not ScanFit.OPPOSES or moved_one or len(kept) == len(things):
            return judged, things
        return self._judged(kept), kept

    def _judged(self, things: list[Thing]) -> Judged:
        both = any(thing.scanned and thing.pictured for thing in things)
        return judge(self.priors, [thing.seen for thing in things if thing.seen], scanned=both)

    def measured(self, judged: Judged, things: list[Thing]) -> list[MeasuredObject]:
        """Make the measured objects."""
        numbers = _numbers(things)
        every = [self._measured(judged.solution, thing, numbers.get(id(thing))) for thing in things]
        told = [replace(found, disagrees=thing.disagrees) for found, thing in zip(every, things, strict=True)]
        return without_shared_places(told)

    def _measured(self, solution: Solution, thing: Thing, number: int | None) -> MeasuredObject:
        facts = self._facts(thing, number)
        if number is not None and not thing.is_round:
            return self._as_scan_allows(thing, from_box(solution, number, facts))
        height, common = (np.nan, np.nan), np.zeros(COMMON_ERRORS)
        if number is not None:
            box = from_box(solution, number, facts)
            height, common = (float(box.size_mm[2]), float(box.std_mm[2])), box.common_mm[2]
        if thing.footprint is not None and (thing.why is None or thing.why.reason not in NOT_STANDING):
            found = from_scan(thing.footprint, solution.on_floor(self.priors.laser), height, facts.reasons)
        else:
            assert thing.region is not None
            found = from_region(thing.region, facts.reasons)
        return replace(found, common_mm=np.vstack([found.common_mm[:2], common]))

    def _as_scan_allows(self, thing: Thing, found: MeasuredObject) -> MeasuredObject:
        """A box without its outline, where beams go through a face: the pictures showed two things as one."""
        corners, ends = found.outline_mm, {"box": ((0, 1), (0, 3)), "face": ((0, 1),)}.get(found.shape, ())
        faces = [corners[list(pair)] for pair in ends] if thing.disagrees else []
        if any(is_seen_through(face, self.priors.laser, self.readings_mm) for face in faces):
            sizes = " x ".join(f"{size:.0f}" for size in found.size_mm[:2] if np.isfinite(size))
            return found.without_outline(Why(Reason.OTHER_IN_SCAN, f"{sizes} mm, but beams go through it"))
        return self._without_doubtful_width(thing, found)

    def _without_doubtful_width(self, thing: Thing, found: MeasuredObject) -> MeasuredObject:
        """A lone face without its width, where the scan shows no straight one there, or one thing far wider.

        Lines of a print, or ends of two things, may have been taken for its ends.
        """
        if found.shape != "face" or "width" in found.reasons or thing.footprint is None or thing.pictured is None:
            return found
        readings = self.priors.laser.points_mm(thing.footprint.segment.points_mm)
        shows_none = Why(Reason.SCAN_IRREGULAR) in found.reasons.values()
        if not (shows_none or (thing.disagrees and self._is_far_wider(readings, thing, thing.pictured))):
            return found
        ends_mm = float(np.hypot(*(readings[-1] - readings[0])))
        shown = "no straight face" if shows_none else f"{ends_mm:.0f} mm from end to end"
        return found.without("width", Why(Reason.OTHER_IN_SCAN, f"{found.size_mm[1]:.0f} mm, in the scan {shown}"))

    def _is_far_wider(self, readings_mm: Float64, thing: Thing, pictured: Pictured) -> bool:
        """Whether the scan shows one thing far wider than what the pictures do, no side of which has two sharp ends."""
        if any(piece.is_box for piece in thing.pieces) or self._reads_otherwise(pictured):
            return False
        wider = Place.of(readings_mm).span_rad > _FAR_WIDER * Place.of(_ends_mm(pictured)).span_rad
        return wider and not any({Edge.CORNER, side.end} <= sharp_edges(pictured.seen) for side in Side)

    def _facts(self, thing: Thing, number: int | None) -> BoxFacts:
        """What is told of an object besides its sizes."""
        reasons, pictured = dict[str, Why](), thing.pictured
        if thing.why is not None:
            reasons["object" if thing.why.reason in NOT_STANDING else "height"] = thing.why
        elif thing.footprint is None and self.scan_has_objects:
            reasons["object"] = Why(Reason.OTHERWISE_IN_SCAN if thing.otherwise else Reason.NOT_IN_SCAN)
        elif thing.footprint is not None and thing.footprint.shape == "irregular" and number is not None:
            reasons["object"] = Why(Reason.SCAN_IRREGULAR)
        if number is None:
            return BoxFacts(reasons=reasons)
        if pictured is None:
            return BoxFacts(sources={"lines": Source.SCAN}, reasons=reasons)
        sources = {"lines": Source.BOTH if thing.scanned else Source.IMAGE, "height": Source.IMAGE}
        for name, edge in (("right end", Edge.RIGHT_END), ("left end", Edge.LEFT_END)):
            shown = pictured.past.get(edge, pictured.past.get(Edge.CORNER))
            sources[name] = Source.IMAGE if shown is Past.OPEN or not thing.scanned else Source.SCAN
        return BoxFacts(pictured.past, sources, reasons, pictured.doubtful, pictured.doubt)


def _pictured(region: ObjectRegion, box: Pictured | CannotMeasure) -> Thing:
    if isinstance(box, CannotMeasure):
        return Thing(region=region, why=Why(Reason.NO_TEXTURE))
    return Thing(box, region, why=box.refused, seen=None if box.refused else box.seen)


def scan_fit(things: list[Thing], *, is_placed: bool) -> ScanFit:
    """Whether a scan is of what the pictures show; what stands beside them, or behind plain faces, tells nothing.

    A lone thing where it shows something else may have been moved. But the scan of a laser that nobody calibrated has
    its place from what it shows of the pictures' things alone: where it has others only, nobody knows what it is of.

    Parameters
    ----------
    things : list of Thing
        As the least squares left them.
    is_placed : bool
        The laser was calibrated.

    Returns
    -------
    ScanFit
    """
    if any(thing.scanned and thing.pictured for thing in things):
        return ScanFit.AGREES
    boxes = [thing for thing in things if thing.is_box]
    opposed = bool(boxes) and any(thing.disagrees or _should_be_seen(thing) for thing in things)
    opposed |= len(boxes) > 1 and any(thing.otherwise for thing in boxes)
    opposed |= not is_placed and bool(boxes) and any(thing.footprint is not None for thing in things)
    return ScanFit.OPPOSES if opposed else ScanFit.UNTOLD


def _should_be_seen(thing: Thing) -> bool:
    """The scan alone shows it, and both cameras should."""
    return thing.region is None and thing.why is not None and thing.why.reason is Reason.NO_TEXTURE


def _numbers(things: list[Thing]) -> dict[int, int]:
    """Numbers in the least squares, by the things' identities."""
    return {id(thing): k for k, thing in enumerate(thing for thing in things if thing.seen)}


def _contradicts(pictured: Pictured, seen: Seen, solution: Solution, number: int) -> bool:
    """The scan's readings or ends miss the box, or it ends a face that the pictures followed farther.

    Or they agree only if the cameras have turned farther than they do.
    """
    if abs(solution.shared[Shared.OFFSET]) > _MOST_TURNED_PX:
        return True
    pairs = zip(seen.observations, solution.misfits[number].tolist(), strict=True)
    hidden = [side.extent for side in Side if pictured.past.get(side.end, Past.OPEN) is not Past.OPEN]
    shorter = (solution.boxes[number][hidden] < _FOLLOWED * pictured.own[hidden]).any()
    return bool(shorter or any(o.of_scan and misfit > _CONTRADICTION for o, misfit in pairs))


def _doubted(priors: Priors, pictured: Pictured, seen: Seen) -> Pictured:
    """A box about whose ends the scan disagrees: if it confirms the faces, nobody knows who is mistaken."""
    return replace(pictured, doubt=pictured.doubt + weigh_ends(priors, seen, pictured.own))


def _place(thing: Thing, floor: Floor) -> Place:
    """Where an object of the pictures stands."""
    if thing.pictured is not None:
        return Place.of(_ends_mm(thing.pictured))
    assert thing.region is not None
    region, rectified = thing.region, floor.rectified
    bearings = np.arctan((rectified.P1[0, 2] - np.array([region.bounds[2], region.bounds[0]])) / rectified.f_px)
    return Place.of(float(np.hypot(*region.position_mm)) * direction(bearings))


def _ends_mm(pictured: Pictured) -> Float64:
    """Where the faces of a box end that the pictures show, (N, 2), on the floor."""
    corners = Box(pictured.own).points(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]))[:, :2]
    return corners[[True, Edge.RIGHT_END in pictured.past, Edge.LEFT_END in pictured.past]]


def _why_unseen(footprint: Footprint, standing: Standing) -> Why:
    """Why the pictures say nothing of an object in the scan."""
    priors = standing.priors
    if standing.floor is None:
        return Why(Reason.NO_FLOOR)
    p, rectified = priors.laser.points_mm(footprint.segment.points_mm), priors.floor.rectified
    ahead = np.maximum(p[:, 0], 1.0)
    u, shift = rectified.P1[0, 2] - rectified.f_px * p[:, 1] / ahead, rectified.f_px * rectified.baseline_mm / ahead
    in_left = (p[:, 0] > 0) & (u > 0) & (u < rectified.size[0])
    if in_left.sum() < _LEAST_BEAMS:
        return Why(Reason.NOT_IN_PICTURE)
    if (in_left & (u > shift)).mean() < _SHOWN:
        return Why(Reason.ONE_CAMERA)
    if np.linalg.norm(p, axis=1).min() > OBJECTS_WITHIN_MM:
        return Why(Reason.TOO_FAR, f"farther than {OBJECTS_WITHIN_MM / 1000:g} m")
    return Why(Reason.NO_TEXTURE)


def nearest_mm(judged: Judged, things: list[Thing]) -> float:
    """How far the nearest box is of which the pictures tell something.

    Parameters
    ----------
    judged : Judged
    things : list of Thing

    Returns
    -------
    float, mm
        Infinite where there is none.
    """
    boxes, numbers = judged.solution.boxes, _numbers(things)
    pictured = (boxes[numbers[id(thing)]] for thing in things if thing.seen and thing.pictured)
    return min((float(np.hypot(*own[[Own.X, Own.Y]])) for own in pictured), default=np.inf)
