"""Error model of the laser: bias, spread and percentage error; laws of the spread; averaging.

A triangulating sensor sees its spot move by ``d = f b / r`` on its chip. A fixed error of the spot
therefore becomes ``sigma = (sigma_d / f b) r^2`` in range, on top of a floor: ``a + b r^2``. The law of
the spread alone does not tell how a sensor works: a flight time scatters more where the echo is weak.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from stereolib.base import Float64, Ints
from stereolib.laser.xv11 import RANGE_STEP_MM

Law: TypeAlias = Literal["constant", "linear", "quadratic"]
LAWS: tuple[Law, ...] = ("constant", "linear", "quadratic")
QUANTISATION_MM = float(RANGE_STEP_MM / np.sqrt(12))  # standard deviation that rounding to whole steps leaves
_LEAST_SPREADS = 4  # two coefficients, and something left to judge them by
_ROUNDING = 1e-9  # relative residuals of a law that fits exactly: no law is better for smaller ones
_LEAST_IN_MEAN = 10  # readings at a distance before their mean error is called a bias
_DRAWS = 2000  # combinations of each number of readings


@dataclass(frozen=True, eq=False)
class ErrorCurve:
    """Error against distance; one entry per known distance.

    Attributes
    ----------
    true_mm : (k,) float64
        Known distance, mm.
    n : (k,) int
        Valid readings.
    bias_mm, spread_mm : (k,) float64
        Mean error and sample standard deviation, mm.
    percent : (k,) float64
        Mean absolute error in percent of the distance.
    dropout : (k,) float64
        Share of the readings that were invalid.
    """

    true_mm: Float64
    n: Ints
    bias_mm: Float64
    spread_mm: Float64
    percent: Float64
    dropout: Float64


def error_curve(true_mm: ArrayLike, readings_mm: Sequence[ArrayLike]) -> ErrorCurve:
    """Compute bias, spread and percentage error at known distances.

    Parameters
    ----------
    true_mm : (k,) array_like
        Known distances, mm.
    readings_mm : sequence of k arrays
        Readings taken at each, mm; NaN is a dropout. Without any valid reading the errors are NaN.

    Returns
    -------
    ErrorCurve

    Raises
    ------
    ValueError
        If the lengths differ or a distance is not positive.

    Examples
    --------
    >>> curve = error_curve([500, 1000], [[503, 505], [990, np.nan]])
    >>> curve.bias_mm, curve.percent, curve.dropout
    (array([  4., -10.]), array([0.8, 1. ]), array([0. , 0.5]))
    """
    true = np.asarray(true_mm, np.float64)
    if true.ndim != 1 or len(true) != len(readings_mm):
        got = f"{true.size} distances and {len(readings_mm)} arrays"
        raise ValueError(f"one array of readings per known distance is needed: got {got}")
    if not (true > 0).all():
        raise ValueError("known distances must be positive, in mm")
    rows = [_errors_at(distance, np.asarray(r, float).ravel()) for distance, r in zip(true, readings_mm, strict=True)]
    counts, bias, spread, percent, dropout = np.array(rows, np.float64).reshape(-1, 5).T
    return ErrorCurve(true, counts.astype(int), bias, spread, percent, dropout)


def _errors_at(distance_mm: float, readings_mm: Float64) -> tuple[float, ...]:
    """Valid readings, mean error, spread, percentage error and dropout at one distance."""
    error = readings_mm[np.isfinite(readings_mm)] - distance_mm
    n, spread = len(error), error.std(ddof=1) if len(error) > 1 else np.nan
    mean, percent = (error.mean(), 100 * np.abs(error).mean() / distance_mm) if n else (np.nan, np.nan)
    return n, mean, spread, percent, 1 - n / max(len(readings_mm), 1)


@dataclass(frozen=True)
class SigmaFit:
    """A law of the spread: ``a``, ``a + b r`` or ``a + b r^2``, with a and b not negative.

    Attributes
    ----------
    law : str
        "constant", "linear" or "quadratic".
    a_mm, b : float
        Coefficients for r in mm (b: 1, or 1/mm for the quadratic law).
    rms_mm : float
        Root mean square residual, mm.
    rms_percent : float
        The same relative to the law, in percent.
    aic : float
        Akaike's criterion; lower is better, 10 less is decisive.
    """

    law: Law
    a_mm: float
    b: float
    rms_mm: float
    rms_percent: float
    aic: float

    def __call__(self, distance_mm: ArrayLike) -> Float64:
        """Evaluate the law.

        Parameters
        ----------
        distance_mm : array_like, mm

        Returns
        -------
        array like `distance_mm`, mm
            The spread expected there.
        """
        return self.a_mm + self.b * np.asarray(distance_mm, np.float64) ** LAWS.index(self.law)


def fit_sigma(distance_mm: ArrayLike, sigma_mm: ArrayLike, law: Law = "quadratic", n: ArrayLike = 2) -> SigmaFit:
    """Fit a law to measured spreads.

    Relative residuals are minimised, since a spread's own error is in proportion to it
    (``sigma / sqrt(2 (n - 1))`` from n readings); the weights are iterated, as they depend on the
    law.

    Parameters
    ----------
    distance_mm, sigma_mm : (k,) array_like
        Distances and the spread measured at each, mm; NaN and zero spreads are left out.
    law : {"quadratic", "linear", "constant"}
    n : (k,) array_like, optional
        Readings behind each spread; by default all alike.

    Returns
    -------
    SigmaFit

    Raises
    ------
    ValueError
        For fewer than four usable spreads, or for an unknown law.

    Examples
    --------
    >>> r = np.array([500.0, 1000, 2000, 4000])
    >>> fit = fit_sigma(r, 1.5 + 1e-6 * r**2)
    >>> round(fit.a_mm, 6), round(fit.b, 9)
    (1.5, 1e-06)
    """
    from scipy.optimize import nnls

    if law not in LAWS:
        raise ValueError(f"law must be one of {', '.join(LAWS)}; got {law!r}")
    r, sigma = (np.asarray(v, np.float64).ravel() for v in (distance_mm, sigma_mm))
    if r.shape != sigma.shape:
        raise ValueError(f"as many spreads as distances are needed, got {sigma.size} and {r.size}")
    weight = np.broadcast_to(np.asarray(n, np.float64) - 1, r.shape)
    usable = np.isfinite(r) & np.isfinite(sigma) & (sigma > 0) & (weight > 0)
    r, sigma, weight = r[usable], sigma[usable], weight[usable] / weight[usable].mean()
    if len(r) < _LEAST_SPREADS:
        advice = "record more distances, each with at least two readings"
        raise ValueError(f"at least four distances with a spread are needed, got {len(r)}; {advice}")
    scale = r.max()
    power = LAWS.index(law)
    columns = np.stack([np.ones_like(r), (r / scale) ** power], axis=1)[:, : 1 + (power > 0)]
    model, coefficients = sigma, np.zeros(1)
    for _ in range(100):
        root = np.sqrt(weight) / model
        coefficients, _ = nnls(columns * root[:, None], sigma * root)
        before, model = model, np.maximum(columns @ coefficients, 1e-3 * sigma)
        if np.allclose(before, model, rtol=1e-9):
            break
    a, b = (*coefficients, 0.0)[:2]
    # the likelihood of N(model, (s model)^2 / weight)
    mean_square = float(np.mean(weight * (sigma / model - 1) ** 2))
    aic = float(len(r) * np.log(max(mean_square, _ROUNDING**2)) + 2 * np.log(model).sum() + 2 * (len(coefficients) + 1))
    rms_mm, rms_percent = float(np.sqrt(np.mean((sigma - model) ** 2))), float(100 * np.sqrt(mean_square))
    return SigmaFit(law, float(a), float(b / scale**power), rms_mm, rms_percent, aic)


def compare_sigma_laws(distance_mm: ArrayLike, sigma_mm: ArrayLike, n: ArrayLike = 2) -> list[SigmaFit]:
    """Fit the three laws to the same spreads.

    Parameters
    ----------
    distance_mm, sigma_mm, n
        As for `fit_sigma`.

    Returns
    -------
    list of SigmaFit
        The best (lowest AIC) first.

    Examples
    --------
    >>> r = np.array([500.0, 1000, 2000, 3000, 4000])
    >>> compare_sigma_laws(r, [1.7, 2.5, 6.0, 11.5, 20.5], n=100)[0].law
    'quadratic'
    """
    return sorted((fit_sigma(distance_mm, sigma_mm, law, n) for law in LAWS), key=lambda fit: fit.aic)


@dataclass(frozen=True)
class BiasCorrection:
    """Bias as a polynomial of the measured range: ``sum_i c_i (r / 1000)^i``, r in mm.

    Call it with readings to get them without their bias.

    Attributes
    ----------
    coefficients_mm : tuple of float
    range_mm : (low, high)
        Where it was learnt, mm; readings more than a tenth outside raise ValueError.
    """

    coefficients_mm: tuple[float, ...]
    range_mm: tuple[float, float] = (0.0, np.inf)

    def bias_mm(self, measured_mm: ArrayLike) -> Float64:
        """Evaluate the polynomial.

        Parameters
        ----------
        measured_mm : array_like, mm

        Returns
        -------
        array like `measured_mm`, mm
            The bias expected of these readings.

        Raises
        ------
        ValueError
            If a reading lies where the bias is not known.
        """
        r = np.asarray(measured_mm, np.float64)
        outside = r[(r < 0.9 * self.range_mm[0]) | (r > 1.1 * self.range_mm[1])]
        if outside.size:
            learnt = f"learnt from {self.range_mm[0]:g} to {self.range_mm[1]:g} mm and is not known"
            raise ValueError(
                f"the bias was {learnt} at {outside.flat[0]:g} mm; gate the scan, or learn it from that far"
            )
        return np.asarray(np.polynomial.polynomial.polyval(r / 1000, self.coefficients_mm))

    def __call__(self, measured_mm: ArrayLike) -> Float64:
        """Take the bias out of readings.

        Parameters
        ----------
        measured_mm : array_like, mm

        Returns
        -------
        array like `measured_mm`, mm
        """
        return np.asarray(measured_mm, np.float64) - self.bias_mm(measured_mm)


def learn_bias(true_mm: ArrayLike, measured_mm: ArrayLike, degree: int = 2) -> BiasCorrection:
    """Learn a bias correction by least squares, each residual divided by 1 + (r / 1 m)^2, as its deviation grows.

    Parameters
    ----------
    true_mm, measured_mm : (n,) array_like
        Known distances and readings, mm; what is NaN is left out.
    degree : int
        Degree of the polynomial in range.

    Returns
    -------
    BiasCorrection

    Raises
    ------
    ValueError
        If there are not as many readings as distances, or fewer distances than coefficients.

    Examples
    --------
    >>> correct = learn_bias([500, 1000, 2000], [505, 1006, 2008], degree=1)
    >>> correct([505, 2008]).round(6)
    array([ 500., 2000.])
    """
    true, r = _known(true_mm, measured_mm)
    if (distances := len(np.unique(true))) <= degree:
        few = f"{distances} distances with a valid reading; record more distances or lower the degree"
        raise ValueError(f"{degree + 1} coefficients cannot be learnt from {few}")
    scale = 1 / (1 + (r / 1000) ** 2)
    matrix = np.vander(r / 1000, degree + 1, increasing=True) * scale[:, None]
    coefficients = np.linalg.lstsq(matrix, (r - true) * scale, rcond=None)[0]
    return BiasCorrection(tuple(coefficients.tolist()), (float(r.min()), float(r.max())))


def _known(true_mm: ArrayLike, measured_mm: ArrayLike) -> tuple[Float64, Float64]:
    """Distances and readings, one each, without those of which either is NaN."""
    true, r = (np.asarray(v, np.float64).ravel() for v in (true_mm, measured_mm))
    if len(true) != len(r):
        raise ValueError(f"each reading needs its known distance, got {len(true)} distances and {len(r)} readings")
    valid = np.isfinite(true) & np.isfinite(r)
    return true[valid], r[valid]


def bias_correction_test(
    true_mm: ArrayLike, measured_mm: ArrayLike, *, degree: int = 2, rng: np.random.Generator
) -> dict[str, float]:
    """Learn the bias on one random half of the readings, test it on the other half.

    Parameters
    ----------
    true_mm, measured_mm, degree
        As for `learn_bias`.
    rng : numpy.random.Generator
        Draws the halves.

    Returns
    -------
    dict
        ``n_learn, n_test``, and over the test half ``rms_before_mm, rms_after_mm`` (of single
        readings) and ``bias_before_mm, bias_after_mm`` (rms, over the distances with at least 10
        readings in that half, of the mean error).

    Raises
    ------
    ValueError
        As `learn_bias`, of the half to learn from.
    """
    true, r = _known(true_mm, measured_mm)
    halves = rng.permutation(len(r))
    learn, test = np.sort(halves[: len(r) // 2]), np.sort(halves[len(r) // 2 :])
    learnt = learn_bias(true[learn], r[learn], degree)
    corrected = replace(learnt, range_mm=(0.0, np.inf))(r[test])  # the halves need not reach equally far
    result: dict[str, float] = {"n_learn": len(learn), "n_test": len(test)}
    for name, values in (("before", r[test]), ("after", corrected)):
        error = values - true[test]
        places = [error[true[test] == d] for d in np.unique(true[test])]
        means = [p.mean() for p in places if len(p) >= _LEAST_IN_MEAN] or [np.nan]
        result[f"rms_{name}_mm"] = float(np.sqrt(np.mean(error**2)))
        result[f"bias_{name}_mm"] = float(np.sqrt(np.mean(np.square(means))))
    return result


@dataclass(frozen=True, eq=False)
class ErrorAgainstN:
    """Error of the combination of n realizations.

    Attributes
    ----------
    n : (k,) int
        Realizations combined.
    rms_mm : (k,) float64
        Root mean square error against the truth, mm.
    spread_mm : (k,) float64
        Its random part, mm.
    bias_mm : float
        The part that no averaging removes, mm.
    """

    n: Ints
    rms_mm: Float64
    spread_mm: Float64
    bias_mm: float


def error_against_n(
    readings_mm: ArrayLike,
    true_mm: float,
    *,
    rng: np.random.Generator,
    n: Sequence[int] = (1, 2, 3, 5, 10, 20, 50),
    method: Literal["median", "mean"] = "median",
) -> ErrorAgainstN:
    """Find out how the error falls with the number of realizations combined.

    Parameters
    ----------
    readings_mm : (m,) array_like
        Readings at one distance, mm; NaN are left out.
    true_mm : float
        That distance, mm.
    rng : numpy.random.Generator
        Draws the realizations, each from all readings: combinations without repeats would agree the more the nearer n
        comes to m, and all be the same at m.
    n : sequence of int
        Numbers of realizations; those above m are left out.
    method : {"median", "mean"}
        How they are combined.

    Returns
    -------
    ErrorAgainstN

    Raises
    ------
    ValueError
        If no reading is valid, no number is left, or for an unknown method.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> curve = error_against_n(rng.normal(1000, 8, 500), 1000, rng=rng, n=(1, 5, 20), method="mean")
    >>> curve.rms_mm.round(0)
    array([8., 4., 2.])
    """
    if method not in ("median", "mean"):
        raise ValueError(f'method must be "median" or "mean", got {method!r}')
    combine = np.median if method == "median" else np.mean
    values = np.asarray(readings_mm, np.float64).ravel()
    values = values[np.isfinite(values)]
    if not len(values):
        raise ValueError("none of the readings is valid; nothing to combine")
    numbers = np.array([k for k in n if 1 <= k <= len(values)], int)
    if not len(numbers):
        raise ValueError(f"none of n = {tuple(n)} lies between 1 and the {len(values)} valid readings: record more")
    drawn = values[rng.integers(len(values), size=(_DRAWS, numbers.max()))]
    errors = np.stack([combine(drawn[:, :k], axis=1) - true_mm for k in numbers])
    bias = float(values.mean() - true_mm)
    return ErrorAgainstN(numbers, np.sqrt((errors**2).mean(axis=1)), errors.std(axis=1), bias)
