"""Turns, averages, gate, points and walls of scans, and the error model, against known truth."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereolib import laser
from stereolib.base import datasets


@pytest.fixture(scope="module")
def recording():
    try:
        return datasets.real_recording("xv11/hand_in_box.txt")
    except datasets.NotAvailable as reason:
        pytest.skip(str(reason))


def packets(n, start=0, distance_mm=None, **kwargs):
    """`n` packets in a row; by default beam b of the stream measures 1000 + b mm."""
    if distance_mm is None:
        distance_mm = 1000.0 + np.arange(4 * start, 4 * (start + n))
    index = (start + np.arange(n)) % 90
    return laser.Readings.build(index, np.reshape(distance_mm, (n, 4)), 100, **kwargs)


def scan(ranges_mm, **kwargs):
    ranges = np.asarray(ranges_mm, float)
    return laser.LaserScan(ranges, np.full(len(ranges), 100.0), **kwargs)


def test_turns_put_every_beam_at_its_angle():
    scans = laser.turns(packets(180))
    assert [s.complete for s in scans] == [True, True]
    np.testing.assert_array_equal(scans[0].ranges_mm, 1000 + np.arange(360))
    np.testing.assert_array_equal(scans[1].ranges_mm, 1360 + np.arange(360))
    first = scans[0]
    np.testing.assert_allclose(first.angles_rad, np.deg2rad(np.arange(360)))
    assert first.angle_max_rad == pytest.approx(np.deg2rad(359))
    assert first.scan_time_s == pytest.approx(0.2)
    assert first.time_increment_s == pytest.approx(0.2 / 360)
    assert scans[1].stamp_s == pytest.approx(0.2)
    with pytest.raises(ValueError, match="read-only"):
        first.ranges_mm[0] = 0


def test_lost_packets_and_cut_turns():
    whole = packets(270, start=30)  # 60 packets, two whole turns, 30 packets
    assert [s.complete for s in laser.turns(whole)] == [False, True, True, False]
    holes = laser.concatenate([whole[:70], whole[75:]])  # 5 lost in the second turn
    scans = laser.turns(holes)
    assert [s.complete for s in scans] == [False, False, True, False]
    assert np.flatnonzero(np.isnan(scans[1].ranges_mm)).tolist() == list(range(40, 60))
    across = laser.concatenate([whole[:140], whole[160:]])  # 20 lost about the turn's end
    scans = laser.turns(across)
    assert [s.complete for s in scans] == [False, False, False, False]
    assert [int(np.isfinite(s.ranges_mm).sum()) for s in scans] == [240, 320, 320, 120]
    assert scans[2].stamp_s - scans[1].stamp_s == pytest.approx(0.2, rel=0.15)
    assert laser.turns(laser.decode(b"")) == []


@given(seed=st.integers(0, 2**32))
@settings(deadline=None, max_examples=30)
def test_no_reading_is_lost_or_moved_by_turns(seed):
    rng = np.random.default_rng(seed)
    all_packets = packets(400)
    kept = np.flatnonzero(rng.random(400) < 0.8)
    some = laser.concatenate([all_packets[:0], *(all_packets[k : k + 1] for k in kept)])
    scans = laser.turns(some)
    got = np.concatenate([s.ranges_mm[np.isfinite(s.ranges_mm)] for s in scans])
    np.testing.assert_array_equal(got, some.distance_mm.ravel())
    for s in scans:  # 1000 + b mm: the beam's own angle is in its reading
        beams = np.flatnonzero(np.isfinite(s.ranges_mm))
        np.testing.assert_array_equal((s.ranges_mm[beams] - 1000) % 360, beams)


def test_real_recording(recording):
    about = laser.info(recording)
    assert (about["packets"], about["turns"], about["bad_checksums"]) == (11451, 120, 1)
    assert 295 < about["rpm_median"] < 298 and 49 < about["rpm_min"] < 51
    assert about["invalid_share"] == pytest.approx(0.0611, abs=5e-5)
    assert json.loads(json.dumps(about)) == about


def test_real_walls_are_straight_with_the_geometry_correction(recording):
    scans = [s for s in laser.turns(laser.load(recording)) if s.complete]
    mean = laser.average(scans)

    def walls(points, threshold_mm):
        found = laser.fit_walls(points, 4, threshold_mm=threshold_mm, rng=np.random.default_rng(0))
        squares = np.concatenate([w.residuals_mm[w.inliers] ** 2 for w in found])
        return found, float(np.sqrt(squares.mean())), len(squares)

    corrected, rms_mm, used = walls(laser.points_mm(mean, geometry_correction=True), 4.0)
    assert rms_mm <= 1.1 and used >= 340
    assert max(w.rms_mm for w in corrected) <= 1.85
    _, wide_rms_mm, wide_used = walls(laser.points_mm(mean, geometry_correction=True), 6.0)
    assert wide_rms_mm <= 1.85 and wide_used >= 358
    _, plain_rms_mm, _ = walls(laser.points_mm(mean), 6.0)
    assert wide_rms_mm < 0.8 * plain_rms_mm
    angles = np.sort(np.rad2deg([w.angle_rad for w in corrected]))
    np.testing.assert_allclose(np.diff(angles), 90, atol=3)


def test_the_hand_moves_and_the_walls_do_not(recording):
    scans = [s for s in laser.turns(laser.load(recording)) if s.complete]
    seen = laser.moving(scans)
    assert seen.shape == (120, 360)
    per_turn = seen.sum(axis=1)  # the hand comes at turn 13, goes, and comes back at the end
    assert per_turn[:13].sum() == 0 and per_turn[91:113].sum() == 0
    assert (per_turn[13:83] > 0).all() and per_turn[13:83].max() <= 30


def test_average_against_numpy():
    rng = np.random.default_rng(0)
    stack = np.rint(rng.normal(1000, 20, (7, 360)))
    stack[rng.random(stack.shape) < 0.3] = np.nan
    stack[:, 5], stack[1:, 6] = np.nan, np.nan
    stack[0, 6] = 990
    scans = [scan(row) for row in stack]
    for method, slow in (("median", np.median), ("mean", np.mean), ("trimmed", trimmed)):
        a = laser.average(scans, method)
        for beam in range(360):
            values = stack[np.isfinite(stack[:, beam]), beam]
            assert a.count[beam] == len(values)
            assert a.dropout[beam] == pytest.approx(1 - len(values) / 7)
            if len(values):
                assert a.ranges_mm[beam] == pytest.approx(slow(values))
            else:
                assert np.isnan(a.ranges_mm[beam])
            if len(values) > 1:
                assert a.spread_mm[beam] == pytest.approx(values.std(ddof=1))
            else:
                assert np.isnan(a.spread_mm[beam])
    assert a.n_turns == 7


def trimmed(values):
    cut = int(0.2 * len(values))
    return np.sort(values)[cut : len(values) - cut].mean()


def test_average_refuses_what_it_cannot_do():
    with pytest.raises(ValueError, match="no turns given"):
        laser.average([])
    with pytest.raises(ValueError, match="none of the 2 turns is complete"):
        laser.average([scan(np.ones(360), complete=False)] * 2)
    assert laser.average([scan(np.ones(360), complete=False)], complete_only=False).n_turns == 1
    with pytest.raises(ValueError, match="median, mean, trimmed"):
        laser.average([scan(np.ones(360))], "mode")
    with pytest.raises(ValueError, match=r"0 <= trim < 0\.5"):
        laser.average([scan(np.ones(360))], "trimmed", trim=0.5)


def test_gate():
    gated = laser.gate(scan([100, 2999, 3000, 3001, np.nan]), max_mm=3000)
    np.testing.assert_array_equal(gated.ranges_mm, [100, 2999, 3000, np.nan, np.nan])
    kept = laser.gate(laser.average([scan(np.full(360, 3500.0))]))
    assert isinstance(kept, laser.AveragedScan) and np.isnan(kept.ranges_mm).all()
    with pytest.raises(ValueError, match="min_mm < max_mm"):
        laser.gate(kept, max_mm=0)


def test_points():
    ranges = np.full(360, np.nan)
    ranges[[0, 90, 180]] = 1000, 2000, 500
    np.testing.assert_allclose(laser.points_mm(scan(ranges)), [[1000, 0], [0, 2000], [-500, 0]], atol=1e-9)
    assert laser.points_mm(scan(ranges), keep_invalid=True).shape == (360, 2)
    side = 25 * np.array([np.cos(np.deg2rad(-82)), np.sin(np.deg2rad(-82))])
    np.testing.assert_allclose(laser.points_mm(scan(ranges), geometry_correction=True)[0], [1000 + side[0], side[1]])


def test_walls_of_a_known_room():
    rng = np.random.default_rng(1)
    t = np.linspace(-1, 1, 120)
    room = np.concatenate([
        np.stack([np.full(120, 900.0), 700 * t], axis=1),
        np.stack([np.full(120, -600.0), 700 * t], axis=1),
        np.stack([750 * t + 150, np.full(120, 700.0)], axis=1),
        np.stack([750 * t + 150, np.full(120, -700.0)], axis=1),
    ])  # fmt: skip
    turn = np.deg2rad(17)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    points = (room + rng.normal(0, 1.0, room.shape)) @ rotation.T
    clutter = rng.uniform(-500, 500, (60, 2))
    walls = laser.fit_walls(np.concatenate([points, clutter]), 4, rng=rng)
    found = sorted((round(np.rad2deg(w.angle_rad)) % 360, w.offset_mm) for w in walls)
    assert [angle for angle, _ in found] == [17, 107, 197, 287]
    np.testing.assert_allclose([offset for _, offset in found], [900, 700, 600, 700], atol=0.5)
    for w in walls:
        assert w.inliers.sum() >= 115 and 0.8 < w.rms_mm < 1.3
        ends = w.ends_mm(np.concatenate([points, clutter]))
        np.testing.assert_allclose(ends @ w.normal, w.offset_mm)


def test_line_at_right_angles_not_along_y():
    line = laser.fit_line([[5, -100], [5, 0], [5, 200]])  # upright: no slope to speak of
    np.testing.assert_allclose(line.normal, [1, 0], atol=1e-12)
    assert line.offset_mm == pytest.approx(5) and line.rms_mm == pytest.approx(0, abs=1e-9)
    with_outlier = np.array([[10.0 * x, 10.0] for x in range(20)] + [[10.0, 60.0]])
    robust = laser.fit_line(with_outlier, threshold_mm=20)
    assert robust.inliers.tolist() == [True] * 20 + [False]
    assert robust.offset_mm == pytest.approx(10)
    with pytest.raises(ValueError, match="at least 2 finite points"):
        laser.fit_line([[1, 2]])
    with pytest.raises(ValueError, match="walls found"):
        laser.fit_walls(with_outlier[:20], 4, rng=np.random.default_rng(0))


def test_files_that_are_no_recordings(tmp_path):
    path = tmp_path / "scan.bin"
    path.write_bytes(b"")
    with pytest.raises(ValueError, match=r"is empty.*power"):
        laser.load(path)
    path.write_bytes(np.random.default_rng(0).bytes(5000))
    with pytest.raises(ValueError, match=r"is no XV-11 recording.*115200"):
        laser.load(path)
    path.write_bytes(np.random.default_rng(0).bytes(5000) + laser.encode(packets(1)))
    with pytest.raises(ValueError, match=r"5022 bytes.* is no XV-11"):
        laser.load(path)  # one packet by chance does not make a recording
    path.write_bytes(laser.encode(packets(90)) + laser.encode(packets(90), "turns"))
    with pytest.raises(ValueError, match=r"mixes two firmwares: 90 packets .* 1 turns"):
        laser.load(path)
    path.write_bytes(laser.encode(packets(45)))
    assert laser.info(path)["turns"] == 0 and laser.info(path)["partial_turns"] == 1
    path.write_bytes(laser.encode(packets(180), "turns"))
    about = laser.info(path)
    assert about["turns"] == 2 and about["rpm_median"] is None
    assert about["firmware"] == "1446-byte turns"


def test_error_curve():
    curve = laser.error_curve([500, 1000], [[503, 505, np.nan, 507], [990, 1010]])
    np.testing.assert_allclose(curve.bias_mm, [5, 0])
    np.testing.assert_allclose(curve.spread_mm, [2, 200**0.5])
    np.testing.assert_allclose(curve.percent, [1, 1])
    np.testing.assert_allclose(curve.dropout, [0.25, 0])
    assert curve.n.tolist() == [3, 2]
    empty = laser.error_curve([500], [[np.nan]])
    assert np.isnan(empty.bias_mm[0]) and empty.dropout[0] == 1
    with pytest.raises(ValueError, match="2 distances and 1 arrays"):
        laser.error_curve([500, 600], [[1]])


@pytest.mark.parametrize("law", ["constant", "linear", "quadratic"])
def test_the_true_law_of_the_spread_wins(law):
    rng = np.random.default_rng(5)
    r = np.linspace(200, 5000, 25)
    truth = 1.5 + {"constant": 0, "linear": 2e-3, "quadratic": 1.2e-6}[law] * (
        r ** ["constant", "linear", "quadratic"].index(law)
    )
    spread = [rng.normal(0, s, 400).std(ddof=1) for s in truth]
    best, *others = laser.compare_sigma_laws(r, spread)
    if law == "constant":  # the others hold it as their special case, at the price of a parameter
        constant = laser.fit_sigma(r, spread, "constant")
        assert constant.aic <= best.aic + 2 and constant.a_mm == pytest.approx(1.5, rel=0.02)
    else:
        assert best.law == law and best.aic < others[0].aic - 10
        np.testing.assert_allclose(best(r), truth, rtol=0.05)


def test_fit_sigma_weighs_and_refuses():
    r = np.array([500.0, 1000, 2000, 3000, 4000])
    spread = 1 + 1e-6 * r**2
    spoilt = spread.copy()
    spoilt[2] = 100
    fit = laser.fit_sigma(r, spoilt, n=[1000, 1000, 2, 1000, 1000])
    assert fit.a_mm == pytest.approx(1, rel=0.1) and fit.b == pytest.approx(1e-6, rel=0.1)
    with pytest.raises(ValueError, match="at least four"):
        laser.fit_sigma(r[:3], spread[:3])
    with pytest.raises(ValueError, match="constant, linear, quadratic"):
        laser.fit_sigma(r, spread, "cubic")


def test_bias_is_learnt_on_one_half_and_gone_from_the_other():
    rng = np.random.default_rng(6)
    true = np.repeat(np.arange(200, 5001, 200.0), 400)
    bias = 4 - 3 * true / 1000 + 1.5 * (true / 1000) ** 2
    measured = true + bias + rng.normal(0, 3, true.shape)
    result = laser.bias_correction_test(true, measured, rng=rng)
    assert result["bias_before_mm"] > 8 and result["bias_after_mm"] < 0.4
    assert result["rms_after_mm"] == pytest.approx(3, rel=0.03)
    assert result["n_learn"] + result["n_test"] == len(true)
    learnt = laser.learn_bias(true, measured)
    np.testing.assert_allclose(learnt.coefficients_mm, [4, -3, 1.5], atol=0.3)
    np.testing.assert_allclose(learnt(true + bias), true, atol=0.5)
    with pytest.raises(ValueError, match=r"not known at 6000 mm; gate the scan"):
        learnt([1000, 6000, np.nan])
    with pytest.raises(ValueError, match="3 coefficients cannot be learnt from 2 distances"):
        laser.learn_bias([1000, 1000, 2000], [1001, 1002, 2003])


def test_error_falls_with_the_root_of_n_down_to_the_bias():
    rng = np.random.default_rng(7)
    readings = np.rint(1000.0 + 2 + rng.normal(0, 8, 5000))
    mean = laser.error_against_n(readings, 1000, rng=rng, method="mean")
    np.testing.assert_allclose(mean.rms_mm, mean.expected_mm, rtol=0.06)
    assert mean.bias_mm == pytest.approx(2, abs=0.35)
    assert mean.quantisation_mm == pytest.approx(0.2887, abs=1e-4)
    median = laser.error_against_n(readings, 1000, rng=rng)
    assert (np.diff(median.rms_mm) < 0.05).all()
    ratio = median.spread_mm[3:6] / mean.spread_mm[3:6]  # the median's price: sqrt(pi / 2) at most
    assert ((ratio > 1.05) & (ratio < 1.35)).all()
    assert laser.error_against_n([1000.0, 1001], 1000, rng=rng).n.tolist() == [1, 2]
    with pytest.raises(ValueError, match="none of the readings"):
        laser.error_against_n([np.nan], 1000, rng=rng)
