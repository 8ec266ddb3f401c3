"""What a scan says of a face whose ends the pictures may have mistaken."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.boxes import OWN, PRIORS, STILL, edges

from stereolib.laser import Footprint
from stereolib.measurement.agreement import Past
from stereolib.measurement.box import Box, Edge, Shared
from stereolib.measurement.contradictions import sharp_edges
from stereolib.measurement.laser_on_floor import Lean
from stereolib.measurement.measured_object import MeasuredObject
from stereolib.measurement.reasons import Reason, Why
from stereolib.measurement.scene_solver import Seen, solve
from stereolib.measurement.things import Scene, Thing

ENDS = Box(OWN).points(np.array([[0.0, 0, 0], [1, 0, 0]]))[:, :2]
FACE = MeasuredObject(
    shape="face", size_mm=np.array([np.nan, 300.0, 250.0]), covariance=np.diag([np.nan, 1.0, 1.0]),
    position_mm=OWN[:2], position_covariance=np.eye(2), yaw_rad=0.0, yaw_std_rad=0.01, outline_mm=ENDS,
    reasons={"length": Why(Reason.DEPTH_HIDDEN)}, common_mm=np.ones((3, 7)), unsure={"width": "far", "height": "far"},
)  # fmt: skip


FACE_DEG = float(np.degrees(np.ptp(np.arctan2(ENDS[:, 1], ENDS[:, 0]))))


def readings(spread_deg, distance_mm=720.0):
    bearings = np.radians(np.linspace(-spread_deg / 2, spread_deg / 2, 50))
    return distance_mm * np.column_stack([np.cos(bearings), np.sin(bearings)])


def judged(points_mm, *, std_px=(0.8, 0.8), disagrees=True, found=FACE, pieces=(), priors=PRIORS, readings_mm=None):
    """What is told of a face that looks `FACE_DEG` wide; its corner and its right end are known so well."""
    readings_mm = points_mm if readings_mm is None else readings_mm
    some = (Edge.CORNER, Edge.RIGHT_END)
    seen = edges(PRIORS.world(STILL), OWN, some=some)
    seen = Seen(OWN, tuple(replace(edge, std_px=std) for edge, std in zip(seen, std_px, strict=True)))
    pictured = SimpleNamespace(own=OWN, past=dict.fromkeys(some, Past.OPEN), seen=seen)
    footprint = SimpleNamespace(segment=SimpleNamespace(points_mm=points_mm))
    scene = Scene(SimpleNamespace(priors=priors), True, points_mm, readings_mm)
    thing = Thing(pictured, footprint=footprint, seen=seen, disagrees=disagrees, pieces=pieces)
    return scene._as_scan_allows(thing, found)


LOW = replace(PRIORS, laser=replace(PRIORS.laser, lean=Lean(np.zeros(2), 80.0, 1e-6 * np.eye(2))))


@pytest.mark.parametrize("std_px", [(0.8, 0.8), (0.1, 0.8), (0.8, 0.1)])
def test_a_face_that_is_far_wider_in_the_scan_has_no_width(std_px):
    found = judged(readings(1.6 * FACE_DEG), std_px=std_px)
    assert np.isnan(found.size_mm[:2]).all() and found.size_mm[2] == 250
    assert found.reasons["width"].reason is Reason.OTHER_IN_SCAN and "300 mm, in the scan " in str(
        found.reasons["width"]
    )
    assert found.reasons["length"] is FACE.reasons["length"] and found.unsure == {"height": "far"}
    assert found.std_mm[2] == 1 and np.isnan(found.covariance[1]).all() and not found.common_mm[1].any()


IRREGULAR = replace(FACE, reasons=FACE.reasons | {"object": Why(Reason.SCAN_IRREGULAR)})


@pytest.mark.parametrize("std_px", [(0.8, 0.8), (0.1, 0.1)])
def test_a_face_that_is_no_straight_one_in_the_scan_has_no_width(std_px):
    found = judged(readings(FACE_DEG), std_px=std_px, disagrees=False, found=IRREGULAR)
    assert np.isnan(found.size_mm[:2]).all() and found.size_mm[2] == 250
    assert str(found.reasons["width"]).startswith("300 mm, in the scan no straight face: ")
    box = replace(IRREGULAR, shape="box")  # its corner is no straight face either
    assert judged(readings(FACE_DEG), disagrees=False, found=box) is box


def beams(gap, *, before=6, after=6, far=1.5):
    """A face's width in beams: so many that meet it, some that go through it, others that meet it."""
    share = (np.arange(before + gap + after) + 0.5) / (before + gap + after)
    on_it = ENDS[0] + share[:, None] * (ENDS[1] - ENDS[0])
    through = (np.arange(len(on_it)) >= before) & (np.arange(len(on_it)) < before + gap)
    return np.where(through[:, None], far * on_it, on_it)


BOX = replace(FACE, shape="box", size_mm=np.array([300.0, 200.0, 250.0]), covariance=np.eye(3), reasons={},
              outline_mm=Box(OWN).points(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]))[:, :2])  # fmt: skip


@pytest.mark.parametrize(("found", "told"), [(FACE, "300 mm, "), (BOX, "300 x 200 mm, ")])
def test_what_beams_go_through_has_no_outline(found, told):
    seen = judged(readings(FACE_DEG), std_px=(0.1, 0.1), found=found, readings_mm=beams(3))
    assert seen.shape == "irregular" and np.isnan(seen.size_mm[:2]).all() and seen.size_mm[2] == 250
    assert str(seen.reasons["width"]).startswith(f"{told}but beams go through it: ") and np.isnan(seen.yaw_rad)
    solid = judged(readings(FACE_DEG), std_px=(0.1, 0.1), found=found, readings_mm=beams(0))
    fused = judged(readings(FACE_DEG), std_px=(0.1, 0.1), found=found, readings_mm=beams(3), disagrees=False)
    assert solid is found and fused is found


TWICE = readings(2 * FACE_DEG)
A_BOX = Thing(SimpleNamespace(own=OWN), seen=Seen(OWN, ()))


def test_a_plain_part_within_its_outline_does_not_tell_what_it_is_of():
    assert "width" in judged(TWICE, pieces=(Thing(),)).reasons


@pytest.mark.parametrize(
    "otherwise",
    [
        {"points_mm": readings(1.4 * FACE_DEG)},  # hardly wider
        {"points_mm": TWICE, "std_px": (0.1, 0.1)},  # its ends are sharp: no print
        {"points_mm": TWICE, "disagrees": False},
        {"points_mm": TWICE, "found": BOX},
        {"points_mm": TWICE, "found": FACE.without("width", Why(Reason.CUT))},
        {"points_mm": TWICE, "pieces": (A_BOX,)},  # others within that outline stand alone now
        {"points_mm": 2.5 * TWICE, "priors": LOW},  # far behind: something else
    ],
)
def test_else_it_stays(otherwise):
    assert judged(**otherwise) is otherwise.get("found", FACE)


def test_which_edges_are_sharp():
    every = edges(PRIORS.world(STILL), OWN)
    seen = Seen(OWN, (replace(every[0], std_px=0.6), *every[1:]))
    assert sharp_edges(seen) == {edge.edge for edge in every[1:]}


def test_a_round_thing_stands_where_the_scene_has_the_laser_and_as_well_known():
    angles = np.linspace(0.6 * np.pi, 1.4 * np.pi, 12)
    rim = np.array([800.0, 0.0]) + 60.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    round_ = Footprint(
        "circle", SimpleNamespace(points_mm=rim), length_mm=120.0, width_mm=120.0, length_std_mm=1.0,
        width_std_mm=1.0, centre_mm=np.array([800.0, 0.0]), centre_std_mm=np.ones(2),
    )  # fmt: skip
    scene = Scene(SimpleNamespace(priors=PRIORS), True, rim, rim)
    first = solve(PRIORS, [])
    moved = replace(first, shared=first.shared.copy(), covariance=9 * first.covariance)
    moved.shared[Shared.LASER_X] = 30.0
    things = [scene._measured(each, Thing(footprint=round_), None) for each in (first, moved)]
    assert things[1].position_mm - things[0].position_mm == pytest.approx([30.0, 0.0])
    own = np.eye(2)
    known = [thing.position_covariance - own for thing in things]
    np.testing.assert_allclose(known[1], 9 * known[0], rtol=1e-6)
    assert things[0].common_mm[:2].any() and not things[0].common_mm[2].any()
