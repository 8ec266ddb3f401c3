"""Planes of a scene to a few hundredths of a pixel, by aligning the two pictures over them.

Block matching rounds slanted surfaces to steps and errs to one side on steep ones. Over a whole plane the disparity has
two or three unknowns; the pictures themselves, compared pixel by pixel, give them without that error.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from stereolib.base import Bools, Float32, Float64, Floats, Ints, UInt8, clustered_covariance, median
from stereolib.calibration import DisparityErrors
from stereolib.measurement.light import Picture
from stereolib.rig import check_pair, to_grey

_MOST_PIXELS = 1500  # more add nothing but time
_ASKED = 60  # of them, what the calibration leaves open
_CELL_PX = 24  # neighbouring pixels err together: those of one cell count as one witness
_BACKGROUND_PX = (31, 1)  # brightness that changes more slowly than this is taken away: the cameras' exposures differ
_DEVIATION, _LEAST_DEVIATION = 30.0, 3.0  # grey levels that it is given; less than so many are noise, and stay small
_BLUR_PX = (3, 3)  # of either level; the coarse one, in half size, leads from 2 px off to a fraction
_MOST_STEPS, _CONVERGED_PX = 10, 0.003  # Gauss-Newton steps on either level
_GAINS = (0.7, 1.4)  # of the right picture's contrast: what automatic exposure does, and no more
_TUKEY = 4.7 * 1.48  # Tukey's weights end at so many median absolute residuals (95 % efficient for normal errors)


_NOTHING = "the pictures show nothing to align; light or texture the surface"


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
        self.reason, self.text = reason, text


@dataclass(frozen=True, eq=False)
class AlignedPair:
    """A rectified pair, made ready to be measured in.

    Attributes
    ----------
    levels : two of (left, right), (H / 2, W / 2, 2) and (H, W, 2) float32
        Brightness without its slow changes and of one deviation everywhere, and its slope along the row.
    pictures : (left, right), (H, W) or (H, W, 3) uint8, or RawPicture
        What edges are located in: as they came, or as the cameras gave them.
    rows_covariance : (3, 3) float64
        Of the row offset that may be left between them (`RowOffset.covariance`).
    errors : DisparityErrors or None
        What the calibration leaves open of their disparities, from place to place.
    """

    levels: tuple[tuple[Float32, Float32], ...]
    pictures: tuple[Picture, Picture]
    rows_covariance: Float64 = field(default_factory=lambda: np.zeros((3, 3)))
    errors: DisparityErrors | None = None

    @classmethod
    def of(cls, left: UInt8, right: UInt8, rows_covariance: Float64 | None = None) -> AlignedPair:
        """Prepare two rectified pictures.

        Parameters
        ----------
        left, right : (H, W) or (H, W, 3) uint8
        rows_covariance : (3, 3) float64, optional
            By default their rows agree.

        Returns
        -------
        AlignedPair

        Raises
        ------
        ValueError
            If they differ in size, channels or type.
        """
        check_pair(left, right)
        rows = np.zeros((3, 3)) if rows_covariance is None else rows_covariance
        # Large arrays in one piece: memory that is had and given back in many costs more than what is done in it.
        fine, coarse = np.empty((2, *left.shape[:2], 2), np.float32), list[Float32]()
        for image, into in zip((left, right), fine, strict=True):
            sharp = _levelled(to_grey(image))
            coarse.append(_with_slope(cv2.resize(sharp, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)))
            _with_slope(sharp, into)
        return cls(((coarse[0], coarse[1]), (fine[0], fine[1])), (left, right), rows)


def _levelled(grey: UInt8) -> Float32:
    """Take a picture's slow changes away and give all its parts one deviation."""
    slow, small = _BACKGROUND_PX, (8, 8)
    sharp = cv2.subtract(grey, cv2.blur(grey, slow), dtype=cv2.CV_32F)
    power = cv2.blur(
        cv2.resize(cv2.multiply(sharp, sharp), None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA), small
    )
    spread = cv2.resize(cv2.sqrt(power + _LEAST_DEVIATION**2), grey.shape[::-1], interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.divide(sharp, spread, sharp, scale=_DEVIATION))


def _with_slope(image: Floats, into: Float32 | None = None) -> Float32:
    """A picture, blurred in its place, and its slope along the row: (H, W, 2)."""
    soft = cv2.blur(image, _BLUR_PX, image)
    return np.asarray(cv2.merge([soft, cv2.Sobel(soft, cv2.CV_32F, 1, 0, ksize=1, scale=0.5)], into))


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


def align(
    pair: AlignedPair, u: Float64, v: Float64, x: Float64, start: Float64, *, most: int = _MOST_PIXELS
) -> PlaneFit:
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
    most : int
        Pixels that are compared, of those given.

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
    Noise has slopes too, and their squares only add up: they would pass for texture, and the covariance would be too
    small. There the product of the left and the right slope stands in their stead, as two pictures' noises are
    independent.

    References
    ----------
    Baker, Matthews: Lucas-Kanade 20 years on. Int. J. Comput. Vis. 56 (2004), doi:10.1023/B:VISI.0000011205.11775.fd.
    """
    some = slice(None, None, max(1, -(-len(u) // most)))
    u, v, x = u[some], v[some], x[some]
    parameters, width = np.array(start, float), pair.pictures[0].shape[1]
    for left, right in pair.levels:
        zoom = left.shape[1] / width
        rows = _places(v, zoom)
        mine = _sample(left, _places(u, zoom), rows, zoom)
        for _ in range(_MOST_STEPS):
            where = u - x @ parameters
            inside = (where > 2) & (where < width - 3)
            now = _compare(mine, _sample(right, _places(where, zoom), rows, zoom), inside)
            J = x * now.slope[:, None]
            weighted = (J * now.weight[:, None]).T
            try:
                step = np.linalg.solve(weighted @ J, weighted @ now.error)
            except np.linalg.LinAlgError:
                raise CannotMeasure("no texture", _NOTHING) from None
            parameters = parameters - step
            if np.mean(np.abs(x @ step)) < _CONVERGED_PX:
                break
    where = u - x @ parameters
    columns = _places(where)
    down = now.gain * (_sample(right, columns, _places(v + 0.5))[0] - _sample(right, columns, _places(v - 0.5))[0])
    bent, curved = ((x * a[:, None]).T for a in (now.bend * now.slope, now.curvature))
    try:
        covariance = clustered_covariance(x, now.slope * now.error, now.weight, cell_of(u, v), now.curvature)
        by_rows = np.linalg.solve(curved @ x, bent @ (down[:, None] * np.stack([where, v, np.ones(len(v))], axis=1)))
    except np.linalg.LinAlgError:
        raise CannotMeasure("no texture", _NOTHING) from None
    covariance = covariance + by_rows @ pair.rows_covariance @ by_rows.T
    if pair.errors is not None:
        some = slice(None, None, -(-len(u) // _ASKED))
        shared = pair.errors.within(u[some], v[some], x[some] @ parameters)
        by_calibration = np.linalg.lstsq(x[some], shared, rcond=None)[0]
        covariance = covariance + by_calibration @ by_calibration.T
    return PlaneFit(parameters, covariance)


def _places(px: Float64, zoom: float = 1.0) -> Float32:
    """Columns or rows of pixels of the full size, in a picture so many times as large: (1, N)."""
    return np.asarray(((px + 0.5) * zoom - 0.5).astype(np.float32)[None])


def _sample(image: Float32, x: Float32, y: Float32, zoom: float = 1.0) -> Float64:
    """Brightness and slope (2, N) at places of a picture that is so many times as large."""
    found = cv2.remap(image, x, y, cv2.INTER_LINEAR)[0].T.astype(float, order="C")  # float32: depends on the processor
    found[1] *= zoom
    return np.asarray(found)


@dataclass(frozen=True, eq=False)
class _Comparison:
    """Error and both slopes of every pixel, how far it is off, Tukey's weight's root, the gain of the right picture."""

    error: Float64
    slopes: tuple[Float64, Float64]
    off: Float64
    root: Float64
    gain: float

    @property
    def slope(self) -> Float64:
        """Of both pictures."""
        return 0.5 * (self.slopes[0] + self.slopes[1])

    @property
    def weight(self) -> Float64:
        """Tukey's."""
        return self.root * self.root

    @property
    def bend(self) -> Float64:
        """Derivative of the weighted error."""
        return self.root * (1 - 5 * self.off)

    @property
    def curvature(self) -> Float64:
        """Of the cost."""
        return self.bend * self.slopes[0] * self.slopes[1]


def _compare(left: Float64, right: Float64, inside: Bools) -> _Comparison:
    (mine, slope), (theirs, their_slope) = left, right
    gain = min(max(float(mine @ theirs) / max(float(theirs @ theirs), 1e-9), _GAINS[0]), _GAINS[1])
    error = (mine - gain * theirs) * inside
    off = (error / max(_TUKEY * median(np.abs(error[::4])), 2.0)) ** 2
    return _Comparison(error, (slope, gain * their_slope), off, np.maximum(1 - off, 0) * inside, gain)


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
