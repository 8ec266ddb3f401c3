"""Lines, right-angled corners and circles through the readings of a laser: least squares along the beams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereolib.base import Float64, direction
from stereolib.laser.points import Rays

_STEPS = 4  # of Gauss-Newton: an angle right to 0.1 rad is right to 1e-8 after three
_CIRCLE_STEPS = 8  # from the algebraic fit a round outline needs four
_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])
_CANDIDATES = 2  # splits of a corner that are fitted in full


@dataclass(frozen=True, eq=False)
class Lines:
    """One line, or two at right angles.

    Attributes
    ----------
    parameters : (2,) or (3,) float64
        Angle of the first normal, rad, and the offset of each line, mm.
    covariance : (2, 2) or (3, 3) float64
    chi2 : float
        Sum of the squared residuals in standard deviations.
    split : int
        The points before it belong to the first line.
    """

    parameters: Float64
    covariance: Float64
    chi2: float
    split: int

    def normal(self, face: int) -> Float64:
        """Unit normal of the first (0) or second (1) line.

        Parameters
        ----------
        face : int

        Returns
        -------
        (2,) float64
        """
        return direction(self.parameters[0] + face * np.pi / 2)


@dataclass(frozen=True, eq=False)
class Circle:
    """A circle that is seen from outside.

    Attributes
    ----------
    parameters : (3,) float64
        Centre and radius, mm.
    covariance : (3, 3) float64
        By the noise of the readings.
    chi2 : float
        Sum of the squared residuals in standard deviations; infinite if the points are seen from inside.
    by_range : (3, N) float64
        By how much the parameters change for 1 mm of each reading.
    cosines : (N,) float64
        Between each beam and the circle's normal where it meets it.
    """

    parameters: Float64
    covariance: Float64
    chi2: float
    by_range: Float64
    cosines: Float64


NO_CIRCLE = Circle(np.full(3, np.nan), np.full((3, 3), np.nan), np.inf, np.zeros((3, 0)), np.zeros(0))


def fit_lines(p: Float64, beams: Rays, sigma: Float64, split: int, start: float | None = None) -> Lines:
    """Fit one line, or two at right angles, by Gauss-Newton on the angle and the offsets.

    Parameters
    ----------
    p : (N, 2) float64, mm
    beams : Rays
        The N beams that met them.
    sigma : (N,) float64
        Standard deviation of each reading along its beam, mm.
    split : int
        Points before it belong to the first line, the others to the second.
    start : float, optional
        Angle of the first normal to start from, rad; by default that of a line through all points.

    Returns
    -------
    Lines
    """
    if start is None:
        centred = p - p.mean(axis=0)
        normal = np.linalg.eigh(centred.T @ centred)[1][:, 0]
        start = float(np.arctan2(normal[1], normal[0]))
    x = np.array([start, 0.0, 0.0] if split < len(p) else [start, 0.0])
    # Turned back by a quarter, the second part's points lie like the first's: one normal serves both.
    q, beam = (np.concatenate([v[:split], v[split:] @ _TURN]) for v in (p, beams.directions))
    columns = np.zeros((len(p), len(x) - 1))
    columns[:split, 0] = columns[split:, -1] = 1.0
    for step in range(_STEPS):
        c, s = np.cos(x[0]), np.sin(x[0])
        across, along = q @ [c, s], q @ [-s, c]
        weight = 1 / (sigma * np.maximum(np.abs(beam @ [c, s]), 0.05))
        if step == 0:  # the offsets first
            w2 = weight**2
            x[1:] = (w2 * across) @ columns / np.maximum(w2 @ columns, 1e-12)
            continue
        J = np.concatenate([along[:, None], -columns], axis=1) * weight[:, None]
        e = (across - columns @ x[1:]) * weight
        A = J.T @ J
        x = x - np.linalg.solve(A, J.T @ e)
    return Lines(x, np.linalg.inv(A), float(e @ e), split)


def fit_corner(p: Float64, beams: Rays, sigma: Float64) -> Lines | None:
    """Fit the best corner that stands out towards the sensor.

    Parameters
    ----------
    p : (N, 2) float64, mm
    beams : Rays
        The N beams that met them.
    sigma : (N,) float64, mm

    Returns
    -------
    Lines or None
        None if no split makes such a corner.
    """
    n, towards = len(p), beams.directions
    weight = 1 / sigma**2
    moments = np.stack([weight, *(weight * p.T), *(weight * (p[:, i] * p[:, j]) for i, j in ((0, 0), (0, 1), (1, 1)))])
    sums = np.concatenate([np.zeros((6, 1)), moments.cumsum(axis=1)], axis=1)

    def scatter(part: Float64) -> Float64:
        w, x, y, xx, xy, yy = part
        off = xy - x * y / w
        return np.array([[xx - x * x / w, off], [off, yy - y * y / w]]).transpose(2, 0, 1)

    splits = np.arange(1, n)
    second = scatter(sums[:, -1:] - sums[:, splits])
    values, vectors = np.linalg.eigh(scatter(sums[:, splits]) + _TURN.T @ second @ _TURN)
    best: Lines | None = None
    for at in np.argsort(values[:, 0], kind="stable")[:_CANDIDATES]:
        k = int(splits[at])
        fit = fit_lines(p, beams, sigma, k, float(np.arctan2(vectors[at, 1, 0], vectors[at, 0, 0])))
        n1, n2, first, last = fit.normal(0), fit.normal(1), slice(0, k), slice(k, n)
        # Each face lies behind the other's line, as seen from the sensor.
        convex = all(
            np.sign(towards[own].mean(axis=0) @ normal) * (p[other].mean(axis=0) @ normal - c) > 0
            for normal, c, own, other in ((n1, fit.parameters[1], first, last), (n2, fit.parameters[2], last, first))
        )
        if convex and (best is None or fit.chi2 < best.chi2):
            best = fit
    return best


def fit_circle(p: Float64, beams: Rays, sigma: Float64) -> Circle:
    """Fit a circle that is seen from outside.

    Parameters
    ----------
    p : (N, 2) float64, mm
    beams : Rays
        The N beams that met them.
    sigma : (N,) float64, mm

    Returns
    -------
    Circle

    Notes
    -----
    Gauss-Newton on the ranges, ``r = b . m - sqrt(R^2 - m^2 + (b . m)^2)`` along the beam b from its origin, from
    which the centre is m.
    """
    beam = beams.directions
    r = ((p - beams.origins_mm) * beam).sum(axis=1)
    x, y, c = np.linalg.lstsq(np.column_stack([2 * p, np.ones(len(p))]), (p**2).sum(axis=1), rcond=None)[0]
    q = np.array([x, y, np.sqrt(max(c + x * x + y * y, 1.0))])
    if (
        np.linalg.norm(q[:2] - beams.origins_mm, axis=1).min() < q[2]
    ):  # seen from inside: the outline is hollow or straight
        return NO_CIRCLE
    best, damping = np.inf, 1e-3
    for _ in range(_CIRCLE_STEPS):
        m = q[:2] - beams.origins_mm
        along = (beam * m).sum(axis=1)
        root = np.sqrt(np.maximum(q[2] ** 2 - (m**2).sum(axis=1) + along**2, 1.0))
        e = (along - root - r) / sigma
        if e @ e < best * (1 + 1e-9):
            done = best - e @ e < 1e-4 * best
            best, kept, damping = float(e @ e), q, damping / 3
            J = np.column_stack([beam - (along[:, None] * beam - m) / root[:, None], -q[2] / root]) / sigma[:, None]
            A, g, cosines = J.T @ J, J.T @ e, root / q[2]
            if done:
                break
        else:
            damping *= 10
        q = kept - np.linalg.solve(A * (1 + damping * np.eye(3)), g)
    covariance = np.asarray(np.linalg.pinv(A), np.float64)
    return Circle(kept, covariance, best, covariance @ J.T / sigma, cosines)
