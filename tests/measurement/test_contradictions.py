"""Edges that contradict each other: what hangs on them is known worse, the rest stays; a box that fits none is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.boxes import EDGE_PX, EDGES, OWN, PRIORS, STILL, edges, ends, everything, pictured, planes, readings, start

from stereolib.measurement.agreement import Past
from stereolib.measurement.box import Edge, Own
from stereolib.measurement.contradictions import weigh_contradictions, weigh_ends
from stereolib.measurement.measured_object import BoxFacts, from_box
from stereolib.measurement.observations import EdgeSeen, weak_priors
from stereolib.measurement.outline import predicted
from stereolib.measurement.scene_solver import Seen, solve

EXTENTS = [Own.RIGHT, Own.LEFT, Own.HEIGHT]


ALL = (*EDGES, Edge.BACK_LEFT)


def weighed(seen, followed=None):
    box = Seen(start(), seen)
    found = solve(PRIORS, [box])
    return found, weigh_contradictions(PRIORS, box, found, followed or {})


def changed(seen, edge, *, px=0.0, std_px):
    """One edge moved across, and known otherwise."""
    return [
        replace(o, point_px=o.point_px + px * o.across, std_px=std_px) if getattr(o, "edge", None) is edge else o
        for o in seen
    ]


def with_moved(*moved, std_px=EDGE_PX):
    """What is seen of the box, some edges so many pixels off."""
    seen = everything(PRIORS.world(STILL))
    for edge, px in moved:
        seen = changed(seen, edge, px=px, std_px=std_px)
    return seen


@pytest.mark.parametrize(("px", "std_px"), [(3.0, EDGE_PX), (-3.0, EDGE_PX), (3.0, 0.4)])
def test_of_two_upper_edges_that_contradict_nobody_knows_which_is_right(px, std_px):
    found, (doubtful, doubt) = weighed(with_moved((Edge.TOP_RIGHT, px), std_px=std_px))
    assert not doubtful
    without = from_box(found, 0, BoxFacts(dict.fromkeys(EDGES, Past.OPEN)))
    told = from_box(found, 0, BoxFacts(dict.fromkeys(EDGES, Past.OPEN), doubt=doubt))
    off = np.abs(told.size_mm - OWN[EXTENTS])
    assert (off < 1.5 * told.std_mm).all() and told.reasons == {}
    assert told.std_mm[2] > 1.3 * without.std_mm[2]  # the height hangs on them
    np.testing.assert_allclose(told.std_mm[:2], without.std_mm[:2], rtol=0.05)  # the ends do not


def test_what_no_edge_left_out_reconciles_is_doubtful():
    _, (doubtful, doubt) = weighed(with_moved((Edge.TOP_RIGHT, 4.0), (Edge.CORNER, 4.0)))
    assert {Edge.TOP_RIGHT, Edge.CORNER} & doubtful and not doubt.any()


def test_edges_that_agree_leave_no_doubt():
    _, (doubtful, doubt) = weighed(everything(PRIORS.world(STILL), OWN, np.random.default_rng(3)))
    assert not doubtful and not doubt.any()


def test_an_edge_that_three_others_outvote_hardly_counts():
    """Four upper edges, one of them off: the height stays where the three have it, known nearly as well."""
    world = PRIORS.world(STILL)
    four = [*with_moved((Edge.TOP_RIGHT, 3.0)), *edges(world, OWN, some=(Edge.TOP_LEFT, Edge.TOP_RIGHT))]
    _, (doubtful, doubt) = weighed(four)
    assert not doubtful and np.sqrt(doubt[Own.HEIGHT, Own.HEIGHT]) < 0.5


def with_back(off_px, end_std_px):
    """A box from above, the edge behind its top mistaken, and how well its right end is known."""
    world = PRIORS.world(STILL)
    seen = [*weak_priors(start(), PRIORS.laser.bias_mm), *planes(world, OWN), *edges(world, OWN, some=ALL)]
    return changed(changed(seen, Edge.BACK_LEFT, px=off_px, std_px=0.2), Edge.RIGHT_END, std_px=end_std_px)


def test_a_sharp_end_of_a_face_outweighs_an_edge_behind_the_top():
    """Both tell how far the box goes back: the end that was seen all along its line is hardly ever the mistaken one."""
    _, (doubtful, sharp) = weighed(with_back(4.0, EDGE_PX))
    _, (_, blurred) = weighed(with_back(4.0, 0.6))
    assert not doubtful and blurred[Own.RIGHT, Own.RIGHT] > 4 * sharp[Own.RIGHT, Own.RIGHT] > 0


def test_where_a_face_was_followed_to_is_not_forgotten_when_its_end_is_doubted():
    world = PRIORS.world(STILL)
    near = EdgeSeen.near(predicted(Edge.RIGHT_END, world, OWN), 1.5)
    _, (_, alone) = weighed(with_back(6.0, 0.6))
    _, (_, followed) = weighed(with_back(6.0, 0.6), {Edge.RIGHT_END: near})
    assert followed[Own.RIGHT, Own.RIGHT] < 0.1 * alone[Own.RIGHT, Own.RIGHT]


@pytest.mark.parametrize(("std_px", "doubts"), [(1.5, True), (EDGE_PX, False)])
def test_of_a_blurred_end_that_the_scan_denies_nobody_knows_who_is_mistaken(std_px, doubts):
    """The left face as the pictures have it, 25 mm too long; a sharp end is doubted for no beam."""
    world, longer = PRIORS.world(STILL), OWN.copy()
    longer[Own.LEFT] += 25
    pair = [*weak_priors(start(), PRIORS.laser.bias_mm), *planes(world, OWN), *edges(world, longer)]
    seen = [*changed(pair, Edge.LEFT_END, std_px=std_px), *readings(world, OWN), *ends(world, OWN)]
    doubt = np.sqrt(weigh_ends(PRIORS, Seen(start(), seen), longer)[Own.LEFT, Own.LEFT])
    assert doubt == (pytest.approx(25 / 2**0.5, abs=3) if doubts else 0)


def test_a_scan_that_misses_the_faces_too_is_of_another_place():
    world, elsewhere = PRIORS.world(STILL), OWN + 60.0 * np.eye(len(Own))[Own.X]
    seen = [*changed(pictured(world), Edge.LEFT_END, std_px=1.5), *readings(world, elsewhere), *ends(world, elsewhere)]
    assert not weigh_ends(PRIORS, Seen(start(), seen), OWN).any()
