"""Edges that contradict each other: what hangs on them is known worse, the rest stays; a box that fits none is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.boxes import EDGE_PX, EDGES, OWN, PRIORS, STILL, edges, everything, start

from stereolib.measurement.agreement import Past
from stereolib.measurement.box import Edge, Own
from stereolib.measurement.contradictions import weigh_contradictions
from stereolib.measurement.measured_object import BoxFacts, from_box
from stereolib.measurement.observations import EdgeSeen
from stereolib.measurement.scene_solver import Seen, solve

EXTENTS = [Own.RIGHT, Own.LEFT, Own.HEIGHT]


def weighed(seen):
    box = Seen(start(), seen)
    found = solve(PRIORS, [box])
    return found, weigh_contradictions(PRIORS, box, found)


def with_moved(*moved, std_px=EDGE_PX):
    """What is seen of the box, some edges so many pixels off."""
    off = dict(moved)
    seen = everything(PRIORS.world(STILL))
    return [
        replace(o, point_px=o.point_px + off[o.edge] * o.across, std_px=std_px)
        if isinstance(o, EdgeSeen) and o.edge in off
        else o
        for o in seen
    ]


@pytest.mark.parametrize(("px", "std_px"), [(3.0, EDGE_PX), (-3.0, EDGE_PX), (3.0, 0.5)])
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
