"""Statistics of fits to measured numbers: quick medians and quantiles, covariances where clusters share errors."""

from __future__ import annotations

import numpy as np

from stereolib.base.arrays import Float64, Floats, Ints


def median(values: Floats) -> float:
    """Take the median of a few numbers; `np.median` takes longer to look at its arguments than to sort them.

    Parameters
    ----------
    values : (N,) float

    Returns
    -------
    float
    """
    ordered = values.copy()
    ordered.sort()
    return float(ordered[(len(values) - 1) // 2] + ordered[len(values) // 2]) / 2


def quantile(values: Floats, share: float) -> float:
    """Take a quantile of a few numbers, interpolated between two: `np.quantile` takes much longer over them.

    Parameters
    ----------
    values : (N,) float
        Without NaN.
    share : float
        0..1.

    Returns
    -------
    float

    Examples
    --------
    >>> quantile(np.array([3.0, 0.0, 2.0, 1.0]), 0.75)
    2.25
    """
    ordered = values.copy()
    ordered.sort()
    at = share * (len(values) - 1)
    low = int(at)
    first, second = float(ordered[low]), float(ordered[min(low + 1, len(values) - 1)])
    step, part = second - first, at - low
    return first + step * part if part < 0.5 else second - step * (1 - part)  # as numpy rounds it


def clustered_covariance(
    x: Float64, residual: Float64, weight: Float64, cluster: Ints, bend: Float64 | None = None
) -> Float64:
    """Covariance of a weighted linear fit whose errors are common within clusters.

    Parameters
    ----------
    x : (N, k) float64
        Rows of the design matrix.
    residual, weight : (N,) float64
    cluster : (N,) int, >= 0
    bend : (N,) float64, optional
        Of a robust fit: the derivative of ``w r`` with respect to r, in whose stead `weight` would be too sure.

    Returns
    -------
    (k, k) float64

    Raises
    ------
    numpy.linalg.LinAlgError
        If what remains without some cluster does not tell the fit, as where there is but one.

    Notes
    -----
    The jackknife: with ``g_c`` the sum of ``w r x`` over cluster c and ``A_c`` that of ``b x x'``, b being w or `bend`,
    leaving the cluster out moves the fit by ``(A - A_c)^-1 g_c``; the covariance is the sum of these moves' squares.

    References
    ----------
    Bell, McCaffrey: Bias reduction in standard errors for linear regression with multi-stage samples. Survey
    Methodology 28 (2002).
    """
    k = x.shape[1]
    scaled = x * weight[:, None]
    g = np.stack([np.bincount(cluster, column * residual) for column in scaled.T], axis=1)
    bent = scaled if bend is None else x * bend[:, None]
    parts = [np.bincount(cluster, bent[:, i] * x[:, j]) for i in range(k) for j in range(k)]
    each = np.stack(parts, axis=1).reshape(-1, k, k)
    rest = each.sum(axis=0) - each
    moves = np.linalg.solve(rest, g[..., None])[..., 0]
    return np.asarray(moves.T @ moves)
