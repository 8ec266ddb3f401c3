"""Turns, their average, the gate, and what moves between turns, against known truth."""

from dataclasses import replace

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
    holes = laser.join_readings([whole[:70], whole[75:]])  # 5 lost in the second turn
    scans = laser.turns(holes)
    assert [s.complete for s in scans] == [False, False, True, False]
    assert np.flatnonzero(np.isnan(scans[1].ranges_mm)).tolist() == list(range(40, 60))
    across = laser.join_readings([whole[:140], whole[160:]])  # 20 lost about the turn's end
    scans = laser.turns(across)
    assert [s.complete for s in scans] == [False, False, False, False]
    assert [int(np.isfinite(s.ranges_mm).sum()) for s in scans] == [240, 320, 320, 120]
    assert scans[2].stamp_s - scans[1].stamp_s == pytest.approx(0.2, rel=0.15)
    assert laser.turns(laser.decode(b"")) == []


def test_one_lost_packet_leaves_a_turn_incomplete():
    whole = packets(270)
    holes = laser.join_readings([whole[:130], whole[131:]])
    assert [s.complete for s in laser.turns(holes)] == [True, False, True]


def test_an_index_that_comes_again_begins_a_turn():
    """A sensor that sends one packet only, or a whole turn that was lost."""
    again = laser.join_readings([packets(90), packets(1, start=89), packets(1, start=89)])
    scans = laser.turns(again)
    assert [s.complete for s in scans] == [True, False, False]
    assert [int(np.isfinite(s.ranges_mm).sum()) for s in scans] == [360, 4, 4]


@given(seed=st.integers(0, 2**32))
@settings(deadline=None, max_examples=30)
def test_no_reading_is_lost_or_moved_by_turns(seed):
    rng = np.random.default_rng(seed)
    all_packets = packets(400)
    kept = np.flatnonzero(rng.random(400) < 0.8)
    some = laser.join_readings([all_packets[:0], *(all_packets[k : k + 1] for k in kept)])
    scans = laser.turns(some)
    got = np.concatenate([s.ranges_mm[np.isfinite(s.ranges_mm)] for s in scans])
    np.testing.assert_array_equal(got, some.distance_mm.ravel())
    for s in scans:  # 1000 + b mm: the beam's own angle is in its reading
        beams = np.flatnonzero(np.isfinite(s.ranges_mm))
        np.testing.assert_array_equal((s.ranges_mm[beams] - 1000) % 360, beams)


def test_a_clockwise_scan_is_turned_round():
    ranges = np.full(270, 2000.0)
    ranges[80:100] = 700
    ranges[7] = np.nan
    step = np.deg2rad(1.0)
    forward = laser.LaserScan(ranges, np.arange(270.0), angle_min_rad=-1.0, angle_increment_rad=step)
    back = laser.LaserScan(
        ranges[::-1], np.arange(270.0)[::-1], angle_min_rad=forward.angle_max_rad, angle_increment_rad=-step
    )
    assert (back.angle_increment_rad, back.angle_min_rad) == (step, pytest.approx(-1.0))
    assert back.angle_max_rad == pytest.approx(forward.angle_max_rad)
    np.testing.assert_array_equal(back.ranges_mm, forward.ranges_mm)
    np.testing.assert_array_equal(back.intensities, forward.intensities)
    np.testing.assert_allclose(laser.points_mm(back), laser.points_mm(forward), atol=1e-9)
    found = [[(part.kind, part.beams.tolist()) for part in laser.find_segments(one)] for one in (back, forward)]
    assert found[0] == found[1] and len(found[0]) == 3
    with pytest.raises(ValueError, match="read-only"):
        back.ranges_mm[0] = 0


def test_an_average_is_turned_round_with_all_its_arrays():
    mean = laser.average([scan(1000 + k * np.arange(360.0)) for k in (0, 1, 2)])
    arrays = {name: value[::-1] for name, value in vars(mean).items() if isinstance(value, np.ndarray)}
    turned = {"angle_min_rad": mean.angle_max_rad, "angle_increment_rad": -mean.angle_increment_rad}
    back = replace(mean, **arrays, **turned)
    for name in arrays:
        np.testing.assert_array_equal(getattr(back, name), getattr(mean, name))
    assert {"spread_mm", "still_spread_mm", "count", "dropout"} < arrays.keys()


@pytest.mark.parametrize("step", [0.0, np.nan, np.inf, -np.inf])
def test_beams_without_an_angle_between_them_are_refused(step):
    with pytest.raises(ValueError, match=r"must be a number of rad other than 0, got (0|nan|-?inf)"):
        scan(np.ones(360), angle_increment_rad=step)


@pytest.mark.parametrize("step", [1.0, -1.0])
def test_more_than_a_turn_is_refused(step):
    with pytest.raises(ValueError, match=r"360 beams at steps of 1 rad are more than a turn: .* in degrees"):
        scan(np.ones(360), angle_increment_rad=step)
    with pytest.raises(ValueError, match="1 beam at steps of 7 rad"):
        scan([900.0], angle_increment_rad=7 * step)
    both_ends = np.float32(2 * np.pi / 359)  # as ROS drivers send it: the last beam is the first again
    assert len(scan(np.ones(360), angle_increment_rad=float(both_ends)).ranges_mm) == 360


def test_the_hand_moves_and_the_walls_do_not(recording):
    scans = [s for s in laser.turns(laser.read_recording(recording)) if s.complete]
    moving = laser.moving_readings(scans)
    assert moving.shape == (120, 360)
    per_turn = moving.sum(axis=1)  # the hand comes at turn 13, goes, and comes back at the end
    assert per_turn[:13].sum() == 0 and per_turn[91:113].sum() == 0
    assert (per_turn[13:83] > 0).all() and per_turn[13:83].max() <= 30


def test_what_stands_still_scatters_as_before_the_hand_came(recording):
    scans = [s for s in laser.turns(laser.read_recording(recording)) if s.complete]
    before, whole = laser.average(scans[:13]), laser.average(scans)  # the hand comes at turn 13
    near = whole.ranges_mm < 500
    assert np.nanmedian(before.spread_mm[near]) == pytest.approx(0.28, abs=0.01)
    assert np.nanmedian(whole.spread_mm[near]) > 10
    assert np.nanmedian(whole.still_spread_mm[near]) < 1.2 * np.nanmedian(before.spread_mm[near])


def test_average_against_numpy():
    rng = np.random.default_rng(0)
    stack = np.rint(rng.normal(1000, 20, (7, 360)))
    stack[rng.random(stack.shape) < 0.3] = np.nan
    stack[:, 5], stack[1:, 6] = np.nan, np.nan
    stack[0, 6] = 990
    scans = [scan(row) for row in stack]
    for method, slow in (("median", np.median), ("mean", np.mean)):
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


def test_still_spread_leaves_out_what_moved():
    rng = np.random.default_rng(0)
    stack = np.rint(rng.normal(1000, 2, (40, 360)))
    still = laser.average([scan(row) for row in stack])
    np.testing.assert_array_equal(still.still_spread_mm, still.spread_mm)
    stack[7:12] -= 300  # a hand before every beam
    moved = laser.average([scan(row) for row in stack])
    assert np.median(moved.spread_mm) > 90
    assert np.median(moved.still_spread_mm) == pytest.approx(np.median(still.spread_mm), rel=0.05)


def test_average_refuses_what_it_cannot_do():
    with pytest.raises(ValueError, match="no turns given"):
        laser.average([])
    with pytest.raises(ValueError, match="of 2 turns none is complete"):
        laser.average([scan(np.ones(360), complete=False)] * 2)
    assert laser.average([scan(np.ones(360), complete=False)], complete_only=False).n_turns == 1
    with pytest.raises(ValueError, match="median, mean; got 'mode'"):
        laser.average([scan(np.ones(360))], "mode")


def test_turns_of_other_beams_are_not_combined():
    ranges = np.full(360, 1000.0)
    with pytest.raises(ValueError, match=r"different beams, angle_min_rad 0 and 0\.5: take those of one sensor"):
        laser.average([scan(ranges), scan(ranges, angle_min_rad=0.5)])
    with pytest.raises(ValueError, match="emitter_offset_mm 0 and 25"):
        laser.average([scan(ranges), scan(ranges, emitter_offset_mm=0.0)])
    with pytest.raises(ValueError, match="have 180 and 360 beams"):
        laser.moving_readings([scan(ranges), scan(ranges[:180])])


@pytest.mark.parametrize("ranges, strength", [(np.ones((2, 3)), np.ones((2, 3))), (np.ones(3), np.ones(2)), (1.0, 1.0)])
def test_a_scan_has_one_number_a_beam(ranges, strength):
    with pytest.raises(ValueError, match=r"one number a beam.*ranges_mm \("):
        laser.LaserScan(ranges, strength)


def test_gate():
    gated = laser.gate(scan([100, 2999, 3000, 3001, np.nan]), max_mm=3000)
    np.testing.assert_array_equal(gated.ranges_mm, [100, 2999, 3000, np.nan, np.nan])
    kept = laser.gate(laser.average([scan(np.full(360, 3500.0))]))
    assert isinstance(kept, laser.AveragedScan) and np.isnan(kept.ranges_mm).all()
    with pytest.raises(ValueError, match="max_mm > 0"):
        laser.gate(kept, max_mm=0)
