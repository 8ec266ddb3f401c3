"""A pair of pictures, made ready to be measured in: rectified, of one exposure, with rows that agree, and matched."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np

from stereolib.base import Float32, UInt8
from stereolib.matching import SGBMParams, check_sides, match_pair
from stereolib.measurement.plane_alignment import AlignedPair
from stereolib.measurement.rows import RowOffset, measure_rows
from stereolib.rig import RectifiedRig, check_pair, to_grey

#: The pictures are matched in half size: planes and edges are found in the full ones afterwards.
_HALF = SGBMParams(num_disparities=96, mode="3way")
_QUARTER = SGBMParams(num_disparities=64, mode="3way", speckle_window_size=25)
_ROOM_PX = 8  # beyond them, px of the half size
_DOUBTFUL = 0.6  # share of unmatched pixels from which on exchanged sides are suspected
_NEAR = 0.03  # share of the matched pixels that must be nearer than the window for it to follow them
_WINDOW_PX = 15  # of the half size, over which mean and deviation are made alike
_LEAST_DEVIATION = 3.0  # grey levels; less is noise, and stays small
_LEVELLED = 128.0, 40.0  # mean and deviation of what is matched
_CLIPPED = (2, 253)  # grey levels beyond which a pixel tells nothing


@dataclass(frozen=True, eq=False)
class Views:
    """What both cameras saw at one moment.

    Attributes
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        Rectified; the right one's rows are corrected.
    disparity_px : (H, W) float32
        Of the left picture, NaN where nothing was matched.
    pair : AlignedPair
    rows : RowOffset
        What was corrected, and how well it is known.
    clipped : float
        Share of pixels that are black or white in one of the pictures: the larger one.
    """

    left: UInt8
    right: UInt8
    disparity_px: Float32
    pair: AlignedPair
    rows: RowOffset
    clipped: float

    @cached_property
    def slope(self) -> Float32:
        """How fast the left picture's brightness changes along its rows, grey levels per px. (H, W)."""
        return np.asarray(
            cv2.Sobel(cv2.blur(to_grey(self.left), (3, 3)), cv2.CV_32F, 1, 0, ksize=1, scale=0.5), np.float32
        )

    @classmethod
    def of(cls, left: UInt8, right: UInt8, rectified: RectifiedRig) -> Views:
        """Prepare a pair as the cameras gave it.

        Parameters
        ----------
        left, right : (H, W) or (H, W, 3) uint8
        rectified : RectifiedRig

        Returns
        -------
        Views

        Raises
        ------
        ValueError
            If pictures and calibration do not fit together.
        """
        return cls.of_rectified(*rectified.rectify(left, right), lambda: rectified.rectify(right, left))

    @classmethod
    def of_rectified(
        cls, left: UInt8, right: UInt8, exchanged: Callable[[], tuple[UInt8, UInt8]] | None = None
    ) -> Views:
        """Prepare a pair that is rectified already.

        Parameters
        ----------
        left, right : (H, W) or (H, W, 3) uint8
        exchanged : callable, optional
            Makes the pair as it is if left and right were exchanged; default: ``right, left``.

        Returns
        -------
        Views

        Raises
        ------
        ValueError
            If they are no pair.

        Notes
        -----
        The rows are measured in quarter size first, where they are off by less than a pixel; then in half size, where
        the disparities come from too.
        """
        check_pair(left, right)
        grey = to_grey(left), to_grey(right)
        first, second = (_levelled(_halved(_halved(image))) for image in grey)
        roughly = match_pair(first, second, _narrow(_QUARTER, first), whole=True)
        rough = measure_rows(first, second, roughly).doubled().doubled()
        first, second = (_levelled(_halved(image)) for image in (grey[0], rough.correct(grey[1])))
        small = match_pair(first, second, _narrow(_window(roughly), first), whole=True)
        if np.isnan(small).mean() > _DOUBTFUL:
            other = exchanged() if exchanged else (right, left)
            check_sides(*grey, (to_grey(other[0]), to_grey(other[1])))
        rows = measure_rows(first, second, small).doubled().after(rough)
        right = rows.correct(right)
        disparity = cv2.resize(2 * small, left.shape[1::-1], interpolation=cv2.INTER_NEAREST)
        pair = AlignedPair.of(left, right, rows.covariance)
        return cls(left, right, np.asarray(disparity), pair, rows, max(map(_clipped, grey)))


def _window(quarter_px: Float32) -> SGBMParams:
    """How the half size is matched: with a window that holds what is near, as the quarter size saw it."""
    near = 2 * float(np.nanquantile(quarter_px, 1 - _NEAR)) if np.isfinite(quarter_px).any() else 0.0
    return replace(_HALF, num_disparities=max(_HALF.num_disparities, 16 * -(-int(near + _ROOM_PX) // 16)))


def _narrow(params: SGBMParams, image: UInt8) -> SGBMParams:
    """The same with a window that a small picture holds."""
    most = (image.shape[1] - params.block_size) // 16 * 16
    return replace(params, num_disparities=max(16, min(params.num_disparities, most)))


def _halved(image: UInt8) -> UInt8:
    return np.asarray(cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))


def _levelled(image: UInt8) -> UInt8:
    """Give all parts of a picture the same mean and deviation, so that exposures no longer differ."""
    window, (level, deviation) = (_WINDOW_PX, _WINDOW_PX), _LEVELLED
    mean = cv2.blur(image, window, dst=None).astype(np.float32)
    square = cv2.sqrBoxFilter(image, cv2.CV_32F, window)
    spread = cv2.sqrt(np.maximum(square - cv2.blur(image.astype(np.float32), window) ** 2, 0) + _LEAST_DEVIATION**2)
    return np.asarray(cv2.divide(image - mean, spread, scale=deviation) + level).clip(0, 255).astype(np.uint8)


def _clipped(grey: UInt8) -> float:
    low, high = _CLIPPED
    return float(np.count_nonzero((grey < low) | (grey > high)) / grey.size)
