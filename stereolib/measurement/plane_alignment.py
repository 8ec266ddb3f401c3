"""Planes of a scene to a few hundredths of a pixel, by aligning the two pictures over them.

Block matching rounds slanted surfaces to steps and errs to one side on steep ones. Over a whole plane the disparity has
two or three unknowns; the pictures themselves, compared pixel by pixel, give them without that error.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.rig import check_pair, to_grey, to_light

Array = np.ndarray
_MOST_PIXELS = 1500  # more add nothing but time
_CELL_PX = 24  # neighbouring pixels err together: those of one cell count as one witness


class CannotMeasure(ValueError):
    """What was asked for cannot be measured here; `reason` is the short name of why, the text says what to do."""

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(f"{reason}: {text}")
        self.reason = reason


@dataclass(frozen=True, eq=False)
class AlignedPair:
    """A rectified pair, made ready to be measured in.

    Attributes
    ----------
    levels : two of (left, right), (H, W, 2) float32
        Brightness without its slow changes, and its slope along the row; coarse, then fine.
    light : (left, right), (H, W) or (H, W, 3) float32
        See `stereolib.images.to_light`.
    """

    levels: tuple[tuple[Array, Array], ...]
    light: tuple[Array, Array]

    @classmethod
    def of(cls, left: Array, right: Array) -> AlignedPair:
        """Prepare two rectified pictures, (H, W) or (H, W, 3) uint8; ValueError if they do not fit together."""
        check_pair(left, right)
        grey = [to_grey(image) for image in (left, right)]
        sharp = [cv2.subtract(image, cv2.blur(image, (31, 31)), dtype=cv2.CV_32F) for image in grey]
        coarse, fine = ([_with_slope(cv2.blur(image, (size, size))) for image in sharp] for size in (7, 3))
        return cls(((coarse[0], coarse[1]), (fine[0], fine[1])), (to_light(left), to_light(right)))


def _with_slope(image: Array) -> Array:
    return np.asarray(cv2.merge([image, cv2.Sobel(image, cv2.CV_32F, 1, 0, ksize=1, scale=0.5)]))


@dataclass(frozen=True, eq=False)
class PlaneFit:
    """Parameters (k,) of a disparity ``x . parameters``, their covariance (k, k), and the share of agreeing pixels."""

    parameters: Array
    covariance: Array
    agreement: float


def align(
    pair: AlignedPair, u: Array, v: Array, x: Array, start: Array, *, coarse_steps: int = 2, steps: int = 2
) -> PlaneFit:
    """Find the plane over which the two pictures agree best.

    Parameters
    ----------
    pair : AlignedPair
    u, v : (N,) float, px
        Whole pixels of the left picture that show the plane.
    x : (N, k) array
        The disparity there is ``x @ parameters``.
    start : (k,) array
        Right to about 2 px.
    coarse_steps, steps : int
        Iterations on the two levels.

    Raises
    ------
    CannotMeasure
        "no texture".

    Notes
    -----
    Gauss-Newton on ``e = L(u, v) - g R(u - x . p, v)`` with Tukey's weights; the slope is the mean of both pictures'.
    """
    parameters = np.array(start, float)
    some = slice(None, None, max(1, -(-len(u) // _MOST_PIXELS)))
    u, v, x = u[some], v[some], x[some]
    width = pair.light[0].shape[1]
    pixel, y = (v * width + u).astype(int), v.astype(np.float32)[None]
    for (left, right), count in zip(pair.levels, (coarse_steps, steps), strict=True):
        mine, my_slope = left.reshape(-1, 2).take(pixel, axis=0).T.astype(float)
        for _ in range(count):
            where = u - x @ parameters
            inside = (where > 2) & (where < width - 3)
            seen = cv2.remap(right, where.astype(np.float32)[None], y, cv2.INTER_LINEAR)[0]
            theirs, their_slope = seen.T.astype(float)  # sums of float32 would depend on the processor
            gain = min(max(float(mine @ theirs) / max(float(theirs @ theirs), 1e-9), 0.7), 1.4)
            e = (mine - gain * theirs) * inside
            slope = 0.5 * (my_slope + gain * their_slope)
            reach = max(4.7 * 1.48 * median(np.abs(e[::4])), 2.0)
            weight = np.maximum(1 - (e / reach) ** 2, 0) ** 2 * inside
            J = x * slope[:, None]
            weighted = (J * weight[:, None]).T
            try:
                parameters = parameters - np.linalg.solve(weighted @ J, weighted @ e)
            except np.linalg.LinAlgError:
                text = "the pictures show nothing to align; light or texture the surface"
                raise CannotMeasure("no texture", text) from None
    covariance = clustered_covariance(J, e, weight, cell_of(u, v))
    return PlaneFit(parameters, covariance, np.count_nonzero(weight) / len(weight))


def median(values: Array) -> float:
    """Median of a few numbers (N,); `np.median` takes longer to look at its arguments than to sort them."""
    ordered = np.sort(values)
    return float(ordered[(len(values) - 1) // 2] + ordered[len(values) // 2]) / 2


def cell_of(u: Array, v: Array) -> Array:
    """Number of the 24 x 24 pixel cell that pixels lie in, (N,) int."""
    row, column = (np.asarray(a, int) // _CELL_PX for a in (v, u))
    return row * (int(column.max(initial=0)) + 1) + column


def clustered_covariance(x: Array, residual: Array, weight: Array, cluster: Array) -> Array:
    """Covariance of a weighted linear fit whose errors are common within clusters.

    Parameters
    ----------
    x : (N, k) array
        Rows of the design matrix.
    residual, weight : (N,) arrays
    cluster : (N,) int array, >= 0

    Notes
    -----
    With ``g_c`` the sum of ``w r x`` over cluster c: ``C = A^-1 (sum_c g_c g_c') A^-1``, ``A = sum w x x'``.
    """
    scaled = x * weight[:, None]
    inverse = np.linalg.inv(scaled.T @ x)
    g = np.stack([np.bincount(cluster, column * residual) for column in scaled.T], axis=1)
    filled = np.count_nonzero(np.bincount(cluster))
    return inverse @ (g.T @ g) @ inverse * (filled / max(filled - x.shape[1], 1))
