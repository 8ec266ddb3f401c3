"""Planes of a scene to a few hundredths of a pixel, by aligning the two pictures over them.

Block matching rounds slanted surfaces to steps and errs to one side on steep ones. Over a whole plane the disparity has
two or three unknowns; the pictures themselves, compared pixel by pixel, give them without that error.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.images import check_pair, to_grey

Array = np.ndarray
_CELL_PX = 24  # neighbouring pixels err together: those of one cell count as one witness


@dataclass(frozen=True, eq=False)
class AlignedPair:
    """A rectified pair, made ready: brightness without its slow changes, and its slope along the row.

    ``levels`` holds, coarse then fine, (left, right, left slope, right slope), each (H, W) float32.
    """

    levels: tuple[tuple[Array, Array, Array, Array], ...]

    @classmethod
    def of(cls, left: Array, right: Array) -> AlignedPair:
        """Prepare two rectified pictures, (H, W) or (H, W, 3) uint8; ValueError if they do not fit together."""
        check_pair(left, right)
        grey = [to_grey(image).astype(np.float32) for image in (left, right)]
        slow = [cv2.blur(image, (31, 31)) for image in grey]
        grey = [image - mean for image, mean in zip(grey, slow, strict=True)]
        levels = []
        for sigma_px in (2.5, 0.8):
            a, b = (cv2.GaussianBlur(image, (0, 0), sigma_px) for image in grey)
            slope = [cv2.Sobel(image, cv2.CV_32F, 1, 0, ksize=1, scale=0.5) for image in (a, b)]
            levels.append((a, b, *slope))
        return cls(tuple(levels))


@dataclass(frozen=True, eq=False)
class PlaneFit:
    """Parameters (k,) of a disparity ``x . parameters``, their covariance (k, k), and the share of agreeing pixels."""

    parameters: Array
    covariance: Array
    agreement: float


def align(pair: AlignedPair, u: Array, v: Array, x: Array, start: Array, *, steps: int = 3) -> PlaneFit:
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
    steps : int
        Iterations on each of the two levels.

    Raises
    ------
    ValueError
        If the pictures have no texture there.

    Notes
    -----
    Gauss-Newton on ``e = L(u, v) - g R(u - x . p, v)`` with Tukey's weights; the slope is the mean of both pictures'.
    """
    parameters = np.array(start, float)
    at = v.astype(int), u.astype(int)
    for left, right, left_slope, right_slope in pair.levels:
        mine, my_slope = left[at], left_slope[at]
        for _ in range(steps):
            column = u - x @ parameters
            inside = (column > 1) & (column < left.shape[1] - 2)
            theirs, their_slope = sample((right, right_slope), np.where(inside, column, 0), v)
            gain = np.clip((mine @ theirs) / max(float(theirs @ theirs), 1e-9), 0.7, 1.4)
            e = mine - gain * theirs
            slope = 0.5 * (my_slope + gain * their_slope)
            reach = max(4.7 * 1.48 * float(np.median(np.abs(e[inside]))), 2.0) if inside.any() else 1.0
            weight = np.where(inside & (np.abs(e) < reach), (1 - (e / reach) ** 2) ** 2, 0.0)
            J = x * slope[:, None]
            A = (J * weight[:, None]).T @ J
            if not np.linalg.cond(A) < 1e12:
                raise ValueError("the pictures have no texture there: nothing to align. Light or texture the surface")
            parameters = parameters - np.linalg.solve(A, J.T @ (weight * e))
    covariance = clustered_covariance(J, e, weight, cell_of(u, v))
    return PlaneFit(parameters, covariance, float((weight > 0).mean()))


def sample(images: tuple[Array, ...], u: Array, v: Array) -> list[Array]:
    """Pictures at points between the pixels, bilinear. Each (N,) or (N, channels)."""
    columns = 1024  # cv2.remap limits the size of a map, so the list is folded into rows
    rows = -(-len(u) // columns)
    maps = np.zeros((2, rows * columns), np.float32)
    maps[0, : len(u)], maps[1, : len(u)] = u, v
    x, y = maps.reshape(2, rows, columns)
    found = [cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for image in images]
    return [f.reshape(rows * columns, *f.shape[2:])[: len(u)] for f in found]


def cell_of(u: Array, v: Array) -> Array:
    """Number of the 24 x 24 pixel cell that pixels lie in, (N,) int."""
    return (v // _CELL_PX * 4096 + u // _CELL_PX).astype(int)


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
    _, cluster = np.unique(cluster, return_inverse=True)
    g = np.stack([np.bincount(cluster, column * residual) for column in scaled.T], axis=1)
    return inverse @ (g.T @ g) @ inverse * (len(g) / max(len(g) - x.shape[1], 1))
