"""Cameras that were turned sideways since their calibration: what one pair tells of it, and what is measured then."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support import box_scenes
from support.disturbances import case
from support.measured import the_cube

from stereolib.calibration import DisparityErrors
from stereolib.measurement import (
    Instrument,
    floor_from_pose,
    length_between,
    measure_depth,
    measure_objects,
    see_standing,
)
from stereolib.measurement.camera_moves import _likely, moved_back, see_pair
from stereolib.measurement.views import Views
from stereolib.rig import Camera, StereoRig
from stereolib.virtual import recordings

PAIR = recordings.load_pair("conditions/texture")
DEGREES = [-0.8, -0.3, 0.3, 0.8]
CUBE_MM, SAID = 300.0, "turned sideways against each other"


def believed(degrees, side, unsure=1.0):
    """The calibrated rig as it was before one of its cameras was turned sideways; `unsure` times as unsure."""
    known = box_scenes.instrument()
    rig, Y = known.rectified.rig, Rotation.from_euler("y", degrees, degrees=True).as_matrix()
    before = StereoRig(rig.left, rig.right, *((Y @ rig.R, Y @ rig.T) if side == "right" else (rig.R @ Y, rig.T)))
    rectified, errors = before.rectify(), known.uncertainty.errors
    uncertainty = replace(known.uncertainty, errors=DisparityErrors(rectified, unsure**2 * errors.covariance))
    return Instrument(rectified, known.lidar, uncertainty)


def cube_of(instrument, scan=None):
    found = measure_objects(*PAIR, scan, instrument)
    return the_cube(found), found


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("degrees", DEGREES)
def test_a_turn_is_told_from_the_pair_alone_and_corrected(degrees, side):
    instrument = believed(degrees, side)
    thing, found = cube_of(instrument)
    off = np.abs(thing.size_mm - CUBE_MM)
    assert (off < 3 * thing.std_mm).all() and (off < 5).all()
    (said,) = [text for text in found.warnings if SAID in text]
    told, std = (float(number) for number in said.split(" by ")[1].split(" degrees")[0].split(" ± "))
    assert abs(told - abs(degrees)) < 3 * std < 0.25 and "calibrate again" in said
    unknown = cube_of(without_deviations(instrument))[0]  # the same rig, if nobody knows how sure its calibration is
    assert not (np.abs(unknown.size_mm - CUBE_MM) < 0.02 * CUBE_MM).all()  # NaN: refused


def test_a_turn_leaves_intervals_wider_than_those_of_a_rig_that_nobody_turned():
    sure, turned = cube_of(box_scenes.instrument())[0], cube_of(believed(0.5, "right"))[0]
    assert (turned.std_mm > 1.2 * sure.std_mm).all() and (turned.std_mm < 0.01 * CUBE_MM).all()


def test_of_a_rig_that_was_not_turned_nothing_changes():
    instrument = box_scenes.instrument()
    views, now = see_pair(*PAIR, instrument)
    plain = Views.of(*PAIR, instrument.rectified)
    np.testing.assert_array_equal(views.right, plain.right)
    assert now.rectified is instrument.rectified and now.moves.chance == now.turn_std_px == 0
    assert 1 < now.moves.seen_px < 4
    _, found = cube_of(instrument)
    assert f"less than {now.moves.seen_px:.1f} px of it may show in nothing here" in " ".join(found.warnings)


def test_the_correction_grows_without_a_step_from_nothing_to_all_of_it():
    """Where the odds turn it grows fast, but by no more than its deviation says that it may be off."""
    degrees = np.linspace(0.06, 0.26, 51)
    turns = [moved_back(*PAIR, believed(d, "right")).moves for d in degrees]
    told, std, chance = np.transpose([(abs(turn.turn_px), turn.turn_std_px, turn.chance) for turn in turns])
    true = np.radians(degrees) * box_scenes.instrument().rectified.f_px
    assert chance[0] == 0 and chance[-1] > 0.99 and abs(told[-1] - true[-1]) < 3 * std[-1]
    assert (np.abs(np.diff(told)) < 1.2 * np.maximum(std[1:], std[:-1]) + 1e-3).all()
    open_ = (chance > 0.3) & (chance < 0.95)
    assert open_.sum() > 3 and (np.abs(told - true)[open_] < 3 * std[open_]).all()


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_calibration_that_is_less_sure_than_the_rows_tells_no_turn(side):
    """Where its own errors let rows drift apart as far, the sizes stay those of the rig as it was calibrated."""
    instrument = believed(0.2, side, unsure=30.0)
    now = moved_back(*PAIR, instrument)
    assert now.moves.chance < 0.1 and now.rectified.f_px == instrument.rectified.f_px
    assert now.moves.seen_px > 5


def test_a_rig_whose_calibration_tells_no_deviations_is_taken_as_it_is():
    rectified = box_scenes.instrument().rectified
    for instrument in (
        Instrument(rectified),
        replace(believed(0.5, "right"), uncertainty=Instrument(rectified).uncertainty),
    ):
        assert moved_back(*PAIR, instrument) is instrument
        assert see_pair(*PAIR, instrument)[1] is instrument


def test_a_length_between_two_pixels_and_depths_know_of_a_turn():
    instrument, known = believed(0.5, "right"), box_scenes.instrument()
    ends = recordings_ends()
    one, other = (length_between(*PAIR, ends, each) for each in (known, instrument))
    assert abs(one.length_mm - other.length_mm) < 3 * np.hypot(one.std_mm, other.std_mm)
    assert any(SAID in text for text in other.warnings)
    one, other = (measure_depth(*PAIR, each, "fast") for each in (known, instrument))
    share = np.nanmedian(other.depth_mm) / np.nanmedian(one.depth_mm)
    assert abs(share - 1) < 0.015 and any(SAID in text for text in other.instrument.warnings)


def test_what_is_left_open_of_a_turn_is_in_the_deviations(monkeypatch):
    instrument, ends = believed(0.5, "right"), recordings_ends()
    depth = measure_depth(*PAIR, instrument)
    left_open = depth.instrument.turn_std_px
    without = replace(depth, instrument=replace(depth.instrument, moves=None))
    d, there = depth.match.estimate.disparity_px, np.isfinite(depth.std_mm) & np.isfinite(without.std_mm)
    more = depth.std_mm[there] ** 2 - without.std_mm[there] ** 2
    np.testing.assert_allclose(more, (depth.depth_mm[there] * left_open / d[there]) ** 2, rtol=2e-2)
    told = length_between(*PAIR, ends, instrument).std_mm
    monkeypatch.setattr(Instrument, "turn_std_px", 0.0)
    assert length_between(*PAIR, ends, instrument).std_mm < told


def test_a_floor_that_was_given_stays_where_it_is_below_the_left_camera():
    instrument = believed(0.8, "right")
    floor = floor_from_pose(instrument.rectified, recordings.setup())
    views, now = see_pair(*PAIR, instrument)
    found = see_standing(views, now, floor=floor).floor
    assert found.rectified is now.rectified and found.camera_height_mm == pytest.approx(floor.camera_height_mm)
    down = [each.rectified.R1.T @ each.down for each in (floor, found)]
    np.testing.assert_allclose(*down, atol=1e-9)
    assert np.abs(found.down - floor.down).max() > 1e-4  # its cameras look elsewhere


def moved(instrument, *, rise_mm=0.0, ahead_mm=0.0, tilt_deg=0.0, k1=(0.0, 0.0)):
    """The same rig as it was before something else moved, and how sure its calibration is of it."""
    rig, Y = instrument.rectified.rig, Rotation.from_euler("x", tilt_deg, degrees=True).as_matrix()
    lenses = [
        Camera(lens.K, lens.dist + np.r_[more, np.zeros(lens.dist.size - 1)], lens.size)
        for lens, more in zip((rig.left, rig.right), k1, strict=True)
    ]
    rectified = StereoRig(*lenses, Y @ rig.R, Y @ (rig.T + np.array([0.0, rise_mm, ahead_mm]))).rectify()
    errors = DisparityErrors(rectified, instrument.uncertainty.errors.covariance)
    return replace(instrument, rectified=rectified, uncertainty=replace(instrument.uncertainty, errors=errors))


@pytest.mark.parametrize(
    "how",
    [
        {"rise_mm": 3.0}, {"rise_mm": -3.0}, {"ahead_mm": 4.0}, {"ahead_mm": -4.0}, {"tilt_deg": 0.2},
        {"k1": (0.01, 0.01)}, {"k1": (-0.01, -0.01)}, {"k1": (0.0, 0.01)},
    ],
)  # fmt: skip
@pytest.mark.parametrize("number", [1005, 1007])
def test_what_else_moves_passes_for_no_turn(how, number):
    """Each lets rows disagree, too, and some of it towards the corners: of boxes that stand out from their floor."""
    shot, known = case("undisturbed", number, box_scenes.shoot)
    moves = see_pair(shot.left, shot.right, moved(known, **how))[1].moves
    assert moves is None or (abs(moves.turn_px) < 0.5 and ("rise_mm" in how or abs(moves.rise_mm) < 0.5))


@pytest.mark.parametrize("rise_mm", [-3.0, -0.8, 0.8, 3.0])
@pytest.mark.parametrize("number", [1005, 1007])
def test_a_right_camera_that_rose_is_told_and_corrected(number, rise_mm):
    shot, known = case("undisturbed", number, box_scenes.shoot)
    instrument = moved(known, rise_mm=-rise_mm)
    views, now = see_pair(shot.left, shot.right, instrument)
    taken_as_it_was = Views.of(shot.left, shot.right, instrument.rectified)
    apart, before = (np.percentile(np.abs(each.rows.cells.offset_px), 75) for each in (views, taken_as_it_was))
    assert apart < 0.25 and apart < before * (1 if abs(rise_mm) < 1 else 0.8)
    found = measure_objects(shot.left, shot.right, None, instrument)
    off = box_scenes.errors(box_scenes.the_box(found, shot.truth), shot.truth)
    assert len(off) > 1 and "height" in off and all(abs(pct) < 2 and abs(z) < 3.5 for pct, z in off.values())
    said = [text for text in found.warnings if "of a right camera that" in text]
    assert len(said) == (abs(now.moves.rise_mm) > 0.005 * now.rectified.baseline_mm)  # smaller ones need no word
    how = f" {'rose' if rise_mm > 0 else 'sank'} by {abs(now.moves.rise_mm):.1f} ± "
    assert all(how in text and "moved between the two pictures" in text for text in said)
    assert abs(now.moves.rise_mm - rise_mm) < 3 * now.moves.rise_std_mm + 0.25 < 2.5  # the calibration errs, too
    rectified = now.rectified
    np.testing.assert_allclose(rectified.R2 @ rectified.rig.T, [-rectified.baseline_mm, 0, 0], atol=1e-9)
    np.testing.assert_allclose(rectified.R2 @ rectified.rig.R, rectified.R1, atol=1e-9)


def test_a_calibration_that_is_less_sure_than_the_rows_tells_no_rise():
    shot, known = case("undisturbed", 1007, box_scenes.shoot)
    sure = moved(known, rise_mm=-1.0)
    errors = sure.uncertainty.errors
    unsure = replace(errors, covariance=30.0**2 * errors.covariance)
    instrument = replace(sure, uncertainty=replace(sure.uncertainty, errors=unsure))
    told = [moved_back(shot.left, shot.right, each).moves.rise_mm for each in (sure, instrument)]
    assert told[0] > 0.5 and told[1] == 0


@pytest.mark.parametrize("number", [1000, 1002, 1004, 1005])
def test_rows_that_sank_in_a_part_of_the_picture_tell_no_rise_surely(number):
    shot, known = case("undisturbed", number, box_scenes.shoot)
    right = shot.right.copy()
    right[241:] = shot.right[240:-1]
    moves = moved_back(shot.left, right, known).moves
    assert abs(moves.rise_mm) < max(0.3, 3 * moves.rise_std_mm)


def test_a_rise_is_corrected_without_a_step_by_more_than_shows():
    shot, known = case("undisturbed", 1007, box_scenes.shoot)
    rises_mm = np.linspace(0.0, 0.8, 33)
    told = [moved_back(shot.left, shot.right, moved(known, rise_mm=-mm)).moves.rise_mm for mm in rises_mm]
    in_rows_px = known.rectified.f_px / 5 / known.rectified.baseline_mm  # of what stands five baselines away
    assert (
        told[0] == 0 and (np.abs(np.diff(told)) * in_rows_px < 0.5).all() and told[-1] == pytest.approx(0.8, abs=0.25)
    )


def test_the_deviation_is_that_of_a_move_and_of_none_together():
    rng, priors = np.random.default_rng(1), 760 * np.array([np.radians(0.5), 0.03 / 5])
    for k in (0.0, 1.2, 1.5, 1.8, 4.0):
        told = np.transpose(_likely(np.full(2, k), np.full(2, 0.4**2), 760.0)[:3])
        for t, (mean, std, chance) in zip(priors**2, told, strict=True):
            s = 0.4**2 + 0.05**2
            drawn = rng.normal(k * t / (s + t), np.sqrt(s * t / (s + t)), 400_000) * (rng.random(400_000) < chance)
            assert (mean, std) == pytest.approx((drawn.mean(), drawn.std()), rel=0.02, abs=1e-3)
    assert (_likely(np.zeros(2), np.full(2, 0.4**2), 760.0)[2] == 0).all()
    assert (_likely(np.full(2, 4.0), np.full(2, 0.4**2), 760.0)[2] > 0.99).all()


def test_a_rig_that_was_moved_back_already_stays_so():
    now = moved_back(*PAIR, believed(0.5, "right"))
    assert moved_back(*PAIR, now) is now and see_pair(*PAIR, now)[1] is now


def recordings_ends():
    """Two corners of the cube's face, raw pixels of the left picture."""
    truth, rectified = recordings.load_truth("conditions/texture"), box_scenes.instrument().rectified
    on = np.argwhere(truth.visible & (truth.box == 1) & np.isfinite(truth.disparity_px))[:, ::-1]
    inner = on[(np.abs(on - np.median(on, axis=0)) < 60).all(axis=1)]
    both = np.array([inner[0], inner[-1]], float)
    back = rectified.R1.T @ np.linalg.inv(rectified.P1[:, :3]) @ np.column_stack([both, np.ones(2)]).T
    return rectified.rig.left.project(back.T)


def without_deviations(instrument):
    return replace(instrument, uncertainty=replace(instrument.uncertainty, errors=None))
