"""A pair made ready to be matched, and how far its pictures differ where a map says that they show the same."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from stereolib.base import Float32, UInt8
from stereolib.matching.levels import evened, noise_grey, shaded
from stereolib.matching.rows import find_rows
from stereolib.rig import to_grey

_DETAIL_PX = 11  # window in which detail is measured
_MOST_UNLIKE = 40.0  # grey levels: what differs by more is no more wrong


class EvenPair(NamedTuple):
    """A pair whose rows and exposure agree, and whose brightness does so part by part.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
    noise_grey : float, grey levels
        As `levels.noise_grey` tells it, above 0.
    """

    left: UInt8
    right: UInt8
    noise_grey: float

    def detail(self) -> Float32:
        """Tell where matches are sure: how much the left picture changes along its rows, in squares of the noise.

        Returns
        -------
        (H, W) float32
            Mean of the squared slope over 11 px, less about what the noise alone gives. A match's variance is inverse
            to it.

        Examples
        --------
        >>> left = np.tile(np.arange(0, 200, 5, np.uint8), (4, 1))
        >>> float(EvenPair(left, left, 2.0).detail()[2, 20])
        5.75
        """
        slope = cv2.Sobel(to_grey(self.left), cv2.CV_32F, 1, 0, ksize=1, scale=0.5)
        square = cv2.blur(slope * slope, (_DETAIL_PX, _DETAIL_PX)) / np.float32(self.noise_grey**2)
        return np.asarray(np.maximum(square - np.float32(0.5), 0))

    def unlike(self, disparity_px: Float32) -> Float32:
        """How far the right picture differs from the left one where a map says that it shows the same.

        Parameters
        ----------
        disparity_px : (H, W) float32, px
            Dense.

        Returns
        -------
        (H, W) float32
            In units of the noise: ``|L(u) - R(u - d)|``, mean of the channels, up to 40 grey levels. Beyond the right
            picture its border goes on.

        Examples
        --------
        >>> left = np.tile(np.arange(0, 200, 5, np.uint8), (4, 1))
        >>> pair = EvenPair(left, np.roll(left, -2, axis=1), 1.0)
        >>> [float(pair.unlike(np.full((4, 40), d, np.float32))[2, 20]) for d in (2, 3)]
        [0.0, 5.0]
        """
        v, u = (np.arange(n, dtype=np.float32) for n in disparity_px.shape)
        rows = np.broadcast_to(v[:, None], disparity_px.shape)
        seen = cv2.remap(self.right, u - disparity_px, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        off = np.atleast_3d(cv2.absdiff(self.left, seen)).astype(np.float32)
        mean = cv2.transform(off, np.full((1, off.shape[2]), 1 / off.shape[2], np.float32))
        return np.asarray(np.minimum(mean, _MOST_UNLIKE) / np.float32(self.noise_grey))


def even_out(left: UInt8, right: UInt8) -> EvenPair:
    """Correct the rows and the exposure of a rectified pair, as a whole and part by part, and tell its noise.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8

    Returns
    -------
    EvenPair

    Raises
    ------
    ValueError
        If they are no pair.
    """
    rows, rough_px = find_rows(left, right)
    right = evened(left, rows.correct(right))
    return EvenPair(shaded(left, right, rough_px), right, noise_grey(left, right, rough_px))
