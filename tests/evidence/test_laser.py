"""Verdicts of notebook 05 turn with the scans, and what it says of a real unit holds on a second one."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO

import numpy as np
import pandas as pd
import pytest
from support.verdicts import assert_turns, verdict_of

from stereolib import evidence, laser
from stereolib.base import data_path, datasets, read_text
from stereolib.virtual import VirtualLidar, cube_scene

STATIC = pd.read_csv(StringIO(read_text(data_path("real/xv11_static_turns.csv"))))


def real_turns(low_mm: float, high_mm: float) -> np.ndarray:
    """Turns x beams of the real unit, where its beams end between two distances."""
    turns = STATIC.filter(like="turn").to_numpy(float)
    middle = np.median(turns, axis=1)
    return turns[(middle >= low_mm) & (middle < high_mm)].T


NEAR, FAR, WALL = real_turns(700, 740), real_turns(2600, 3000), real_turns(2600, 3400)


def turns_of(sigma_mm: float, distance_mm: float = 2800.0, shared_mm: float = 0.0) -> np.ndarray:
    """Seven turns of 200 beams, with noise of their own and some that all turns share."""
    rng = np.random.default_rng(1)
    return distance_mm + shared_mm * rng.standard_normal(200) + sigma_mm * rng.standard_normal((7, 200))


def counted(power: float, step_mm: float = 1.7, n: int = 300) -> np.ndarray:
    """Readings of 2.6 to 3.3 m that a sensor counts in steps growing with a power, and then rounds."""
    r = np.random.default_rng(2).uniform(2600, 3300, n)
    if power == 0:
        return np.rint(np.rint(r / step_mm) * step_mm)
    rate = step_mm / 3000.0**2
    return np.rint(1 / (np.rint(1 / r / rate) * rate))


def scan_of(
    heading_deg: float = 0.0, size_mm: tuple[float, float, float] = (300.0, 300.0, 300.0)
) -> laser.AveragedScan:
    pose = (0.0, 0.0, np.radians(heading_deg))
    data = VirtualLidar().scan(cube_scene(size_mm=size_mm), pose, np.random.default_rng(3), turns=5)
    return laser.average(laser.turns(laser.decode(data)))


def curve_of(errors_mm: float) -> laser.ErrorCurve:
    true = np.array([1000.0, 2000.0, 3000.0, 5000.0])
    return laser.error_curve(true, [np.full(100, d + errors_mm) for d in true])


def test_flight_time():
    clock, chip = evidence.find_step_pattern(counted(0, 1.25)), evidence.find_step_pattern(counted(2, 1.7))
    assert clock.power == 0
    assert chip.power == 2 and chip.step_mm(3000) == pytest.approx(1.7, abs=0.01)
    assert_turns("claim.time_of_flight", evidence.steps_of_a_clock(clock), evidence.steps_of_a_clock(chip))


def test_readings_without_steps_decide_nothing():
    smooth = np.rint(np.random.default_rng(4).uniform(2600, 3300, 300))
    with pytest.raises(ValueError, match="show no steps"):
        evidence.steps_of_a_clock(evidence.find_step_pattern(smooth))
    with pytest.raises(ValueError, match="50 readings"):
        evidence.find_step_pattern(smooth[:40])


def test_the_real_units_steps_are_those_of_a_spot_on_a_chip_in_either_half_of_its_turns():
    """Found in four turns, and in the other three: the same step, and by chance never."""
    for half in (WALL[::2], WALL[1::2]):
        pattern = evidence.find_step_pattern(half)
        assert pattern.power == 2 and pattern.step_mm(3000) == pytest.approx(1.666, abs=0.005)
    whole = evidence.find_step_pattern(WALL)
    others = np.sort(whole.scores)[:-1]
    assert whole.chance < 1e-12 and whole.scores.max() > 2 * others.max()


def test_resolution_and_range():
    fine, coarse = (evidence.find_step_pattern(counted(2, step)) for step in (1.7, 2.5))
    sharp, blunt = turns_of(0.3), turns_of(40.0)
    fine = replace(fine, steps_mm=fine.steps_mm / 2)  # steps below a millimetre leave no trace in the packet
    assert_turns("lrf.resolution", evidence.repeatability(sharp, fine), evidence.repeatability(blunt, coarse))
    off = turns_of(40.0, distance_mm=2900.0)
    assert_turns("lrf.max_range", evidence.relative_error(sharp, 2800.0), evidence.relative_error(off, 2800.0))
    assert verdict_of("lrf.max_range", evidence.relative_error(sharp)) == "holds in part"  # nobody knows the truth


def test_averaging():
    """Beams on the edge between two surfaces meet now one and now the other: no median lies between them."""
    torn = 2800 + 30.0 * np.random.default_rng(5).choice([-1, 1], (7, 400))
    assert_turns("claim.lrf_averaging_helps", evidence.averaging_gain(turns_of(8.0)), evidence.averaging_gain(torn))


def test_lesser_variance():
    """Noise that grows with the distance; noise that does not."""
    beyond = turns_of(8.0, 3200.0)
    steady, lesser = (evidence.noise_within(turns_of(sigma_mm), beyond) for sigma_mm in (9.0, 4.0))
    assert_turns("claim.lrf_lesser_variance", lesser, steady)
    assert lesser["noise_times"] == pytest.approx(0.5, abs=0.02)


def test_five_turns():
    """Noise that five turns beat and seven hardly better; noise that no median of a few turns beats."""
    noisy, quiet = turns_of(10.0), turns_of(0.5)
    torn = 2800 + 30.0 * np.random.default_rng(5).choice([-1, 1], (7, 400))
    gains = {
        name: evidence.turns_gain(turns) for name, turns in {"noisy": noisy, "quiet": quiet, "torn": 2 * torn}.items()
    }
    assert gains["noisy"]["gained_mm"] > 1 > gains["quiet"]["gained_mm"] and gains["torn"]["gained_mm"] < 1
    assert gains["quiet"]["gained_std_mm"] < gains["noisy"]["gained_std_mm"] < 1


def test_two_more_turns_are_reckoned_as_they_come_out():
    reckoned = evidence.turns_gain(turns_of(8.0))["beyond_mm"]
    five, seven = (np.median(np.random.default_rng(8).normal(0, 8, (n, 40000)), axis=0).std() for n in (5, 7))
    assert reckoned == pytest.approx(five - seven, rel=0.2)


def test_noise_too_small_to_be_told_is_unknown():
    """All turns but one read alike: what is left of the noise in a median of six is lost in the estimate."""
    turns = np.full((7, 50), 715.0)
    turns[0] += 1
    assert np.isnan(evidence.noise_of_median(turns, 5))


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_noise_of_a_median_is_that_of_many(n):
    """Against the scatter of medians of fresh turns, also where every beam has an offset of its own."""
    rng = np.random.default_rng(6)
    direct = np.median(rng.normal(0, 8, (n, 20000)), axis=0).std()
    assert evidence.noise_of_median(turns_of(8.0, shared_mm=30.0), n) == pytest.approx(direct, rel=0.1)
    with pytest.raises(ValueError, match="1 to 6 can be combined"):
        evidence.noise_of_median(turns_of(8.0), 7)


def test_the_excerpt_is_what_the_source_prints():
    """Bytes of the source's turns at 0.72 m (high byte 02), and its steps through a room: no beam is out of its row."""
    printed = ["D1 C9 C6 C7 CD DD", "D1 C9 C6 C7 CD DD", "D1 C8 C6 C7 CD DE", "D0 C8 C6 C7 CD DC"]
    assert NEAR[:4].tolist() == [[int("02" + low, 16) for low in line.split()] for line in printed]
    assert STATIC.groupby("about_mm").size().to_dict() == {370: 11, 570: 14, 720: 6, 980: 35, 2900: 43}
    turns = STATIC.filter(like="turn").to_numpy(float)
    off = np.abs(turns - np.median(turns, axis=1, keepdims=True))
    assert off.max() <= 0.03 * turns.max() and np.median(off) <= 1


def test_a_second_real_unit_repeats_as_well():
    """`hand_in_box`: beams on which no hand came, 0.29 to 0.49 m away."""
    try:
        recording = datasets.real_recording("xv11/hand_in_box.txt")
    except datasets.NotAvailable as error:
        pytest.skip(str(error))
    scans = [scan for scan in laser.turns(laser.read_recording(recording)) if scan.complete]
    ranges = np.stack([scan.ranges_mm for scan in scans])
    still = ~laser.moving_readings(scans).any(axis=0) & (np.isfinite(ranges).mean(axis=0) > 0.95)
    spread = np.nanstd(ranges[:, still], axis=0, ddof=1)
    assert still.sum() > 50 and np.median(spread) < 0.6


def test_reflectivity():
    """Built in, and still no constant: its data can turn it. Wild readings and rare losses are mended, others stay."""
    id, true, rng = "claim.lrf_averaging_reflectivity", [1000.0, 2000.0], np.random.default_rng(7)
    wild = [np.where(rng.random(1000) < 0.1, d + 200, np.where(rng.random(1000) < 0.3, np.nan, d)) for d in true]
    stays = [np.where(np.arange(1000) < 800, np.nan, d + 8) for d in true]
    assert verdict_of(id, evidence.averaging_of_reflectivity(true, wild)) == "follows"
    assert verdict_of(id, evidence.averaging_of_reflectivity(true, stays)) == "does not follow"


def test_figures_5_and_6():
    good, bad = curve_of(5.0), curve_of(80.0)
    assert verdict_of("fig.5", evidence.error_below(3000, white=good, dark=good)) == "follows"
    assert verdict_of("fig.5", evidence.error_below(3000, white=bad, dark=bad)) == "does not follow"
    assert verdict_of("fig.5", evidence.error_below(3000, white=good, dark=bad)) == "follows in part"
    truth, walls = np.full(360, 2000.0), np.ones(360, bool)
    for off_mm, verdict in ((5.0, "follows"), (60.0, "does not follow")):
        scan = laser.LaserScan(truth + off_mm, np.ones(360))
        assert verdict_of("fig.6", evidence.sweep_error(scan, truth, walls)) == verdict


def test_footprint():
    """As the laser stands its beams happen to end where the cube's faces do; turned by half a degree they do not."""
    assert_turns("title.footprint", evidence.footprint_cm(scan_of(0.0)), evidence.footprint_cm(scan_of(0.5)))
    brick = evidence.footprint_cm(scan_of(size_mm=(400.0, 250.0, 300.0)))
    assert np.abs(brick - [40, 25]).max() < 2 * evidence.half_beam_step_cm(700, 400)
    assert np.isnan(evidence.footprint_cm(laser.LaserScan(np.full(360, 2500.0), np.ones(360)))).all()


def test_an_end_is_known_to_half_of_the_stretch_between_two_beams():
    sides = [evidence.footprint_cm(scan_of(heading)) for heading in (0.0, 0.25, 0.5, 0.75)]
    off = np.abs(np.array(sides) - 30)
    assert 1 < off.max() < evidence.half_beam_step_cm(700, 300) + 0.3


def test_the_beams_are_as_far_apart_as_they_meet_the_face():
    """Against the angles at which the two beams around the far end of the face meet its line."""
    end, along = np.array([912.132, 212.132]), np.sqrt(0.5)
    angle = np.arctan2(end[1], end[0])
    stretches = []
    for beam in np.radians([-0.5, 0.5]) + angle:
        a = np.array([[np.cos(beam), -along], [np.sin(beam), -along]])
        stretches.append(np.linalg.solve(a, [700.0, 0.0])[1])
    assert evidence.half_beam_step_cm(700, 300) == pytest.approx((stretches[1] - stretches[0]) / 20, rel=0.01)
