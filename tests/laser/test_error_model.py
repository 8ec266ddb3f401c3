"""The error model against known truth: errors, laws of the spread, bias, and averaging."""

import numpy as np
import pytest

from stereolib import laser


def test_error_curve():
    curve = laser.error_curve([500, 1000], [[503, 505, np.nan, 507], [990, 1010]])
    np.testing.assert_allclose(curve.bias_mm, [5, 0])
    np.testing.assert_allclose(curve.spread_mm, [2, 200**0.5])
    np.testing.assert_allclose(curve.percent, [1, 1])
    np.testing.assert_allclose(curve.dropout, [0.25, 0])
    assert curve.n.tolist() == [3, 2]
    single = laser.error_curve([500], [[504]])
    assert single.bias_mm == 4 and np.isnan(single.spread_mm) and single.n == 1
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
    np.testing.assert_allclose(mean.rms_mm, np.hypot(mean.bias_mm, readings.std() / np.sqrt(mean.n)), rtol=0.06)
    assert mean.bias_mm == pytest.approx(2, abs=0.35)
    median = laser.error_against_n(readings, 1000, rng=rng)
    assert (np.diff(median.rms_mm) < 0.05).all()
    ratio = median.spread_mm[3:6] / mean.spread_mm[3:6]  # the median's price: sqrt(pi / 2) at most
    assert ((ratio > 1.05) & (ratio < 1.35)).all()
    assert laser.error_against_n([1000.0, 1001], 1000, rng=rng).n.tolist() == [1, 2]
    with pytest.raises(ValueError, match="none of the readings"):
        laser.error_against_n([np.nan], 1000, rng=rng)
    with pytest.raises(ValueError, match=r"none of n = \(5, 10\) lies between 1 and the 2 valid readings"):
        laser.error_against_n([1000.0, 1001], 1000, rng=rng, n=(5, 10))


def test_the_error_of_all_readings_combined_is_not_zero_by_construction():
    rng = np.random.default_rng(8)
    readings = rng.normal(1000, 8, 20)
    curve = laser.error_against_n(readings, readings.mean(), rng=rng, n=(5, 20), method="mean")
    np.testing.assert_allclose(curve.spread_mm, readings.std() / np.sqrt([5, 20]), rtol=0.05)


def test_halves_need_not_reach_equally_far():
    """One reading each at 500 and 2000 mm: some draws learn without one of them and test with it."""
    true = np.array([500.0] + 20 * [1000.0] + 20 * [1200.0] + [2000.0])
    for seed in range(8):
        result = laser.bias_correction_test(true, true + 5, degree=1, rng=np.random.default_rng(seed))
        assert result["rms_after_mm"] < 1e-6


def test_what_is_nan_is_left_out_and_lengths_must_agree():
    true, rng = np.repeat([500.0, 1000, 2000], 20), np.random.default_rng(9)
    measured = true + 5
    true[3] = measured[30] = np.nan
    result = laser.bias_correction_test(true, measured, degree=0, rng=rng)
    assert result["n_learn"] + result["n_test"] == 58 and result["rms_before_mm"] == pytest.approx(5)
    for refuse in (
        lambda: laser.learn_bias(true, measured[:7]),
        lambda: laser.bias_correction_test(true, [1], rng=rng),
    ):
        with pytest.raises(ValueError, match="each reading needs its known distance, got 60 distances"):
            refuse()


def test_a_residual_is_divided_by_its_deviation():
    """Where one coefficient has to serve two biases, their mean is weighted by the inverse squares of deviations."""
    assert laser.learn_bias([990, 1980], [1000, 2000], degree=0).coefficients_mm[0] == pytest.approx(
        (10 / 2**2 + 20 / 5**2) / (1 / 2**2 + 1 / 5**2)
    )


def test_an_exact_law_is_no_better_than_rounding_tells():
    r = [500, 1000, 2000, 4000]
    best = laser.compare_sigma_laws(r, [2.0, 2, 2, 2])
    assert best[0].law == "constant" and all(np.isfinite(fit.aic) for fit in best)
