"""The instrument's file: written, read, damaged."""

from __future__ import annotations

import json

import numpy as np
import pytest
from support.corners import corner_set
from support.instruments import LIDAR, RECT

from stereolib.calibration import LASER_SCALE_STD, calibration_facts, diagnose, rig_covariance
from stereolib.measurement import Instrument, SystematicUncertainty, save_laser_pose
from stereolib.rig import StereoRig


def test_instrument_file_goes_round(tmp_path):
    deviations = {"std": {"rectified": {"f_px": 0.1, "baseline_mm": 0.01}}}
    StereoRig.save(RECT.rig, tmp_path / "rig.json", calibration=deviations)
    save_laser_pose(tmp_path / "rig.json", LIDAR)
    instrument = Instrument.load(tmp_path / "rig.json")
    np.testing.assert_array_equal(instrument.lidar.T_left_lidar, LIDAR.T_left_lidar)
    np.testing.assert_array_equal(instrument.lidar.covariance, LIDAR.covariance)
    assert instrument.lidar.scale == LIDAR.scale
    assert instrument.uncertainty.f_px == 0.1 and instrument.rectified.f_px == RECT.f_px
    text = json.loads((tmp_path / "rig.json").read_text())
    text["lidar"]["T_left_lidar"][0][0] = 3.0
    (tmp_path / "rig.json").write_text(json.dumps(text))
    with pytest.raises(ValueError, match="laser or of deviations is damaged"):
        Instrument.load(tmp_path / "rig.json")


def test_a_laser_s_entry_without_a_scale_leaves_it_open(tmp_path):
    path = StereoRig.save(RECT.rig, tmp_path / "rig.json")
    save_laser_pose(path, LIDAR)
    text = json.loads(path.read_text())
    del text["lidar"]["scale"]
    text["lidar"]["covariance"] = LIDAR.covariance[:6, :6].tolist()
    path.write_text(json.dumps(text))
    lidar = Instrument.load(path).lidar
    assert (lidar.scale, lidar.std_scale) == (0.0, LASER_SCALE_STD)
    np.testing.assert_array_equal(lidar.covariance[:6, :6], LIDAR.covariance[:6, :6])


def test_something_else_that_shifts_all_disparities_widens_the_offset_alone():
    known = SystematicUncertainty(4.0, 0.5, 0.3, (0.5, -0.4, 0.2))
    for none in ((5, 0, 0), (0.9, 0.9, -0.9)):
        with pytest.raises(ValueError, match="no three quantities are correlated so"):
            SystematicUncertainty(1, 1, 1, none)
    more = np.diag([0.0, 0.0, 0.4**2])
    np.testing.assert_allclose(known.with_offset(0.4).covariance, known.covariance + more, atol=1e-12)
    np.testing.assert_array_equal(SystematicUncertainty().with_offset(0.4).covariance, more)
    np.testing.assert_array_equal(SystematicUncertainty().with_offset(0.0).covariance, 0 * more)


@pytest.mark.parametrize(
    ("entry", "place", "value", "message"),
    [
        ("T_left_lidar", (0, 3), float("nan"), "finite"),
        ("T_left_lidar", (1, 3), float("inf"), "finite"),
        ("T_left_lidar", (0, 0), float("-inf"), "finite"),
        ("T_left_lidar", (0, 0), 3.0, "rotation"),
        ("T_left_lidar", (3, 0), 1.0, "0 0 0 1"),
        ("covariance", (2, 2), float("nan"), "finite"),
        ("covariance", (3, 3), -4.0, "negative variances"),
        ("covariance", (6, 6), 0.0, "zero or negative variances"),
    ],
)
def test_a_damaged_pose_of_the_laser_is_refused_with_what_to_do(tmp_path, entry, place, value, message):
    path = tmp_path / "rig.json"
    StereoRig.save(RECT.rig, path)
    save_laser_pose(path, LIDAR)
    text = json.loads(path.read_text())
    text["lidar"][entry][place[0]][place[1]] = value
    path.write_text(json.dumps(text))
    with pytest.raises(ValueError, match=rf"rig\.json.*{message}.*calibrate-laser") as refused:
        Instrument.load(path)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("lidar", "message"),
    [
        ({}, "it has no 'T_left_lidar'"),
        (5, "an entry is of another kind"),
        ({"T_left_lidar": 3}, "it has no 'covariance'"),
    ],
)
def test_damage_is_named_without_python_s_words(tmp_path, lidar, message):
    path = StereoRig.save(RECT.rig, tmp_path / "rig.json")
    path.write_text(json.dumps(json.loads(path.read_text()) | {"lidar": lidar}))
    with pytest.raises(ValueError, match=rf"rig\.json: .* is damaged \({message}\): run `stereolib calibrate-laser`"):
        Instrument.load(path)


def test_a_calibration_that_keeps_its_covariance_knows_its_errors_from_place_to_place(tmp_path):
    views = corner_set(np.random.default_rng(41), rig=RECT.rig)
    diagnosis = diagnose(views)
    path = diagnosis.rig.save(tmp_path / "rig.json", calibration=calibration_facts(diagnosis))
    found = Instrument.load(path)
    known = SystematicUncertainty.of(found.rectified, rig_covariance(diagnosis.fit))
    np.testing.assert_allclose(found.uncertainty.covariance, known.covariance, rtol=1e-6, atol=1e-12)
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(60, 140, 5), np.linspace(200, 280, 5)))
    left, middle = found.uncertainty.at(u, v), found.uncertainty.at(u + 220, v)
    assert left.offset_px > 1.5 * middle.offset_px > 0
    np.testing.assert_allclose(left.covariance, known.at(u, v).covariance, rtol=1e-6, atol=1e-12)
    text = json.loads(path.read_text())
    del text["calibration"]["record"]
    path.write_text(json.dumps(text))
    old = Instrument.load(path).uncertainty
    assert old.errors is None and old.at(u, v) is old and old.offset_px == found.uncertainty.offset_px


def test_what_is_no_rig_file_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "rig.json"
    path.write_text("[1, 2]")
    for use in (Instrument.load, lambda path: save_laser_pose(path, LIDAR)):
        with pytest.raises(ValueError, match=r"rig\.json"):
            use(path)
    assert path.read_text() == "[1, 2]"


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -0.1, "wide", None])
@pytest.mark.parametrize("name", ["f_px", "baseline_mm", "offset_px"])
def test_deviations_that_are_none_are_refused_with_what_to_do(tmp_path, name, value):
    path = tmp_path / "rig.json"
    StereoRig.save(RECT.rig, path, calibration={"std": {"rectified": {name: 0.1}}})
    path.write_text(path.read_text().replace("0.1", json.dumps(value)))
    with pytest.raises(ValueError, match=r"rig\.json: .*damaged.*run `stereolib calibrate` again$"):
        Instrument.load(path)


def test_what_of_a_calibration_goes_together_is_kept(tmp_path):
    path, known = (
        tmp_path / "rig.json",
        {"f_px": 2.0, "baseline_mm": 0.5, "offset_px": 0.1, "correlation": [0.5, 0.0, -0.8]},
    )
    StereoRig.save(RECT.rig, path, calibration={"std": {"rectified": known}})
    covariance = Instrument.load(path).uncertainty.covariance
    assert covariance == pytest.approx(np.array([[4.0, 0.5, 0.0], [0.5, 0.25, -0.04], [0.0, -0.04, 0.01]]))


@pytest.mark.parametrize("together", [[0.1, 0.2], [0.0, 1.5, 0.0], ["much", 0, 0], None])
def test_correlations_that_are_none_are_refused_with_what_to_do(tmp_path, together):
    path = tmp_path / "rig.json"
    StereoRig.save(RECT.rig, path, calibration={"std": {"rectified": {"f_px": 0.1, "correlation": together}}})
    with pytest.raises(ValueError, match=r"rig\.json: .*damaged.*run `stereolib calibrate` again$"):
        Instrument.load(path)


def test_a_rig_that_cannot_be_rectified_is_named(tmp_path):
    path = StereoRig(RECT.rig.left, RECT.rig.right, RECT.rig.R, -RECT.rig.T).save(tmp_path / "rig.json")
    with pytest.raises(ValueError, match=r"rig\.json: the right camera must stand to the right.*swap the cameras"):
        Instrument.load(path)
