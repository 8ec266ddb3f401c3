"""OpenCV's semi-global block matching: its settings, refused where it would round them or run over, and its answer."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, cast

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Float32, UInt8
from stereolib.rig import RectifiedRig

STEPS_PER_PX = 16  # OpenCV returns disparities in these steps
_MODES = {
    "sgbm": cv2.STEREO_SGBM_MODE_SGBM,
    "hh": cv2.STEREO_SGBM_MODE_HH,
    "3way": cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    "hh4": cv2.STEREO_SGBM_MODE_HH4,
}
_LARGEST = 32767  # OpenCV adds up costs in 16 bits
_LEAST_ROOM = 88  # grey levels; see SGBMParams.room
_FARTHEST_PX = 2047  # OpenCV returns disparities in 16 bits, too
_WIDEST = 1024  # disparities; more than any picture that fits a matcher's memory asks for


@dataclass(frozen=True)
class SGBMParams:
    """Parameters of `cv2.StereoSGBM`, checked; nothing is rounded silently.

    Parameters
    ----------
    num_disparities : int, px
        Width of the search window, a multiple of 16.
    block_size : int, px
        Odd edge of the matched block.
    min_disparity : int, px
        Where the search window begins.
    p1, p2 : int or None
        Penalties for a disparity step of one and of more pixels; None takes ``8 b^2`` and ``32 b^2``.
    disp12_max_diff : int, px
        Largest disagreement with the match from right to left, which OpenCV reads off the costs of that from left to
        right; -1 leaves the check out. OpenCV itself, whatever its reference says, takes 0 and -1 as 1.
    uniqueness_ratio : int, %
        By how much the best match must beat the second.
    speckle_window_size, speckle_range : int
        Patches smaller than this many pixels, whose disparities differ by less than the range, are removed.
    pre_filter_cap : int
        Clip of the prefiltered image's gradient, 1 to 63.
    mode : {"sgbm", "hh", "3way", "hh4"}
        Five paths, eight, three, four.

    Raises
    ------
    ValueError
        The text says which neighbouring values are valid.
    """

    num_disparities: int = 128
    block_size: int = 5
    min_disparity: int = 0
    p1: int | None = None
    p2: int | None = None
    disp12_max_diff: int = 1
    uniqueness_ratio: int = 10
    speckle_window_size: int = 100
    speckle_range: int = 2
    pre_filter_cap: int = 63
    mode: str = "sgbm"

    def __post_init__(self) -> None:
        for name, value in ((f.name, getattr(self, f.name)) for f in fields(self) if f.name != "mode"):
            if not (isinstance(value, int | np.integer) or (value is None and name in ("p1", "p2"))):
                raise ValueError(f"{name} must be a whole number, got {value!r}")
            if isinstance(value, np.integer):  # whose products may run over
                object.__setattr__(self, name, int(value))
        if self.mode not in _MODES:
            raise ValueError(f"unknown mode {self.mode!r}; choose one of {', '.join(_MODES)}")
        self._check_window_and_block()
        if not 0 <= self.uniqueness_ratio <= 100:
            raise ValueError(f"uniqueness_ratio is a percentage, got {self.uniqueness_ratio}")
        if not 1 <= self.pre_filter_cap <= 63:
            raise ValueError(f"pre_filter_cap must be 1 to 63, got {self.pre_filter_cap}")
        if self.speckle_window_size < 0 or self.speckle_range < 0:
            got = f"got {self.speckle_window_size} and {self.speckle_range}"
            raise ValueError(f"speckle_window_size and speckle_range must be 0 (no search for specks) or more, {got}")
        self._check_penalties()

    def _check_window_and_block(self) -> None:
        n, block = self.num_disparities, self.block_size
        if n < 16 or n % 16:
            below = max(16, n // 16 * 16)
            near = f"near are {below}, {below + 16}"
            raise ValueError(f"num_disparities must be a positive multiple of 16, got {n}; {near}")
        if self.min_disparity < -_FARTHEST_PX or self.min_disparity + n - 1 > _FARTHEST_PX:
            got = f"got {self.min_disparity} to {self.min_disparity + n - 1}: take smaller pictures"
            raise ValueError(f"OpenCV knows disparities from {-_FARTHEST_PX} to {_FARTHEST_PX} px, {got}")
        if block < 1 or block % 2 == 0:
            below = max(1, block - 1)
            raise ValueError(f"block_size must be odd and at least 1, got {block}; near are {below}, {below + 2}")

    def _check_penalties(self) -> None:
        p1, p2 = self.penalties
        if not 0 < p1 < p2:
            raise ValueError(f"the penalties must satisfy 0 < p1 < p2, got p1={p1}, p2={p2}")
        if self.room < _LEAST_ROOM:
            most = _LARGEST - _LEAST_ROOM * self.block_size**2
            smaller = f"p2 up to {most} (and p1 below it), or " if most > 1 else ""
            left = f"{self.room:.0f} grey levels a pixel are left for a mismatch, {_LEAST_ROOM} are needed"
            advice = f"Take {smaller}a block of at most 15 with the usual penalties"
            why = f"OpenCV adds up costs in 16 bits, and {left}. {advice}"
            raise ValueError(f"block_size {self.block_size} with p2={p2} runs over: {why}")

    @classmethod
    def for_range(cls, rig: RectifiedRig, near_mm: float, far_mm: float = np.inf, **fields: Any) -> SGBMParams:
        """The smallest search window that holds everything between two depths.

        Parameters
        ----------
        rig : RectifiedRig
        near_mm, far_mm : float
            Depth along the left camera's optical axis, mm.
        **fields
            The other parameters.

        Returns
        -------
        SGBMParams

        Raises
        ------
        ValueError
            If not ``0 < near_mm < far_mm``, if so near a depth needs more than 1024 disparities (metres were given),
            or if the rig is not rectified.

        Notes
        -----
        ``d = f B / Z`` at both ends, and one pixel more on either side: a match at the window's end has no
        neighbour to be interpolated with.

        Examples
        --------
        >>> from stereolib.paper import paper_rig
        >>> params = SGBMParams.for_range(paper_rig().rectify(), near_mm=600, far_mm=1200)
        >>> params.min_disparity, params.num_disparities
        (58, 64)
        """
        if not 0 < near_mm < far_mm:
            raise ValueError(f"depths must satisfy 0 < near_mm < far_mm, got {near_mm:g} and {far_mm:g}")
        if not isinstance(rig, RectifiedRig):
            raise ValueError(f"for_range needs a RectifiedRig, got {type(rig).__name__}: pass rig.rectify()")
        largest, smallest = (rig.f_px * rig.baseline_mm / depth for depth in (near_mm, far_mm))
        first = int(np.floor(smallest)) - 1 if np.isfinite(far_mm) else 0
        count = int(np.ceil(largest)) + 2 - first
        if count > _WIDEST:
            raise ValueError(f"near_mm={near_mm:g} needs {count} disparities, more than {_WIDEST}: depths are in mm")
        return cls(num_disparities=-(-count // 16) * 16, min_disparity=first, **fields)

    @property
    def penalties(self) -> tuple[int, int]:
        """The penalties in force, ``8 b^2`` and ``32 b^2`` unless given."""
        area = self.block_size**2
        return 8 * area if self.p1 is None else self.p1, 32 * area if self.p2 is None else self.p2

    @property
    def room(self) -> float:
        """Mean cost of a pixel, grey levels, at which a block's cost and P2 together leave OpenCV's 16 bits.

        ``(32767 - P2) / b^2``. A pixel's cost is at most 63 from the grey values and twice `pre_filter_cap` from their
        gradients, so that nothing can run over from 189 on (block 11 with the usual penalties). Real mismatches cost
        less: with 88 recordings, the motorcycle pair and noisy pictures are as good as ever; with 81 (block 17) a dim
        picture has more than twice as many bad pixels, and from 59 on (block 19) all of them fall apart.
        """
        return (_LARGEST - self.penalties[1]) / self.block_size**2

    def matcher(self) -> cv2.StereoSGBM:
        """Make a `cv2.StereoSGBM` with these parameters.

        Returns
        -------
        cv2.StereoSGBM
        """
        p1, p2 = self.penalties
        return cv2.StereoSGBM.create(
            minDisparity=self.min_disparity,
            numDisparities=self.num_disparities,
            blockSize=self.block_size,
            P1=p1,
            P2=p2,
            disp12MaxDiff=self.num_disparities if self.disp12_max_diff < 0 else self.disp12_max_diff,
            preFilterCap=self.pre_filter_cap,
            uniquenessRatio=self.uniqueness_ratio,
            speckleWindowSize=self.speckle_window_size,
            speckleRange=self.speckle_range,
            mode=_MODES[self.mode],
        )


def check_window(params: SGBMParams, width_px: int) -> int:
    """Refuse a search window that the image cannot hold.

    Parameters
    ----------
    params : SGBMParams
    width_px : int
        The image's width, px.

    Returns
    -------
    int
        Where the window ends, px: so many columns at the left have no match inside the right image.

    Raises
    ------
    ValueError
        If the window and half a block are wider than the image.

    Examples
    --------
    >>> check_window(SGBMParams(num_disparities=128), 640)
    128
    """
    reach = max(0, params.min_disparity + params.num_disparities)
    if reach + params.block_size // 2 >= width_px:
        why = f"the image is {width_px} px wide and blocks are {params.block_size} px"
        advice = "reduce num_disparities, min_disparity or block_size"
        raise ValueError(f"the search window ends at {reach} px, {why}: {advice}")
    return reach


def match_in_steps(left: UInt8, right: UInt8, params: SGBMParams, *, whole: bool = False) -> npt.NDArray[np.int16]:
    """Match a grey pair and leave the disparities in OpenCV's steps, unchecked.

    Parameters
    ----------
    left, right : (H, W) uint8
    params : SGBMParams
    whole : bool
        As in `compute_disparity`.

    Returns
    -------
    (H, W) int16, 1/16 px
        Less than ``16 min_disparity`` where there is no match.
    """
    border = max(0, params.min_disparity + params.num_disparities) if whole else 0
    if border:
        left, right = (cast(UInt8, cv2.copyMakeBorder(i, 0, 0, border, 0, cv2.BORDER_REPLICATE)) for i in (left, right))
    steps: npt.NDArray[np.int16] = params.matcher().compute(left, right)[:, border:]
    if border:  # a match outside the right image is a match with the border's copies
        column = STEPS_PER_PX * np.arange(steps.shape[1])
        steps = np.where(steps > column, np.int16(STEPS_PER_PX * (params.min_disparity - 1)), steps)
    return steps


def match_pair(left: UInt8, right: UInt8, params: SGBMParams, *, whole: bool = False) -> Float32:
    """Match a grey pair, unchecked.

    Parameters
    ----------
    left, right : (H, W) uint8
    params : SGBMParams
    whole : bool
        As in `compute_disparity`.

    Returns
    -------
    (H, W) float32, px
        NaN where there is no match.
    """
    steps = match_in_steps(left, right, params, whole=whole)
    disparity: Float32 = steps * np.float32(1 / STEPS_PER_PX)
    np.putmask(disparity, steps < STEPS_PER_PX * params.min_disparity, np.nan)
    return disparity
