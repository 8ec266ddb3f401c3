"""A pair to a depth map in millimetres, with its standard deviation, and to coloured points before the camera."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from stereolib.base import Bools, Float32, Float64, Floats, UInt8
from stereolib.calibration import DisparityErrors
from stereolib.matching import CheckedMatch, check_matchable, disparity_to_depth, match_checked
from stereolib.measurement.camera_moves import moved_back
from stereolib.measurement.disparity_map import pixel_rays
from stereolib.measurement.instrument import Instrument
from stereolib.measurement.views import MOST_OFF

_ROWS_PX = 1.0  # that rows may be off where nothing corrects them
_MOST_STD = 0.1  # of a point's depth: what is known worse is no point
_APART_PX, _DISPARITIES = 16, 5  # places and disparities for which the calibration's errors are told
_LEAST = 1e-9  # of a depth, so that there is a logarithm


@dataclass(frozen=True, eq=False)
class DepthMap:
    """What a pair tells of depth, along the optical axis of the rectified left camera.

    Attributes
    ----------
    match : CheckedMatch
        Its disparities, and what speaks against them.
    left : (H, W) or (H, W, 3) uint8
        The rectified left picture.
    instrument : Instrument
        As it stands now (`moved_back`).
    is_filled : bool
        Pixels that were filled by a guess have a depth, too.
    """

    match: CheckedMatch
    left: UInt8
    instrument: Instrument
    is_filled: bool = False

    @cached_property
    def depth_mm(self) -> Float32:
        """``Z = f B / d``, NaN where invalid, and where d is not above its deviation: that may be anywhere. (H, W)."""
        estimate, rectified = self.match.estimate, self.instrument.rectified
        told = estimate.disparity_px if self.is_filled else np.where(estimate.matched, estimate.disparity_px, np.nan)
        if estimate.std_px is not None:
            told = np.where(told > estimate.std_px, told, np.nan)
        return disparity_to_depth(told, rectified.f_px, rectified.baseline_mm).astype(np.float32)

    @cached_property
    def std_mm(self) -> Float32 | None:
        """Standard deviation of each depth: the matcher's, and what the calibration leaves open. (H, W).

        ``(std_Z / Z)^2 = (std_d / d)^2 + (std_c / d)^2 + s^2``, std_c that of a shift which correcting rows and turn
        may have left, s the calibration's: where the errors from place to place are known, those of the point
        (`DisparityErrors.of_points`), told every 16 px for five disparities and interpolated; else ``s^2 = g' C g``, C
        the covariance of f, B and an offset of all disparities, ``g = (1 / f, 1 / B, 1 / d)``. None where the pipeline
        tells no deviation.
        """
        std_px = self.match.estimate.std_px
        if std_px is None:
            return None
        d = np.where(np.isfinite(self.depth_mm), self._disparity_px, np.nan).astype(np.float64)
        share = (np.square(std_px) + self.match.columns_std_px**2 + self.instrument.turn_std_px**2) / np.square(d)
        errors = self.instrument.uncertainty.errors
        share += self._alike(d) if errors is None else _from_place_to_place(errors, d)
        return np.asarray(self.depth_mm * np.sqrt(share), np.float32)

    def _alike(self, d: Float64) -> Float64:
        """Relative variance of depths by a calibration's errors that are the same all over the picture. (H, W)."""
        rectified, share = self.instrument.rectified, np.zeros(d.shape)
        g = (1 / rectified.f_px, 1 / rectified.baseline_mm, 1 / d)
        for row, first in zip(self.instrument.uncertainty.covariance, g, strict=True):
            for value, second in zip(row, g, strict=True):
                share = share + value * first * second
        return share

    @property
    def _disparity_px(self) -> Float32:
        return self.match.estimate.disparity_px

    def points(self) -> tuple[Float64, UInt8]:
        """Points that stand before the camera, but those whose depth is known to 10 % only, or worse.

        Returns
        -------
        points_mm : (N, 3) float64
            In the rectified left camera's frame: x right, y down, z forward.
        colors_rgb : (N, 3) uint8
        """
        kept: Bools = np.isfinite(self.depth_mm)
        if self.std_mm is not None:
            kept &= np.nan_to_num(self.std_mm, nan=np.inf) < _MOST_STD * np.nan_to_num(self.depth_mm)
        row, column = np.nonzero(kept)
        rays = pixel_rays(column.astype(float), row.astype(float), self.instrument.rectified)
        color = self.left if self.left.ndim == 3 else np.repeat(self.left[..., None], 3, axis=2)
        return rays * self.depth_mm[row, column, None].astype(float), np.asarray(color[row, column, ::-1])


def measure_depth(
    left: UInt8,
    right: UInt8,
    instrument: Instrument,
    pipeline: str = "best",
    num_disparities: int | None = None,
    *,
    filled: bool = False,
) -> DepthMap:
    """Rectify and match a pair, and tell its depths.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8
        As the cameras gave them.
    instrument : Instrument
    pipeline, num_disparities
        As for `stereolib.matching.stereo_pipeline`; None takes the range that a rough match of the pair tells.
    filled : bool
        Give a depth to pixels that were filled by a guess, too.

    Returns
    -------
    DepthMap

    Raises
    ------
    ValueError
        If pictures and calibration do not fit together (with "best", whose rows are corrected, by more than 0.6 % of
        the width), left and right are exchanged, a picture shows nothing, or nothing was matched.
    """
    check_matchable(left, right)
    instrument = moved_back(left, right, instrument)
    rectified = instrument.rectified
    pair = rectified.rectify(left, right)
    limit_px = max(_ROWS_PX, MOST_OFF * left.shape[1]) if pipeline == "best" else _ROWS_PX
    match = match_checked(
        *pair, pipeline, num_disparities, limit_px=limit_px, exchanged=lambda: rectified.rectify(right, left)
    )
    return DepthMap(match, pair[0], instrument, filled)


def _from_place_to_place(errors: DisparityErrors, d: Float64) -> Float64:
    """Relative variance of depths by a calibration's errors, of disparities (H, W); NaN stays."""
    from scipy.interpolate import RegularGridInterpolator

    known = np.isfinite(d)
    if not known.any():
        return d
    low, high = float(d[known].min()), float(d[known].max())
    disparities = np.geomspace(low, max(high, 1.01 * low), _DISPARITIES)
    rows, columns = (np.linspace(0, n - 1, max(2, -(-n // _APART_PX) + 1)) for n in d.shape)
    v, u, at = np.meshgrid(rows, columns, disparities, indexing="ij")
    inside = np.maximum(u, at)  # else the right camera does not see it
    points = errors.rectified.triangulate(np.stack([inside.ravel(), v.ravel()], axis=1), at.ravel())
    std = np.linalg.norm(errors.of_points(inside.ravel(), v.ravel(), at.ravel())[:, 2], axis=1) / points[:, 2]
    between = RegularGridInterpolator((rows, columns, np.log(disparities)), np.log(std + _LEAST).reshape(at.shape))
    out = np.full(d.shape, np.nan)
    within = np.clip(np.log(d[known]), np.log(disparities[0]), np.log(disparities[-1]))
    out[known] = np.exp(2 * between(np.column_stack([*np.nonzero(known), within])))
    return out


def whole_mm(depth_mm: Floats) -> npt.NDArray[np.uint16]:
    """Turn a depth map into whole millimetres, as a depth picture of 16 bits has them.

    Parameters
    ----------
    depth_mm : (H, W) float, mm

    Returns
    -------
    (H, W) uint16, mm
        0 where there is no depth above 0, or one beyond 65,535 mm.

    References
    ----------
    ROS REP 118, depth images.

    Examples
    --------
    >>> whole_mm(np.array([[700.4, np.nan, 1e6]])).tolist()
    [[700, 0, 0]]
    """
    whole = np.rint(np.nan_to_num(depth_mm, nan=0.0))
    return np.where((whole >= 0) & (whole <= np.iinfo(np.uint16).max), whole, 0).astype(np.uint16)
