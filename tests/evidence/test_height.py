"""Verdicts of notebook 06 turn with the maps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.verdicts import assert_turns, verdict_of

from stereolib import evidence, paper
from stereolib.measurement import attempt_height
from stereolib.paper import height_by_maximum, height_of_top
from stereolib.virtual import recordings

RECTIFIED = recordings.rectified()
PITCHED = paper.solve_pitch(RECTIFIED, paper.paper_setup())
HIGH = paper.setup_family(RECTIFIED, paper.paper_setup(), [525.0])[0]  # sees 30 cm of rows at the printed scale
FOOT, SCALE = 427, 0.116


def only_edge(view, rows: int | None = None):
    """The near edge at one disparity before a far wall: what the paper's method takes for granted."""
    disparity = np.full((480, 640), 20.0)
    edge = evidence.edge_mask(view, disparity.shape)
    if rows is not None:
        edge[: FOOT - rows] = False
        edge[FOOT - rows : FOOT, round(view.column)] = True
    disparity[edge] = 100.0
    return disparity


def faces_that_fall():
    """The pitched cube: the edge falls from its foot to its top, and the faces fall away from it on both sides."""
    rows, columns = np.mgrid[:480, :640].astype(float)
    up = (PITCHED.foot_row - rows) / PITCHED.edge_rows
    disparity = PITCHED.disparity_foot_px + up * (PITCHED.disparity_top_px - PITCHED.disparity_foot_px)
    disparity -= 0.08 * np.abs(columns - PITCHED.column)
    return np.where((rows >= PITCHED.top_row) & (rows < FOOT), disparity, 20.0)


def with_stray():
    """A wrong match far above the cube."""
    disparity = faces_that_fall()
    disparity[10, 50] = 150.0
    return disparity


def test_the_maximum_is_the_near_edge():
    names = ("level", "pitched")
    good, bad = (
        evidence.largest_on_edge(dict.fromkeys(names, (d, PITCHED))) for d in (only_edge(PITCHED), faces_that_fall())
    )
    assert good["level_pct"] == 100
    assert_turns("claim.maximum_is_near_edge", good, bad)


def test_figures_7_and_8():
    good, bad = only_edge(PITCHED), with_stray()
    assert_turns("fig.7", evidence.mask_on_edge(good, PITCHED), evidence.mask_on_edge(bad, PITCHED))
    rows = [evidence.top_found(dict.fromkeys(("pitched", "level"), (d, PITCHED))) for d in (good, bad)]
    assert rows[0]["pitched_pct"] == pytest.approx(80, abs=1)  # the wall has a fifth of the edge's disparity
    assert_turns("fig.8", *rows)


def test_the_rows_of_a_nearer_wall_are_found_at_fewer_thresholds():
    near_wall = np.maximum(only_edge(PITCHED), 70.0)
    assert evidence.top_found({"one": (near_wall, PITCHED)})["one_pct"] == pytest.approx(30, abs=1)


def test_an_edge_without_disparity_supports_nothing():
    lost = only_edge(PITCHED)
    lost[:200] = np.nan
    assert np.isnan(evidence.whole_edge_tolerance_px(lost, PITCHED))
    assert np.isnan(evidence.whole_edge_reading_cm(lost, PITCHED))
    assert evidence.top_found({"one": (lost, PITCHED)})["one_pct"] == 0


def test_recipe_at_the_reading_of_most_thresholds():
    """A camera that sees as many rows as the printed scale wants, and the paper's."""
    holds, broken = (evidence.steady_reading_cm(only_edge(view)) for view in (HIGH, PITCHED))
    assert (holds, broken) == pytest.approx((30.0, 37.7), abs=0.1)
    assert_turns("height.recipe", [holds, holds], [broken, broken])
    assert evidence.steady_reading_cm(faces_that_fall()) == pytest.approx(37.7, abs=0.05)
    assert evidence.steady_reading_cm(with_stray()) == pytest.approx(0.116 * (FOOT - 10))  # nothing else is as steady


def test_a_tuned_threshold():
    right, taller = only_edge(HIGH), {side: only_edge(HIGH, round(side / SCALE)) for side in (20, 35)}
    good = evidence.threshold_elsewhere(evidence.tuned_threshold_px(right), [right, 1.1 * right], taller)
    tuned = evidence.tuned_threshold_px(faces_that_fall())
    assert evidence.reading_at_threshold_cm(faces_that_fall(), tuned) == pytest.approx(30, abs=0.5)
    other = [1.01 * faces_that_fall(), 0.99 * faces_that_fall()]  # one pixel of disparity moves where the mask stops
    bad = evidence.threshold_elsewhere(tuned, other, {35: np.roll(faces_that_fall(), -20, axis=0)})
    assert good == {"apart_cm": 0.0, "other_cm": pytest.approx(0.0, abs=0.1)}
    assert_turns("height.recipe_threshold", good, bad)


def test_curve_is_the_recipe_at_each_threshold():
    disparity = faces_that_fall()
    curve = evidence.threshold_curve(disparity, PITCHED)
    for k in range(0, len(curve.below_px), 97):
        one = height_by_maximum(disparity, SCALE, 53, tolerance_px=curve.below_px[k])
        assert curve.reading_cm[k] == pytest.approx(one.height_mm / 10)
    assert curve.whole_px == pytest.approx(6.2, abs=0.1)
    assert curve.whole_cm == pytest.approx(37.7, abs=0.05)
    assert curve.until_px > 80
    assert 4.7 < curve.right_px[0] <= curve.right_px[1] < 5.2
    assert evidence.reading_at_threshold_cm(disparity, 99.4) == pytest.approx(30.5, abs=0.5)
    assert evidence.reading_at_threshold_cm(disparity, 200.0) == 0.0


def test_floor():
    rows = np.arange(480)[:, None] * np.ones(640)
    on_floor = rows >= FOOT
    near_floor = np.where(on_floor, 100 + (rows - FOOT) / 2 + 1, only_edge(PITCHED))
    floor_in_crop = np.where(rows >= FOOT - 30, 110.0, 0.8 * only_edge(PITCHED))  # the cube stands farther away
    far_floor = np.where(on_floor, 50.0, only_edge(PITCHED))
    disturbed = evidence.floor_disturbs(near_floor, on_floor, PITCHED, floor_in_crop)
    calm = evidence.floor_disturbs(far_floor, on_floor, PITCHED, far_floor)
    assert verdict_of("claim.floor_shares_disparity", disturbed) == "follows"
    assert verdict_of("claim.floor_shares_disparity", calm) == "does not follow"


def drawn(gap: bool):
    """A bright square on dark ground; its lower edge fades where it has a gap."""
    picture = np.full((200, 200), 40, np.uint8)
    picture[50:150, 50:150] = 200
    if gap:
        picture[90:150, 50:150] = np.linspace(200, 40, 60)[:, None].astype(np.uint8)
    return picture


def test_rectangles_vary():
    steady = [paper.canny_bounding_box(drawn(False) + np.uint8(k)) for k in range(4)]
    unsteady = [paper.canny_bounding_box(drawn(bool(k % 2))) for k in range(4)]
    assert_turns(
        "claim.canny_box_varies",
        evidence.box_spread({"textured": unsteady, "plain": unsteady}),
        evidence.box_spread({"textured": steady, "plain": steady}),
    )


def test_ray_at_the_edges_own_depth():
    wrong = 1.1 * faces_that_fall()
    heights = [
        height_of_top(RECTIFIED, PITCHED.T_left_world, height_by_maximum(d, SCALE, 53, tolerance_px=7.5)) / 10
        for d in (faces_that_fall(), wrong)
    ]
    assert_turns("height.cube", *([height, heights[0]] for height in heights))  # one wrong map is enough


@pytest.mark.slow
def test_height_over_the_floor():
    left, right = RECTIFIED.rectify(*recordings.load_pair("conditions/texture"))
    mis_rectified = replace(RECTIFIED, P2=RECTIFIED.P2 * np.array([[1, 1, 1, 1.02], [1, 1, 1, 1], [1, 1, 1, 1]]))
    true, wrong = attempt_height(left, right, RECTIFIED), attempt_height(left, right, mis_rectified)
    limits = {"tolerances": {"height.plane": 0.196 * true.std_mm}}
    assert_turns("height.plane", true.height_mm / 10, wrong.height_mm / 10, **limits)


def over_setups(heights_mm):
    setups = paper.setups_in_print()
    ways = {"printed_height": False, "any_height": False, "any_height_to_point": True}
    views = {
        way: [v for one in setups for v in paper.setup_family(RECTIFIED, one, heights_mm, to_point=point)]
        for way, point in ways.items()
    }
    return evidence.recipe_over_setups(views, evidence.ENDS_PX)


def test_set_ups_decide_what_the_recipe_reads(monkeypatch):
    off, span = over_setups([85.0])
    assert verdict_of("height.recipe_family", off) == "does not hold"
    assert span["any_height"] == pytest.approx((37.5, 37.5), abs=0.05)
    off, _ = over_setups([85.0, 560.0])
    assert verdict_of("height.recipe_family", off) == "holds in part"  # only measured to the top of the edge
    scale = {"scale.cm_per_px": 0.0922}  # another printed number: the scale of the near edge
    real = evidence.recipe_over_setups.__globals__["printed_value"]
    monkeypatch.setitem(evidence.recipe_over_setups.__globals__, "printed_value", lambda id: scale.get(id) or real(id))
    off, _ = over_setups([85.0])
    assert verdict_of("height.recipe_family", off) == "agrees"


def test_no_set_up_with_the_width_reads_nothing():
    off, span = evidence.recipe_over_setups({"one": [HIGH]}, 2.0)
    assert np.isnan(off["one"]) and np.isnan(span["one"]).all()
