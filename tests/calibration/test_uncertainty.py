"""Stated uncertainties against what happens: repeated draws, bootstrap, triangulation by brute force."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
from scipy.stats import t as student
from support.corners import corner_set, draw_poses, draw_rig

from stereolib.calibration import (
    INTERVAL_STDS,
    JUDGED_AT_MM,
    bundle_adjustment,
    calibrate_stereo,
    compare_calibrations,
    diagnose,
    error_map,
    interval_table,
    rig_covariance,
    rig_parameter_names,
    rig_std,
    triangulate,
)


def std(covariance):
    return np.sqrt(np.diag(covariance))


@pytest.fixture(scope="module")
def rig():
    return draw_rig(np.random.default_rng(11))


@pytest.fixture(scope="module")
def views(rig):
    return corner_set(np.random.default_rng(12), rig=rig)


@pytest.fixture(scope="module")
def fitted(views, rig):
    return bundle_adjustment.fit_rig(views, rig)


@pytest.fixture(scope="module")
def covariance(fitted):
    return rig_covariance(fitted)


def test_intervals_hold_the_truth():
    """95 % intervals of drawn rigs, by both methods; the pooled share over 20 draws and 24 parameters."""
    inside = []
    for k in range(20):
        rng = np.random.default_rng([6, k])
        rig = draw_rig(rng)
        found = bundle_adjustment.fit_rig(corner_set(rng, rig=rig), rig)
        off = np.abs(bundle_adjustment.rig_difference(found.rig, rig))
        inside.append([off < INTERVAL_STDS * std(rig_covariance(found, method=m)) for m in ("jackknife", "corners")])
    for share in np.mean(inside, axis=(0, 2)):
        assert 0.90 <= share <= 0.99


def test_standard_deviations_are_those_of_repetition(rig):
    """The same boards seen again and again with new noise."""
    poses = draw_poses(rig, 30, np.random.default_rng(0))
    sets = [corner_set(np.random.default_rng([1, k]), rig=rig, poses=poses) for k in range(50)]
    fits = [bundle_adjustment.fit_rig(views, rig) for views in sets]
    spread = np.std([bundle_adjustment.rig_difference(f.rig, rig) for f in fits], axis=0)
    ratio = std(rig_covariance(fits[0], method="corners")) / spread
    assert (np.abs(ratio - 1) < 0.35).all()  # 50 draws give a standard deviation within 10 %, three times that
    assert np.mean(ratio) == pytest.approx(1, abs=0.1)


def bootstrap_covariance(views, fitted, draws, rng):
    """Refits on pairs drawn with replacement: slow, and independent of any Jacobian."""
    moves = []
    for _ in range(draws):
        drawn = views.only(rng.integers(0, len(views), len(views)).tolist())
        moves.append(bundle_adjustment.rig_difference(bundle_adjustment.fit_rig(drawn, fitted.rig).rig, fitted.rig))
    return np.cov(np.array(moves).T)


@pytest.mark.slow
def test_jackknife_is_the_bootstrap(views, fitted, covariance):
    booted = bootstrap_covariance(views, fitted, 60, np.random.default_rng(2))
    ratio = std(covariance) / std(booted)
    assert np.mean(ratio) == pytest.approx(1, abs=0.2)
    assert (np.abs(ratio - 1) < 0.5).all()


def test_errors_that_a_board_shares_are_counted(views, fitted):
    """Each pair's right corners shifted as one: independent corners would promise too much."""
    scores = []
    for seed in range(3, 9):
        shift = np.random.default_rng(seed).normal(0, 0.3, (len(views), 1, 2))
        shaken = type(views)(views.board, views.size, views.left_px, views.right_px + shift, views.names, ())
        found = bundle_adjustment.fit_rig(shaken, fitted.rig)
        naive, honest = (std(rig_covariance(found, method=m)) for m in ("corners", "jackknife"))
        off = np.abs(bundle_adjustment.rig_difference(found.rig, fitted.rig))
        assert (honest / naive)[18:].min() > 2  # R and T
        scores.append(off[:, None] / np.column_stack([naive, honest]))
    too_little, enough = np.sqrt(np.mean(np.square(scores), axis=(0, 1)))
    assert 0.75 < enough < 1.35 < 2 < too_little


@pytest.mark.parametrize("pairs", [5, 8, 12])
def test_disjoint_few_pairs_agree_within_their_intervals(pairs):
    """Each pair's right corners shifted as one, as a hand does that moves between two shutters."""
    inside = []
    for k in range(12):
        rng = np.random.default_rng([31, pairs, k])
        rig, fits = draw_rig(rng), []
        for _ in range(2):
            views = corner_set(rng, rig=rig, pairs=pairs)
            shift = rng.normal(0, 0.1, (pairs, 1, 2))
            shaken = type(views)(views.board, views.size, views.left_px, views.right_px + shift, views.names, ())
            fits.append(bundle_adjustment.fit_rig(shaken, rig))
        off = np.abs(bundle_adjustment.rig_difference(fits[0].rig, fits[1].rig))
        widths = {m: np.hypot(*(std(rig_covariance(f, method=m)) for f in fits)) for m in ("auto", "corners")}
        inside.append([off < INTERVAL_STDS * width for width in widths.values()])
    auto, corners = np.mean(inside, axis=(0, 2))
    assert 0.93 <= auto <= (1 if pairs < 8 else 0.995)  # five are stated too widely rather than not
    assert corners < 0.85


def test_few_pairs_are_widened_by_students_t(views):
    for count in (6, 12, len(views)):
        few = bundle_adjustment.fit_rig(views.only(range(count)), draw_rig(np.random.default_rng(11)))
        widened = std(rig_covariance(few)) / std(rig_covariance(few, method="jackknife"))
        np.testing.assert_allclose(widened, student.ppf(0.975, count - 1) / student.ppf(0.975, 29))
    with pytest.raises(ValueError, match=r"must be .*got 'guess'"):
        rig_covariance(few, method="guess")


def test_few_pairs_are_stated_too_widely_as_documented(rig):
    """The detector's noise alone: the jackknife's deviations over the corners', by the number of pairs."""
    wide = {}
    for count in (6, 12, 30):
        ratios = []
        for k in range(8):
            found = bundle_adjustment.fit_rig(corner_set(np.random.default_rng([k, count]), rig=rig, pairs=count), rig)
            jackknife, corners = (rig_covariance(found, method=m).diagonal() for m in ("jackknife", "corners"))
            ratios.append(jackknife / corners)
        wide[count] = np.sqrt(np.mean(ratios))
    assert 1.3 < wide[6] < 1.8 and 1.1 < wide[12] < 1.4 and 1 < wide[30] < 1.2


def test_one_pair_is_no_set_to_leave_pairs_out_of(views, rig):
    alone = bundle_adjustment.fit_rig(views.only([0]), rig, free=False)
    for method in ("auto", "jackknife"):
        with pytest.raises(ValueError, match="1 pair cannot be left out"):
            rig_covariance(alone, method=method)


def test_parts_by_name(fitted, covariance):
    names, parts = rig_parameter_names(fitted.rig), rig_std(fitted.rig, covariance)
    assert len(names) == 24
    spread = dict(zip(names, std(covariance), strict=True))
    assert parts.left_K[2] == spread["left cx"]
    assert parts.right_dist[4] == spread["right k3"]
    assert parts.R_rad[1] == spread["Ry"]
    assert parts.T_mm[2] == spread["Tz"]
    drawn = np.random.default_rng(0).multivariate_normal(fitted.rig.T, covariance[-3:, -3:], 20000)
    assert parts.baseline_mm == pytest.approx(np.linalg.norm(drawn, axis=1).std(), rel=0.03)


def test_error_map_is_what_triangulation_does(fitted, covariance):
    """Rigs drawn from the covariance triangulate pixel pairs all over the map; no Jacobian is involved."""
    rig, found = fitted.rig, error_map(fitted.rig, covariance, at_mm=700)
    columns, rows = np.arange(10, 640, 20), np.arange(10, 480, 20)
    np.testing.assert_array_equal(found.columns_px, columns)
    np.testing.assert_array_equal(found.rows_px, rows)
    i, j = np.array([[12, 16], [0, 10], [2, 28], [22, 9], [20, 26], [10, 24]]).T
    half, point = np.array([50.0, 0, 0]), rig.left.rays(np.column_stack([columns[j], rows[i]])) * 700
    points = np.concatenate([point, point - half, point + half])
    pixels = rig.left.project(points), rig.right.project(points @ rig.R.T + rig.T)
    steps = np.random.default_rng(8).multivariate_normal(np.zeros(24), covariance, 400)
    drawn = np.array([triangulate(bundle_adjustment.moved_rig(rig, step), *pixels) for step in steps])
    middle, right, left = np.split(drawn, 3, axis=1)
    np.testing.assert_allclose(found.depth_mm[i, j], middle[..., 2].std(axis=0), rtol=0.12)
    np.testing.assert_allclose(found.length_mm[i, j], np.linalg.norm(left - right, axis=2).std(axis=0), rtol=0.12)
    assert np.ptp(found.depth_mm[i, j]) > 0.3 * found.depth_mm[12, 16]  # it is no constant that all agree with
    assert np.isnan(found.depth_mm[:, 0]).all()  # the left rim is out of the right camera's sight
    assert found.depth_mm.shape == (24, 32)


def test_all_is_judged_at_one_distance_unless_another_is_asked_for(views, fitted, covariance):
    first, second = fitted, bundle_adjustment.fit_rig(views.only(range(10)), fitted.rig)
    one, same = (compare_calibrations(first, second, **at) for at in ({}, {"at_mm": JUDGED_AT_MM}))
    np.testing.assert_array_equal(one.depth_mm, same.depth_mm)
    assert error_map(fitted.rig, covariance).at_mm == JUDGED_AT_MM
    assert inspect.signature(diagnose).parameters["at_mm"].default == JUDGED_AT_MM


def test_maps_refuse_metres(fitted, covariance):
    with pytest.raises(ValueError, match="given as 1, but millimetres are expected: for 1 m that is 1000"):
        error_map(fitted.rig, covariance, at_mm=1.0)


def test_halves_differ_by_what_was_predicted(views, rig):
    first, second = (bundle_adjustment.fit_rig(views.only(range(k, 30, 2)), rig) for k in (0, 1))
    agreement = compare_calibrations(first, second)
    assert 0.5 < agreement.rms_z < 1.6
    z = agreement.depth_mm / agreement.predicted_mm
    assert 0.1 < np.sqrt(np.nanmean(z**2)) < 2.5
    other = bundle_adjustment.fit_rig(
        corner_set(np.random.default_rng(5), pairs=15), draw_rig(np.random.default_rng(5))
    )
    assert compare_calibrations(first, other).rms_z > 20  # another rig is told from this one


def test_table_shows_every_parameter_beside_the_truth(fitted, covariance, rig):
    rows = interval_table(fitted.rig, covariance, rig)
    assert list(rows["parameter"]) == list(rig_parameter_names(rig))
    off = np.abs(bundle_adjustment.rig_difference(fitted.rig, rig))
    np.testing.assert_allclose(
        (rows["ours"].astype(float) - rows["true"].astype(float)).abs(), off, rtol=0.1, atol=2e-2
    )
    assert list(rows["inside"] == "yes") == list(off <= INTERVAL_STDS * std(covariance))
    width = rows["± (95 %)"].astype(float)
    np.testing.assert_allclose(width, INTERVAL_STDS * std(covariance), rtol=0.06, atol=0.06)


@pytest.mark.parametrize(("model", "count"), [("pinhole", 0), ("brown2", 4), ("rational8", 8)])
def test_table_of_another_lens_than_the_true_one(views, rig, model, count):
    found = calibrate_stereo(views, model=model).fit
    rows = interval_table(found.rig, rig_covariance(found), rig).set_index("parameter")
    assert list(rows.index) == list(rig_parameter_names(found.rig)) and len(rows) == 2 * (4 + count) + 6
    if count > 5:
        assert float(rows.loc["left k4", "true"]) == 0
    if count:
        assert float(rows.loc["right k1", "true"]) == pytest.approx(rig.right.dist[0], abs=0.05)
