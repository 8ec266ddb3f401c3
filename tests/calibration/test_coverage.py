"""What a set of boards covers, and what it leaves out."""

from __future__ import annotations

import numpy as np
import pytest
from support.corners import corner_set, draw_rig

from stereolib.calibration import boards_per_cell, bundle_adjustment
from stereolib.calibration.coverage import _regions, judge_coverage
from stereolib.paper import paper_rig


def test_coverage_counts_boards_over_cells():
    square = np.array([[[100, 100], [300, 100], [300, 200], [100, 200]]], float)
    count = boards_per_cell(np.concatenate([square, square]), (640, 480))
    assert count.shape == (24, 32)
    assert set(np.unique(count)) == {0, 2}
    assert (count > 0).sum() * 400 == pytest.approx(200 * 100, rel=0.02)
    assert count[7, 10] == 2 and count[2, 2] == 0


def test_coverage_names_a_third_that_one_camera_never_saw():
    wide = corner_set(np.random.default_rng(0), pairs=60)
    some = wide.only(np.flatnonzero(wide.right_px[..., 0].max(axis=1) < 424).tolist())
    fitted = bundle_adjustment.fit_rig(some, paper_rig())
    found = judge_coverage(some, fitted.turns, fitted.shifts)
    assert found.missing == ("no views in the right third of the right image",)
    assert str(found) == f"{found.missing[0]}: hold the board there in some pictures" == found.advice[0]


def test_coverage_of_a_wide_set_is_high():
    rng = np.random.default_rng(0)
    rig = draw_rig(rng)
    fitted = bundle_adjustment.fit_rig(views := corner_set(rng, rig=rig), rig)
    found = judge_coverage(views, fitted.turns, fitted.shifts)
    assert found.missing == ()
    assert found.distance == found.tilt == 1.0
    assert 0.4 < found.image <= 1
    assert str(found) == f"nothing more is needed (boards were seen in {100 * found.image:.0f} % of the images)"


@pytest.mark.parametrize(
    ("seen", "missing"),
    [
        ([(1, 1)], ["no views outside the centre"]),
        ([(1, 0), (1, 1)], ["no views outside the centre"]),
        ([(1, 1), (1, 2)], ["no views outside the centre"]),
        ([(1, 0), (1, 1), (1, 2)], ["no views in the upper third", "no views in the lower third"]),
        ([(0, 1), (1, 1), (2, 1)], ["no views in the left third", "no views in the right third"]),
        ([(i, j) for i in range(3) for j in range(3) if (i, j) != (2, 0)], ["no views in the lower left"]),
    ],
)
def test_what_no_board_reaches_is_named_as_a_whole(seen, missing):
    mask = np.zeros((24, 30), bool)
    for i, j in seen:
        mask[8 * i : 8 * i + 8, 10 * j : 10 * j + 10] = True
    assert _regions([mask, mask]) == missing
    assert _regions([mask, np.zeros_like(mask)]) == missing  # one camera is enough
