"""How far the rows of a rectified pair disagree: a rig that was knocked since its calibration.

First roughly, in quarter size; then, with the disparities known, to a few hundredths of a pixel over all that was
matched in half size. What chance matched differs between the two sizes, which tells that rows were not found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np

from stereolib.base import (
    Float32,
    Float64,
    Floats,
    Ints,
    UInt8,
    clustered_covariance,
    finite_array,
    median,
    set_frozen,
)
from stereolib.matching.levels import halved, levelled
from stereolib.matching.row_cells import RowCells
from stereolib.matching.sgbm import SGBMParams, match_pair
from stereolib.rig import check_pair, to_grey

#: A rough match, in half and in quarter size, from which rows and the range of disparities are told.
_HALF = SGBMParams(num_disparities=96, mode="3way")
_QUARTER = SGBMParams(num_disparities=64, mode="3way", speckle_window_size=25)
_ROOM_PX = 8  # beyond them, px of the half size
_NEAR = 0.03  # share of the matched pixels that must be nearer than the window for it to follow them
_ALIKE, _ALIKE_PX = 2 / 3, 2.0  # share of the matches that are the quarter size's, px of the half size: 0.8 and more
# of pairs whose rows agree to some pixels, however noisy; below 0.6 of what was matched by chance
_TRIES, _NEAR_PX, _PROBE_PX = 4, 1.0, 3.0  # to come to the rows; what is left then; how far a probe moves them
_LEVEL = 128.0  # of what is matched, grey levels
_LEAST_SIDE_PX = 96  # smaller pictures have no rows to compare

_CELL = 12  # px: its samples give one offset
_BLOCK = 4  # neighbouring cells, each way, that err together
_GRID_PX = 1 / 32  # to which OpenCV rounds where it looks a picture up
_STEPS, _ROUNDS = 2, 3  # warps, and rounds of weights after each
_TUKEY = 4.7 * 1.48
_LEAST_CELLS = 12
_LEAST_USED = 0.4  # share of a cell that must be matched
_LEAST_WEIGHT = 4.0  # of a cell: squared grey levels per px
_MOVED_PX, _CERTAIN = 0.3, 5.0  # an offset so large, in px and in standard deviations, is told
_SURE_STDS = 3.0  # a roll or zoom so many deviations from none counts by half,
_LEAST_ROLL, _LEAST_ZOOM = 1e-9, 1e-3  # and one that is no larger than this does, too
_AXIS = 0.02  # of a picture's width: standard deviation of a lens's axis from its middle, about which it is turned
_NOWHERE_PX = -9.0  # where a pixel stands that nothing was matched with
_UNKNOWN_PX = 3.0  # standard deviation where nothing tells


@dataclass(frozen=True, eq=False)
class RowOffset:
    """Rows of the right picture: what the left one shows in row v stands in row ``v + a + b u + c v`` there.

    Attributes
    ----------
    coefficients : (3,) float64
        b, c, a: px per px, px per px, px.
    covariance : (3, 3) float64
    centre : (u, v), px
        The picture's.
    is_rough : bool
        A zoom is then corrected in the rows alone: columns are matched as they are, and moved once it is well known.
    is_known : bool
        Something told it; else it is zero, to several px.
    cells : RowCells or None
        What it was fitted to; None where too little tells.
    """

    coefficients: Float64
    covariance: Float64
    centre: tuple[float, float]
    is_rough: bool = False
    is_known: bool = True
    cells: RowCells | None = None

    def __post_init__(self) -> None:
        set_frozen(self, coefficients=finite_array(self.coefficients, (3,), "coefficients"))
        set_frozen(self, covariance=finite_array(self.covariance, (3, 3), "covariance"))

    @cached_property
    def _middle(self) -> Float64:
        return np.array([*self.centre, 1.0])

    @property
    def offset_px(self) -> float:
        """Rows by which the right picture's middle is too low, px."""
        return float(self.coefficients @ self._middle)

    @property
    def std_px(self) -> float:
        """Standard deviation of what remains in the middle once it is corrected, px."""
        return float(np.sqrt(self._middle @ self.covariance @ self._middle))

    @property
    def roll_rad(self) -> float:
        """How far the right picture is turned, clockwise, rad."""
        return float(np.arctan(self.coefficients[0]))

    @cached_property
    def _turn(self) -> tuple[float, float]:
        """Roll and the zoom that is left beside it, each as far as it is no chance."""
        (b, c, _), (var_b, var_c, _) = self.coefficients, np.diag(self.covariance)
        roll = _surely(b, var_b, _LEAST_ROLL)
        return roll, 0.0 if self.is_rough else _surely(c - _shortened(roll), var_c, _LEAST_ZOOM)

    @property
    def zoom(self) -> float:
        """By what share the right picture is larger than the left one; 0 where it may be chance."""
        return self._turn[1]

    @property
    def columns_std_px(self) -> float:
        """Standard deviation of a shift of all columns that is left: a camera turns about its axis, not the middle."""
        return float(np.hypot(*self._turn)) * _AXIS * 2 * self.centre[0]

    @property
    def warp(self) -> Float64:
        """Affine matrix (2, 3) that takes pixels of the corrected picture to those of the right one.

        Rows that rise along the picture are a roll, which shears the columns about the middle as much; rows that grow
        apart are a lens with another focus, which stretches the columns about the middle as much.
        """
        (b, c, a), (roll, zoom) = self.coefficients, self._turn
        wider = _shortened(roll) + zoom
        return np.array([[1.0 + wider, -roll, roll * self.centre[1] - wider * self.centre[0]], [b, 1.0 + c, a]])

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to tell of rows that disagree; nothing where they hardly do, or it is not certain."""
        std_b, std_c = np.sqrt(np.diag(self.covariance)[:2])
        moved, said = [], []
        if _is_told(self.offset_px, self.std_px):
            moved.append(
                f"the rows of right are {abs(self.offset_px):.1f} px too {'low' if self.offset_px > 0 else 'high'}"
            )
        if _is_told(self.coefficients[0] * self.centre[0], std_b * self.centre[0]):
            moved.append(f"right is turned by {np.degrees(abs(self.roll_rad)):.1f} degrees")
        if moved:
            why = "the rig has moved since its calibration or, if nothing fixed it, between the two pictures"
            weak = "or the calibration is no better, if pairs that it was made of say so, too"
            said.append(f"{' and '.join(moved)}, corrected here: {why}, {weak}; if more pairs do, calibrate again")
        if _is_told(self.zoom * self.centre[1], std_c * self.centre[1]):
            which = "larger" if self.zoom > 0 else "smaller"
            why = "the focus of a lens is another one than at the calibration (autofocus?)"
            then = "evened out here, but what is measured may be off by as much: fix the focus, and calibrate again"
            said.append(f"right is {100 * abs(self.zoom):.1f} % {which} than left: {why}; {then}")
        return tuple(said)

    def doubled(self) -> RowOffset:
        """Tell the same offset in a picture of twice the size.

        Returns
        -------
        RowOffset
        """
        to = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.5, -0.5, 2.0]])  # v' = 2 v + 1/2 in the larger one
        centre = (2 * self.centre[0] + 0.5, 2 * self.centre[1] + 0.5)
        coefficients, covariance, cells = to @ self.coefficients, to @ self.covariance @ to.T, self.cells
        return RowOffset(coefficients, covariance, centre, self.is_rough, self.is_known, cells and cells.doubled())

    def after(self, first: RowOffset) -> RowOffset:
        """Add an offset that had been corrected before this one was measured.

        Parameters
        ----------
        first : RowOffset

        Returns
        -------
        RowOffset
            What takes pixels of the twice corrected picture to the right one as it came; with the cells of this one.
        """
        rounding = np.diag([0.0, 0.0, 2 * _GRID_PX**2 / 12])  # of either correction
        both = _one_warp(self, first)[1] - [0.0, 1.0, 0.0]
        return RowOffset(both, self.covariance + rounding, self.centre, is_known=self.is_known, cells=self.cells)

    def correct(self, right: UInt8) -> UInt8:
        """Shift the rows of the right picture to those of the left one.

        Parameters
        ----------
        right : (H, W) or (H, W, 3) uint8
            Rectified.

        Returns
        -------
        uint8, shaped like `right`
            Beyond its border, the border's grey.
        """
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(
            cv2.warpAffine(right, self.warp, right.shape[1::-1], flags=flags, borderMode=cv2.BORDER_REPLICATE)
        )


def find_rows(left: UInt8, right: UInt8) -> tuple[RowOffset, Float32]:
    """Match a rectified pair roughly, and tell how far its rows disagree.

    Parameters
    ----------
    left, right : (H, W) or (H, W, 3) uint8

    Returns
    -------
    rows : RowOffset
        Of the whole pictures. Zero, to several px, where too little was matched, all by chance as in pictures whose
        rows are off by 3 % of their height or that are exchanged, or a side is shorter than 96 px.
    disparity_px : (H / 2, W / 2) float32
        Of the left picture in half size, in pixels of it; NaN where nothing was matched.

    Raises
    ------
    ValueError
        If they are no pair.

    Notes
    -----
    The rows are measured in quarter size first, where they are off by less than a pixel; then in half size, where the
    disparities come from too. Of rows that are off by more the quarter size tells a part: then both matchings disagree,
    and what was told is corrected and all measured again. Where they always do, as before walls that show nothing, the
    rows are known if they are found again when they are moved by 3 px.
    """
    check_pair(left, right)
    grey = to_grey(left), to_grey(right)
    if min(left.shape[:2]) < _LEAST_SIDE_PX:
        return _unknown(left.shape), np.full(halved(grey[0]).shape, np.nan, np.float32)
    rows, half_px, is_alike = _search(*grey)
    if is_alike:
        return rows, half_px
    if settled := _settle(*grey, rows):
        return settled
    return rows if _is_followed(*grey, rows) else _unknown(left.shape), half_px


def _settle(left: UInt8, right: UInt8, rows: RowOffset) -> tuple[RowOffset, Float32] | None:
    """Rows and disparities from rows that are a part of the way; None where nothing leads on."""
    for _ in range(_TRIES):
        before = rows
        more, half_px, is_alike = _search(left, before.correct(right))
        rows, is_near = more.after(before), abs(more.offset_px) < _NEAR_PX
        if is_alike and is_near:
            return rows, _moved(half_px, _one_warp(more, before)[0] - rows.warp[0])
        if is_near:
            break
    return None


def _is_followed(left: UInt8, right: UInt8, rows: RowOffset) -> bool:
    """Whether rows that were moved on purpose, to either side, are found where they are; chance stays where it was."""
    for probe_px in (-_PROBE_PX, _PROBE_PX):
        beside = replace(rows, coefficients=rows.coefficients - np.array([0.0, 0.0, probe_px]))
        if not abs(_search(left, beside.correct(right))[0].offset_px - probe_px) < _NEAR_PX:
            return False
    return True


def _search(left: UInt8, right: UInt8) -> tuple[RowOffset, Float32, bool]:
    """Rows and disparities in half size of grey pictures, and whether both sizes were matched alike."""
    first, second = (_even(halved(halved(image))) for image in (left, right))
    roughly = match_pair(first, second, _narrow(_QUARTER, first), whole=True)
    rough = replace(measure_rows(first, second, roughly).doubled().doubled(), is_rough=True)
    first, second = (_even(halved(image)) for image in (left, rough.correct(right)))
    small = match_pair(first, second, _narrow(_window(roughly), first), whole=True)
    rows = measure_rows(first, second, small).doubled().after(rough)
    return rows, _moved(small, rough.warp[0] - rows.warp[0]), _are_alike(roughly, small)


def _are_alike(quarter_px: Float32, half_px: Float32) -> bool:
    """Whether most of what was matched in half size was matched so in quarter size, too; by chance few are."""
    expected = 2 * cv2.resize(quarter_px, half_px.shape[::-1], interpolation=cv2.INTER_NEAREST)
    alike, matched = np.abs(half_px - expected) < _ALIKE_PX, np.isfinite(half_px)
    return bool(np.count_nonzero(alike) > _ALIKE * np.count_nonzero(matched))


def _one_warp(rows: RowOffset, first: RowOffset) -> Float64:
    """Matrix (3, 3) that takes pixels of a picture corrected by `first`, then by `rows`, to those as it came."""
    warps = (np.vstack([each.warp, [0.0, 0.0, 1.0]]) for each in (first, rows))
    return np.asarray(np.matmul(*warps))


def _moved(half_px: Float32, columns: Float64) -> Float32:
    """Disparities in half size when columns of the right picture, whole size, are moved by ``a x + b y + c``."""
    v, u = (np.arange(size, dtype=np.float32) for size in half_px.shape)
    a, b, c = columns.astype(np.float32)
    return np.asarray(half_px - a * (u - half_px) - (b * v)[:, None] - (c + (a + b) / 2) / 2)


def measure_rows(left: UInt8, right: UInt8, disparity_px: Float32) -> RowOffset:
    """Row offset of a matched pair.

    Parameters
    ----------
    left, right : (H, W) uint8
        Of one exposure.
    disparity_px : (H, W) float32, px
        NaN where nothing was matched.

    Returns
    -------
    RowOffset
        Zero, to several px, where too little was matched.

    Notes
    -----
    ``e = R(u - d, v + dv) - L(u, v)`` has the slopes Lu and Lv. In each cell of pixels the disparity may err by a shift
    of its own; without it, ``dv = -(S_ve - S_uv S_ue / S_uu) / (S_vv - S_uv^2 / S_uu)`` of sums S over the cell. A
    plane through the cells' offsets, with Tukey's weights, is the next ``dv``.
    """
    height, width = left.shape
    cells = _Cells.of(left, right, disparity_px)
    if len(cells.weight) < _LEAST_CELLS:
        return _unknown(left.shape)
    plane = np.zeros(3)
    try:
        for _ in range(_STEPS):
            plane, *residuals = cells.plane(offsets := cells.offsets(plane))
        covariance = cells.covariance(*residuals)
    except np.linalg.LinAlgError:  # all that tells it stands in one place
        return _unknown(left.shape)
    return RowOffset(plane, covariance, ((width - 1) / 2, (height - 1) / 2), cells=cells.told(offsets))


def _surely(value: float, variance: float, least: float) -> float:
    """A value as far as it is no chance: all of it where it is much larger than its deviation, none where smaller."""
    return float(value**5 / (value**4 + (_SURE_STDS**2 * variance + least**2) ** 2))


def _shortened(roll: float) -> float:
    """By what share a turn shortens what lies along the rows."""
    return float(np.sqrt(max(1.0 - roll**2, 0.0)) - 1.0)


def _is_told(off_px: float, std_px: float) -> bool:
    return abs(off_px) >= max(_MOVED_PX, _CERTAIN * std_px)


def _unknown(shape: tuple[int, ...]) -> RowOffset:
    height, width = shape[:2]
    unknown = np.diag([_UNKNOWN_PX / width, _UNKNOWN_PX / height, _UNKNOWN_PX])
    return RowOffset(np.zeros(3), unknown**2, ((width - 1) / 2, (height - 1) / 2), is_known=False)


def _window(quarter_px: Float32) -> SGBMParams:
    """How the half size is matched: with a window that holds what is near, as the quarter size saw it."""
    near = 2 * float(np.nanquantile(quarter_px, 1 - _NEAR)) if np.isfinite(quarter_px).any() else 0.0
    return replace(_HALF, num_disparities=max(_HALF.num_disparities, 16 * -(-int(near + _ROOM_PX) // 16)))


def _narrow(params: SGBMParams, image: UInt8) -> SGBMParams:
    """The same with a window that a small picture holds."""
    most = (image.shape[1] - params.block_size) // 16 * 16
    return replace(params, num_disparities=max(16, min(params.num_disparities, most)))


def _even(image: UInt8) -> UInt8:
    """What is matched of a picture: levelled, so that exposures no longer differ."""
    return np.asarray(levelled(image) + _LEVEL).clip(0, 255).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class _Cells:
    """Sums over cells of a matched pair, for the N cells that tell something.

    `x` is where each pixel of the left picture stands in the right one, `slopes` are the left one's along u and v, 0
    where nothing was matched, `shape` is (columns, rows) of cells, `some` numbers those that tell something. They stand
    at the first two columns of `at` in the right picture, the third is 1, and in the columns `left_u_px` of the left
    one. `here` is 1 where the left one has a slope along u, and `share` its mean in each cell.
    """

    left: UInt8
    right: UInt8
    x: Floats
    slopes: tuple[Floats, Floats]
    shape: tuple[int, int]
    some: Ints
    oblique: Floats
    weight: Float64
    at: Float64
    left_u_px: Float64
    here: Floats
    share: Floats

    @classmethod
    def of(cls, left: UInt8, right: UInt8, disparity_px: Float32) -> _Cells:
        height, width = left.shape
        x = np.arange(width, dtype=np.float32) - disparity_px
        cv2.patchNaNs(x, _NOWHERE_PX)
        used = ((x > 1) & (x < width - 2)).astype(np.float32)
        soft = [np.asarray(cv2.blur(image, (3, 3))) for image in (left, right)]
        along, down = (cv2.Sobel(soft[0], cv2.CV_32F, i, 1 - i, ksize=1, scale=0.5) * used for i in (1, 0))
        shape = width // _CELL, height // _CELL
        uu, uv, vv = (_mean(a, shape) for a in (along * along, along * down, down * down))
        oblique, share = uv / np.maximum(uu, 1e-6), _mean(used, shape)
        weight = np.asarray(np.where(share < _LEAST_USED, 0, vv - oblique * uv), float).ravel()
        columns, in_left = (
            (_mean(a * used, shape) / np.maximum(share, 1e-6)).ravel() for a in (x, np.arange(width, dtype=np.float32))
        )
        rows = np.repeat((np.arange(shape[1]) + 0.5) * height / shape[1] - 0.5, shape[0])
        some = np.flatnonzero(weight > _LEAST_WEIGHT)
        at = np.stack([columns, rows, np.ones(rows.size)], axis=1).astype(np.float64)[some]
        here = (along != 0).astype(np.float32)
        share = np.maximum(_mean(here, shape), 1e-6).ravel()[some]
        left_u_px = in_left[some].astype(np.float64)
        return cls(soft[0], soft[1], x, (along, down), shape, some, oblique, weight[some], at, left_u_px, here, share)

    def offsets(self, plane: Float64) -> Float64:
        """Row offset of each cell, (N,), the pictures being compared at a plane that is nearly right."""
        (b, c, a), v = plane.astype(np.float32), np.arange(len(self.left), dtype=np.float32)[:, None]
        shift = np.rint((b * self.x + c * v + a) / _GRID_PX) * np.float32(_GRID_PX)  # as OpenCV does it
        seen = cv2.remap(self.right, self.x, v + shift, cv2.INTER_LINEAR)
        error = cv2.subtract(seen, self.left, dtype=cv2.CV_32F)
        by_u, by_v = (_mean(slope * error, self.shape) for slope in self.slopes)
        mean = _mean(shift * self.here, self.shape).ravel()[self.some] / self.share
        return mean - (by_v - self.oblique * by_u).ravel()[self.some] / self.weight

    def plane(self, offsets: Float64) -> tuple[Float64, Float64, Float64]:
        """Plane (3,) through the cells' offsets; their residuals, and squared over that where Tukey's weights end."""
        plane, weight = np.linalg.lstsq(self.at, offsets, rcond=None)[0], np.sqrt(self.weight)
        for _ in range(_ROUNDS):
            rest = offsets - self.at @ plane
            off = (rest / max(_TUKEY * median(np.abs(rest)), 0.01)) ** 2
            scaled = (self.at * (np.maximum(1 - off, 0) ** 2 * weight)[:, None]).T
            plane = np.linalg.solve(scaled @ self.at, scaled @ offsets)
        return np.asarray(plane), rest, off

    def covariance(self, rest: Float64, off: Float64) -> Float64:
        """Covariance (3, 3) of a plane that left these residuals."""
        root, weight = np.maximum(1 - off, 0), np.sqrt(self.weight)
        return clustered_covariance(self.at, rest, root**2 * weight, self.block, root * (1 - 5 * off) * weight)

    @property
    def block(self) -> Ints:
        """Number of the block of cells that err together. (N,)."""
        column, row = self.some % self.shape[0] // _BLOCK, self.some // self.shape[0] // _BLOCK
        return np.asarray(row * self.shape[0] + column)

    def told(self, offsets: Float64) -> RowCells:
        """What the cells tell, in all."""
        return RowCells(self.at[:, :2], self.left_u_px, offsets, np.sqrt(self.weight), self.block)


def _mean(values: Floats, shape: tuple[int, int]) -> Floats:
    """Mean over each of so many (columns, rows) cells."""
    return np.asarray(cv2.resize(values, shape, interpolation=cv2.INTER_AREA))
