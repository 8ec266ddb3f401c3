"""The virtual laser: truth it casts, noise and dropouts it adds, and what comes back from its bytes."""

from dataclasses import replace

import numpy as np
import pytest

from stereolib import laser, virtual
from stereolib.virtual.lidar import NO_ECHO, OUT_OF_RANGE

WHITE, GREY, DARK = 0.85, 0.35, 0.05  # reflectance
DISTANCES_MM = np.r_[150:500:50, 500:1000:100, 1000:5001:250].astype(float)


def room_scene(**kwargs):
    wall = virtual.Material((0.6, 0.6, 0.6))
    return virtual.Scene((virtual.room(wall, wall, **kwargs),))


def series(albedo, distances_mm=DISTANCES_MM, readings=1800, **kwargs):
    sensor = virtual.VirtualLidar(**kwargs)
    recordings = sensor.range_series(distances_mm, albedo, np.random.default_rng(1), readings=readings)
    return [laser.decode(data, "raise") for data in recordings]


def curve(albedo, **kwargs):
    values = [r.distance_mm for r in series(albedo, **kwargs)]
    return laser.error_curve(kwargs.get("distances_mm", DISTANCES_MM), values)


def test_truth_in_a_rectangular_room():
    """Against the distance to the nearest of four walls, worked out by hand."""
    sensor, pose = virtual.VirtualLidar(emitter_offset_mm=0.0), (200.0, -100.0, 0.3)
    truth = sensor.truth_mm(room_scene(x_mm=(-1800.0, 2400.0), y_mm=(-1700.0, 1900.0)), pose)
    angle = pose[2] + np.deg2rad(np.arange(360))
    with np.errstate(divide="ignore"):
        to_x = np.where(np.cos(angle) > 0, 2200, -2000) / np.cos(angle)
        to_y = np.where(np.sin(angle) > 0, 2000, -1600) / np.sin(angle)
    np.testing.assert_allclose(truth, np.minimum(to_x, to_y), rtol=1e-8)


def test_a_ray_along_the_axes_hits():
    """Every beam, the four along the axes too: on the cube's near faces by their lines, else on the walls."""
    truth = virtual.VirtualLidar(emitter_offset_mm=0.0).truth_mm(virtual.cube_scene(700.0), (0.0, 0.0, 0.0))
    angle, half = np.radians(np.arange(360.0)), 150 * np.sqrt(2)  # half of the cube's diagonal
    forward, aside = np.cos(angle), np.abs(np.sin(angle))
    with np.errstate(divide="ignore"):
        face = 700 / (forward - aside)  # |y| = x - 700, as far as the corners
        to_x = np.where(forward > 0, 2400, 1800) / np.abs(forward)
        walls = np.minimum(to_x, np.where(angle < np.pi, 1900, 1700) / aside)
    on_cube = (face > 0) & (face * aside <= half)
    assert on_cube.sum() == 27 and on_cube[0]
    np.testing.assert_allclose(truth, np.where(on_cube, face, walls), rtol=1e-8)


def test_averaged_sweep_is_true_to_3_mm_at_the_cube():
    sensor, pose = virtual.VirtualLidar(), (0.0, 0.0, 0.0)
    world = virtual.cube_scene(700.0)
    scans = laser.turns(laser.decode(sensor.scan(world, pose, np.random.default_rng(2)), "raise"))
    assert [s.complete for s in scans] == [True] * 5
    truth = sensor.truth_mm(world, pose)
    cube = truth < 950
    five = np.abs(laser.average(scans).ranges_mm - truth)
    one = np.abs(scans[0].ranges_mm - truth)
    assert cube.sum() > 15
    assert np.nanmedian(five[cube]) < 1.6 < 3
    assert np.nanmedian(five) < np.nanmedian(one)


def test_noise_follows_the_law_it_was_given():
    white = curve(WHITE)
    usable = white.dropout < 0.5
    best = laser.compare_sigma_laws(white.true_mm[usable], white.spread_mm[usable], white.n[usable])[0]
    assert best.law == "quadratic"
    assert best.a_mm == pytest.approx(1.3, rel=0.1)
    assert best.b == pytest.approx(1.2e-6, rel=0.05)


@pytest.mark.parametrize(("distance_mm", "measured_mm"), [(600, 1.5), (1250, 4.1), (2750, 7.4), (3150, 14.8)])
def test_noise_is_near_the_figures_it_was_fitted_to(distance_mm, measured_mm):
    """The law cannot meet all four, but each within 45 %. Where they come from is not known: no proof of likeness."""
    assert virtual.VirtualLidar().sigma(distance_mm) == pytest.approx(measured_mm, rel=0.45)


def test_the_constants_are_what_the_fit_gives():
    fit = laser.fit_sigma([600, 1250, 2750, 3150], [1.5, 4.1, 7.4, 14.8])
    sensor = virtual.VirtualLidar()
    assert fit.a_mm == pytest.approx(sensor.sigma_mm, abs=0.05)
    assert fit.b == pytest.approx(sensor.sigma_per_mm, rel=0.02)
    assert fit.rms_percent == pytest.approx(22, abs=1)


def test_bias_is_worth_correcting():
    assert np.abs(virtual.VirtualLidar().bias(np.arange(100, 6001), GREY)).max() < 30
    readings = np.concatenate([r.distance_mm.ravel() for r in series(WHITE)])
    true = np.repeat(DISTANCES_MM, len(readings) // len(DISTANCES_MM))
    result = laser.bias_correction_test(true, readings, rng=np.random.default_rng(4))
    assert result["bias_after_mm"] < 0.25 * result["bias_before_mm"]


def test_strength_falls_with_distance_and_darkness_until_readings_are_lost():
    white, dark = series(WHITE), series(DARK)
    at_1_m = int(np.flatnonzero(DISTANCES_MM == 1000)[0])
    assert np.median(white[at_1_m].strength) == 200 * 0.85
    assert np.median(dark[at_1_m].strength) == 10
    at_2_m = int(np.flatnonzero(DISTANCES_MM == 2000)[0])
    assert np.median(white[at_2_m].strength) == pytest.approx(200 * 0.85 / 4, abs=1)
    lost = np.array([np.isnan(r.distance_mm).mean() for r in dark])
    assert lost[DISTANCES_MM <= 700].max() < 0.02 and lost[DISTANCES_MM >= 3000].min() > 0.9
    assert (np.diff(lost) > -0.03).all()
    white_lost = np.array([np.isnan(r.distance_mm).mean() for r in white])
    assert white_lost[DISTANCES_MM <= 3000].max() < 0.01
    assert set(np.unique(dark[-1].error_code)) == {0, NO_ECHO} or (set(np.unique(dark[-1].error_code)) == {NO_ECHO})
    assert dark[at_2_m].warning.mean() > 0.9 and white[at_1_m].warning.sum() == 0


def test_out_of_range_is_an_error_not_a_number():
    near, far = series(WHITE, distances_mm=[60.0, 6500.0], readings=360)
    for r in (near, far):
        assert np.isnan(r.distance_mm).all()
        assert (r.error_code == OUT_OF_RANGE).mean() > 0.8


def test_grazing_beams_drop_out():
    hall = room_scene(x_mm=(-300.0, 4500.0), y_mm=(-250.0, 250.0))
    sensor = virtual.VirtualLidar()
    data = sensor.scan(hall, (0.0, 0.0, 0.0), np.random.default_rng(0), turns=40)
    average = laser.average(laser.turns(laser.decode(data)))
    assert average.dropout[[2, 1, 0, 359, 358]].max() < 0.1  # the far wall, met head on
    assert average.dropout[5] > 0.5  # the side wall 2.9 m away, met at 5 degrees
    assert average.dropout[30:150].max() == 0


def test_readings_are_whole_millimetres_and_spread_by_quantisation_at_least():
    silent = {"sigma_mm": 0.0, "sigma_per_mm": 0.0, "bias_mm": (0.0, 0.0, 0.0), "bias_dark_mm": 0.0}
    values = series(0.5, distances_mm=np.array([700.4, 700.6]), readings=360, **silent)
    assert set(values[0].distance_mm.ravel()) == {700.0}
    assert set(values[1].distance_mm.ravel()) == {701.0}


def test_emitter_beside_the_axis_is_undone_in_the_points():
    room, sensor = room_scene(x_mm=(-800.0, 900.0), y_mm=(-700.0, 600.0)), virtual.VirtualLidar()
    exact = laser.LaserScan(sensor.truth_mm(room, (0.0, 0.0, 0.0)), np.ones(360))
    walls = laser.fit_walls(laser.points_mm(exact), 4, rng=np.random.default_rng(0))
    assert max(w.rms_mm for w in walls) < 0.01
    np.testing.assert_allclose(sorted(w.offset_mm for w in walls), [600, 700, 800, 900], atol=0.01)
    plain = laser.points_mm(replace(exact, emitter_offset_mm=0.0))
    assert max(w.rms_mm for w in laser.fit_walls(plain, 4, rng=np.random.default_rng(0))) > 0.3


def test_same_seed_same_bytes():
    sensor, world = virtual.VirtualLidar(), room_scene()
    a, b, c = (sensor.scan(world, (0, 0, 0), np.random.default_rng(s), turns=1) for s in (1, 1, 2))
    assert a == b != c


def test_wrong_input():
    sensor, rng = virtual.VirtualLidar(), np.random.default_rng(0)
    with pytest.raises(ValueError, match="turns must be 1 or more"):
        sensor.scan(room_scene(), (0, 0, 0), rng, turns=0)
    with pytest.raises(ValueError, match="x_mm, y_mm, yaw_rad"):
        sensor.scan(room_scene(), (0, 0), rng)
    with pytest.raises(ValueError, match="0 < albedo <= 1"):
        sensor.range_series([500], 0, rng)
    with pytest.raises(ValueError, match="positive"):
        sensor.range_series([0], 0.5, rng)
