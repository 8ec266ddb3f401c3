"""What a calibration keeps of itself: written and read, and what files hold that were written by others."""

from __future__ import annotations

import json
import operator
from dataclasses import replace

import numpy as np
import pytest
from support.corners import corner_set

from stereolib.calibration import CalibrationRecord, calibration_facts, diagnose, fit_rig, rig_covariance
from stereolib.calibration.record import pair_scatter
from stereolib.paper import paper_rig


@pytest.fixture(scope="module")
def views():
    return corner_set(np.random.default_rng(1), pairs=12)


@pytest.fixture(scope="module")
def diagnosis(views):
    return diagnose(views)


def test_what_is_written_is_read(diagnosis, views, tmp_path):
    notes = calibration_facts(diagnosis)
    path = diagnosis.rig.save(tmp_path / "calibration.json", calibration=notes)
    record = CalibrationRecord.load(path, diagnosis.rig)
    np.testing.assert_array_equal(record.covariance, rig_covariance(diagnosis.fit))
    assert record.whole and record.scatter == pair_scatter(diagnosis.fit) and record.sigma_px == diagnosis.fit.sigma_px
    assert record.made_from(views.only([3, 5])) == ("pair 04", "pair 06")
    stored_again = replace(views, left_px=views.left_px + np.float32(0.01))  # as JPEG, say
    assert len(record.made_from(stored_again)) == len(views)


def test_older_files_state_single_deviations_and_others_none(diagnosis, tmp_path):
    notes = {name: entry for name, entry in calibration_facts(diagnosis).items() if name != "record"}
    older = CalibrationRecord.load(diagnosis.rig.save(tmp_path / "a.json", calibration=notes), diagnosis.rig)
    np.testing.assert_allclose(older.covariance, np.diag(np.diag(rig_covariance(diagnosis.fit))), rtol=1e-9)
    assert not older.whole and older.outer_px is None
    bare = CalibrationRecord.load(diagnosis.rig.save(tmp_path / "b.json"), diagnosis.rig)
    assert not bare.covariance.any() and bare.outer_px is None and bare.made_from(diagnosis.views) == ()


@pytest.mark.parametrize(
    "spoil",
    [
        lambda record: record.pop("scatter"),
        lambda record: record.update(covariance=[[1.0]]),
        lambda record: operator.setitem(record["covariance"][0], 0, -1.0),
        lambda record: operator.setitem(record["covariance"][3], 4, 1e3),
        lambda record: operator.setitem(record["covariance"][5], 5, 0.0),
        lambda record: record.update(outer_px=[1, 2]),
        lambda record: record["outer_px"].update(x="here"),
        lambda record: record.update(sigma_px=None),
    ],
)
def test_a_damaged_record_names_the_file(diagnosis, spoil, tmp_path):
    path = diagnosis.rig.save(tmp_path / "calibration.json", calibration=calibration_facts(diagnosis))
    stored = json.loads(path.read_text())
    spoil(stored["calibration"]["record"])
    path.write_text(json.dumps(stored))
    with pytest.raises(ValueError, match=r"calibration.json: what it says of its calibration is damaged .*: calibrate"):
        CalibrationRecord.load(path, diagnosis.rig)


def test_pairs_scatter_as_their_corners_do_unless_boards_move(views):
    fit = fit_rig(views, paper_rig())
    assert 1 <= pair_scatter(fit) < 1.3
    shaken = replace(views, right_px=views.right_px + np.random.default_rng(2).normal(0, 0.3, (12, 1, 2)))
    assert pair_scatter(fit_rig(shaken, paper_rig())) > 2
