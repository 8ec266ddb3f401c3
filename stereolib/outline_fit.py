"""Lines, right-angled corners and circles through the readings of a laser: least squares along the beams."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Lines:
    """One line, or two at right angles: angle of the first normal, offsets, covariance, chi square, split."""

    parameters: Array
    covariance: Array
    chi2: float
    split: int

    def normal(self, face: int) -> Array:
        angle = self.parameters[0] + face * np.pi / 2
        return np.array([np.cos(angle), np.sin(angle)])


def fit_lines(p: Array, sigma: Array, split: int, start: float | None = None) -> Lines:
    """Gauss-Newton on the angle and the offsets; points before the split belong to the first line."""
    second = np.arange(len(p)) >= split
    beam = p / np.linalg.norm(p, axis=1, keepdims=True)
    two = bool(second.any())
    if start is None:
        centred = p - p.mean(axis=0)
        normal = np.linalg.eigh(centred.T @ centred)[1][:, 0]
        start = float(np.arctan2(normal[1], normal[0]))
    x = np.array([start, 0.0, 0.0][: 2 + two])
    for step in range(8):
        n1 = np.array([np.cos(x[0]), np.sin(x[0])])
        n2 = np.array([-n1[1], n1[0]])
        normal, slope = np.where(second[:, None], n2, n1), np.where(second[:, None], -n1, n2)
        facing = np.abs((normal * beam).sum(axis=1))
        weight = 1 / (sigma * np.maximum(facing, 0.05))
        offset = x[1 + second.astype(int)] if step else np.zeros(len(p))
        J = np.stack([(slope * p).sum(axis=1), -1.0 * ~second, -1.0 * second], axis=1)[:, : 2 + two] * weight[:, None]
        e = ((normal * p).sum(axis=1) - offset) * weight
        if not step:  # the offsets first
            x[1:] = np.linalg.lstsq(J[:, 1:], -e, rcond=None)[0]
            continue
        x = x - np.linalg.lstsq(J, e, rcond=None)[0]
    return Lines(x, np.linalg.pinv(J.T @ J), float(e @ e), split)


def fit_corner(p: Array, sigma: Array) -> Lines | None:
    """Best corner that stands out towards the sensor, or None."""
    n = len(p)
    weight = 1 / sigma**2
    moments = np.stack([weight, *(weight * p.T), *(weight * (p[:, i] * p[:, j]) for i, j in ((0, 0), (0, 1), (1, 1)))])
    sums = np.concatenate([np.zeros((6, 1)), moments.cumsum(axis=1)], axis=1)

    def scatter(part: Array) -> Array:
        w, x, y, xx, xy, yy = part
        off = xy - x * y / w
        return np.array([[xx - x * x / w, off], [off, yy - y * y / w]]).transpose(2, 0, 1)

    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    splits = np.arange(1, n)
    values, vectors = np.linalg.eigh(scatter(sums[:, splits]) + turn.T @ scatter(sums[:, -1:] - sums[:, splits]) @ turn)
    best: Lines | None = None
    for at in np.argsort(values[:, 0])[:5]:
        k = int(splits[at])
        fit = fit_lines(p, sigma, k, float(np.arctan2(vectors[at, 1, 0], vectors[at, 0, 0])))
        n1, n2 = fit.normal(0), fit.normal(1)
        # Each face lies behind the other's line, as seen from the sensor.
        convex = all(
            np.sign(c) * (p[part].mean(axis=0) @ normal - c) > 0
            for normal, c, part in ((n1, fit.parameters[1], slice(k, n)), (n2, fit.parameters[2], slice(0, k)))
        )
        if convex and (best is None or fit.chi2 < best.chi2):
            best = fit
    return best


def fit_circle(p: Array, sigma: Array) -> tuple[Array, float, Array]:
    """Centre and radius (3,), chi square, and covariance of a circle seen from outside."""
    from scipy.optimize import least_squares

    r = np.linalg.norm(p, axis=1)
    beam = p / r[:, None]
    design = np.column_stack([2 * p, np.ones(len(p))])
    x, y, c = np.linalg.lstsq(design, r**2, rcond=None)[0]
    radius = np.sqrt(max(c + x * x + y * y, 1.0))

    def residual(q: Array) -> Array:
        along = beam @ q[:2]
        return (along - np.sqrt(np.maximum(q[2] ** 2 - q[:2] @ q[:2] + along**2, 0)) - r) / sigma

    start = np.array([x, y, radius])
    if np.hypot(x, y) < radius:  # seen from inside: the outline is hollow or straight
        return start, np.inf, np.full((3, 3), np.nan)
    fit = least_squares(residual, start, method="lm", max_nfev=60)
    return fit.x, float(2 * fit.cost), np.linalg.pinv(fit.jac.T @ fit.jac)
