"""Planes of a scene to a few hundredths of a pixel, by aligning the two pictures over them.

Block matching rounds slanted surfaces to steps and errs to one side on steep ones. Over a whole plane the disparity has
two or three unknowns; the pictures themselves, compared pixel by pixel, give them without that error.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.base import Float32, Float64, Floats, Ints, UInt8
from stereolib.rig import check_pair, to_grey, to_light

_MOST_PIXELS = 1500  # more add nothing but time
_CELL_PX = 24  # neighbouring pixels err together: those of one cell count as one witness
_BACKGROUND_PX = 31  # brightness that changes more slowly than this is taken away: the cameras' exposures differ
_BLURS_PX = (7, 3)  # of the coarse level, which leads from 2 px off to a fraction, and of the fine one
_STEPS = (2, 2)  # Gauss-Newton steps on either level
_GAINS = (0.7, 1.4)  # of the right picture's contrast: what automatic exposure does, and no more
_TUKEY = 4.7 * 1.48  # Tukey's weights end at so many median absolute residuals (95 % efficient for normal errors)


class CannotMeasure(ValueError):
    """What was asked for cannot be measured here.

    Parameters
    ----------
    reason : str
        Its short name, such as ``"no floor"``.
    text : str
        What was seen, and what to do.
    """

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
        The pictures as light (`stereolib.rig.to_light`).
    """

    levels: tuple[tuple[Float32, Float32], ...]
    light: tuple[Float32, Float32]

    @classmethod
    def of(cls, left: UInt8, right: UInt8) -> AlignedPair:
        """Prepare two rectified pictures.

        Parameters
        ----------
        left, right : (H, W) or (H, W, 3) uint8

        Returns
        -------
        AlignedPair

        Raises
        ------
        ValueError
            If they differ in size, channels or type.
        """
        check_pair(left, right)
        grey, slow = [to_grey(image) for image in (left, right)], (_BACKGROUND_PX, _BACKGROUND_PX)
        sharp = [cv2.subtract(image, cv2.blur(image, slow), dtype=cv2.CV_32F) for image in grey]
        coarse, fine = ([_with_slope(cv2.blur(image, (size, size))) for image in sharp] for size in _BLURS_PX)
        return cls(((coarse[0], coarse[1]), (fine[0], fine[1])), (to_light(left), to_light(right)))


def _with_slope(image: Float32) -> Float32:
    return np.asarray(cv2.merge([image, cv2.Sobel(image, cv2.CV_32F, 1, 0, ksize=1, scale=0.5)]))


@dataclass(frozen=True, eq=False)
class PlaneFit:
    """A plane over which two pictures agree.

    Attributes
    ----------
    parameters : (k,) float64
        The disparity is ``x . parameters``.
    covariance : (k, k) float64
    """

    parameters: Float64
    covariance: Float64


def align(pair: AlignedPair, u: Float64, v: Float64, x: Float64, start: Float64) -> PlaneFit:
    """Find the plane over which the two pictures agree best.

    Parameters
    ----------
    pair : AlignedPair
    u, v : (N,) float64, px
        Whole pixels of the left picture that show the plane.
    x : (N, k) float64
        The disparity there is ``x @ parameters``.
    start : (k,) float64
        Right to about 2 px.

    Returns
    -------
    PlaneFit

    Raises
    ------
    CannotMeasure
        "no texture", if the pictures show nothing to align.

    Notes
    -----
    Gauss-Newton on ``e = L(u, v) - g R(u - x . p, v)`` with Tukey's weights; the slope is the mean of both pictures'.

    References
    ----------
    Baker, Matthews: Lucas-Kanade 20 years on. Int. J. Comput. Vis. 56 (2004), doi:10.1023/B:VISI.0000011205.11775.fd.
    """
    parameters = np.array(start, float)
    some = slice(None, None, max(1, -(-len(u) // _MOST_PIXELS)))
    u, v, x = u[some], v[some], x[some]
    width = pair.light[0].shape[1]
    pixel, y = (v * width + u).astype(int), v.astype(np.float32)[None]
    for (left, right), count in zip(pair.levels, _STEPS, strict=True):
        mine, my_slope = left.reshape(-1, 2).take(pixel, axis=0).T.astype(float)
        for _ in range(count):
            where = u - x @ parameters
            inside = (where > 2) & (where < width - 3)
            sampled = cv2.remap(right, where.astype(np.float32)[None], y, cv2.INTER_LINEAR)[0]
            theirs, their_slope = sampled.T.astype(float)  # sums of float32 would depend on the processor
            gain = min(max(float(mine @ theirs) / max(float(theirs @ theirs), 1e-9), _GAINS[0]), _GAINS[1])
            e = (mine - gain * theirs) * inside
            slope = 0.5 * (my_slope + gain * their_slope)
            reach = max(_TUKEY * median(np.abs(e[::4])), 2.0)
            weight = np.maximum(1 - (e / reach) ** 2, 0) ** 2 * inside
            J = x * slope[:, None]
            weighted = (J * weight[:, None]).T
            try:
                parameters = parameters - np.linalg.solve(weighted @ J, weighted @ e)
            except np.linalg.LinAlgError:
                text = "the pictures show nothing to align; light or texture the surface"
                raise CannotMeasure("no texture", text) from None
    return PlaneFit(parameters, clustered_covariance(J, e, weight, cell_of(u, v)))


def median(values: Floats) -> float:
    """Take the median of a few numbers; `np.median` takes longer to look at its arguments than to sort them.

    Parameters
    ----------
    values : (N,) float

    Returns
    -------
    float
    """
    ordered = np.sort(values)
    return float(ordered[(len(values) - 1) // 2] + ordered[len(values) // 2]) / 2


def cell_of(u: Float64, v: Float64) -> Ints:
    """Number the cells of 24 x 24 pixels that pixels lie in: those of one cell err together.

    Parameters
    ----------
    u, v : (N,) float64, px

    Returns
    -------
    (N,) int
    """
    row, column = (np.asarray(a, int) // _CELL_PX for a in (v, u))
    return np.asarray(row * (int(column.max(initial=0)) + 1) + column)


def clustered_covariance(x: Float64, residual: Float64, weight: Float64, cluster: Ints) -> Float64:
    """Covariance of a weighted linear fit whose errors are common within clusters.

    Parameters
    ----------
    x : (N, k) float64
        Rows of the design matrix.
    residual, weight : (N,) float64
    cluster : (N,) int, >= 0

    Returns
    -------
    (k, k) float64

    Notes
    -----
    With ``g_c`` the sum of ``w r x`` over cluster c: ``C = A^-1 (sum_c g_c g_c') A^-1``, ``A = sum w x x'``, times
    ``n / (n - k)`` for n clusters that hold something.
    """
    scaled = x * weight[:, None]
    inverse = np.linalg.inv(scaled.T @ x)
    g = np.stack([np.bincount(cluster, column * residual) for column in scaled.T], axis=1)
    filled = np.count_nonzero(np.bincount(cluster))
    return np.asarray(inverse @ (g.T @ g) @ inverse * (filled / max(filled - x.shape[1], 1)))
