"""Verdicts of notebook 07 turn with the pictures, the distances and the printed numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.verdicts import assert_turns, verdict_of

from stereolib import evidence, paper
from stereolib.measurement import attempt_height, corner_width_mm
from stereolib.paper import canny_bounding_box
from stereolib.virtual import recordings

RECTIFIED = recordings.rectified()
HEIGHTS_MM = [84.5, 85.0, 85.5]


def square(width: int, *, touching: bool = False):
    """A bright square of so many pixels on dark ground, alone or joined to a line across the picture."""
    picture = np.full((300, 500), 40, np.uint8)
    picture[60 : 60 + width, 40 : 40 + width] = 200
    if touching:
        picture[100:110] = 200
    return picture


def test_canny_finds_the_width():
    alone = [canny_bounding_box(square(200 + k)) for k in range(2)]
    joined = [canny_bounding_box(square(200 + k, touching=True)) for k in range(2)]
    good, bad = (evidence.boxes_right({"textured": boxes, "plain": boxes}, 200.5) for boxes in (alone, joined))
    assert_turns("scale.width_canny", good, bad)
    offs = [evidence.box_off_px(boxes[0], 200) for boxes in (alone, joined)]
    assert_turns("fig.9", *({"textured_px": off, "plain_px": off} for off in offs))


def test_a_relation_over_distance():
    depth = np.array([500.0, 700, 900, 1100, 1300])
    fitted = np.array([True, False, True, False, True])
    pinhole = [canny_bounding_box(square(round(70_000 / z))).width - 1 for z in depth]
    constant = [canny_bounding_box(square(100)).width - 1 for _ in depth]
    true_cm = np.full(depth.shape, 10.0)
    assert_turns(
        "future.parametric_scale",
        evidence.relation_error(depth, pinhole, true_cm, fitted),
        evidence.relation_error(depth, constant, true_cm, fitted),
    )


@pytest.mark.slow
def test_width_from_the_faces():
    left, right = RECTIFIED.rectify(*recordings.load_pair("series/medium_700"))
    wrong = replace(RECTIFIED, P2=RECTIFIED.P2 * np.array([[1, 1, 1, 1.05], [1, 1, 1, 1], [1, 1, 1, 1]]))
    widths = [corner_width_mm(attempt_height(left, right, rig)) / 10 for rig in (RECTIFIED, wrong)]
    assert_turns("scale.width_faces", *widths)


def views(heights_mm=HEIGHTS_MM, **other):
    return [
        view
        for one in paper.setups_in_print()
        for view in paper.setup_family(RECTIFIED, replace(one, **other), heights_mm)
    ]


def test_another_printed_number_would_turn_the_set_up():
    """Arguments: no data, but other numbers in the paper would have given the other verdict."""
    tolerance = evidence.width_tolerance_px(views())
    assert 4 < tolerance < 4.2  # 2 mm of width for 5 mm of distance, and 2 px
    for distance, verdict in ((700.0, "consistent"), (650.0, "paper contradicts itself")):
        view = paper.solve_pitch(RECTIFIED, replace(paper.paper_setup(), distance_mm=distance))
        assert verdict_of("scale.width_px", view.box_px, tolerances={"scale.width_px": tolerance}) == verdict
    low, high = views([50.0, 70.0, 85.0, 120.0]), views([300.0, 350.0])
    assert verdict_of("setup.camera_height", evidence.camera_heights_left(low)) == "consistent"
    assert verdict_of("setup.camera_height", evidence.camera_heights_left(high)) == "paper contradicts itself"
    assert verdict_of("setup.camera_height", evidence.camera_heights_left([])) == "paper contradicts itself"


def test_one_scale_serves_where_the_depths_agree():
    flat = evidence.one_scale(0.116, [886.0], 886.0, 763.7)
    deep = evidence.one_scale(0.116, [681.0, 724.0], 890.0, 763.7)
    assert [verdict_of("claim.one_scale_serves", x) for x in (flat, deep)] == ["agrees", "holds in part"]


@pytest.mark.parametrize(("side_cm", "verdict"), [(30, "consistent"), (31, "paper contradicts itself")])
def test_the_diagonal(side_cm, verdict):
    assert verdict_of("scale.width_cm", np.hypot(side_cm, side_cm)) == verdict


@pytest.mark.parametrize(("width_px", "verdict"), [(362, "consistent"), (365, "paper contradicts itself")])
def test_the_quotient(width_px, verdict):
    assert verdict_of("scale.cm_per_px", paper.cm_per_px(42, width_px)) == verdict
