"""The picture of a calibration that was tried on fresh boards."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.corners import corner_set
from support.knocks import calibrated

from stereolib.calibration import Estimate, check_calibration
from stereolib.paper import paper_rig
from stereolib.plotting import check_figure


@pytest.mark.parametrize(("pct", "says"), [(0.06, "0.060 ± 0.030 % too large"), (-0.06, "0.060 ± 0.030 % too small")])
def test_title_says_which_way_the_board_is_off(pct, says):
    rig, record, _ = calibrated(paper_rig(), np.random.default_rng(3), pairs=6)
    fresh = corner_set(np.random.default_rng(4), rig=paper_rig(), pairs=2)
    check = check_calibration(rig, fresh, record=record)
    figure = check_figure(replace(check, board_pct=Estimate(pct, 0.03)))
    assert says in figure.axes[0].get_title()
