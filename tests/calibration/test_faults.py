"""Seventeen sets with one known fault each: the fault is named, and the pairs that have it."""

from __future__ import annotations

import pytest
from support.faults import bad_sets

from stereolib.calibration import diagnose, fit_rig
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
    assert found.verdict != "good"
    assert set(found.pairs_refused) == set(fault.pairs)
    assert found.reasons


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
