"""Objects that would stand in one another: neither outline is told then."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stereolib.measurement.measured_object import MeasuredObject
from stereolib.measurement.one_place import reach_into_mm, without_shared_places
from stereolib.measurement.reasons import Reason, Why


def box(x, y, *, length=300.0, width=200.0, std=1.0, turn=0.0):
    corners = np.array([[0.0, 0], [width, 0], [width, length], [0, length]])
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    size, outline = np.array([length, width, 250.0]), corners @ R.T + [x, y]
    covariance = np.diag([std, std, 1.0]) ** 2
    return MeasuredObject(
        "box", size, covariance, outline.mean(axis=0), std**2 / 4 * np.eye(2), turn, 0.01, outline,
        common_mm=np.ones((3, 7)),
    )  # fmt: skip


def face(start, end, *, unknown=(), along_std=1.0):
    """A face of which an end may be cut: then its middle is hardly known along it."""
    ends = np.array([start, end], float)
    along = (ends[1] - ends[0]) / np.hypot(*(ends[1] - ends[0]))
    spread = 0.25 * np.eye(2) + along_std**2 * np.outer(along, along)
    size = np.array([np.nan, float(np.hypot(*(ends[1] - ends[0]))), 200.0])
    found = MeasuredObject(
        "face", size, np.diag([np.nan, 1.0, 1.0]), ends.mean(axis=0), spread, 0.0, 0.01, ends,
        reasons={"length": Why(Reason.DEPTH_HIDDEN)},
    )  # fmt: skip
    for name in unknown:
        found = found.without(name, Why(Reason.CUT))
    return found


def told(found):
    return [np.isfinite(item.size_mm).tolist() for item in found]


def test_two_boxes_in_one_another_have_no_outline_but_heights():
    first, second, apart = box(800, 0), box(960, 100), box(800, 900)
    found = without_shared_places([first, second, apart])
    assert told(found) == [[False, False, True], [False, False, True], [True, True, True]] and found[2] is apart
    assert [item.shape for item in found] == ["irregular", "irregular", "box"] and np.isnan(found[0].yaw_rad)
    for item, before in zip(found[:2], (first, second), strict=True):
        assert item.reasons["length"].reason is item.reasons["width"].reason is Reason.IN_ANOTHER
        assert str(item.reasons["width"]).startswith("by 40 mm: ") and item.std_mm[2] == 1.0
        assert item.outline_mm is before.outline_mm and not item.common_mm[:2].any()


@pytest.mark.parametrize(
    "others",
    [
        [box(800, 0), box(1000, 0)],  # they touch
        [box(800, 0), box(996, 0)],  # by no more than may be chance
        [box(800, 0, std=15.0), box(970, 0)],  # one of them may be so much smaller
        [box(800, 0), box(1200, -250, turn=0.78)],  # side by side, though their bounds along x and y overlap
        [box(800, 0), face((790, -100), (790, 400))],
    ],
)
def test_else_both_stay(others):
    found = without_shared_places(others)
    assert all(item is before for item, before in zip(found, others, strict=True))


def test_a_face_whose_end_is_cut_is_where_it_was_seen_all_the_same():
    seen = face((850, 150), (850, 600), unknown=("width",), along_std=500.0)
    found = without_shared_places([box(800, 0), seen])
    assert told(found) == [[False, False, True], [False, False, True]] and found[1] is seen


def test_what_has_no_sides_reaches_into_nothing():
    round_ = replace(box(850, 50), shape="circle")
    found = without_shared_places([box(800, 0), round_])
    assert told(found) == [[True, True, True], [True, True, True]]


def test_outlines_reach_into_each_other_by_the_shortest_way_out():
    square = np.array([[0.0, 0], [10, 0], [10, 10], [0, 10]])
    turned = (square - 5) @ np.array([[1, 1], [-1, 1]]) / np.sqrt(2)  # a corner at 7.07
    assert reach_into_mm(square, turned + np.array([15, 5])) == pytest.approx(10 - (15 - 5 * np.sqrt(2)))
    assert reach_into_mm(square, square + np.array([13, 0])) == pytest.approx(-3)
    assert reach_into_mm(square, square) == pytest.approx(10)
