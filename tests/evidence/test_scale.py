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


def faint(width: int):
    """The same square, so faint that Canny's default thresholds do not see it."""
    return (40 + (square(width).astype(int) - 40) // 8).astype(np.uint8)


def test_canny_finds_the_width():
    settings = [(5, 20.0), (5, 150.0)]
    alone, joined = ([square(200 + k, touching=t) for k in range(2)] for t in (False, True))
    boxes = {name: [canny_bounding_box(p) for p in same] for name, same in (("alone", alone), ("joined", joined))}
    assert evidence.boxes_right(boxes, 200.5) == {"alone_pct": 100.0, "joined_pct": 0.0}
    good, bad = (
        evidence.boxes_at_best_setting({"textured": p, "plain": p}, 200.5, settings)[0] for p in (alone, joined)
    )
    assert_turns("fig.9", good, bad)


def test_the_best_setting_is_each_scenes_own():
    pictures = {"faint": [faint(200)], "clear": [square(200)]}
    share, chosen = evidence.boxes_at_best_setting(pictures, 200.0, iter([(5, 150.0), (5, 20.0)]))
    assert share == {"faint_pct": 100.0, "clear_pct": 100.0}
    assert chosen["faint"] == (5, 20.0)
    assert evidence.boxes_at_best_setting(pictures, 200.0, [(5, 150.0)])[0]["faint_pct"] == 0  # no edge at all


def test_a_relation_over_distance():
    depth = np.array([500.0, 700, 900, 1100, 1300])
    fitted = np.array([True, False, True, False, True])
    pinhole = [canny_bounding_box(square(round(70_000 / z))).width - 1 for z in depth]
    constant = [canny_bounding_box(square(100)).width - 1 for _ in depth]
    errors = [evidence.relation_error(depth, px, np.full(5, 10.0), fitted) for px in (pinhole, constant)]
    assert [verdict_of("future.parametric_scale", error) for error in errors] == ["follows", "does not follow"]


@pytest.mark.slow
def test_width_from_the_faces():
    left, right = RECTIFIED.rectify(*recordings.load_pair("series/medium_700"))
    wrong = replace(RECTIFIED, P2=RECTIFIED.P2 * np.array([[1, 1, 1, 1.05], [1, 1, 1, 1], [1, 1, 1, 1]]))
    widths = [corner_width_mm(attempt_height(left, right, rig)) / 10 for rig in (RECTIFIED, wrong)]
    assert_turns("scale.width_faces", *widths)


def views(heights_mm=HEIGHTS_MM, roll_rad=0.0, **other):
    return [
        view
        for one in paper.setups_in_print()
        for view in paper.setup_family(RECTIFIED, replace(one, **other), heights_mm, roll_rad=roll_rad)
    ]


def test_another_printed_number_would_turn_the_set_up():
    """Arguments: no data, but other numbers in the paper would have given the other verdict."""
    tolerance = evidence.width_tolerance_px(views())
    assert 4 < tolerance < 4.2  # 2 mm of width for 5 mm of distance, and 2 px
    for distance, verdict in ((700.0, "consistent"), (650.0, "paper contradicts itself")):
        view = paper.solve_pitch(RECTIFIED, replace(paper.paper_setup(), distance_mm=distance))
        assert verdict_of("scale.width_px", view.box_px, tolerances={"scale.width_px": tolerance}) == verdict


@pytest.mark.parametrize(
    ("height_mm", "verdict"),
    [(85.0, "consistent"), (215.9, "paper contradicts itself"), (600.0, "paper contradicts itself")],
)
def test_the_printed_height_must_be_one_that_fits(height_mm, verdict):
    """8.5 cm is; 8.5 inches lie in the gap, and 60 cm beyond the range."""
    every = views([*np.arange(10.0, 400.0, 10.0), 85.0, 215.9])
    assert verdict_of("setup.camera_height", evidence.height_off_cm(every, height_mm)) == verdict
    left = evidence.camera_heights_left(every)
    assert left == {"lowest_cm": 7.0, "highest_cm": 39.0, "gap_from_cm": 18.0, "gap_to_cm": 22.0}


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_roll_closes_the_gap(sign):
    """Only pictures that are level to a fraction of a degree leave it; a smaller roll leaves a part of it."""
    heights, full = np.arange(10.0, 400.0, 10.0), sign * paper.left_level_roll(RECTIFIED)
    level, some = views(heights), views(heights, 0.55 * full)
    left = evidence.camera_heights_left([*level, *some, *views(heights, full)])
    assert left["lowest_cm"] == 7.0 and np.isnan(left["gap_from_cm"])
    assert evidence.camera_heights_left([*level, *some]) == left | {"gap_from_cm": 20.0, "gap_to_cm": 22.0}
    assert evidence.height_off_cm(views([215.9], full), 215.9) == {"off_cm": 0.0}


def test_no_camera_fits():
    assert np.isnan(list(evidence.camera_heights_left([]).values())).all()
    assert verdict_of("setup.camera_height", evidence.height_off_cm([], 85.0)) == "paper contradicts itself"


def test_one_scale_serves_where_the_depths_agree():
    flat = evidence.one_scale(0.116, [886.0], [886.0], 763.7)
    deep = evidence.one_scale(0.116, [681.0, 724.0], [890.0, 934.0], 763.7)
    assert [verdict_of("claim.one_scale_serves", x) for x in (flat, deep)] == ["agrees", "holds in part"]
    assert deep["corner_times"] == pytest.approx(1, abs=0.01) and deep["side_times"] < 0.98


@pytest.mark.parametrize(("side_cm", "verdict"), [(30, "consistent"), (31, "paper contradicts itself")])
def test_the_diagonal(side_cm, verdict):
    assert verdict_of("scale.width_cm", np.hypot(side_cm, side_cm)) == verdict


@pytest.mark.parametrize(("width_px", "verdict"), [(362, "consistent"), (365, "paper contradicts itself")])
def test_the_quotient(width_px, verdict):
    assert verdict_of("scale.cm_per_px", paper.cm_per_px(42, width_px)) == verdict
