"""A pair of pictures, made ready to be measured in: rectified, of one exposure, with rows that agree, and matched."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np

from stereolib.base import Float32, UInt8, quantile
from stereolib.matching import RowOffset, check_sides, find_rows, is_doubtful
from stereolib.measurement.jpeg_blocks import without_blocks
from stereolib.measurement.light import RawPicture
from stereolib.measurement.plane_alignment import AlignedPair
from stereolib.rig import RectifiedRig, check_pair, to_grey

MOST_OFF, _SURE_STDS = 0.006, 5.0  # of the width: rows that are surely off by more are no knock's, but another rig's
_NOISE_STEP = 3  # every third pixel of every third row tells the noise
_STD_PER_MEDIAN = 1 / 0.6745  # of a normal distribution: deviation over the median of what it is off by


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
    """

    left: UInt8
    right: UInt8
    disparity_px: Float32
    pair: AlignedPair
    rows: RowOffset

    @cached_property
    def slope(self) -> Float32:
        """How fast the left picture's brightness changes along its rows, grey levels per px. (H, W)."""
        return np.asarray(
            cv2.Sobel(cv2.blur(to_grey(self.left), (3, 3)), cv2.CV_32F, 1, 0, ksize=1, scale=0.5), np.float32
        )

    @cached_property
    def slope_noise(self) -> float:
        """Standard deviation of one picture's slopes, as `AlignedPair` has them, that the other one does not share.

        From where both were matched; 0 where nothing was.
        """
        left, right = (picture[..., 1] for picture in self.pair.levels[1])
        step = _NOISE_STEP
        disparity = self.disparity_px[::step, ::step]
        v, u = (np.float32(step) * at for at in np.indices(disparity.shape, np.float32))
        there = np.where(disparity < u, u - disparity, 0)
        off = np.abs(left[::step, ::step] - cv2.remap(right, there, v, cv2.INTER_LINEAR))[there > 0]
        return float(_STD_PER_MEDIAN * quantile(off, 0.5) / np.sqrt(2)) if len(off) else 0.0

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
            If pictures and calibration do not fit together: sizes, or rows by more than 0.6 % of the width.
        """
        check_pair(left, right)
        left, right = without_blocks(left), without_blocks(right)
        views = cls.of_rectified(*rectified.rectify(left, right), lambda: rectified.rectify(right, left))
        warps = np.eye(2, 3), views.rows.warp
        raw = [RawPicture(*each) for each in zip((left, right), rectified.maps, warps, strict=True)]
        return replace(views, pair=replace(views.pair, pictures=(raw[0], raw[1])))

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
            If they are no pair, or their rows are off by more than 0.6 % of the width.
        """
        check_pair(left, right)
        grey = to_grey(left), to_grey(right)
        rows, small = find_rows(*grey)
        if is_doubtful(small):
            other = exchanged() if exchanged else (right, left)
            check_sides(*grey, (to_grey(other[0]), to_grey(other[1])))
        _check_rows(rows, left.shape[1])
        right = rows.correct(right)
        disparity = cv2.resize(2 * small, left.shape[1::-1], interpolation=cv2.INTER_NEAREST)
        pair = AlignedPair.of(left, right, rows.covariance)
        return cls(left, right, np.asarray(disparity), pair, rows)


def _check_rows(rows: RowOffset, width: int) -> None:
    off_px = rows.offset_px
    if abs(off_px) > max(MOST_OFF * width, _SURE_STDS * rows.std_px):
        seen = f"the rows of right are {abs(off_px):.1f} px too {'low' if off_px > 0 else 'high'}"
        ask = "Is the calibration of these cameras, as they stand now? Are the pictures mirrored, or upside down?"
        raise ValueError(f"{seen}: what is measured would be wrong by more than anyone could tell. {ask}")
