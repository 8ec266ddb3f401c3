"""Sets with one known fault each: the fault is named, and the pairs that have it."""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import pytest
from support.board_pictures import Photo, Print, photographed
from support.corners import corner_set, draw_poses, draw_rig
from support.faults import bad_sets, misfit_sets

from stereolib.calibration import diagnose, find_in_pairs, fit_rig
from stereolib.calibration.outliers import sort_pairs
from stereolib.paper import paper_rig

FAULTS = list(bad_sets())


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_fault_is_named(fault):
    if fault.refused:
        with pytest.raises(ValueError) as caught:
            diagnose(fault.views, model=fault.model, ruler_mm=fault.ruler_mm)
        assert fault.says in str(caught.value)
        return
    found = diagnose(fault.views, model=fault.model, ruler_mm=fault.ruler_mm)
    assert any(fault.says in warning for warning in found.warnings)
    assert found.verdict == (fault.verdict or found.verdict)
    assert bool(found.reasons) == (found.verdict != "good")
    assert set(found.pairs_refused) == set(fault.pairs)
    assert len(found.advice) <= 3
    assert fault.says in " ".join([*found.reasons, *found.advice])


@pytest.mark.parametrize("fault", [*misfit_sets(1), *misfit_sets(2)], ids=lambda fault: fault.name)
def test_pairs_that_do_not_fit_are_explained(fault):
    test_fault_is_named(fault)


@pytest.mark.parametrize("seed", range(20))
def test_sound_sets_are_free_of_them(seed):
    rng = np.random.default_rng([seed, 18])
    pairs, noise_px = (int(rng.choice([6, 8, 15, 30])), float(rng.choice([0.03, 0.2])))
    found = sort_pairs(corner_set(rng, rig=draw_rig(rng), pairs=pairs, noise_px=noise_px))
    assert not found.refused and not found.moved_by


def test_what_changed_in_the_focus_is_told():
    for camera, found in (
        (f.name.rpartition("of ")[2], diagnose(f.views)) for f in misfit_sets(3) if "focus" in f.name
    ):
        (share,) = re.findall(rf"the focal length ([\d.]+) % longer in {camera}: switch autofocus off", found.advice[0])
        assert float(share) == pytest.approx(3.0, abs=0.3)


def fault(name):
    return next(fault for fault in FAULTS if fault.name == name)


def test_pairs_of_each_position_are_listed():
    found = diagnose(fault("two positions of the rig").views)
    assert found.verdict == "bad"
    assert [len(group) for group in found.groups] == [20, 10]
    assert found.groups[1] == tuple(f"pair {k}" for k in range(21, 31))
    assert "2.0 mm shifted and 0.49 degrees" in found.warnings[0]
    assert found.rig.baseline_mm == pytest.approx(paper_rig().baseline_mm, abs=0.1)  # of the larger group alone


def test_what_a_bad_pair_would_have_done():
    """Left in, three pairs whose boards moved spoil the baseline; refused, they do not."""
    bad = fault("three pairs whose boards moved")
    true = paper_rig().baseline_mm
    spoilt = fit_rig(bad.views, paper_rig()).rig.baseline_mm
    assert abs(diagnose(bad.views).rig.baseline_mm - true) < 0.05 < abs(spoilt - true)


@cache
def twelve_pairs():
    rng = np.random.default_rng(5)
    rig = draw_rig(rng)
    return tuple(photographed(rig, draw_poses(rig, 12, rng), Print(), Photo(), rng))


@pytest.mark.parametrize(
    ("sides", "says"), [((0, 1), "both pictures are"), ((0,), "the left picture is"), ((1,), "the right picture is")]
)
def test_mirrored_pictures_of_some_pairs_are_named(sides, says):
    pairs = list(twelve_pairs())
    for k in (2, 5, 9):
        left, right = (p[:, ::-1].copy() if side in sides else p for side, p in enumerate(pairs[k]))
        pairs[k] = left, right
    views = find_in_pairs(pairs, Print().board, [f"{k:02d}" for k in range(12)], progress=False)
    refused = diagnose(views).pairs_refused
    assert set(refused) == {"02", "05", "09"}
    assert all(why.startswith(f"{says} mirrored: switch that off") for why in refused.values())
